"""From a domain and depths to the base grid (paper, section 3.2)."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from tidemesh.basegrid.depths import DepthReport, sample_depths
from tidemesh.basegrid.points import build_base_points
from tidemesh.basegrid.settings import BaseGridSettings, DepthSettings
from tidemesh.datatypes import CoastalMesh, Domain, Raster, Soundings
from tidemesh.triangulation import domain as domain_triangulation


def build_base_grid(
    domain: Domain,
    sources: Sequence[Raster | Soundings],
    settings: BaseGridSettings | None = None,
    depth_settings: DepthSettings | None = None,
    *,
    progress: Callable[[float], None] | None = None,
) -> tuple[CoastalMesh, DepthReport]:
    """Fill a domain with points, triangulate, and put depths on the nodes.

    Parameters
    ----------
    domain : Domain
    sources : sequence of Raster and Soundings
        In order of priority.
    settings : BaseGridSettings, optional
    depth_settings : DepthSettings, optional
    progress : callable, optional
        Called with the fraction done.

    Returns
    -------
    mesh : CoastalMesh
        The boundary nodes first, ring after ring.
    report : DepthReport
        Where the depths came from.

    Raises
    ------
    InputError
        If the sources do not serve the domain.
    MeshError
        If the domain cannot be triangulated.
    """
    tell = (lambda fraction: None) if progress is None else progress
    interior = build_base_points(domain, settings)
    tell(0.3)
    points, triangles = domain_triangulation.triangulate(domain, interior)
    tell(0.5)
    depth, report = sample_depths(
        points,
        domain.projection,
        sources,
        depth_settings,
        spacing=node_spacing(points, triangles),
    )
    mesh = CoastalMesh(
        points,
        triangles,
        depth,
        domain_triangulation.boundary_strings(domain),
        domain.projection,
    )
    tell(1.0)
    return mesh, report


def node_spacing(points: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """Mean length of the edges that meet at each node: (n_points,) m."""
    total = np.zeros(len(points))
    for corner in range(3):
        start, end = triangles[:, corner], triangles[:, (corner + 1) % 3]
        length = np.hypot(*(points[end] - points[start]).T)
        total += np.bincount(start, length, len(points))
        total += np.bincount(end, length, len(points))
    # Every triangle adds two edge ends at each of its corners.
    count = 2 * np.bincount(triangles.ravel(), minlength=len(points))
    return total / np.maximum(count, 1)
