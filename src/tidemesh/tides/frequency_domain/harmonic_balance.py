"""Nonlinear tides: constituents that act on each other, iterated to agreement.

Every constituent obeys the linear equations with loads of the others,

    i w u + T u + f k x u = -g grad(e - p) + m,   m = T u - F(u) - A(u),
    i w e + div(h u + E) = 0,

where F is the bottom friction, A the advection, E = the mean of e u, all projected on
the constituent, and T the mean derivative of the friction by the velocity. With u on
the right from the last iteration, what is lagged is small: for one constituent at most
a third of T.
"""

from __future__ import annotations

import copy
import logging
from collections import deque
from collections.abc import Callable, Iterable
from typing import NamedTuple

import msgspec
import numpy as np

from tidemesh.errors import ConvergenceError
from tidemesh.tides.frequency_domain.energy import EnergyBalance, constituent_energy
from tidemesh.tides.frequency_domain.nonlinear_terms import (
    LEAST_WATER,
    NonlinearTerms,
    Places,
    Terms,
)
from tidemesh.tides.frequency_domain.parallel import each
from tidemesh.tides.frequency_domain.sampling import PhaseLattice
from tidemesh.tides.frequency_domain.velocity import (
    nodal_gradient,
    nodal_response,
    turn,
)
from tidemesh.tides.frequency_domain.wave_equation import (
    FactorisedWave,
    Symbols,
    WaveEquation,
)

logger = logging.getLogger(__name__)

KEPT_UNKNOWNS = 2_000_000
"""Constituents times nodes up to which all factors stay in memory (about 2 kB each)."""

REFACTOR = 0.2
"""Relative change of T above which the equations are factorised again."""

TOO_WEAK = 1.0
"""The same at one place, upwards: with too little of T an iteration overshoots."""

_STILL = 1.0e-3
"""Least mean derivative of the friction over the largest frequency."""

_CARRIED = 0.5
"""What T gains over the rate at which water crosses a triangle: the advection is all
lagged, and this shortens the steps where it is strong."""

_DAILY = 7.3e-5
"""rad/s, where nothing oscillates."""

_HISTORY = 8
"""Iterations that the acceleration draws on."""

_ROUGH, _ROUGH_ITERATIONS = 0.05, 6
"""Change at which the strongest constituent alone is good enough to start from."""

_RUNAWAY = 100.0
"""Root mean square elevation over that of the drive, above which no tide is."""

_NODAL_SWEEPS = 30


class IterationReport(NamedTuple):
    """How the nonlinear terms converged."""

    iterations: int
    """0 for a linear tide."""
    change: float
    """Largest change of the elevation in the last iteration over its root mean
    square."""
    converged: bool


class Drive(NamedTuple):
    """What drives the constituents, amplitudes as they act (nodal factors in)."""

    names: tuple[str, ...]
    symbols: tuple[Symbols, ...]
    combination: np.ndarray
    """(n_c, n_fundamental) int, phases by the fundamental ones."""
    boundary: np.ndarray
    """(n_c, n_ocean) complex m."""
    potential: np.ndarray | None
    """(n_c, n_points) complex m."""

    def only(self, k: int) -> Drive:
        """One of the constituents, whose phase is then the fundamental one."""
        return Drive(
            self.names[k : k + 1],
            self.symbols[k : k + 1],
            np.ones((1, 1), dtype=np.int64),
            self.boundary[k : k + 1],
            None if self.potential is None else self.potential[k : k + 1],
        )

    def strength(self) -> np.ndarray:
        """(n_c,) root mean square of what drives each (m)."""
        return strength(self.boundary, self.potential)


def strength(boundary: np.ndarray, potential: np.ndarray | None) -> np.ndarray:
    """(n_c,) root mean square of elevations at the boundary and a potential (m)."""
    square = np.zeros(len(boundary))
    for part in (boundary, potential):
        if part is not None and part.shape[1]:
            square += (np.abs(part) ** 2).mean(axis=1)
    return np.sqrt(square)


class State(NamedTuple):
    """The tide of an iteration."""

    elevation: np.ndarray
    """(n_c, n_points) complex m."""
    velocity: np.ndarray
    """(n_c, 2, n) complex m/s, of the triangles or nodes that the terms are of."""


class HarmonicBalance:
    """The nonlinear tide of a mesh.

    Parameters
    ----------
    equation : WaveEquation
        Its friction is the linear one of the settings.
    drive : Drive
    drag : (n_points,) array or None
        C_f, or g n**2 for Manning's formula; None for linear friction.
    """

    def __init__(self, equation: WaveEquation, drive: Drive, drag: np.ndarray | None):
        self.equation = equation
        self.drive = drive
        self.drag = drag
        self.lattice = PhaseLattice(drive.combination)
        elements = equation.elements
        self.terms = self._terms(*self._places())
        settings = equation.settings
        rates = [abs(s.momentum) for s in drive.symbols if s.momentum]
        self._rates = rates if rates else [_DAILY]
        self._threads = min(settings.threads, len(drive.names))
        size = len(drive.names) * elements.n_points
        self._keeps_factors = size <= KEPT_UNKNOWNS
        self._waves: dict[int, FactorisedWave] = {}
        self._split = equation
        self._last: tuple[State, Terms] | None = None
        self._shown = 0.0
        self.change = np.inf
        self.iterations = 0

    def _places(self) -> tuple[Places, np.ndarray]:
        """Where the terms are evaluated, and the linear friction there."""
        equation = self.equation
        drag = None if self.drag is None else equation.elements.mean(self.drag)
        return Places(equation.depth, drag), equation._element_friction

    def _terms(self, places: Places, linear: np.ndarray) -> NonlinearTerms:
        settings = self.equation.settings
        law = linear if self.drag is None else None
        if law is not None:
            places = Places(places.depth, np.zeros_like(places.depth))
        return NonlinearTerms(self.lattice, places, settings, law)

    # ---- iteration -----------------------------------------------------------------

    def solve(self, report: Callable[[float], None]) -> State:
        """Iterate until the elevation stays.

        Raises
        ------
        ConvergenceError
            If the iteration diverges or does not reach its tolerance.
        """
        settings = self.equation.settings
        state = self._start()
        history = _Acceleration(self._weights(), _HISTORY)
        limit = _RUNAWAY * self.drive.strength().max()
        for self.iterations in range(1, settings.max_iterations + 1):
            if self._renew_split(state):
                history.forget()
            previous, state = state, self._advance(state)
            self.change = self._change_of(previous, state)
            logger.info("iteration %d: change %.1e", self.iterations, self.change)
            report(self._progress())
            if self.change <= settings.tolerance:
                self._waves.clear()
                return state
            if not self._rms(state.elevation) < limit:
                break
            state = State(*history.next(previous, state))
        if settings.advection:
            advice = (
                "leave out advection, which harmonics cannot follow in strong jets, or "
                "use the time-domain model"
            )
        elif settings.finite_amplitude:
            advice = (
                "raise max_iterations, or the minimum depth where the water is shallow "
                "against the tide, or leave out finite_amplitude"
            )
        else:
            advice = "raise max_iterations"
        raise ConvergenceError(
            f"the nonlinear tide did not converge: after {self.iterations} iterations "
            f"the elevation still changes by {self.change:.1e} of its root mean "
            f"square, more than the tolerance {settings.tolerance:g}; {advice}"
        )

    def _start(self) -> State:
        """The strongest constituent alone, roughly, and nothing of the others."""
        n_c = len(self.drive.names)
        elements = self.equation.elements
        state = State(
            np.zeros((n_c, elements.n_points), dtype=np.complex128),
            np.zeros((n_c, 2, len(self.terms.places.depth)), dtype=np.complex128),
        )
        strongest = int(np.argmax(self.drive.strength()))
        if n_c == 1 or self.drag is None:
            return state
        one = self._alone(strongest)
        state.elevation[strongest] = one.elevation[0]
        state.velocity[strongest] = one.velocity[0]
        return state

    def _alone(self, k: int) -> State:
        """One constituent with its friction alone, roughly."""
        equation = copy.copy(self.equation)
        equation.settings = msgspec.structs.replace(
            equation.settings, finite_amplitude=False, advection=False
        )
        balance = type(self)(equation, self.drive.only(k), self.drag)
        state = balance._start()
        for _ in range(_ROUGH_ITERATIONS):
            balance._renew_split(state)
            previous, state = state, balance._advance(state)
            change = balance._change_of(previous, state)
            if change < _ROUGH:
                break
        return state

    def _advance(self, state: State) -> State:
        """Solve all constituents under the loads of the others."""
        terms = self._evaluate(state)
        equation, drive = self._split, self.drive
        g = equation.settings.gravity

        def solve(k: int) -> tuple[np.ndarray, np.ndarray]:
            load = equation.resistance(state.velocity[k]) - terms.friction[k]
            if terms.advection is not None:
                load -= terms.advection[k]
            slope = load / -g
            if drive.potential is not None:
                slope -= equation.elements.gradient_of(drive.potential[k])
            symbols = drive.symbols[k]
            transport = equation.depth * equation.flow(symbols, slope)
            if terms.flux is not None:
                transport = transport + terms.flux[k]
            wave = self._wave(k)
            elevation = wave.elevation(
                drive.boundary[k], equation.divergence(transport)
            )
            slope += equation.elements.gradient_of(elevation)
            return elevation, equation.flow(symbols, slope)

        solved = each(solve, range(len(drive.names)), self._threads)
        self._last = state, terms
        return State(*(np.stack(part) for part in zip(*solved)))

    def _wave(self, k: int) -> FactorisedWave:
        if k in self._waves:
            return self._waves[k]
        wave = self._split.factorise(self.drive.symbols[k])
        if self._keeps_factors:
            self._waves[k] = wave
        return wave

    def _renew_split(self, state: State) -> bool:
        """Take the mean derivative of the friction anew where it has changed."""
        advection = self.equation.settings.advection
        if not state.velocity.any() or (self.drag is None and not advection):
            return False
        slope = self.terms.mean_slope(state.velocity, self._level(state))
        tensor = self._held(slope)
        if advection:
            tensor[::2] += _CARRIED * self._carried(state.velocity)
        old = self._split._element_friction
        if old.ndim == 2:
            moved = (tensor - old)[::2].sum(axis=0)
            moved /= min(self._rates) + old[::2].sum(axis=0)
            area = self.equation.elements.area
            mean = (area * np.abs(moved)).sum() / area.sum()
            if mean <= REFACTOR and moved.max() <= TOO_WEAK:
                return False
        self._split = self.equation.with_friction(tensor)
        self._waves.clear()
        return True

    def _evaluate(self, state: State) -> Terms:
        shear = None
        if self.equation.settings.advection:
            shear = np.stack([self._shear(row) for row in state.velocity])
        return self.terms.evaluate(state.velocity, self._level(state), shear)

    def _carried(self, velocity: np.ndarray) -> np.ndarray:
        """(n_triangles,) root mean square speed over the size of the triangle (1/s)."""
        square = 0.5 * (np.abs(velocity) ** 2).sum(axis=(0, 1))
        return np.sqrt(square / (2.0 * self.equation.elements.area))

    def _level(self, state: State) -> np.ndarray | None:
        """(n_c, n_triangles) elevation of the triangles, where it counts."""
        if not self.equation.settings.finite_amplitude:
            return None
        mean = self.equation.elements.mean
        return np.stack([mean(row) for row in state.elevation])

    def _shear(self, velocity: np.ndarray) -> np.ndarray:
        """(4, n_triangles) derivatives of the mean velocities at the nodes."""
        elements = self.equation.elements
        corners = elements.from_corners(elements.nodal_vector(velocity))
        return np.einsum("ikm,jkm->ijm", corners, elements.gradient).reshape(4, -1)

    def _change_of(self, before: State, after: State) -> float:
        size = self._rms(after.elevation)
        if size == 0.0:
            return 0.0
        return float(np.abs(after.elevation - before.elevation).max() / size)

    @staticmethod
    def _rms(elevation: np.ndarray) -> float:
        return float(np.sqrt((np.abs(elevation) ** 2).sum(axis=0).mean()))

    def _weights(self) -> State:
        """Square roots of the energy of a unit elevation and velocity."""
        elements = self.equation.elements
        share = elements.scatter(
            np.broadcast_to(elements.area / 3.0, elements.corners.shape)
        )
        mass = self.equation.depth * elements.area / self.equation.settings.gravity
        return State(np.sqrt(share), np.sqrt(mass))

    def _progress(self) -> float:
        """Share of the way, by the change so far."""
        goal = self.equation.settings.tolerance
        way = np.log(max(self.change, goal)) / np.log(min(goal, 0.5))
        self._shown = max(self._shown, float(np.clip(0.2 + 0.7 * way, 0.0, 0.95)))
        return self._shown

    # ---- what follows from the answer ------------------------------------------------

    def energy(self, state: State) -> EnergyBalance:
        """Balance of the answer, with the friction force of the last iteration."""
        before, terms = self._last
        rows = []
        for k, symbols in enumerate(self.drive.symbols):
            later = self._split.resistance(state.velocity[k] - before.velocity[k])
            potential = self.drive.potential
            row = constituent_energy(
                self._split,
                symbols,
                state.elevation[k],
                state.velocity[k],
                friction=terms.friction[k] + later,
                advection=None if terms.advection is None else terms.advection[k],
                flux=None if terms.flux is None else terms.flux[k],
                potential=None if potential is None else potential[k],
            )
            rows.append(row)
        return EnergyBalance(*np.array(rows).T)

    def nodal(self, state: State) -> tuple[np.ndarray, np.ndarray]:
        """Velocity and friction coefficient at the nodes.

        The momentum equations of the nodes, with the gradients that the settings choose
        and the friction of the nodes' own depth and velocity.

        Returns
        -------
        velocity : (n_c, n_points, 2) complex array
            m/s.
        friction : (n_c, n_points) or (n_points,) array
            Linear coefficient (1/s) that does the same work; of an overtide the mean
            derivative of the friction by its velocity.
        """
        equation, drive = self.equation, self.drive
        elements, settings = equation.elements, equation.settings
        velocity = np.stack([elements.nodal_vector(u) for u in state.velocity])
        driving = state.elevation
        if drive.potential is not None:
            driving = driving - drive.potential
        slope = np.stack([nodal_gradient(equation, row) for row in driving])
        advection = self._last[1].advection
        if advection is not None:
            slope += np.stack([elements.nodal_vector(row) for row in advection]) / (
                settings.gravity
            )
        tensor = np.empty((3, elements.n_points))
        force, before = np.empty_like(velocity), np.empty_like(velocity)
        linear = np.broadcast_to(equation.friction, elements.n_points)
        active = np.arange(elements.n_points)
        for _ in range(_NODAL_SWEEPS):
            drag = None if self.drag is None else self.drag[active]
            places = Places(equation.mesh.depth[active], drag)
            terms = self._terms(places, linear[active])
            old = velocity[:, :, active]
            level = state.elevation[:, active]
            tensor[:, active] = self._held(terms.mean_slope(old, level))
            resisted = terms.evaluate(old, level, transport=False).friction
            before[:, :, active], force[:, :, active] = old, resisted
            new = np.empty_like(old)
            for k, symbols in enumerate(drive.symbols):
                lag = resisted[k] - _times(tensor[:, active], old[k])
                response = nodal_response(equation, symbols, tensor)[:, :, active]
                new[k] = turn(response, slope[k][:, active] + lag / settings.gravity)
            velocity[:, :, active] = new
            size = np.sqrt((np.abs(velocity) ** 2).mean())
            moved = np.abs(new - old).max(axis=(0, 1)) > settings.tolerance * size
            active = active[moved]
            if len(active) == 0:
                break
        self._warn_of_low_water(state)
        friction = equation.friction
        if self.drag is not None:
            friction = self._equivalent(before, force, tensor)
        return np.ascontiguousarray(velocity.transpose(0, 2, 1)), friction

    def _warn_of_low_water(self, state: State) -> None:
        if not self.equation.settings.finite_amplitude:
            return
        lowest = (1.0 - LEAST_WATER) * self.equation.mesh.depth
        low = int((np.abs(state.elevation).sum(axis=0) > lowest).sum())
        if low:
            logger.warning(
                "at %d of %d nodes the tide may leave less water than %g of the depth "
                "below mean level, where friction takes that much: wetting and drying "
                "are not part of this model",
                low,
                state.elevation.shape[1],
                LEAST_WATER,
            )

    def _held(self, tensor: np.ndarray) -> np.ndarray:
        """Mean derivative of the friction, where no water moves not quite zero.

        Nothing else would hold a steady constituent there.
        """
        if self.drag is not None:
            tensor[::2] += _STILL * max(self._rates)
        return tensor

    def _equivalent(
        self, velocity: np.ndarray, force: np.ndarray, tensor: np.ndarray
    ) -> np.ndarray:
        square = (np.abs(velocity) ** 2).sum(axis=1)
        work = (velocity.conj() * force).real.sum(axis=1)
        mean = 0.5 * (tensor[0] + tensor[2])
        friction = np.broadcast_to(mean, work.shape).copy()
        np.divide(work, square, out=friction, where=square > 0.0)
        # Where one velocity nearly vanishes, the others decide about its friction.
        friction = np.clip(friction, 0.0, 2.0 * mean)
        friction[self.drive.strength() == 0.0] = mean
        return friction


def _times(tensor: np.ndarray, vectors: np.ndarray) -> np.ndarray:
    """(3, n) symmetric tensors times (2, n) vectors."""
    (xx, xy, yy), (u, v) = tensor, vectors
    return np.stack([xx * u + xy * v, xy * u + yy * v])


class _Acceleration:
    """Anderson's acceleration of a fixed-point iteration x -> G(x).

    The next x is the combination of the last images whose combined step G(x) - x is
    the smallest (Walker & Ni 2011).
    """

    def __init__(self, weights: State, size: int):
        self._weights = weights
        self._size = size
        self.forget()

    def forget(self) -> None:
        """Start anew: the map has changed."""
        self._images: deque[State] = deque(maxlen=self._size)
        self._steps: deque[list[np.ndarray]] = deque(maxlen=self._size)
        self._products = np.zeros((0, 0))

    def next(self, before: State, image: State) -> Iterable[np.ndarray]:
        """The next trial, from the last one and its image."""
        step = [
            (w * (b - a)).astype(np.complex64)
            for w, a, b in zip(self._weights, before, image)
        ]
        if len(self._steps) == self._size:
            self._products = self._products[1:, 1:]
        self._images.append(image)
        self._steps.append(step)
        row = [
            sum(float(np.vdot(x, y).real) for x, y in zip(step, other))
            for other in self._steps
        ]
        count = len(row)
        products = np.zeros((count, count))
        products[:-1, :-1] = self._products
        products[-1] = products[:, -1] = row
        self._products = products
        share = _least(products)
        for parts in zip(*self._images):
            yield sum(s * part for s, part in zip(share, parts))


def _least(products: np.ndarray) -> np.ndarray:
    """Weights of sum 1 that make the combined step smallest."""
    count = len(products)
    scale = np.sqrt(products.diagonal())
    if not scale.all():
        return np.eye(count)[-1]
    # A trace of the diagonal keeps near parallel steps apart.
    normal = products / products[-1, -1]
    normal = normal + 1e-10 * np.diag(normal.diagonal())
    share = np.linalg.solve(normal, np.ones(count))
    return share / share.sum()
