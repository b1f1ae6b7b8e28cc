"""The open boundary: the line between the domain and the sea outside."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import shapely
from shapely import Geometry, Polygon

from tidemesh.boundary.plane import (
    WorkPlane,
    box_in_degrees,
    follow_in_degrees,
    unwrapped_box,
)
from tidemesh.boundary.settings import (
    DomainSettings,
    OceanArc,
    OceanEdges,
    OceanPolygon,
)
from tidemesh.errors import InputError
from tidemesh.geometry.polygons import (
    divide_path,
    lexicographic_first,
    path_length,
    polygon_parts,
    transform,
)

_ARC_POINTS = 7200
_CORNER_DEG = 20.0


def box_polygon(settings: DomainSettings, plane: WorkPlane) -> Polygon:
    """The box in work coordinates."""
    return transform(box_in_degrees(settings), plane.from_degrees)


def ocean_polygon(
    settings: DomainSettings, plane: WorkPlane, drawn: Geometry | None = None
) -> tuple[Polygon, Geometry]:
    """Polygon of the seaward limit, and that part of its outline that may be open.

    Parameters
    ----------
    settings : DomainSettings
    plane : WorkPlane
    drawn : geometry, optional
        The polygon of ``settings.ocean.file`` in degrees.

    Returns
    -------
    polygon, line : geometries in work coordinates

    Raises
    ------
    InputError
        If the polygon is missing or crosses itself.
    """
    ocean = settings.ocean
    if isinstance(ocean, OceanArc):
        polygon = _disc(ocean, plane)
        return polygon, polygon.exterior
    if isinstance(ocean, OceanPolygon):
        polygon = _drawn_polygon(ocean, drawn)
        polygon = transform(follow_in_degrees(polygon, settings), plane.from_degrees)
        return polygon, polygon.exterior
    return box_polygon(settings, plane), _box_edges(settings, ocean, plane)


def _disc(ocean: OceanArc, plane: WorkPlane) -> Polygon:
    angle = np.linspace(0.0, 2.0 * np.pi, _ARC_POINTS, endpoint=False)
    circle = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    center = np.array([ocean.center_deg], dtype=np.float64)
    if ocean.radius_deg is not None:
        return Polygon(plane.from_degrees(center + ocean.radius_deg * circle))
    center = plane.projection.forward(center[:, 0], center[:, 1])
    metres = center + 1000.0 * ocean.radius_km * circle
    if plane.in_degrees:
        return Polygon(plane.projection.inverse(metres))
    return Polygon(metres)


def _drawn_polygon(ocean: OceanPolygon, drawn: Geometry | None) -> Polygon:
    if ocean.file is None:
        polygon = Polygon(ocean.polygon_deg)
        name = "domain.ocean.polygon_deg"
    else:
        name = ocean.file
        parts = polygon_parts(drawn)
        if len(parts) != 1:
            raise InputError(
                f"{name}: expected one polygon for the open boundary, "
                f"found {len(parts)}"
            )
        polygon = Polygon(parts[0].exterior)
    if not polygon.is_valid:
        raise InputError(
            f"{name}: the polygon of the open boundary crosses itself "
            f"({shapely.is_valid_reason(polygon)}): list its corners in order"
        )
    return polygon


def _box_edges(
    settings: DomainSettings, ocean: OceanEdges, plane: WorkPlane
) -> Geometry:
    outline = shapely.get_coordinates(box_in_degrees(settings))
    west, south, east, north = unwrapped_box(settings)
    sides = {"west": (0, west), "east": (0, east), "south": (1, south)}
    sides["north"] = (1, north)
    lines = []
    for edge in sorted(set(ocean.edges)):
        axis, value = sides[edge]
        along = outline[outline[:, axis] == value]
        order = np.argsort(along[:, 1 - axis], kind="stable")
        lines.append(shapely.LineString(plane.from_degrees(along[order])))
    return shapely.line_merge(shapely.union_all(lines))


def ocean_nodes(
    string: np.ndarray, closed: bool, settings: DomainSettings, plane: WorkPlane
) -> np.ndarray:
    """Nodes of one open string at their own spacing, its ends and corners kept.

    Parameters
    ----------
    string : (n, 2) array
        Work coordinates; a closed string does not repeat its first point.
    closed : bool
        Whether the string is a whole ring.

    Returns
    -------
    nodes : (k, 2) array
        With both ends of an open string.
    """
    ocean = settings.ocean
    minimum = settings.min_spacing_deg or settings.min_spacing_m
    string = _without_stubs(string, 0.01 * minimum)
    if closed:
        string = _from_a_corner(string)
        string = np.concatenate([string, string[:1]])
    if ocean.spacing_deg is not None:
        spacing, measure = ocean.spacing_deg, plane.to_degrees(string)
    elif ocean.spacing_m is not None:
        spacing, measure = ocean.spacing_m, plane.to_metres(string)
    else:
        spacing, measure = 1.25 * minimum, string
    if closed:
        spacing = min(spacing, np.hypot(*np.diff(measure, axis=0).T).sum() / 3.0)
    cuts = [0, *_corners(string).tolist(), len(string) - 1]
    pieces = [
        divide_path(string[a : b + 1], spacing, measure[a : b + 1])
        for a, b in pairwise(cuts)
    ]
    nodes = np.concatenate([piece[:-1] for piece in pieces] + [string[-1:]])
    return nodes[:-1] if closed else nodes


def _without_stubs(string: np.ndarray, least: float) -> np.ndarray:
    # Cutting at the shore leaves steps of rounding size, whose direction is chance.
    length = path_length(string)
    cell = np.floor(length / least)
    keep = np.append(True, cell[1:] != cell[:-1])
    keep &= length[-1] - length > least
    keep[[0, -1]] = True
    return string[keep]


def _from_a_corner(ring: np.ndarray) -> np.ndarray:
    corners = _corners(np.concatenate([ring[-1:], ring, ring[:1]])) - 1
    start = corners[0] if len(corners) else lexicographic_first(ring)
    return np.roll(ring, -start, axis=0)


def _corners(string: np.ndarray) -> np.ndarray:
    ahead = np.diff(string, axis=0)
    heading = np.arctan2(ahead[:, 1], ahead[:, 0])
    turn = (np.diff(heading) + np.pi) % (2.0 * np.pi) - np.pi
    return np.flatnonzero(np.abs(turn) > np.radians(_CORNER_DEG)) + 1
