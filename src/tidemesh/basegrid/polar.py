"""Points on arcs about one or more centres (paper, section 3.2)."""

from __future__ import annotations

import math

import numpy as np
import shapely
from scipy.spatial import cKDTree

from tidemesh.basegrid.clearance import NearBoundary, inside
from tidemesh.basegrid.settings import BaseGridSettings, PolarCentre
from tidemesh.datatypes import Domain
from tidemesh.geometry.projection import Projection
from tidemesh.geometry.systems import DEGREES, PLANE, metres_per_unit


def polar_points(domain: Domain, settings: BaseGridSettings) -> np.ndarray:
    """Points of all families of arcs inside a domain, clear of its boundary.

    Each family fills its own region; where regions overlap the later family counts, and
    points of earlier ones that come too close to it are dropped.

    Returns
    -------
    points : (n, 2) float array
        Metres, family after family, from the innermost arc outwards.
    """
    projection = domain.projection
    kept = [np.empty((0, 3))]
    for number, centre in enumerate(settings.centres):
        points, spacing = arc_points(centre, projection)
        keep = _in_region(centre, points, projection) if centre.region_deg else ...
        points, spacing = points[keep], spacing[keep]
        for later in settings.centres[number + 1 :]:
            outside = ~_in_region(later, points, projection)
            points, spacing = points[outside], spacing[outside]
        if len(points) == 0:
            continue
        limit = settings.clearance * spacing
        distance, _ = NearBoundary(domain, spacing.min() / 8.0).query(
            points, limit.max()
        )
        keep = (distance >= limit) & inside(domain, points)
        kept.append(np.column_stack([points, limit])[keep])
    for number in range(len(kept) - 1):
        later = np.concatenate(kept[number + 1 :])
        if len(later):
            gap, _ = cKDTree(later[:, :2]).query(kept[number][:, :2])
            kept[number] = kept[number][gap >= kept[number][:, 2]]
    return np.concatenate(kept)[:, :2]


def arc_points(
    centre: PolarCentre, projection: Projection
) -> tuple[np.ndarray, np.ndarray]:
    """All points of one family: arc k of radius k dr, an angle 1/k apart.

    Returns
    -------
    points : (n, 2) float array
        Metres.
    spacing : (n,) float array
        Local node spacing (m).
    """
    span = math.tau
    if centre.to_deg is not None:
        span = math.radians(centre.to_deg - centre.from_deg)
    arc = np.arange(1, centre.arcs + 1)
    full = math.isclose(span, math.tau)
    # A full turn must not come closer than one step to its own first point; any other
    # ends on its last angle if that falls on a step.
    count = np.floor(span * arc * (1.0 + 1e-12)).astype(np.int64) + (0 if full else 1)
    k = np.repeat(arc, count)
    number = np.arange(len(k)) - np.repeat(np.cumsum(count) - count, count)
    angle = math.radians(centre.from_deg) + number / k
    turned = np.stack([np.cos(angle), np.sin(angle)], axis=1) * k[:, None]
    if centre.step_deg is not None:
        place = np.asarray(centre.center_deg) + centre.step_deg * turned
        system = DEGREES if projection.crs else PLANE
        along_x, along_y = metres_per_unit(system, place[:, 1])
        spacing = centre.step_deg * np.sqrt(along_x * along_y)
        return projection.forward(*place.T), spacing
    middle = projection.forward(*centre.center_deg)
    return middle + centre.step_m * turned, np.full(len(k), centre.step_m)


def _in_region(
    centre: PolarCentre, points: np.ndarray, projection: Projection
) -> np.ndarray:
    if centre.region_deg:
        polygon = shapely.Polygon(centre.region_deg)
        shapely.prepare(polygon)
        places = projection.inverse(points)
        places[:, 0] -= _whole_turns(places[:, 0] - polygon.centroid.x, projection)
        return shapely.contains_xy(polygon, *places.T)
    if centre.step_deg is not None:
        offset = projection.inverse(points) - np.asarray(centre.center_deg)
        offset[:, 0] -= _whole_turns(offset[:, 0], projection)
        offset = offset / centre.step_deg
    else:
        offset = (points - projection.forward(*centre.center_deg)) / centre.step_m
    near = np.hypot(*offset.T) <= centre.arcs + 0.5
    if centre.to_deg is None:
        return near
    angle = np.degrees(np.arctan2(offset[:, 1], offset[:, 0]))
    return near & ((angle - centre.from_deg) % 360.0 <= centre.to_deg - centre.from_deg)


def _whole_turns(longitude_deg: np.ndarray, projection: Projection) -> np.ndarray:
    """What to take off for the least longitudes: users count 182 E or 178 W."""
    if not projection.crs:
        return np.zeros(len(longitude_deg))
    return 360.0 * np.round(longitude_deg / 360.0)
