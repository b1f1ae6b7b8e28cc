"""The errors that a caller may want to catch."""

from __future__ import annotations

import re
from pathlib import Path

_LONG_QUOTE = re.compile(r'"([^"]{120})[^"]{20,}"')


class TidemeshError(Exception):
    """Base of every error raised on purpose by this package."""


class InputError(TidemeshError):
    """The user's input cannot be used; the message names it, the place and a remedy."""


class FormatError(InputError):
    """A file does not follow its format.

    Parameters
    ----------
    message : str
        What was expected and what came.
    path : path, optional
        The file.
    line : int, optional
        Line number, counted from 1.
    """

    def __init__(
        self, message: str, path: str | Path | None = None, line: int | None = None
    ):
        self.path = None if path is None else Path(path)
        self.line = line
        place = "" if path is None else f"{path}: "
        place += "" if line is None else f"line {line}: "
        super().__init__(place + _legible(message))


def _legible(message: str) -> str:
    """A message that quotes a damaged file, fit for a terminal."""
    plain = "".join(c if c.isprintable() or c == "\n" else "?" for c in message)
    return _LONG_QUOTE.sub(r'"\1 ..."', plain)


class MeshError(TidemeshError):
    """A mesh is not valid, or cannot be made from what was given."""


class EngineError(TidemeshError):
    """A tide engine cannot run or gave no usable answer."""


class ConvergenceError(TidemeshError):
    """An iteration reached its bound before its tolerance."""
