"""Co-tidal charts."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.tri import Triangulation

from tidemesh.datatypes import CoastalMesh, TideSolution
from tidemesh.plots.maps import (
    Frame,
    add_colour_bar,
    draw_nodal_values,
    draw_outline,
    new_axis,
)


def cotidal_chart(
    mesh: CoastalMesh,
    tide: TideSolution,
    constituent: str | None = None,
    *,
    axis: Axes | None = None,
) -> Axes:
    """Amplitude in colour and lines of equal Greenwich phase.

    Parameters
    ----------
    mesh : CoastalMesh
    tide : TideSolution
    constituent : str, optional
        The first one by default.
    axis : Axes, optional

    Returns
    -------
    Axes

    Raises
    ------
    ValueError
        If the solution has no such constituent.
    """
    name = constituent or tide.names[0]
    if name not in tide.names:
        raise ValueError(f'no constituent "{name}" among {", ".join(tide.names)}')
    elevation = tide.elevation[tide.names.index(name)]
    axis = new_axis(axis)
    frame = Frame(mesh.projection)
    triangulation = frame.triangulation(mesh.points, mesh.triangles)
    shades = draw_nodal_values(axis, triangulation, np.abs(elevation), cmap="viridis")
    step, levels = phase_levels(elevation)
    for level in levels:
        draw_phase_line(axis, triangulation, elevation, level)
    draw_outline(axis, mesh, frame)
    frame.decorate(axis, frame.place(mesh.points))
    add_colour_bar(axis, shades, f"{name} amplitude (m)")
    axis.set_title(f"{name}: amplitude, and Greenwich phase every {step:g}°")
    return axis


def phase_levels(elevation: np.ndarray) -> tuple[float, np.ndarray]:
    """Step and values (degrees) of the phase lines: at most about a dozen.

    The range may lie across 360 degrees; it is the circle without the widest gap
    between the phases of the nodes.
    """
    phase = np.sort(greenwich_phase(elevation[np.abs(elevation) > 0.0]))
    if not phase.size:
        return 10.0, np.empty(0)
    gap = np.diff(phase, append=phase[0] + 360.0)
    widest = int(np.argmax(gap))
    start = phase[(widest + 1) % len(phase)]
    span = 360.0 - gap[widest]
    if span > 330.0:
        return 30.0, np.arange(0.0, 360.0, 30.0)
    step = next((s for s in (1.0, 2.0, 5.0, 10.0, 15.0) if span / s <= 12.5), 30.0)
    first = np.ceil(start / step)
    last = np.floor((start + span) / step)
    levels = np.mod(step * np.arange(first, last + 1.0), 360.0)
    return step, np.unique(levels)


def greenwich_phase(elevation: np.ndarray) -> np.ndarray:
    """Phase lag G (degrees, 0 to 360) of amplitude * exp(-i G)."""
    return np.mod(-np.angle(elevation, deg=True), 360.0)


def draw_phase_line(
    axis: Axes, triangulation: Triangulation, elevation: np.ndarray, level: float
) -> None:
    """Line of one Greenwich phase (degrees), labelled on its longest part."""
    # Turned by the level the line is where the elevation is real and positive, so
    # nothing jumps at 360 degrees; the opposite phase is masked away.
    turned = elevation * np.exp(1j * np.radians(level))
    real, imaginary = (
        part[triangulation.triangles] for part in (turned.real, turned.imag)
    )
    crossed = (
        (real > 0.0).all(axis=1)
        & (imaginary.min(axis=1) <= 0.0)
        & (imaginary.max(axis=1) >= 0.0)
    )
    if not crossed.any():
        return
    lines = axis.tricontour(
        Triangulation(
            triangulation.x, triangulation.y, triangulation.triangles[crossed]
        ),
        turned.imag / np.abs(turned).max(),
        levels=[0.0],
        colors="white",
        linewidths=0.9,
    )
    pieces = lines.get_paths()[0].to_polygons(closed_only=False)
    if not pieces:
        return
    length = [np.hypot(*np.diff(piece, axis=0).T).sum() for piece in pieces]
    longest = pieces[int(np.argmax(length))]
    if max(length) > 0.03 * np.ptp(triangulation.y):
        axis.clabel(
            lines,
            manual=[tuple(longest[len(longest) // 2])],
            fmt=lambda _: f"{level:g}°",
            fontsize=8,
            inline=True,
        )
