"""Whole files or none, and their fingerprints."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from tidemesh.errors import FormatError, InputError


@contextmanager
def atomic(path: str | Path) -> Iterator[Path]:
    """Write a file beside its place and move it there when it is complete.

    Yields the temporary path (same suffix). An exception inside the block, Ctrl-C
    included, removes the temporary file and leaves an older file untouched.

    Raises
    ------
    InputError
        If the folder is missing or cannot be written to, or the disc is full.

    Examples
    --------
    >>> with atomic("out/mesh.14") as temporary:  # doctest: +SKIP
    ...     temporary.write_text("...")
    """
    path = Path(path)
    if not path.parent.is_dir():
        raise InputError(
            f"{path}: the folder {path.parent} does not exist; create it or name "
            "another output"
        )
    if path.is_dir():
        raise InputError(f"{path}: is a folder, a file name was expected")
    # The process number keeps two runs into one folder apart.
    temporary = path.with_name(f".{path.stem}.{os.getpid()}.part{path.suffix}")
    try:
        # Found out before the work, not by the library that writes.
        with open(temporary, "wb"):
            pass
        yield temporary
        os.replace(temporary, path)
    except OSError as error:
        temporary.unlink(missing_ok=True)
        if error.filename not in (None, str(temporary), temporary, str(path)):
            raise
        raise InputError(
            f"{path}: cannot be written ({error.strerror or error}); check the "
            "permissions and the space left, or name another output"
        ) from error
    except BaseException:
        temporary.unlink(missing_ok=True)
        raise


def read_text(path: Path) -> str:
    """Text of a file in UTF-8, with or without a byte order mark.

    Raises
    ------
    InputError
        If there is no such file.
    FormatError
        If it is not text.
    """
    try:
        return path.read_text(encoding="utf-8-sig")
    except (FileNotFoundError, IsADirectoryError) as error:
        raise InputError(f"{path}: there is no such file") from error
    except UnicodeDecodeError as error:
        raise FormatError("is not a text file in UTF-8", path) from error


def sha256(path: str | Path) -> str:
    """SHA-256 of a file's content in hexadecimal digits.

    Raises
    ------
    InputError
        If the file cannot be read.
    """
    try:
        with open(path, "rb") as file:
            return hashlib.file_digest(file, "sha256").hexdigest()
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror})") from error
