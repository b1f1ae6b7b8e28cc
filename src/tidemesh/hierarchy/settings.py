"""Settings of the node placement."""

from __future__ import annotations

from typing import Annotated, Literal

import msgspec

Positive = Annotated[float, msgspec.Meta(gt=0)]
Fraction = Annotated[float, msgspec.Meta(ge=0, le=1)]


class HierarchySettings(
    msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True
):
    """How nodes are placed to follow a size function (paper, section 3.5)."""

    rule: Literal["balanced", "graded", "strict"] = "balanced"
    """"strict": a triangle is chosen when smaller than its target, as printed.
    "graded": when smaller than twice its target, plus a mid-side node above 4/3 and a
    centre node above 5/3 of the target, which can only fire so (docs/method.md,
    reading 5). "balanced": the same with the centre node from 4/3 on, which keeps the
    triangles equilateral."""
    line_rule: Literal["equidistributed", "tree"] = "equidistributed"
    """Boundary lines: equal integrals of ds/size between fixed corners, smoother, or
    the binary tree of the paper."""
    near_shore: Literal["resample", "keep"] = "resample"
    """"resample": sizes to the shore. "keep": the shore and a strip of given nodes
    stay as they are, as published."""
    minimum_size_m: Positive | None = None
    """m, no segment or triangle is smaller; the paper's 300 m. None: no limit."""
    root_size_m: Positive | None = None
    """m, an edge of the lattice; None takes the spacing typical of the size function,
    so that a scaled function gives a scaled lattice."""
    gradation: Annotated[float, msgspec.Meta(gt=0, le=1)] = 0.25
    """Largest growth of the size per metre off a finely resolved shore."""
    boundary_clearance: Fraction = 0.6
    """Interior nodes keep this fraction of the local size from the boundary."""
    corner_angle_deg: Annotated[float, msgspec.Meta(gt=0, le=180)] = 60.0
    """degrees, a turn of the boundary within one spacing that keeps its vertex."""
    width_fraction: Fraction = 0.5
    """A boundary segment is refined where the opposite bank is nearer than this
    fraction of its length; 0 for no refinement beyond what the topology needs."""
    conserve_area: bool = True
    """Move the new points of the shore off the old one by the water that chords leave
    out, so that bays keep their area and inlets their width; False leaves them on it.
    Without effect on "keep"."""
    island_points: Annotated[int, msgspec.Meta(ge=3)] = 4
    """Least number of points of an island."""
    strip_width_m: Annotated[float, msgspec.Meta(ge=0)] = 5000.0
    """m, width of the near-shore strip that "keep" leaves unmodified."""
    seam_factor: Fraction = 0.65
    """With "keep": offshore nodes keep this fraction of their size from the strip's
    nodes (the paper's value)."""
