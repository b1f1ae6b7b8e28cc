"""A solution set beside gauges: constants and water levels, tables and figures."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from tidemesh import tides, verification
from tidemesh.datatypes import CoastalMesh, TideRecord, TideTable
from tidemesh.errors import InputError
from tidemesh.io.tide_tables import read_tide_table
from tidemesh.pipeline.examples import examples_folder
from tidemesh.pipeline.info import on_a_conformal_map, read_mesh
from tidemesh.pipeline.levels import analysed, read_levels
from tidemesh.pipeline.solution import read_solution
from tidemesh.pipeline.tide import seconds

STEP = 360.0
"""s, of predicted levels: the six minutes of NOAA's gauges."""

_SAME_PLACE_DEG = 0.02
_BY_CONSTANTS = ", tide of its own constants"
"""What is called observed is no measurement then."""


class Verification(NamedTuple):
    """What was compared and what was written."""

    constants: verification.ConstantsComparison | None
    records: tuple[verification.RecordComparison, ...]
    left_out: tuple[verification.LeftOut, ...]
    files: tuple[Path, ...]


def verify(
    solution: str | Path,
    *,
    output: str | Path,
    mesh: str | Path | None = None,
    gauges: str | Path | None = None,
    constituents: Sequence[str] | None = None,
    observed: str | Path | None = None,
    modelled: str | Path | None = None,
    station: str | None = None,
    start: str | None = None,
    end: str | None = None,
    stations: Sequence[str] = (),
    cold_start: str | None = None,
    analyse: bool = False,
    farthest_m: float = 3000.0,
    figures: bool = True,
) -> Verification:
    """Compare a tide with gauges.

    Parameters
    ----------
    solution : path
        As `read_solution` takes it.
    output : path
        Folder for ``verification.json``, ``verification.md``, CSV tables and figures.
    mesh : path, optional
        Needed for a fort.53.
    gauges : path, optional
        Harmonic constants at gauges; the shipped ones of the South Carolina coast
        (NOAA) if not given.
    constituents : sequence of str, optional
        All that both have if not given.
    observed : path, optional
        Water levels at gauges (CSV, or files of NOAA CO-OPS). Without it, and with
        ``start`` and ``end``, the astronomical tide of the gauge's own constants.
    modelled : path, optional
        Water levels of a simulation at stations: CSV, ``stations.nc``, or ADCIRC's
        fort.61; predicted from the constants of the solution if not given.
    station : str, optional
        Part of the name of the one gauge whose levels are compared.
    start, end : str, optional
        Dates (UTC) between which levels are compared.
    stations : sequence of str
        Names of the stations of a fort.61.
    cold_start : str, optional
        Time 0 of a fort.61.
    analyse : bool
        Take the modelled constants from the modelled levels by UTide, and the observed
        ones from the observed levels where there are any.
    farthest_m : float
        A gauge outside the mesh takes the tide of the nearest wet place up to here.
    figures : bool

    Raises
    ------
    InputError
        If an input cannot be used, or no gauge lies in the mesh.
    """
    if start is not None and end is not None and seconds(start) >= seconds(end):
        raise InputError(f"--start {start} is not before --end {end}")
    given = None if mesh is None else read_mesh(mesh)
    grid, tide = read_solution(solution, given)
    # The same velocities and elevations on a map with true distances.
    grid = on_a_conformal_map(grid)
    table = read_tide_table(
        examples_folder() / "south_carolina" / "data" / "gauges.csv"
        if gauges is None
        else gauges
    )
    served = verification.constants_at_gauges(grid, tide, table, farthest_m=farthest_m)
    if len(served.table.longitude_deg) == 0:
        raise InputError(
            f"none of the {len(table.longitude_deg)} gauges lies within "
            f"{farthest_m / 1e3:g} km of the mesh: name others with --gauges, or raise "
            "--farthest-km"
        )
    if modelled is None and (Path(solution) / "stations.csv").is_file():
        # A simulation's own levels are worth more than those of its constants.
        modelled = Path(solution) / "stations.csv"
    models = None
    if modelled is not None:
        models = read_levels(modelled, stations=stations, start=cold_start)
    truths = None if observed is None else _chosen(read_levels(observed), station)
    constants = _constants(served, table, models, truths, constituents, analyse)
    pairs = _record_pairs(served.table, table, truths, models, station, start, end)
    records = tuple(
        verification.compare_records(
            model,
            truth,
            start=None if start is None else seconds(start),
            end=None if end is None else seconds(end),
        )
        for model, truth in pairs
    )
    folder = Path(output)
    files = verification.write_verification(
        folder,
        constants=constants,
        records=records,
        left_out=served.left_out,
        title=f"Tide of {solution} against gauges",
    )
    if figures:
        files = [*files, *_draw(folder, grid, constants, records)]
    return Verification(constants, records, served.left_out, tuple(files))


def _constants(
    served: verification.GaugeTide,
    table: TideTable,
    models: Sequence[TideRecord] | None,
    truths: Sequence[TideRecord] | None,
    names: Sequence[str] | None,
    analyse: bool,
) -> verification.ConstantsComparison:
    ours, distance = served.table, served.distance_m
    if analyse:
        if models is None:
            raise InputError(
                "constants are analysed from modelled levels: give them with "
                "--modelled, or the folder of a simulation"
            )
        wanted = names or [name for name in ours.names if name in table.names]
        ours, distance = analysed(models, ours, wanted), None
        if truths is not None:
            table = analysed(truths, table, wanted)
    return verification.compare_constants(ours, table, names=names, distance_m=distance)


# ---- water levels ---------------------------------------------------------------


def _record_pairs(
    ours: TideTable,
    theirs: TideTable,
    truths: Sequence[TideRecord] | None,
    models: Sequence[TideRecord] | None,
    station: str | None,
    start: str | None,
    end: str | None,
) -> list[tuple[TideRecord, TideRecord]]:
    if truths is None and station is None and start is None:
        return []
    if truths is None and (start is None or end is None):
        raise InputError(
            "levels are compared between two dates: give --start and --end, or "
            "observed levels with --observed"
        )
    if truths is None:
        truths = _predicted(theirs, _names(ours, station), start, end)
    pairs = []
    for truth in truths:
        if models is not None:
            pairs.append((_same_station(models, truth), truth))
            continue
        place = _place_of(ours, truth, len(truths))
        level = tides.predict(ours, truth.time, place=place)
        pairs.append(
            (
                TideRecord(
                    truth.time,
                    level,
                    ours.stations[place] if ours.stations else truth.station,
                    float(ours.longitude_deg[place]),
                    float(ours.latitude_deg[place]),
                ),
                truth,
            )
        )
    return pairs


def _names(table: TideTable, station: str | None) -> list[str]:
    names = [n for n in table.stations if station is None or _matches(n, station)]
    if not names:
        raise InputError(
            f'no gauge of the mesh is called "{station}"; there are '
            + ", ".join(table.stations)
        )
    return names


def _matches(name: str, wanted: str) -> bool:
    return wanted.casefold() in name.casefold()


def _either(one: str, other: str) -> bool:
    return _matches(one, other) or _matches(other, one)


def _chosen(
    records: Sequence[TideRecord], station: str | None
) -> tuple[TideRecord, ...]:
    """Those of the station; a single record without a name is that of the station."""
    if station is None:
        return tuple(records)
    found = tuple(r for r in records if _matches(r.station, station))
    if not found and len(records) == 1 and not records[0].station:
        (only,) = records
        found = (TideRecord(only.time, only.elevation, station, datum=only.datum),)
    if not found:
        raise InputError(
            f'the observed levels have no station "{station}"; they have '
            + ", ".join(r.station or "one without a name" for r in records)
        )
    return found


def _predicted(
    table: TideTable, names: Sequence[str], start: str, end: str
) -> list[TideRecord]:
    """The astronomical tide of the gauges' own constants."""
    time = np.arange(seconds(start), seconds(end) + 0.5 * STEP, STEP)
    records = []
    for name in names:
        place = table.stations.index(name)
        records.append(
            TideRecord(
                time,
                tides.predict(table, time, place=place),
                f"{name}{_BY_CONSTANTS}",
                float(table.longitude_deg[place]),
                float(table.latitude_deg[place]),
            )
        )
    return records


def _place_of(table: TideTable, record: TideRecord, n_records: int) -> int:
    """Row of the gauge of a record: by its name, else the nearest one."""
    for k, name in enumerate(table.stations):
        if record.station and _either(name, record.station):
            return k
    near = _nearest(record, table.longitude_deg, table.latitude_deg)
    if near is not None:
        return near
    if n_records == 1 and len(table.longitude_deg) == 1:
        return 0
    raise InputError(
        f'the observed levels of "{record.station or "a station without name"}" belong '
        "to no gauge in the mesh: name it with --station; there are "
        + ", ".join(table.stations)
    )


def _same_station(records: Sequence[TideRecord], truth: TideRecord) -> TideRecord:
    for record in records:
        if record.station and truth.station and _either(record.station, truth.station):
            return record
    places = np.array([[r.longitude_deg, r.latitude_deg] for r in records])
    near = _nearest(truth, *places.T)
    if near is not None:
        return records[near]
    if len(records) == 1:
        return records[0]
    raise InputError(
        f'the modelled levels have no station "{truth.station}"; they have '
        + ", ".join(r.station for r in records)
    )


def _nearest(
    record: TideRecord, longitude_deg: np.ndarray, latitude_deg: np.ndarray
) -> int | None:
    """The place nearest to a record, if it is known to lie within some 2 km of it."""
    gap = np.hypot(
        (longitude_deg - record.longitude_deg)
        * np.cos(np.radians(record.latitude_deg)),
        latitude_deg - record.latitude_deg,
    )
    if not np.isfinite(gap).any() or np.nanmin(gap) > _SAME_PLACE_DEG:
        return None
    return int(np.nanargmin(gap))


# ---- figures --------------------------------------------------------------------


def _draw(
    folder: Path,
    mesh: CoastalMesh,
    constants: verification.ConstantsComparison,
    records: Sequence[verification.RecordComparison],
) -> list[Path]:
    # Loads matplotlib, which takes longer than the comparison.
    from tidemesh import plots

    draws = {
        "constants": lambda axis: plots.plot_constants(constants, axis=axis),
        "gauges": lambda axis: plots.plot_gauge_map(mesh, constants, axis=axis),
    }
    for record in records:
        name = "".join(c if c.isalnum() else "_" for c in record.station.lower())
        draws[f"levels_{name or 'station'}"] = lambda axis, record=record: (
            plots.plot_records(record, axis=axis)
        )
    paths = []
    for name, draw in draws.items():
        paths.append(folder / "figures" / f"{name}.png")
        paths[-1].parent.mkdir(parents=True, exist_ok=True)
        plots.save_figure(paths[-1], draw, dpi=150)
    return paths
