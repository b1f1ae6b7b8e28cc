"""The linear tide as one sparse complex system for each frequency."""

from tidemesh.tides.frequency_domain.direct import Factorisation
from tidemesh.tides.frequency_domain.elements import Elements
from tidemesh.tides.frequency_domain.energy import EnergyBalance, energy_balance
from tidemesh.tides.frequency_domain.solve import FrequencyDomain, solve
from tidemesh.tides.frequency_domain.wave_equation import (
    FactorisedWave,
    Symbols,
    WaveEquation,
)

__all__ = [
    "Elements",
    "EnergyBalance",
    "Factorisation",
    "FactorisedWave",
    "FrequencyDomain",
    "Symbols",
    "WaveEquation",
    "energy_balance",
    "solve",
]
