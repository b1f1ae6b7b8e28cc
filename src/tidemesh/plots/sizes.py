"""Allowed node spacing (Fig. 5)."""

from __future__ import annotations

from matplotlib.axes import Axes
from matplotlib.colors import LogNorm
from matplotlib.ticker import FuncFormatter

from tidemesh.datatypes import CoastalMesh, SizeField
from tidemesh.geometry.projection import Projection
from tidemesh.plots.maps import (
    Frame,
    add_colour_bar,
    draw_nodal_values,
    draw_outline,
    new_axis,
    round_steps,
)

_TICKS = FuncFormatter(
    lambda value, _: f"{value:,.4g}" if value < 1.0 else f"{value:,.0f}"
)


def size_map(
    sizes: SizeField,
    *,
    projection: Projection | None = None,
    mesh: CoastalMesh | None = None,
    axis: Axes | None = None,
) -> Axes:
    """Allowed node spacing, on a logarithmic colour scale (paper, Fig. 5).

    Parameters
    ----------
    sizes : SizeField
    projection : Projection, optional
        For longitudes and latitudes; km without it.
    mesh : CoastalMesh, optional
        Its boundary is drawn, and its projection taken.
    axis : Axes, optional

    Returns
    -------
    Axes
    """
    axis = new_axis(axis)
    if mesh is not None:
        projection = mesh.projection
    frame = Frame(projection or Projection())
    triangulation = frame.triangulation(sizes.points, sizes.triangles)
    low, high = sizes.spacing.min(), sizes.spacing.max()
    shades = draw_nodal_values(
        axis,
        triangulation,
        sizes.spacing,
        cmap="viridis",
        norm=LogNorm(low, max(high, 1.01 * low)),
    )
    if mesh is not None:
        draw_outline(axis, mesh, frame)
    frame.decorate(axis, frame.place(sizes.points))
    steps = round_steps(low, max(high, 1.01 * low))
    inside = steps[(steps >= low) & (steps <= high)]
    ticks = inside if len(inside) >= 2 else [low, high]
    add_colour_bar(axis, shades, "node spacing (m)", ticks=ticks, format=_TICKS)
    axis.set_title(f"Allowed node spacing: {_length(low)} to {_length(high)}")
    return axis


def _length(metres: float) -> str:
    return f"{metres / 1000.0:.2f} km" if metres >= 10_000 else f"{metres:.0f} m"
