"""Hierarchy of polyline segments: binary trees over arc length, level by level."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from tidemesh.errors import InputError

MAXIMUM_LEVELS = 40
ROUNDING = 1e-6


def divide_lines(
    start: np.ndarray,
    end: np.ndarray,
    size_at: Callable[[np.ndarray], np.ndarray],
    *,
    rule: str = "graded",
    minimum_length: float = 0.0,
) -> np.ndarray:
    """Divide runs of a line into halves until every piece suits its target size.

    Parameters
    ----------
    start, end : (n,) float arrays
        m, arc lengths at the ends of the runs, ``end > start``.
    size_at : callable
        Target size at the points of the line with given arc lengths: (k,) -> (k,) m.
        It is asked at the middle of a piece, where the perpendicular bisector of the
        piece meets the line.
    rule : {"graded", "strict", "balanced"}
        "strict": choose a piece shorter than its target. The others: choose it below
        twice the target, and halve it once more above 4/3 of the target.
    minimum_length : float
        m, pieces whose halves would be shorter are chosen whatever the target.

    Returns
    -------
    breaks : (m,) float array
        Arc lengths at the ends of all chosen pieces, ascending, each once.

    Notes
    -----
    Paper, section 3.5; docs/method.md, section 7.
    """
    start = np.asarray(start, dtype=np.float64)
    end = np.asarray(end, dtype=np.float64)
    limit = 1.0 + ROUNDING if rule == "strict" else 2.0 * (1.0 - ROUNDING)
    breaks = [start, end]
    for _ in range(MAXIMUM_LEVELS):
        if not len(start):
            return np.unique(np.concatenate(breaks))
        length, middle = end - start, 0.5 * (start + end)
        target = np.asarray(size_at(middle), dtype=np.float64)
        too_fine = 0.5 * length < minimum_length * (1.0 - ROUNDING)
        chosen = (length < limit * target) | too_fine
        if rule != "strict":
            halved = length > 4.0 / 3.0 * (1.0 + ROUNDING) * target
            breaks.append(middle[chosen & halved & ~too_fine])
        breaks.append(middle[~chosen])
        start, end = (
            np.stack([start[~chosen], middle[~chosen]], axis=1).ravel(),
            np.stack([middle[~chosen], end[~chosen]], axis=1).ravel(),
        )
    raise InputError(
        f"the size {target[~chosen][0]:.3g} m wanted on the boundary is beyond "
        f"{MAXIMUM_LEVELS} halvings: raise the smallest size"
    )
