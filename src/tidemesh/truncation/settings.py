"""Settings of the truncation error estimate."""

from __future__ import annotations

from typing import Annotated, Literal

import msgspec


class TruncationSettings(
    msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True
):
    """Localised truncation error of the momentum equations (paper, Eq. 4)."""

    derivatives: Literal["least_squares", "lattice"] = "least_squares"
    """Local polynomials at the nodes, which reach the boundary, or differences on a
    square lattice as published, which lose a band of three spacings along it."""

    delta: Literal["half_edge", "spacing"] = "half_edge"
    """What Delta of Eq. 4 stands for: half an edge, as it is derived, or the node
    spacing, as the paper evaluates it."""

    components: Literal["sum", "vector"] = "sum"
    """The sum of the x and the y component as published, which is blind to errors
    along (1, -1), or both components."""

    degree: Annotated[int, msgspec.Meta(ge=5, le=6)] = 5
    """Degree of the local polynomials; Eq. 4 holds fifth derivatives."""

    patch_points: Annotated[int, msgspec.Meta(ge=28)] | None = None
    """Least number of nodes in a fit; by default 1.6 times the number of monomials.
    More nodes smooth more."""

    lattice_spacing_m: Annotated[float, msgspec.Meta(gt=0.0)] | None = None
    """For "lattice": the paper has 900 m. By default the median edge of the mesh."""

    skip_rings: Annotated[int, msgspec.Meta(ge=0)] = 0
    """Rings of nodes along the boundary to be left unknown (1: the boundary nodes).
    Third and fifth derivatives of a discrete tide are mostly noise on a jagged shore;
    2 takes out the worst of it."""
