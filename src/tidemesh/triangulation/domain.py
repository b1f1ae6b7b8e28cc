"""Triangulate a domain, and list its boundary as typed, ordered strings."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from tidemesh.datatypes import LAND, OCEAN, BoundaryString, CoastalMesh, Domain, Ring
from tidemesh.errors import MeshError
from tidemesh.geometry.polygons import ring_area
from tidemesh.geometry.projection import Projection
from tidemesh.triangulation import topology
from tidemesh.triangulation.delaunay import constrained_delaunay


def ring_points(domain: Domain) -> np.ndarray:
    """All boundary points, ring after ring: (n_ring_points, 2) m."""
    return np.concatenate([ring.points for ring in domain.rings])


def ring_segments(domain: Domain) -> np.ndarray:
    """Boundary segments as indices into `ring_points`, the water on their left.

    Returns
    -------
    segments : (n_ring_points, 2) int64 array
        Row i runs from point i to the next point of its ring.
    """
    parts = []
    first = 0
    for ring in domain.rings:
        start = first + np.arange(len(ring.points))
        parts.append(np.stack([start, np.roll(start, -1)], axis=1))
        first += len(ring.points)
    return np.concatenate(parts)


def triangulate(domain: Domain, interior: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Constrained Delaunay triangulation of the rings and the interior points.

    Parameters
    ----------
    domain : Domain
        Simple rings that neither touch nor cross one another.
    interior : (n_interior, 2) float array
        Points (m) strictly inside the domain; may be empty.

    Returns
    -------
    points : (n_points, 2) float64 array
        The ring points, ring after ring, then the interior points as given.
    triangles : (n_triangles, 3) int64 array
        Counter-clockwise. Every ring segment is an edge of one triangle.

    Raises
    ------
    MeshError
        If a point is not finite, coincides with another, lies outside the domain or
        on one of its segments, or if rings cross or touch.
    """
    boundary = ring_points(domain)
    interior = np.asarray(interior, dtype=np.float64).reshape(-1, 2)
    points = np.concatenate([boundary, interior])
    triangles = constrained_delaunay(points, ring_segments(domain))
    used = np.bincount(triangles.ravel(), minlength=len(points)) > 0
    if not used.all():
        unused = np.flatnonzero(~used)
        raise MeshError(
            f"{len(unused)} of {len(points)} points are not inside the domain, "
            f"the first at {_place(domain, points[unused[0]])}"
        )
    # Euler's formula for a disc with holes; a point on a segment splits the segment
    # and makes one triangle less, rings that touch make one more or one less.
    expected = 2 * len(interior) + len(boundary) - 4 + 2 * len(domain.rings)
    if len(triangles) != expected:
        segments = ring_segments(domain)
        lost = _lost_segments(segments, topology.boundary_edges(triangles))
        place = "" if len(lost) == 0 else _place(domain, points[segments[lost[0], 0]])
        raise MeshError(
            f"the triangulation has {len(triangles)} triangles instead of {expected}: "
            f"{len(lost)} boundary segments are split or lost"
            + (f", the first at {place}" if place else "")
            + "; a point lies on a boundary segment, or two rings touch"
        )
    return points, triangles


def boundary_strings(domain: Domain) -> tuple[BoundaryString, ...]:
    """Typed strings of a mesh whose first points are the domain's ring points.

    Open strings come first, then mainland, then islands, each in ring order. Runs of
    ocean and of land segments on one ring share their end nodes. A ring of one kind
    gives one closed string, its first node not repeated: an open or a mainland string
    on the outer ring, an island on a hole.

    Returns
    -------
    strings : tuple of BoundaryString
        Node indices as in `triangulate`; the water on the left.
    """
    strings: list[BoundaryString] = []
    first = 0
    for number, ring in enumerate(domain.rings):
        nodes = first + np.arange(len(ring.points))
        is_open = ring.segment_kind == OCEAN
        strings += _strings_of_ring(nodes, is_open, is_outer=number == 0)
        first += len(nodes)
    return _in_order(strings)


def boundary_strings_from_mesh(
    points: np.ndarray,
    triangles: np.ndarray,
    open_nodes: np.ndarray | None = None,
    *,
    open_edges: np.ndarray | None = None,
) -> tuple[BoundaryString, ...]:
    """Typed strings of any mesh, from its topology.

    Parameters
    ----------
    points : (n_points, 2) float array
    triangles : (n_triangles, 3) int array
        Counter-clockwise.
    open_nodes : (k,) int or (n_points,) bool array, optional
        Nodes of the open boundary, end nodes included. A boundary edge between two of
        them is open.
    open_edges : (m, 2) int array, optional
        Open boundary edges instead, in any direction; needed where a single land edge
        joins two open strings.

    Returns
    -------
    strings : tuple of BoundaryString
        As from `boundary_strings`. Rings that enclose water are outer rings, all
        others are islands.
    """
    n_points = len(points)
    edges = topology.boundary_edges(triangles)
    if open_edges is not None:
        wanted = np.sort(np.asarray(open_edges, dtype=np.int64).reshape(-1, 2), axis=1)
        have = np.sort(edges, axis=1)
        is_open = np.isin(
            have[:, 0] * n_points + have[:, 1], wanted[:, 0] * n_points + wanted[:, 1]
        )
    else:
        mask = np.zeros(n_points, dtype=bool)
        if open_nodes is not None:
            mask[np.asarray(open_nodes)] = True
        is_open = mask[edges].all(axis=1)
    open_key = np.sort(edges[is_open, 0] * n_points + edges[is_open, 1])

    strings: list[BoundaryString] = []
    for ring in topology.boundary_rings(triangles):
        key = ring * n_points + np.roll(ring, -1)
        outer = ring_area(points[ring]) > 0.0
        strings += _strings_of_ring(ring, np.isin(key, open_key), is_outer=outer)
    return _in_order(strings)


def domain_from_mesh(mesh: CoastalMesh) -> Domain:
    """The water body that a mesh covers, its open strings as ocean.

    Returns
    -------
    domain : Domain
        The outer ring first, then the islands; ring points are mesh nodes.

    Raises
    ------
    MeshError
        If the mesh has several parts, or its boundary touches itself at a node.
    """
    rings = topology.boundary_rings(mesh.triangles)
    area = np.array([ring_area(mesh.points[ring]) for ring in rings])
    if (area > 0.0).sum() != 1:
        raise MeshError(
            f"the mesh has {int((area > 0.0).sum())} separate parts; only a connected "
            "mesh bounds one body of water"
        )
    nodes, count = np.unique(np.concatenate(rings), return_counts=True)
    if (count > 1).any():
        where = _at(mesh.projection, mesh.points[nodes[count > 1][0]])
        raise MeshError(
            f"the boundary of the mesh touches itself at {int((count > 1).sum())} "
            f"nodes, the first at {where}: `tidemesh info` lists such faults"
        )
    n_points = len(mesh.points)
    open_keys = [
        _edge_keys(np.append(s.nodes, s.nodes[:1] if s.closed else []), n_points)
        for s in mesh.boundaries
        if s.kind == "open"
    ]
    is_open = np.concatenate(open_keys) if open_keys else np.empty(0, dtype=np.int64)
    made = []
    for k in np.argsort(-area, kind="stable"):
        ring = rings[k]
        ocean = np.isin(_edge_keys(np.append(ring, ring[0]), n_points), is_open)
        made.append(Ring(mesh.points[ring], np.where(ocean, OCEAN, LAND)))
    return Domain(tuple(made), mesh.projection)


def _edge_keys(run: np.ndarray, n_points: int) -> np.ndarray:
    """One number for each edge of a run of nodes, whichever way it goes."""
    ends = np.sort(np.stack([run[:-1], run[1:]]).astype(np.int64), axis=0)
    return ends[0] * n_points + ends[1]


def segment_kinds(domain: Domain) -> np.ndarray:
    """Kinds of `ring_segments`: (n_ring_points,) int8, `LAND` or `OCEAN`."""
    return np.concatenate([ring.segment_kind for ring in domain.rings])


def _strings_of_ring(
    nodes: np.ndarray, is_open: np.ndarray, *, is_outer: bool
) -> list[BoundaryString]:
    if is_open.all():
        return [BoundaryString("open", nodes, closed=True)]
    if not is_open.any():
        if is_outer:
            return [BoundaryString("mainland", nodes, closed=True)]
        return [BoundaryString("island", nodes, closed=True, ibtype=1)]
    # Start the ring where a run starts, so that no run is cut in two.
    start = int(np.flatnonzero(is_open & ~np.roll(is_open, 1))[0])
    nodes = np.roll(nodes, -start)
    is_open = np.roll(is_open, -start)
    cuts = np.flatnonzero(np.diff(is_open)) + 1
    bounds = np.concatenate([[0], cuts, [len(nodes)]])
    closed_nodes = np.append(nodes, nodes[0])
    return [
        BoundaryString(
            "open" if is_open[begin] else "mainland", closed_nodes[begin : end + 1]
        )
        for begin, end in pairwise(bounds.tolist())
    ]


def _in_order(strings: list[BoundaryString]) -> tuple[BoundaryString, ...]:
    rank = {"open": 0, "mainland": 1, "island": 2}
    return tuple(sorted(strings, key=lambda string: rank[string.kind]))


def _lost_segments(segments: np.ndarray, edges: np.ndarray) -> np.ndarray:
    size = int(max(segments.max(), edges.max())) + 1
    have = edges[:, 0] * size + edges[:, 1]
    return np.flatnonzero(~np.isin(segments[:, 0] * size + segments[:, 1], have))


def _place(domain: Domain, point: np.ndarray) -> str:
    return _at(domain.projection, point)


def _at(projection: Projection, point: np.ndarray) -> str:
    if not projection.crs:
        return f"x {point[0]:.3f} m, y {point[1]:.3f} m"
    longitude, latitude = projection.inverse(point)
    return f"longitude {longitude:.5f}, latitude {latitude:.5f}"
