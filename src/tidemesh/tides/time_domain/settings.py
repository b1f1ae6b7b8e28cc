"""Settings of a simulation in time; the physics are those of `TideSettings`."""

from __future__ import annotations

from typing import Annotated

import msgspec

NonNegative = Annotated[float, msgspec.Meta(ge=0.0)]
Positive = Annotated[float, msgspec.Meta(gt=0.0)]


class SimulationSettings(
    msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True
):
    """A run in time: its span, step, analysis and output (paper, section 4).

    Friction law, finite amplitude, advection, rotation, gravity, potential, metric and
    the weight tau0 are those of the tide settings.
    """

    start: str = "1998-01-01T00:00:00Z"
    """Time of the first step, ISO 8601, UTC; the equilibrium arguments of the forcing
    belong to it."""

    days: Positive = 90.0
    """Length of the run."""

    ramp_days: NonNegative = 5.0
    """The forcing grows as tanh(2 t/ramp), as in ADCIRC; 0 for none."""

    time_step_s: NonNegative = 0.0
    """Time step; 0 takes the longest stable one that divides `station_every_s`."""

    eddy_viscosity: NonNegative = 0.0
    """Lateral viscosity, m2/s (ADCIRC's ESLM)."""

    ocean_advection: bool = False
    """Advection counts in the triangles of the open boundary too, as in ADCIRC. There
    the inflow brings a velocity that nothing prescribes, and runs blow up of it (so
    does ADCIRC without its nodal attribute for this)."""

    minimum_column_m: Positive = 0.1
    """The water column never gets thinner than this: there is no wetting and drying,
    and a node that would fall dry keeps a film. How often is reported."""

    expected_level_m: NonNegative = 2.0
    """High water, and `expected_speed` the current, that the advised step has to bear;
    they count where finite amplitude and advection are on."""

    expected_speed_m_s: NonNegative = 2.0
    """See `expected_level_m`."""

    level_limit_m: Positive = 30.0
    """A water level beyond this, up or down, counts as blow-up and ends the run."""

    analysis_start_day: NonNegative | None = None
    """Start of the harmonic analysis, which lasts to the end of the run; left out: two
    ramps after the start."""

    analysis_every_s: Positive = 600.0
    """Time between the samples of the analysis, the maxima and the water volume."""

    constituents: tuple[str, ...] | None = None
    """Constituents of the analysis; left out: those of the forcing and, of a nonlinear
    run, M4, M6 and STEADY. None with ()."""

    station_every_s: Positive = 360.0
    """Time between the water levels at stations (NOAA's gauges: six minutes)."""

    station_distance_m: NonNegative = 3000.0
    """A station outside the mesh gets the water level of the nearest place on its
    boundary up to this distance; farther ones are an error."""

    global_every_s: NonNegative = 0.0
    """Time between the fields of levels and currents on all nodes; 0 for none."""

    restart_every_days: NonNegative = 10.0
    """Time between restart files; 0 for none but that of an interrupted run."""

    threads: Annotated[int, msgspec.Meta(ge=1, le=256)] = 1
    """Threads of the time steps; the answer is the same for any number, bit by bit."""
