"""What a mesh that the user brings must have before a tide is solved on it."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from tidemesh.datatypes import CoastalMesh
from tidemesh.errors import InputError
from tidemesh.io.fort14 import EXTRA_COLUMNS
from tidemesh.pipeline.info import goes_round_the_globe
from tidemesh.tides.settings import TideSettings
from tidemesh.triangulation import topology

APART = "triangle apart from the largest part"
"""A fault of a mesh by which a tide is not spoilt: lakes, polders behind weirs."""
_PERIODIC = 94
WEIRS = tuple(ibtype for ibtype in EXTRA_COLUMNS if ibtype != _PERIODIC)
"""IBTYPE of boundaries that water may flow over."""


def check_mesh(mesh: CoastalMesh, path: Path) -> None:
    """Refuse a mesh on which no tide can be solved.

    Raises
    ------
    InputError
    """
    faults = topology.check_mesh(mesh.points, mesh.triangles, mesh.depth)
    tolerated = {APART}
    if goes_round_the_globe(mesh):
        # Triangles across the edge of the map lie over all the others.
        tolerated.add("overlapping triangles")
    found = [str(fault) for fault in faults if fault.name not in tolerated]
    if found:
        raise InputError(f"{path}: the mesh is not valid: " + "; ".join(found))


def require_water(mesh: CoastalMesh, path: Path) -> None:
    """Refuse nodes without water: nothing here falls dry.

    Raises
    ------
    InputError
    """
    dry = np.flatnonzero(mesh.depth <= 0.0)
    if not len(dry):
        return
    x, y = mesh.projection.inverse(mesh.points[dry[0]])
    raise InputError(
        f"{path}: {len(dry)} nodes have no water, the first is node {dry[0] + 1} at "
        f"({x:.6g}, {y:.6g}) with a depth of {mesh.depth[dry[0]]:g} m: give them water "
        "in the mesh, or a fort.15, whose H0 is the least depth"
    )


def require_driven(mesh: CoastalMesh, path: Path, potential: bool) -> list[str]:
    """Refuse a mesh that nothing drives; say which parts of it nothing reaches.

    Parameters
    ----------
    mesh : CoastalMesh
    path : path
        For the message.
    potential : bool
        Whether the astronomical forces act on every node.

    Returns
    -------
    notes : list of str

    Raises
    ------
    InputError
    """
    if potential:
        return []
    if len(mesh.open_nodes) == 0:
        raise InputError(
            f"{path}: the mesh has no open boundary string to drive it, and the tidal "
            "potential is not asked for (NTIP in the fort.15, or tide.tidal_potential)"
        )
    parts, part = topology.connected_components(mesh.triangles)
    if parts == 1:
        return []
    part_of_node = np.empty(len(mesh.points), dtype=np.int64)
    part_of_node[mesh.triangles] = part[:, None]
    still = np.setdiff1d(np.arange(parts), part_of_node[mesh.open_nodes])
    if not len(still):
        return []
    return [
        f"{len(still)} of {parts} parts of the mesh, {int(np.isin(part, still).sum())} "
        "triangles, have no open boundary: they stay at rest"
    ]


def weir_notes(mesh: CoastalMesh) -> list[str]:
    """What is said of weirs and of boundaries with prescribed flow."""
    weirs = sum(string.ibtype in WEIRS for string in mesh.boundaries)
    return [f"{weirs} weirs are walls that nothing overtops"] if weirs else []


def require_map(mesh: CoastalMesh, path: Path, settings: TideSettings) -> None:
    """Refuse to solve on a flat map a mesh that the map tears apart.

    Raises
    ------
    InputError
    """
    if settings.metric != "geographic" and goes_round_the_globe(mesh):
        raise InputError(
            f"{path}: the mesh goes round the globe, and no flat map holds it: use "
            'tide.metric = "geographic"'
        )
