"""Energy balance of a linear tide: what flows in is lost to friction."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from tidemesh.datatypes import CoastalMesh, TideSolution
from tidemesh.tides.frequency_domain.velocity import element_velocity
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


def energy_balance(
    mesh: CoastalMesh,
    tide: TideSolution,
    open_nodes: np.ndarray,
    settings: TideSettings | None = None,
) -> EnergyBalance:
    """Inflow of energy over the open boundary against friction loss.

    Both are exact for the discrete equations (friction, mass matrix and metric as in
    the settings of the solution), so they agree to rounding whatever the mesh.

    Parameters
    ----------
    mesh : CoastalMesh
    tide : TideSolution
    open_nodes : (n_ocean,) int array
    settings : TideSettings, optional
        Those the tide was solved with.
    """
    equation = WaveEquation(
        mesh, open_nodes, settings, friction=tide.friction, coriolis=tide.coriolis
    )
    inflow, dissipation = [], []
    for frequency, elevation in zip(tide.frequency, tide.elevation):
        symbols = Symbols.exact(frequency)
        flow = equation.apply(symbols, elevation)[equation.open_nodes]
        work = (np.conj(elevation[equation.open_nodes]) * flow).sum().real
        inflow.append(0.5 * WATER_DENSITY * tide.gravity * work)
        speed = element_velocity(equation, elevation, symbols)
        loss = (
            equation.element_q(symbols).real * equation.depth * equation.elements.area
        )
        square = (speed.real**2 + speed.imag**2).sum(axis=0)
        dissipation.append(0.5 * WATER_DENSITY * (loss * square).sum())
    return EnergyBalance(np.array(inflow), np.array(dissipation))
