"""The plane in which the boundary is built: metres, or the paper's degrees."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import shapely

from tidemesh.boundary.settings import DomainSettings, Region
from tidemesh.constants import EARTH_RADIUS
from tidemesh.errors import InputError
from tidemesh.geometry.polygons import transform
from tidemesh.geometry.projection import Projection

_DEGREE_M = math.radians(1.0) * EARTH_RADIUS


@dataclass(frozen=True)
class WorkPlane:
    """Coordinates of the boundary work, and the ways to degrees and metres."""

    projection: Projection
    in_degrees: bool
    """True: work coordinates are longitude and latitude, both counted alike."""
    west_deg: float
    """Longitudes come back in [west_deg, west_deg + 360), as the user's box counts."""

    def from_degrees(self, places: np.ndarray) -> np.ndarray:
        """Longitude and latitude (n, 2) to work coordinates."""
        if self.in_degrees:
            return np.asarray(places, dtype=np.float64)
        return self.projection.forward(places[:, 0], places[:, 1])

    def to_degrees(self, points: np.ndarray) -> np.ndarray:
        """Work coordinates (n, 2) to longitude and latitude."""
        if self.in_degrees or not self.projection.crs:
            return points
        places = self.projection.inverse(points)
        start = self.west_deg - 1.0
        places[:, 0] = (places[:, 0] - start) % 360.0 + start
        return places

    def to_metres(self, points: np.ndarray) -> np.ndarray:
        """Work coordinates (n, 2) to metres."""
        if not self.in_degrees:
            return points
        return self.projection.forward(points[:, 0], points[:, 1])

    def length(self, metres: float) -> float:
        """A length in metres as a length in work coordinates."""
        return metres / _DEGREE_M if self.in_degrees else metres

    def area_m2(self, geometry: shapely.Geometry) -> float:
        """Area of a geometry in work coordinates (m2)."""
        return transform(geometry, self.to_metres).area

    def place(self, geometry: shapely.Geometry) -> tuple[float, float]:
        """Longitude and latitude of a point on a geometry."""
        point = shapely.get_coordinates(geometry.point_on_surface())
        longitude, latitude = self.to_degrees(point)[0]
        return float(longitude), float(latitude)


def work_plane(settings: DomainSettings) -> WorkPlane:
    """Plane about the centre of the box.

    Raises
    ------
    InputError
        If the projection is not known or cannot show the box.
    """
    west, south, east, north = unwrapped_box(settings)
    name = settings.projection
    longitude, latitude = 0.5 * (west + east), 0.5 * (south + north)
    if name == "none":
        projection = Projection("")
        if settings.min_spacing_deg is not None:
            raise InputError(
                'domain.projection = "none" has no degrees: give min_spacing_m'
            )
    elif name == "stereographic":
        projection = Projection.stereographic(longitude, latitude)
    elif name == "equirectangular":
        projection = Projection.equirectangular(longitude, latitude)
    else:
        projection = Projection(name)
    corners = projection.forward([west, west, east, east], [south, north, south, north])
    if not np.isfinite(corners).all():
        raise InputError(
            f'projection "{name}" cannot show the box {list(settings.box_deg)}: '
            "choose a system made for this place"
        )
    return WorkPlane(projection, settings.min_spacing_deg is not None, west)


def unwrapped_box(settings: DomainSettings) -> tuple[float, float, float, float]:
    """West, south, east, north with west < east, also across the date line."""
    west, south, east, north = settings.box_deg
    return west, south, east + 360.0 if east < west else east, north


def box_in_degrees(settings: DomainSettings) -> shapely.Polygon:
    """The box with so many points on its sides that they stay lines on any map.

    A parallel is curved on most maps. Between two points at a distance s it leaves the
    chord by some s**2 / (8 * 10,000 km); s is such that this is a millionth of the
    spacing.
    """
    box = shapely.box(*unwrapped_box(settings))
    if settings.projection == "none" or settings.min_spacing_m is None:
        return box
    step = math.sqrt(80.0 * settings.min_spacing_m) / _DEGREE_M
    return shapely.segmentize(box, min(max(step, box.length / 50_000.0), 0.02))


def follow_in_degrees(geometry: shapely.Geometry, settings: DomainSettings):
    """Lines that are straight in degrees, followed in steps of at most 0.02 degrees."""
    if settings.projection == "none":
        return geometry
    return shapely.segmentize(geometry, 0.02)


@dataclass(frozen=True)
class LocalSettings:
    """Spacing, narrow-water width and island area of one part of the coast."""

    polygon: shapely.Polygon | None
    """Where they hold, in work coordinates; None for everywhere else."""
    minimum: float
    """Least spacing, work units."""
    width: float
    """Width below which water is removed, work units; 0 keeps all."""
    island_m2: float
    """Islands below this area go."""


class LocalRules:
    """The domain's settings and those of its regions, looked up by place."""

    def __init__(self, settings: DomainSettings, plane: WorkPlane):
        self._plane = plane
        self.parts = [self._read(settings, settings, None)]
        for region in settings.regions:
            ring = follow_in_degrees(shapely.Polygon(region.polygon_deg), settings)
            polygon = transform(ring, plane.from_degrees)
            if not polygon.is_valid:
                raise InputError(
                    f'the polygon of region "{region.name}" crosses itself: '
                    "list its corners in order"
                )
            shapely.prepare(polygon)
            self.parts.append(self._read(region, settings, polygon))

    def _read(
        self,
        local: DomainSettings | Region,
        settings: DomainSettings,
        polygon: shapely.Polygon | None,
    ) -> LocalSettings:
        if self._plane.in_degrees:
            minimum = local.min_spacing_deg or settings.min_spacing_deg
        else:
            minimum = local.min_spacing_m or settings.min_spacing_m
        width = local.narrow_water_width_m
        if width is None and local.min_spacing_m is None:
            width = local.min_spacing_deg is None and settings.narrow_water_width_m
        width = self._plane.length(width) if width else minimum
        if settings.narrow_water == "keep":
            width = 0.0
        island_km2 = local.min_island_area_km2
        if island_km2 is None:
            island_km2 = settings.min_island_area_km2
        return LocalSettings(polygon, minimum, width, island_km2 * 1e6)

    @property
    def coarsest(self) -> float:
        """Greatest of the least spacings."""
        return max(part.minimum for part in self.parts)

    @property
    def finest(self) -> float:
        """Least of the least spacings."""
        return min(part.minimum for part in self.parts)

    def minimum(self, points: np.ndarray) -> np.ndarray:
        """Least spacing at points: (n, 2) -> (n,)."""
        return self._look_up("minimum", points)

    def width(self, points: np.ndarray) -> np.ndarray:
        """Width below which water is removed, at points: (n, 2) -> (n,)."""
        return self._look_up("width", points)

    def island_m2(self, points: np.ndarray) -> np.ndarray:
        """Least island area at points: (n, 2) -> (n,)."""
        return self._look_up("island_m2", points)

    def _look_up(self, name: str, points: np.ndarray) -> np.ndarray:
        values = np.full(len(points), getattr(self.parts[0], name))
        for part in self.parts[1:]:
            inside = shapely.contains_xy(part.polygon, points[:, 0], points[:, 1])
            values[inside] = getattr(part, name)
        return values
