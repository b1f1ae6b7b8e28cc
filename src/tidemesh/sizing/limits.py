"""Least and greatest spacings: the user's, the boundary's, the channels', Courant's."""

from __future__ import annotations

import numpy as np
import shapely
from numpy.typing import ArrayLike

from tidemesh.constants import GRAVITY
from tidemesh.datatypes import CoastalMesh
from tidemesh.sizing.settings import SizingSettings
from tidemesh.triangulation import topology
from tidemesh.triangulation.delaunay import constrained_delaunay

# A line between two banks counts as a crossing if the way along the shore is at least
# this many times longer: a bay at least as long as it is wide.
_DETOUR = 3.0


def spacing_limits(
    mesh: CoastalMesh, settings: SizingSettings
) -> tuple[np.ndarray, np.ndarray]:
    """Least and greatest spacing at every node.

    Parameters
    ----------
    mesh : CoastalMesh
        Base mesh.
    settings : SizingSettings

    Returns
    -------
    least, greatest : (n_points,) arrays
        m; 0 and infinity where there is no limit. Where they contradict each other the
        user's least spacing prevails over the channels' greatest, and a region's
        limits over the general ones.
    """
    n_points = len(mesh.points)
    least = np.full(n_points, settings.min_m or 0.0)
    greatest = np.full(n_points, settings.max_m or np.inf)
    if settings.time_step_s is not None:
        celerity = np.sqrt(GRAVITY * np.maximum(mesh.depth, 0.0))
        least = np.maximum(least, celerity * settings.time_step_s / settings.courant)
    for region in settings.regions:
        corners = np.asarray(region.polygon_deg)
        ring = mesh.projection.forward(corners[:, 0], corners[:, 1])
        inside = shapely.contains_xy(shapely.Polygon(ring), *mesh.points.T)
        if region.min_m is not None:
            least[inside] = region.min_m
        if region.max_m is not None:
            greatest[inside] = region.max_m
            least[inside] = np.minimum(least[inside], region.max_m)

    if settings.channel_elements > 0.0:
        channel = feature_width(mesh) / settings.channel_elements
        greatest = np.minimum(greatest, np.maximum(channel, least))
    if settings.follow_boundary:
        greatest = np.minimum(greatest, np.maximum(boundary_spacing(mesh), least))
    return least, np.maximum(greatest, least)


def clip(spacing: ArrayLike, least: np.ndarray, greatest: np.ndarray) -> np.ndarray:
    """Bring a spacing between its limits: (n,) m."""
    return np.minimum(np.maximum(spacing, least), greatest)


def boundary_spacing(mesh: CoastalMesh) -> np.ndarray:
    """Mean length (m) of the two boundary edges of a node: (n_points,).

    Infinite at interior nodes.
    """
    edge = topology.boundary_edges(mesh.triangles)
    length = np.linalg.norm(mesh.points[edge[:, 0]] - mesh.points[edge[:, 1]], axis=1)
    n_points = len(mesh.points)
    total = np.bincount(edge.ravel(), np.repeat(length, 2), n_points)
    count = np.bincount(edge.ravel(), minlength=n_points)
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.where(count > 0, total / count, np.inf)


def feature_width(mesh: CoastalMesh) -> np.ndarray:
    """Width of the water at the nodes of channels, inlets and straits.

    Parameters
    ----------
    mesh : CoastalMesh

    Returns
    -------
    (n_points,) array
        m; infinite in open water and at interior nodes, which take part by gradation.

    Notes
    -----
    The boundary points alone are triangulated. An edge through the water whose ends lie
    on land of different rings, or of one ring but far apart along it, crosses from
    bank to bank; the shortest crossing at a node is the width there.
    """
    rings = topology.boundary_rings(mesh.triangles)
    node = np.concatenate(rings)
    points = mesh.points[node]
    ring, position, perimeter = _along_rings(mesh.points, rings)
    first = np.concatenate([[0], np.cumsum([len(r) for r in rings])])
    following = np.arange(1, len(node) + 1)
    following[first[1:] - 1] = first[:-1]
    segments = np.stack([np.arange(len(node)), following], axis=1)

    edge = topology.edges(constrained_delaunay(points, segments))
    start, end = edge.T
    chord = np.linalg.norm(points[start] - points[end], axis=1)
    along = np.abs(position[start] - position[end])
    along = np.minimum(along, perimeter[ring[start]] - along)
    crosses = (ring[start] != ring[end]) | (along >= _DETOUR * chord)
    at_sea = np.isin(node, mesh.open_nodes)
    crosses &= ~at_sea[start] & ~at_sea[end]

    width = np.full(len(mesh.points), np.inf)
    for side in (start, end):
        np.minimum.at(width, node[side[crosses]], chord[crosses])
    return width


def _along_rings(
    points: np.ndarray, rings: list[np.ndarray]
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Ring and distance along it of every ring point, and the rings' perimeters."""
    positions, perimeters = [], []
    for ring in rings:
        step = np.linalg.norm(points[np.roll(ring, -1)] - points[ring], axis=1)
        positions.append(np.concatenate([[0.0], np.cumsum(step[:-1])]))
        perimeters.append(step.sum())
    number = np.repeat(np.arange(len(rings)), [len(ring) for ring in rings])
    return number, np.concatenate(positions), np.array(perimeters)
