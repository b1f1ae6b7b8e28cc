"""The mesh with enlarged panels (Fig. 8), and its boundary strings."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes

from tidemesh.datatypes import CoastalMesh
from tidemesh.plots.maps import (
    BLACK,
    BLUE,
    GREEN,
    ORANGE,
    PURPLE,
    Frame,
    add_legend,
    draw_outline,
    mark_window,
    new_axis,
    panels_beside,
    window_about,
)
from tidemesh.triangulation import quality


def mesh_map(
    mesh: CoastalMesh,
    *,
    zooms_deg: Sequence[tuple[float, float, float, float]] | None = None,
    axis: Axes | None = None,
) -> Axes:
    """Triangles of a mesh, and two panels at its smallest elements (paper, Fig. 8).

    Parameters
    ----------
    mesh : CoastalMesh
    zooms_deg : sequence of (west, south, east, north), optional
        At most two windows for the panels, in place of the smallest elements.
    axis : Axes, optional

    Returns
    -------
    Axes
    """
    axis = new_axis(axis)
    frame = Frame(mesh.projection)
    xy = frame.place(mesh.points)
    width = float(np.clip(20.0 / np.sqrt(len(xy)), 0.1, 0.5))
    axis.triplot(*xy.T, mesh.triangles, color=BLACK, linewidth=width)
    draw_outline(axis, mesh, frame, width=0.7)
    frame.decorate(axis, xy)
    if zooms_deg is None:
        windows = _smallest_elements(axis, mesh, xy)
    else:
        windows = [frame.place_degrees(np.reshape(zoom, (2, 2))) for zoom in zooms_deg]
    panels = panels_beside(axis, len(windows), width=0.55)
    for name, panel, window in zip("ab", panels, windows):
        mark_window(axis, panel, window, name)
        panel.triplot(*xy.T, _near(mesh, xy, window), color=BLACK, linewidth=0.35)
        draw_outline(panel, mesh, frame, width=1.2)
    edge = quality.edge_length(mesh.points, mesh.triangles)
    axis.set_title(
        f"Mesh: {len(mesh.points):,} nodes, {len(mesh.triangles):,} elements, "
        f"edges {edge.min():.0f} m to {edge.max() / 1000.0:.2f} km"
    )
    return axis


def boundary_strings(mesh: CoastalMesh, *, axis: Axes | None = None) -> Axes:
    """Boundary strings by kind, numbered as in a fort.14: open ones, then land ones.

    Parameters
    ----------
    mesh : CoastalMesh
    axis : Axes, optional

    Returns
    -------
    Axes
    """
    axis = new_axis(axis)
    frame = Frame(mesh.projection)
    xy = frame.place(mesh.points)
    colours = {"open": (BLUE, PURPLE), "mainland": (BLACK, ORANGE), "island": (GREEN,)}
    total = {kind: 0 for kind in colours}
    number = {"open": 0, "land": 0}
    small = 0.02 * np.ptp(xy, axis=0).max()
    for string in mesh.boundaries:
        shades = colours[string.kind]
        colour = shades[total[string.kind] % len(shades)]
        total[string.kind] += 1
        group = "open" if string.kind == "open" else "land"
        number[group] += 1
        line = xy[string.nodes]
        if string.closed:
            line = np.concatenate([line, line[:1]])
        axis.plot(*line.T, color=colour, linewidth=1.2)
        if not string.closed:
            axis.plot(*line[[0, -1]].T, "o", color=colour, markersize=3)
        # Numbers on specks would hide the coast.
        if not string.closed or np.ptp(line, axis=0).max() > small:
            prefix = "O" if group == "open" else "L"
            axis.annotate(
                f"{prefix}{number[group]}",
                line[len(line) // 2],
                fontsize=8,
                color=colour,
                textcoords="offset points",
                xytext=(4, 4),
                bbox={"facecolor": "white", "edgecolor": "none", "pad": 0.8},
            )
    names = {"open": "open sea", "mainland": "mainland", "island": "islands"}
    for kind, shades in colours.items():
        if total[kind]:
            label = f"{names[kind]}: {total[kind]}"
            axis.plot([], [], color=shades[0], label=label)
    add_legend(axis)
    frame.decorate(axis, xy)
    axis.set_title("Boundary strings (O open, L land, numbered as in fort.14)")
    return axis


def _near(mesh: CoastalMesh, xy: np.ndarray, window: np.ndarray) -> np.ndarray:
    """Triangles that reach into a window, at least by their bounding boxes."""
    corner = xy[mesh.triangles]
    touches = (corner.max(axis=1) >= window[0]) & (corner.min(axis=1) <= window[1])
    return mesh.triangles[touches.all(axis=1)]


def _smallest_elements(
    axis: Axes, mesh: CoastalMesh, xy: np.ndarray
) -> list[np.ndarray]:
    """Square windows about the smallest element and the smallest one far from it."""
    size = np.sqrt(np.abs(quality.area(mesh.points, mesh.triangles)))
    centre = mesh.points[mesh.triangles].mean(axis=1)
    extent = np.ptp(mesh.points, axis=0).max()
    first = int(np.argmin(size))
    away = np.hypot(*(centre - centre[first]).T) > 0.2 * extent
    chosen = [first]
    if away.any():
        chosen.append(int(np.flatnonzero(away)[np.argmin(size[away])]))
    per_metre = np.ptp(xy, axis=0) / np.ptp(mesh.points, axis=0)
    windows = []
    for element in chosen:
        half = min(30.0 * size[element], 0.1 * extent) * per_metre
        middle = xy[mesh.triangles[element]].mean(axis=0)
        windows.append(window_about(axis, middle, half))
    # From north to south, as the panels are.
    return sorted(windows, key=lambda window: -window[0, 1])
