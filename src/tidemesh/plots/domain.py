"""The domain with its depths, and its boundary before and after (Figs. 2 and 3)."""

from __future__ import annotations

import numpy as np
import shapely
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PathCollection
from matplotlib.colors import BoundaryNorm
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.path import Path

from tidemesh.datatypes import LAND, CoastalMesh, Domain
from tidemesh.plots.maps import (
    BLACK,
    BLUE,
    ORANGE,
    VERMILION,
    Frame,
    add_colour_bar,
    add_legend,
    draw_outline,
    mark_window,
    new_axis,
    panels_beside,
    round_steps,
    window_about,
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
        norm=BoundaryNorm(levels, 256),
    )
    lines = axis.tricontour(
        triangulation, mesh.depth, levels=levels[1:-1], colors=BLACK, linewidths=0.4
    )
    axis.clabel(lines, fmt="%g", fontsize=8, inline_spacing=2)
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
        Window of the enlarged panel; by default about the largest water removed.
    axis : Axes, optional

    Returns
    -------
    Axes
    """
    axis = new_axis(axis)
    frame = Frame(domain.projection)
    rings = [frame.place(ring.points) for ring in domain.rings]
    frame.decorate(axis, np.concatenate(rings))
    low = np.min([xy.min(axis=0) for xy in rings], axis=0)
    high = np.max([xy.max(axis=0) for xy in rings], axis=0)
    # Wide enough to hold most of what was cut off, so that it can be told from the sea.
    margin = 0.3 * (high - low)
    near = shapely.clip_by_rect(
        land, *frame.degrees(low - margin), *frame.degrees(high + margin)
    )
    lost = _water_lost(near, domain, rings, frame, low - margin, high + margin)

    if zoom_deg is None:
        window = _window_at_loss(axis, domain, lost, frame, 0.06 * (high - low))
    else:
        window = frame.place_degrees(np.reshape(zoom_deg, (2, 2)))
    panels = [] if window is None else panels_beside(axis, 1)
    for panel, width in [(axis, 0.7), *((panel, 1.4) for panel in panels)]:
        _fill(panel, near, frame, facecolor="0.9", edgecolor=VERMILION, linewidth=0.6)
        _fill(panel, lost, frame, facecolor=ORANGE, alpha=0.7)
        for ring, xy in zip(domain.rings, rings):
            segments = np.stack([xy, np.roll(xy, -1, axis=0)], axis=1)
            on_land = ring.segment_kind == LAND
            for part, colour in ((on_land, BLACK), (~on_land, BLUE)):
                panel.add_collection(
                    LineCollection(segments[part], colors=colour, linewidths=width),
                    autolim=False,
                )
    for panel in panels:
        mark_window(axis, panel, window, "a")
    add_legend(
        axis,
        handles=[
            Patch(facecolor="0.9", edgecolor=VERMILION, label="land as read"),
            Patch(facecolor=ORANGE, alpha=0.7, label="water removed"),
            Line2D([], [], color=BLACK, label="boundary kept: land"),
            Line2D([], [], color=BLUE, label="boundary kept: open sea"),
        ],
    )
    read, kept = shapely.get_num_coordinates(near), sum(len(xy) for xy in rings)
    axis.set_title(
        f"Boundary: {read:,} shoreline points read, {kept:,} kept, "
        f"{len(domain.ledger):,} ledger entries"
    )
    return axis


def _water_lost(land, domain: Domain, rings, frame: Frame, low, high) -> list:
    """Water behind the land side of the boundary, as polygons in degrees."""
    shell, *holes = [frame.degrees(xy) for xy in rings]
    kept = shapely.make_valid(shapely.Polygon(shell, holes))
    window = shapely.box(*frame.degrees(low), *frame.degrees(high))
    outside = window.difference(shapely.make_valid(land)).difference(kept)
    # What borders on the open boundary or on the window is sea that was never wanted.
    at_sea = [
        frame.degrees(xy[ring.segment_kind != LAND])
        for ring, xy in zip(domain.rings, rings)
    ]
    wanted_out = shapely.union_all(
        [window.exterior, shapely.MultiPoint(np.concatenate(at_sea))]
    )
    near = shapely.buffer(wanted_out, 1e-6 * float(np.ptp(frame.degrees([low, high]))))
    parts = shapely.get_parts(outside)
    parts = parts[shapely.area(parts) > 1e-10 * window.area]
    return [part for part in parts if not part.intersects(near)]


def _fill(axis: Axes, geometry, frame: Frame, **style) -> None:
    """Fill polygons, holes left out."""
    polygons = [p for p in shapely.get_parts(geometry) if p.geom_type == "Polygon"]
    paths = [
        Path.make_compound_path(
            *(
                Path(frame.place_degrees(shapely.get_coordinates(ring)), closed=True)
                for ring in (polygon.exterior, *polygon.interiors)
            )
        )
        for polygon in polygons
    ]
    axis.add_collection(PathCollection(paths, **style), autolim=False)


def _window_at_loss(
    axis: Axes, domain: Domain, lost: list, frame: Frame, half: np.ndarray
) -> np.ndarray | None:
    """Window about the largest water removed, of that which is drawn as such."""
    # Water apart from the domain is in the ledger too, but there is nothing to compare.
    drawn = shapely.union_all(lost)
    shapely.prepare(drawn)
    losses = [
        entry
        for entry in domain.ledger
        if entry.area_m2 < 0.0
        and shapely.intersects_xy(drawn, entry.longitude_deg, entry.latitude_deg)
    ]
    if not losses:
        return None
    largest = min(losses, key=lambda entry: entry.area_m2)
    centre = frame.place_degrees([largest.longitude_deg, largest.latitude_deg])[0]
    return window_about(axis, centre, half)


def _pairs(triangulation) -> np.ndarray:
    return np.stack([triangulation.x, triangulation.y], axis=1)
