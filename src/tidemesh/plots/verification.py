"""Modelled beside observed tides."""

from __future__ import annotations

import math
from collections.abc import Sequence
from datetime import UTC, datetime
from itertools import pairwise
from typing import Protocol

import numpy as np
from matplotlib.axes import Axes
from matplotlib.dates import AutoDateLocator, DateFormatter
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter
from scipy.interpolate import CubicSpline

from tidemesh.datatypes import CoastalMesh, TideTable
from tidemesh.plots.maps import (
    BLACK,
    BLUE,
    GREEN,
    ORANGE,
    PURPLE,
    SKY_BLUE,
    VERMILION,
    Frame,
    add_colour_bar,
    draw_outline,
    new_axis,
    panels_beside,
)
from tidemesh.plots.tide import greenwich_phase

BAND_PERCENT = 10.0
BAND_DEG = 10.0
"""The shaded bands: a model within them is commonly called good."""

_MARKS = (
    ("M2", BLUE, "o"),
    ("S2", ORANGE, "s"),
    ("N2", GREEN, "^"),
    ("K1", VERMILION, "D"),
    ("O1", PURPLE, "v"),
    ("M4", SKY_BLUE, "P"),
    ("M6", BLACK, "X"),
)
_MORE = ("<", ">", "p", "h", "*", "d")
_NAME_SIZE = np.array([0.25, 0.025])
"""Width and height of a name, in parts of a map."""
_DRAWN_STEP_S = 600.0
_DOT_STEP_S = 3600.0
_LINEAR_PERCENT = 20.0
_LINEAR_DEG = 20.0
"""Errors up to these are drawn to scale, larger ones by their logarithm."""


class ComparedConstants(Protocol):
    """Constants of the same gauges, in the same order."""

    modelled: TideTable
    observed: TideTable


class ComparedLevels(Protocol):
    """Water levels at the same times."""

    station: str
    time: np.ndarray
    """(n,) s since 1970-01-01 00:00 UTC."""
    observed: np.ndarray
    """(n,) m."""
    modelled: np.ndarray
    """(n,) m."""


def plot_constants(
    comparison: ComparedConstants,
    *,
    names: Sequence[str] | None = None,
    axis: Axes | None = None,
) -> Axes:
    """Amplitudes and phases of gauges, modelled against observed, with 10 % and 10°.

    The left panel has the amplitudes on logarithmic scales, so that the 10 % band is
    equally wide for all constituents. The right one has the two errors of each point:
    inside the shaded box a gauge is met within 10 % and 10°. Its scales are linear up
    to 20 and logarithmic beyond, so that lost gauges (creeks that the mesh leaves out)
    neither vanish nor crowd the others.

    Parameters
    ----------
    comparison : ComparedConstants
        For instance of `verification.compare_constants`.
    names : sequence of str, optional
        Constituents; all that both have if not given.
    axis : Axes, optional
        Takes the amplitudes; the phases come to its right.

    Returns
    -------
    Axes
        That of the amplitudes.

    Raises
    ------
    ValueError
        If the tables have different gauges, or no constituent in common.
    """
    modelled, observed = comparison.modelled, comparison.observed
    names = _common(modelled, observed, names)
    axis = new_axis(axis)
    panels = panels_beside(axis, 1)
    total = 0
    within = 0
    for number, name in enumerate(names):
        ours, theirs = _pairs(modelled, observed, name)
        total += len(ours)
        within += int(_within(ours, theirs).sum())
        style = {**_style(name, number), "label": name, "zorder": 3}
        axis.plot(np.abs(theirs), np.abs(ours), **style)
        for panel in panels:
            percent, lag = _errors(ours, theirs)
            panel.plot(percent, lag, **style)
    _decorate_amplitudes(axis)
    axis.set_title(
        f"{total} constants of {_gauges(observed)} gauges: {within} within "
        f"{BAND_PERCENT:g} % and {BAND_DEG:g}°"
    )
    for panel in panels:
        _decorate_errors(panel)
    return axis


def plot_phases(
    comparison: ComparedConstants,
    *,
    names: Sequence[str] | None = None,
    axis: Axes | None = None,
) -> Axes:
    """Greenwich phases, modelled against observed, with the line of equality and 10°.

    Parameters
    ----------
    comparison : ComparedConstants
    names : sequence of str, optional
    axis : Axes, optional

    Returns
    -------
    Axes
    """
    modelled, observed = comparison.modelled, comparison.observed
    names = _common(modelled, observed, names)
    axis = new_axis(axis)
    low, high = math.inf, -math.inf
    for number, name in enumerate(names):
        ours, theirs = _pairs(modelled, observed, name)
        # From -180 on, since the phases of a coast often lie about 360 degrees.
        phase = (greenwich_phase(theirs) + 180.0) % 360.0 - 180.0
        lag = phase + _errors(ours, theirs)[1]
        axis.plot(phase, lag, **_style(name, number), label=name, zorder=3)
        if len(phase):
            low, high = min(low, phase.min(), lag.min()), max(high, *phase, *lag)
    margin = 0.05 * (high - low) + BAND_DEG
    ends = np.array([low - margin, high + margin])
    axis.fill_between(ends, ends - BAND_DEG, ends + BAND_DEG, color="0.9", linewidth=0)
    axis.plot(ends, ends, color="0.4", linewidth=0.8)
    axis.set_xlim(ends)
    axis.set_ylim(ends)
    axis.set_aspect("equal")
    axis.set_xlabel("observed phase (° Greenwich)")
    axis.set_ylabel("modelled phase (° Greenwich)")
    axis.legend(loc="upper left", frameon=False, fontsize=9)
    axis.set_title(f"Phases; shaded: within {BAND_DEG:g}°")
    return axis


def plot_records(comparison: ComparedLevels, *, axis: Axes | None = None) -> Axes:
    """Water levels over time, observed as points, modelled as a line (paper, Fig. 9).

    Parameters
    ----------
    comparison : ComparedLevels
        For instance of `verification.compare_records`.
    axis : Axes, optional
        Takes the levels; the residual comes beneath.

    Returns
    -------
    Axes
        That of the levels.
    """
    time, observed = comparison.time, comparison.observed
    residual = comparison.modelled - observed
    axis = new_axis(axis)
    beneath = _panel_beneath(axis)
    axis.plot(
        *_smooth(time, comparison.modelled),
        color=BLUE,
        linewidth=1.1,
        label="modelled",
    )
    axis.plot(
        _dates(time),
        observed,
        linestyle="none",
        marker="o",
        markersize=2.6,
        markerfacecolor="white",
        markeredgecolor=BLACK,
        markeredgewidth=0.7,
        label="observed",
        # Six-minute levels would hide each other and the line.
        markevery=max(1, round(_DOT_STEP_S / _step(time))),
        zorder=3,
    )
    axis.axhline(0.0, color="0.6", linewidth=0.6, zorder=0)
    axis.set_ylabel("water level (m)")
    axis.legend(loc="upper right", ncols=2, frameon=False, fontsize=9)
    low = min(observed.min(), comparison.modelled.min())
    high = max(observed.max(), comparison.modelled.max())
    room = 0.08 * (high - low) + 0.01
    axis.set_ylim(low - room, high + 2.5 * room)
    rms = float(np.sqrt(np.mean(residual**2)))
    axis.set_title(f"{comparison.station}: rms error {rms:.3f} m".removeprefix(": "))
    for panel in (axis, *beneath):
        _decorate_dates(panel, time[0], time[-1])
    for panel in beneath:
        panel.plot(*_broken(time, residual), color=VERMILION, linewidth=0.9)
        panel.axhline(0.0, color="0.6", linewidth=0.6, zorder=0)
        limit = max(1.15 * float(np.abs(residual).max()), 0.01)
        panel.set_ylim(-limit, limit)
        panel.set_ylabel("modelled −\nobserved (m)")
        axis.tick_params(labelbottom=False)
        axis.set_xlabel("")
    return axis


def plot_gauge_map(
    mesh: CoastalMesh,
    comparison: ComparedConstants,
    constituent: str | None = None,
    *,
    labels: int = 6,
    axis: Axes | None = None,
) -> Axes:
    """Outline of a mesh and gauges in the colour of their complex error.

    Parameters
    ----------
    mesh : CoastalMesh
    comparison : ComparedConstants
    constituent : str, optional
        The first one in common by default.
    labels : int
        Of the gauges with the largest errors this many are called by their names.
    axis : Axes, optional

    Returns
    -------
    Axes

    Raises
    ------
    ValueError
        If the tables have different gauges, or no such constituent.
    """
    modelled, observed = comparison.modelled, comparison.observed
    name = _common(modelled, observed, [constituent] if constituent else None)[0]
    error = np.abs(
        modelled.elevation[modelled.names.index(name)]
        - observed.elevation[observed.names.index(name)]
    )
    axis = new_axis(axis)
    frame = Frame(mesh.projection)
    draw_outline(axis, mesh, frame, width=0.5)
    places = frame.place_degrees(
        np.stack([observed.longitude_deg, observed.latitude_deg], axis=1)
    )
    known = np.flatnonzero(np.isfinite(error))
    # The worst on top.
    known = known[np.argsort(error[known], kind="stable")]
    spots = axis.scatter(
        *places[known].T,
        c=error[known],
        s=42,
        cmap="plasma_r",
        vmin=0.0,
        edgecolors=BLACK,
        linewidths=0.6,
        zorder=4,
    )
    frame.decorate(axis, np.concatenate([frame.place(mesh.points), places[known]]))
    if observed.stations:
        _name_gauges(axis, places[known[::-1]], known[::-1], observed, labels)
    add_colour_bar(axis, spots, f"{name} error |modelled − observed| (m)")
    rms = math.sqrt(float(np.mean(error[known] ** 2)) / 2.0) if len(known) else math.nan
    axis.set_title(f"{name} at {len(known)} gauges: rms error {rms:.3f} m")
    return axis


def _name_gauges(
    axis: Axes, places: np.ndarray, gauges: np.ndarray, table: TideTable, most: int
) -> None:
    """Names beside the first gauges, towards the middle, none upon another."""
    low, high = np.array([axis.get_xlim(), axis.get_ylim()]).T
    taken: list[np.ndarray] = []
    for place, g in zip(places, gauges):
        at = (place - low) / (high - low)
        if any((np.abs(at - other) < _NAME_SIZE).all() for other in taken):
            continue
        taken.append(at)
        right = at[0] < 0.5
        axis.annotate(
            table.stations[g],
            place,
            textcoords="offset points",
            xytext=(6 if right else -6, 4),
            ha="left" if right else "right",
            fontsize=7,
            zorder=5,
        )
        if len(taken) == most:
            return


# ---- what two tables have in common ----------------------------------------------


def _common(
    modelled: TideTable, observed: TideTable, names: Sequence[str] | None
) -> list[str]:
    if len(modelled.longitude_deg) != len(observed.longitude_deg):
        raise ValueError(
            "the tables must have the same gauges: modelled "
            f"{len(modelled.longitude_deg)}, observed {len(observed.longitude_deg)}"
        )
    both = [name for name in observed.names if name in modelled.names]
    for name in names or ():
        if name not in both:
            raise ValueError(f'no constituent "{name}" among {", ".join(both)}')
    if not both:
        raise ValueError("the tables have no constituent in common")
    return list(names or both)


def _pairs(
    modelled: TideTable, observed: TideTable, name: str
) -> tuple[np.ndarray, np.ndarray]:
    ours = modelled.elevation[modelled.names.index(name)]
    theirs = observed.elevation[observed.names.index(name)]
    known = np.isfinite(ours) & np.isfinite(theirs) & (np.abs(theirs) > 0.0)
    return ours[known], theirs[known]


def _errors(ours: np.ndarray, theirs: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Of the amplitude (%) and of the phase (degrees, positive where late)."""
    percent = 100.0 * (np.abs(ours) / np.abs(theirs) - 1.0)
    return percent, -np.angle(ours * np.conj(theirs), deg=True)


def _within(ours: np.ndarray, theirs: np.ndarray) -> np.ndarray:
    percent, lag = _errors(ours, theirs)
    return (np.abs(percent) <= BAND_PERCENT) & (np.abs(lag) <= BAND_DEG)


def _gauges(table: TideTable) -> int:
    return int(np.isfinite(table.elevation).any(axis=0).sum())


# ---- looks -----------------------------------------------------------------------


def _style(name: str, number: int) -> dict:
    known = {key: (colour, marker) for key, colour, marker in _MARKS}
    colour, marker = known.get(name, ("0.5", _MORE[number % len(_MORE)]))
    return {
        "linestyle": "none",
        "marker": marker,
        "markersize": 5.5,
        "markerfacecolor": colour,
        "markeredgecolor": "white",
        "markeredgewidth": 0.4,
    }


def _decorate_amplitudes(axis: Axes) -> None:
    lines = [line for line in axis.lines if len(line.get_xdata())]
    values = np.concatenate([[*line.get_xdata(), *line.get_ydata()] for line in lines])
    values = values[values > 0.0]
    ends = np.array([values.min() / 1.4, values.max() * 1.4])
    factor = 1.0 + BAND_PERCENT / 100.0
    axis.fill_between(
        ends, ends / factor, ends * factor, color="0.9", linewidth=0, zorder=0
    )
    axis.plot(ends, ends, color="0.4", linewidth=0.8, zorder=1)
    axis.set_xscale("log")
    axis.set_yscale("log")
    axis.set_xlim(ends)
    axis.set_ylim(ends)
    axis.set_box_aspect(1.0)
    for one in (axis.xaxis, axis.yaxis):
        one.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
        # Decades alone would leave a narrow range with one number or none.
        narrow = ends[1] < 20.0 * ends[0]
        one.set_minor_locator(LogLocator(subs=(2.0, 5.0)))
        one.set_minor_formatter(
            FuncFormatter(lambda value, _: f"{value:g}") if narrow else NullFormatter()
        )
    axis.set_xlabel("observed amplitude (m)")
    axis.set_ylabel("modelled amplitude (m)")
    axis.legend(loc="upper left", frameon=False, fontsize=9)


def _decorate_errors(panel: Axes) -> None:
    panel.fill_between(
        [-BAND_PERCENT, BAND_PERCENT],
        -BAND_DEG,
        BAND_DEG,
        color="0.9",
        linewidth=0,
        zorder=0,
    )
    panel.axhline(0.0, color="0.4", linewidth=0.8, zorder=1)
    panel.axvline(0.0, color="0.4", linewidth=0.8, zorder=1)
    panel.set_xscale("symlog", linthresh=_LINEAR_PERCENT, linscale=2.0)
    panel.set_yscale("symlog", linthresh=_LINEAR_DEG, linscale=2.0)
    lines = [line for line in panel.lines if line.get_marker() != "None"]
    for set_limits, values, most in (
        (panel.set_xlim, [line.get_xdata() for line in lines], math.inf),
        (panel.set_ylim, [line.get_ydata() for line in lines], 200.0),
    ):
        reach = 1.3 * np.concatenate([[-20.0, 20.0], *values])
        set_limits(max(reach.min(), -most), min(reach.max(), most))
    for one, ticks in (
        (panel.xaxis, (5, 10, 20, 50, 100, 200, 500, 1000, 10_000)),
        (panel.yaxis, (5, 10, 20, 50, 100, 180)),
    ):
        low, high = one.get_view_interval()
        both = [*(-tick for tick in ticks[::-1]), 0, *ticks]
        one.set_ticks([tick for tick in both if low <= tick <= high])
        one.set_major_formatter(
            FuncFormatter(lambda value, _: f"{value:+g}" if value else "0")
        )
        one.set_minor_formatter(NullFormatter())
    panel.set_box_aspect(1.0)
    panel.set_xlabel("amplitude error (%)")
    panel.set_ylabel("phase error (°, positive: model late)")
    panel.set_title("Errors (logarithmic beyond 20)")


def _panel_beneath(axis: Axes) -> list[Axes]:
    """Room for a flat panel below an axis; nothing if it cannot be divided."""
    place = axis.get_subplotspec()
    if place is None:
        return []
    grid = place.subgridspec(2, 1, height_ratios=[3.0, 1.0])
    axis.set_subplotspec(grid[0])
    return [axis.figure.add_subplot(grid[1])]


def _step(time: np.ndarray) -> float:
    return float(np.median(np.diff(time))) if len(time) > 1 else _DOT_STEP_S


def _runs(time: np.ndarray) -> list[slice]:
    """Parts without gaps."""
    ends = np.flatnonzero(np.diff(time) > 1.5 * _step(time)) + 1
    return [slice(a, b) for a, b in pairwise([0, *ends.tolist(), len(time)])]


def _broken(time: np.ndarray, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Dates and values of a line that leaves gaps open."""
    parts = [(time[run], values[run]) for run in _runs(time)]
    return _joined(parts)


def _smooth(time: np.ndarray, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The same of a curve through the values, which hourly levels cut corners of."""
    parts = []
    for run in _runs(time):
        own, level = time[run], values[run]
        if len(own) >= 4 and _step(own) > _DRAWN_STEP_S:
            fine = np.union1d(np.arange(own[0], own[-1], _DRAWN_STEP_S), own)
            own, level = fine, CubicSpline(own, level)(fine)
        parts.append((own, level))
    return _joined(parts)


def _joined(parts: list[tuple[np.ndarray, np.ndarray]]) -> tuple:
    time = np.concatenate([np.append(own, own[-1]) for own, _ in parts])
    values = np.concatenate([np.append(level, np.nan) for _, level in parts])
    return _dates(time), values


def _decorate_dates(axis: Axes, low: float, high: float) -> None:
    ends = _dates(np.array([low, high]))
    axis.set_xlim(*ends)
    # Without multiples, since the 31st and the first would hide each other.
    locator = AutoDateLocator(minticks=4, maxticks=8, interval_multiples=False, tz=UTC)
    axis.xaxis.set_major_locator(locator)
    form = "%d %b" if ends[1] - ends[0] > 4.0 else "%d %b %H:%M"
    axis.xaxis.set_major_formatter(DateFormatter(form, tz=UTC))
    years = sorted({datetime.fromtimestamp(t, UTC).year for t in (low, high - 1.0)})
    axis.set_xlabel(f"{'-'.join(map(str, years))}, UTC")


def _dates(time: np.ndarray) -> np.ndarray:
    """Days since 1970, which is what matplotlib counts."""
    return np.asarray(time) / 86400.0
