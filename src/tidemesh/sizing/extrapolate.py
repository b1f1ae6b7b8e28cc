"""Sizes where the rule is undefined, from where it is defined."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.sparse import csc_array, csr_array, diags_array
from scipy.sparse.csgraph import connected_components
from scipy.sparse.linalg import splu
from scipy.spatial import cKDTree

from tidemesh.errors import InputError

Extension = Callable[[np.ndarray], np.ndarray]


def harmonic_extension(
    points: np.ndarray, edges: np.ndarray, known: np.ndarray
) -> Extension:
    """Prepare the filling of undefined nodes by a smooth extension along the mesh.

    Parameters
    ----------
    points : (n, 2) array
        m.
    edges : (m, 2) int array
        Pairs of nodes.
    known : (n,) bool array
        Where values are defined.

    Returns
    -------
    extend : function (n,) -> (n,)
        Keeps the known positive values; every other node gets the mean of the
        logarithms of its neighbours, weighted by 1 / length, so filled values stay
        between the known ones. A part of the mesh without any known node takes the
        nearest known value.

    Raises
    ------
    InputError
        If no node is known.
    """
    if not known.any():
        raise InputError(
            "the sizing rule is undefined at every node of the base mesh: refine the "
            "base grid, or use another [sizing] rule"
        )
    if known.all():
        return lambda values: np.array(values, dtype=np.float64)

    graph = _weights(points, edges)
    nearest = _nearest_for_unreached(points, graph, known)
    given = known.copy()
    given[list(nearest)] = True
    wanted = np.flatnonzero(~given)
    rows = graph[wanted]
    matrix = diags_array(rows.sum(axis=1)) - rows[:, wanted]
    solve = splu(csc_array(matrix), permc_spec="MMD_AT_PLUS_A").solve
    coupling = rows[:, np.flatnonzero(given)]

    def extend(values: np.ndarray) -> np.ndarray:
        filled = np.array(values, dtype=np.float64)
        filled[list(nearest)] = filled[list(nearest.values())]
        filled[wanted] = np.exp(solve(coupling @ np.log(filled[given])))
        return filled

    return extend


def smooth_logarithm(values: np.ndarray, edges: np.ndarray, sweeps: int) -> np.ndarray:
    """Geometric mean of every node and its neighbours, repeated.

    One noisy node would otherwise set a mesh.

    Parameters
    ----------
    values : (n,) array
        Positive; NaN where undefined, which stays so and is not looked at.
    edges : (m, 2) int array
    sweeps : int

    Returns
    -------
    (n,) array
    """
    values = np.array(values, dtype=np.float64)
    known = np.isfinite(values)
    start, end = edges[known[edges].all(axis=1)].T
    n = len(values)
    count = 1 + np.bincount(start, minlength=n) + np.bincount(end, minlength=n)
    logarithm = np.log(np.where(known, values, 1.0))
    for _ in range(sweeps):
        logarithm = (
            logarithm
            + np.bincount(start, logarithm[end], n)
            + np.bincount(end, logarithm[start], n)
        ) / count
    return np.where(known & (sweeps > 0), np.exp(logarithm), values)


def _weights(points: np.ndarray, edges: np.ndarray) -> csr_array:
    start, end = edges.T
    weight = 1.0 / np.linalg.norm(points[start] - points[end], axis=1)
    return csr_array(
        (
            np.concatenate([weight, weight]),
            (np.concatenate([start, end]), np.concatenate([end, start])),
        ),
        shape=(len(points), len(points)),
    )


def _nearest_for_unreached(
    points: np.ndarray, graph: csr_array, known: np.ndarray
) -> dict[int, int]:
    """Nearest known node of every node in a part without known nodes."""
    number, part = connected_components(graph, directed=False)
    reached = np.bincount(part, known, number) > 0
    lost = np.flatnonzero(~reached[part])
    candidates = np.flatnonzero(known)
    if not lost.size:
        return {}
    _, index = cKDTree(points[candidates]).query(points[lost])
    return dict(zip(lost.tolist(), candidates[index].tolist()))
