"""Loops over triangles and nodes: neighbours, side flips, node moves.

Plain arrays only. Neighbour k of a triangle lies across the side opposite corner k.
"""

from __future__ import annotations

import numpy as np
from numba import njit

# Nodes with more neighbours than this stay where they are.
MOST_NEIGHBOURS = 64
# A node at rest moves by less than this fraction of its sides.
REST = 0.005


@njit(cache=True, error_model="numpy")
def find_neighbours(triangles, n_points):
    """Neighbours of every triangle: (n_triangles, 3), -1 on the boundary."""
    neighbours = np.full(triangles.shape, -1)
    # Sides still without a partner, chained by their smaller node.
    newest = np.full(n_points, -1)
    before = np.empty(triangles.size, np.int64)
    for side in range(triangles.size):
        t, k = side // 3, side % 3
        a, b = triangles[t, (k + 1) % 3], triangles[t, (k + 2) % 3]
        low = min(a, b)
        other = newest[low]
        while other >= 0 and (
            neighbours[other // 3, other % 3] >= 0
            or triangles[other // 3, (other % 3 + 1) % 3] != b
            or triangles[other // 3, (other % 3 + 2) % 3] != a
        ):
            other = before[other]
        if other >= 0:
            neighbours[t, k] = other // 3
            neighbours[other // 3, other % 3] = t
        else:
            before[side] = newest[low]
            newest[low] = side
    return neighbours


@njit(cache=True, error_model="numpy")
def _opening(points, a, b, c):
    """Scaled cosine and sine of the angle at a, from b to c."""
    ux, uy = points[b, 0] - points[a, 0], points[b, 1] - points[a, 1]
    vx, vy = points[c, 0] - points[a, 0], points[c, 1] - points[a, 1]
    return ux * vx + uy * vy, ux * vy - uy * vx


@njit(cache=True, error_model="numpy")
def flip_to_delaunay(points, triangles, neighbours, awake, maximum_sweeps):
    """Flip sides in place until all are Delaunay; return the number of flips.

    Triangles without an awake node are taken to be Delaunay. Sides of the boundary
    have one triangle and stay.
    """
    active = np.empty(len(triangles), np.bool_)
    for t in range(len(triangles)):
        a, b, c = triangles[t, 0], triangles[t, 1], triangles[t, 2]
        active[t] = awake[a] or awake[b] or awake[c]
    total = 0
    for _ in range(maximum_sweeps):
        before = total
        for t in range(len(triangles)):
            k = 0
            while active[t] and k < 3:
                o = neighbours[t, k]
                if o >= 0:
                    b, c = triangles[t, (k + 1) % 3], triangles[t, (k + 2) % 3]
                    m = 0
                    while triangles[o, m] == b or triangles[o, m] == c:
                        m += 1
                    a, d = triangles[t, k], triangles[o, m]
                    # The angles at a and d add up to more than pi where the sum of
                    # their cotangents is negative; the four nodes are then convex.
                    cos_a, sin_a = _opening(points, a, b, c)
                    cos_d, sin_d = _opening(points, d, c, b)
                    bound = (abs(cos_a) + sin_a) * (abs(cos_d) + sin_d)
                    if cos_a * sin_d + cos_d * sin_a < -1e-10 * bound:
                        # (a, b, c) becomes (a, b, d) and (d, c, b) becomes (d, c, a).
                        beside_t = neighbours[t, (k + 1) % 3]
                        beside_o = neighbours[o, (m + 1) % 3]
                        triangles[t, (k + 2) % 3] = d
                        triangles[o, (m + 2) % 3] = a
                        neighbours[t, k] = beside_o
                        neighbours[t, (k + 1) % 3] = o
                        neighbours[o, m] = beside_t
                        neighbours[o, (m + 1) % 3] = t
                        for e in range(3):
                            if beside_t >= 0 and neighbours[beside_t, e] == t:
                                neighbours[beside_t, e] = o
                            if beside_o >= 0 and neighbours[beside_o, e] == o:
                                neighbours[beside_o, e] = t
                        active[o] = True
                        total += 1
                        k = -1
                k += 1
            active[t] = False
        if total == before:
            break
    return total


@njit(cache=True, error_model="numpy")
def _worst(points, ring, n, x, y):
    """Least shape quality of the triangles of a node at (x, y) and a ring around it."""
    worst = 1.0
    for m in range(n):
        b, c = ring[m], ring[m + 1]
        ux, uy = points[b, 0] - x, points[b, 1] - y
        vx, vy = points[c, 0] - x, points[c, 1] - y
        # u.u + v.v + (v - u).(v - u)
        squares = 2.0 * (ux * ux + uy * uy + vx * vx + vy * vy - ux * vx - uy * vy)
        worst = min(worst, (ux * vy - uy * vx) / squares)
    return 3.4641016151377544 * worst


@njit(cache=True, error_model="numpy")
def move_nodes(points, triangles, neighbours, incident, awake, size, springs, floor):
    """Move nodes in turn, in place; return moved and refused counts.

    Only awake nodes move, and only they and their neighbours, if they moved by more
    than `REST` of their sides, are awake afterwards. A node with an incident triangle
    (fixed nodes have -1) goes to the mean of its
    neighbours, or to the mean of the places that its neighbours wish it at: at
    ``size[i] + size[j]`` times the mean stretch of the node's sides. A move is
    refused where it takes the worst triangle of the node below its present quality
    and below the floor; a half and a quarter of it are tried before.
    """
    moved = 0
    refused = 0
    ring = np.empty(MOST_NEIGHBOURS + 1, np.int64)
    length = np.empty(MOST_NEIGHBOURS)
    was_awake = awake.copy()
    awake[:] = False
    for i in range(len(incident)):
        if not was_awake[i]:
            continue
        t, n = incident[i], 0
        while t >= 0 and n < MOST_NEIGHBOURS and (n == 0 or t != incident[i]):
            k = 0
            while triangles[t, k] != i:
                k += 1
            ring[n] = triangles[t, (k + 1) % 3]
            t = neighbours[t, (k + 1) % 3]
            n += 1
        if n == 0 or t != incident[i]:
            continue
        ring[n] = ring[0]
        x, y = points[i, 0], points[i, 1]
        around, wanted = 0.0, 0.0
        for m in range(n):
            b = ring[m]
            bx, by = points[b, 0] - x, points[b, 1] - y
            length[m] = np.sqrt(bx * bx + by * by)
            around += length[m]
            wanted += size[b] + size[i]
        stretch = around / wanted
        sx, sy, sw = 0.0, 0.0, 0.0
        for m in range(n):
            b = ring[m]
            bx, by = points[b, 0] - x, points[b, 1] - y
            pull, weight = 1.0, 1.0
            if springs:
                rest = stretch * (size[b] + size[i])
                weight = 1.0 / rest
                # Twice the way: a spring along one side is free along the other.
                pull = 2.0 * (1.0 - rest / length[m])
            sx += weight * pull * bx
            sy += weight * pull * by
            sw += weight
        sx /= sw
        sy /= sw
        old = _worst(points, ring, n, x, y)
        tries = 0
        while tries < 3:
            new = _worst(points, ring, n, x + sx, y + sy)
            if new >= old or new >= floor:
                break
            sx *= 0.5
            sy *= 0.5
            tries += 1
        if tries < 3:
            points[i, 0] = x + sx
            points[i, 1] = y + sy
            moved += 1
            if n * n * (sx * sx + sy * sy) > REST * REST * around * around:
                awake[i] = True
                for m in range(n):
                    awake[ring[m]] = True
        else:
            refused += 1
    return moved, refused
