"""Write a figure to a file, the same bytes every time."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import matplotlib
from matplotlib.figure import Figure

from tidemesh.io.files import atomic

_STYLE = {
    "font.size": 10.0,
    "axes.titlesize": 11.0,
    "axes.grid": False,
    "axes.linewidth": 0.8,
    "savefig.facecolor": "white",
    "figure.facecolor": "white",
    # Else the names inside an SVG file are drawn by chance.
    "svg.hashsalt": "tidemesh",
}


def save_figure(
    path: str | Path,
    draw: Callable,
    *,
    size_inches: tuple[float, float] = (8.0, 7.0),
    dpi: int = 160,
) -> Path:
    """Draw one figure and save it.

    Parameters
    ----------
    path : path
        The ending chooses the format, for instance ".png".
    draw : function
        Called as ``draw(axis=axis)``; any figure of this room with its data bound, for
        instance by `functools.partial`.
    size_inches : (width, height)
    dpi : int

    Returns
    -------
    path : Path

    Notes
    -----
    Neither the user's matplotlib settings nor dates or versions enter the file.
    """
    path = Path(path)
    defaults = {
        key: value
        for key, value in matplotlib.rcParamsDefault.items()
        if not key.startswith(("backend", "interactive", "toolbar"))
    }
    with matplotlib.rc_context({**defaults, **_STYLE}):
        figure = Figure(figsize=size_inches, dpi=dpi, layout="constrained")
        draw(axis=figure.subplots())
        with atomic(path) as unfinished:
            figure.savefig(
                unfinished,
                format=path.suffix.lstrip(".") or "png",
                metadata=_anonymous(path.suffix),
            )
    return path


def _anonymous(suffix: str) -> dict[str, None]:
    names = {
        ".png": ("Software",),
        ".pdf": ("Creator", "Producer", "CreationDate"),
        ".svg": ("Creator", "Date"),
    }
    return dict.fromkeys(names.get(suffix.lower(), ()))
