"""Nodes removed and inserted, corners repaired; the boundary stays as it is."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tidemesh.improve import _kernels
from tidemesh.improve.settings import ImproveSettings


@dataclass(frozen=True, eq=False)
class Cleaned:
    """A mesh with some nodes gone and some new."""

    points: np.ndarray
    """(n_points, 2) m: kept nodes in their order, then new ones."""
    triangles: np.ndarray
    """(n_triangles, 3) counter-clockwise."""
    source: np.ndarray
    """(n_points,) node of the given mesh, -1 for a new node."""
    report: dict[str, float]
    """Nodes removed and inserted."""


def clean(
    points: np.ndarray,
    triangles: np.ndarray,
    fixed: np.ndarray,
    settings: ImproveSettings | None = None,
    *,
    size: np.ndarray,
) -> Cleaned:
    """Remove nodes of short sides and low valence, divide long sides.

    Parameters
    ----------
    points : (n_points, 2) float array
        m.
    triangles : (n_triangles, 3) int array
        Counter-clockwise.
    fixed : (n_points,) bool array
        Nodes that stay; those of the boundary must be among them.
    settings : ImproveSettings, optional
    size : (n_points,) float array
        m, target spacing at the nodes.

    Returns
    -------
    Cleaned
        No two removed nodes were neighbours, and no new node divides a side of a
        triangle that another change has touched.
    """
    settings = settings or ImproveSettings()
    points = np.array(points, dtype=np.float64)
    triangles = np.array(triangles, dtype=np.int64)
    free = ~np.asarray(fixed, dtype=bool)
    neighbours, first, member = _kernels.adjacency(triangles, len(points))
    sides = _sides(triangles, neighbours)
    ratio = _side_ratios(points, sides, size)

    doomed = _doomed(points, triangles, sides, ratio, free, first, settings)
    long = (ratio > settings.longest_side) & (sides.other >= 0)
    divided = _independent_sides(sides, ratio, long, doomed, len(triangles))

    removed = _kernels.collapse(points, triangles, first, member, doomed, False)
    points, triangles = _divide(points, triangles, sides, divided)
    triangles = triangles[triangles[:, 0] >= 0]
    used = np.zeros(len(points), dtype=bool)
    used[triangles] = True
    number = np.cumsum(used) - 1
    source = np.append(np.arange(len(free)), np.full(len(points) - len(free), -1))
    report = {"removed": float(removed), "inserted": float(divided.sum())}
    return Cleaned(points[used], number[triangles], source[used], report)


@dataclass(frozen=True, eq=False)
class _Sides:
    """Every side once."""

    triangle: np.ndarray
    corner: np.ndarray
    """The side lies opposite this corner of the triangle."""
    other: np.ndarray
    """Triangle on the other side, -1 on the boundary."""
    start: np.ndarray
    end: np.ndarray


def _sides(triangles: np.ndarray, neighbours: np.ndarray) -> _Sides:
    own = np.arange(len(triangles))[:, None]
    triangle, corner = np.nonzero((neighbours > own) | (neighbours < 0))
    return _Sides(
        triangle,
        corner,
        neighbours[triangle, corner],
        triangles[triangle, (corner + 1) % 3],
        triangles[triangle, (corner + 2) % 3],
    )


def _side_ratios(points: np.ndarray, sides: _Sides, size: np.ndarray) -> np.ndarray:
    """Length of every side over its target."""
    step = points[sides.end] - points[sides.start]
    return (
        2.0 * np.hypot(step[:, 0], step[:, 1]) / (size[sides.start] + size[sides.end])
    )


def _doomed(
    points: np.ndarray,
    triangles: np.ndarray,
    sides: _Sides,
    ratio: np.ndarray,
    free: np.ndarray,
    first: np.ndarray,
    settings: ImproveSettings,
) -> np.ndarray:
    """Nodes to remove: the most crowded ones, no two of them neighbours."""
    n = len(points)
    valence = np.diff(first)
    shortest = np.full(n, np.inf)
    np.minimum.at(shortest, sides.start, ratio)
    np.minimum.at(shortest, sides.end, ratio)
    total = np.bincount(sides.start, ratio, n) + np.bincount(sides.end, ratio, n)
    mean = total / np.maximum(valence, 1)

    score = np.zeros(n)
    crowded = free & (shortest < settings.shortest_side)
    # Of the two ends of a short side the more crowded one goes.
    score[crowded] = (
        2.0 - shortest[crowded] + 0.1 * np.maximum(2.0 - mean[crowded], 0.0)
    )
    score[free & (valence <= settings.lowest_valence)] += 1.0
    return _largest_around(score, sides)


def _largest_around(score: np.ndarray, sides: _Sides) -> np.ndarray:
    """Nodes with a positive score above that of all neighbours; first index on ties."""
    start, end = sides.start, sides.end
    tied = score[start] == score[end]
    lower = np.minimum(start, end)
    start_wins = (score[start] > score[end]) | (tied & (lower == start))
    beaten = np.zeros(len(score), dtype=bool)
    beaten[np.where(start_wins, end, start)] = True
    return (score > 0.0) & ~beaten


def _independent_sides(
    sides: _Sides,
    ratio: np.ndarray,
    wanted: np.ndarray,
    doomed: np.ndarray,
    n_triangles: int,
) -> np.ndarray:
    """Wanted sides that are the longest of both their triangles, clear of removals."""
    value = np.where(wanted, ratio, 0.0)
    longest = np.zeros(n_triangles)
    for triangle in (sides.triangle, sides.other[sides.other >= 0]):
        part = value if triangle is sides.triangle else value[sides.other >= 0]
        np.maximum.at(longest, triangle, part)
    near_removal = np.zeros(n_triangles, dtype=bool)
    gone = doomed[sides.start] | doomed[sides.end]
    near_removal[sides.triangle[gone]] = True
    near_removal[sides.other[gone & (sides.other >= 0)]] = True

    chosen = np.flatnonzero(wanted)
    one, two = sides.triangle[chosen], sides.other[chosen]
    good = (value[chosen] >= longest[one]) & (value[chosen] >= longest[two])
    good &= ~near_removal[one] & ~near_removal[two]
    chosen = chosen[good]
    # Equal lengths: the side that comes first keeps the triangle.
    taken = np.full(n_triangles, len(wanted))
    np.minimum.at(taken, sides.triangle[chosen], chosen)
    np.minimum.at(taken, sides.other[chosen], chosen)
    first = (taken[sides.triangle[chosen]] == chosen) & (
        taken[sides.other[chosen]] == chosen
    )
    result = np.zeros(len(wanted), dtype=bool)
    result[chosen[first]] = True
    return result


def _divide(
    points: np.ndarray, triangles: np.ndarray, sides: _Sides, divided: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """New nodes at the middles of sides, two triangles made of each beside them."""
    start, end = sides.start[divided], sides.end[divided]
    one, two = sides.triangle[divided], sides.other[divided]
    middle = len(points) + np.arange(len(start))
    apex_one = triangles[one].sum(axis=1) - start - end
    apex_two = triangles[two].sum(axis=1) - start - end
    triangles[one] = np.stack([apex_one, start, middle], axis=1)
    triangles[two] = np.stack([apex_two, end, middle], axis=1)
    new = np.concatenate(
        [
            np.stack([apex_one, middle, end], axis=1),
            np.stack([apex_two, middle, start], axis=1),
        ]
    )
    points = np.concatenate([points, 0.5 * (points[start] + points[end])])
    return points, np.concatenate([triangles, new])
