"""Settings of the sizes (section 3.4)."""

from __future__ import annotations

from typing import Annotated, Literal

import msgspec

from tidemesh.sizing.rules import RULES

Positive = Annotated[float, msgspec.Meta(gt=0)]
RuleName = Literal[tuple(RULES)]


class SizeRegion(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A polygon with its own limits, in place of the general ones."""

    polygon_deg: Annotated[list[tuple[float, float]], msgspec.Meta(min_length=3)]
    """Corners, longitude and latitude."""
    min_m: Positive | None = None
    """Least spacing there (m)."""
    max_m: Positive | None = None
    """Greatest spacing there (m)."""
    name: str = ""


class SizingSettings(
    msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True
):
    """From the error of the tide to the node spacing."""

    rule: RuleName = "hessian"
    """What sets the spacing. The recovered curvature of the elevation gave the least
    error at equal node count in trials; "truncation_error" is the paper's Eq. 4."""
    tolerance: Literal["nodes", "peak", "percentile", "absolute"] = "nodes"
    """How the level of the rule is found: by a node budget; from the largest error
    (or a percentile of the errors) of the base grid, so that the finest spacing
    (or that of the percentile) is the base grid's, as in the paper; or given."""
    nodes: Annotated[int, msgspec.Meta(ge=4)] = 10_000
    """Node budget, met within 1 %, for tolerance = "nodes". The paper's mesh has
    10,013 nodes."""
    percentile: Annotated[float, msgspec.Meta(gt=0, le=100)] = 99.0
    """For tolerance = "percentile"."""
    level: Positive | None = None
    """For tolerance = "absolute": error (m/s2) for "truncation_error", spacing (m)
    for "uniform", spacing (m) at the median curvature for "hessian" and
    "energy_hessian", part of the wave length for the others."""

    components: Literal["vector", "largest"] = "vector"
    """Norm over the components of the truncation error: root of the sum of squares,
    or the largest one. The paper's scalar sum has one component only."""
    constituents: Literal["largest", "root_sum_square"] = "largest"
    """The same over the constituents: the finest spacing of all, or their errors
    combined."""
    exponent: Annotated[float, msgspec.Meta(gt=0, le=1)] = 0.6
    """Of the Hessian rules: 1/2 spreads the largest error of interpolation and the
    error of the flow, 1/3 the mean square, 1/4 the mean. A little more than 1/2 makes
    up for base grids that smooth the curvature in inlets, where the flow into a bay is
    decided."""
    floor: Annotated[float, msgspec.Meta(gt=0, lt=1)] = 1e-4
    """Least curvature as a part of its 99th percentile."""
    slope_weight: Positive = 5.0
    """Of "wavelength_slope": spacings per wave length over spacings per
    topographic length 2 pi h / |grad h| (100 over 20 is common)."""
    smoothing_sweeps: Annotated[int, msgspec.Meta(ge=0, le=100)] = 2
    """Averagings of the spacing over neighbours, since one noisy node would else set
    the mesh around it."""

    min_m: Positive | None = None
    """Least spacing (m)."""
    max_m: Positive | None = None
    """Greatest spacing (m)."""
    gradation: Positive = 0.25
    """Greatest growth of the spacing (m) per m; 0.15 to 0.35 is usual, inf is no limit,
    as in the paper."""
    channel_elements: Annotated[float, msgspec.Meta(ge=0)] = 2.0
    """Least number of elements between opposite banks, as far as min_m allows, so that
    nodes stand in the stream; 0 for no regard to channels, as in the paper. More costs
    small budgets their open water: with 2,500 nodes on South Carolina three had an
    error half as large again as two."""
    follow_boundary: bool = False
    """Keep the spacing at the boundary at or below that of the boundary points of the
    base grid."""
    time_step_s: Positive | None = None
    """Time step (s) of the tide model, for a least spacing by the Courant number."""
    courant: Positive = 0.8
    """Greatest Courant number sqrt(g h) * time step / spacing."""
    regions: list[SizeRegion] = []
    """Polygons with limits of their own; the last one that holds a point counts."""

    def __post_init__(self) -> None:
        if self.tolerance == "absolute" and self.level is None:
            raise ValueError('tolerance = "absolute" needs a level')
        for limits in (self, *self.regions):
            if None not in (limits.min_m, limits.max_m) and limits.min_m > limits.max_m:
                raise ValueError(
                    f"min_m = {limits.min_m:g} is above max_m = {limits.max_m:g}"
                )
