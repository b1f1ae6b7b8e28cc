"""The tide of a mesh that is there already: one file in, harmonic constants out."""

from __future__ import annotations

import dataclasses
import json
import os
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import msgspec

import tidemesh
from tidemesh.datatypes import CoastalMesh, TideForcing, TideSolution
from tidemesh.errors import ConvergenceError, InputError
from tidemesh.io.files import atomic
from tidemesh.io.fort53 import write_fort53, write_fort54
from tidemesh.io.ugrid import write_ugrid
from tidemesh.pipeline.adcirc_case import (
    read_adcirc_case,
    still_known,
    with_odd_overtides,
)
from tidemesh.pipeline.case import (
    ForcingSettings,
    apply_overrides,
    decode_case,
    find_files,
    read_toml,
    tide_files,
)
from tidemesh.pipeline.given_mesh import (
    check_mesh,
    require_driven,
    require_map,
    require_water,
    weir_notes,
)
from tidemesh.pipeline.info import on_a_conformal_map, read_mesh
from tidemesh.pipeline.runner import strict
from tidemesh.pipeline.tide import (
    check_tide_inputs,
    make_forcing,
    placed,
    solve_tide,
    tide_fields,
)
from tidemesh.tides.adcirc.settings import AdcircSettings
from tidemesh.tides.settings import TideSettings

Progress = Callable[[float], None]


class TideCase(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """The sections of a case file that decide a tide on a given mesh."""

    title: str = ""
    tide: TideSettings = TideSettings()
    forcing: ForcingSettings | None = None
    adcirc: AdcircSettings = AdcircSettings()


def read_tide_case(
    case: str | Path | None,
    overrides: Sequence[str] = (),
    *,
    kind: type = TideCase,
    sections: Sequence[str] = ("title", "tide", "forcing", "adcirc"),
    start: Mapping[str, Any] | None = None,
) -> Any:
    """The sections of a case file that matter here, the others left alone.

    Parameters
    ----------
    case : path, optional
    overrides : sequence of "section.key=value"
    kind : type
        Struct of the sections.
    sections : sequence of str
    start : mapping, optional
        What holds where the file and the overrides say nothing.

    Raises
    ------
    InputError
        If the file or a value cannot be used.
    """
    data: dict[str, Any] = dict(start or {})
    text = ""
    if case is not None:
        found, text = read_toml(case)
        data.update({name: found[name] for name in sections if name in found})
    apply_overrides(data, overrides)
    return decode_case(data, kind=kind, name=str(case or "--set"), text=text)


def solve_mesh(
    mesh: str | Path,
    *,
    output: str | Path,
    fort15: str | Path | None = None,
    fort13: str | Path | None = None,
    case: str | Path | None = None,
    table: str | Path | None = None,
    overrides: Sequence[str] = (),
    progress: Progress = lambda fraction: None,
) -> dict[str, Any]:
    """Solve the tide of a mesh and write ``tide.nc``, ``fort.53`` and ``fort.54``.

    Parameters
    ----------
    mesh : path
        fort.14 or UGRID.
    output : path
        Folder of the results.
    fort15, fort13 : path, optional
        An ADCIRC case: its constituents, boundary values, friction, rotation and map.
    case : path, optional
        A case file; its sections ``tide``, ``forcing`` and ``adcirc`` count.
    table : path, optional
        Harmonic constants for the ocean boundary, instead of a case file's.
    overrides : sequence of "section.key=value"
    progress : callable

    Returns
    -------
    summary : dict
        What ``summary.json`` holds.

    Raises
    ------
    InputError, MeshError, EngineError, ConvergenceError
        If an input cannot be used, or the tide cannot be solved.
    """
    started = time.perf_counter()
    given = read_mesh(mesh)
    check_mesh(given, Path(mesh))
    require_writable(output)
    summary: dict[str, Any] = {"tidemesh": tidemesh.__version__, "mesh": str(mesh)}
    output = Path(output)
    if fort15 is not None:
        if case is not None or table is not None:
            raise InputError(
                "a fort.15 brings its own forcing: leave out --case and --table"
            )
        solved, tide, report = _solve_adcirc_case(
            given, Path(mesh), fort15, fort13, overrides, output, progress
        )
    else:
        solved, tide, report = _solve_case(
            given, Path(mesh), case, table, overrides, output, progress
        )
    summary.update(
        nodes=len(solved.points),
        elements=len(solved.triangles),
        constituents=list(tide.names),
        **report,
    )
    summary["seconds"] = round(time.perf_counter() - started, 3)
    folder = made_folder(output)
    write_constants(folder, solved, tide)
    write_summary(folder, summary)
    return summary


def _solve_adcirc_case(
    mesh: CoastalMesh,
    path: Path,
    fort15: str | Path,
    fort13: str | Path | None,
    overrides: Sequence[str],
    output: Path,
    progress: Progress,
) -> tuple[CoastalMesh, TideSolution, dict[str, Any]]:
    theirs = read_adcirc_case(mesh, fort15, fort13)
    data = {"tide": msgspec.to_builtins(theirs.settings)}
    case = read_tide_case(None, overrides, start=data)
    files = find_files(tide_files(None, case.tide, case.adcirc), Path())
    forcing = chosen(theirs.forcing, case.tide, Path(fort15))
    notes = [
        *theirs.notes,
        *weir_notes(mesh),
        *require_driven(mesh, path, forcing.potential is not None),
    ]

    def solved(settings: TideSettings) -> tuple[TideSolution, dict[str, Any]]:
        longer, asked = with_odd_overtides(forcing, settings)
        tide, report = solve_tide(
            theirs.mesh,
            longer,
            settings,
            adcirc=case.adcirc,
            folder=output / "adcirc",
            friction_file=files.get("tide.friction_file"),
            progress=progress,
            **still_known(theirs.known, theirs.settings, settings),
        )
        if asked == len(longer.names):
            return tide, report
        tide = dataclasses.replace(
            tide,
            names=tide.names[:asked],
            frequency=tide.frequency[:asked],
            elevation=tide.elevation[:asked],
            velocity=tide.velocity[:asked],
            friction=tide.friction[:asked],
        )
        for name in longer.names[asked:]:
            del report[name]
        return tide, report

    try:
        tide, report = solved(case.tide)
    except ConvergenceError:
        if not case.tide.advection:
            raise
        tide, report = solved(msgspec.structs.replace(case.tide, advection=False))
        notes.append(
            "advection left out, since its harmonics do not converge in strong jets; "
            "behind narrow inlets M2 may be wrong by a tenth, and overtides and mean "
            "level are no guide: `tidemesh simulate` has all terms"
        )
    settings = msgspec.to_builtins(case.tide)
    return (
        theirs.mesh,
        tide,
        {
            "tide": report,
            "settings": settings,
            "left_out": notes,
        },
    )


def _solve_case(
    mesh: CoastalMesh,
    path: Path,
    case: str | Path | None,
    table: str | Path | None,
    overrides: Sequence[str],
    output: Path,
    progress: Progress,
) -> tuple[CoastalMesh, TideSolution, dict[str, Any]]:
    settings = read_tide_case(case, overrides)
    notes = weir_notes(mesh) + require_driven(mesh, path, settings.tide.tidal_potential)
    closed = len(mesh.open_nodes) == 0 and settings.tide.tidal_potential
    forcing, folder = forcing_of_case(settings.forcing, case, table, closed=closed)
    files = find_files(tide_files(forcing, settings.tide, settings.adcirc), folder)
    check_tide_inputs(settings.tide, files)
    require_map(mesh, path, settings.tide)
    require_water(mesh, path)
    # ADCIRC's map of degrees stretches; the plane of the equations must not.
    if settings.tide.metric in ("plane", "sphere"):
        mesh = on_a_conformal_map(mesh)
    driven, fitted = make_forcing(mesh, settings.tide, forcing, files)
    tide, report = solve_tide(
        mesh,
        driven,
        settings.tide,
        adcirc=placed(settings.adcirc, files),
        folder=output / "adcirc",
        friction_file=files.get("tide.friction_file"),
        progress=progress,
    )
    return (
        mesh,
        tide,
        {
            "tide": report,
            "settings": msgspec.to_builtins(settings.tide),
            **fitted,
            "left_out": notes,
        },
    )


def forcing_of_case(
    forcing: ForcingSettings | None,
    case: str | Path | None,
    table: str | Path | None,
    *,
    closed: bool = False,
) -> tuple[ForcingSettings | None, Path]:
    """Where the forcing comes from, and the folder where its paths start.

    None for a closed basin or the globe, which the tidal potential alone drives.
    """
    folder = Path(case).parent if case is not None else Path()
    if closed:
        return None, folder
    if table is not None:
        return ForcingSettings(table=str(Path(table).absolute())), folder
    if forcing is None:
        raise InputError(
            "nothing drives the tide: give --fort15 FILE, --table FILE with harmonic "
            "constants along the ocean boundary, or --case FILE with a section forcing"
        )
    return forcing, folder


def chosen(forcing: TideForcing, settings: TideSettings, path: Path) -> TideForcing:
    """The constituents of a fort.15 that the settings leave.

    Raises
    ------
    InputError
        If a driven one is wanted that the fort.15 does not have.
    """
    upper = [name.upper() for name in forcing.names]
    for name in settings.constituents:
        if name.upper() not in upper:
            raise InputError(
                f"{path}: no constituent {name}; it has {', '.join(forcing.names)}: "
                "change tide.constituents"
            )
    wanted = {name.upper() for name in (*settings.constituents, *settings.overtides)}
    kept = [k for k, name in enumerate(upper) if name in wanted]
    rows = {
        name: value[kept]
        for name in ("frequency", "elevation", "nodal_factor", "argument", "potential")
        if (value := getattr(forcing, name)) is not None
    }
    return dataclasses.replace(
        forcing, names=tuple(forcing.names[k] for k in kept), **rows
    )


def require_writable(output: str | Path) -> None:
    """Find before long work that the folder of the results cannot be made.

    Raises
    ------
    InputError
    """
    folder = Path(output).absolute()
    there = next(part for part in (folder, *folder.parents) if part.exists())
    if not there.is_dir() or not os.access(there, os.W_OK | os.X_OK):
        raise InputError(
            f"output folder {output} cannot be written ({there} is "
            f"{'read-only' if there.is_dir() else 'no folder'}); name another with "
            "--output"
        )


def made_folder(path: str | Path) -> Path:
    """The folder of the results, made if it is not there.

    Raises
    ------
    InputError
        If it cannot be made.
    """
    folder = Path(path)
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(
            f"output folder {folder} cannot be written ({error.strerror}); name "
            "another with --output"
        ) from None
    return folder


def write_constants(folder: Path, mesh: CoastalMesh, tide: TideSolution) -> None:
    """Write ``tide.nc``, ``fort.53`` and ``fort.54``."""
    write_ugrid(folder / "tide.nc", mesh, tide_fields(mesh, tide))
    write_fort53(folder / "fort.53", tide)
    # ADCIRC's velocities on a mesh in degrees are east and north.
    east_north = mesh.projection.east_north(mesh.points, tide.velocity)
    write_fort54(folder / "fort.54", dataclasses.replace(tide, velocity=east_north))


def write_summary(folder: Path, summary: dict[str, Any]) -> None:
    """Write ``summary.json``."""
    text = json.dumps(strict(summary), indent=2, allow_nan=False)
    with atomic(folder / "summary.json") as temporary:
        Path(temporary).write_text(text + "\n", encoding="utf-8")
