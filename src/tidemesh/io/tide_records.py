"""Water levels as time series: CSV of any make, and the files of NOAA CO-OPS."""

from __future__ import annotations

import csv
import json
import logging
import math
import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime, timedelta, timezone
from pathlib import Path
from typing import Any

import numpy as np

from tidemesh.datatypes import TideRecord
from tidemesh.errors import FormatError, InputError
from tidemesh.io.files import atomic, read_text

_log = logging.getLogger(__name__)

_UNITS = {
    **dict.fromkeys(("m", "metre", "metres", "meter", "meters"), 1.0),
    **dict.fromkeys(("cm", "centimetre", "centimetres"), 0.01),
    **dict.fromkeys(("ft", "foot", "feet"), 0.3048),
}
_TIME_WORDS = {"time", "date", "datetime", "timestamp", "t"}
_ZONE_WORDS = {"utc", "gmt", "z"}
_LOCAL_WORDS = {"lst", "ldt", "local", "est", "edt", "cst", "cdt", "mst", "pst", "cet"}
_LEVEL_WORDS = {
    *("level", "levels", "elevation", "eta", "zeta", "height", "wl", "ssh", "v"),
    *("prediction", "predicted", "predictions", "observed", "observation"),
    *("verified", "preliminary", "modelled", "modeled", "tide"),
}
_OTHER_WORDS = {"sigma", "quality", "flag", "flags", "error", "speed", "std", "or"}
"""Mark a column that holds no levels, such as "O or I (for verified)" of CO-OPS."""

_DATUMS = {
    "msl": "mean sea level",
    "mllw": "mean lower low water",
    "mlw": "mean low water",
    "mhw": "mean high water",
    "mhhw": "mean higher high water",
    "navd88": "NAVD88",
    "navd": "NAVD88",
}
_COLUMNS = {
    "station": ("station", "station_name", "name", "gauge", "station_id", "id"),
    "longitude": ("longitude_deg", "longitude", "lon", "lon_deg"),
    "latitude": ("latitude_deg", "latitude", "lat", "lat_deg"),
    "datum": ("datum",),
}
_ABSENT = ("", "nan", "na", "n/a", "null", "none", "-", "--")
_NO_DATA = (-99999.0, -9999.0, -999.0, 9999.0, 99999.0)
_NOT_STATED = "not stated"


def read_records(
    path: str | Path,
    *,
    unit: str | None = None,
    utc_offset_hours: float | None = None,
) -> tuple[TideRecord, ...]:
    """Read water levels observed or modelled at one or several stations.

    Known by their content:

    - CSV (commas, semicolons or tabs; lines that start with ``#`` are left out) with a
      time column, or a date and a time column, and one or more level columns. Times
      are ISO 8601, ``1998-03-16T00:00Z`` or ``1998/03/16 00:00``. The zone comes with
      every time or in the header (``time_utc``, ``Time (GMT)``), the unit in the
      header (``level_m``, ``Verified (ft)``), and if wanted the datum
      (``level_m_navd88``). Columns station, longitude, latitude, datum are understood;
      rows of several stations may alternate. Of several level columns each becomes a
      record.
    - CSV and JSON as the data service of NOAA CO-OPS sends it, observations and
      predictions. Such files state neither unit nor zone; metres and UTC are taken,
      with a warning, unless the keywords say otherwise.

    Parameters
    ----------
    path : path
    unit : {"m", "cm", "ft"}, optional
        For files that do not state it.
    utc_offset_hours : float, optional
        Of the times of files that do not state it, positive to the east.

    Returns
    -------
    records : tuple of TideRecord
        In the order of the file; NaN where a value is missing.

    Raises
    ------
    FormatError
        If a column, the unit or the zone is missing, a value cannot be used, or times
        do not increase; with the line.
    InputError
        If there is no such file, or a keyword is not known.
    """
    path = Path(path)
    if unit is not None and unit.lower() not in _UNITS:
        raise InputError(f'the unit "{unit}" is not known; known are m, cm, ft')
    stated = _Stated(
        None if unit is None else _UNITS[unit.lower()],
        None if utc_offset_hours is None else _zone(utc_offset_hours),
    )
    text = read_text(path)
    if text.lstrip()[:1] in ("{", "["):
        return _read_json(text, stated, path)
    return _read_csv(text, stated, path)


def write_records(path: str | Path, records: TideRecord | Sequence[TideRecord]) -> Path:
    """Write water levels as CSV, one row a station and time; read back unchanged.

    Parameters
    ----------
    path : path
    records : TideRecord or sequence of TideRecord
        Of different stations.

    Returns
    -------
    path : Path

    Raises
    ------
    InputError
        If two records have one station and place, or the file cannot be written.

    Notes
    -----
    Times are written to the microsecond, levels with all their digits.
    """
    path = Path(path)
    if isinstance(records, TideRecord):
        records = (records,)
    places = [(r.station, repr(r.longitude_deg), repr(r.latitude_deg)) for r in records]
    for k, place in enumerate(places):
        if place in places[:k]:
            raise InputError(
                f'{path}: two records are called "{place[0]}"; give every station a '
                "name of its own"
            )
    with (
        atomic(path) as unfinished,
        open(unfinished, "w", encoding="utf-8", newline="") as file,
    ):
        rows = csv.writer(file, lineterminator="\n")
        rows.writerow(
            ["time_utc", "station", "longitude_deg", "latitude_deg", "datum", "level_m"]
        )
        for record in records:
            where = [
                record.station,
                *(
                    repr(float(x)) if math.isfinite(x) else ""
                    for x in (record.longitude_deg, record.latitude_deg)
                ),
                record.datum,
            ]
            levels = record.elevation.tolist()
            for second, level in zip(record.time.tolist(), levels):
                rows.writerow(
                    [_iso(second), *where, repr(level) if level == level else ""]
                )
    return path


# ---- what a file states ----------------------------------------------------------


@dataclass(frozen=True)
class _Stated:
    """Unit (m) and time zone that are known from elsewhere than the values."""

    unit: float | None
    zone: timezone | None


@dataclass(frozen=True)
class _LevelColumn:
    index: int
    name: str
    unit: float
    datum: str


def _zone(hours: float) -> timezone:
    if not -24.0 < hours < 24.0:
        raise InputError(f"utc_offset_hours must lie within a day, got {hours:g}")
    return timezone(timedelta(hours=hours))


# ---- CSV -------------------------------------------------------------------------


def _read_csv(text: str, stated: _Stated, path: Path) -> tuple[TideRecord, ...]:
    rows = _rows(text)
    line, header = next(rows, (1, []))
    if not header:
        raise FormatError("the file is empty", path)
    words = [_words(name) for name in header]
    time_columns = _time_columns(header, words, path, line)
    of_coops = header[0].lower() == "date time"
    zone = _header_zone([words[k] for k in time_columns], path, line) or stated.zone
    unit = stated.unit
    if of_coops:
        zone, unit = _of_coops(zone, unit, words, path)
    others = {
        meaning: index
        for meaning, accepted in _COLUMNS.items()
        if (index := _first_of(header, accepted)) is not None
    }
    taken = {*time_columns, *others.values()}
    levels = _level_columns(header, words, taken, unit, path, line)

    series: dict[tuple, _Series] = {}
    for line, row in rows:
        # CO-OPS closes some rows with one comma more than the header.
        if len(row) < len(header) or any(row[len(header) :]):
            raise FormatError(
                f"expected {len(header)} columns as in the header, got {len(row)}",
                path,
                line,
            )
        second = _seconds(" ".join(row[k] for k in time_columns), zone, path, line)
        station, where, datum = _place(row, others, path, line)
        for level in levels:
            value = _level(row[level.index], level.unit, path, line)
            name = f"{station} {level.name}".strip()
            key = (name, *where)
            if key not in series:
                series[key] = _Series(name, where, datum or level.datum)
            series[key].append(second, value, path, line)
    if not series:
        raise FormatError("there is a header and no rows", path)
    return tuple(one.record() for one in series.values())


def _rows(text: str) -> Iterator[tuple[int, list[str]]]:
    lines = text.splitlines()
    first = next((s for s in lines if s.strip() and not s.startswith("#")), "")
    delimiter = max(",;\t", key=first.count)
    for number, line in enumerate(lines, start=1):
        if line.strip() and not line.startswith("#"):
            cells = next(csv.reader([line], delimiter=delimiter, skipinitialspace=True))
            yield number, [cell.strip() for cell in cells]


def _words(name: str) -> list[str]:
    return re.findall(r"[a-z]+[0-9]*", name.lower())


def _first_of(header: list[str], accepted: Iterable[str]) -> int | None:
    lower = [name.lower().replace(" ", "_") for name in header]
    return next((lower.index(name) for name in accepted if name in lower), None)


def _time_columns(
    header: list[str], words: list[list[str]], path: Path, line: int
) -> list[int]:
    """One column of date and time, or two."""
    found = [
        k
        for k, own in enumerate(words)
        if own and own[0] in _TIME_WORDS and not _LEVEL_WORDS - {"v"} & set(own)
    ]
    dates = [k for k in found if words[k] == ["date"]]
    clocks = [k for k in found if words[k][0] == "time"]
    if dates and clocks:
        return [dates[0], clocks[0]]
    if not found:
        raise FormatError(
            'no time column: expected one named for instance "time_utc" or '
            f'"Date Time"; got {", ".join(header)}',
            path,
            line,
        )
    return found[:1]


def _header_zone(names: list[list[str]], path: Path, line: int) -> timezone | None:
    words = {word for name in names for word in name}
    if local := words & _LOCAL_WORDS:
        raise FormatError(
            f'the times are local ("{local.pop().upper()}"), which jumps with '
            "daylight saving: obtain the file in UTC (GMT)",
            path,
            line,
        )
    return UTC if words & _ZONE_WORDS else None


def _of_coops(
    zone: timezone | None, unit: float | None, words: list[list[str]], path: Path
) -> tuple[timezone, float]:
    """What files of the data service leave unsaid."""
    unsaid = []
    if zone is None:
        unsaid.append("UTC")
    if unit is None and not any(_UNITS.keys() & set(own) for own in words):
        unsaid.append("metres")
    if unsaid:
        _log.warning(
            "%s: a file of NOAA CO-OPS states neither zone nor unit; taken as %s",
            path,
            " and ".join(unsaid),
        )
    return zone or UTC, unit or 1.0


def _level_columns(
    header: list[str],
    words: list[list[str]],
    taken: set[int],
    unit: float | None,
    path: Path,
    line: int,
) -> list[_LevelColumn]:
    found = []
    for k, own in enumerate(words):
        units = [word for word in own if word in _UNITS]
        named = set(own)
        if k in taken or named & _OTHER_WORDS or not (named & _LEVEL_WORDS or units):
            continue
        factor = _UNITS[units[0]] if units else unit
        if factor is None:
            raise FormatError(
                f'the column "{header[k]}" does not state its unit: call it '
                f'"{header[k]}_m" or "{header[k]}_ft", or give the unit',
                path,
                line,
            )
        datum = next((_DATUMS[w] for w in own if w in _DATUMS), _NOT_STATED)
        name = re.sub(
            r"[\s_]*[\(\[]?\b(m|cm|ft)\b[\)\]]?", "", header[k].replace("_", " ")
        )
        found.append(_LevelColumn(k, name.strip(), factor, datum))
    if len(found) == 1 and set(words[found[0].index]) & _LEVEL_WORDS:
        # The name says what it is and not where.
        found[0] = replace(found[0], name="")
    if not found:
        raise FormatError(
            'no column of water levels: expected one named for instance "level_m" or '
            f'"Water Level (ft)"; got {", ".join(header)}',
            path,
            line,
        )
    return found


def _place(
    row: list[str], others: dict[str, int], path: Path, line: int
) -> tuple[str, tuple[float, float], str]:
    """Station, its longitude and latitude, the datum: what the row says of them."""
    where = []
    for meaning in ("longitude", "latitude"):
        cell = row[others[meaning]] if meaning in others else ""
        try:
            value = float(cell) if cell else math.nan
        except ValueError:
            raise FormatError(
                f'expected a number as {meaning}, got "{cell}"', path, line
            ) from None
        # One object for all rows, since NaN is not equal to itself.
        where.append(value if math.isfinite(value) else math.nan)
    station = row[others["station"]] if "station" in others else ""
    return station, tuple(where), row[others["datum"]] if "datum" in others else ""


def _level(cell: str, unit: float, path: Path, line: int | None) -> float:
    if cell.lower() in _ABSENT:
        return math.nan
    try:
        value = float(cell)
    except ValueError:
        raise FormatError(
            f'expected a number as water level, got "{cell}"', path, line
        ) from None
    if value in _NO_DATA:
        return math.nan
    if not math.isfinite(value):
        raise FormatError(f"the water level is not finite: {cell}", path, line)
    # A factor of 1 must not cost a digit, and does not.
    return value * unit


# ---- JSON ------------------------------------------------------------------------


def _read_json(text: str, stated: _Stated, path: Path) -> tuple[TideRecord, ...]:
    try:
        content = json.loads(text)
    except json.JSONDecodeError as error:
        raise FormatError(
            f"is not JSON: {error.msg}; is the file complete?", path, error.lineno
        ) from error
    if isinstance(content, dict) and "error" in content:
        told = content["error"]
        told = told.get("message", told) if isinstance(told, dict) else told
        raise FormatError(f'holds an error message instead of data: "{told}"', path)
    entries = None
    if isinstance(content, dict):
        entries = content.get("data", content.get("predictions"))
    if not isinstance(entries, list) or not entries:
        raise FormatError(
            'expected a list "data" or "predictions" of {"t": time, "v": level} as '
            "the data service of NOAA CO-OPS sends it",
            path,
        )
    zone, unit = _of_coops(stated.zone, stated.unit, [], path)
    about: dict[str, Any] = content.get("metadata") or {}
    series = _Series(
        str(about.get("name") or about.get("id") or ""),
        tuple(_coordinate(about.get(key)) for key in ("lon", "lat")),
        _NOT_STATED,
    )
    for number, entry in enumerate(entries, start=1):
        try:
            when, value = str(entry["t"]), entry["v"]
        except (TypeError, KeyError):
            raise FormatError(
                f'entry {number} has no "t" and "v": {json.dumps(entry)}', path
            ) from None
        try:
            series.append(
                _seconds(when, zone, path, None),
                _level("" if value is None else str(value).strip(), unit, path, None),
                path,
                None,
            )
        except FormatError as error:
            message = str(error).removeprefix(f"{path}: ")
            raise FormatError(f"entry {number}: {message}", path) from None
    return (series.record(),)


def _coordinate(value: Any) -> float:
    try:
        return float(value)
    except (TypeError, ValueError):
        return math.nan


# ---- times -----------------------------------------------------------------------


def _seconds(cell: str, zone: timezone | None, path: Path, line: int | None) -> float:
    """Seconds since 1970-01-01 00:00 UTC."""
    try:
        when = datetime.fromisoformat(cell.strip().replace("/", "-"))
    except ValueError:
        raise FormatError(
            f'"{cell}" is not a time: expected for instance 1998-03-16T00:00Z or '
            "1998-03-16 00:00",
            path,
            line,
        ) from None
    if when.tzinfo is None:
        if zone is None:
            raise FormatError(
                f'the time "{cell}" states no zone: add Z or an offset, call the '
                "column time_utc, or give utc_offset_hours",
                path,
                line,
            )
        when = when.replace(tzinfo=zone)
    return when.timestamp()


def _iso(second: float) -> str:
    when = datetime.fromtimestamp(0, UTC) + timedelta(seconds=second)
    return when.isoformat().replace("+00:00", "Z")


# ---- series ----------------------------------------------------------------------


class _Series:
    """A record while it is read."""

    def __init__(self, station: str, where: tuple[float, ...], datum: str):
        self.station, self.where, self.datum = station, where, datum
        self.time: list[float] = []
        self.level: list[float] = []

    def append(self, second: float, level: float, path: Path, line: int | None) -> None:
        if self.time and second <= self.time[-1]:
            of = f" of {self.station}" if self.station else ""
            what = (
                f"the time {_iso(second)}{of} is given a second time"
                if second == self.time[-1]
                else f"the times{of} do not increase: {_iso(second)} comes after "
                f"{_iso(self.time[-1])}"
            )
            raise FormatError(f"{what}; sort the rows and drop duplicates", path, line)
        self.time.append(second)
        self.level.append(level)

    def record(self) -> TideRecord:
        return TideRecord(
            time=np.array(self.time),
            elevation=np.array(self.level),
            station=self.station,
            longitude_deg=self.where[0],
            latitude_deg=self.where[1],
            datum=self.datum,
        )
