"""How far points are from the boundary of a domain, and how fine it is there."""

from __future__ import annotations

import numpy as np
import shapely
from scipy.spatial import cKDTree

from tidemesh.datatypes import Domain


def inside(domain: Domain, points: np.ndarray) -> np.ndarray:
    """Whether points lie in the water: (n, 2) m -> (n,) bool."""
    polygon = shapely.Polygon(
        domain.rings[0].points, [ring.points for ring in domain.rings[1:]]
    )
    shapely.prepare(polygon)
    return shapely.contains_xy(polygon, points[:, 0], points[:, 1])


class NearBoundary:
    """Distance to the nearest boundary segment and the node spacing along it.

    Parameters
    ----------
    domain : Domain
    piece : float
        Segments are cut into pieces (m) no longer than this for the search; distances
        are to the segments themselves.
    """

    def __init__(self, domain: Domain, piece: float):
        starts = np.concatenate([ring.points for ring in domain.rings])
        ends = np.concatenate([np.roll(r.points, -1, axis=0) for r in domain.rings])
        spacing = np.concatenate([_smoothed_spacing(r.points) for r in domain.rings])
        self.segment_spacing = spacing

        length = np.hypot(*(ends - starts).T)
        count = np.maximum(np.ceil(length / piece), 1).astype(np.int64)
        parent = np.repeat(np.arange(len(starts)), count)
        number = np.arange(len(parent)) - np.repeat(np.cumsum(count) - count, count)
        step = (ends - starts)[parent] / count[parent, None]
        self._start = starts[parent] + number[:, None] * step
        self._step = step
        self._spacing = spacing[parent]
        self._tree = cKDTree(self._start + 0.5 * step)
        # The midpoint of a piece is farther than its nearest place by at most this.
        self._slack = 0.51 * float(np.hypot(*step.T).max())

    def query(self, points: np.ndarray, reach: float) -> tuple[np.ndarray, np.ndarray]:
        """Distance and boundary spacing (m) at points; infinite farther than reach.

        Parameters
        ----------
        points : (n, 2) float array

        Returns
        -------
        distance, spacing : (n,) float arrays
        """
        distance = np.full(len(points), np.inf)
        spacing = np.full(len(points), np.inf)
        near = np.flatnonzero(self._may_be_near(points, reach))
        # The nearest midpoint need not belong to the nearest piece: look at a few.
        k = min(4, len(self._start))
        gap, index = self._tree.query(
            points[near], k=k, distance_upper_bound=reach + self._slack
        )
        gap, index = gap.reshape(len(near), k), index.reshape(len(near), k)
        found = np.isfinite(gap[:, 0])
        near, index = near[found], index[found]
        # Missing neighbours carry the index n: repeat the nearest instead.
        index = np.where(index == len(self._start), index[:, :1], index)
        to_piece = self._distance(points[near, None, :], index)
        best = np.argmin(to_piece, axis=1)
        rows = np.arange(len(near))
        distance[near] = to_piece[rows, best]
        spacing[near] = self._spacing[index[rows, best]]
        return distance, spacing

    def _distance(self, points: np.ndarray, piece: np.ndarray) -> np.ndarray:
        step = self._step[piece]
        offset = points - self._start[piece]
        square = np.maximum((step * step).sum(axis=-1), 1e-300)
        along = np.clip((offset * step).sum(axis=-1) / square, 0.0, 1.0)
        return np.hypot(*np.moveaxis(offset - along[..., None] * step, -1, 0))

    def _may_be_near(self, points: np.ndarray, reach: float) -> np.ndarray:
        """Points in or beside a square of side `reach` that holds a piece."""
        side = reach + 2.0 * self._slack
        low = self._start.min(axis=0) - 2.0 * side
        shape = ((self._start.max(axis=0) - low) / side).astype(np.int64) + 4
        marked = np.zeros(tuple(shape), dtype=bool)
        i, j = ((self._start - low) / side).astype(np.int64).T
        for di in (-1, 0, 1):
            for dj in (-1, 0, 1):
                marked[i + di, j + dj] = True
        cell = np.floor((points - low) / side).astype(np.int64)
        known = ((cell >= 0) & (cell < shape)).all(axis=1)
        near = np.zeros(len(points), dtype=bool)
        near[known] = marked[tuple(cell[known].T)]
        return near


def _smoothed_spacing(ring: np.ndarray) -> np.ndarray:
    """Mean length of each segment and its two neighbours."""
    # One short segment that the coast forces does not call for fine points around it.
    length = np.hypot(*(np.roll(ring, -1, axis=0) - ring).T)
    return (np.roll(length, 1) + length + np.roll(length, -1)) / 3.0
