"""Constrained Delaunay triangulation of a region; the one door to pythoncdt."""

from __future__ import annotations

import numpy as np
import pythoncdt as cdt

from tidemesh.errors import MeshError


def constrained_delaunay(points: np.ndarray, segments: np.ndarray) -> np.ndarray:
    """Triangulate the region enclosed by segments, holes left out.

    Parameters
    ----------
    points : (n, 2) float array
        Metres. Finite and unique.
    segments : (m, 2) int array
        Point indices of the boundary segments, closed rings in any order and
        direction; islands are the rings inside another ring.

    Returns
    -------
    triangles : (n_triangles, 3) int64 array
        Counter-clockwise point indices.

    Raises
    ------
    MeshError
        If coordinates are not finite, points coincide, indices are out of range or
        segments cross.
    """
    points = np.ascontiguousarray(points, dtype=np.float64)
    segments = np.ascontiguousarray(segments, dtype=np.int64)
    _check(points, segments)
    triangulation = cdt.Triangulation(
        cdt.VertexInsertionOrder.AUTO, cdt.IntersectingConstraintEdges.NOT_ALLOWED, 0.0
    )
    try:
        triangulation.insert_vertices(points)
        triangulation.insert_edges(segments.astype(np.uint32))
    except RuntimeError as error:
        raise MeshError(f"the boundary cannot be triangulated: {error}") from error
    triangulation.erase_outer_triangles_and_holes()
    records = triangulation.triangles_array()
    return np.ascontiguousarray(records["vertices"], dtype=np.int64)


def _check(points: np.ndarray, segments: np.ndarray) -> None:
    # The library allocates without end on NaN and says little on a bad index.
    if not np.isfinite(points).all():
        bad = int(np.flatnonzero(~np.isfinite(points).all(axis=1))[0])
        raise MeshError(f"point {bad} is not finite: {points[bad]}")
    if len(segments) and (segments.min() < 0 or segments.max() >= len(points)):
        raise MeshError(
            f"a segment names point {int(segments.max())} of {len(points)} points"
        )
    order = np.lexsort((points[:, 1], points[:, 0]))
    same = (np.diff(points[order], axis=0) == 0.0).all(axis=1)
    if same.any():
        first = order[np.flatnonzero(same)[0]]
        raise MeshError(f"two points coincide at {points[first]}")
