"""Depths at nodes that keep the water volume of what lies between the nodes."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

# Triangles are sampled at the middles of k**2 equal parts, no larger than the cells of
# the source; beyond 8**2 parts the sources are averaged over them.
_DIVISIONS = (2, 4, 8)
_CHUNK = 500_000


def volume_corrected(
    points: np.ndarray,
    triangles: np.ndarray,
    depth: np.ndarray,
    bed: Callable[[np.ndarray, np.ndarray], np.ndarray],
    resolution: float,
) -> np.ndarray:
    """One step from given depths towards the linear surface nearest to the bed.

    Parameters
    ----------
    points : (n_points, 2) float array
        m.
    triangles : (n_triangles, 3) int array
        Counter-clockwise.
    depth : (n_points,) float array
        m.
    bed : callable
        Depth (m, NaN where unknown) at places (n, 2), means over the given sizes (n,).
    resolution : float
        m, triangles with shorter sides are left as they are.

    Returns
    -------
    corrected : (n_points,) float array
        m, within what the bed and the given depths have in the triangles around a
        node. Short of that limit the volume over the mesh is that of the bed.

    Notes
    -----
    depth + (integral of phi (bed - I depth)) / (integral of phi) with the hat functions
    phi and the linear interpolant I: a step of Jacobi for the L2 projection with the
    lumped mass. The hat functions add up to one, so the volume is exact after one step.
    """
    corner = points[triangles]
    side = np.linalg.norm(corner - np.roll(corner, 1, axis=1), axis=2).max(axis=1)
    one, other = corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]
    area = 0.5 * (one[:, 0] * other[:, 1] - one[:, 1] * other[:, 0])
    wanted = side / resolution if resolution > 0.0 else np.full(len(side), np.inf)
    group = np.minimum(np.searchsorted(_DIVISIONS, wanted), len(_DIVISIONS) - 1)
    group[wanted <= 1.0] = -1

    missing = np.zeros(len(points))
    lowest, highest = depth.copy(), depth.copy()
    for index, number in enumerate(_DIVISIONS):
        weight = _barycentric(number)
        chosen = np.flatnonzero(group == index)
        length = _CHUNK // len(weight)
        for start in range(0, len(chosen), length):
            part = chosen[start : start + length]
            node = triangles[part]
            at = np.einsum("qk,tkd->tqd", weight, points[node]).reshape(-1, 2)
            size = np.repeat(side[part] / number, len(weight))
            found = bed(at, size).reshape(len(part), len(weight))
            residual = found - depth[node] @ weight.T
            share = area[part, None] / len(weight)
            missed = share * (np.nan_to_num(residual) @ weight)
            missing += np.bincount(node.ravel(), missed.ravel(), len(points))
            low, high = np.fmin.reduce(found, axis=1), np.fmax.reduce(found, axis=1)
            for k in range(3):
                np.fmin.at(lowest, node[:, k], low)
                np.fmax.at(highest, node[:, k], high)
    total = np.bincount(triangles.ravel(), np.repeat(area / 3.0, 3), len(points))
    change = np.divide(missing, total, out=np.zeros(len(points)), where=total > 0.0)
    return np.clip(depth + change, lowest, highest)


def _barycentric(number: int) -> np.ndarray:
    """Middles of the number**2 equal parts of a triangle: (n, 3)."""
    row, column = np.meshgrid(np.arange(number), np.arange(number), indexing="ij")
    up = row + column < number
    down = row + column < number - 1
    first = np.concatenate([row[up] + 1.0 / 3.0, row[down] + 2.0 / 3.0])
    second = np.concatenate([column[up] + 1.0 / 3.0, column[down] + 2.0 / 3.0])
    return np.stack([first, second, number - first - second], axis=1) / number
