"""Sizes that grow off the boundary no faster than the boundary's own segments allow."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.spatial import cKDTree

Spacing = Callable[[np.ndarray], np.ndarray]
# A segment this much shorter than its target counts as finer than asked for.
FINER = 0.9


def graded_lengths(
    points: np.ndarray, length: np.ndarray, gradation: float
) -> np.ndarray:
    """Lower lengths at scattered points until they differ by no more than a slope.

    Parameters
    ----------
    points : (n, 2) float array
        m.
    length : (n,) float array
        m, positive.
    gradation : float
        Largest difference of two lengths per metre between their points.

    Returns
    -------
    graded : (n,) float array
        ``min over j of length[j] + gradation * |x - x_j|``, the nearest point of
        every octave of lengths taken for all of that octave.
    """
    graded = np.array(length, dtype=np.float64)
    if not len(graded):
        return graded
    octave = np.floor(np.log2(graded / graded.min())).astype(np.int64)
    reach = (graded.max() - graded.min()) / gradation
    for number in range(int(octave.max())):
        source = np.flatnonzero((octave == number) & (graded >= 0.999 * length))
        if not len(source):
            continue
        coarser = np.flatnonzero(octave > number)
        near = min(8, len(source))
        distance, place = cKDTree(points[source]).query(
            points[coarser], k=near, distance_upper_bound=reach
        )
        reachable = np.append(length[source], np.inf)[place]
        limit = (reachable + gradation * distance).reshape(len(coarser), -1)
        graded[coarser] = np.minimum(graded[coarser], limit.min(axis=1))
    return graded


class BoundaryLimitedSpacing:
    """A size function that also respects the segments of a boundary.

    ``min(spacing(x), length + gradation * distance)`` with the length (graded along
    the boundary) at the nearest boundary point that is finer than its target.

    Parameters
    ----------
    spacing : callable
        Target size at points: (n, 2) m -> (n,) m.
    points : (n, 2) float array
        m, boundary points.
    length : (n,) float array
        m, length of the boundary segments there.
    gradation : float
        Growth of the size per metre off the boundary.
    """

    def __init__(
        self,
        spacing: Spacing,
        points: np.ndarray,
        length: np.ndarray,
        gradation: float,
    ) -> None:
        self._spacing = spacing
        self._gradation = gradation
        graded = graded_lengths(points, length, gradation)
        finer = graded < FINER * np.asarray(spacing(points), dtype=np.float64)
        self._length = graded[finer]
        self._tree = cKDTree(points[finer]) if finer.any() else None

    def __call__(self, points: np.ndarray) -> np.ndarray:
        """Size at points: (n, 2) m -> (n,) m."""
        size = np.asarray(self._spacing(points), dtype=np.float64)
        if self._tree is None or not len(size):
            return size
        reach = (size.max() - self._length.min()) / self._gradation
        if reach <= 0.0:
            return size
        distance, place = self._tree.query(points, distance_upper_bound=reach)
        limit = np.append(self._length, np.inf)[place] + self._gradation * distance
        return np.minimum(size, limit)
