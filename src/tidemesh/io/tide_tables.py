"""Tables of tidal constants as CSV: one row a place and constituent, or one a place."""

from __future__ import annotations

import csv
import math
import re
from pathlib import Path

import numpy as np

from tidemesh.constants import SPEED_DEG_PER_HOUR
from tidemesh.datatypes import TideTable
from tidemesh.errors import FormatError, InputError
from tidemesh.io.files import read_text

_COLUMNS = {
    "longitude": ("lon", "longitude", "lon_deg", "longitude_deg", "x"),
    "latitude": ("lat", "latitude", "lat_deg", "latitude_deg", "y"),
    "constituent": ("constituent", "con", "name_of_constituent"),
    "amplitude": ("amplitude", "amplitude_m", "amp", "amp_m"),
    "phase": (
        "phase",
        "phase_deg",
        "phase_deg_greenwich",
        "phase_deg_gmt",
        "phase_greenwich_deg",
        "phase_gmt_deg",
        "greenwich_phase_deg",
        "phase_gmt",
    ),
    "speed": ("speed_deg_per_hour", "speed"),
    "station": ("name", "station", "station_id", "id"),
}
"""Accepted headers, in any case; a station is called by its name where it has one."""

_WIDE_AMPLITUDE = re.compile(r"^(\w+?)_(?:amp|amplitude)(?:_m)?$", re.IGNORECASE)
_WIDE_PHASE = re.compile(
    r"^(\w+?)_phase(?:_deg)?(?:_(?:gmt|greenwich))?$", re.IGNORECASE
)
_ABSENT = ("", "nan", "na", "-")


def read_tide_table(path: str | Path) -> TideTable:
    """Read amplitudes (m) and Greenwich phase lags (degrees) of tidal constituents.

    Two layouts are known by their header, columns in any order:

    - one row a place and constituent: ``lon, lat, constituent, amplitude, phase``, and
      if wanted ``speed_deg_per_hour`` and a station column;
    - one row a place: ``lon, lat, M2_amp_m, M2_phase_deg_gmt, S2_amp_m, ...``.

    Commas, semicolons or tabs separate; lines that start with ``#`` are left out; an
    empty amplitude or phase means that the constituent is not known there.

    Parameters
    ----------
    path : path

    Returns
    -------
    table : TideTable
        Places and constituents in the order of the file.

    Raises
    ------
    FormatError
        If a column is missing or a value cannot be used; with the line.
    InputError
        If there is no such file, or the speed of a constituent is not known.
    """
    path = Path(path)
    rows = _rows(path)
    line, header = next(rows, (1, []))
    if not header:
        raise FormatError("the table is empty", path)
    columns = _columns(header)
    for wanted in ("longitude", "latitude"):
        if wanted not in columns:
            raise _missing(wanted, header, path, line)
    wide = _wide_columns(header, path, line)
    if "constituent" in columns:
        for wanted in ("amplitude", "phase"):
            if wanted not in columns:
                raise _missing(wanted, header, path, line)
        return _read_long(rows, len(header), columns, path)
    if wide:
        return _read_wide(rows, len(header), columns, wide, path)
    raise FormatError(
        'expected a column "constituent", or columns such as "M2_amp_m" and '
        f'"M2_phase_deg_gmt"; got {", ".join(header)}',
        path,
        line,
    )


def _read_long(rows, width: int, columns: dict[str, int], path: Path) -> TideTable:
    places: dict[tuple, int] = {}
    names: dict[str, int] = {}
    speeds: dict[str, float] = {}
    values: dict[tuple[int, int], complex] = {}
    for line, row in rows:
        _check_width(row, width, path, line)
        station = row[columns["station"]] if "station" in columns else ""
        longitude = _number(row[columns["longitude"]], "longitude", path, line)
        latitude = _number(row[columns["latitude"]], "latitude", path, line)
        place = places.setdefault((longitude, latitude, station), len(places))
        name = row[columns["constituent"]].upper()
        if not name:
            raise FormatError("the constituent has no name", path, line)
        constituent = names.setdefault(name, len(names))
        if "speed" in columns:
            speed = _number(row[columns["speed"]], "speed", path, line)
            if speeds.setdefault(name, speed) != speed:
                raise FormatError(
                    f"the speed of {name} is {speed:g} degrees per hour here and "
                    f"{speeds[name]:g} before",
                    path,
                    line,
                )
        if (constituent, place) in values:
            raise FormatError(
                f"{name} at ({longitude:g}, {latitude:g}) is given a second time",
                path,
                line,
            )
        values[constituent, place] = _constant(
            row[columns["amplitude"]], row[columns["phase"]], name, path, line
        )
    return _table(list(places), list(names), speeds, values, path)


def _read_wide(
    rows, width: int, columns: dict[str, int], wide: dict, path: Path
) -> TideTable:
    places, values = [], {}
    for line, row in rows:
        _check_width(row, width, path, line)
        for constituent, (name, (amplitude, phase)) in enumerate(wide.items()):
            values[constituent, len(places)] = _constant(
                row[amplitude], row[phase], name, path, line
            )
        station = row[columns["station"]] if "station" in columns else ""
        longitude = _number(row[columns["longitude"]], "longitude", path, line)
        latitude = _number(row[columns["latitude"]], "latitude", path, line)
        places.append((longitude, latitude, station))
    return _table(places, list(wide), {}, values, path)


def _table(
    places: list, names: list[str], speeds: dict[str, float], values: dict, path: Path
) -> TideTable:
    if not places:
        raise FormatError("the table has a header and no rows", path)
    elevation = np.full((len(names), len(places)), np.nan, dtype=np.complex128)
    for (constituent, place), value in values.items():
        elevation[constituent, place] = value
    frequency = []
    for name in names:
        speed = speeds.get(name, SPEED_DEG_PER_HOUR.get(name))
        if speed is None:
            raise InputError(
                f"{path}: the speed of constituent {name} is not known: add a column "
                "speed_deg_per_hour; known without it are "
                + ", ".join(SPEED_DEG_PER_HOUR)
            )
        frequency.append(math.radians(speed) / 3600.0)
    stations = tuple(station for *_, station in places)
    return TideTable(
        longitude_deg=np.array([place[0] for place in places]),
        latitude_deg=np.array([place[1] for place in places]),
        names=tuple(names),
        frequency=np.array(frequency),
        elevation=elevation,
        stations=stations if any(stations) else (),
    )


def _rows(path: Path):
    """Line number and stripped cells of every row, comments and blanks left out."""
    text = read_text(path)
    lines = text.splitlines()
    first = next((s for s in lines if s.strip() and not s.startswith("#")), "")
    delimiter = max(",;\t", key=first.count)
    kept = (
        (number, line)
        for number, line in enumerate(lines, start=1)
        if line.strip() and not line.startswith("#")
    )
    for number, line in kept:
        yield number, [s.strip() for s in next(csv.reader([line], delimiter=delimiter))]


def _columns(header: list[str]) -> dict[str, int]:
    lower = [name.lower() for name in header]
    found = {}
    for meaning, accepted in _COLUMNS.items():
        place = next((lower.index(name) for name in accepted if name in lower), None)
        if place is not None:
            found[meaning] = place
    return found


def _wide_columns(
    header: list[str], path: Path, line: int
) -> dict[str, tuple[int, int]]:
    amplitudes, phases = {}, {}
    for index, name in enumerate(header):
        if match := _WIDE_AMPLITUDE.match(name):
            amplitudes[match[1].upper()] = index
        elif match := _WIDE_PHASE.match(name):
            phases[match[1].upper()] = index
    for name in amplitudes:
        if name not in phases:
            raise FormatError(
                f"{name} has an amplitude column and no phase column "
                f'("{name}_phase_deg_gmt")',
                path,
                line,
            )
    return {name: (index, phases[name]) for name, index in amplitudes.items()}


def _missing(meaning: str, header: list[str], path: Path, line: int) -> FormatError:
    accepted = ", ".join(_COLUMNS[meaning])
    return FormatError(
        f"no {meaning} column: expected one named {accepted}; got {', '.join(header)}",
        path,
        line,
    )


def _check_width(row: list[str], width: int, path: Path, line: int) -> None:
    if len(row) != width:
        raise FormatError(
            f"expected {width} columns as in the header, got {len(row)}", path, line
        )


def _number(cell: str, what: str, path: Path, line: int) -> float:
    try:
        value = float(cell)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise FormatError(f'expected a number as {what}, got "{cell}"', path, line)
    return value


def _constant(amplitude: str, phase: str, name: str, path: Path, line: int) -> complex:
    if amplitude.lower() in _ABSENT or phase.lower() in _ABSENT:
        return complex(math.nan, math.nan)
    size = _number(amplitude, f"amplitude of {name}", path, line)
    lag = math.radians(_number(phase, f"phase of {name}", path, line))
    if size < 0.0:
        raise FormatError(
            f"the amplitude of {name} is negative: {size:g} m", path, line
        )
    return complex(size * math.cos(lag), -size * math.sin(lag))
