"""Water levels at stations from any of the files that hold them."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from pathlib import Path

from tidemesh.datatypes import TideRecord, TideTable
from tidemesh.errors import InputError
from tidemesh.io.fort63 import NodalSeries, read_fort61
from tidemesh.io.tide_records import read_records
from tidemesh.io.time_series import read_stations
from tidemesh.pipeline.tide import seconds
from tidemesh.verification import harmonic_analysis

_ADCIRC = ("fort.61", "fort.61.nc", "fort.61.gz")


def read_levels(
    path: str | Path, *, stations: Sequence[str] = (), start: str | None = None
) -> tuple[TideRecord, ...]:
    """Read water levels at stations.

    Parameters
    ----------
    path : path
        CSV or JSON (`read_records`), ``stations.nc`` of a simulation, or ADCIRC's
        fort.61.
    stations : sequence of str
        Names of ADCIRC's stations, where its file does not tell them.
    start : str, optional
        Time 0 (UTC) of an ADCIRC run whose file does not tell it.

    Raises
    ------
    InputError
        If the file cannot be read, or does not tell names or time and neither is given.
    """
    path = Path(path)
    if path.name in _ADCIRC or path.suffix == ".61":
        return _of_adcirc(read_fort61(path, keep_complete=True), path, stations, start)
    if path.suffix == ".nc":
        return read_stations(path)
    return read_records(path)


def _of_adcirc(
    series: NodalSeries, path: Path, stations: Sequence[str], start: str | None
) -> tuple[TideRecord, ...]:
    names = series.names or tuple(stations)
    if len(names) != series.values.shape[1]:
        raise InputError(
            f"{path}: {series.values.shape[1]} stations, {len(names)} names; give "
            "their names in the order of the fort.15 with --stations, separated by "
            "commas"
        )
    begin = start if start is not None else series.base_date
    if begin is None:
        raise InputError(
            f"{path}: does not tell when the run began: give --cold-start, for "
            "instance 1998-01-01T00:00:00Z"
        )
    time = series.time + seconds(begin)
    return tuple(
        TideRecord(time, series.values[:, k], name) for k, name in enumerate(names)
    )


def analysed(
    records: Sequence[TideRecord], table: TideTable, names: Sequence[str]
) -> TideTable:
    """Harmonic constants of records (UTide), at the places of a table's gauges.

    Parameters
    ----------
    records : sequence of TideRecord
        Stations called as the gauges of the table; others are left out.
    table : TideTable
        Gauges.
    names : sequence of str
        Constituents.

    Raises
    ------
    InputError
        If no record belongs to a gauge, or one is too short for the constituents.
    """
    rows, constants = [], []
    for record in records:
        if record.station not in table.stations:
            continue
        row = table.stations.index(record.station)
        latitude = float(table.latitude_deg[row])
        constants.append(harmonic_analysis(record, names, latitude))
        rows.append(row)
    if not rows:
        raise InputError(
            "none of the levels belongs to a gauge: stations are "
            + ", ".join(r.station or "without a name" for r in records)
        )
    elevation = [one.elevation[:, 0] for one in constants]
    return dataclasses.replace(
        table,
        longitude_deg=table.longitude_deg[rows],
        latitude_deg=table.latitude_deg[rows],
        names=constants[0].names,
        frequency=constants[0].frequency,
        elevation=list(zip(*elevation)),
        stations=tuple(table.stations[row] for row in rows),
    )
