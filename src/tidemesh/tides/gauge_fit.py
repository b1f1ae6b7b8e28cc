"""Ocean boundary values from harmonic constants at gauges.

The tide is linear in its boundary values, so one transposed solve for each gauge gives
the exact effect of every boundary node on it. The boundary values follow by least
squares, tied together by their smoothness along the boundary (docs/method.md, 4).
"""

from __future__ import annotations

import logging
from collections.abc import Callable
from dataclasses import dataclass, replace

import msgspec
import numpy as np
import scipy.linalg
import scipy.sparse as sparse

from tidemesh.datatypes import CoastalMesh, TideForcing, TideSolution, TideTable
from tidemesh.datatypes._arrays import ComplexArray, FloatArray, own_fields
from tidemesh.errors import EngineError, InputError
from tidemesh.tides.frequency_domain.gwce import GwceEquation, symbols_for
from tidemesh.tides.frequency_domain.solve import is_nonlinear, solve
from tidemesh.tides.frequency_domain.wave_equation import (
    Symbols,
    WaveEquation,
)
from tidemesh.tides.settings import TideSettings
from tidemesh.triangulation.locate import Locator

logger = logging.getLogger(__name__)

SAME_GAUGE_M = 500.0
"""Rows of the table nearer to each other than this are one gauge."""

SHALLOWEST_M = 1.0
"""Less depth on the open boundary counts as this."""

SLOPE_PENALTY = 0.01
"""Weight of the first derivative along the boundary beside that of the second: a linear
trend across the whole of it costs 1/5000 of an arch of the same height."""

WEAKEST, STRONGEST, CHOICES = 1.0e-8, 1.0e-2, 61
"""Smoothness tried by leaving gauges out. At the strongest an arch of 10 cm along the
whole boundary costs as much as a misfit of 7 cm at one gauge. More would hold any tide
to a constant; that is what leaving out the last gauge before an end of the boundary
votes for, since nothing predicts it."""

MARGIN = 0.25
"""By so much more than the least may the sum of squared leave-one-out errors be."""

DEFAULT_SMOOTHNESS = 1.0e-3
"""Where two gauges or less leave nothing to choose it by."""

LEAST_OUTLIER = 0.05
"""A gauge whose studentised residual is a smaller part of its tide is no outlier."""

FEWEST_TO_JUDGE = 5
"""Gauges that it takes to call one of them an outlier."""

MAX_PASSES = 8
PASS_TOLERANCE = 1.0e-3
"""Fits with nonlinear friction end at this relative change of the boundary values."""

_LOOSEST = 1.0e-2
"""Tolerance of the first nonlinear solves of a fit."""


@dataclass(frozen=True)
class LeftOut:
    """A row of the table that took no part in the fit."""

    station: str
    longitude_deg: float
    latitude_deg: float
    reason: str


@dataclass(frozen=True, eq=False)
class BoundaryFit:
    """Boundary values fitted to gauges, and how well they do it."""

    forcing: TideForcing
    """The fitted values at the open nodes."""
    gauges: TideTable
    """The (n_g,) gauges that were used, with their observed constants; NaN where a
    constituent is absent."""
    left_out: tuple[LeftOut, ...]
    """The other rows of the table, each with the reason."""
    modelled: ComplexArray
    """(n_c, n_g) m, of the fitted boundary."""
    leave_one_out: ComplexArray
    """(n_c, n_g) m, observed minus what the fit without that gauge predicts for it; NaN
    where the constituent is absent or nothing else is left to fit."""
    standard_error: FloatArray
    """(n_c, n_ocean) m, of the boundary values: large where no gauge sees them. NaN
    with a single gauge."""
    smoothness: FloatArray
    """(n_c,) weight of the smoothness against the misfit."""

    def __post_init__(self) -> None:
        n_c, n_g = self.gauges.elevation.shape
        own_fields(
            self,
            modelled=(np.complex128, (n_c, n_g)),
            leave_one_out=(np.complex128, (n_c, n_g)),
            standard_error=(np.float64, (n_c, len(self.forcing.nodes))),
            smoothness=(np.float64, (n_c,)),
        )

    @property
    def observed(self) -> ComplexArray:
        """(n_c, n_g) m, NaN where absent."""
        return self.gauges.elevation

    @property
    def residual(self) -> ComplexArray:
        """(n_c, n_g) m, observed minus modelled, NaN where absent."""
        return self.observed - self.modelled


def fit_boundary(
    mesh: CoastalMesh,
    table: TideTable,
    settings: TideSettings | None = None,
    *,
    smoothness: float | np.ndarray | None = None,
    first_guess: TideForcing | None = None,
    max_distance_m: float = 3_000.0,
    minimum_gauges: int = 1,
    outlier: float | None = None,
    friction: float | np.ndarray | None = None,
    drag: float | np.ndarray | None = None,
    complete: Callable[[TideForcing], TideForcing] | None = None,
    progress: Callable[[float], None] | None = None,
) -> BoundaryFit:
    """Fit smooth boundary values to the harmonic constants of gauges.

    Minimises, for every constituent, the sum over the gauges of |observed - modelled|^2
    plus the smoothness times the penalty of `Roughness`: the second derivative of the
    boundary values, and a little of the first that ties them to a constant where no
    gauge sees them. Every gauge counts the same.

    Parameters
    ----------
    mesh : CoastalMesh
    table : TideTable
        Constants at gauges. Amplitudes of exactly zero stand for "not determined".
    settings : TideSettings, optional
        Constituents to fit, physics. With nonlinear friction the fit and the nonlinear
        solve alternate until the boundary values stand still.
    smoothness : float or (n_c,) array, optional
        Its weight; if not given, one for all constituents: the largest whose sum of
        squared leave-one-out errors is the least or little more. (The least itself can
        follow the gauges so closely that the boundary far from them runs wild.)
    first_guess : TideForcing, optional
        Boundary values of the same open nodes (an atlas, for instance): what is fitted
        and kept smooth is the difference from them.
    max_distance_m : float
        Farthest that a gauge may lie outside the mesh.
    minimum_gauges : int
        Fewest gauges for any constituent.
    outlier : float, optional
        Gauges are left out, the worst first, whose studentised residual is more than so
        many times the median (3, for instance): in creeks and rivers that the mesh does
        not hold, as long as most gauges are on open water. None keeps all.
    friction : float, (n_points,) or (n_triangles,) array, optional
        Linear friction coefficient (1/s), instead of the settings' one value.
    drag : float or (n_points,) array, optional
        Drag coefficient or Manning's n, instead of the settings' one value.
    complete : callable, optional
        Adds to a forcing what else drives the tide (nodal factors, tidal potential).
    progress : callable, optional
        Called with the fraction done.

    Returns
    -------
    fit : BoundaryFit

    Raises
    ------
    InputError
        If a constituent is not in the table, too few gauges have it inside the mesh, or
        the first guess belongs to another mesh.
    EngineError
        If the mesh has no open boundary.

    Notes
    -----
    With b = guess + c + P^+ G' y the fitted values are linear in the data, so the error
    of a gauge that is left out follows from the fit with all of them (Wahba 1990,
    Spline Models for Observational Data, chapter 4). With nonlinear friction these
    errors are those of the last linear fit, friction held.
    """
    settings = TideSettings() if settings is None else settings
    complete = _unchanged if complete is None else complete
    report = _ignore if progress is None else progress
    nodes = mesh.open_nodes
    if len(nodes) == 0:
        raise EngineError(
            "the mesh has no open (ocean) boundary, so there is nothing to fit"
        )
    rows = _rows(table, settings.constituents)
    gauges, place, left_out = _choose_gauges(
        mesh, table, rows, max_distance_m, minimum_gauges
    )
    n_c = len(rows)
    first = _first_values(first_guess, gauges.names, nodes)
    given = _checked_smoothness(smoothness, n_c)
    roughness = Roughness(mesh)
    equation = _equation(mesh, nodes, settings, friction)

    def forcing_of(boundary: np.ndarray) -> TideForcing:
        return complete(TideForcing(gauges.names, gauges.frequency, nodes, boundary))

    nonlinear = is_nonlinear(settings)
    forcing, tide = forcing_of(first), None
    if forcing.potential is not None:
        tide = solve(mesh, forcing, _linear(settings), friction=friction)
    passes = MAX_PASSES if nonlinear else 1
    for step in range(passes):
        report(step / passes)
        effect = _effects(equation, tide, gauges.frequency, place)
        # What the boundary values do not make: potential, nonlinear terms.
        rest = np.zeros(gauges.elevation.shape, dtype=np.complex128)
        if tide is not None:
            rest = tide.elevation[:n_c] @ place.T
            rest -= np.einsum("cgo,co->cg", effect, forcing.elevation)
        while step == 0 and outlier is not None:
            parts = _constituents(effect, gauges.elevation - rest, first, roughness)
            weight = _chosen_smoothness(parts)
            errors = np.stack([part.studentised(weight) for part in parts])
            worst = _outlier(errors, gauges.elevation, outlier, minimum_gauges)
            if worst is None:
                break
            left_out.append(_rejected(gauges, worst, errors))
            kept = np.delete(np.arange(len(gauges.stations)), worst)
            gauges, place = _subset(gauges, kept), place[kept]
            effect, rest = effect[:, kept], rest[:, kept]
        parts = _constituents(effect, gauges.elevation - rest, first, roughness)
        if given is None:
            weights = np.full(n_c, _chosen_smoothness(parts))
            # Held after the first nonlinear pass, or it could go back and forth.
            given = weights if step == 1 else None
        else:
            weights = given
        boundary = np.stack([p.boundary(w) for p, w in zip(parts, weights)])
        change = _relative_change(forcing.elevation, boundary)
        forcing = forcing_of(boundary)
        logger.info("pass %d: boundary values changed by %.1e", step + 1, change)
        if not nonlinear or (step > 0 and change < PASS_TOLERANCE):
            break
        if step < passes - 1:
            # No sharper than the boundary values are known by now.
            loose = max(settings.tolerance, min(_LOOSEST, 0.1 * change))
            rough = msgspec.structs.replace(settings, tolerance=loose)
            tide = solve(mesh, forcing, rough, friction=friction, drag=drag)
    else:
        logger.warning("boundary values still change by %.1e", change)
    report(1.0)
    return BoundaryFit(
        forcing=forcing,
        gauges=gauges,
        left_out=tuple(left_out),
        modelled=np.einsum("cgo,co->cg", effect, boundary) + rest,
        leave_one_out=np.stack([p.leave_one_out(w) for p, w in zip(parts, weights)]),
        standard_error=np.stack([p.standard_error(w) for p, w in zip(parts, weights)]),
        smoothness=weights,
    )


class Roughness:
    """Penalty of boundary values that are not smooth along the open boundary.

    Measured along it is not the distance but the time that a long wave takes, ds /
    sqrt(g h): tides vary by wavelengths, so 100 km of deep water are stiffer than 10 km
    of shoal. With T the time along all of it, ``b' P b`` is T^3 times the integral of
    |b''|^2 plus `SLOPE_PENALTY` T times that of |b'|^2, string by string, plus what the
    means of several strings differ by. It has the units of b^2, and is zero for
    constants alone.

    Parameters
    ----------
    mesh : CoastalMesh
    """

    def __init__(self, mesh: CoastalMesh):
        nodes = mesh.open_nodes
        column = np.full(len(mesh.points), -1)
        column[nodes] = np.arange(len(nodes))
        strings = [b for b in mesh.boundaries if b.kind == "open"]
        gaps = [_travel_times(mesh, b.nodes, b.closed) for b in strings]
        length = sum(gap.sum() for gap in gaps)
        blocks = []
        for string, gap in zip(strings, gaps):
            first = np.append(string.nodes, string.nodes[:1] if string.closed else [])
            blocks += _derivatives(column[first.astype(int)], gap, length, len(nodes))
        means = np.zeros((len(strings), len(nodes)))
        for row, string in zip(means, strings):
            np.add.at(row, column[string.nodes], 1.0 / len(string.nodes))
        blocks.append(sparse.csr_array(means - means.mean(axis=0)))
        root = sparse.vstack(blocks)
        self.matrix = (root.T @ root).toarray()
        """(n_ocean, n_ocean) float array P."""
        n = len(nodes)
        # Regular with the constants in, which `_fit` takes care of by themselves.
        level = max(np.trace(self.matrix) / n, 1.0) / n
        self._factor = np.linalg.cholesky(self.matrix + level)
        self.spread = (self.half_inverse(np.eye(n)) ** 2).sum(axis=0)
        """(n_ocean,) diagonal of P^-1, with the constants in."""

    def half_inverse(self, columns: np.ndarray) -> np.ndarray:
        """R^-1 times (n_ocean, k), where R R' = P."""
        return scipy.linalg.solve_triangular(self._factor, columns, lower=True)

    def half_inverse_transposed(self, columns: np.ndarray) -> np.ndarray:
        """R'^-1 times (n_ocean,) or (n_ocean, k)."""
        return scipy.linalg.solve_triangular(
            self._factor, columns, lower=True, trans="T"
        )


class _Constituent:
    """Penalised least squares of one constituent, ready for any smoothness.

    The constant part T of the effect costs nothing, so the misfit of the data in its
    direction is zero; across it the penalty makes a kernel K = G P^+ G', whose
    eigenvectors serve every smoothness s: with Q = Z V (D + s)^-1 V' Z' the residual is
    s Q d, and that of gauge i left out (Q d)_i / Q_ii.
    """

    def __init__(
        self,
        effect: np.ndarray,
        observed: np.ndarray,
        guess: np.ndarray,
        roughness: Roughness,
    ):
        self.known = np.isfinite(observed)
        self._guess, self._roughness = guess, roughness
        self._effect = effect = effect[self.known]
        self._data = observed[self.known] - effect @ guess
        self._constant = effect.sum(axis=1)
        self._half = roughness.half_inverse(effect.conj().T)
        across = np.linalg.qr(self._constant[:, None], mode="complete")[0][:, 1:]
        kernel = self._half @ across
        values, vectors = np.linalg.eigh(kernel.conj().T @ kernel)
        self._values, self._vectors = np.maximum(values, 0.0), across @ vectors
        self._score = self._vectors.conj().T @ self._data

    def leave_one_out(self, smoothness: float) -> np.ndarray:
        """(n_g,) errors, NaN where nothing is known or nothing else is."""
        errors = np.full(len(self.known), complex(np.nan, np.nan))
        if len(self._data) > 1:
            damped = 1.0 / (self._values + smoothness)
            share = (np.abs(self._vectors) ** 2) @ damped
            errors[self.known] = self._vectors @ (self._score * damped) / share
        return errors

    def studentised(self, smoothness: float) -> np.ndarray:
        """(n_g,) residuals, each scaled to what it would be without leverage.

        A gauge that nothing else predicts has a large error when it is left out, and is
        no outlier for that.
        """
        free = np.full(len(self.known), np.nan)
        damped = smoothness / (self._values + smoothness)
        free[self.known] = (np.abs(self._vectors) ** 2) @ damped
        return self.leave_one_out(smoothness) * np.sqrt(free)

    def boundary(self, smoothness: float) -> np.ndarray:
        """(n_ocean,) boundary values."""
        pull = self._vectors @ (self._score / (self._values + smoothness))
        smooth = self._roughness.half_inverse_transposed(self._half @ pull)
        misfit = self._data - smoothness * pull - self._effect @ smooth
        constant = self._constant
        level = (constant.conj() @ misfit) / (constant.conj() @ constant)
        return self._guess + smooth + level

    def standard_error(self, smoothness: float) -> np.ndarray:
        """(n_ocean,) m, with the penalty taken for the prior of the boundary values.

        The diagonal of v (G' G + s P)^-1 with the noise v that the residual shows
        (Wahba 1983), by way of the matrix of the gauges.
        """
        n = len(self._data)
        if n < 2:
            return np.full(len(self._guess), np.nan)
        damped = 1.0 / (self._values + smoothness)
        # The noise over the smoothness, from |s Q d|^2 and the trace of s Q.
        variance = (np.abs(self._score * damped) ** 2).sum() / damped.sum()
        seen = self._roughness.half_inverse_transposed(self._half).conj().T
        constant = self._constant
        kernel = self._half.conj().T @ self._half + smoothness * np.eye(n)
        solved = np.linalg.solve(kernel, np.column_stack([seen, constant]))
        level = np.abs(1.0 - constant.conj() @ solved[:, :-1]) ** 2
        level /= (constant.conj() @ solved[:, -1]).real
        spread = self._roughness.spread - (seen.conj() * solved[:, :-1]).sum(axis=0)
        return np.sqrt(variance * np.maximum(spread.real + level, 0.0))


def _constituents(
    effect: np.ndarray, observed: np.ndarray, first: np.ndarray, roughness: Roughness
) -> list[_Constituent]:
    return [_Constituent(*row, roughness) for row in zip(effect, observed, first)]


def _chosen_smoothness(parts: list[_Constituent]) -> float:
    """The smoothness of the least leave-one-out errors.

    Constituents differ in size, hardly in shape, and a dozen gauges say little: so all
    are judged together. The largest smoothness within the `MARGIN` is taken.
    """
    judges = [part for part in parts if part.known.sum() > 2]
    if not judges:
        return DEFAULT_SMOOTHNESS
    tried = np.geomspace(STRONGEST, WEAKEST, CHOICES)
    total = np.zeros(CHOICES)
    for part in judges:
        errors = np.stack([part.leave_one_out(weight) for weight in tried])
        total += np.nansum(np.abs(errors) ** 2, axis=1)
    chosen = int(np.argmin(total))
    limit = total[chosen] * (1.0 + MARGIN)
    # Step by step, not over a hump to the constants.
    while chosen > 0 and total[chosen - 1] <= limit:
        chosen -= 1
    return float(tried[chosen])


def _outlier(
    errors: np.ndarray, observed: np.ndarray, factor: float, minimum: int
) -> int | None:
    """The gauge that disagrees most with all others, if it does so by too much."""
    error, tide = _total(errors), _total(observed)
    enough = np.isfinite(observed).sum(axis=1).min() > minimum
    if len(error) < FEWEST_TO_JUDGE or not enough:
        return None
    worst = int(np.argmax(error))
    limit = max(factor * float(np.median(error)), LEAST_OUTLIER * tide[worst])
    return worst if error[worst] > limit else None


def _rejected(gauges: TideTable, worst: int, errors: np.ndarray) -> LeftOut:
    error = _total(errors)
    reason = (
        f"disagrees with the others by {error[worst]:.3f} m, where half of them agree "
        f"to {np.median(error):.3f} m"
    )
    logger.info("%s left out: %s", gauges.stations[worst], reason)
    return LeftOut(
        gauges.stations[worst],
        float(gauges.longitude_deg[worst]),
        float(gauges.latitude_deg[worst]),
        reason,
    )


def _total(amplitudes: np.ndarray) -> np.ndarray:
    """(n_c, n_g) -> (n_g,) root of the sum of squares, what is absent left out."""
    return np.sqrt(np.nansum(np.abs(amplitudes) ** 2, axis=0))


def _effects(
    equation: WaveEquation,
    tide: TideSolution | None,
    frequency: np.ndarray,
    place: sparse.csr_array,
) -> np.ndarray:
    """(n_c, n_g, n_ocean) effect of the boundary, with the friction of a tide."""
    effects = []
    for k, omega in enumerate(frequency):
        at = equation
        if tide is not None and tide.friction.ndim == 2:
            at = equation.with_friction(tide.friction[k])
        if isinstance(at, GwceEquation):
            symbols = symbols_for(omega, at.settings)
        else:
            symbols = Symbols.exact(omega)
        effects.append(at.factorise(symbols).effect_of_open_nodes(place))
    return np.stack(effects)


def _equation(
    mesh: CoastalMesh,
    nodes: np.ndarray,
    settings: TideSettings,
    friction: float | np.ndarray | None,
) -> WaveEquation:
    kind = GwceEquation if settings.discretisation == "gwce" else WaveEquation
    return kind(mesh, nodes, settings, friction=friction)


def _linear(settings: TideSettings) -> TideSettings:
    return msgspec.structs.replace(
        settings,
        friction_law="linear",
        finite_amplitude=False,
        advection=False,
        overtides=(),
    )


def _travel_times(mesh: CoastalMesh, nodes: np.ndarray, closed: bool) -> np.ndarray:
    """Times between neighbours along a string, but for the factor sqrt(g)."""
    run = np.append(nodes, nodes[:1]) if closed else nodes
    distance = np.hypot(*np.diff(mesh.points[run], axis=0).T)
    depth = np.maximum(mesh.depth[run], SHALLOWEST_M)
    return distance * 0.5 * (depth[1:] ** -0.5 + depth[:-1] ** -0.5)


def _derivatives(
    columns: np.ndarray, gap: np.ndarray, length: float, n: int
) -> list[sparse.csr_array]:
    """First and second derivative along a string, scaled for the sum of squares."""
    m = len(gap)
    if m == 0:
        return []
    row = np.arange(m)
    slope = sparse.csr_array(
        (
            np.concatenate([-1.0 / gap, 1.0 / gap]),
            (np.concatenate([row, row]), np.concatenate([columns[:-1], columns[1:]])),
        ),
        shape=(m, n),
    )
    closed = columns[0] == columns[-1]
    after = np.roll(row, -1) if closed else row[1:]
    before = row if closed else row[:-1]
    between = 0.5 * (gap[before] + gap[after])
    bend = sparse.diags_array(1.0 / between) @ (slope[after] - slope[before])
    return [
        sparse.diags_array(np.sqrt(SLOPE_PENALTY * length * gap)) @ slope,
        sparse.diags_array(np.sqrt(length**3 * between)) @ bend,
    ]


def _choose_gauges(
    mesh: CoastalMesh,
    table: TideTable,
    rows: list[int],
    max_distance_m: float,
    minimum: int,
) -> tuple[TideTable, sparse.csr_array, list[LeftOut]]:
    """Gauges to fit, the weights of the nodes at them, and the rows left out."""
    positions = mesh.projection.forward(table.longitude_deg, table.latitude_deg)
    triangle, weight, distance = Locator(mesh.points, mesh.triangles).nearest(positions)
    elevation = np.where(table.elevation == 0.0, np.nan, table.elevation)[rows]
    known = np.isfinite(elevation).any(axis=0)
    stations = table.stations or tuple(f"row {k + 1}" for k in range(len(positions)))
    used: list[int] = []
    left_out = []
    for k in range(len(positions)):
        reason = None
        apart = np.hypot(*(positions[used] - positions[k]).T)
        if triangle[k] < 0 or distance[k] > max_distance_m:
            reason = f"{distance[k] / 1e3:.1f} km outside the mesh"
        elif not known[k]:
            reason = "none of the constituents is known there"
        elif len(used) and apart.min() < SAME_GAUGE_M:
            reason = f"repeats {stations[used[int(np.argmin(apart))]]}"
        if reason is None:
            used.append(k)
        else:
            longitude, latitude = table.longitude_deg[k], table.latitude_deg[k]
            left_out.append(
                LeftOut(stations[k], float(longitude), float(latitude), reason)
            )
    names = tuple(table.names[row] for row in rows)
    count = np.isfinite(elevation[:, used]).sum(axis=1)
    for name, number in zip(names, count.tolist()):
        if number < max(minimum, 1):
            raise InputError(
                f"{number} gauges in the mesh or within {max_distance_m / 1e3:g} km of "
                f"it know {name}, and the boundary fit needs {max(minimum, 1)}: use a "
                "table with gauges on this coast (longitudes are positive to the east)"
            )
    corner = mesh.triangles[triangle[used]]
    place = sparse.csr_array(
        (weight[used].ravel(), corner.ravel(), np.arange(0, 3 * len(used) + 1, 3)),
        shape=(len(used), len(mesh.points)),
    )
    wanted = replace(
        table,
        names=names,
        frequency=table.frequency[rows],
        elevation=elevation,
        stations=stations,
    )
    return _subset(wanted, np.array(used)), place, left_out


def _subset(table: TideTable, kept: np.ndarray) -> TideTable:
    return replace(
        table,
        longitude_deg=table.longitude_deg[kept],
        latitude_deg=table.latitude_deg[kept],
        elevation=table.elevation[:, kept],
        stations=tuple(table.stations[k] for k in kept),
    )


def _rows(table: TideTable, names: tuple[str, ...]) -> list[int]:
    known = [name.upper() for name in table.names]
    missing = [name for name in names if name.upper() not in known]
    if missing:
        raise InputError(
            f"the table of gauges has no {', '.join(missing)}; it has "
            + ", ".join(table.names)
        )
    return [known.index(name.upper()) for name in names]


def _first_values(
    guess: TideForcing | None, names: tuple[str, ...], nodes: np.ndarray
) -> np.ndarray:
    if guess is None:
        return np.zeros((len(names), len(nodes)), dtype=np.complex128)
    if not np.array_equal(guess.nodes, nodes):
        raise InputError(
            "the first guess of the boundary values is not for the open nodes of this "
            "mesh: interpolate it to them (boundary_forcing)"
        )
    known = [name.upper() for name in guess.names]
    missing = [name for name in names if name.upper() not in known]
    if missing:
        raise InputError(
            f"the first guess of the boundary values has no {', '.join(missing)}; it "
            "has " + ", ".join(guess.names)
        )
    return guess.elevation[[known.index(name.upper()) for name in names]]


def _checked_smoothness(
    smoothness: float | np.ndarray | None, n_c: int
) -> np.ndarray | None:
    if smoothness is None:
        return None
    values = np.asarray(smoothness, dtype=np.float64)
    if values.shape not in ((), (n_c,)):
        raise ValueError(
            f"smoothness must be a number or ({n_c},), got shape {values.shape}"
        )
    if not (np.isfinite(values) & (values > 0.0)).all():
        raise InputError("the smoothness of the boundary fit must be positive")
    return np.broadcast_to(values, (n_c,))


def _relative_change(old: np.ndarray, new: np.ndarray) -> float:
    size = np.linalg.norm(new)
    return float(np.linalg.norm(new - old) / size) if size > 0.0 else 0.0


def _unchanged(forcing: TideForcing) -> TideForcing:
    return forcing


def _ignore(_: float) -> None:
    pass
