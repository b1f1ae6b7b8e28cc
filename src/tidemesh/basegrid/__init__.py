"""The base grid: interior points and depths on a domain (paper, section 3.2)."""

from tidemesh.basegrid.base_grid import build_base_grid
from tidemesh.basegrid.depths import DepthReport, sample_depths
from tidemesh.basegrid.points import build_base_points
from tidemesh.basegrid.settings import (
    BaseGridSettings,
    DepthSettings,
    DepthSource,
    PolarCentre,
)
from tidemesh.basegrid.sources import read_sources

__all__ = [
    "BaseGridSettings",
    "DepthReport",
    "DepthSettings",
    "DepthSource",
    "PolarCentre",
    "build_base_grid",
    "build_base_points",
    "read_sources",
    "sample_depths",
]
