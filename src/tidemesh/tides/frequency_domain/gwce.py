"""The generalised wave continuity equation as ADCIRC discretises it.

Continuity is differentiated in time, weighted with tau0 and added to the divergence of
the momentum equations (Lynch & Gray 1979; Luettich & Westerink 2004):

    e_tt + tau0 e_t - div(g h grad(e - p) - J) - Q . grad(tau0) = 0,
    J = (tau0 - tau) Q - f k x Q,

with the flux Q = h u of the *nodal* velocities and p the equilibrium tide. These follow
from the momentum equations with the area-weighted mean of the element gradients and the
rule at land nodes. ADCIRC steps both in time; for one frequency the velocities are
eliminated here, which leaves one equation a node with neighbours of neighbours in it.

Where tau0 = tau everywhere and f = 0, J vanishes and what is left is the plain wave
equation by Galerkin's method.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cached_property
from typing import NamedTuple

import numpy as np
import scipy.sparse as sparse

from tidemesh.datatypes import CoastalMesh, TideForcing, TideSolution
from tidemesh.errors import EngineError, InputError
from tidemesh.tides.frequency_domain.elements import MASS, Elements
from tidemesh.tides.frequency_domain.ordering import nested_dissection
from tidemesh.tides.frequency_domain.parallel import each
from tidemesh.tides.frequency_domain.velocity import (
    nodal_response,
    nodal_velocity,
    turn,
)
from tidemesh.tides.frequency_domain.wave_equation import Symbols, WaveEquation
from tidemesh.tides.settings import TideSettings

WEIGHTS = (0.35, 0.30, 0.35)
"""ADCIRC's usual weights of the surface slope at the new, present and old time."""

LUMPED_WEIGHTS = (0.0, 1.0, 0.0)
"""The only ones that ADCIRC's lumped (explicit) wave equation knows."""


class GwceSymbols(NamedTuple):
    """What the derivatives in time and the means over time levels become.

    In continuous time (i w)**2, i w, 1, i w and 1.
    """

    second: complex
    """Second derivative in the wave equation (1/s2)."""
    first: complex
    """First derivative in the wave equation (1/s)."""
    slope: complex
    """Weight of the surface slope in the wave equation."""
    momentum: complex
    """Derivative in the momentum equations (1/s)."""
    middle: complex = 1.0
    """Mean over the two time levels of the momentum equations."""

    @classmethod
    def exact(cls, frequency: float) -> GwceSymbols:
        """Continuous time."""
        rate = 1j * frequency
        return cls(rate * rate, rate, 1.0, rate)

    def plain(self, friction: float) -> Symbols:
        """Those of the plain wave equation with the same answer (tau0 = tau, f = 0)."""
        wave = self.second + friction * self.first
        return Symbols(wave / (self.slope * (self.momentum + friction)), self.momentum)


def adcirc_symbols(
    frequency: float,
    time_step: float,
    weights: tuple[float, float, float] = WEIGHTS,
) -> GwceSymbols:
    """Symbols of ADCIRC's time stepping.

    Three levels in the wave equation, Crank-Nicolson in the momentum equations.

    Parameters
    ----------
    frequency : float
        rad/s.
    time_step : float
        s (DTDP).
    weights : (3,) floats
        A00, B00, C00.

    Raises
    ------
    InputError
        If the step is not positive or not shorter than half a period.
    """
    if not (time_step > 0.0 and time_step * abs(frequency) < np.pi):
        raise InputError(
            f"a time step of {time_step:g} s does not resolve the frequency "
            f"{frequency:g} rad/s: it must be positive and shorter than half a period"
        )
    new, present, old = weights
    z = np.exp(1j * frequency * time_step)
    return GwceSymbols(
        second=(z - 2.0 + 1.0 / z) / time_step**2,
        first=(z - 1.0 / z) / (2.0 * time_step),
        slope=new * z + present + old / z,
        momentum=2.0 / time_step * (z - 1.0) / (z + 1.0),
        middle=0.5 * (z + 1.0),
    )


class GwceEquation(WaveEquation):
    """The discrete wave continuity equation of a mesh, ready for any frequency.

    Used as `WaveEquation`, with `GwceSymbols`. Every row is divided by ``symbols.slope
    * (symbols.momentum + tau0)``, so that loads are inflows (m3/s) like there.

    Parameters
    ----------
    mesh, open_nodes, settings, friction, coriolis, elements
        As for `WaveEquation`; ADCIRC's friction is nodal.
    tau0 : float or (n_points,) array, optional
        Weight of continuity (1/s), instead of ``settings.tau0``. If neither is given:
        the friction where that is one number, else ``settings.friction``.
    """

    def __init__(
        self,
        mesh: CoastalMesh,
        open_nodes: np.ndarray,
        settings: TideSettings | None = None,
        *,
        friction: float | np.ndarray | None = None,
        coriolis: float | np.ndarray | None = None,
        elements: Elements | None = None,
        tau0: float | np.ndarray | None = None,
    ):
        settings = TideSettings() if settings is None else settings
        if tau0 is None:
            tau0 = settings.tau0
        if tau0 is None:
            one = friction is not None and np.ndim(friction) == 0
            tau0 = friction if one else settings.friction
        self.tau0 = _checked_weight(tau0, len(mesh.points))
        super().__init__(
            mesh,
            open_nodes,
            settings,
            friction=friction,
            coriolis=coriolis,
            elements=elements,
        )
        _check_scalar(self)

    @property
    def coupled(self) -> bool:
        """Whether the velocities stay in the wave equation."""
        return self.coriolis is not None or bool(
            np.any(self.tau0 != self.friction) or np.any(self.tau0 != self.tau0[0])
        )

    def with_friction(self, friction: float | np.ndarray) -> GwceEquation:
        """The same equation with other friction; the rest is shared."""
        other = super().with_friction(friction)
        _check_scalar(other)
        if other.coupled != self.coupled:
            other._place, other._n_free = other._number_unknowns()
            other.__dict__.pop("_pattern", None)
        return other

    def apply(self, symbols: GwceSymbols, elevation: np.ndarray) -> np.ndarray:
        """Matrix times vector without the matrix: (n_points,) -> (n_points,).

        At nodes off the open boundary it is the residual (m3/s).
        """
        elements = self.elements
        conductance = symbols.slope * self.settings.gravity * self.depth
        result = self.divergence(conductance * elements.gradient_of(elevation))
        on, off = MASS[self.settings.mass]
        mass = self._element_mass(symbols)
        values = elevation[elements.corners]
        result += elements.scatter(
            mass * (off * values.sum(axis=0) + (on - off) * values)
        )
        result -= self._inflow_under(symbols, elevation)
        return result / self._row_scale(symbols)

    def potential_load(self, symbols: GwceSymbols, potential: np.ndarray) -> np.ndarray:
        """Load (m3/s) of the astronomical forces.

        Parameters
        ----------
        symbols : GwceSymbols
        potential : (n_points,) complex array
            Equilibrium tide (m). Its gradient stands beside that of the elevation:
            at the present time in ADCIRC's wave equation.

        Returns
        -------
        load : (n_points,) complex array
            m3/s.
        """
        conductance = self.settings.gravity * self.depth
        load = self.divergence(conductance * self.elements.gradient_of(potential))
        load -= self._inflow_under(symbols, potential)
        return load / self._row_scale(symbols)

    def force_load(
        self,
        symbols: GwceSymbols,
        momentum: np.ndarray,
        wave: np.ndarray | None = None,
    ) -> np.ndarray:
        """Load (m3/s) of a force that does not follow from the elevation.

        Parameters
        ----------
        symbols : GwceSymbols
        momentum : (2, n_points) complex array
            m/s2, acceleration of the nodal momentum equations.
        wave : (2, n_points) complex array, optional
            The same in the wave equation, where a time step makes it another.

        Returns
        -------
        load : (n_points,) complex array
            m3/s.
        """
        elements, depth = self.elements, self.mesh.depth
        wave = momentum if wave is None else wave
        slope = momentum / -self.settings.gravity
        load = self._inflow_of(depth * turn(self._checked_response(symbols), slope))
        load += self.divergence(elements.mean_vector(depth * wave))
        return load / self._row_scale(symbols)

    def _row_scale(self, symbols: GwceSymbols) -> np.ndarray:
        scale = symbols.slope * (symbols.momentum + self.tau0)
        if not np.all(scale):
            raise EngineError(
                "the wave continuity equation has no answer where frequency and tau0 "
                "are both zero: give tau0 to a steady constituent"
            )
        return scale

    def _element_mass(self, symbols: GwceSymbols) -> np.ndarray:
        """(n_triangles,) factor of the mass matrix of a triangle of area 1."""
        weight = self.elements.mean(self.tau0)
        return self.elements.area * (symbols.second + symbols.first * weight)

    def _inflow_under(self, symbols: GwceSymbols, elevation: np.ndarray) -> np.ndarray:
        """What the velocities under a surface add to the wave equation."""
        elements = self.elements
        if not self.coupled:
            return np.zeros(elements.n_points, dtype=np.complex128)
        slope = elements.nodal_vector(elements.gradient_of(elevation))
        return self._inflow_of(
            self.mesh.depth * turn(self._checked_response(symbols), slope)
        )

    def _inflow_of(self, flux: np.ndarray) -> np.ndarray:
        """What nodal fluxes (2, n_points) m2/s add to the wave equation."""
        elements = self.elements
        force = elements.mean_vector((self.tau0 - self.friction) * flux)
        mean = elements.mean_vector(flux)
        if self._element_coriolis is not None:
            force[0] += self._element_coriolis * mean[1]
            force[1] -= self._element_coriolis * mean[0]
        rise = (elements.gradient_of(self.tau0) * mean).sum(axis=0)
        return self.divergence(force) + elements.scatter(
            np.tile(elements.area * rise / 3.0, 3)
        )

    def _checked_response(self, symbols: GwceSymbols) -> np.ndarray:
        q = self.nodal_q(symbols)
        if not np.all(q * q + (0.0 if self.coriolis is None else self.coriolis**2)):
            raise EngineError(
                "the momentum equation has no answer where frequency and friction "
                "are both zero: give friction to a steady constituent"
            )
        return nodal_response(self, symbols)

    def _assemble(self, symbols: GwceSymbols) -> sparse.csc_array:
        """Matrix of all nodes in solution order."""
        row_scale = self._row_scale(symbols)
        if not self.coupled:
            return super()._assemble(symbols.plain(float(self.tau0[0])))
        elements = self.elements
        on, off = MASS[self.settings.mass]
        mass = self._element_mass(symbols)
        conductance = symbols.slope * self.settings.gravity * self.depth * elements.area
        gx, gy = elements.gradient
        stiffness = gx[:, None] * gx + gy[:, None] * gy
        share = np.where(np.eye(3, dtype=bool), on, off)[:, :, None]
        matrix = self._matrix(conductance * stiffness + mass * share)
        inflow = self._inflow_operators()
        outflow = self._flux_operators(symbols)
        for one, other in zip(inflow, outflow):
            matrix = matrix - one @ other
        scale = np.empty(elements.n_points, dtype=np.complex128)
        scale[self._place] = row_scale
        matrix.data /= scale[matrix.indices]
        return matrix

    def _inflow_operators(self) -> tuple[sparse.csc_array, sparse.csc_array]:
        """From x and y components of the nodal fluxes to the wave equation."""
        elements = self.elements
        n = elements.n_points
        gx, gy = elements.gradient
        rise = elements.gradient_of(self.tau0)
        excess = (self.tau0 - self.friction)[elements.corners]
        f = self._element_coriolis
        third = elements.area / 3.0
        operators = []
        for unit in np.eye(2):
            # The unit vector of every node along the axes of its triangles.
            x, y = elements.from_corners(np.repeat(unit[:, None], n, axis=1))
            along, across = excess * x, excess * y
            if f is not None:
                along, across = along + f * y, across - f * x
            entries = gx[:, None] * along + gy[:, None] * across
            entries += (rise[0] * x + rise[1] * y) / 3.0
            operators.append(self._matrix(third * entries))
        return operators[0], operators[1]

    def _flux_operators(
        self, symbols: GwceSymbols
    ) -> tuple[sparse.csc_array, sparse.csc_array]:
        """From the elevation to x and y components of the nodal fluxes."""
        elements = self.elements
        n, place = elements.n_points, self._place
        slopes = []
        turned = [elements.to_corners(elements.gradient[:, k]) for k in range(3)]
        for component in range(2):
            entries = np.stack([part[component] for part in turned], axis=1)
            slopes.append(self._matrix(elements.weight * entries))
        response = np.empty((2, 2, n), dtype=np.complex128)
        depth = self.mesh.depth / elements.around
        response[:, :, place] = depth * self._checked_response(symbols)
        return tuple(_scaled_sum(response[component], slopes) for component in range(2))

    def _matrix(self, entries: np.ndarray) -> sparse.csc_array:
        """(3, 3, n_triangles) entries, row corner first -> matrix in solution order."""
        slots, indices, starts = self._pattern
        values = np.ravel(entries)
        data = np.bincount(slots, values.real, len(indices))
        if np.iscomplexobj(values):
            data = data + 1j * np.bincount(slots, values.imag, len(indices))
        n = self.elements.n_points
        return sparse.csc_array((data, indices, starts), shape=(n, n))

    @cached_property
    def _pattern(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Where the nine entries of a triangle go, in columns of the matrix."""
        tails = self._place[self.elements.corners].astype(np.int64)
        heads = np.roll(tails, -1, axis=0)
        n = self.elements.n_points
        # The diagonal, the sides from lower to higher numbers, and back.
        keys, side = np.unique(
            np.minimum(tails, heads) * n + np.maximum(tails, heads), return_inverse=True
        )
        low, high = np.divmod(keys, n)
        node, size = np.arange(n), n + 2 * len(keys)
        ends = np.concatenate([node, low, high]), np.concatenate([node, high, low])
        columns = sparse.csc_array((np.arange(size), ends), shape=(n, n))
        slot = np.empty(size, dtype=np.int64)
        slot[columns.data] = np.arange(size)

        side = n + side.reshape(tails.shape)
        forth = slot[np.where(tails < heads, side, side + len(keys))]
        back = slot[np.where(tails < heads, side + len(keys), side)]
        slots = np.empty((3, *tails.shape), dtype=np.int64)
        for k in range(3):
            after = (k + 1) % 3
            slots[k, k] = slot[tails[k]]
            slots[k, after], slots[after, k] = forth[k], back[k]
        return slots.ravel(), columns.indices, columns.indptr

    def _number_unknowns(self) -> tuple[np.ndarray, int]:
        """Place of every node in solution order: free nodes first, open nodes last."""
        if not self.coupled:
            return super()._number_unknowns()
        corners = self.elements.corners
        n = self.elements.n_points
        is_free = np.ones(n, dtype=bool)
        is_free[self.open_nodes] = False
        free = np.flatnonzero(is_free)
        ends = corners.ravel(), np.roll(corners, -1, axis=0).ravel()
        ones = np.ones(len(ends[0]), dtype=np.int8)
        near = sparse.csr_array((ones, ends), shape=(n, n))
        near = (near + near.T + sparse.eye_array(n, dtype=np.int8)).tocsr()
        rings = near[free] @ near[:, free]
        once = sparse.triu(rings, k=1, format="coo").coords
        order = nested_dissection(self.mesh.points[free], np.stack(once))
        place = np.empty(n, dtype=np.int32)
        place[free[order]] = np.arange(len(free))
        place[self.open_nodes] = np.arange(len(free), n)
        return place, len(free)


def solve_gwce(
    mesh: CoastalMesh,
    forcing: TideForcing,
    settings: TideSettings | None = None,
    *,
    friction: float | np.ndarray | None = None,
    coriolis: float | np.ndarray | None = None,
    elements: Elements | None = None,
    symbols: Sequence[GwceSymbols] | None = None,
    tau0: float | np.ndarray | None = None,
    progress: Callable[[float], None] | None = None,
) -> TideSolution:
    """Solve the linear tide with ADCIRC's wave continuity equation.

    Parameters
    ----------
    mesh : CoastalMesh
    forcing : TideForcing
    settings : TideSettings, optional
        With ``time_step_s`` the answer has ADCIRC's errors of time.
    friction : float, (n_points,) or (n_c, n_points) array, optional
        Linear friction coefficient (1/s), of every constituent if two-dimensional:
        what quadratic friction amounts to, for instance, as `TideSolution` has it.
    coriolis, elements, progress
        As in `tidemesh.tides.solve`.
    symbols : sequence of GwceSymbols, optional
        Those of every constituent, instead of what ``settings.time_step_s`` says.
    tau0 : float or (n_points,) array, optional
        Weight of continuity (1/s), instead of ``settings.tau0``.

    Returns
    -------
    tide : TideSolution

    Raises
    ------
    InputError
        If tau0 or the friction is negative or not finite, or the friction a tensor.
    EngineError
        If the equations are singular: a steady constituent without friction or tau0.
    """
    settings = TideSettings() if settings is None else settings
    report = progress if progress is not None else (lambda _: None)
    report(0.0)
    n_c, n = len(forcing.names), len(mesh.points)
    each_its_own = np.shape(friction) == (n_c, n)
    equation = GwceEquation(
        mesh,
        forcing.nodes,
        settings,
        friction=friction[0] if each_its_own else friction,
        coriolis=coriolis,
        elements=elements,
        tau0=tau0,
    )
    equations = [equation] * n_c
    if each_its_own:
        equations[1:] = [equation.with_friction(row) for row in friction[1:]]
    if symbols is None:
        symbols = [symbols_for(frequency, settings) for frequency in forcing.frequency]
    threads = min(settings.threads, n_c)
    done = iter(range(1, n_c + 1))

    def solve_one(k: int) -> tuple[np.ndarray, np.ndarray]:
        at = equations[k]
        potential = None if forcing.potential is None else forcing.potential[k]
        load = None
        if potential is not None:
            load = at.potential_load(symbols[k], potential)
        # The factors, by far the largest thing in memory, are let go of at once.
        wave = at.factorise(symbols[k]).elevation(forcing.elevation[k], load)
        velocity = nodal_velocity(at, wave, symbols[k], potential)
        if threads <= 1:
            report(next(done) / n_c)
        return wave, velocity

    solved = each(solve_one, range(n_c), threads)
    report(1.0)
    return TideSolution(
        names=tuple(forcing.names),
        frequency=forcing.frequency,
        elevation=np.stack([row[0] for row in solved]),
        velocity=np.stack([row[1] for row in solved]),
        friction=np.stack([at.friction for at in equations])
        if each_its_own
        else equation.friction,
        gravity=settings.gravity,
        coriolis=equation.coriolis,
    )


def symbols_for(frequency: float, settings: TideSettings) -> GwceSymbols:
    """Symbols of a frequency as the settings say: ADCIRC's time step, or none."""
    if settings.time_step_s == 0.0:
        return GwceSymbols.exact(frequency)
    weights = LUMPED_WEIGHTS if settings.mass == "lumped" else WEIGHTS
    return adcirc_symbols(frequency, settings.time_step_s, weights)


def _scaled_sum(
    factors: np.ndarray, matrices: Sequence[sparse.csc_array]
) -> sparse.csc_array:
    """Sum of matrices of one pattern, the rows of each multiplied by its factors."""
    first = matrices[0]
    data = sum(
        factor[first.indices] * matrix.data for factor, matrix in zip(factors, matrices)
    )
    return sparse.csc_array((data, first.indices, first.indptr), shape=first.shape)


def _check_scalar(equation: GwceEquation) -> None:
    if equation._element_friction.ndim > 1:
        raise InputError(
            "ADCIRC's wave continuity equation takes friction as one number a node, "
            "not as a tensor"
        )


def _checked_weight(tau0: float | np.ndarray, n_points: int) -> np.ndarray:
    values = np.asarray(tau0, dtype=np.float64)
    if values.shape not in ((), (n_points,)):
        raise ValueError(
            f"tau0 must be a number or ({n_points},), got shape {values.shape}"
        )
    if not (np.isfinite(values).all() and (values >= 0.0).all()):
        raise InputError("tau0 must be finite and not negative")
    return np.broadcast_to(values, n_points)
