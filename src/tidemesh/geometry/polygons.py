"""Polygons as arrays and back; thin layers over shapely that the rooms share."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import shapely
from shapely import Geometry, LinearRing, MultiPolygon, Polygon


def ring_area(points: np.ndarray) -> float:
    """Signed area of a closed ring (n, 2), positive when counter-clockwise.

    The first point is not repeated. Computed about the first point, so that large
    map coordinates cost no digits.

    Examples
    --------
    >>> ring_area(np.array([[0.0, 0.0], [2.0, 0.0], [2.0, 1.0], [0.0, 1.0]]))
    2.0
    """
    x, y = (points - points[0]).T
    return 0.5 * float(np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y))


def open_ring(ring: LinearRing) -> np.ndarray:
    """Coordinates (n, 2) of a shapely ring without the repeated last point."""
    return shapely.get_coordinates(ring)[:-1]


def polygon_parts(geometry: Geometry | None) -> list[Polygon]:
    """Every polygon of non-zero area in a geometry, lines and points left out."""
    if geometry is None or geometry.is_empty:
        return []
    parts = shapely.get_parts(geometry)
    while any(part.geom_type == "GeometryCollection" for part in parts):
        parts = shapely.get_parts(parts)
    parts = shapely.get_parts(parts)
    return [p for p in parts if p.geom_type == "Polygon" and p.area > 0.0]


def polygonal(geometry: Geometry | None) -> MultiPolygon:
    """The polygons of a geometry alone; overlays also leave lines and points."""
    return MultiPolygon(polygon_parts(geometry))


def polygon_rings(polygon: Polygon) -> list[np.ndarray]:
    """Rings of a polygon with its inside on the left: outer first, then the holes.

    The outer ring runs counter-clockwise and the holes clockwise; no ring repeats its
    first point.
    """
    rings = [open_ring(polygon.exterior)]
    rings += [open_ring(ring) for ring in polygon.interiors]
    wanted = [1.0] + [-1.0] * (len(rings) - 1)
    return [
        ring if ring_area(ring) * sign > 0.0 else ring[::-1]
        for ring, sign in zip(rings, wanted)
    ]


def holes(polygon: Polygon) -> np.ndarray:
    """The holes of a polygon as an array (n,) of polygons."""
    return np.array([Polygon(ring) for ring in polygon.interiors], dtype=object)


def without_holes(polygon: Polygon, dropped: np.ndarray) -> Polygon:
    """A polygon without those of its holes that are marked in an (n,) bool array."""
    kept = [ring for ring, drop in zip(polygon.interiors, dropped) if not drop]
    return Polygon(polygon.exterior, kept)


def from_rings(rings: list[np.ndarray]) -> Polygon:
    """Polygon of an outer ring and holes; it need not be valid."""
    return Polygon(rings[0], rings[1:])


def transform(geometry: Geometry, function: Callable[[np.ndarray], np.ndarray]):
    """Apply a map of coordinates, (n, 2) -> (n, 2), to a geometry or array of them."""
    return shapely.transform(geometry, function)


def lexicographic_first(points: np.ndarray) -> int:
    """Index of the westernmost point, the southernmost of those on a tie."""
    return int(np.lexsort((points[:, 1], points[:, 0]))[0])


def path_length(points: np.ndarray) -> np.ndarray:
    """Length from the first point to every point of a path: (n, 2) -> (n,)."""
    steps = np.hypot(*np.diff(points, axis=0).T)
    return np.concatenate([[0.0], np.cumsum(steps)])


def divide_path(
    points: np.ndarray, spacing: float, measure: np.ndarray | None = None
) -> np.ndarray:
    """Nodes at equal steps along a path, its two ends included.

    Parameters
    ----------
    points : (n, 2) array
        The path.
    spacing : float
        Wanted step; the step taken is the nearest that divides the path evenly.
    measure : (n, 2) array, optional
        The same path in the coordinates in which the step is measured.

    Returns
    -------
    nodes : (k, 2) array
    """
    length = path_length(points if measure is None else measure)
    count = max(1, round(length[-1] / spacing))
    places = np.linspace(0.0, length[-1], count + 1)
    nodes = np.stack([np.interp(places, length, column) for column in points.T], axis=1)
    nodes[0], nodes[-1] = points[0], points[-1]
    return nodes
