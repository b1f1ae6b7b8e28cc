"""Nodes removed and inserted where sizes or valences are off; the boundary stays."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tidemesh.improve.settings import ImproveSettings
from tidemesh.improve.sides import Sides, best_nodes, best_sides
from tidemesh.triangulation import quality

# A node is merged into a neighbour only if every triangle stays this good.
WORST_AFTER_MERGE = 0.05
# A boundary corner at least this wide has room for two triangles.
WIDE_CORNER_DEG = 80.0


@dataclass(frozen=True, eq=False)
class Cleaned:
    """A mesh with some nodes gone and some new."""

    points: np.ndarray
    """(n_points, 2) m: kept nodes in their order, then new ones."""
    triangles: np.ndarray
    """(n_triangles, 3) counter-clockwise, not Delaunay beside the changes."""
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
    wanted: int | None = None,
) -> Cleaned:
    """Remove nodes of short sides and low valence; divide long sides and wide corners.

    Parameters
    ----------
    points : (n_points, 2) float array
        m.
    triangles : (n_triangles, 3) int array
        Counter-clockwise.
    fixed : (n_points,) bool array
        Nodes that stay; those of the boundary must be among them.
    settings : ImproveSettings, optional
        Limits of sides and valence.
    size : (n_points,) float array
        m, target spacing at the nodes.
    wanted : int, optional
        Number of nodes to end with: the less needed removals, or insertions, are left
        out. The given number by default.

    Returns
    -------
    Cleaned
        No two removed nodes were neighbours, and no new node divides a side of a
        triangle that another change has touched.
    """
    settings = settings or ImproveSettings()
    points = np.array(points, dtype=np.float64)
    triangles = np.array(triangles, dtype=np.int64)
    fixed = np.asarray(fixed, dtype=bool)
    size = np.asarray(size, dtype=np.float64)
    n_given = len(points)
    sides = Sides.of(triangles, n_given)
    ratio = 2.0 * sides.length(points) / (size[sides.start] + size[sides.end])

    surplus = n_given - (n_given if wanted is None else wanted)
    # Where the number must change, the next best candidates count as well.
    shortest = max(settings.shortest_side, 1.0 if surplus > 0 else 0.0)
    longest = min(settings.longest_side, 1.0 if surplus < 0 else np.inf)
    crowding = _crowding(sides, ratio, fixed, shortest, settings.lowest_valence)
    doomed = best_nodes(crowding, sides)
    need = _need(points, triangles, sides, ratio, doomed, longest)
    divided = best_sides(need, sides, len(triangles))
    n_doomed, n_divided = int(doomed.sum()), int(divided.sum())
    _keep_best(doomed, crowding, n_divided + surplus)
    _keep_best(divided, need, n_doomed - surplus)
    removed = _merge(points, triangles, doomed)
    points, triangles = _divide(points, triangles, sides.where(divided))

    triangles = triangles[triangles[:, 0] >= 0]
    used = np.append(fixed, np.zeros(len(points) - n_given, dtype=bool))
    used[triangles] = True
    number = np.cumsum(used) - 1
    source = np.append(np.arange(n_given), np.full(len(points) - n_given, -1))
    report = {"removed": float(removed), "inserted": float(len(points) - n_given)}
    return Cleaned(points[used], number[triangles], source[used], report)


def _crowding(
    sides: Sides,
    ratio: np.ndarray,
    fixed: np.ndarray,
    shortest_side: float,
    lowest_valence: int,
) -> np.ndarray:
    """(n_points,) how much a node is in the way: 0 for not at all."""
    n = len(fixed)
    ends = np.concatenate([sides.start, sides.end])
    both = np.tile(ratio, 2)
    valence = np.bincount(ends, minlength=n)
    mean = np.bincount(ends, both, n) / np.maximum(valence, 1)
    shortest = np.full(n, np.inf)
    np.minimum.at(shortest, ends, both)

    score = np.zeros(n)
    crowded = shortest < shortest_side
    # Of the two ends of a short side the one among shorter sides goes.
    score[crowded] = 2.0 - shortest[crowded] + 0.1 * np.maximum(2.0 - mean[crowded], 0)
    score[valence <= lowest_valence] += 1.0
    score[fixed] = 0.0
    return score


def _keep_best(chosen: np.ndarray, score: np.ndarray, number: int) -> None:
    """Drop the lowest scores, in place, until no more than a number are chosen."""
    index = np.flatnonzero(chosen)
    order = np.lexsort((index, -score[index]))
    chosen[index[order[max(number, 0) :]]] = False


def _need(
    points: np.ndarray,
    triangles: np.ndarray,
    sides: Sides,
    ratio: np.ndarray,
    doomed: np.ndarray,
    longest_side: float,
) -> np.ndarray:
    """(n_sides,) need to divide: long sides, and those that cut off a corner."""
    score = np.where(ratio > longest_side, ratio, 0.0)
    cut = _corner_cutting(points, triangles, sides)
    score[cut] += 1.0
    # Triangles of removed nodes are left alone.
    touched = doomed[triangles].any(axis=1)
    score[touched[sides.one] | touched[sides.other]] = 0.0
    return score


def _corner_cutting(
    points: np.ndarray, triangles: np.ndarray, sides: Sides
) -> np.ndarray:
    """Sides opposite a wide boundary corner that hangs on one triangle."""
    on_boundary = np.zeros(len(triangles), dtype=np.int64)
    edge = sides.other < 0
    np.add.at(on_boundary, sides.one[edge], 1)
    inner = np.flatnonzero(~edge)
    found = []
    for triangle in (sides.one[inner], sides.other[inner]):
        ear = on_boundary[triangle] == 2
        side, triangle = inner[ear], triangle[ear]
        corner = triangles[triangle].sum(axis=1) - sides.start[side] - sides.end[side]
        u = points[sides.start[side]] - points[corner]
        v = points[sides.end[side]] - points[corner]
        sine = np.abs(u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0])
        angle = np.arctan2(sine, (u * v).sum(axis=1))
        found.append(side[angle >= np.radians(WIDE_CORNER_DEG)])
    return np.unique(np.concatenate(found))


def _merge(points: np.ndarray, triangles: np.ndarray, doomed: np.ndarray) -> int:
    """Merge doomed nodes, no two of them neighbours, into a neighbour each, in place.

    The neighbour is the one that leaves the best worst triangle. Triangles that
    vanish get -1 in their first column. Returns the number of merged nodes.
    """
    triangle, corner = np.nonzero(doomed[triangles])
    node = triangles[triangle, corner]
    order = np.argsort(node, kind="stable")
    triangle, corner, node = triangle[order], corner[order], node[order]
    ahead = triangles[triangle, (corner + 1) % 3]
    behind = triangles[triangle, (corner + 2) % 3]
    _, first, count = np.unique(node, return_index=True, return_counts=True)

    # Every triangle of a node against every neighbour that may take its place.
    star = np.repeat(np.arange(len(first)), count)
    repeat = count[star]
    heir = np.repeat(np.arange(len(node)), repeat)
    within = np.arange(len(heir)) - np.repeat(np.cumsum(repeat) - repeat, repeat)
    other = first[star[heir]] + within
    replaced = np.stack([ahead[heir], ahead[other], behind[other]], axis=1)
    left = quality.shape_quality(points, replaced)
    left[(replaced[:, 1] == replaced[:, 0]) | (replaced[:, 2] == replaced[:, 0])] = 2.0
    if not len(left):
        return 0
    worst = np.minimum.reduceat(left, np.cumsum(repeat) - repeat)
    best = np.lexsort((np.arange(len(node)), -worst, star))[first]
    good = worst[best] > WORST_AFTER_MERGE

    new = np.repeat(ahead[best], count)
    change = np.repeat(good, count)
    vanish = change & ((ahead == new) | (behind == new))
    stay = change & ~vanish
    triangles[triangle[stay], corner[stay]] = new[stay]
    triangles[triangle[vanish], 0] = -1
    return int(good.sum())


def _divide(
    points: np.ndarray, triangles: np.ndarray, sides: Sides
) -> tuple[np.ndarray, np.ndarray]:
    """New nodes at the middles of sides, two triangles made of each beside them."""
    start, end = sides.start, sides.end
    middle = len(points) + np.arange(len(start))
    near, far = sides.apex, sides.far_apex(triangles)
    triangles[sides.one] = np.stack([near, start, middle], axis=1)
    triangles[sides.other] = np.stack([far, end, middle], axis=1)
    beyond = np.concatenate(
        [
            np.stack([near, middle, end], axis=1),
            np.stack([far, middle, start], axis=1),
        ]
    )
    points = np.concatenate([points, 0.5 * (points[start] + points[end])])
    return points, np.concatenate([triangles, beyond])
