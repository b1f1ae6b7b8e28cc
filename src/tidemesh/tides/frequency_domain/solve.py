"""The tide of a mesh, all its constituents."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from tidemesh import constants
from tidemesh.datatypes import CoastalMesh, TideForcing, TideSolution
from tidemesh.errors import EngineError, InputError, MeshError
from tidemesh.tides.frequency_domain.elements import Elements
from tidemesh.tides.frequency_domain.energy import (
    EnergyBalance,
    ForcedTide,
    constituent_energy,
)
from tidemesh.tides.frequency_domain.gwce import (
    GwceEquation,
    solve_gwce,
    symbols_for,
)
from tidemesh.tides.frequency_domain.gwce_balance import GwceBalance
from tidemesh.tides.frequency_domain.harmonic_balance import (
    Drive,
    HarmonicBalance,
    IterationReport,
    strength,
)
from tidemesh.tides.frequency_domain.parallel import each
from tidemesh.tides.frequency_domain.sampling import as_combination, integer_phases
from tidemesh.tides.frequency_domain.velocity import nodal_velocity
from tidemesh.tides.frequency_domain.wave_equation import Symbols, WaveEquation
from tidemesh.tides.settings import TideSettings

_NEAR = 1.0e-7
"""rad/s by which the frequencies of a forcing may differ from the table's."""


def solve(
    mesh: CoastalMesh,
    forcing: TideForcing,
    settings: TideSettings | None = None,
    *,
    friction: float | np.ndarray | None = None,
    drag: float | np.ndarray | None = None,
    coriolis: float | np.ndarray | None = None,
    elements: Elements | None = None,
    symbols: Sequence[Symbols] | None = None,
    progress: Callable[[float], None] | None = None,
) -> TideSolution:
    """Solve the tide in the frequency domain.

    One sparse complex system for each constituent takes the place of weeks of time
    stepping (docs/method.md, section 4). Quadratic friction, finite amplitude and
    advection couple the constituents, which are then iterated to
    ``settings.tolerance``.

    Parameters
    ----------
    mesh : CoastalMesh
        Positive depths; the boundary is closed wherever the forcing has no node.
    forcing : TideForcing
        Elevation at the open boundary nodes, and the equilibrium tide inside where
        ``potential`` is given: that alone drives a mesh without open boundary.
        ``settings.overtides`` are added to its constituents.
    settings : TideSettings, optional
    friction : float, (n_points,), (n_triangles,) or (n_c, n_points) array, optional
        Linear friction coefficient (1/s), instead of the settings' one value.
    drag : float or (n_points,) array, optional
        Drag coefficient C_f of quadratic friction, or Manning's n (s m^(-1/3)) for
        ``friction_law = "manning"``, instead of the settings' one value.
    coriolis : float or (n_points,) array, optional
        Coriolis parameter (rad/s), instead of what the settings say.
    elements : Elements, optional
        Geometry of the triangles, instead of what ``settings.metric`` says.
    symbols : sequence of Symbols, optional
        Discrete-time symbols of every constituent, to reproduce a time-stepping
        scheme; continuous time if not given.
    progress : callable, optional
        Called with the fraction done.

    Returns
    -------
    tide : TideSolution
        Its friction is (n_c, n_points) where the law is not linear.

    Raises
    ------
    InputError
        If the forcing is not finite, misses an open boundary node, or its constituents
        contradict each other or the settings; if a coefficient is not usable.
    MeshError
        If a triangle is inverted or dry, or a node has no triangle.
    EngineError
        If nothing drives the tide, or the equations are singular.
    ConvergenceError
        If the nonlinear terms do not converge.
    """
    return solve_with_report(
        mesh,
        forcing,
        settings,
        friction=friction,
        drag=drag,
        coriolis=coriolis,
        elements=elements,
        symbols=symbols,
        progress=progress,
    )[0]


def solve_with_report(
    mesh: CoastalMesh,
    forcing: TideForcing,
    settings: TideSettings | None = None,
    *,
    friction: float | np.ndarray | None = None,
    drag: float | np.ndarray | None = None,
    coriolis: float | np.ndarray | None = None,
    elements: Elements | None = None,
    symbols: Sequence[Symbols] | None = None,
    progress: Callable[[float], None] | None = None,
) -> tuple[TideSolution, IterationReport]:
    """As `solve`, and how the nonlinear terms converged."""
    settings = TideSettings() if settings is None else settings
    _check_forcing(mesh, forcing)
    forcing = with_overtides(forcing, settings)
    coefficient = drag_coefficient(mesh, settings, drag)
    if symbols is not None and len(symbols) != len(forcing.names):
        raise ValueError(
            f"{len(symbols)} symbols for {len(forcing.names)} constituents"
        )
    linear = IterationReport(0, 0.0, True)
    per_constituent = np.ndim(friction) == 2
    if per_constituent and is_nonlinear(settings):
        raise InputError(
            "friction of every constituent goes with linear equations; quadratic "
            "friction finds it itself"
        )
    if settings.discretisation == "gwce":
        if settings.finite_amplitude or settings.advection:
            raise InputError(
                'discretisation = "gwce" knows quadratic friction, but neither '
                "finite_amplitude nor advection: leave them out, or use "
                'discretisation = "galerkin"'
            )
        given = {"friction": friction, "coriolis": coriolis, "elements": elements}
        if not is_nonlinear(settings):
            tide = solve_gwce(
                mesh, forcing, settings, symbols=symbols, progress=progress, **given
            )
            return tide, linear
        gwce = GwceEquation(mesh, forcing.nodes, settings, **given)
        if symbols is None:
            symbols = [symbols_for(w, settings) for w in forcing.frequency]
        report = progress if progress is not None else _ignore
        report(0.0)
        return _solve_nonlinear(gwce, forcing, symbols, coefficient, report)
    if symbols is None:
        if settings.time_step_s:
            raise InputError(
                'time_step_s goes with discretisation = "gwce", whose model steps in '
                "time: set that, or leave time_step_s out"
            )
        symbols = [Symbols.exact(frequency) for frequency in forcing.frequency]
    report = progress if progress is not None else _ignore
    report(0.0)
    if per_constituent and len(friction) != len(forcing.names):
        raise ValueError(
            f"{len(friction)} rows of friction for {len(forcing.names)} constituents"
        )
    equation = WaveEquation(
        mesh,
        forcing.nodes,
        settings,
        friction=None if per_constituent else friction,
        coriolis=coriolis,
        elements=elements,
    )
    if is_nonlinear(settings):
        return _solve_nonlinear(equation, forcing, symbols, coefficient, report)
    if per_constituent:
        equations = [equation.with_friction(row) for row in friction]
    else:
        equations = [equation] * len(forcing.names)
    tide = _solve_linear(equations, forcing, symbols, report)
    if per_constituent:
        tide = replace(tide, friction=np.stack([e.friction for e in equations]))
    return tide, linear


def is_nonlinear(settings: TideSettings) -> bool:
    """Whether the settings couple the constituents."""
    return (
        settings.friction_law != "linear"
        or settings.finite_amplitude
        or settings.advection
    )


def _solve_linear(
    equations: Sequence[WaveEquation],
    forcing: TideForcing,
    symbols: Sequence[Symbols],
    report: Callable[[float], None],
) -> TideSolution:
    equation = equations[0]
    n_c = len(forcing.names)
    steps = 3 * n_c + 2
    report(2 / steps)
    threads = min(equation.settings.threads, n_c)
    done = [2]

    def step(count: int) -> None:
        if threads <= 1:
            done[0] += count
            report(done[0] / steps)

    def solve_one(k: int) -> tuple[np.ndarray, np.ndarray, tuple[float, ...] | None]:
        at = equations[k]
        wave = at.factorise(symbols[k])
        step(2)
        potential = None if forcing.potential is None else forcing.potential[k]
        load, slope = None, 0.0
        if potential is not None:
            slope = -at.elements.gradient_of(potential)
            load = at.divergence(at.depth * at.flow(symbols[k], slope))
        elevation = wave.elevation(forcing.elevation[k], load)
        # The factors are by far the largest thing in memory.
        del wave
        velocity = nodal_velocity(at, elevation, symbols[k], potential)
        energy = None
        if potential is not None:
            slope = slope + at.elements.gradient_of(elevation)
            flow = at.flow(symbols[k], slope)
            energy = constituent_energy(
                at, symbols[k], elevation, flow, potential=potential
            )
        step(1)
        return elevation, velocity, energy

    solved = each(solve_one, range(n_c), threads)
    report(1.0)
    common = {
        "names": tuple(forcing.names),
        "frequency": forcing.frequency,
        "elevation": np.stack([row[0] for row in solved]),
        "velocity": np.stack([row[1] for row in solved]),
        "friction": equation.friction,
        "gravity": equation.settings.gravity,
        "coriolis": equation.coriolis,
    }
    if forcing.potential is None:
        return TideSolution(**common)
    balance = EnergyBalance(*np.array([row[2] for row in solved]).T)
    return ForcedTide(**common, energy=balance)


def _solve_nonlinear(
    equation: WaveEquation,
    forcing: TideForcing,
    symbols: Sequence[Symbols],
    drag: np.ndarray | None,
    report: Callable[[float], None],
) -> tuple[TideSolution, IterationReport]:
    settings = equation.settings
    if drag is not None or settings.finite_amplitude:
        _check_depth(equation.mesh)
    weight = strength(forcing.elevation, forcing.potential)
    combination = integer_phases(forcing.frequency, weight)
    factor = _acting(forcing, combination)[:, None]
    potential = forcing.potential
    drive = Drive(
        tuple(forcing.names),
        tuple(symbols),
        combination,
        factor * forcing.elevation,
        None if potential is None else factor * potential,
    )
    gwce = isinstance(equation, GwceEquation)
    balance = (GwceBalance if gwce else HarmonicBalance)(equation, drive, drag)
    state = balance.solve(report)
    velocity, friction = balance.nodal(state)
    constants_of = {
        "names": tuple(forcing.names),
        "frequency": forcing.frequency,
        "elevation": state.elevation / factor,
        "velocity": velocity / factor[:, None],
        "friction": friction,
        "gravity": settings.gravity,
        "coriolis": equation.coriolis,
    }
    if gwce:
        tide = TideSolution(**constants_of)
    else:
        tide = ForcedTide(**constants_of, energy=balance.energy(state))
    report(1.0)
    return tide, IterationReport(balance.iterations, balance.change, True)


def _acting(forcing: TideForcing, combination: np.ndarray) -> np.ndarray:
    """(n_c,) amplitudes that act, over the harmonic constants.

    The nodal factors; and where the phase of a constituent is a combination of others,
    what its equilibrium argument differs from that combination of theirs.
    """
    acting = np.ones(len(forcing.names), dtype=np.complex128)
    if forcing.nodal_factor is not None:
        acting *= forcing.nodal_factor
    if forcing.argument is not None:
        fundamental = np.zeros(combination.shape[1])
        for column in range(combination.shape[1]):
            alone = (np.abs(combination).sum(axis=1) == 1) & (
                combination[:, column] == 1
            )
            fundamental[column] = forcing.argument[np.flatnonzero(alone)[0]]
        acting *= np.exp(1j * (forcing.argument - combination @ fundamental))
    return acting


def drag_coefficient(
    mesh: CoastalMesh, settings: TideSettings, drag: float | np.ndarray | None = None
) -> np.ndarray | None:
    """(n_points,) C_f, or g n**2 for Manning's formula; None for linear friction.

    Raises
    ------
    InputError
        If a value is negative or not finite, or friction is linear.
    """
    if settings.friction_law == "linear":
        if drag is not None:
            raise InputError(
                'a drag coefficient was given, and friction_law = "linear" has none'
            )
        return None
    manning = settings.friction_law == "manning"
    if drag is None:
        drag = settings.manning_n if manning else settings.drag_coefficient
    values = np.asarray(drag, dtype=np.float64)
    if values.ndim and values.shape != (len(mesh.points),):
        raise ValueError(
            f"drag must be a number or ({len(mesh.points)},), got shape {values.shape}"
        )
    bad = ~(np.isfinite(values) & (values >= 0.0))
    if bad.any():
        node = int(np.argmax(bad)) if values.ndim else 0
        raise InputError(
            f"the drag coefficient must be finite and not negative; at node {node} it "
            f"is {values.ravel()[node]}"
        )
    values = np.broadcast_to(values, len(mesh.points))
    return settings.gravity * values**2 if manning else values


def with_overtides(forcing: TideForcing, settings: TideSettings) -> TideForcing:
    """The forcing with the overtides of the settings, at rest on the ocean boundary.

    Frequencies, nodal factors and equilibrium arguments of overtides are combinations
    of those of the driven constituents.

    Raises
    ------
    InputError
        If a constituent is there twice or an overtide is also driven; if it is unknown,
        no combination of what is driven, or nothing would make it.
    """
    _check_names(forcing, settings)
    size = strength(forcing.elevation, forcing.potential)
    known = {name.upper(): k for k, name in enumerate(forcing.names)}
    new = []
    for name in settings.overtides:
        k = known.get(name.upper())
        if k is None:
            new.append(name.upper())
        elif size[k] > 0.0:
            raise InputError(
                f"{name} is among the overtides, and the forcing drives it at the "
                "ocean boundary or inside: leave it out of one of the two"
            )
    if not new:
        return forcing
    driven = np.flatnonzero(size > 0.0)
    table = np.array(
        [
            _table_frequency(forcing.names[k], forcing.frequency[k])
            for k in driven.tolist()
        ]
    )
    rows = []
    for name in new:
        if name not in constants.SPEED_DEG_PER_HOUR:
            raise InputError(
                f"the overtide {name} is unknown; known are "
                + ", ".join(constants.SPEED_DEG_PER_HOUR)
            )
        row = as_combination(constants.frequency(name), table)
        if row is None:
            raise InputError(
                f"the overtide {name} is no combination of the driven constituents "
                + ", ".join(forcing.names[k] for k in driven)
            )
        rows.append(row)
    combination = np.array(rows)

    def longer(values: np.ndarray | None, more: np.ndarray) -> np.ndarray | None:
        return None if values is None else np.concatenate([values, more])

    def at_rest(values: np.ndarray) -> np.ndarray:
        return np.zeros((len(new), values.shape[1]))

    factor, argument = forcing.nodal_factor, forcing.argument
    return TideForcing(
        names=(*forcing.names, *new),
        frequency=longer(forcing.frequency, combination @ forcing.frequency[driven]),
        nodes=forcing.nodes,
        elevation=longer(forcing.elevation, at_rest(forcing.elevation)),
        nodal_factor=None
        if factor is None
        else longer(factor, np.prod(factor[driven] ** np.abs(combination), axis=1)),
        argument=None
        if argument is None
        else longer(argument, combination @ argument[driven]),
        potential=None
        if forcing.potential is None
        else longer(forcing.potential, at_rest(forcing.potential)),
    )


@dataclass(frozen=True)
class FrequencyDomain:
    """The frequency-domain solver as a `TideEngine`."""

    settings: TideSettings = field(default_factory=TideSettings)

    def solve(self, mesh: CoastalMesh, forcing: TideForcing) -> TideSolution:
        """Solve with this engine's settings; see `solve`."""
        return solve(mesh, forcing, self.settings)


def _table_frequency(name: str, given: float) -> float:
    """Frequency of the table where the name is there and the forcing means the same."""
    if name.upper() in constants.SPEED_DEG_PER_HOUR:
        known = constants.frequency(name)
        if abs(known - given) <= _NEAR:
            return known
    return given


def _check_names(forcing: TideForcing, settings: TideSettings) -> None:
    for what, names in (
        ("the forcing", forcing.names),
        ("overtides", settings.overtides),
    ):
        upper = [name.upper() for name in names]
        for name in upper:
            if upper.count(name) > 1:
                raise InputError(f"the constituent {name} is twice in {what}")
    if settings.overtides and not is_nonlinear(settings):
        raise InputError(
            "nothing makes the overtides "
            + ", ".join(settings.overtides)
            + ': use friction_law = "quadratic", finite_amplitude or advection'
        )
    if is_nonlinear(settings):
        order = np.argsort(forcing.frequency, kind="stable")
        same = np.flatnonzero(np.diff(forcing.frequency[order]) == 0.0)
        if len(same):
            first, second = order[same[0]], order[same[0] + 1]
            raise InputError(
                f"{forcing.names[first]} and {forcing.names[second]} have the same "
                f"frequency, {forcing.frequency[first]:g} rad/s"
            )


def _check_forcing(mesh: CoastalMesh, forcing: TideForcing) -> None:
    n = len(mesh.points)
    if len(forcing.nodes) == 0 and forcing.potential is None:
        raise EngineError(
            "the mesh has no open (ocean) boundary, so nothing drives the tide"
            if len(mesh.open_nodes) == 0
            else "the forcing names no open (ocean) boundary node, so nothing drives "
            "the tide"
        )
    finite = np.isfinite(forcing.elevation)
    if not finite.all():
        constituent, place = np.argwhere(~finite)[0]
        node = int(forcing.nodes[place])
        raise InputError(
            f"the forcing of {forcing.names[constituent]} at ocean node {node} is not "
            f"a finite number: {forcing.elevation[constituent, place]}"
        )
    if not (np.isfinite(forcing.frequency) & (forcing.frequency >= 0.0)).all():
        raise InputError(
            "the frequencies of the forcing must be finite and not negative: "
            + ", ".join(f"{n} {w:g}" for n, w in zip(forcing.names, forcing.frequency))
        )
    if forcing.nodal_factor is not None:
        good = np.isfinite(forcing.nodal_factor) & (forcing.nodal_factor > 0.0)
        if not good.all():
            k = int(np.flatnonzero(~good)[0])
            raise InputError(
                f"the nodal factor of {forcing.names[k]} must be positive, it is "
                f"{forcing.nodal_factor[k]:g}"
            )
    if forcing.argument is not None and not np.isfinite(forcing.argument).all():
        k = int(np.flatnonzero(~np.isfinite(forcing.argument))[0])
        raise InputError(
            f"the equilibrium argument of {forcing.names[k]} is not a finite number"
        )
    if forcing.potential is not None:
        if forcing.potential.shape[1] != n:
            raise InputError(
                f"the tidal potential has {forcing.potential.shape[1]} nodes, the mesh "
                f"{n}: it belongs to another mesh"
            )
        if not np.isfinite(forcing.potential).all():
            k, node = np.argwhere(~np.isfinite(forcing.potential))[0]
            raise InputError(
                f"the tidal potential of {forcing.names[k]} at node {int(node)} is not "
                "a finite number"
            )
    if len(forcing.nodes) and forcing.nodes.max() < n:
        missed = np.setdiff1d(mesh.open_nodes, forcing.nodes)
        if len(missed):
            longitude, latitude = mesh.projection.inverse(mesh.points[missed[0]])
            raise InputError(
                f"the forcing misses {len(missed)} of {len(mesh.open_nodes)} nodes of "
                f"the ocean boundary, the first is node {int(missed[0])} at "
                f"({longitude:.5f}, {latitude:.5f}): give their elevation, or make "
                "that part of the boundary land"
            )


def _check_depth(mesh: CoastalMesh) -> None:
    good = np.isfinite(mesh.depth) & (mesh.depth > 0.0)
    if not good.all():
        node = int(np.flatnonzero(~good)[0])
        longitude, latitude = mesh.projection.inverse(mesh.points[node])
        raise MeshError(
            f"{int((~good).sum())} nodes have no water: a depth of "
            f"{mesh.depth[node]:g} m at node {node}, ({longitude:.5f}, "
            f"{latitude:.5f}); friction by the depth needs positive depths: raise the "
            "minimum depth"
        )


def _ignore(_: float) -> None:
    pass
