"""Sides of triangles, each once, and choices among them that do not interfere."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tidemesh.improve import _kernels


@dataclass(frozen=True, eq=False)
class Sides:
    """Every side of a mesh once."""

    one: np.ndarray
    """(n,) a triangle of the side."""
    other: np.ndarray
    """(n,) the other triangle, -1 on the boundary."""
    start: np.ndarray
    """(n,) node; the side runs counter-clockwise about ``one``."""
    end: np.ndarray
    """(n,) node."""
    apex: np.ndarray
    """(n,) node of ``one`` opposite the side."""

    @classmethod
    def of(cls, triangles: np.ndarray, n_points: int) -> Sides:
        """All sides of a mesh, in the order of the triangles."""
        neighbours = _kernels.find_neighbours(triangles, n_points)
        own = np.arange(len(triangles))[:, None]
        one, corner = np.nonzero((neighbours > own) | (neighbours < 0))
        return cls(
            one,
            neighbours[one, corner],
            triangles[one, (corner + 1) % 3],
            triangles[one, (corner + 2) % 3],
            triangles[one, corner],
        )

    def where(self, mask: np.ndarray) -> Sides:
        """Return the sides that a mask or an index array selects."""
        return Sides(
            self.one[mask],
            self.other[mask],
            self.start[mask],
            self.end[mask],
            self.apex[mask],
        )

    def far_apex(self, triangles: np.ndarray) -> np.ndarray:
        """(n,) node of ``other`` opposite the side; meaningless on the boundary."""
        return triangles[self.other].sum(axis=1) - self.start - self.end

    def length(self, points: np.ndarray) -> np.ndarray:
        """(n,) m."""
        step = points[self.end] - points[self.start]
        return np.hypot(step[:, 0], step[:, 1])


def best_nodes(score: np.ndarray, sides: Sides) -> np.ndarray:
    """Nodes with a positive score above that of every neighbour.

    Of two equal neighbours the one that comes first wins: no two winners are
    neighbours.
    """
    start, end = sides.start, sides.end
    start_wins = (score[start] > score[end]) | (
        (score[start] == score[end]) & (start < end)
    )
    beaten = np.zeros(len(score), dtype=bool)
    beaten[np.where(start_wins, end, start)] = True
    return (score > 0.0) & ~beaten


def best_sides(score: np.ndarray, sides: Sides, n_triangles: int) -> np.ndarray:
    """Inner sides with a positive score above all others of both their triangles.

    Of equal sides the one that comes first wins: no two winners share a triangle.
    """
    candidate = np.flatnonzero((score > 0.0) & (sides.other >= 0))
    ranked = candidate[np.lexsort((candidate, -score[candidate]))]
    rank = np.arange(len(ranked))
    best = np.full(n_triangles, len(ranked))
    np.minimum.at(best, sides.one[ranked], rank)
    np.minimum.at(best, sides.other[ranked], rank)
    winners = (best[sides.one[ranked]] == rank) & (best[sides.other[ranked]] == rank)
    result = np.zeros(len(score), dtype=bool)
    result[ranked[winners]] = True
    return result
