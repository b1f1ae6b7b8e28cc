"""Tides: CoastalMesh + TideForcing -> TideSolution (paper, sections 2.2, 3.3 and 4)."""

from tidemesh.tides.adcirc import Adcirc, AdcircPending, AdcircSettings
from tidemesh.tides.astronomy import nodal_corrections, predict, with_astronomy
from tidemesh.tides.atlas import atlas_forcing
from tidemesh.tides.completion import complete_solution
from tidemesh.tides.engine import TideEngine
from tidemesh.tides.forcing import boundary_forcing
from tidemesh.tides.frequency_domain import (
    EnergyBalance,
    FrequencyDomain,
    Symbols,
    WaveEquation,
    energy_balance,
    solve,
    solve_with_report,
)
from tidemesh.tides.frequency_domain.direct import available_solvers
from tidemesh.tides.gauge_fit import BoundaryFit, fit_boundary
from tidemesh.tides.potential import equilibrium_tide, with_potential
from tidemesh.tides.settings import TideSettings

__all__ = [
    "Adcirc",
    "AdcircPending",
    "AdcircSettings",
    "BoundaryFit",
    "EnergyBalance",
    "FrequencyDomain",
    "Symbols",
    "TideEngine",
    "TideSettings",
    "WaveEquation",
    "atlas_forcing",
    "available_solvers",
    "boundary_forcing",
    "complete_solution",
    "energy_balance",
    "equilibrium_tide",
    "fit_boundary",
    "nodal_corrections",
    "predict",
    "solve",
    "solve_with_report",
    "with_astronomy",
    "with_potential",
]
