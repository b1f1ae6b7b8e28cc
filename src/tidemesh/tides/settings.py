"""Settings of the tide model."""

from __future__ import annotations

from typing import Annotated, Literal

import msgspec

from tidemesh.constants import GRAVITY

NonNegative = Annotated[float, msgspec.Meta(ge=0.0)]
Positive = Annotated[float, msgspec.Meta(gt=0.0)]


class TideSettings(
    msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True
):
    """Linear tide: constituents, physics, and how velocities are formed."""

    constituents: Annotated[tuple[str, ...], msgspec.Meta(min_length=1)] = ("M2",)
    """Names as in the table of tidal constants."""

    friction: NonNegative = 4.0e-4
    """Linear friction coefficient tau, 1/s (paper, section 3.3)."""

    gravity: Positive = GRAVITY
    """m/s2."""

    coriolis: Literal["none", "constant", "latitude"] = "none"
    """No rotation (as in the paper), the f of one latitude, or the f of each node."""

    latitude_deg: Annotated[float, msgspec.Meta(ge=-90.0, le=90.0)] = 33.0
    """Latitude for ``coriolis = "constant"``, degrees north."""

    mass: Literal["consistent", "half_lumped", "lumped"] = "consistent"
    """Galerkin mass matrix (as ADCIRC), or one closer to its diagonal."""

    velocity: Literal["lumped", "consistent", "recovered"] = "lumped"
    """How nodal velocities follow from the elevation: area-weighted mean of the element
    gradients (as ADCIRC), L2 projection, or the gradient of a local quadratic fit,
    which is of second order up to the boundary."""

    land_rule: Literal["adcirc", "none"] = "adcirc"
    """Velocity at land nodes: along the shore, as ADCIRC does it, or left alone."""

    minimum_inner_angle_deg: Annotated[float, msgspec.Meta(ge=0.0, le=180.0)] = 90.0
    """Land corners sharper than this get no velocity (ADCIRC's ANGINN)."""

    metric: Literal["plane", "sphere"] = "plane"
    """Trust the lengths of the projected plane, or correct them by the scale of the
    map (for domains so wide that the scale varies)."""

    max_forcing_distance_km: Positive = 50.0
    """Farthest that a place of the tidal constants may be from an ocean node; the
    common global atlases have a spacing of 7 to 28 km."""
