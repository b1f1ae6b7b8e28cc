"""What the user decides about the domain."""

from __future__ import annotations

from typing import Annotated, Literal

import msgspec

Positive = Annotated[float, msgspec.Meta(gt=0)]
NotNegative = Annotated[float, msgspec.Meta(ge=0)]
Place = tuple[float, float]
"""Longitude and latitude (degrees)."""

_STRICT = {"frozen": True, "kw_only": True, "forbid_unknown_fields": True}


class _OceanSpacing(msgspec.Struct, **_STRICT):
    """Node spacing on the open boundary; without either, that of the shoreline."""

    spacing_m: Positive | None = None
    """Node spacing (m)."""
    spacing_deg: Positive | None = None
    """Node spacing along the line in degrees (the paper's 0.00834 degrees of arc)."""

    def __post_init__(self) -> None:
        if self.spacing_m is not None and self.spacing_deg is not None:
            raise ValueError("give spacing_m or spacing_deg, not both")


class OceanArc(_OceanSpacing, tag="arc", tag_field="kind", **_STRICT):
    """Open boundary on a circle: the domain is the water inside."""

    center_deg: Place
    """Longitude and latitude of the centre."""
    radius_deg: Positive | None = None
    """Radius in degrees: a circle in longitude and latitude, as in the paper."""
    radius_km: Positive | None = None
    """Radius (km) of a circle on the map."""

    def __post_init__(self) -> None:
        super().__post_init__()
        if (self.radius_deg is None) == (self.radius_km is None):
            raise ValueError("give exactly one of radius_deg and radius_km")


class OceanPolygon(_OceanSpacing, tag="polygon", tag_field="kind", **_STRICT):
    """Open boundary on the sides of a polygon: the domain is the water inside."""

    polygon_deg: tuple[Place, ...] | None = None
    """Corners, longitude and latitude; sides are straight in degrees."""
    file: str | None = None
    """The polygon as a file (GeoJSON, GeoPackage, Shapefile)."""

    def __post_init__(self) -> None:
        super().__post_init__()
        if (self.polygon_deg is None) == (self.file is None):
            raise ValueError("give exactly one of polygon_deg and file")
        if self.polygon_deg is not None and len(self.polygon_deg) < 3:
            raise ValueError("polygon_deg needs at least three corners")


class OceanEdges(_OceanSpacing, tag="box", tag_field="kind", **_STRICT):
    """Open boundary on edges of the box: the domain is the water in the box."""

    edges: Annotated[
        tuple[Literal["south", "east", "north", "west"], ...],
        msgspec.Meta(min_length=1),
    ]
    """Edges of the box that are open sea."""


class Region(msgspec.Struct, **_STRICT):
    """A part of the coast with its own spacing, and perhaps its own shoreline.

    Where regions overlap the one listed last counts.
    """

    name: str
    polygon_deg: Annotated[tuple[Place, ...], msgspec.Meta(min_length=3)]
    """Corners, longitude and latitude."""
    min_spacing_m: Positive | None = None
    min_spacing_deg: Positive | None = None
    """Least node spacing in here; in the unit used for the domain. Without it, the
    domain's."""
    shoreline: str | None = None
    """A finer shoreline that replaces the domain's inside the polygon."""
    narrow_water_width_m: Positive | None = None
    """Width below which water is removed (m). Without it, the region's spacing."""
    min_island_area_km2: NotNegative | None = None
    """Islands below this area (km2) are dropped. Without it, the domain's."""


class DomainSettings(msgspec.Struct, **_STRICT):
    """Where the domain lies and how its boundary is resolved (paper, section 3.1)."""

    shoreline: str
    """Land polygons or coastlines (GeoJSON, GeoPackage, Shapefile)."""
    layer: str | None = None
    """Layer of the shoreline file, where it has several."""
    land_on: Literal["left", "right"] = "left"
    """Side of the land along open coastlines; left is the custom of OpenStreetMap."""
    repair: bool = False
    """Mend self-crossings and duplicates of the shoreline instead of refusing them."""
    box_deg: tuple[float, float, float, float]
    """West, south, east, north (degrees). West > east crosses the date line."""
    projection: str = "stereographic"
    """ "stereographic" (conformal, so equilateral triangles stay so) or
    "equirectangular" (ADCIRC's own), both about the box's centre; any projected system,
    for instance "EPSG:32617"; or "none": coordinates are metres on a plane."""
    ocean: OceanArc | OceanPolygon | OceanEdges
    """The open boundary."""
    inside_deg: Place | None = None
    """A place in the water to keep, should the shoreline part it into several."""
    min_spacing_m: Positive | None = None
    min_spacing_deg: Positive | None = None
    """Least node spacing of the shoreline d_min: exactly one of metres and degrees. In
    degrees, distances are taken in longitude and latitude alike, as in the paper."""
    max_spacing_factor: Annotated[float, msgspec.Meta(ge=1.5, le=10.0)] = 1.75
    """Greatest spacing over d_min. The paper's 1.75; below 1.5 many lines cannot be
    divided at all."""
    min_island_area_km2: NotNegative = 0.0
    """Islands below this area (km2) are dropped. Those too small for a triangle of side
    d_min go in any case."""
    narrow_water: Literal["remove", "keep"] = "remove"
    """What becomes of water narrower than narrow_water_width_m."""
    narrow_water_width_m: Positive | None = None
    """Width below which water is removed (m). Without it, d_min, as in the paper: one
    element between opposite banks."""
    regions: tuple[Region, ...] = ()

    def __post_init__(self) -> None:
        if (self.min_spacing_m is None) == (self.min_spacing_deg is None):
            raise ValueError("give exactly one of min_spacing_m and min_spacing_deg")
        west, south, east, north = self.box_deg
        if south >= north or west == east:
            raise ValueError(
                "box_deg is west, south, east, north, with south < north and "
                f"west != east; got {list(self.box_deg)}"
            )
        unused = "min_spacing_deg" if self.min_spacing_m else "min_spacing_m"
        for region in self.regions:
            if getattr(region, unused) is not None:
                raise ValueError(
                    f'region "{region.name}" gives {unused}, the domain does not: '
                    "use one unit"
                )
