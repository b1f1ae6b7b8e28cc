"""The tide as one sparse complex system for each frequency."""

from tidemesh.tides.frequency_domain.direct import Factorisation
from tidemesh.tides.frequency_domain.elements import Elements
from tidemesh.tides.frequency_domain.energy import EnergyBalance, energy_balance
from tidemesh.tides.frequency_domain.gwce import (
    GwceEquation,
    GwceSymbols,
    adcirc_symbols,
    solve_gwce,
)
from tidemesh.tides.frequency_domain.harmonic_balance import IterationReport
from tidemesh.tides.frequency_domain.solve import (
    FrequencyDomain,
    solve,
    solve_with_report,
    with_overtides,
)
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
    "GwceEquation",
    "GwceSymbols",
    "IterationReport",
    "Symbols",
    "WaveEquation",
    "adcirc_symbols",
    "energy_balance",
    "solve",
    "solve_gwce",
    "solve_with_report",
    "with_overtides",
]
