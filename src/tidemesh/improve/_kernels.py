"""Loops over triangles and nodes: adjacency, edge flips, node moves.

Plain arrays only. Neighbour k of a triangle lies across the side opposite corner k.
"""

from __future__ import annotations

import numpy as np
from numba import njit

SQRT3 = 1.7320508075688772


@njit(cache=True)
def adjacency(triangles, n_points):
    """Neighbours (n_triangles, 3), -1 for none, and the triangles of every node.

    Returns ``neighbours, first, member``: node i has the corners
    ``member[first[i]:first[i + 1]]``, each ``3 * triangle + corner``.
    """
    n = len(triangles)
    first = np.zeros(n_points + 1, np.int64)
    for t in range(n):
        for k in range(3):
            first[triangles[t, k] + 1] += 1
    for i in range(n_points):
        first[i + 1] += first[i]
    place = first[:-1].copy()
    member = np.empty(3 * n, np.int64)
    for t in range(n):
        for k in range(3):
            i = triangles[t, k]
            member[place[i]] = 3 * t + k
            place[i] += 1
    neighbours = np.full((n, 3), -1, np.int64)
    for t in range(n):
        for k in range(3):
            a = triangles[t, (k + 1) % 3]
            b = triangles[t, (k + 2) % 3]
            if neighbours[t, k] >= 0:
                continue
            # The neighbour runs through the side from b to a.
            for m in range(first[b], first[b + 1]):
                other = member[m] // 3
                corner = member[m] % 3
                if triangles[other, (corner + 1) % 3] == a:
                    neighbours[t, k] = other
                    neighbours[other, (corner + 2) % 3] = t
                    break
    return neighbours, first, member


@njit(cache=True, inline="always")
def _quality(ax, ay, bx, by, cx, cy):
    """Shape quality q of one triangle."""
    ux, uy = bx - ax, by - ay
    vx, vy = cx - ax, cy - ay
    wx, wy = cx - bx, cy - by
    squares = ux * ux + uy * uy + vx * vx + vy * vy + wx * wx + wy * wy
    return 2.0 * SQRT3 * (ux * vy - uy * vx) / squares


@njit(cache=True)
def flip(points, triangles, neighbours, by_quality, maximum_sweeps):
    """Flip sides in place; return the number of flips.

    By the Delaunay criterion, or where the worse quality of the two triangles rises.
    Sides of the boundary have one triangle and stay.
    """
    n = len(triangles)
    total = 0
    active = np.ones(n, np.bool_)
    for _ in range(maximum_sweeps):
        flips = 0
        for t in range(n):
            if not active[t]:
                continue
            active[t] = False
            for k in range(3):
                o = neighbours[t, k]
                if o < 0:
                    continue
                a = triangles[t, k]
                b = triangles[t, (k + 1) % 3]
                c = triangles[t, (k + 2) % 3]
                m = 0
                while neighbours[o, m] != t or triangles[o, (m + 1) % 3] != c:
                    m += 1
                d = triangles[o, m]
                ax, ay = points[a, 0], points[a, 1]
                bx, by = points[b, 0], points[b, 1]
                cx, cy = points[c, 0], points[c, 1]
                dx, dy = points[d, 0], points[d, 1]
                if by_quality:
                    new_one = _quality(ax, ay, bx, by, dx, dy)
                    new_two = _quality(ax, ay, dx, dy, cx, cy)
                    new = min(new_one, new_two)
                    if new <= 1e-3:
                        continue
                    old = min(
                        _quality(ax, ay, bx, by, cx, cy),
                        _quality(dx, dy, cx, cy, bx, by),
                    )
                    if new <= old + 1e-6:
                        continue
                else:
                    # The angles at a and d sum to more than pi where their cotangents
                    # sum to less than zero.
                    pa = (bx - ax) * (cx - ax) + (by - ay) * (cy - ay)
                    qa = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)
                    pd = (cx - dx) * (bx - dx) + (cy - dy) * (by - dy)
                    qd = (cx - dx) * (by - dy) - (cy - dy) * (bx - dx)
                    scale = (abs(pa) + qa) * (abs(pd) + qd)
                    if pa * qd + pd * qa >= -1e-10 * scale:
                        continue
                    if (
                        _quality(ax, ay, bx, by, dx, dy) <= 0.0
                        or _quality(ax, ay, dx, dy, cx, cy) <= 0.0
                    ):
                        continue
                # Side b-c becomes a-d: t = (a, b, d), o = (a, d, c).
                beside_ab = neighbours[t, (k + 2) % 3]
                beside_ca = neighbours[t, (k + 1) % 3]
                beside_bd = neighbours[o, (m + 1) % 3]
                beside_dc = neighbours[o, (m + 2) % 3]
                triangles[t, 0], triangles[t, 1], triangles[t, 2] = a, b, d
                triangles[o, 0], triangles[o, 1], triangles[o, 2] = a, d, c
                neighbours[t, 0], neighbours[t, 1], neighbours[t, 2] = (
                    beside_bd,
                    o,
                    beside_ab,
                )
                neighbours[o, 0], neighbours[o, 1], neighbours[o, 2] = (
                    beside_dc,
                    beside_ca,
                    t,
                )
                if beside_bd >= 0:
                    for e in range(3):
                        if neighbours[beside_bd, e] == o:
                            neighbours[beside_bd, e] = t
                    active[beside_bd] = True
                if beside_ca >= 0:
                    for e in range(3):
                        if neighbours[beside_ca, e] == t:
                            neighbours[beside_ca, e] = o
                    active[beside_ca] = True
                if beside_ab >= 0:
                    active[beside_ab] = True
                if beside_dc >= 0:
                    active[beside_dc] = True
                active[t] = True
                active[o] = True
                flips += 1
                break
        total += flips
        if flips == 0:
            break
    return total


@njit(cache=True, inline="always")
def _worst(points, triangles, first, member, i, x, y):
    """Least quality of the triangles of node i, were it at (x, y)."""
    worst = 1.0
    for m in range(first[i], first[i + 1]):
        t = member[m] // 3
        k = member[m] % 3
        b = triangles[t, (k + 1) % 3]
        c = triangles[t, (k + 2) % 3]
        worst = min(
            worst,
            _quality(x, y, points[b, 0], points[b, 1], points[c, 0], points[c, 1]),
        )
    return worst


@njit(cache=True)
def move_nodes(points, triangles, first, member, free, size, springs, floor):
    """Move every free node in turn, in place; return moved and refused counts.

    To the mean of its neighbours, or to the mean of the places that its neighbours
    wish it at: ``size[i] + size[j]`` away, times the mean stretch of the node's sides.
    A move is refused where it takes the worst triangle of the node below its present
    quality and below the floor; a half and a quarter of it are tried before.
    """
    moved = 0
    refused = 0
    for i in range(len(free)):
        if not free[i]:
            continue
        x, y = points[i, 0], points[i, 1]
        stretch = 0.0
        if springs:
            actual = 0.0
            wanted = 0.0
            for m in range(first[i], first[i + 1]):
                b = triangles[member[m] // 3, (member[m] + 1) % 3]
                actual += np.hypot(points[b, 0] - x, points[b, 1] - y)
                wanted += size[b] + size[i]
            stretch = actual / wanted
        sx, sy, sw = 0.0, 0.0, 0.0
        for m in range(first[i], first[i + 1]):
            b = triangles[member[m] // 3, (member[m] + 1) % 3]
            bx, by = points[b, 0] - x, points[b, 1] - y
            pull, weight = 1.0, 1.0
            if springs:
                rest = stretch * (size[b] + size[i])
                weight = 1.0 / rest
                # Twice the step: neighbours move as well, and meet it half way.
                pull = 2.0 * (1.0 - rest / np.hypot(bx, by))
            sx += weight * pull * bx
            sy += weight * pull * by
            sw += weight
        if sw <= 0.0:
            continue
        sx /= sw
        sy /= sw
        old = _worst(points, triangles, first, member, i, x, y)
        accepted = False
        for _ in range(3):
            new = _worst(points, triangles, first, member, i, x + sx, y + sy)
            if new >= old or new >= floor:
                accepted = True
                break
            sx *= 0.5
            sy *= 0.5
        if accepted:
            points[i, 0] = x + sx
            points[i, 1] = y + sy
            moved += 1
        else:
            refused += 1
    return moved, refused


@njit(cache=True)
def collapse(points, triangles, first, member, doomed, gain):
    """Merge doomed nodes into a neighbour each, in place; return merged counts.

    No two doomed nodes may be neighbours. The neighbour is the one that leaves the
    best worst triangle; that must be positive and, if ``gain``, better than before.
    Triangles that vanish get -1 in their first column; merged nodes stay unused.
    """
    merged = 0
    for i in range(len(doomed)):
        if not doomed[i]:
            continue
        x, y = points[i, 0], points[i, 1]
        best = 0.05
        if gain:
            best = max(best, _worst(points, triangles, first, member, i, x, y) + 1e-3)
        heir = -1
        for m in range(first[i], first[i + 1]):
            j = triangles[member[m] // 3, (member[m] + 1) % 3]
            worst = 1.0
            for k in range(first[i], first[i + 1]):
                b = triangles[member[k] // 3, (member[k] + 1) % 3]
                c = triangles[member[k] // 3, (member[k] + 2) % 3]
                if b != j and c != j:
                    worst = min(
                        worst,
                        _quality(
                            points[j, 0],
                            points[j, 1],
                            points[b, 0],
                            points[b, 1],
                            points[c, 0],
                            points[c, 1],
                        ),
                    )
            if worst > best:
                best = worst
                heir = j
        if heir < 0:
            continue
        for m in range(first[i], first[i + 1]):
            t = member[m] // 3
            b = triangles[t, (member[m] + 1) % 3]
            c = triangles[t, (member[m] + 2) % 3]
            if b == heir or c == heir:
                triangles[t, 0] = -1
            else:
                triangles[t, member[m] % 3] = heir
        merged += 1
    return merged


@njit(cache=True)
def raise_worst(points, triangles, first, member, free, below, sweeps):
    """Search better places for the nodes of bad triangles; return improved nodes.

    Compass search around each free node whose worst triangle is below a quality.
    """
    improved = 0
    for _ in range(sweeps):
        changed = 0
        for i in range(len(free)):
            if not free[i]:
                continue
            x, y = points[i, 0], points[i, 1]
            best = _worst(points, triangles, first, member, i, x, y)
            if best >= below:
                continue
            start = best
            t = member[first[i]] // 3
            k = member[first[i]] % 3
            b = triangles[t, (k + 1) % 3]
            step = 0.25 * np.hypot(points[b, 0] - x, points[b, 1] - y)
            for _ in range(24):
                found = False
                for direction in range(8):
                    angle = direction * np.pi / 4.0
                    u, v = x + step * np.cos(angle), y + step * np.sin(angle)
                    new = _worst(points, triangles, first, member, i, u, v)
                    if new > best + 1e-6:
                        best, bx, by = new, u, v
                        found = True
                if found:
                    x, y = bx, by
                else:
                    step *= 0.5
            if best > start + 1e-4:
                points[i, 0], points[i, 1] = x, y
                changed += 1
        improved += changed
        if changed == 0:
            break
    return improved


@njit(cache=True)
def qualities(points, triangles):
    """Shape quality of every triangle."""
    result = np.empty(len(triangles))
    for t in range(len(triangles)):
        a, b, c = triangles[t, 0], triangles[t, 1], triangles[t, 2]
        result[t] = _quality(
            points[a, 0],
            points[a, 1],
            points[b, 0],
            points[b, 1],
            points[c, 0],
            points[c, 1],
        )
    return result
