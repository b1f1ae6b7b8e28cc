"""One function a figure: data types and an optional axis in, the axis out."""

from tidemesh.plots.domain import boundary_before_after, depth_contours
from tidemesh.plots.error import error_before_after, error_map
from tidemesh.plots.mesh import boundary_strings, mesh_map
from tidemesh.plots.quality import quality_histogram
from tidemesh.plots.saving import save_figure
from tidemesh.plots.sizes import size_map
from tidemesh.plots.tide import cotidal_chart
from tidemesh.plots.verification import (
    plot_constants,
    plot_gauge_map,
    plot_phases,
    plot_records,
)

__all__ = [
    "boundary_before_after",
    "boundary_strings",
    "cotidal_chart",
    "depth_contours",
    "error_before_after",
    "error_map",
    "mesh_map",
    "plot_constants",
    "plot_gauge_map",
    "plot_phases",
    "plot_records",
    "quality_histogram",
    "save_figure",
    "size_map",
]
