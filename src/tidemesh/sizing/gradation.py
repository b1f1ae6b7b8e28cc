"""Limit how fast the spacing may grow."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra


def limit_gradation(
    spacing: ArrayLike, edges: np.ndarray, lengths: np.ndarray, limit: float
) -> np.ndarray:
    """Largest spacing below the given one that changes by at most limit * length.

    Parameters
    ----------
    spacing : (n,) array
        Positive.
    edges : (m, 2) int array
        Pairs of nodes, of any graph.
    lengths : (m,) array
        Positive, in the unit of the spacing.
    limit : float
        Greatest change of spacing per length along an edge, not negative.

    Returns
    -------
    (n,) array
        Never larger than `spacing`; applied twice it changes nothing.

    Notes
    -----
    The wanted spacing at a node is the least of spacing[i] + limit * distance(i, node)
    over all nodes i: the shortest way from an outside source that is joined to every
    node i by an edge of length spacing[i].
    """
    spacing = np.array(spacing, dtype=np.float64)
    start, end = np.asarray(edges, dtype=np.int64).reshape(-1, 2).T
    weight = limit * np.asarray(lengths, dtype=np.float64)
    if not (np.abs(spacing[start] - spacing[end]) > weight).any():
        return spacing
    n = len(spacing)
    source = np.full(n, n)
    graph = csr_array(
        (
            np.concatenate([weight, weight, spacing]),
            (
                np.concatenate([start, end, source]),
                np.concatenate([end, start, np.arange(n)]),
            ),
        ),
        shape=(n + 1, n + 1),
    )
    return dijkstra(graph, indices=n)[:n]
