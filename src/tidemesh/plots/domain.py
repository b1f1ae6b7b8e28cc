"""The domain with its depths, and its boundary before and after (Figs. 2 and 3)."""

from __future__ import annotations

import numpy as np
import shapely
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.colors import BoundaryNorm

from tidemesh.datatypes import LAND, CoastalMesh, Domain
from tidemesh.plots.maps import (
    BLACK,
    BLUE,
    GREY,
    VERMILION,
    Frame,
    add_colour_bar,
    draw_outline,
    new_axis,
    round_steps,
)


def depth_contours(mesh: CoastalMesh, *, axis: Axes | None = None) -> Axes:
    """Domain with depth contours (paper, Fig. 3).

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
    triangulation = frame.triangulation(mesh.points, mesh.triangles)
    levels = depth_levels(mesh.depth)
    shades = axis.tricontourf(
        triangulation,
        mesh.depth,
        levels=levels,
        cmap="YlGnBu",
        norm=BoundaryNorm(levels, 256, extend="both"),
        extend="both",
    )
    lines = axis.tricontour(
        triangulation, mesh.depth, levels=levels, colors=GREY, linewidths=0.4
    )
    axis.clabel(lines, levels[1:], fmt="%g", fontsize=7, inline_spacing=2)
    draw_outline(axis, mesh, frame)
    frame.decorate(axis, _pairs(triangulation))
    add_colour_bar(axis, shades, "depth (m)", ticks=levels, format="%g")
    axis.set_title(
        f"Depth: {mesh.depth.min():.3g} to {mesh.depth.max():.4g} m, "
        f"{len(mesh.points):,} nodes"
    )
    return axis


def depth_levels(depth: np.ndarray) -> np.ndarray:
    """Round contour levels for a range of depths: at least three, ascending."""
    low, high = float(np.min(depth)), float(np.max(depth))
    if low > 0.0 and high / low > 5.0:
        return round_steps(low, high)
    if high > 0.0 >= low:
        return np.concatenate(
            [[low if low < 0 else 0.0], round_steps(high / 100, high)]
        )
    middle, half = 0.5 * (low + high), max(0.5 * (high - low), 1e-3 * (1 + abs(high)))
    return np.linspace(middle - half, middle + half, 6)


def boundary_before_after(
    land: shapely.Geometry,
    domain: Domain,
    *,
    zoom_deg: tuple[float, float, float, float] | None = None,
    axis: Axes | None = None,
) -> Axes:
    """Shoreline as read, boundary as kept, and the water removed (paper, Fig. 2).

    Parameters
    ----------
    land : shapely geometry
        Land polygons, longitude and latitude.
    domain : Domain
        Its rings and ledger.
    zoom_deg : (west, south, east, north), optional
        Window of the inset; by default about the largest removed water.
    axis : Axes, optional

    Returns
    -------
    Axes
    """
    axis = new_axis(axis)
    frame = Frame(domain.projection)
    rings = [frame.place(ring.points) for ring in domain.rings]
    everything = np.concatenate(rings)
    frame.decorate(axis, everything)
    low, high = everything.min(axis=0), everything.max(axis=0)
    margin = 0.1 * (high - low)
    shore = _lines(land, frame, low - margin, high + margin)

    if zoom_deg is None:
        window = _window_at_change(domain, frame, low, high)
    else:
        window = frame.place_degrees(np.reshape(zoom_deg, (2, 2)))
    panels = [(axis, 0.6)]
    if window is not None:
        inset = axis.inset_axes((1.04, 0.18, 0.64, 0.64))
        inset.set_aspect(axis.get_aspect(), adjustable="datalim")
        inset.set_xlim(window[:, 0])
        inset.set_ylim(window[:, 1])
        inset.tick_params(labelsize=7)
        inset.xaxis.set_major_formatter(axis.xaxis.get_major_formatter())
        inset.yaxis.set_major_formatter(axis.yaxis.get_major_formatter())
        inset.yaxis.tick_right()
        inset.locator_params(nbins=4)
        axis.indicate_inset(
            bounds=(*window[0], *(window[1] - window[0])), inset_ax=inset
        )
        panels.append((inset, 1.2))

    for panel, width in panels:
        panel.add_collection(
            LineCollection(shore, colors=VERMILION, linewidths=width), autolim=False
        )
        for ring, xy in zip(domain.rings, rings):
            segments = np.stack([xy, np.roll(xy, -1, axis=0)], axis=1)
            on_land = ring.segment_kind == LAND
            for part, colour in ((on_land, BLACK), (~on_land, BLUE)):
                panel.add_collection(
                    LineCollection(segments[part], colors=colour, linewidths=width),
                    autolim=False,
                )
    removed = [e for e in domain.ledger if e.area_m2 > 0.0]
    if removed:
        places = frame.place_degrees(
            np.array([(e.longitude_deg, e.latitude_deg) for e in removed])
        )
        for panel, _ in panels:
            panel.plot(*places.T, ".", color=VERMILION, markersize=3, zorder=3)
    axis.plot([], [], color=VERMILION, label="shoreline as read")
    axis.plot([], [], color=BLACK, label="boundary kept: land")
    axis.plot([], [], color=BLUE, label="boundary kept: open sea")
    if removed:
        axis.plot([], [], ".", color=VERMILION, label=f"changes: {len(removed)}")
    axis.legend(loc="lower right", fontsize=8, framealpha=0.9)
    kept = sum(len(ring.points) for ring in domain.rings)
    raw = shapely.get_num_coordinates(land)
    axis.set_title(f"Boundary: {raw:,} shoreline points read, {kept:,} kept")
    return axis


def _window_at_change(domain: Domain, frame: Frame, low, high) -> np.ndarray | None:
    """A tenth of the domain about the largest change that the ledger tells of."""
    changes = [e for e in domain.ledger if e.area_m2 > 0.0]
    if not changes:
        return None
    largest = max(changes, key=lambda entry: entry.area_m2)
    centre = frame.place_degrees([largest.longitude_deg, largest.latitude_deg])[0]
    half = 0.06 * (high - low)
    return np.array([centre - half, centre + half])


def _lines(land: shapely.Geometry, frame: Frame, low, high) -> list[np.ndarray]:
    """Land outlines near the window, in map coordinates."""
    scale = 1.0 if frame.geographic else 1000.0
    shapely.prepare(land)
    near = shapely.clip_by_rect(shapely.boundary(land), *(low * scale), *(high * scale))
    return [
        frame.place_degrees(shapely.get_coordinates(line))
        for line in shapely.get_parts(near)
        if line.geom_type == "LineString"
    ]


def _pairs(triangulation) -> np.ndarray:
    return np.stack([triangulation.x, triangulation.y], axis=1)
