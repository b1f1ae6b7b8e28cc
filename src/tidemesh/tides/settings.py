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
    """The tide model: constituents, physics, discretisation, solver."""

    engine: Literal["frequency_domain", "adcirc"] = "frequency_domain"
    """The embedded solver, or ADCIRC (section ``adcirc``) where it is installed."""

    constituents: Annotated[tuple[str, ...], msgspec.Meta(min_length=1)] = ("M2",)
    """Names as in the table of tidal constants."""

    overtides: tuple[str, ...] = ()
    """Constituents that nothing drives at the ocean boundary: the nonlinear terms make
    them inside, for instance M4, M6, MS4, MN4, STEADY."""

    friction_law: Literal["linear", "quadratic", "manning"] = "linear"
    """Bottom stress proportional to the velocity, to its square by one drag
    coefficient, or by that of Manning's formula."""

    friction: NonNegative = 4.0e-4
    """Linear friction coefficient tau, 1/s (paper, section 3.3); for
    ``friction_law = "linear"``, and the first guess of the others."""

    drag_coefficient: NonNegative = 3.0e-3
    """C_f for ``friction_law = "quadratic"`` (paper, section 4)."""

    manning_n: Positive = 0.022
    """s m^(-1/3), for ``friction_law = "manning"``: C_f = g n^2 / h^(1/3)."""

    friction_file: str | None = None
    """Raster (GeoTIFF or NetCDF, degrees or projected) of the coefficient of the
    friction law, where it varies in space; it takes the place of the one number."""

    finite_amplitude: bool = False
    """Elevation counts in the water depth (makes M4, MS4, STEADY ...)."""

    advection: bool = False
    """Momentum is advected (makes M4, MS4, STEADY ...). For meshes that are coarse
    against the way of the water in a tide; in jets its harmonics do not converge."""

    tidal_potential: bool = False
    """The astronomical forces inside the domain, with body-tide factors."""

    date: str | None = None
    """Middle of the time of interest, for instance "1998-03-24": nodal factors of that
    day scale the amplitudes that set the quadratic friction. Left out: factors of 1."""

    tolerance: Positive = 1.0e-4
    """Largest change of the elevation (with ``discretisation = "gwce"`` of the velocity
    as well) in the last iteration of the nonlinear terms, relative to its root mean
    square."""

    max_iterations: Annotated[int, msgspec.Meta(ge=1, le=1000)] = 60
    """Iterations after which the nonlinear terms are reported as not converging."""

    gravity: Positive = GRAVITY
    """m/s2."""

    coriolis: Literal["none", "constant", "latitude"] = "none"
    """No rotation (as in the paper), the f of one latitude, or the f of each node."""

    latitude_deg: Annotated[float, msgspec.Meta(ge=-90.0, le=90.0)] = 33.0
    """Latitude for ``coriolis = "constant"``, degrees north."""

    discretisation: Literal["galerkin", "gwce"] = "galerkin"
    """Galerkin's method for the wave equation, or the generalised wave continuity
    equation exactly as ADCIRC discretises it (the same where tau0 = tau and f = 0),
    with any friction law but without finite amplitude and advection."""

    tau0: NonNegative | None = None
    """Weight of ADCIRC's wave equation, 1/s; left out: the friction where that is one
    number, else ``friction``."""

    time_step_s: NonNegative = 0.0
    """Step of a time-stepping model whose answer is to be reproduced, with its errors
    of time (ADCIRC's weights 0.35, 0.30, 0.35); 0 for continuous time; needs
    ``discretisation = "gwce"``."""

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

    metric: Literal["plane", "sphere", "geographic", "adcirc"] = "plane"
    """Trust the lengths of the projected plane; correct them by the scale of the map
    (for domains so wide that the scale varies); measure every triangle in space by
    the longitudes and latitudes of its corners (oceans, poles, the globe; on the
    ellipsoid or sphere of the mesh's map); or as
    ADCIRC's spherical runs (ICS = 2) do."""

    solver: Literal["superlu", "pardiso"] = "superlu"
    """Sparse factorisation: the one that is always there, or that of Intel's MKL where
    it is installed (``pip install "tidemesh[fast]"``)."""

    threads: Annotated[int, msgspec.Meta(ge=1, le=256)] = 1
    """Constituents that are solved at the same time; each needs memory of its own."""

    max_forcing_distance_km: Positive = 50.0
    """Farthest that a place of the tidal constants may be from an ocean node; the
    common global atlases have a spacing of 7 to 28 km."""
