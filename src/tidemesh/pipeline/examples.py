"""The cases that come with the package."""

from __future__ import annotations

import shutil
from pathlib import Path

import tidemesh
from tidemesh.errors import InputError


def examples_folder() -> Path:
    """Folder of the shipped cases: inside the installed package, or the checkout's."""
    package = Path(tidemesh.__file__).parent
    for folder in (package / "examples", package.parents[1] / "examples"):
        if folder.is_dir():
            return folder
    raise InputError("the shipped examples are not part of this installation")


def copy_example(name: str, folder: str | Path) -> Path:
    """Copy a shipped case and its data; returns the path of its case file.

    Raises
    ------
    InputError
        If there is no such example, or the folder already holds files of its name:
        nothing of the user's is overwritten.
    """
    source = examples_folder() / name
    folders = sorted(p.name for p in examples_folder().iterdir())
    known = [n for n in folders if (examples_folder() / n / f"{n}.toml").is_file()]
    if name not in known:
        raise InputError(f"no example {name}; there are: {', '.join(known)}")
    folder = Path(folder)
    files = [p for p in sorted(source.rglob("*")) if p.is_file() and _is_whole(p)]
    for path in files:
        target = folder / path.relative_to(source)
        if target.exists():
            raise InputError(f"{target} exists already; name an empty folder")
    try:
        for path in files:
            target = folder / path.relative_to(source)
            target.parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(path, target)
    except OSError as error:
        raise InputError(f"{folder} cannot be written: {error.strerror}") from None
    return folder / f"{name}.toml"


def _is_whole(path: Path) -> bool:
    """Whether a file is of use by itself: not a case on data from elsewhere."""
    return path.suffix != ".toml" or "../" not in path.read_text(encoding="utf-8")
