"""The finished mesh beside the base grid and beside gauges."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from tidemesh import verification
from tidemesh.datatypes import CoastalMesh, TideSolution, TideTable
from tidemesh.triangulation import locate, quality


def compare_with_base(
    base: CoastalMesh,
    base_tide: TideSolution,
    mesh: CoastalMesh,
    tide: TideSolution,
    shore_distance: np.ndarray,
    strip_width: float,
) -> dict[str, Any]:
    """Relative L2 difference of the complex elevation on the nodes of the base grid.

    Parameters
    ----------
    base, base_tide : CoastalMesh, TideSolution
        The base grid and its tide.
    mesh, tide : CoastalMesh, TideSolution
        The finished mesh and its tide.
    shore_distance : (n_base_points,) array
        m, of the nodes of the base grid from land.
    strip_width : float
        m, the near-shore strip, outside which the paper compares.

    Returns
    -------
    report : dict
        For every constituent the difference over all nodes and outside the strip.
    """
    locator = locate.Locator(mesh.points, mesh.triangles)
    there = locator.interpolate(tide.elevation, base.points)
    area = np.bincount(
        base.triangles.ravel(),
        np.repeat(quality.area(base.points, base.triangles) / 3.0, 3),
        len(base.points),
    )
    offshore = shore_distance > strip_width
    report: dict[str, Any] = {"strip_width_m": strip_width}
    for c, name in enumerate(tide.names):
        report[name] = {
            "relative_l2": _relative_l2(there[c], base_tide.elevation[c], area),
            "relative_l2_outside_strip": _relative_l2(
                there[c][offshore], base_tide.elevation[c][offshore], area[offshore]
            )
            if offshore.any()
            else None,
        }
    report["base_nodes_per_node"] = len(base.points) / len(mesh.points)
    return report


def _relative_l2(ours: np.ndarray, reference: np.ndarray, weight: np.ndarray) -> float:
    size = float(weight @ np.abs(reference) ** 2)
    return math.sqrt(float(weight @ np.abs(ours - reference) ** 2) / size)


def compare_with_gauges(
    mesh: CoastalMesh, tide: TideSolution, table: TideTable
) -> dict[str, Any]:
    """Modelled and observed constants at the gauges that lie in or near the mesh.

    Returns
    -------
    report : dict
        As `ConstantsComparison.as_dict`; empty if there is nothing to compare.
    """
    served = verification.constants_at_gauges(mesh, tide, table)
    if len(served.table.longitude_deg) == 0:
        return {}
    names = [name for name in tide.names if name in table.names]
    if not names:
        return {}
    return verification.compare_constants(
        served.table, table, names=names, distance_m=served.distance_m
    ).as_dict()
