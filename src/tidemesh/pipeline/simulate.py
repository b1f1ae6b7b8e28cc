"""The nonlinear tide of a mesh in time (paper, section 4)."""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import msgspec
import numpy as np

import tidemesh
from tidemesh import tides
from tidemesh.datatypes import CoastalMesh, TideForcing
from tidemesh.errors import InputError
from tidemesh.io.tide_records import write_records
from tidemesh.io.tide_tables import read_tide_table
from tidemesh.io.ugrid import Field, write_ugrid
from tidemesh.pipeline.adcirc_case import read_adcirc_case, still_known
from tidemesh.pipeline.case import find_files, tide_files
from tidemesh.pipeline.examples import examples_folder
from tidemesh.pipeline.given_mesh import (
    check_mesh,
    require_driven,
    require_water,
    weir_notes,
)
from tidemesh.pipeline.info import on_a_conformal_map, read_mesh
from tidemesh.pipeline.solve import (
    TideCase,
    forcing_of_case,
    made_folder,
    read_tide_case,
    require_writable,
    write_constants,
    write_summary,
)
from tidemesh.pipeline.tide import (
    bottom_coefficient,
    check_tide_inputs,
    make_forcing,
    seconds,
)
from tidemesh.tides.time_domain import (
    SimulationResult,
    SimulationSettings,
    Station,
    simulate,
    stable_step,
)
from tidemesh.triangulation import locate

Progress = Callable[[float], None]

PAPER = {
    "friction_law": "quadratic",
    "drag_coefficient": 0.003,
    "tau0": 0.009,
    "finite_amplitude": True,
    "advection": True,
    "coriolis": "latitude",
}
"""Physics where neither a case nor a fort.15 says otherwise (paper, section 4)."""


class SimulationCase(TideCase, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """The sections of a case file that decide a simulation on a given mesh."""

    simulation: SimulationSettings = SimulationSettings()


def simulate_mesh(
    mesh: str | Path,
    *,
    output: str | Path,
    fort15: str | Path | None = None,
    fort13: str | Path | None = None,
    case: str | Path | None = None,
    table: str | Path | None = None,
    stations: str | Path | None = None,
    overrides: Sequence[str] = (),
    progress: Progress = lambda fraction: None,
) -> dict[str, Any]:
    """Run the tide of a mesh in time.

    Writes water levels at stations (``stations.nc``, ``stations.csv``), harmonic
    constants (``tide.nc``, ``fort.53``, ``fort.54``), the fields asked for
    (``fields.nc``), restart files and ``summary.json``. A run that was interrupted goes
    on from its restart file.

    Parameters
    ----------
    mesh : path
        fort.14 or UGRID.
    output : path
    fort15, fort13, case, table : path, optional
        As for `solve_mesh`; without a case or a fort.15 the physics of the paper's
        section 4.
    stations : path, optional
        Table of tide constants whose places are the stations; the shipped gauges if
        not given. Places off the mesh are left out.
    overrides : sequence of "section.key=value"
    progress : callable

    Returns
    -------
    summary : dict

    Raises
    ------
    InputError, MeshError, EngineError
    """
    started = time.perf_counter()
    given = read_mesh(mesh)
    check_mesh(given, Path(mesh))
    require_writable(output)
    if fort15 is not None:
        grid, forcing, settings, known, notes = _of_fort15(
            given, fort15, fort13, overrides
        )
    else:
        grid, forcing, settings, known = _of_case(given, case, table, overrides)
        notes = ()
    require_water(grid, Path(mesh))
    notes = [
        *notes,
        *weir_notes(grid),
        *require_driven(grid, Path(mesh), forcing.potential is not None),
    ]
    chosen, left_out = _stations(grid, stations, settings.simulation)
    folder = made_folder(output)
    restart = folder / "restart.npz"
    result = simulate(
        grid,
        forcing,
        settings.tide,
        settings.simulation,
        stations=chosen,
        folder=folder,
        restart=restart if restart.is_file() else None,
        progress=progress,
        **known,
    )
    if result.records:
        write_records(folder / "stations.csv", result.records)
    _write_maxima(folder, grid, result)
    summary = {
        "tidemesh": tidemesh.__version__,
        "mesh": str(mesh),
        "nodes": len(grid.points),
        "elements": len(grid.triangles),
        "constituents": [],
        "left_out": notes,
        "stations": [record.station for record in result.records],
        "stations_left_out": left_out,
        **_report(result),
        "settings": {
            "tide": msgspec.to_builtins(settings.tide),
            "simulation": msgspec.to_builtins(settings.simulation),
        },
        "seconds": round(time.perf_counter() - started, 3),
    }
    if result.constants is not None:
        summary["constituents"] = list(result.constants.names)
        summary["tide"] = {
            name: {"largest_amplitude_m": float(np.abs(row).max())}
            for name, row in zip(result.constants.names, result.constants.elevation)
        }
        write_constants(folder, grid, result.constants)
    write_summary(folder, summary)
    return summary


def _of_fort15(
    mesh: CoastalMesh,
    fort15: str | Path,
    fort13: str | Path | None,
    overrides: Sequence[str],
) -> tuple[CoastalMesh, TideForcing, SimulationCase, dict[str, Any], tuple[str, ...]]:
    theirs = read_adcirc_case(mesh, fort15, fort13)
    control = theirs.control
    physics = msgspec.structs.replace(
        theirs.settings,
        tau0=control.tau0 if control.tau0 > 0.0 else PAPER["tau0"],
        discretisation="gwce",
    )
    simulation = {
        "days": control.run_days,
        "ramp_days": control.ramp_days[0] if control.nramp else 0.0,
        "time_step_s": abs(control.time_step),
        "eddy_viscosity": max(control.eddy_viscosity, 0.0),
        "constituents": [c.name for c in control.harmonic],
    }
    data = {"tide": msgspec.to_builtins(physics), "simulation": simulation}
    settings = read_tide_case(None, overrides, kind=SimulationCase, start=data)
    known = still_known(theirs.known, physics, settings.tide)
    known = {k: v for k, v in known.items() if k in ("friction", "drag")}
    notes = [n for n in theirs.notes if not n.startswith("lateral eddy")]
    step = settings.simulation.time_step_s
    if step == abs(control.time_step):
        advice = stable_step(theirs.mesh, settings.simulation, settings.tide)
        if step > advice.step_s:
            # ADCIRC's gravity waves are implicit, these are not.
            notes.append(
                f"DTDP = {step:g} s is too long for explicit steps: "
                f"at most {advice.step_s:.3g} s, {advice.reason}"
            )
            shorter = msgspec.structs.replace(settings.simulation, time_step_s=0.0)
            settings = msgspec.structs.replace(settings, simulation=shorter)
    return theirs.mesh, theirs.forcing, settings, known, tuple(notes)


def _of_case(
    mesh: CoastalMesh,
    case: str | Path | None,
    table: str | Path | None,
    overrides: Sequence[str],
) -> tuple[CoastalMesh, TideForcing, SimulationCase, dict[str, Any]]:
    start = {"tide": dict(PAPER)} if case is None else {}
    settings = read_tide_case(
        case,
        overrides,
        kind=SimulationCase,
        sections=("title", "tide", "forcing", "adcirc", "simulation"),
        start=start,
    )
    forcing, folder = forcing_of_case(settings.forcing, case, table)
    files = find_files(tide_files(forcing, settings.tide), folder)
    check_tide_inputs(settings.tide, files)
    mesh = on_a_conformal_map(mesh)
    # Overtides grow by themselves, nodal factors are those of the run, and a fit to
    # gauges needs no more than friction.
    physics = msgspec.structs.replace(
        settings.tide,
        overtides=(),
        date=None,
        discretisation="galerkin",
        finite_amplitude=False,
        advection=False,
    )
    driven, _ = make_forcing(mesh, physics, forcing, files)
    if mesh.projection.crs:
        driven = _of_the_time(mesh, driven, settings.simulation)
    bottom = bottom_coefficient(mesh, settings.tide, files.get("tide.friction_file"))
    return mesh, driven, settings, bottom


def _of_the_time(
    mesh: CoastalMesh, forcing: TideForcing, settings: SimulationSettings
) -> TideForcing:
    begin = seconds(settings.start)
    latitude = float(mesh.projection.inverse(mesh.points)[:, 1].mean())
    middle = begin + 0.5 * 86400.0 * settings.days
    return tides.with_astronomy(forcing, begin, latitude, middle_s=middle)


def _stations(
    mesh: CoastalMesh, path: str | Path | None, settings: SimulationSettings
) -> tuple[list[Station], list[str]]:
    """Gauges in or near the mesh; the names of the others."""
    if path is None and not mesh.projection.crs:
        return [], []
    table = read_tide_table(
        examples_folder() / "south_carolina" / "data" / "gauges.csv"
        if path is None
        else path
    )
    places = mesh.projection.forward(table.longitude_deg, table.latitude_deg)
    near = np.isfinite(places).all(axis=1)
    _, _, distance = locate.Locator(mesh.points, mesh.triangles).nearest(places[near])
    near[near] = distance <= settings.station_distance_m
    names = table.stations or tuple(f"station {k + 1}" for k in range(len(near)))
    if path is not None and not near.any():
        raise InputError(
            f"{path}: none of its {len(near)} places lies within "
            f"{settings.station_distance_m / 1e3:g} km of the mesh (longitudes are "
            "positive to the east)"
        )
    chosen = [
        Station(names[k], float(table.longitude_deg[k]), float(table.latitude_deg[k]))
        for k in np.flatnonzero(near)
    ]
    left_out = [] if path is None else [names[k] for k in np.flatnonzero(~near)]
    return chosen, left_out


def _report(result: SimulationResult) -> dict[str, Any]:
    volume = result.volume
    return {
        "time_step_s": result.step_s,
        "steps": result.steps,
        "step_advice": dataclasses.asdict(result.advice),
        "highest_level_m": float(result.highest.max()),
        "fastest_current_m_s": float(result.fastest.max()),
        "volume_m3": [float(volume.min()), float(volume.max())],
        "nodes_held_at_minimum": int((result.films > 0).sum()),
        "water_added_m3": float(result.film_volume),
    }


def _write_maxima(folder: Path, mesh: CoastalMesh, result: SimulationResult) -> None:
    fields = [
        Field("highest_level", result.highest, "m", "highest water level"),
        Field("fastest_current", result.fastest, "m s-1", "largest speed"),
        Field(
            "held_at_minimum",
            result.films,
            "1",
            "steps at which the water column was held at the minimum",
        ),
    ]
    write_ugrid(folder / "maxima.nc", mesh, fields)
