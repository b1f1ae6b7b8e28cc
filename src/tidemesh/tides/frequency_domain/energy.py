"""Energy balance of a tide: what flows in and what the moon does is lost to friction.

With the amplitudes of one constituent, the continuity equation times g e* and the
momentum equation times h u* give

    inflow + potential = dissipation + transfer

where the transfer to other constituents is what the advection of momentum and the flux
e u take. The sums are those of the discrete equations, so the balance holds to rounding
on any mesh.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from tidemesh.datatypes import CoastalMesh, TideSolution
from tidemesh.tides.frequency_domain.wave_equation import Symbols, WaveEquation
from tidemesh.tides.settings import TideSettings

WATER_DENSITY = 1025.0
"""kg/m3, mean sea water; a common factor of both sides of the balance."""


class EnergyBalance(NamedTuple):
    """Mean power of every constituent."""

    inflow: np.ndarray
    """(n_c,) W through the open boundary."""
    dissipation: np.ndarray
    """(n_c,) W lost to bottom friction."""
    potential: np.ndarray
    """(n_c,) W of work by the astronomical forces."""
    transfer: np.ndarray
    """(n_c,) W to other constituents, by advection and finite amplitude."""


@dataclass(frozen=True, eq=False)
class ForcedTide(TideSolution):
    """A tide whose energy balance does not follow from its elevations alone."""

    energy: EnergyBalance | None = None
    """At the nodal factors of the forcing."""


def energy_balance(
    mesh: CoastalMesh,
    tide: TideSolution,
    open_nodes: np.ndarray,
    settings: TideSettings | None = None,
) -> EnergyBalance:
    """Energy that flows in, works inside, is transferred and is lost.

    It is exact for the discrete equations (friction, mass matrix and metric as in the
    settings of the solution). A tide with a potential or nonlinear terms carries the
    balance that its solver has made; one that was read from a file is taken for a
    linear tide with the friction that it names.

    Parameters
    ----------
    mesh : CoastalMesh
    tide : TideSolution
    open_nodes : (n_ocean,) int array
    settings : TideSettings, optional
        Those the tide was solved with.
    """
    if isinstance(tide, ForcedTide) and tide.energy is not None:
        return tide.energy
    each = tide.friction.ndim == 2
    equation = WaveEquation(
        mesh,
        open_nodes,
        settings,
        friction=None if each else tide.friction,
        coriolis=tide.coriolis,
    )
    rows = []
    for k, (frequency, elevation) in enumerate(zip(tide.frequency, tide.elevation)):
        at = equation.with_friction(tide.friction[k]) if each else equation
        symbols = Symbols.exact(frequency)
        flow = at.flow(symbols, at.elements.gradient_of(elevation))
        rows.append(constituent_energy(at, symbols, elevation, flow))
    return EnergyBalance(*np.array(rows).reshape(-1, 4).T)


def constituent_energy(
    equation: WaveEquation,
    symbols: Symbols,
    elevation: np.ndarray,
    velocity: np.ndarray,
    *,
    friction: np.ndarray | None = None,
    advection: np.ndarray | None = None,
    flux: np.ndarray | None = None,
    potential: np.ndarray | None = None,
) -> tuple[float, float, float, float]:
    """Inflow, dissipation, work of the potential and transfer (W) of one constituent.

    Parameters
    ----------
    equation : WaveEquation
    symbols : Symbols
    elevation : (n_points,) complex array
        m.
    velocity : (2, n_triangles) complex array
        m/s.
    friction, advection : (2, n_triangles) complex array, optional
        Bottom friction and advection (m/s2); linear friction if not given.
    flux : (2, n_triangles) complex array, optional
        Transport beside h u (m2/s).
    potential : (n_points,) complex array, optional
        Equilibrium tide (m).
    """
    elements, g = equation.elements, equation.settings.gravity
    # A steady part works all the time, an oscillation half of it.
    share = WATER_DENSITY * (1.0 if symbols.continuity == 0.0 else 0.5)
    water = share * equation.depth * elements.area

    def work(force: np.ndarray) -> float:
        return float((water * (velocity.conj() * force).real.sum(axis=0)).sum())

    transport = equation.depth * velocity
    if flux is not None:
        transport = transport + flux
    inflow = equation.continuity(symbols, elevation, transport)[equation.open_nodes]
    level = elevation[equation.open_nodes]
    entering = share * g * float((level.conj() * inflow).real.sum())
    lost = work(equation.resistance(velocity) if friction is None else friction)
    raised = 0.0
    if potential is not None:
        raised = work(g * elements.gradient_of(potential))
    transferred = 0.0
    if advection is not None:
        transferred += work(advection)
    if flux is not None:
        slope = elements.gradient_of(elevation)
        along = (flux.conj() * slope).real.sum(axis=0)
        transferred -= share * g * float((elements.area * along).sum())
    return entering, lost, raised, transferred
