"""Compiled loops of point location; called by `locate` alone."""

from __future__ import annotations

import numpy as np
from numba import njit

STACK = 128


@njit(cache=True)
def find(
    x,
    y,
    triangles,
    origin,
    step,
    shape,
    first_cell,
    child,
    start,
    entries,
    query,
    tolerance,
    triangle,
    barycentric,
):
    """Triangle (-1 outside) and barycentric coordinates of every query point."""
    for i in range(len(query)):
        px, py = query[i, 0], query[i, 1]
        triangle[i] = -1
        column = np.floor((px - origin[0, 0]) / step[0])
        row = np.floor((py - origin[0, 1]) / step[0])
        # Written so that a NaN is outside too.
        if not (0 <= column < shape[0, 0] and 0 <= row < shape[0, 1]):
            continue
        cell = int(row) * shape[0, 0] + int(column)
        while child[cell] >= 0:
            g = child[cell]
            columns, rows = shape[g, 0], shape[g, 1]
            k = int((px - origin[g, 0]) / step[g])
            j = int((py - origin[g, 1]) / step[g])
            k = min(max(k, 0), columns - 1)
            j = min(max(j, 0), rows - 1)
            cell = first_cell[g] + j * columns + k
        best = -tolerance
        for n in range(start[cell], start[cell + 1]):
            t = entries[n]
            a, b, c = triangles[t, 0], triangles[t, 1], triangles[t, 2]
            ax, ay = x[a], y[a]
            ux, uy = x[b] - ax, y[b] - ay
            vx, vy = x[c] - ax, y[c] - ay
            dx, dy = px - ax, py - ay
            area = ux * vy - vx * uy
            if area == 0.0:
                continue
            scale = 1.0 / area
            second = (dx * vy - vx * dy) * scale
            third = (ux * dy - dx * uy) * scale
            first = 1.0 - second - third
            least = min(first, second, third)
            if least >= best:
                best = least
                triangle[i] = t
                barycentric[i, 0] = first
                barycentric[i, 1] = second
                barycentric[i, 2] = third
                if least >= 0.0:
                    break


@njit(cache=True)
def nearest_segment(ends, boxes, leaf, query, segment, fraction):
    """Nearest segment and the fraction along it, by a tree of bounding boxes.

    boxes[1] is the root, boxes[2 k] and boxes[2 k + 1] the halves of boxes[k]; the
    last half of the rows are leaves of `leaf` consecutive segments.
    """
    leaves = len(boxes) // 2
    stack = np.empty(STACK, dtype=np.int64)
    reach = np.empty(STACK)
    for i in range(len(query)):
        px, py = query[i, 0], query[i, 1]
        nearest = np.inf
        segment[i] = -1
        stack[0], reach[0], depth = 1, 0.0, 1
        while depth > 0:
            depth -= 1
            if reach[depth] >= nearest:
                continue
            node = stack[depth]
            if node >= leaves:
                begin = (node - leaves) * leaf
                for s in range(begin, min(begin + leaf, len(ends))):
                    ax, ay = ends[s, 0], ends[s, 1]
                    ux, uy = ends[s, 2] - ax, ends[s, 3] - ay
                    dx, dy = px - ax, py - ay
                    along = (dx * ux + dy * uy) / (ux * ux + uy * uy)
                    along = min(max(along, 0.0), 1.0)
                    dx -= along * ux
                    dy -= along * uy
                    distance = dx * dx + dy * dy
                    if distance < nearest:
                        nearest = distance
                        segment[i] = s
                        fraction[i] = along
                continue
            first, second = 2 * node, 2 * node + 1
            dx = max(boxes[first, 0] - px, px - boxes[first, 2], 0.0)
            dy = max(boxes[first, 1] - py, py - boxes[first, 3], 0.0)
            near = dx * dx + dy * dy
            dx = max(boxes[second, 0] - px, px - boxes[second, 2], 0.0)
            dy = max(boxes[second, 1] - py, py - boxes[second, 3], 0.0)
            far = dx * dx + dy * dy
            if far < near:
                first, second, near, far = second, first, far, near
            # The nearer half goes on top of the stack.
            if far < nearest:
                stack[depth], reach[depth] = second, far
                depth += 1
            if near < nearest:
                stack[depth], reach[depth] = first, near
                depth += 1
