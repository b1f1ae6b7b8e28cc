"""Nonlinear tides in the time domain (paper, section 4)."""

from tidemesh.tides.time_domain.settings import SimulationSettings
from tidemesh.tides.time_domain.simulate import SimulationResult, Station, simulate
from tidemesh.tides.time_domain.stability import StepAdvice, stable_step
from tidemesh.tides.time_domain.stepper import Stepper

__all__ = [
    "SimulationResult",
    "SimulationSettings",
    "Station",
    "StepAdvice",
    "Stepper",
    "simulate",
    "stable_step",
]
