"""Fill-reducing elimination order of a planar mesh by nested dissection."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sparse
from scipy.sparse.csgraph import maximum_bipartite_matching

_SMALLEST = 6
"""Parts of so few nodes are not cut any more."""


def nested_dissection(points: np.ndarray, sides: np.ndarray) -> np.ndarray:
    """Order the nodes of a mesh for elimination.

    Every part of the mesh is halved at the median of x or of y, whichever cuts fewer
    sides; the fewest nodes that hold all cut sides separate the halves and come last
    (George 1973). All parts of one level are cut at once, on whole arrays.

    Parameters
    ----------
    points : (n, 2) float array
    sides : (2, n_sides) int array
        Sides of the triangles, each once.

    Returns
    -------
    order : (n,) int array
        ``order[k]`` is the node to be eliminated as number k.

    Notes
    -----
    On lattices of equilateral triangles the factors are as large as with METIS, on
    irregular meshes by a fifth larger (in mazes of creeks by a half); the order takes a
    third of its time, which makes up for it.
    """
    n = len(points)
    tails, heads = sides
    # The nodes left, sorted along x and y within their parts, parts one after another.
    along = [np.argsort(points[:, axis], kind="stable") for axis in (0, 1)]
    part = np.zeros(n, dtype=np.int32)
    size, first = np.array([n]), np.array([0])
    place = np.empty(n, dtype=np.int64)
    while len(size):
        right = _halve(along, part, size, tails, heads)
        separates = size[part] <= _SMALLEST
        cut = right[tails] != right[heads]
        a, b = tails[cut], heads[cut]
        swapped = right[a]
        left_end, right_end = np.where(swapped, b, a), np.where(swapped, a, b)
        separates[_minimum_cover(left_end, right_end)] = True

        # Elimination numbers: left half, right half, separator.
        nodes = along[0]
        stays = ~separates[nodes]
        half = 2 * part[nodes] + right[nodes]
        halves = np.bincount(half[stays], minlength=2 * len(size)).reshape(-1, 2)
        last = nodes[~stays]
        count = size - halves.sum(axis=1)
        begin = first + halves.sum(axis=1) - (np.cumsum(count) - count)
        place[last] = begin[part[last]] + np.arange(len(last))

        first = np.column_stack([first, first + halves[:, 0]]).ravel()
        size = halves.ravel()
        number = np.cumsum(size > 0) - 1
        part[nodes] = number[half]
        part[last] = 0  # out of the game; any part that exists will do
        first, size = first[size > 0], size[size > 0]
        for axis in (0, 1):
            left = along[axis][~separates[along[axis]]]
            along[axis] = left[np.argsort(part[left], kind="stable")]
        whole = ~(cut | separates[tails] | separates[heads])
        tails, heads = tails[whole], heads[whole]
    order = np.empty(n, dtype=np.int64)
    order[place] = np.arange(n)
    return order


def _halve(
    along: list[np.ndarray],
    part: np.ndarray,
    size: np.ndarray,
    tails: np.ndarray,
    heads: np.ndarray,
) -> np.ndarray:
    """True for the nodes of the right (or upper) half of every part."""
    start = np.cumsum(size) - size
    upper = np.arange(size.sum()) >= np.repeat(start + size // 2, size)
    halves, cuts = [], []
    for nodes in along:
        right = np.zeros(len(part), dtype=bool)
        right[nodes] = upper
        cut = right[tails] != right[heads]
        halves.append(right)
        cuts.append(np.bincount(part[tails[cut]], minlength=len(size)))
    return np.where((cuts[1] < cuts[0])[part], halves[1], halves[0])


def _minimum_cover(left: np.ndarray, right: np.ndarray) -> np.ndarray:
    """Fewest nodes that hold at least one end of every side (Konig's theorem).

    Parameters
    ----------
    left, right : (n,) int arrays
        Ends of the sides; no node is in both.
    """
    if len(left) == 0:
        return left
    left_nodes, i = np.unique(left, return_inverse=True)
    right_nodes, j = np.unique(right, return_inverse=True)
    ones = np.ones(len(left), dtype=np.int8)
    shape = len(left_nodes), len(right_nodes)
    mate = maximum_bipartite_matching(
        sparse.csr_array((ones, (i, j)), shape=shape), perm_type="column"
    )
    mate_of_right = np.full(len(right_nodes), -1)
    matched = np.flatnonzero(mate >= 0)
    mate_of_right[mate[matched]] = matched
    # What alternating paths reach from unmatched left nodes: left nodes reached stay
    # out of the cover, right nodes reached are in it.
    reached_left = mate < 0
    reached_right = np.zeros(len(right_nodes), dtype=bool)
    front = reached_left
    while front.any():
        new = np.zeros(len(right_nodes), dtype=bool)
        new[j[front[i]]] = True
        new &= ~reached_right
        reached_right |= new
        back = mate_of_right[new]
        front = np.zeros(len(left_nodes), dtype=bool)
        front[back[back >= 0]] = True
        reached_left = reached_left | front
    return np.concatenate([left_nodes[~reached_left], right_nodes[reached_right]])
