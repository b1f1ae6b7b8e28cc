"""Node moves under an orientation guard, alternating with re-triangulation."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tidemesh.improve import _kernels
from tidemesh.improve.settings import ImproveSettings
from tidemesh.triangulation import quality

MAXIMUM_FLIP_SWEEPS = 200


@dataclass(frozen=True, eq=False)
class Smoothed:
    """A smoothed mesh and what was done."""

    points: np.ndarray
    """(n_points, 2) m."""
    triangles: np.ndarray
    """(n_triangles, 3) counter-clockwise."""
    report: dict[str, float]
    """Moves, refused moves and flipped sides."""


def smooth(
    points: np.ndarray,
    triangles: np.ndarray,
    fixed: np.ndarray,
    settings: ImproveSettings | None = None,
    *,
    size: np.ndarray | None = None,
) -> Smoothed:
    """Smooth a mesh: sweeps of node moves, sides flipped to Delaunay after each.

    Parameters
    ----------
    points : (n_points, 2) float array
        m.
    triangles : (n_triangles, 3) int array
        Counter-clockwise.
    fixed : (n_points,) bool array
        Nodes that stay; those of the boundary must be among them.
    settings : ImproveSettings, optional
        Method, number of sweeps and quality floor.
    size : (n_points,) float array, optional
        m, target spacing at the nodes; equal everywhere if left out.

    Returns
    -------
    Smoothed
        New arrays. No triangle turns over. A move never takes a triangle below both
        its node's worst and the floor (or the mesh's worst, if that is higher).

    Notes
    -----
    Sides of the boundary are never flipped, so a constrained Delaunay triangulation
    remains one (docs/method.md, section 7). Nodes move one after the other, in
    order: the result does not depend on threads.
    """
    settings = settings or ImproveSettings()
    points = np.array(points, dtype=np.float64)
    triangles = np.array(triangles, dtype=np.int64)
    size = np.ones(len(points)) if size is None else np.asarray(size, dtype=np.float64)
    fixed = np.asarray(fixed, dtype=bool)
    worst = float(quality.shape_quality(points, triangles).min(initial=1.0))
    floor = max(settings.quality_floor, worst)

    report = {"moves": 0.0, "refused_moves": 0.0, "flips": 0.0}
    neighbours = _kernels.find_neighbours(triangles, len(points))
    incident = np.empty(len(points), dtype=np.int64)
    awake = np.ones(len(points), dtype=bool)
    springs = settings.method == "springs"
    for _ in range(settings.sweeps):
        incident[triangles] = np.arange(len(triangles))[:, None]
        incident[fixed] = -1
        moved, refused = _kernels.move_nodes(
            points, triangles, neighbours, incident, awake, size, springs, floor
        )
        report["moves"] += moved
        report["refused_moves"] += refused
        report["flips"] += _kernels.flip_to_delaunay(
            points, triangles, neighbours, awake, MAXIMUM_FLIP_SWEEPS
        )
    return Smoothed(points, triangles, report)
