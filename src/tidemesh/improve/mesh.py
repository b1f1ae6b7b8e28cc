"""From nodes to a finished mesh: triangulate, smooth, clean."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from tidemesh.datatypes import Domain
from tidemesh.improve.clean import clean
from tidemesh.improve.polish import flip_poor, raise_worst
from tidemesh.improve.settings import ImproveSettings
from tidemesh.improve.smooth import smooth
from tidemesh.triangulation.domain import triangulate

Spacing = Callable[[np.ndarray], np.ndarray]


def improve_mesh(
    domain: Domain,
    interior: np.ndarray,
    spacing: Spacing,
    settings: ImproveSettings | None = None,
    *,
    nodes: int | None = None,
    progress: Callable[[float], None] | None = None,
) -> tuple[np.ndarray, np.ndarray, dict[str, float]]:
    """Triangulate a domain and improve the mesh; its boundary stays as it is.

    Parameters
    ----------
    domain : Domain
        The rings, as they shall appear in the mesh.
    interior : (n, 2) float array
        m, nodes strictly inside.
    spacing : callable
        Target edge length at points: (n, 2) m -> (n,) m.
    settings : ImproveSettings, optional
    nodes : int, optional
        Number of nodes to end with, a few percent off the number given at most; the
        cleaning removes or inserts the difference, as far as sides too short or too
        long allow. The given number by default.
    progress : callable, optional
        Called with the fraction done.

    Returns
    -------
    points : (n_points, 2) float array
        m, the ring points first, ring after ring, then interior nodes.
    triangles : (n_triangles, 3) int64 array
        Counter-clockwise.
    report : dict
        What every step changed.
    """
    settings = settings or ImproveSettings()
    points, triangles = triangulate(domain, interior)
    # Triangles in the order of their nodes: the sweeps below then read memory in order.
    triangles = triangles[np.argsort(triangles.max(axis=1), kind="stable")]
    wanted = len(points) if nodes is None else nodes
    n_fixed = sum(len(ring.points) for ring in domain.rings)
    size = np.asarray(spacing(points), dtype=np.float64)
    report = {"moves": 0.0, "refused_moves": 0.0, "flips": 0.0}
    report |= {"removed": 0.0, "inserted": 0.0}

    for number in range(settings.rounds):
        fixed = np.arange(len(points)) < n_fixed
        smoothed = smooth(points, triangles, fixed, settings, size=size)
        points, triangles = smoothed.points, smoothed.triangles
        _add(report, smoothed.report)
        if progress is not None:
            progress((number + 1) / (settings.rounds + 1))
        if settings.clean and number + 1 < settings.rounds:
            if number == 0:
                # Later moves are too small to change the size at a node.
                size = np.asarray(spacing(points), dtype=np.float64)
            cleaned = clean(
                points, triangles, fixed, settings, size=size, wanted=wanted
            )
            points, triangles = cleaned.points, cleaned.triangles
            _add(report, cleaned.report)
            new = cleaned.source < 0
            size = size[cleaned.source]
            if new.any():
                size[new] = spacing(points[new])
    if settings.clean:
        fixed = np.arange(len(points)) < n_fixed
        triangles, flips = flip_poor(points, triangles, settings.poor_quality)
        points, searched = raise_worst(points, triangles, fixed, settings.poor_quality)
        report |= {"shape_flips": float(flips), "searched": float(searched)}
    if progress is not None:
        progress(1.0)
    return points, triangles, report


def _add(report: dict[str, float], part: dict[str, float]) -> None:
    for name, count in part.items():
        report[name] += count
