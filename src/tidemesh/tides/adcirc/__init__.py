"""ADCIRC as an engine: write its run directory, run it, check and read its results."""

from tidemesh.tides.adcirc.check import AdcircPending, RunReport, check_run
from tidemesh.tides.adcirc.control import RunInputs, run_inputs
from tidemesh.tides.adcirc.engine import Adcirc, tide_solution
from tidemesh.tides.adcirc.folder import RunFolder, write_run
from tidemesh.tides.adcirc.plan import RunPlan, plan_run
from tidemesh.tides.adcirc.settings import AdcircSettings

__all__ = [
    "Adcirc",
    "AdcircPending",
    "AdcircSettings",
    "RunFolder",
    "RunInputs",
    "RunPlan",
    "RunReport",
    "check_run",
    "plan_run",
    "run_inputs",
    "tide_solution",
    "write_run",
]
