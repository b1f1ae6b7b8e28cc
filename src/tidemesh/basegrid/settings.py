"""Settings of the base grid and of its depths."""

from __future__ import annotations

from typing import Annotated, Literal

import msgspec

_STRICT = {"frozen": True, "kw_only": True, "forbid_unknown_fields": True}
_Positive = Annotated[float, msgspec.Meta(gt=0)]
_NotNegative = Annotated[float, msgspec.Meta(ge=0)]
_LonLat = tuple[
    Annotated[float, msgspec.Meta(ge=-360, le=360)],
    Annotated[float, msgspec.Meta(ge=-90, le=90)],
]


class PolarCentre(msgspec.Struct, **_STRICT):
    """One family of arcs (paper, section 3.2).

    Arc k has the radius k * step; its nodes start at `from_deg` and follow one another
    at a distance of one step along the arc.
    """

    center_deg: _LonLat
    """Longitude and latitude of the centre."""
    arcs: Annotated[int, msgspec.Meta(ge=1)]
    """Number of arcs."""
    step_deg: _Positive | None = None
    """Radius step in degrees: the arcs are circles in longitude and latitude, as in the
    paper. Give this or `step_m`."""
    step_m: _Positive | None = None
    """Radius step in metres: the arcs are circles in the projected plane."""
    from_deg: float = 135.0
    """Angle of the first node, anticlockwise from east; the paper starts at 135."""
    to_deg: float | None = None
    """Last angle; a full turn when left out."""
    region_deg: tuple[_LonLat, ...] = ()
    """Polygon (longitude, latitude) that these arcs fill, and nobody else's do. When
    left out it is the sector covered by the arcs: everything, for the first centre."""

    def __post_init__(self) -> None:
        if (self.step_deg is None) == (self.step_m is None):
            raise ValueError("give either step_deg or step_m")
        if self.to_deg is not None and not 0 < self.to_deg - self.from_deg <= 360:
            raise ValueError("to_deg must be above from_deg by at most 360 degrees")
        if len(self.region_deg) in (1, 2):
            raise ValueError("region_deg needs at least three corners")


class BaseGridSettings(msgspec.Struct, **_STRICT):
    """Interior points of the base grid."""

    kind: Literal["hexagonal", "polar"] = "hexagonal"
    """"hexagonal": an equilateral lattice in the projected plane, the patch on which
    the truncation error is derived. "polar": the arcs of the paper."""
    spacing_m: _Positive = 900.0
    """Node spacing of the hexagonal lattice; 900 m is the paper's."""
    clearance: Annotated[float, msgspec.Meta(ge=0.1, le=1.0)] = 0.6
    """Points closer to the boundary than this share of the local spacing are dropped:
    0.6 lies midway between a boundary triangle too flat and one too tall."""
    transition: bool = True
    """Fill in halved lattices where boundary nodes are closer than the lattice
    (hexagonal only)."""
    transition_gradation: Annotated[float, msgspec.Meta(gt=0, le=1)] = 0.3
    """Growth of the spacing per metre of distance from such a boundary."""
    centres: tuple[PolarCentre, ...] = ()
    """Families of arcs (polar only); later ones take over from earlier ones."""

    def __post_init__(self) -> None:
        if self.kind == "polar" and not self.centres:
            raise ValueError('kind "polar" needs at least one entry in centres')
        if self.kind == "hexagonal" and self.centres:
            raise ValueError('centres belong to kind "polar"')


class DepthSource(msgspec.Struct, **_STRICT):
    """One file of bed elevations or depths."""

    path: str
    """NetCDF, GeoTIFF or another raster; or soundings as CSV (.csv, .csv.gz, .txt)."""
    kind: Literal["auto", "raster", "soundings"] = "auto"
    """"auto" goes by the file's ending."""
    variable: str | None = None
    """NetCDF variable, band number, or column of the soundings; guessed if there is
    only one that fits."""
    positive: Literal["auto", "up", "down"] = "auto"
    """"up" for elevations, "down" for depths; "auto" reads it from the file."""
    crs: str | None = None
    """Coordinate reference system, where the file names none, for instance
    "EPSG:32617"; "plane" for a case without a place."""
    fill_value: float | None = None
    """Number that stands for "unknown", where the file does not say."""


class DepthSettings(msgspec.Struct, **_STRICT):
    """Where the depths come from, and how they are put on nodes."""

    sources: tuple[DepthSource, ...] = ()
    """In order of priority: the first that knows a place decides."""
    minimum_m: _Positive = 1.5
    """Least depth: below it a linear tide would run dry at low water here."""
    land: Literal["drop", "minimum", "use"] = "drop"
    """Cells above the water level: "drop" leaves them out of every mean, so that land
    heights do not bleed into the water; "minimum" counts them with the least depth;
    "use" takes their height."""
    averaging: bool = True
    """Average over the area that a node stands for where that is larger than a cell."""
    conserve_volume: bool = True
    """Correct the depths of nodes by what the linear depth of their triangles misses of
    the water volume. Without it a coarse mesh is too deep over hollow beds."""
    fill: Literal["nearest", "error"] = "nearest"
    """Nodes for which no source has water: take the nearest water, or stop."""
    max_fill_km: _NotNegative = 50.0
    """Farthest "nearest water" where the sources say land (harbours and rivers that a
    coarse raster does not show)."""
    max_hole_km: _NotNegative = 5.0
    """Farthest "nearest water" where the sources say nothing: a wider gap is a hole in
    the coverage, and an error."""
