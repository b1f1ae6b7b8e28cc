"""Truncation error before and after."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LogNorm

from tidemesh.datatypes import CoastalMesh
from tidemesh.plots.maps import (
    Frame,
    add_colour_bar,
    draw_nodal_values,
    draw_outline,
    new_axis,
    panels_beside,
)


def error_map(
    mesh: CoastalMesh,
    error: np.ndarray,
    *,
    limits: tuple[float, float] | None = None,
    label: str = "truncation error (m/s²)",
    title: str = "Truncation error",
    colour_bar: bool = True,
    axis: Axes | None = None,
) -> Axes:
    """Error at the nodes on a logarithmic colour scale; blank where it is unknown.

    Parameters
    ----------
    mesh : CoastalMesh
    error : (n_points,) array
        NaN where undefined.
    limits : (low, high), optional
        Ends of the colour scale; by default those of `colour_limits`.
    label, title : str
    colour_bar : bool
    axis : Axes, optional

    Returns
    -------
    Axes
    """
    axis = new_axis(axis)
    frame = Frame(mesh.projection)
    low, high = limits or colour_limits(error)
    triangulation = frame.triangulation(mesh.points, mesh.triangles)
    shades = draw_nodal_values(
        axis,
        triangulation,
        np.maximum(error, 1e-300),
        cmap="cividis",
        norm=LogNorm(low, high),
    )
    draw_outline(axis, mesh, frame, width=0.6)
    frame.decorate(axis, frame.place(mesh.points))
    if colour_bar:
        add_colour_bar(axis, shades, label, extend="both")
    known = error[np.isfinite(error)]
    axis.set_title(
        f"{title}: {len(mesh.points):,} nodes, "
        f"peak {known.max():.2e}, median {np.median(known):.2e}"
        if known.size
        else title
    )
    return axis


def error_before_after(
    before: CoastalMesh,
    error_before: np.ndarray,
    after: CoastalMesh,
    error_after: np.ndarray,
    *,
    label: str = "truncation error (m/s²)",
    axis: Axes | None = None,
) -> Axes:
    """The error on the base grid and on the finished mesh, in the same colours.

    Parameters
    ----------
    before, after : CoastalMesh
    error_before, error_after : (n_points,) arrays
        On the nodes of each mesh, NaN where undefined.
    label : str
    axis : Axes, optional
        Takes the first map; the second comes to its right.

    Returns
    -------
    Axes
        That of the first map.
    """
    axis = new_axis(axis)
    limits = colour_limits(np.concatenate([error_before, error_after]))
    panels = panels_beside(axis, 1)
    style = {"limits": limits, "label": label}
    error_map(
        before,
        error_before,
        title="Base grid",
        colour_bar=not panels,
        axis=axis,
        **style,
    )
    for panel in panels:
        error_map(after, error_after, title="Mesh", axis=panel, **style)
        panel.set_ylabel("")
    return axis


def colour_limits(error: np.ndarray) -> tuple[float, float]:
    """Range that holds all but the extreme half per cent of the known errors."""
    known = error[np.isfinite(error) & (error > 0.0)]
    if not known.size:
        return 0.1, 1.0
    low, high = np.percentile(known, [0.5, 99.5])
    return float(low), float(max(high, 1.1 * low))
