"""Base grid: points, triangulation and depths on a round sea with a fine coast.

CPU seconds, one thread; the last column is all of it over scipy's Delaunay
triangulation of the same points.

    python benchmarks/base_grid.py [nodes ...]
"""

from __future__ import annotations

import math
import sys
import time

import numpy as np
from scipy.spatial import Delaunay

from tidemesh.basegrid import BaseGridSettings, build_base_points, sample_depths
from tidemesh.basegrid.base_grid import node_spacing
from tidemesh.datatypes import LAND, Domain, Raster, Ring
from tidemesh.geometry.projection import Projection
from tidemesh.triangulation.domain import triangulate

RADIUS = 100_000.0


def sea(spacing: float) -> Domain:
    """A lobed sea, its boundary nodes at 0.6 of the lattice spacing."""
    angle = np.linspace(0.0, math.tau, round(math.tau * RADIUS / spacing / 0.6) + 1)[
        :-1
    ]
    radius = RADIUS * (1.0 + 0.05 * np.sin(7.0 * angle) + 0.01 * np.sin(40.0 * angle))
    points = radius[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    return Domain((Ring(points, np.full(len(points), LAND)),), Projection())


def bed(cells: int = 1_500) -> Raster:
    """A shelf that deepens outwards, with land in one corner."""
    axis = np.linspace(-1.2 * RADIUS, 1.2 * RADIUS, cells)
    x, y = np.meshgrid(axis, axis)
    return Raster(axis, axis, -30.0 - 4e-4 * x - 9e-9 * y * y, "", "bed")


def main() -> None:
    nodes = [int(n) for n in sys.argv[1:]] or [70_000, 300_000]
    raster = bed()
    # Compiled code and libraries are loaded before the clock runs.
    build_base_points(sea(20_000.0), BaseGridSettings(spacing_m=20_000.0))
    print("  nodes   points  triangles  depths at  mean    all   / Qhull")
    for wanted in nodes:
        area = math.pi * RADIUS**2
        spacing = math.sqrt(2.0 / math.sqrt(3.0) * area / wanted)
        domain = sea(spacing)
        settings = BaseGridSettings(spacing_m=spacing)
        clock = [time.process_time()]
        interior = build_base_points(domain, settings)
        clock.append(time.process_time())
        points, triangles = triangulate(domain, interior)
        clock.append(time.process_time())
        sample_depths(points, domain.projection, [raster])
        clock.append(time.process_time())
        around = 4.0 * node_spacing(points, triangles)
        sample_depths(points, domain.projection, [raster], spacing=around)
        clock.append(time.process_time())
        Delaunay(points)
        qhull = time.process_time() - clock[-1]
        taken = np.diff(clock)
        print(
            f"{len(points):7d}   {taken[0]:6.2f}  {taken[1]:9.2f}  {taken[2]:9.2f}  "
            f"{taken[3]:4.2f}  {taken.sum():5.2f}   {taken.sum() / qhull:7.2f}"
        )


if __name__ == "__main__":
    main()
