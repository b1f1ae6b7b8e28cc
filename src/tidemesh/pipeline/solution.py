"""Tides that were solved before, by this program or by ADCIRC."""

from __future__ import annotations

import logging
from pathlib import Path

import numpy as np
from scipy.spatial import cKDTree

from tidemesh import tides
from tidemesh.datatypes import CoastalMesh, TideSolution
from tidemesh.errors import FormatError, InputError
from tidemesh.io.fort53 import (
    HarmonicConstants,
    read_fort53,
    read_fort54,
    require_nodes,
)
from tidemesh.io.ugrid import read_ugrid
from tidemesh.pipeline.tide import solution_of
from tidemesh.tides.settings import TideSettings

log = logging.getLogger(__name__)

_OURS = ("mesh_tide.nc", "tide.nc")
_THEIRS = ("fort.53", "fort.53.nc", "fort.53.gz")


def find_solution(path: str | Path) -> Path:
    """The file of a solution: itself, or the one that a folder holds.

    Raises
    ------
    InputError
        If there is none.
    """
    path = Path(path)
    if path.is_dir():
        for name in (*_OURS, *_THEIRS):
            if (path / name).is_file():
                return path / name
        raise InputError(
            f"{path}: holds no solution; expected one of "
            + ", ".join((*_OURS, *_THEIRS))
        )
    if not path.is_file():
        raise InputError(f"{path}: no such file or folder")
    return path


def read_solution(
    path: str | Path,
    mesh: CoastalMesh | None = None,
    settings: TideSettings | None = None,
) -> tuple[CoastalMesh, TideSolution]:
    """Read a tide: our NetCDF, or ADCIRC's fort.53 with the fort.54 beside it.

    Parameters
    ----------
    path : path
        File, or a folder that holds one.
    mesh : CoastalMesh, optional
        The mesh of the solution; our NetCDF brings its own.
    settings : TideSettings, optional
        Friction and rotation, which fort.53 does not tell. Without a fort.54 the
        velocities follow from the elevation by the linear momentum equation.

    Returns
    -------
    mesh : CoastalMesh
    tide : TideSolution

    Raises
    ------
    FormatError
        If the file does not follow its format, or belongs to another mesh.
    InputError
        If there is no such file, or a mesh is needed and not given.
    """
    path = find_solution(path)
    if path.suffix == ".nc":
        own = _read_ours(path, mesh, settings)
        if own is not None:
            return own
    if mesh is None:
        raise InputError(f"{path}: fort.53 holds no mesh: name the fort.14 as well")
    return mesh, _read_adcirc(path, mesh, settings or TideSettings())


def _read_ours(
    path: Path, mesh: CoastalMesh | None, settings: TideSettings | None
) -> tuple[CoastalMesh, TideSolution] | None:
    try:
        own, fields = read_ugrid(path)
    except FormatError:
        # ADCIRC's NetCDF names its mesh in an older way.
        return None
    tide = solution_of(own, fields, settings)
    if tide is None:
        return None
    if mesh is not None and len(mesh.points) != len(own.points):
        raise FormatError(
            f"the solution has {len(own.points)} nodes, the mesh {len(mesh.points)}: "
            "they do not belong together",
            path,
        )
    return own, tide


def _read_adcirc(path: Path, mesh: CoastalMesh, settings: TideSettings) -> TideSolution:
    elevation = _filled(read_fort53(path), mesh, path)
    beside = path.with_name(path.name.replace("53", "54", 1))
    if path.name.startswith("fort.53") and beside.is_file():
        velocity = _filled(read_fort54(beside), mesh, beside)
        if velocity.names != elevation.names:
            raise FormatError(
                f"its constituents ({', '.join(velocity.names)}) are not those of "
                f"{path.name} ({', '.join(elevation.names)})",
                beside,
            )
        uv = mesh.projection.from_east_north(mesh.points, velocity.values)
    else:
        log.warning("%s: no fort.54 beside it: velocities from the elevation", path)
        uv = None
    return tides.complete_solution(
        mesh, elevation.names, elevation.frequency, elevation.values, uv, settings
    )


def _filled(
    constants: HarmonicConstants, mesh: CoastalMesh, path: Path
) -> HarmonicConstants:
    """The constants, those of dry nodes taken from the nearest wet one."""
    n = len(mesh.points)
    require_nodes(constants, n, path)
    dry = ~np.isfinite(constants.values).reshape(len(constants.names), n, -1)
    dry = dry.any(axis=(0, 2))
    if not dry.any():
        return constants
    if dry.all():
        raise FormatError("every node is dry", path)
    log.warning("%s: %d dry nodes take the nearest wet value", path, int(dry.sum()))
    wet = np.flatnonzero(~dry)
    nearest = wet[cKDTree(mesh.points[wet]).query(mesh.points[dry])[1]]
    values = constants.values.copy()
    values[:, dry] = values[:, nearest]
    return constants._replace(values=values)
