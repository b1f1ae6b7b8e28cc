"""Modelled against observed tides (paper, section 4)."""

from tidemesh.verification.constants import (
    ConstantsComparison,
    ConstantsRow,
    ConstituentSummary,
    compare_constants,
)
from tidemesh.verification.gauges import GaugeTide, LeftOut, constants_at_gauges
from tidemesh.verification.harmonic_analysis import (
    HarmonicAnalysis,
    analyse,
    harmonic_analysis,
)
from tidemesh.verification.records import RecordComparison, compare_records
from tidemesh.verification.report import write_verification

__all__ = [
    "ConstantsComparison",
    "ConstantsRow",
    "ConstituentSummary",
    "GaugeTide",
    "HarmonicAnalysis",
    "LeftOut",
    "RecordComparison",
    "analyse",
    "compare_constants",
    "compare_records",
    "constants_at_gauges",
    "harmonic_analysis",
    "write_verification",
]
