"""What every map shares: coordinates, axes, outlines, colour bars, zoomed insets."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.colorbar import Colorbar
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle
from matplotlib.ticker import FuncFormatter
from matplotlib.tri import Triangulation

from tidemesh.datatypes import CoastalMesh
from tidemesh.geometry.projection import Projection
from tidemesh.triangulation import topology

# The colours of Okabe and Ito, which colour-blind readers can tell apart.
BLACK = "#000000"
ORANGE = "#E69F00"
SKY_BLUE = "#56B4E9"
GREEN = "#009E73"
YELLOW = "#F0E442"
BLUE = "#0072B2"
VERMILION = "#D55E00"
PURPLE = "#CC79A7"


@dataclass(frozen=True)
class Frame:
    """Coordinates in which a map is drawn: degrees, or km on the bare plane."""

    projection: Projection

    @property
    def geographic(self) -> bool:
        """Whether the axes are longitude and latitude."""
        return bool(self.projection.crs)

    def place(self, points: np.ndarray) -> np.ndarray:
        """Metres to map coordinates: (n, 2) -> (n, 2)."""
        points = np.asarray(points, dtype=np.float64).reshape(-1, 2)
        if self.geographic:
            return self.projection.inverse(points)
        return points / 1000.0

    def place_degrees(self, points: np.ndarray) -> np.ndarray:
        """Longitude and latitude to map coordinates (metres on the bare plane)."""
        points = np.asarray(points, dtype=np.float64).reshape(-1, 2)
        return points if self.geographic else points / 1000.0

    def degrees(self, places: np.ndarray) -> np.ndarray:
        """Map coordinates to longitude and latitude (metres on the bare plane)."""
        places = np.asarray(places, dtype=np.float64)
        return places if self.geographic else places * 1000.0

    def triangulation(self, points: np.ndarray, triangles: np.ndarray) -> Triangulation:
        """Triangulation in map coordinates."""
        x, y = self.place(points).T
        return Triangulation(x, y, triangles)

    def decorate(self, axis: Axes, points: np.ndarray) -> None:
        """Set the aspect, limits and labels of an axis that shows these map points."""
        low, high = np.min(points, axis=0), np.max(points, axis=0)
        margin = 0.02 * np.maximum(*(high - low))
        stretch = 1.0
        if self.geographic:
            stretch = 1.0 / math.cos(math.radians(0.5 * (low[1] + high[1])))
            axis.xaxis.set_major_formatter(FuncFormatter(longitude_label))
            axis.yaxis.set_major_formatter(FuncFormatter(latitude_label))
            axis.set_xlabel("longitude")
            axis.set_ylabel("latitude")
        else:
            axis.set_xlabel("x (km)")
            axis.set_ylabel("y (km)")
        axis.set_xlim(low[0] - margin * stretch, high[0] + margin * stretch)
        axis.set_ylim(low[1] - margin, high[1] + margin)
        axis.set_aspect(stretch)


def longitude_label(value: float, _position: int | None = None) -> str:
    """Degrees east or west, for instance 79.5°W, also beyond the date line."""
    if abs(value) > 180.0:
        value -= math.copysign(360.0, value)
    return _degrees(value, "E", "W")


def latitude_label(value: float, _position: int | None = None) -> str:
    """Degrees north or south, for instance 33°N."""
    return _degrees(value, "N", "S")


def _degrees(value: float, positive: str, negative: str) -> str:
    letter = positive if value > 0 else negative if value < 0 else ""
    return f"{abs(round(value, 6)):g}°{letter}"


def new_axis(axis: Axes | None) -> Axes:
    """Take the given axis, or that of a new figure."""
    if axis is not None:
        return axis
    return Figure(figsize=(8.0, 7.0), layout="constrained").subplots()


def panels_beside(axis: Axes, number: int, *, width: float = 1.0) -> list[Axes]:
    """Make room to the right of an axis for further panels, one above the other.

    Parameters
    ----------
    axis : Axes
        Shrinks to the left. If it has its figure for itself, the figure grows instead.
    number : int
        Of panels.
    width : float
        Of the panels, relative to that of the axis.

    Returns
    -------
    list of Axes
        Empty if the axis is not in a grid and so cannot be divided.
    """
    place = axis.get_subplotspec()
    if place is None or number == 0:
        return []
    figure = axis.figure
    if figure.axes == [axis]:
        wide, high = figure.get_size_inches()
        figure.set_size_inches(wide * (1.0 + width), high)
    grid = place.subgridspec(number, 2, width_ratios=[1.0, width])
    axis.set_subplotspec(grid[:, 0])
    return [figure.add_subplot(grid[row, 1]) for row in range(number)]


def mark_window(axis: Axes, panel: Axes, window: np.ndarray, name: str) -> None:
    """Make a panel show a window of a map, and mark the window there by its name.

    Parameters
    ----------
    axis, panel : Axes
    window : (2, 2) array
        Lower left and upper right corner, in map coordinates.
    name : str
    """
    low, high = window
    panel.set_aspect(axis.get_aspect())
    panel.set_xlim(low[0], high[0])
    panel.set_ylim(low[1], high[1])
    panel.set_title(name, loc="left", fontweight="bold")
    panel.tick_params(labelsize=8)
    panel.xaxis.set_major_formatter(axis.xaxis.get_major_formatter())
    panel.yaxis.set_major_formatter(axis.yaxis.get_major_formatter())
    panel.locator_params(nbins=4)
    axis.add_patch(
        Rectangle(low, *(high - low), fill=False, edgecolor=VERMILION, zorder=4)
    )
    axis.annotate(
        name,
        (low[0], high[1]),
        color=VERMILION,
        fontweight="bold",
        textcoords="offset points",
        xytext=(0, 4),
        zorder=5,
        bbox={"facecolor": "white", "edgecolor": "none", "pad": 0.8},
    )


def draw_outline(axis: Axes, mesh: CoastalMesh, frame: Frame, width: float = 0.8):
    """Draw the boundary of a mesh, land dark and open sea blue."""
    xy = frame.place(mesh.points)
    edge = topology.boundary_edges(mesh.triangles)
    at_sea = _open_edges(mesh, edge)
    for part, colour in ((~at_sea, BLACK), (at_sea, BLUE)):
        lines = LineCollection(xy[edge[part]], colors=colour, linewidths=width)
        axis.add_collection(lines, autolim=False)


def _open_edges(mesh: CoastalMesh, edge: np.ndarray) -> np.ndarray:
    size = len(mesh.points)
    runs = [
        np.stack([b.nodes, np.roll(b.nodes, -1)], axis=1)[: None if b.closed else -1]
        for b in mesh.boundaries
        if b.kind == "open"
    ]
    if not runs:
        return np.zeros(len(edge), dtype=bool)
    sea = np.sort(np.concatenate(runs), axis=1)
    both = np.sort(edge, axis=1)
    return np.isin(both[:, 0] * size + both[:, 1], sea[:, 0] * size + sea[:, 1])


def draw_nodal_values(axis: Axes, triangulation: Triangulation, values, **style):
    """Shade nodal values; triangles with an undefined node stay blank."""
    values = np.asarray(values, dtype=np.float64)
    undefined = ~np.isfinite(values)
    if undefined.any():
        triangulation = Triangulation(
            triangulation.x, triangulation.y, triangulation.triangles
        )
        triangulation.set_mask(undefined[triangulation.triangles].any(axis=1))
    return axis.tripcolor(
        triangulation, np.where(undefined, 0.0, values), shading="gouraud", **style
    )


def add_legend(axis: Axes, **options) -> None:
    """Legend below a map, where it hides nothing."""
    axis.legend(
        loc="upper center",
        bbox_to_anchor=(0.5, -0.09),
        ncols=2,
        frameon=False,
        fontsize=9,
        **options,
    )


def window_about(axis: Axes, centre: np.ndarray, half: np.ndarray) -> np.ndarray:
    """Window of half widths about a centre, moved to lie within a map: (2, 2)."""
    low, high = np.array([axis.get_xlim(), axis.get_ylim()]).T
    half = np.minimum(half, 0.5 * (high - low))
    centre = np.clip(centre, low + half, high - half)
    return np.array([centre - half, centre + half])


def add_colour_bar(axis: Axes, mappable, label: str, **options) -> Colorbar:
    """Colour bar beside a map, as tall as the map."""
    bar = axis.figure.colorbar(
        mappable, ax=axis, label=label, shrink=0.85, pad=0.02, aspect=30, **options
    )
    bar.ax.minorticks_off()
    return bar


def round_steps(low: float, high: float) -> np.ndarray:
    """1, 2, 5, 10, 20 ... from at most `low` to at least `high`, both positive."""
    decades = np.arange(math.floor(math.log10(low)), math.ceil(math.log10(high)) + 1)
    steps = np.outer(10.0**decades, [1.0, 2.0, 5.0]).ravel()
    first = np.searchsorted(steps, low * (1.0 + 1e-9), side="right") - 1
    last = np.searchsorted(steps, high * (1.0 - 1e-9), side="left")
    return steps[max(first, 0) : last + 1]
