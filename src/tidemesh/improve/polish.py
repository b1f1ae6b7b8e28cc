"""The few worst triangles: nodes placed by search, sides flipped for shape."""

from __future__ import annotations

import numpy as np

from tidemesh.improve.sides import Sides, best_sides
from tidemesh.triangulation import quality

SEARCH_STEPS = 40
FLIP_ROUNDS = 6
# A flip must make the worse of two triangles better by this much.
LEAST_GAIN = 0.01
# Flips that free a corner of the boundary may leave triangles no worse than this;
# only worse ones may be mended at the price of such a corner.
GOOD_ENOUGH = 0.5
DIRECTIONS = np.stack(
    [np.cos(np.arange(8) * np.pi / 4.0), np.sin(np.arange(8) * np.pi / 4.0)], axis=1
)


def flip_poor(
    points: np.ndarray, triangles: np.ndarray, below: float
) -> tuple[np.ndarray, int]:
    """Flip sides where that raises the worse quality of two triangles.

    Parameters
    ----------
    points : (n_points, 2) float array
        m.
    triangles : (n_triangles, 3) int array
        Counter-clockwise.
    below : float
        Only triangles of a quality below this are looked at, and triangles that leave
        a boundary node with no other triangle.

    Returns
    -------
    triangles : (n_triangles, 3) int array
        New array; Delaunay no longer at the flipped sides.
    flips : int
    """
    triangles = np.array(triangles, dtype=np.int64)
    total = 0
    for _ in range(FLIP_ROUNDS):
        sides = Sides.of(triangles, len(points))
        count = np.bincount(triangles.ravel(), minlength=len(points))
        shape = quality.shape_quality(points, triangles)
        lonely = (count[triangles] == 1).any(axis=1)
        poor = lonely | (shape < below)
        chosen = (sides.other >= 0) & (poor[sides.one] | poor[sides.other])
        sides = sides.where(chosen)
        near, far = sides.apex, sides.far_apex(triangles)
        first = np.stack([near, sides.start, far], axis=1)
        second = np.stack([near, far, sides.end], axis=1)
        before = np.minimum(shape[sides.one], shape[sides.other])
        after = np.minimum(
            quality.shape_quality(points, first), quality.shape_quality(points, second)
        )
        frees = (count[near] == 1) | (count[far] == 1)
        # The ends of a flipped side lose a triangle each.
        strands = (count[sides.start] <= 2) | (count[sides.end] <= 2)
        gain = after - before
        good = (gain > LEAST_GAIN) | (frees & (after >= GOOD_ENOUGH))
        good &= ~strands | ((before < GOOD_ENOUGH) & (gain > LEAST_GAIN))
        score = np.where(good, gain + 1.0 + frees, 0.0)
        flipped = best_sides(score, sides, len(triangles))
        if not flipped.any():
            break
        triangles[sides.one[flipped]] = first[flipped]
        triangles[sides.other[flipped]] = second[flipped]
        total += int(flipped.sum())
    return triangles, total


def raise_worst(
    points: np.ndarray, triangles: np.ndarray, fixed: np.ndarray, below: float
) -> tuple[np.ndarray, int]:
    """Place the free nodes of poor triangles by a compass search.

    Parameters
    ----------
    points : (n_points, 2) float array
        m.
    triangles : (n_triangles, 3) int array
        Counter-clockwise.
    fixed : (n_points,) bool array
        Nodes that stay.
    below : float
        Quality under which a triangle is poor.

    Returns
    -------
    points : (n_points, 2) float array
        New array. The worst triangle of a moved node is better than before.
    moved : int
        Number of nodes that moved.
    """
    points = np.array(points, dtype=np.float64)
    poor = quality.shape_quality(points, triangles) < below
    wanted = np.zeros(len(points), dtype=bool)
    wanted[triangles[poor]] = True
    nodes = np.flatnonzero(wanted & ~np.asarray(fixed, dtype=bool))
    if not len(nodes):
        return points, 0
    local = np.full(len(points), -1)
    local[nodes] = np.arange(len(nodes))
    triangle, corner = np.nonzero(local[triangles] >= 0)
    star = local[triangles[triangle, corner]]
    order = np.argsort(star, kind="stable")
    triangle, corner, star = triangle[order], corner[order], star[order]
    ahead = triangles[triangle, (corner + 1) % 3]
    behind = triangles[triangle, (corner + 2) % 3]
    first = np.flatnonzero(np.diff(star, prepend=-1))
    # Neighbours that are both to move take turns.
    near = local[ahead] >= 0
    one, other = star[near], local[ahead[near]]

    def worst(places: np.ndarray) -> np.ndarray:
        shape = _shape(places[star], points[ahead], points[behind])
        return np.minimum.reduceat(shape, first)

    given = points[nodes].copy()
    edge = np.hypot(*(points[ahead] - points[nodes][star]).T)
    step = 0.25 * np.minimum.reduceat(edge, first)
    for _ in range(SEARCH_STEPS):
        now = worst(points[nodes])
        tried = [points[nodes] + step[:, None] * way for way in DIRECTIONS]
        found = np.stack([worst(places) for places in tried])
        best = found.argmax(axis=0)
        gain = found.max(axis=0) - now
        better = gain > 1e-6
        turn = better.copy()
        loses = (gain[one] < gain[other]) | ((gain[one] == gain[other]) & (one > other))
        turn[one[loses & better[other]]] = False
        moving = np.flatnonzero(turn)
        points[nodes[moving]] = np.stack(tried)[best[moving], moving]
        step[~better] *= 0.5
    return points, int((points[nodes] != given).any(axis=1).sum())


def _shape(a: np.ndarray, b: np.ndarray, c: np.ndarray) -> np.ndarray:
    points = np.concatenate([a, b, c])
    corner = np.arange(len(a))
    triangles = np.stack([corner, corner + len(a), corner + 2 * len(a)], axis=1)
    return quality.shape_quality(points, triangles)
