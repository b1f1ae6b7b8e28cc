"""Linear tides: CoastalMesh + TideForcing -> TideSolution (paper, section 2.2)."""

from tidemesh.tides.engine import TideEngine
from tidemesh.tides.forcing import boundary_forcing
from tidemesh.tides.frequency_domain import (
    EnergyBalance,
    FrequencyDomain,
    Symbols,
    WaveEquation,
    energy_balance,
    solve,
)
from tidemesh.tides.settings import TideSettings

__all__ = [
    "EnergyBalance",
    "FrequencyDomain",
    "Symbols",
    "TideEngine",
    "TideSettings",
    "WaveEquation",
    "boundary_forcing",
    "energy_balance",
    "solve",
]
