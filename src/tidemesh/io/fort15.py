"""ADCIRC's control file, fort.15 (two-dimensional runs without weather).

One record a line, in a fixed order in which earlier values decide what follows; text
after the values of a line is a comment.
"""

from __future__ import annotations

import logging
from pathlib import Path

import numpy as np

from tidemesh.datatypes import CoastalMesh, TideForcing
from tidemesh.errors import InputError
from tidemesh.io._fort15_reading import listed_nodes, read_records
from tidemesh.io._fort15_writing import written_lines
from tidemesh.io._fortran import Records, read_bytes, writing
from tidemesh.io.control_file import (
    FLUX_TYPES,
    NETCDF_LINES,
    RAMP_VALUES,
    BoundaryConstituent,
    ControlFile,
    FluxConstituent,
    GlobalOutput,
    HarmonicConstituent,
    PotentialConstituent,
    StationOutput,
)

__all__ = [
    "FLUX_TYPES",
    "NETCDF_LINES",
    "RAMP_VALUES",
    "BoundaryConstituent",
    "ControlFile",
    "FluxConstituent",
    "GlobalOutput",
    "HarmonicConstituent",
    "PotentialConstituent",
    "StationOutput",
    "boundary_rows",
    "fort15_forcing",
    "read_fort15",
    "write_fort15",
]

logger = logging.getLogger(__name__)

_HARMLESS = (
    "metcontrol",
    "warnelevcontrol",
    "inundationoutputcontrol",
    "swanoutputcontrol",
)
"""Namelists that leave a tide without weather as it is."""


def read_fort15(path: str | Path, mesh: CoastalMesh | None = None) -> ControlFile:
    """Read the control file of a two-dimensional run without weather.

    Parameters
    ----------
    path : path
        May be gzipped.
    mesh : CoastalMesh, optional
        The mesh of the run. Without it the numbers of boundary rows are found from
        where the rows end.

    Returns
    -------
    control : ControlFile

    Raises
    ------
    FormatError
        If the file does not follow the format, does not belong to the mesh, or asks for
        what is not supported (weather and waves, three dimensions, transport,
        baroclinic terms); with the line.
    InputError
        If there is no such file.
    """
    path = Path(path)
    return read_records(Records(path, read_bytes(path)), mesh)


def write_fort15(path: str | Path, control: ControlFile) -> None:
    """Write a control file as ADCIRC (v45 to v56) reads it; gzipped if named .gz.

    Numbers are written so that the same doubles are read again; boundary phases with
    twelve decimals of a degree.

    Raises
    ------
    InputError
        If the file cannot be written.
    """
    lines = written_lines(control)
    text = "\n".join(lines) + "\n"
    with writing(Path(path)) as file:
        file.write(text.encode("utf-8", errors="surrogateescape"))


def fort15_forcing(control: ControlFile, mesh: CoastalMesh) -> TideForcing:
    """What drives the tide of an ADCIRC run, for the embedded engines.

    Constituents of the boundary come first, then those that only the tidal potential
    has (with elevation 0 at the boundary, as in ADCIRC). The potential counts where
    `control.ntip` is not 0; species by frequency as ADCIRC tells them apart.

    Parameters
    ----------
    control : ControlFile
    mesh : CoastalMesh
        Needs a projection where there is a tidal potential.

    Returns
    -------
    forcing : TideForcing
        With nodal factors, arguments, and the potential if there is one.

    Raises
    ------
    InputError
        If the boundary rows do not belong to the mesh, or constituents contradict each
        other.
    """
    nodes = mesh.open_nodes
    names = [c.name for c in control.forcing]
    frequency = [c.frequency for c in control.forcing]
    factor = [c.nodal_factor for c in control.forcing]
    argument = [c.argument_deg for c in control.forcing]
    elevation = [_at_nodes(c, mesh, nodes) for c in control.forcing]
    rows = control.potential if control.ntip else ()
    potential = np.zeros((len(names), len(mesh.points)), dtype=np.complex128)
    for row in rows:
        part = _equilibrium(row, mesh)
        if row.name in names:
            k = names.index(row.name)
            if abs(row.frequency - frequency[k]) > 1.0e-9:
                raise InputError(
                    f"constituent {row.name} has the frequency {row.frequency:.9g} "
                    f"rad/s in the tidal potential and {frequency[k]:.9g} at the open "
                    "boundary; make them equal, or call one by another name"
                )
            if factor[k] == 0.0:
                raise InputError(
                    f"constituent {row.name} has the nodal factor 0 at the open "
                    "boundary, so that its tidal potential cannot be scaled"
                )
            # One factor and one argument a constituent; the potential carries what is
            # different about its own.
            shift = np.exp(1j * np.radians(row.argument_deg - argument[k]))
            potential[k] += row.nodal_factor / factor[k] * shift * part
            continue
        names.append(row.name)
        frequency.append(row.frequency)
        factor.append(row.nodal_factor)
        argument.append(row.argument_deg)
        elevation.append(np.zeros(len(nodes), dtype=np.complex128))
        potential = np.concatenate([potential, part[None]])
    if not names:
        raise InputError(
            "the fort.15 has no periodic forcing (NBFR and NTIF are 0); elevations of "
            "a fort.19 are not supported"
        )
    if control.nffr is not None:
        logger.warning("the flow through river boundaries (NFFR) is left out")
    if control.ntip == 2:
        logger.warning("self-attraction and loading (NTIP 2, fort.24) are left out")
    for name in control.namelist_names:
        if name not in _HARMLESS:
            logger.warning("the namelist %s is left out", name)
    return TideForcing(
        names=tuple(names),
        frequency=np.array(frequency, dtype=np.float64),
        nodes=nodes,
        elevation=np.array(elevation, dtype=np.complex128).reshape(
            len(names), len(nodes)
        ),
        nodal_factor=np.array(factor, dtype=np.float64),
        argument=np.radians(np.array(argument, dtype=np.float64)),
        potential=potential if rows else None,
    )


def boundary_rows(mesh: CoastalMesh, elevation: np.ndarray) -> np.ndarray:
    """Values at the ocean nodes as rows of a fort.15.

    ADCIRC adds the rows of a node that stands in two open strings, so the second one
    is 0.

    Parameters
    ----------
    mesh : CoastalMesh
    elevation : (n_ocean,) complex array
        At `mesh.open_nodes`.

    Returns
    -------
    rows : (n_rows,) complex array
        A value for every node of every open string.
    """
    listed = listed_nodes(mesh)
    nodes = mesh.open_nodes
    order = np.argsort(nodes)
    rows = np.asarray(elevation)[order[np.searchsorted(nodes[order], listed)]]
    first = np.zeros(len(listed), dtype=bool)
    first[np.unique(listed, return_index=True)[1]] = True
    return np.where(first, rows, 0.0)


def _at_nodes(
    constituent: BoundaryConstituent, mesh: CoastalMesh, nodes: np.ndarray
) -> np.ndarray:
    rows = np.asarray(constituent.elevation)
    for listed in (listed_nodes(mesh), listed_nodes(mesh, repeat_first=True)):
        if len(listed) == len(rows):
            break
    else:
        raise InputError(
            f"constituent {constituent.name} has {len(rows)} boundary rows, the mesh "
            f"lists {len(listed_nodes(mesh))} open boundary nodes: this fort.15 does "
            "not belong to the mesh"
        )
    order = np.argsort(nodes)
    where = order[np.searchsorted(nodes[order], listed)]
    forced = np.bincount(where, weights=np.abs(rows) > 0.0, minlength=len(nodes))
    if (forced > 1).any():
        node = int(nodes[np.flatnonzero(forced > 1)[0]]) + 1
        logger.warning(
            "%s: node %d is listed twice at the open boundary; its rows are added up, "
            "as ADCIRC does",
            constituent.name,
            node,
        )
    real = np.bincount(where, weights=rows.real, minlength=len(nodes))
    imaginary = np.bincount(where, weights=rows.imag, minlength=len(nodes))
    return real + 1j * imaginary


def _equilibrium(row: PotentialConstituent, mesh: CoastalMesh) -> np.ndarray:
    """(n_points,) complex m, times the body-tide factor."""
    if not mesh.projection.crs:
        raise InputError(
            f"the tidal potential of {row.name} needs longitudes and latitudes, the "
            "mesh has none (ICS = 1)"
        )
    longitude, latitude = np.radians(mesh.projection.inverse(mesh.points)).T
    species = min(round(row.frequency / 7.0e-5), 2)
    cosine = np.cos(latitude)
    height = (1.5 * cosine**2 - 1.0, np.sin(2.0 * latitude), cosine**2)[species]
    size = row.amplitude * row.earth_tide_factor
    return size * height * np.exp(1j * species * longitude)
