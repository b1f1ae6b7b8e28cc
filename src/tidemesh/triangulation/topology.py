"""Who touches whom: edges, boundaries, neighbours, parts; and a mesh's faults."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import shapely
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components as _graph_components

from tidemesh.datatypes import BoundaryString
from tidemesh.errors import MeshError
from tidemesh.geometry.polygons import ring_area

PAIRED_TYPES = (4, 5, 24, 25, 64)
"""ADCIRC's boundary types whose first extra column is the node across the weir."""

DEEPEST = 12_000.0
"""m; no sea is deeper (10.9 km) and no land higher: a damaged number."""


def edges(triangles: np.ndarray) -> np.ndarray:
    """Every edge once, smaller index first, in ascending order: (n_edges, 2)."""
    size = _size(triangles)
    keys = np.sort(_edge_keys(triangles, size))
    return _pairs(keys[_first_of_equals(keys)], size)


def edge_table(triangles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Edges, and the edges of every triangle.

    Returns
    -------
    edges : (n_edges, 2) int64 array
        Smaller index first, ascending.
    edge_of_triangle : (n_triangles, 3) int64 array
        Column i is the edge from corner i to corner i + 1.
    """
    size = _size(triangles)
    keys, order = _sorted_with_order(_edge_keys(triangles, size))
    first = _first_of_equals(keys)
    number = np.empty(len(keys), dtype=np.int64)
    number[order] = np.cumsum(first) - 1
    return _pairs(keys[first], size), number.reshape(-1, 3)


def neighbours(triangles: np.ndarray) -> np.ndarray:
    """Triangle across the edge from corner i to corner i + 1: (n_triangles, 3).

    -1 on the boundary. Where more than two triangles share an edge (an invalid mesh)
    they are paired in ascending order.
    """
    ordered, order = _sorted_with_order(_edge_keys(triangles, _size(triangles)))
    same = np.flatnonzero(ordered[1:] == ordered[:-1])
    result = np.full(len(order), -1, dtype=np.int64)
    result[order[same]] = order[same + 1] // 3
    result[order[same + 1]] = order[same] // 3
    return result.reshape(-1, 3)


def boundary_edges(triangles: np.ndarray) -> np.ndarray:
    """Edges of one triangle only, the water on their left: (n_boundary, 2).

    In the order of the triangles.
    """
    return _boundary_edges_and_triangles(triangles)[0]


def boundary_edge_triangles(triangles: np.ndarray) -> np.ndarray:
    """Triangle of every row of `boundary_edges`: (n_boundary,)."""
    return _boundary_edges_and_triangles(triangles)[1]


def boundary_nodes(triangles: np.ndarray) -> np.ndarray:
    """Nodes on the boundary, ascending: (n,)."""
    return np.unique(boundary_edges(triangles))


def boundary_rings(triangles: np.ndarray) -> list[np.ndarray]:
    """Closed walks along the boundary, the water on the left.

    A ring starts at its smallest node, which is not repeated; rings come in ascending
    order of their first nodes. At a pinched node a walk stays with the triangles that
    it has on its left.

    Returns
    -------
    rings : list of (n,) int64 arrays
        Node indices.

    Raises
    ------
    MeshError
        If the boundary does not close (triangles of mixed direction).
    """
    directed, _ = _boundary_edges_and_triangles(triangles)
    if len(directed) == 0:
        return []
    following = _following_edge(triangles, directed)
    visited = np.zeros(len(directed), dtype=bool)
    next_edge = following.tolist()
    rings = []
    for start in np.argsort(directed[:, 0], kind="stable").tolist():
        if visited[start]:
            continue
        walk = [start]
        edge = next_edge[start]
        while edge != start:
            walk.append(edge)
            edge = next_edge[edge]
        visited[walk] = True
        rings.append(directed[walk, 0])
    return rings


def node_to_nodes(
    triangles: np.ndarray, n_points: int
) -> tuple[np.ndarray, np.ndarray]:
    """Neighbours of every node in compressed rows.

    Returns
    -------
    indptr : (n_points + 1,) int64 array
    indices : (2 n_edges,) int64 array
        Neighbours of node i, ascending, are ``indices[indptr[i]:indptr[i + 1]]``.
    """
    pair = edges(triangles)
    low, high = pair.T
    keys = np.concatenate([low * n_points + high, high * n_points + low])
    keys.sort()
    node, other = _pairs(keys, n_points).T
    return _indptr(node, n_points), np.ascontiguousarray(other)


def node_to_triangles(
    triangles: np.ndarray, n_points: int
) -> tuple[np.ndarray, np.ndarray]:
    """Triangles of every node, ascending, in compressed rows (see `node_to_nodes`)."""
    node, order = _sorted_with_order(triangles.ravel())
    return _indptr(node, n_points), order // 3


def valence(triangles: np.ndarray, n_points: int) -> np.ndarray:
    """Number of edges at every node: (n_points,) int64."""
    return np.bincount(edges(triangles).ravel(), minlength=n_points)


def connected_components(triangles: np.ndarray) -> tuple[int, np.ndarray]:
    """Parts joined by edges: their number, and the part of every triangle."""
    if len(triangles) == 0:
        return 0, np.empty(0, dtype=np.int64)
    other = neighbours(triangles).ravel()
    own = np.repeat(np.arange(len(triangles)), 3)
    inner = other >= 0
    graph = coo_array(
        (np.ones(int(inner.sum()), dtype=np.int8), (own[inner], other[inner])),
        shape=(len(triangles), len(triangles)),
    )
    number, label = _graph_components(graph.tocsr(), directed=False)
    return int(number), label.astype(np.int64)


@dataclass(frozen=True, eq=False)
class Problem:
    """One kind of fault of a mesh."""

    name: str
    """For instance "inverted triangle"."""
    place: tuple[float, float] | None
    """x and y (m) of the first occurrence, if it has a place."""
    indices: np.ndarray
    """(n,) all nodes or triangles (as the name says) concerned."""

    def __str__(self) -> str:
        """Name, number of occurrences and first place."""
        where = ""
        if self.place is not None:
            where = f", first at x {self.place[0]:.1f} m, y {self.place[1]:.1f} m"
        return f"{self.name}: {len(self.indices)}{where}"


def check_mesh(
    points: np.ndarray,
    triangles: np.ndarray,
    depth: np.ndarray | None = None,
    boundaries: Sequence[BoundaryString] | None = None,
    *,
    minimum_depth: float | None = None,
) -> list[Problem]:
    """Faults of a mesh; an empty list for a valid one (docs/method.md, quality words).

    Parameters
    ----------
    points : (n_points, 2) float array
        m.
    triangles : (n_triangles, 3) int array
    depth : (n_points,) float array, optional
        m, positive down.
    boundaries : sequence of BoundaryString, optional
        Checked to cover every boundary edge once, in order, water on the left.
    minimum_depth : float, optional
        m.

    Returns
    -------
    problems : list of Problem
    """
    points = np.asarray(points, dtype=np.float64)
    triangles = np.asarray(triangles, dtype=np.int64)
    lost = _first_fault(
        ("point not finite", ~np.isfinite(points).all(axis=1), None),
        (
            "triangle names no node",
            ((triangles < 0) | (triangles >= len(points))).any(axis=1),
            None,
        ),
    )
    if lost or len(triangles) == 0:
        # Nothing else can be computed.
        return lost or [Problem("no triangles", None, np.empty(0, dtype=np.int64))]
    found = _element_problems(points, triangles) + _node_problems(points, triangles)
    if depth is not None:
        found += _depth_problems(points, np.asarray(depth), minimum_depth)
    if boundaries is not None:
        found += _string_problems(points, triangles, boundaries)
    return found


def require_valid(
    points: np.ndarray,
    triangles: np.ndarray,
    depth: np.ndarray | None = None,
    boundaries: Sequence[BoundaryString] | None = None,
    *,
    minimum_depth: float | None = None,
) -> None:
    """Raise MeshError with all the faults that `check_mesh` finds."""
    found = check_mesh(
        points, triangles, depth, boundaries, minimum_depth=minimum_depth
    )
    if found:
        raise MeshError("the mesh is not valid: " + "; ".join(map(str, found)))


def _first_fault(
    *tests: tuple[str, np.ndarray, np.ndarray | None],
) -> list[Problem]:
    """A problem for every (name, mask, places (n, 2)) whose mask has a true item."""
    found = []
    for name, mask, places in tests:
        indices = np.flatnonzero(mask)
        if len(indices):
            place = None if places is None else tuple(places[indices[0]].tolist())
            found.append(Problem(name, place, indices))
    return found


def _element_problems(points: np.ndarray, triangles: np.ndarray) -> list[Problem]:
    corner = points[triangles]
    centre = corner.mean(axis=1)
    along = corner[:, 1] - corner[:, 0]
    across = corner[:, 2] - corner[:, 0]
    twice_area = along[:, 0] * across[:, 1] - along[:, 1] * across[:, 0]
    # Differences of coordinates are exact to their last digit, their product is not.
    magnitude = np.abs(points).max()
    size = np.abs(along).max(axis=1) + np.abs(across).max(axis=1)
    flat = np.abs(twice_area) <= 4.0 * np.finfo(np.float64).eps * magnitude * size

    keys, order = _sorted_with_order(_edge_keys(triangles, len(points)))
    third = np.flatnonzero(keys[2:] == keys[:-2])
    crowded = np.zeros(len(triangles), dtype=bool)
    crowded[order[np.isin(keys, keys[third])] // 3] = len(third) > 0
    repeats = _repeats(triangles, keys, order)

    found = _first_fault(
        ("flat triangle", flat, centre),
        ("inverted triangle", (twice_area < 0.0) & ~flat, centre),
        ("duplicate triangle", repeats, centre),
        ("edge of more than two triangles", crowded & ~repeats, centre),
    )
    parts, label = connected_components(triangles)
    if not found and parts == 1:
        found += _overlap_problems(points, triangles, float(twice_area.sum()) / 2.0)
    if parts > 1:
        largest = np.bincount(label).argmax()
        found += _first_fault(
            ("triangle apart from the largest part", label != largest, centre)
        )
    return found


def _repeats(triangles: np.ndarray, keys: np.ndarray, order: np.ndarray) -> np.ndarray:
    """Triangles whose nodes, in any order, are those of an earlier one."""
    # A copy shares its edges, which have three triangles then, or two if it lies at
    # the boundary: only such pairs whose corners add up alike need a look.
    total = triangles.sum(axis=1)
    suspects = []
    for gap in (1, 2):
        same = keys[gap:] == keys[:-gap]
        first, second = order[:-gap][same] // 3, order[gap:][same] // 3
        alike = total[first] == total[second]
        suspects += [first[alike], second[alike]]
    suspect = np.unique(np.concatenate(suspects))
    ordered = np.sort(triangles[suspect], axis=1)
    rank = np.lexsort((suspect, *ordered.T))
    equal = (np.diff(ordered[rank], axis=0) == 0).all(axis=1)
    repeats = np.zeros(len(triangles), dtype=bool)
    repeats[suspect[rank[1:][equal]]] = True
    return repeats


def _overlap_problems(
    points: np.ndarray, triangles: np.ndarray, total: float
) -> list[Problem]:
    """Triangles that lie over one another without sharing an edge.

    The signed areas of triangles always add up to that of their boundary, folded or
    not, so the boundary is compared as a polygon: its rings may not cross.
    """
    rings = boundary_rings(triangles)
    outer = [ring for ring in rings if ring_area(points[ring]) > 0.0]
    holes = [ring for ring in rings if ring_area(points[ring]) <= 0.0]
    covered, missing = (
        shapely.union_all(
            [shapely.make_valid(shapely.Polygon(points[ring])) for ring in part]
        ).area
        for part in (outer, holes)
    )
    if abs(covered - missing - total) <= 1e-9 * total:
        return []
    return [Problem("overlapping triangles", None, np.empty(0, dtype=np.int64))]


def _node_problems(points: np.ndarray, triangles: np.ndarray) -> list[Problem]:
    unused = np.bincount(triangles.ravel(), minlength=len(points)) == 0
    ends = np.bincount(boundary_edges(triangles).ravel(), minlength=len(points))
    order = np.lexsort((points[:, 1], points[:, 0]))
    same = np.zeros(len(points), dtype=bool)
    same[order[1:]] = (np.diff(points[order], axis=0) == 0.0).all(axis=1)
    return _first_fault(
        ("unused node", unused, points),
        ("coinciding node", same, points),
        ("pinched boundary node", ends > 2, points),
    )


def _depth_problems(
    points: np.ndarray, depth: np.ndarray, minimum_depth: float | None
) -> list[Problem]:
    finite = np.isfinite(depth)
    low = np.zeros(len(depth), dtype=bool)
    if minimum_depth is not None:
        low[finite] = depth[finite] < minimum_depth
    return _first_fault(
        ("depth not finite", ~finite, points),
        ("depth beyond 12 km", finite & (np.abs(depth) > DEEPEST), points),
        ("depth below the minimum", low, points),
    )


def _string_problems(
    points: np.ndarray, triangles: np.ndarray, boundaries: Sequence[BoundaryString]
) -> list[Problem]:
    size = len(points)
    short = [string for string in boundaries if len(string.nodes) < 3]
    found = []
    if short:
        nodes = np.concatenate([string.nodes for string in short])
        first = tuple(points[nodes[0]].tolist()) if len(nodes) else None
        found.append(Problem("node of a string of fewer than 3 nodes", first, nodes))

    edge = boundary_edges(triangles)
    wanted = edge[:, 0] * size + edge[:, 1]
    runs = [run for string in boundaries for run in _runs(string)]
    have = np.concatenate(runs) if runs else np.empty((0, 2), dtype=np.int64)
    keys = have[:, 0] * size + have[:, 1]
    against = have[:, 1] * size + have[:, 0]
    forward, backward = np.isin(keys, wanted), np.isin(against, wanted)
    known, count = np.unique(
        np.concatenate([keys[forward], against[backward]]), return_counts=True
    )
    place = points[edge[:, 0]]
    start = points[have[:, 0]]
    found += _first_fault(
        ("string segment with the water on its right", backward, start),
        ("string segment that is no boundary edge", ~forward & ~backward, start),
        ("boundary edge in no string", ~np.isin(wanted, known), place),
        ("boundary edge in several strings", np.isin(wanted, known[count > 1]), place),
    )
    return found


def _runs(string: BoundaryString) -> list[np.ndarray]:
    """Directed segments of a string: list of (n, 2)."""
    nodes = string.nodes
    if string.closed:
        return [np.stack([nodes, np.roll(nodes, -1)], axis=1)]
    runs = [np.stack([nodes[:-1], nodes[1:]], axis=1)]
    if string.ibtype in PAIRED_TYPES and string.extra is not None:
        # A weir is a slot in the mesh: its back runs the other way, and its ends,
        # where they are open, are edges too.
        back = string.extra[::-1, 0].astype(np.int64)
        ends = np.array([[nodes[-1], back[0]], [back[-1], nodes[0]]])
        runs.append(np.stack([back[:-1], back[1:]], axis=1))
        runs.append(ends[ends[:, 0] != ends[:, 1]])
    return runs


def _size(triangles: np.ndarray) -> int:
    return int(triangles.max()) + 1 if len(triangles) else 1


def _edge_keys(triangles: np.ndarray, size: int) -> np.ndarray:
    """One integer an edge, in triangle order: (3 n_triangles,)."""
    start = np.asarray(triangles, dtype=np.int64)
    end = np.roll(start, -1, axis=1)
    return (np.minimum(start, end) * size + np.maximum(start, end)).ravel()


def _pairs(keys: np.ndarray, size: int) -> np.ndarray:
    """Undo ``first * size + second``: (n,) -> (n, 2)."""
    return np.stack(np.divmod(keys, size), axis=1)


def _first_of_equals(ordered: np.ndarray) -> np.ndarray:
    first = np.ones(len(ordered), dtype=bool)
    np.not_equal(ordered[1:], ordered[:-1], out=first[1:])
    return first


def _sorted_with_order(keys: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Sorted non-negative keys, and where each stood; equal ones in their old order."""
    keys = np.asarray(keys, dtype=np.int64)
    bits = len(keys).bit_length()
    if len(keys) and int(keys.max()) < 1 << (63 - bits):
        # Sorting plain numbers is ten times faster than sorting their order.
        packed = (keys << bits) | np.arange(len(keys))
        packed.sort()
        return packed >> bits, packed & ((1 << bits) - 1)
    order = np.argsort(keys, kind="stable")
    return keys[order], order


def _indptr(node: np.ndarray, n_points: int) -> np.ndarray:
    count = np.bincount(node, minlength=n_points)
    return np.concatenate([[0], np.cumsum(count)])


def _boundary_edges_and_triangles(
    triangles: np.ndarray,
) -> tuple[np.ndarray, np.ndarray]:
    triangle, corner = np.nonzero(neighbours(triangles) < 0)
    start = triangles[triangle, corner]
    end = triangles[triangle, (corner + 1) % 3]
    return np.stack([start, end], axis=1).astype(np.int64), triangle


def _following_edge(triangles: np.ndarray, directed: np.ndarray) -> np.ndarray:
    """Row of the boundary edge that continues each boundary edge."""
    size = _size(triangles)
    out_count = np.bincount(directed[:, 0], minlength=size)
    in_count = np.bincount(directed[:, 1], minlength=size)
    if not np.array_equal(out_count, in_count):
        node = int(np.flatnonzero(out_count != in_count)[0])
        raise MeshError(
            f"the boundary does not close at node {node}: "
            "triangles there do not all run counter-clockwise"
        )
    leaving = np.full(size, -1, dtype=np.int64)
    leaving[directed[:, 0]] = np.arange(len(directed))
    following = leaving[directed[:, 1]]
    if out_count.max() > 1:
        _follow_at_pinches(triangles, directed, out_count > 1, following)
    return following


def _follow_at_pinches(
    triangles: np.ndarray,
    directed: np.ndarray,
    pinched: np.ndarray,
    following: np.ndarray,
) -> None:
    # Around a node b every triangle (b, c, d) leads from its edge b-c to its edge b-d.
    # An incoming boundary edge a-b is the d side of its triangle; turning back from
    # d to c, triangle by triangle, ends at the outgoing boundary edge.
    row_of = {(a, b): row for row, (a, b) in enumerate(directed.tolist())}
    at_pinch = triangles[pinched[triangles].any(axis=1)]
    turn = {}
    for triple in at_pinch.tolist():
        for corner in range(3):
            b, c, d = triple[corner], triple[corner - 2], triple[corner - 1]
            turn[b, d] = c
    for row in np.flatnonzero(pinched[directed[:, 1]]).tolist():
        d, b = directed[row].tolist()
        for _ in range(len(at_pinch) + 1):
            d = turn[b, d]
            if (b, d) in row_of:
                break
        following[row] = row_of[b, d]
