"""Settings of the ADCIRC engine: where it is, how it runs, how it steps."""

from __future__ import annotations

from typing import Annotated, Literal

import msgspec

Positive = Annotated[float, msgspec.Meta(gt=0.0)]
NonNegative = Annotated[float, msgspec.Meta(ge=0.0)]
Weight = Annotated[float, msgspec.Meta(ge=0.0, le=1.0)]

SCHEMES = (-1.0, -2.0, -5.0)
"""Negative tau0 that ADCIRC takes for a rule and that needs no further file."""


class AdcircSettings(
    msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True
):
    """ADCIRC, when `tide.engine = "adcirc"`: programs, length of run, step.

    The physics (friction law, nonlinear terms, Coriolis, potential, gravity) are those
    of section ``tide``.
    """

    adcirc: str = "adcirc"
    """Serial program: a name on the PATH, or a path."""

    adcprep: str = "adcprep"
    """Program that divides the mesh, for ``ranks`` above 1."""

    padcirc: str = "padcirc"
    """Parallel program, for ``ranks`` above 1."""

    ranks: Annotated[int, msgspec.Meta(ge=1, le=100_000)] = 1
    """MPI processes; 1 runs the serial program. Below some 2,000 nodes a process they
    do not pay."""

    launcher: str = "mpirun -np {ranks}"
    """What starts the parallel program, with ``{ranks}`` in place of their number:
    "srun -n {ranks}", "mpirun --allow-run-as-root -np {ranks}"."""

    batch_template: str | None = None
    """Job script of the user with ``{folder}``, ``{ranks}`` and ``{command}`` where the
    run directory, the number of processes and the commands go. It is written into the
    run directory and the program stops there; the same command goes on when the
    results are in the directory."""

    timeout_s: Positive | None = None
    """Time after which a run is stopped."""

    time_step_s: Positive | None = None
    """ADCIRC's DTDP. Left out: ``tide.time_step_s`` if that is given; else 30 s for a
    linear run with tau0 = tau, which is stable at any step, and else the step at which
    no wave crosses an element's edge (Courant number 0.8)."""

    ramp_days: NonNegative = 2.0
    """Forcing grows by tanh(2 t / ramp); 0 for none."""

    spin_up_days: NonNegative | None = None
    """Start of the harmonic analysis. Left out: four ramps, at least 2 days; a ramp
    leaves 2 exp(-4 t / ramp) of itself, 2e-7 after four."""

    run_days: Positive | None = None
    """Length of the run. Left out: as long as the harmonic analysis needs to tell the
    constituents apart (Rayleigh: one turn between the two closest in frequency)."""

    harmonic_every_s: Positive | None = None
    """Time between samples of the harmonic analysis. Left out: 1/40 of the shortest
    period."""

    tau0: float | None = None
    """Weight of the primitive in the wave equation, 1/s. Left out: ``tide.tau0``, or
    the friction where its law is linear, or 0.009 (paper, section 4) where it is not.
    -1 and -2 choose ADCIRC's rules by depth, -5 the one by friction and depth."""

    tau0_range: tuple[Positive, Positive] = (0.005, 0.2)
    """Least and largest tau0, 1/s, for ``tau0 = -5``."""

    weights: tuple[Weight, Weight, Weight] = (0.35, 0.30, 0.35)
    """Of the future, present and past elevation in the wave equation (A00, B00, C00);
    they add up to 1."""

    wetting: bool = False
    """Elements fall dry and flood (NOLIFA = 2); needs ``tide.finite_amplitude``."""

    minimum_depth_m: Positive | None = None
    """ADCIRC's H0: shallower nodes are deepened to it, or, with ``wetting``, are dry
    below it. Left out: no node is changed; 0.1 m with ``wetting``."""

    minimum_wetting_speed: Positive = 0.01
    """m/s, for ``wetting``: the speed to a dry node that floods it (VELMIN)."""

    eddy_viscosity: NonNegative = 0.0
    """Lateral, m2/s (ESLM)."""

    ocean_rings_without_advection: Annotated[int, msgspec.Meta(ge=0, le=1000)] = 1
    """Rings of elements along the ocean boundary, counted from it, in which momentum is
    not advected (nodal attribute advection_state): where shallow water meets the
    boundary, advection across it makes runs blow up."""

    coordinates: Literal["auto", "metres", "adcirc", "mercator", "equal_area"] = "auto"
    """Plane metres (ICS = 1); longitude and latitude in ADCIRC's classical map, which
    leaves out curvature (ICS = 2); or the full spherical equations on Mercator's map
    (ICS = 22) or the equal-area one (ICS = 20). "auto": metres where the mesh has no
    map, or ``tide.metric`` is "plane" and nothing asks for the latitude; "adcirc" as
    ``tide.metric`` says; else "mercator"."""

    output: Literal["ascii", "netcdf"] = "ascii"
    """Harmonic constants as text (phases to 1e-4 degree) or, where ADCIRC was built
    with it, NetCDF in double precision."""

    warning_elevation_m: Positive = 20.0
    """Elevation that ADCIRC warns of (WarnElev)."""

    error_elevation_m: Positive = 100.0
    """Elevation at which a run counts as blown up and stops (ErrorElev)."""

    solver_tolerance: Positive = 1.0e-10
    """Of the conjugate gradients (CONVCR)."""

    solver_iterations: Annotated[int, msgspec.Meta(ge=1, le=100)] = 100
    """At most, in a step (ITMAX). Beyond 100 ADCIRC writes over its own memory. Where
    they do not do once, ADCIRC solves all later steps no better: such a run counts as
    failed."""

    extra_lines: tuple[str, ...] = ()
    """Lines for the end of fort.15, for instance further namelists (WarnElevControl is
    there already, and ADCIRC takes the first of two)."""
