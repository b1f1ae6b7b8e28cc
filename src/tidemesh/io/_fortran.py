"""Text as Fortran reads and writes it: records, list-directed values, numbers."""

from __future__ import annotations

import gzip
import logging
import math
import re
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO

import numpy as np

from tidemesh.errors import FormatError, InputError
from tidemesh.io.files import atomic

MOST_NODES = 200_000_000
"""More nodes than any mesh has: the number is damaged."""

logger = logging.getLogger(__name__)

_REAL = re.compile(
    r"([+-]?(?:\d+\.?\d*|\.\d+))(?:[eEdDqQ]([+-]?\d+)|([+-]\d+))?", re.ASCII
)
_PLAIN = re.compile(r"[+-]?\d+\.?\d*", re.ASCII)
_WHOLE = re.compile(r"[+-]?\d{1,18}", re.ASCII)
_REPEATED = re.compile(r"(\d{1,6})\*(.*)", re.ASCII | re.DOTALL)
_ITEM = re.compile(r"""\s*(,|/|'[^']*'|"[^"]*"|[^\s,/]+)""")


def read_bytes(path: Path) -> bytes:
    """The content of a file, decompressed if it is gzipped.

    Raises
    ------
    InputError
        If the file cannot be read.
    FormatError
        If the compressed file is damaged.
    """
    try:
        content = path.read_bytes()
    except FileNotFoundError as error:
        raise InputError(f"{path}: there is no such file") from error
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror})") from error
    return unpacked(content, path)


def unpacked(content: bytes, path: Path) -> bytes:
    """Content decompressed if it is gzipped.

    Raises
    ------
    FormatError
        If it is damaged.
    """
    if content[:2] != b"\x1f\x8b":
        return content
    try:
        return gzip.decompress(content)
    except (OSError, EOFError, zlib.error) as error:
        raise FormatError(f"the compressed file is damaged: {error}", path) from error


@contextmanager
def writing(path: Path) -> Iterator[BinaryIO]:
    """Write a file whole or not at all, compressed if its name ends in ".gz"."""
    with atomic(path) as temporary, open(temporary, "wb") as file:
        if path.suffix != ".gz":
            yield file
            return
        # No name and no time in the header: the same content gives the same bytes.
        with gzip.GzipFile("", "wb", 6, file, mtime=0) as packed:
            yield packed


def real(word: str) -> float:
    """A Fortran real number: D for E, or no letter before a signed exponent.

    Raises
    ------
    ValueError
        If the word is not a finite number.
    """
    found = _REAL.fullmatch(word)
    if found is None:
        raise ValueError(word)
    mantissa, exponent, bare = found.groups()
    value = float(f"{mantissa}e{exponent or bare or 0}")
    if not math.isfinite(value):
        raise ValueError(word)
    return value


def whole(word: str) -> int:
    """A Fortran integer.

    Raises
    ------
    ValueError
        If the word is not one.
    """
    if _WHOLE.fullmatch(word) is None:
        raise ValueError(word)
    return int(word)


def items(text: str, wanted: int) -> list[str | None]:
    """The first values of a record, as list-directed input finds them.

    Blanks and commas separate, ``3*0`` is three values, a slash ends the record, two
    commas enclose an absent value (None), an exclamation mark starts a comment.
    """
    found: list[str | None] = []
    separated = True
    for match in _ITEM.finditer(text):
        word = match.group(1)
        if word == "/" or len(found) >= wanted:
            break
        if word == ",":
            if separated:
                found.append(None)
            separated = True
            continue
        separated = False
        if word[0] in "'\"":
            found.append(word.strip("'\""))
            continue
        value = word.split("!", 1)[0]
        repeated = _REPEATED.fullmatch(value)
        if repeated is not None:
            count = min(int(repeated.group(1)), wanted)
            found += [repeated.group(2) or None] * count
        elif value:
            found.append(value)
        if value != word:
            break
    return found[:wanted]


def text_of(value: float) -> str:
    """The shortest text from which the same number is read."""
    return str(value) if isinstance(value, int) else repr(float(value))


class Records:
    """The lines of a text file, read one after another, as Fortran's records."""

    def __init__(self, path: Path, content: bytes):
        self.path = path
        # Bytes that are no text are carried through.
        text = content.decode("utf-8", errors="surrogateescape")
        self._lines = text.replace("\r\n", "\n").split("\n")
        self._ended = self._lines[-1] == ""
        if self._ended:
            self._lines.pop()
        self._next = 0

    @property
    def line(self) -> int:
        """Number of the line read last, counted from 1."""
        return self._next

    def error(self, message: str, line: int | None = None) -> FormatError:
        """An error at a line (default: the one read last)."""
        return FormatError(
            message, self.path, max(self._next, 1) if line is None else line
        )

    def peek(self) -> str | None:
        """The next line with text on it, left unread; None at the end."""
        for line in self._lines[self._next :]:
            if line.strip():
                return line
        return None

    def rest(self) -> str:
        """Everything that is left."""
        left = self._lines[self._next :]
        self._next = len(self._lines)
        return "\n".join(left)

    def warn_of_open_end(self) -> None:
        """Say that the last number may be cut off, where the last line has no end."""
        if not self._ended:
            logger.warning(
                "%s: line %d: the last line has no line end; if the file was cut off, "
                "its last number may be cut off too",
                self.path,
                len(self._lines),
            )

    def text(self, what: str) -> str:
        """The next line, blank or not, without a comment behind an exclamation mark."""
        if self._next >= len(self._lines):
            raise self.error(f"the file ends here; expected {what}")
        self._next += 1
        return self._lines[self._next - 1].split("!", 1)[0].strip()

    def raw(self, what: str) -> str:
        """The next line with text on it; Fortran skips blank ones between values."""
        while self._next < len(self._lines):
            self._next += 1
            if self._lines[self._next - 1].strip():
                return self._lines[self._next - 1]
        raise self.error(f"the file ends here; expected {what}")

    def values(self, what: str, kinds: str) -> list:
        """The values that the next line begins with.

        Parameters
        ----------
        what : str
            Their names, for the message.
        kinds : str
            One letter a value: "i" whole number, "r" real, "w" word.
        """
        text = self.raw(what)
        words = items(text, len(kinds))
        if None in words or len(words) < len(kinds):
            several = (
                f"{len(kinds)} values on one line" if len(kinds) > 1 else "a value"
            )
            raise self.error(f'expected {several} ({what}), got "{text.strip()}"')
        values: list = []
        for kind, word in zip(kinds, words):
            try:
                values.append(
                    word if kind == "w" else real(word) if kind == "r" else whole(word)
                )
            except ValueError as error:
                wanted = "a whole number" if kind == "i" else "a number"
                raise self.error(
                    f'expected {wanted} ({what}), got "{word}" in "{text.strip()}"'
                ) from error
        return values

    def integer(self, what: str) -> int:
        """The whole number that the next line begins with."""
        return self.values(what, "i")[0]

    def number(self, what: str) -> float:
        """The number that the next line begins with."""
        return self.values(what, "r")[0]

    def choice(self, what: str, allowed: tuple[int, ...], meaning: str = "") -> int:
        """A whole number out of a few."""
        value = self.integer(what)
        if value not in allowed:
            few = ", ".join(str(number) for number in allowed)
            raise self.error(f"expected {what} {few}{meaning}, got {value}")
        return value

    def count(self, what: str) -> int:
        """A whole number that is not negative."""
        value = self.integer(what)
        if value < 0:
            raise self.error(f"expected {what}, not negative, got {value}")
        return value

    def table(self, rows: int, columns: int, what: str) -> np.ndarray:
        """Numbers at the beginning of each of the next lines, (rows, columns)."""
        first = self._next
        block = self._lines[first : first + rows]
        words = [line.split(None, columns)[:columns] for line in block]
        if len(block) == rows and all(len(row) == columns for row in words):
            try:
                plain = np.array(words, dtype=np.float64).reshape(rows, columns)
            except ValueError:
                pass
            else:
                # Python reads 1_0 as ten, and what is not finite needs a message.
                if np.isfinite(plain).all() and not any("_" in row for row in block):
                    self._next += rows
                    return plain
        careful = [self.values(what, "r" * columns) for _ in range(rows)]
        return np.array(careful, dtype=np.float64).reshape(rows, columns)

    def rows_ahead(self, columns: int, not_as_many_as: int | None = None) -> int:
        """How many of the next lines begin with so many numbers (and not with more)."""
        count = 0
        for line in self._lines[self._next :]:
            if not line.strip():
                continue
            if not begins_with_numbers(line, columns):
                break
            if not_as_many_as and begins_with_numbers(line, not_as_many_as):
                break
            count += 1
        return count


def begins_with_numbers(text: str, columns: int) -> bool:
    """Whether a record begins with so many numbers."""
    plain = text.split(None, columns)[:columns]
    if len(plain) == columns and all(_PLAIN.fullmatch(word) for word in plain):
        return True
    words = items(text, columns)
    try:
        return len(words) == columns and all(
            word is not None and math.isfinite(real(word)) for word in words
        )
    except ValueError:
        return False
