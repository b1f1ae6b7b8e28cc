"""Harmonic constants, modelled against observed."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass, fields
from typing import Any

import numpy as np

from tidemesh.datatypes import TideTable
from tidemesh.errors import InputError
from tidemesh.verification.gauges import station_names

_SAME_PLACE_DEG = 1.0e-3
"""About 100 m: farther apart, two places are not one gauge."""


@dataclass(frozen=True)
class ConstantsRow:
    """One constituent at one gauge."""

    gauge: str
    longitude_deg: float
    latitude_deg: float
    constituent: str
    observed_m: float
    """Amplitude."""
    modelled_m: float
    observed_phase_deg: float
    """Greenwich phase lag, 0 to 360."""
    modelled_phase_deg: float
    amplitude_error_m: float
    """Modelled less observed."""
    amplitude_error_percent: float
    """Of the observed amplitude."""
    phase_error_deg: float
    """Modelled less observed, -180 to 180: positive where the model is late."""
    complex_error_m: float
    """Length of the difference of the two complex amplitudes."""
    distance_m: float | None = None
    """Of the gauge from the mesh, where that is known."""


@dataclass(frozen=True)
class ConstituentSummary:
    """One constituent over all gauges."""

    constituent: str
    gauges: int
    rms_error_m: float
    """sqrt(mean |difference|^2 / 2): root mean square of the error over the gauges and
    over a period."""
    observed_rms_m: float
    """The same of the observed tide."""
    relative_error: float
    """The first over the second."""
    amplitude_ratio: float
    """Mean of modelled over observed amplitude."""
    phase_error_deg: float
    """Mean (on the circle): positive where the model is late."""
    largest_error_m: float
    """Largest complex error,"""
    largest_error_gauge: str
    """and where."""


@dataclass(frozen=True, eq=False)
class ConstantsComparison:
    """Modelled and observed constants at the same gauges, and their differences."""

    modelled: TideTable
    """Constituents and gauges that both tables have,"""
    observed: TideTable
    """in the same order; NaN where the gauge has no constant."""
    rows: tuple[ConstantsRow, ...]
    """Gauge by gauge, each in the order of the constituents."""
    summary: tuple[ConstituentSummary, ...]
    rss_error_m: float
    """Root of the sum of the squared rms errors of all constituents."""
    observed_rss_m: float
    """The same of the observed tide."""

    @property
    def relative_error(self) -> float:
        """Root-sum-square error over that of the observed tide."""
        return self.rss_error_m / self.observed_rss_m

    def as_dict(self) -> dict[str, Any]:
        """Plain values for JSON."""
        return {
            "gauges": len(self.observed.longitude_deg),
            "rss_error_m": self.rss_error_m,
            "observed_rss_m": self.observed_rss_m,
            "relative_error": self.relative_error,
            "constituents": [asdict(one) for one in self.summary],
            "rows": [asdict(row) for row in self.rows],
        }

    def as_text(self) -> str:
        """Two tables to print: gauge by gauge, and over all gauges."""
        return f"{text_table(_ROWS, self.rows)}\n\n{text_table(_SUMMARY, self._all())}"

    def as_markdown(self) -> str:
        """The same as tables of a markdown file."""
        return (
            f"{markdown_table(_SUMMARY, self._all())}\n\n"
            f"{markdown_table(_ROWS, self.rows)}\n"
        )

    def _all(self) -> list[dict[str, Any]]:
        total = {
            "constituent": "all",
            "gauges": len(self.observed.longitude_deg),
            "rms_error_m": self.rss_error_m,
            "observed_rms_m": self.observed_rss_m,
            "relative_error": self.relative_error,
        }
        return [*(asdict(one) for one in self.summary), total]


_ROWS = (
    ("gauge", "gauge", "<", "{}"),
    ("constituent", "const.", "<", "{}"),
    ("observed_m", "obs. m", ">", "{:.3f}"),
    ("modelled_m", "mod. m", ">", "{:.3f}"),
    ("amplitude_error_percent", "error %", ">", "{:+.1f}"),
    ("observed_phase_deg", "obs. deg", ">", "{:.1f}"),
    ("modelled_phase_deg", "mod. deg", ">", "{:.1f}"),
    ("phase_error_deg", "error deg", ">", "{:+.1f}"),
    ("complex_error_m", "|dF| m", ">", "{:.3f}"),
    ("distance_m", "off mesh m", ">", "{:.0f}"),
)
_SUMMARY = (
    ("constituent", "const.", "<", "{}"),
    ("gauges", "gauges", ">", "{}"),
    ("rms_error_m", "rms error m", ">", "{:.4f}"),
    ("observed_rms_m", "rms tide m", ">", "{:.4f}"),
    ("relative_error", "relative", ">", "{:.1%}"),
    ("amplitude_ratio", "ampl. ratio", ">", "{:.3f}"),
    ("phase_error_deg", "lag deg", ">", "{:+.1f}"),
    ("largest_error_m", "largest m", ">", "{:.3f}"),
    ("largest_error_gauge", "at", "<", "{}"),
)
"""Columns of the tables: field, heading, side, format."""


def compare_constants(
    modelled: TideTable,
    observed: TideTable,
    *,
    names: Sequence[str] | None = None,
    distance_m: np.ndarray | None = None,
) -> ConstantsComparison:
    """Compare harmonic constants gauge by gauge and over all gauges.

    Parameters
    ----------
    modelled : TideTable
        For instance of `constants_at_gauges`.
    observed : TideTable
        Gauges are the same where the stations have one name and lie within 0.001
        degrees, or lie there where one of the tables has no names.
    names : sequence of str, optional
        Constituents to compare; all that both tables have if not given.
    distance_m : (n_places,) array, optional
        Distance of the gauges of `modelled` from the mesh, for the table.

    Returns
    -------
    comparison : ConstantsComparison

    Raises
    ------
    InputError
        If the tables have no gauge or no constituent in common, or one that is asked
        for is missing.

    Notes
    -----
    An observed amplitude of exactly zero counts as absent: so NOAA writes a constituent
    that the analysis of a gauge did not resolve. The rms error is the vector
    difference of the literature; the mean sea level (STEADY) has no cycle to average
    over, so its factor 1/2 is left out.
    """
    pairs = _gauges(modelled, observed)
    chosen = _constituents(modelled, observed, names)
    ours, theirs = np.array(pairs, dtype=np.int64).T
    model = _part(modelled, [modelled.names.index(n) for n in chosen], ours)
    truth = _part(observed, [observed.names.index(n) for n in chosen], theirs)
    known = np.isfinite(model.elevation) & np.isfinite(truth.elevation)
    known &= np.abs(truth.elevation) > 0.0
    used = known.any(axis=1)
    if not used.any():
        raise InputError(
            f"no gauge has a constant of {', '.join(chosen)} in both tables"
        )
    distance = None if distance_m is None else np.asarray(distance_m)[ours]
    rows = tuple(
        _row(model, truth, c, g, None if distance is None else float(distance[g]))
        for g in range(len(pairs))
        for c in range(len(chosen))
        if known[c, g]
    )
    summary = tuple(_summary(model, truth, c, known[c]) for c in np.flatnonzero(used))
    return ConstantsComparison(
        modelled=model,
        observed=truth,
        rows=rows,
        summary=summary,
        rss_error_m=math.hypot(*(one.rms_error_m for one in summary)),
        observed_rss_m=math.hypot(*(one.observed_rms_m for one in summary)),
    )


# ---- one gauge, one constituent --------------------------------------------------


def _row(
    model: TideTable, truth: TideTable, c: int, g: int, distance: float | None
) -> ConstantsRow:
    ours, theirs = model.elevation[c, g], truth.elevation[c, g]
    error = abs(ours) - abs(theirs)
    return ConstantsRow(
        gauge=station_names(truth)[g],
        longitude_deg=float(truth.longitude_deg[g]),
        latitude_deg=float(truth.latitude_deg[g]),
        constituent=truth.names[c],
        observed_m=float(abs(theirs)),
        modelled_m=float(abs(ours)),
        observed_phase_deg=phase_deg(theirs),
        modelled_phase_deg=phase_deg(ours),
        amplitude_error_m=float(error),
        amplitude_error_percent=float(100.0 * error / abs(theirs)),
        phase_error_deg=float(np.degrees(_lag(ours, theirs))),
        complex_error_m=float(abs(ours - theirs)),
        distance_m=distance,
    )


def phase_deg(value: complex) -> float:
    """Greenwich phase lag G of amplitude * exp(-i G), 0 to 360 degrees."""
    lag = float(-np.angle(value, deg=True) % 360.0)
    # The remainder of a tiny negative number rounds to the whole circle.
    return 0.0 if lag == 360.0 else lag


def _lag(ours: np.ndarray, theirs: np.ndarray) -> np.ndarray:
    """By how much (rad) ours is late: no jump where the two lie across 360 degrees."""
    return -np.angle(ours * np.conj(theirs))


# ---- one constituent, all gauges -------------------------------------------------


def _summary(
    model: TideTable, truth: TideTable, c: int, known: np.ndarray
) -> ConstituentSummary:
    ours, theirs = model.elevation[c, known], truth.elevation[c, known]
    error = np.abs(ours - theirs)
    half = 1.0 if truth.frequency[c] == 0.0 else 0.5
    rms = math.sqrt(half * float(np.mean(error**2)))
    tide = math.sqrt(half * float(np.mean(np.abs(theirs) ** 2)))
    worst = int(np.argmax(error))
    return ConstituentSummary(
        constituent=truth.names[c],
        gauges=int(known.sum()),
        rms_error_m=rms,
        observed_rms_m=tide,
        relative_error=rms / tide,
        amplitude_ratio=float(np.mean(np.abs(ours) / np.abs(theirs))),
        phase_error_deg=float(
            np.degrees(np.angle(np.mean(np.exp(1j * _lag(ours, theirs)))))
        ),
        largest_error_m=float(error[worst]),
        largest_error_gauge=station_names(truth)[int(np.flatnonzero(known)[worst])],
    )


# ---- what two tables have in common ----------------------------------------------


def _gauges(modelled: TideTable, observed: TideTable) -> list[tuple[int, int]]:
    """Places of the modelled and the observed table that are one gauge."""
    named = bool(modelled.stations and observed.stations)
    pairs, free = [], np.ones(len(observed.longitude_deg), dtype=bool)
    for k in range(len(modelled.longitude_deg)):
        gap = np.maximum(
            np.abs(observed.longitude_deg - modelled.longitude_deg[k]),
            np.abs(observed.latitude_deg - modelled.latitude_deg[k]),
        )
        same = free & (gap <= _SAME_PLACE_DEG)
        if named:
            same &= np.array([s == modelled.stations[k] for s in observed.stations])
        if same.any():
            nearest = int(np.argmin(np.where(same, gap, np.inf)))
            free[nearest] = False
            pairs.append((k, nearest))
    if not pairs:
        raise InputError(
            f"none of the {len(modelled.longitude_deg)} modelled gauges is among the "
            f"{len(observed.longitude_deg)} observed ones: they must have the same "
            "name and place (longitudes are positive to the east)"
        )
    return pairs


def _constituents(
    modelled: TideTable, observed: TideTable, names: Sequence[str] | None
) -> list[str]:
    both = [name for name in modelled.names if name in observed.names]
    if names is None:
        chosen = both
    else:
        chosen = [name.upper() for name in names]
        for name in chosen:
            if name not in both:
                which = "modelled" if name not in modelled.names else "observed"
                table = modelled if which == "modelled" else observed
                raise InputError(
                    f"the {which} constants have no {name}; they have "
                    + ", ".join(table.names)
                )
    if not chosen:
        raise InputError(
            "the tables have no constituent in common: modelled are "
            f"{', '.join(modelled.names)}, observed {', '.join(observed.names)}"
        )
    return chosen


def _part(table: TideTable, rows: list[int], places: np.ndarray) -> TideTable:
    stations = station_names(table)
    return TideTable(
        longitude_deg=table.longitude_deg[places],
        latitude_deg=table.latitude_deg[places],
        names=tuple(table.names[k] for k in rows),
        frequency=table.frequency[rows],
        elevation=table.elevation[rows][:, places],
        stations=tuple(stations[g] for g in places),
    )


# ---- tables ----------------------------------------------------------------------


def _cells(columns: Sequence[tuple], items: Sequence[Any]) -> list[list[str]]:
    rows = []
    for item in items:
        values = item if isinstance(item, dict) else asdict(item)
        rows.append(
            [
                "" if values.get(key) is None else form.format(values[key])
                for key, _, _, form in columns
            ]
        )
    return rows


def text_table(columns: Sequence[tuple], items: Sequence[Any]) -> str:
    """Columns of equal width, for the screen.

    Parameters
    ----------
    columns : sequence of (field, heading, side, format)
    items : sequence of dataclasses or dicts
    """
    cells = _cells(columns, items)
    heads = [heading for _, heading, _, _ in columns]
    wide = [max(len(row[k]) for row in [heads, *cells]) for k in range(len(columns))]
    return "\n".join(
        "  ".join(
            f"{cell:{side}{width}}"
            for cell, (_, _, side, _), width in zip(row, columns, wide)
        ).rstrip()
        for row in [heads, *cells]
    )


def markdown_table(columns: Sequence[tuple], items: Sequence[Any]) -> str:
    """The same as a table of a markdown file."""
    rule = ["---:" if side == ">" else "---" for _, _, side, _ in columns]
    rows = [[heading for _, heading, _, _ in columns], rule, *_cells(columns, items)]
    return "\n".join(
        "| " + " | ".join(cell.replace("|", "\\|") for cell in row) + " |"
        for row in rows
    )


def csv_fields() -> list[str]:
    """Columns of a table of `ConstantsRow`."""
    return [one.name for one in fields(ConstantsRow)]
