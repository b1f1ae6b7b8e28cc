"""Quadratic friction in ADCIRC's wave continuity equation.

The friction C_f |u| u / h is that of the nodes, and the same force holds back the nodal
velocities and enters J of the wave equation (see `gwce`). As in `harmonic_balance` it
is split into a linear part, solved for, and a rest from the last iteration.

With a time step dt ADCIRC takes the speed of level n, and holds back with it the mean
velocity of the levels n and n + 1 in the momentum equations, the velocity of level n in
the wave equation: both are projected on the constituents just so.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from tidemesh.tides.frequency_domain.gwce import GwceEquation
from tidemesh.tides.frequency_domain.harmonic_balance import (
    REFACTOR,
    TOO_WEAK,
    Drive,
    HarmonicBalance,
    State,
)
from tidemesh.tides.frequency_domain.nonlinear_terms import Places
from tidemesh.tides.frequency_domain.parallel import each
from tidemesh.tides.frequency_domain.velocity import (
    lumped_gradient,
    nodal_gradient,
    nodal_response,
    turn,
)


class _Resistance(NamedTuple):
    """(n_c, 2, n_points) m/s2, the friction as the two equations see it."""

    momentum: np.ndarray
    wave: np.ndarray


class GwceBalance(HarmonicBalance):
    """The tide with quadratic friction as ADCIRC discretises it.

    Parameters
    ----------
    equation : GwceEquation
    drive : Drive
        With `GwceSymbols`.
    drag : (n_points,) array
        C_f, or g n**2 for Manning's formula.
    """

    def __init__(self, equation: GwceEquation, drive: Drive, drag: np.ndarray):
        super().__init__(equation, drive, drag)
        middle = np.array([s.middle for s in drive.symbols])
        self._middle = None if (middle == 1.0).all() else middle[:, None, None]

    def nodal(self, state: State) -> tuple[np.ndarray, np.ndarray]:
        """Velocity and friction coefficient at the nodes.

        Returns
        -------
        velocity : (n_c, n_points, 2) complex array
            m/s; with the gradients that the settings choose.
        friction : (n_c, n_points) array
            Linear coefficient (1/s) that does the same work; of an overtide the mean
            derivative of the friction by its velocity.
        """
        before, resistance = self._last
        velocity = state.velocity
        if self.equation.settings.velocity != "lumped":
            rows = []
            for k, row in enumerate(state.elevation):
                slope = nodal_gradient(self.equation, self._driving(k, row))
                lag, _ = self._lagged(k, before, resistance)
                rows.append(self._velocity(k, slope, lag))
            velocity = np.stack(rows)
        tensor = self.terms.mean_slope(before.velocity)
        friction = self._equivalent(before.velocity, resistance.wave, tensor)
        return np.ascontiguousarray(velocity.transpose(0, 2, 1)), friction

    def _places(self) -> tuple[Places, np.ndarray]:
        return Places(self.equation.mesh.depth, self.drag), self.equation.friction

    def _advance(self, state: State) -> State:
        """Solve all constituents under the loads of the others."""
        split, drive = self._split, self.drive
        resistance = self._resistance(state)

        def solve(k: int) -> tuple[np.ndarray, np.ndarray]:
            momentum, wave = self._lagged(k, state, resistance)
            load = split.force_load(drive.symbols[k], momentum, wave)
            if drive.potential is not None:
                load += split.potential_load(drive.symbols[k], drive.potential[k])
            elevation = self._wave(k).elevation(drive.boundary[k], load)
            slope = lumped_gradient(split.elements, self._driving(k, elevation))
            return elevation, self._velocity(k, slope, momentum)

        solved = each(solve, range(len(drive.names)), self._threads)
        self._last = state, resistance
        return State(*(np.stack(part) for part in zip(*solved)))

    def _resistance(self, state: State) -> _Resistance:
        wave = self.terms.evaluate(state.velocity).friction
        if self._middle is None:
            return _Resistance(wave, wave)
        carried = self._middle * state.velocity
        momentum = self.terms.evaluate(state.velocity, carried=carried).friction
        return _Resistance(momentum / self._middle, wave)

    def _lagged(
        self, k: int, state: State, resistance: _Resistance
    ) -> tuple[np.ndarray, np.ndarray]:
        """What is not solved for, as accelerations of the two equations."""
        linear = self._split.friction * state.velocity[k]
        return linear - resistance.momentum[k], linear - resistance.wave[k]

    def _driving(self, k: int, elevation: np.ndarray) -> np.ndarray:
        potential = self.drive.potential
        return elevation if potential is None else elevation - potential[k]

    def _velocity(self, k: int, slope: np.ndarray, lag: np.ndarray) -> np.ndarray:
        """(2, n_points) m/s."""
        response = nodal_response(self._split, self.drive.symbols[k])
        return turn(response, slope - lag / self._split.settings.gravity)

    def _renew_split(self, state: State) -> bool:
        """Take the mean derivative of the friction anew where it has changed."""
        if not state.velocity.any():
            return False
        xx, xy, yy = self._held(self.terms.mean_slope(state.velocity))
        # One number a node: with the derivative along the strongest current, what is
        # lagged of the others is never more than what is solved for.
        friction = 0.5 * (xx + yy) + np.hypot(0.5 * (xx - yy), xy)
        if self._split is not self.equation:
            old, share = self._split.friction, self.equation.elements.around
            moved = (friction - old) / (0.5 * min(self._rates) + old)
            mean = (share * np.abs(moved)).sum() / share.sum()
            if mean <= REFACTOR and moved.max() <= TOO_WEAK:
                return False
        self._split = self.equation.with_friction(friction)
        self._waves.clear()
        return True

    def _change_of(self, before: State, after: State) -> float:
        """The larger one of the changes of elevation and of velocity.

        Nothing follows up the velocities, and where the elevation is given around they
        are all that changes.
        """
        weight = self._weights().velocity
        size = np.linalg.norm(weight * after.velocity)
        change = super()._change_of(before, after)
        if size == 0.0:
            return change
        step = np.linalg.norm(weight * (after.velocity - before.velocity))
        return max(change, float(step / size))

    def _weights(self) -> State:
        """Square roots of the energy of a unit elevation and velocity."""
        elements = self.equation.elements
        share = elements.scatter(
            np.broadcast_to(elements.area / 3.0, elements.corners.shape)
        )
        mass = share * self.equation.mesh.depth / self.equation.settings.gravity
        return State(np.sqrt(share), np.sqrt(mass))
