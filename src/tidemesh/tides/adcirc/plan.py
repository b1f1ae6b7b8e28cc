"""Length, step and analysis of an ADCIRC run, where the settings leave them open."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from tidemesh.constants import GRAVITY
from tidemesh.datatypes import CoastalMesh, TideForcing
from tidemesh.errors import InputError, MeshError
from tidemesh.tides.adcirc.settings import SCHEMES, AdcircSettings
from tidemesh.tides.frequency_domain.solve import is_nonlinear
from tidemesh.tides.settings import TideSettings

DAY_S = 86400.0
COURANT = 0.8
LINEAR_STEP_S = 30.0
"""Step of the paper (section 3.3); its error of time is 1e-6 to 4e-6."""
QUADRATIC_TAU0 = 0.009
"""1/s, of the paper's nonlinear run (section 4)."""
WET_DEPTH_M = 0.1
_LEAST_DAYS = 2.0
_RAMPS = 4.0
_STEPS_A_PERIOD = 100
_NODE_STEPS_A_SECOND = 3.0e6


@dataclass(frozen=True)
class RunPlan:
    """When an ADCIRC run steps, ends and is analysed."""

    time_step_s: float
    courant: float
    """Edges of elements that a long wave crosses in a step, at most."""
    steps: int
    run_days: float
    ramp_days: float
    harmonic_days: tuple[float, float]
    """Start and end of the harmonic analysis."""
    harmonic_every: int
    """Steps between its samples."""
    tau0: float
    """1/s; negative for a rule of ADCIRC's."""
    minimum_depth_m: float
    """H0."""
    notes: tuple[str, ...]
    """What was chosen and why, and what may be wrong with the choice."""


def plan_run(
    mesh: CoastalMesh,
    forcing: TideForcing,
    tide: TideSettings,
    settings: AdcircSettings,
) -> RunPlan:
    """Choose what the settings leave open.

    A linear run with tau0 = tau and weights 0.35, 0.30, 0.35 is stable at any step;
    everything else needs a Courant number of about 1 (docs/method.md). The harmonic
    analysis must be long enough to tell the constituents apart.

    Parameters
    ----------
    mesh : CoastalMesh
    forcing : TideForcing
    tide : TideSettings
    settings : AdcircSettings

    Returns
    -------
    plan : RunPlan

    Raises
    ------
    InputError
        If the settings contradict each other, or two constituents have one frequency.
    MeshError
        If a node has no water.
    """
    _check(tide, settings)
    notes: list[str] = []
    least = _minimum_depth(mesh, settings, notes)
    tau0 = _tau0(tide, settings)
    surge = _surge(forcing, tide)
    shallowest = max(float(mesh.depth.min()), least)
    if surge >= shallowest and not settings.wetting:
        notes.append(
            f"the tide at the ocean boundary ({surge:.2g} m) is higher than the least "
            f"depth ({shallowest:.2g} m): nodes that fall dry blow a run up; raise "
            "adcirc.minimum_depth_m or use adcirc.wetting"
        )
    crossing = crossing_time(mesh, least, surge=surge, gravity=tide.gravity)
    step, note = _time_step(forcing, tide, settings, tau0, crossing)
    notes.append(note)
    start, end = _window(forcing, settings, notes)
    steps = math.ceil(end * DAY_S / step - 1e-9)
    end = steps * step / DAY_S
    work = steps * len(mesh.points)
    notes.append(
        f"{steps:,} steps on {len(mesh.points):,} nodes: about "
        f"{work / _NODE_STEPS_A_SECOND / 60.0:.2g} CPU minutes"
    )
    every_s = settings.harmonic_every_s
    if every_s is None:
        every_s = 2.0 * math.pi / float(forcing.frequency.max()) / 40.0
    return RunPlan(
        time_step_s=step,
        courant=step / crossing,
        steps=steps,
        # ADCIRC rounds the number of steps down.
        run_days=end + 0.01 * step / DAY_S,
        ramp_days=settings.ramp_days,
        harmonic_days=(start, end),
        harmonic_every=max(1, int(every_s / step + 1e-9)),
        tau0=tau0,
        minimum_depth_m=least,
        notes=tuple(notes),
    )


def separation_days(forcing: TideForcing) -> tuple[float, str]:
    """Time to tell the constituents apart (Rayleigh), and what it is needed for.

    Raises
    ------
    InputError
        If two constituents have the same frequency, or all stand still.
    """
    order = np.argsort(forcing.frequency, kind="stable")
    frequency = forcing.frequency[order]
    names = [forcing.names[k] for k in order]
    if frequency[-1] <= 0.0:
        raise InputError(
            "adcirc: there is no constituent with a period to drive and analyse"
        )
    gaps = np.diff(frequency)
    if (gaps <= 1.0e-12).any():
        k = int(np.argmin(gaps))
        raise InputError(
            f"constituents {names[k]} and {names[k + 1]} have the same frequency "
            f"({frequency[k]:.9g} rad/s): no harmonic analysis tells them apart"
        )
    # A constituent that is not slower than the run needs at least one of its periods.
    slowest = int(np.flatnonzero(frequency > 0.0)[0])
    best = 2.0 * math.pi / frequency[slowest], f"one period of {names[slowest]}"
    for k, gap in enumerate(gaps):
        if 2.0 * math.pi / gap > 1.0001 * best[0]:
            best = 2.0 * math.pi / gap, f"telling {names[k]} and {names[k + 1]} apart"
    return best[0] / DAY_S, best[1]


def crossing_time(
    mesh: CoastalMesh,
    least_depth: float = 0.0,
    *,
    surge: float = 0.0,
    gravity: float = GRAVITY,
) -> float:
    """Shortest time (s) in which a long wave runs along the edge of an element.

    Parameters
    ----------
    mesh : CoastalMesh
    least_depth : float
        m, to which shallower nodes are deepened.
    surge : float
        m, elevation that adds to the depth.
    gravity : float
        m/s2.
    """
    first, second = mesh.triangles, np.roll(mesh.triangles, -1, axis=1)
    length = np.linalg.norm(mesh.points[first] - mesh.points[second], axis=2)
    depth = np.maximum(mesh.depth, least_depth) + surge
    speed = np.sqrt(gravity * np.maximum(depth[first], depth[second]))
    return float((length / speed).min())


def _check(tide: TideSettings, settings: AdcircSettings) -> None:
    if abs(sum(settings.weights) - 1.0) > 1e-9:
        raise InputError(
            f"adcirc.weights add up to {sum(settings.weights):g}, they must make 1"
        )
    if settings.wetting and not tide.finite_amplitude:
        raise InputError(
            "adcirc.wetting needs tide.finite_amplitude = true: without it the "
            "elevation does not count in the depth"
        )
    low, high = settings.tau0_range
    if low >= high:
        raise InputError(f"adcirc.tau0_range: {low:g} is not below {high:g}")
    tau0 = settings.tau0
    if tau0 is not None and tau0 < 0.0 and tau0 not in SCHEMES:
        raise InputError(
            f"adcirc.tau0 = {tau0:g}: expected a positive number, or -1, -2 or -5 for "
            "a rule of ADCIRC's"
        )


def _minimum_depth(
    mesh: CoastalMesh, settings: AdcircSettings, notes: list[str]
) -> float:
    least = settings.minimum_depth_m
    if settings.wetting:
        return WET_DEPTH_M if least is None else least
    shallowest = float(mesh.depth.min())
    if least is None:
        if shallowest <= 0.0:
            node = int(np.argmin(mesh.depth))
            x, y = mesh.projection.inverse(mesh.points[node])
            raise MeshError(
                f"node {node} at ({x:.4f}, {y:.4f}) has a depth of {shallowest:g} m; "
                "deepen the mesh, set adcirc.minimum_depth_m, or adcirc.wetting with "
                "tide.finite_amplitude"
            )
        return min(1.0, 0.5 * shallowest)
    if shallowest < least:
        count = int((mesh.depth < least).sum())
        notes.append(
            f"{count} nodes shallower than {least:g} m are deepened to it "
            "(adcirc.minimum_depth_m)"
        )
    return least


def _tau0(tide: TideSettings, settings: AdcircSettings) -> float:
    if settings.tau0 is not None:
        return settings.tau0
    if tide.tau0 is not None:
        return tide.tau0
    return tide.friction if tide.friction_law == "linear" else QUADRATIC_TAU0


def _surge(forcing: TideForcing, tide: TideSettings) -> float:
    """Elevation that adds to the depth (m)."""
    if not tide.finite_amplitude:
        return 0.0
    factor = 1.0 if forcing.nodal_factor is None else forcing.nodal_factor[:, None]
    height = (factor * np.abs(forcing.elevation)).sum(axis=0)
    return float(height.max(initial=0.0))


def _time_step(
    forcing: TideForcing,
    tide: TideSettings,
    settings: AdcircSettings,
    tau0: float,
    crossing: float,
) -> tuple[float, str]:
    """Step (s), and why."""
    stable_at_any = (
        not is_nonlinear(tide)
        and tau0 == tide.friction
        and min(settings.weights[0], settings.weights[2]) >= 0.25
    )
    given = settings.time_step_s or tide.time_step_s or None
    if given is not None:
        note = f"time step {given:g} s, Courant number {given / crossing:.2g}"
        if given > 1.2 * crossing and not stable_at_any:
            note += (
                f": likely to blow up, since a wave crosses the shortest edge in "
                f"{crossing:.3g} s"
            )
        return given, note
    if stable_at_any:
        shortest = 2.0 * math.pi / float(forcing.frequency.max())
        step = min(LINEAR_STEP_S, _two_digits(shortest / _STEPS_A_PERIOD))
        return step, f"time step {step:g} s: linear with tau0 = tau, stable at any step"
    step = min(_two_digits(COURANT * crossing), LINEAR_STEP_S)
    return step, (
        f"time step {step:g} s: a wave crosses the shortest edge in {crossing:.3g} s "
        f"(Courant number {step / crossing:.2g})"
    )


def _two_digits(value: float) -> float:
    """Rounded down to two significant digits."""
    unit = 10.0 ** (math.floor(math.log10(value)) - 1)
    return float(f"{math.floor(value / unit + 1e-9) * unit:.6g}")


def _window(
    forcing: TideForcing, settings: AdcircSettings, notes: list[str]
) -> tuple[float, float]:
    needed, purpose = separation_days(forcing)
    start = settings.spin_up_days
    if start is None:
        start = max(_LEAST_DAYS, _RAMPS * settings.ramp_days)
    if settings.run_days is None:
        end = start + max(needed, _LEAST_DAYS)
    else:
        end = settings.run_days
        if end <= start:
            raise InputError(
                f"adcirc.run_days = {end:g} leaves nothing to analyse after a spin-up "
                f"of {start:g} days; raise it, or lower adcirc.ramp_days or "
                "adcirc.spin_up_days"
            )
    notes.append(
        f"{end:.4g} days, harmonic analysis from day {start:.4g}; {purpose} takes "
        f"{needed:.4g} days"
    )
    if end - start < 0.999 * needed:
        notes.append(
            f"the analysis of {end - start:.4g} days is too short: {purpose} takes "
            f"{needed:.4g} days; raise adcirc.run_days to {start + needed:.4g}"
        )
    if settings.ramp_days > 0.0 and start < 3.0 * settings.ramp_days:
        left = 1.0 - math.tanh(2.0 * start / settings.ramp_days)
        notes.append(
            f"{left:.1g} of the forcing is still missing when the analysis starts: "
            "raise adcirc.spin_up_days or lower adcirc.ramp_days"
        )
    return start, end
