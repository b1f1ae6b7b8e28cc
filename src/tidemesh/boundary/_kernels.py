"""The one loop of the spacing routine."""

from __future__ import annotations

import numpy as np
from numba import njit


@njit(cache=True)
def choose_nodes(points, minimum, added, factor, evenness):
    """Choose nodes along a path so that the chords stay closest to it.

    Shortest path over the candidates, from the first to the last. A chord from i to j
    costs the integral of the squared distance of the path from it (in units of the
    minimum spacing cubed), plus `evenness` times its squared deviation from 1.25
    minima, plus a trifle for an added node; a chord outside
    [minimum, factor * minimum] costs so much that it is taken only where nothing else
    is possible.

    Parameters
    ----------
    points : (n, 2) float array
    minimum : (n,) float array, least spacing at every point
    added : (n,) bool array, True for candidates that are not vertices
    factor, evenness : float

    Returns
    -------
    chosen : int array, ascending, with 0 and n - 1
    """
    n = len(points)
    cost = np.full(n, np.inf)
    previous = np.full(n, -1)
    cost[0] = 0.0
    for i in range(n - 1):
        xi, yi = points[i, 0], points[i, 1]
        along = 0.0
        for j in range(i + 1, n):
            xj, yj = points[j, 0], points[j, 1]
            along += np.hypot(xj - points[j - 1, 0], yj - points[j - 1, 1])
            least = min(minimum[i], minimum[j])
            most = factor * max(minimum[i], minimum[j])
            # A longer detour is a peninsula or an inlet, not roughness.
            if j > i + 1 and along > 8.0 * most / factor:
                break
            length = np.hypot(xj - xi, yj - yi)
            trial = cost[i]
            # Outside the bounds: so dear that its closeness no longer matters.
            if length < least * (1.0 - 1e-9):
                trial += 100.0 + 1000.0 * (1.0 - length / least) ** 2
            elif length > most * (1.0 + 1e-9):
                if j > i + 1 and along > 2.5 * least:
                    continue
                trial += 100.0 + 1000.0 * (length / most - 1.0) ** 2
            else:
                unit = 0.5 * (minimum[i] + minimum[j])
                trial += evenness * (length / unit - 1.25) ** 2
                if added[j]:
                    trial += 0.01 * evenness
                ux, uy = (xj - xi) / length, (yj - yi) / length
                before = 0.0
                for k in range(i + 1, j + 1):
                    if trial >= cost[j]:
                        break
                    dx, dy = points[k, 0] - xi, points[k, 1] - yi
                    t = min(max(dx * ux + dy * uy, 0.0), length)
                    square = (dx - t * ux) ** 2 + (dy - t * uy) ** 2
                    step = np.hypot(
                        points[k, 0] - points[k - 1, 0],
                        points[k, 1] - points[k - 1, 1],
                    )
                    trial += 0.5 * (before + square) * step / unit**3
                    before = square
            if trial < cost[j]:
                cost[j] = trial
                previous[j] = i
    count = 1
    node = n - 1
    while node > 0:
        node = previous[node]
        count += 1
    chosen = np.empty(count, dtype=np.int64)
    node = n - 1
    for place in range(count - 1, -1, -1):
        chosen[place] = node
        node = previous[node]
    return chosen
