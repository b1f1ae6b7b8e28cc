"""A wavy bay with two islands, and its nodes on a roughly graded lattice."""

from __future__ import annotations

from functools import cache
from itertools import product

import numpy as np
import shapely
from scipy.spatial import cKDTree

from tidemesh.datatypes import Domain, Ring
from tidemesh.geometry.projection import Projection
from tidemesh.triangulation.domain import triangulate


def ring_of(radius, centre, number, *, clockwise, waves=0, height=0.0):
    angle = np.arange(number) * 2.0 * np.pi / number
    angle = -angle if clockwise else angle
    r = radius * (1.0 + height * np.sin(waves * angle))
    points = np.asarray(centre) + r[:, None] * np.stack(
        [np.cos(angle), np.sin(angle)], axis=1
    )
    return Ring(points, np.zeros(number))


@cache
def wavy_bay() -> Domain:
    return Domain(
        (
            ring_of(1000.0, (0, 0), 160, clockwise=False, waves=7, height=0.1),
            ring_of(80.0, (300, 100), 14, clockwise=True),
            ring_of(120.0, (-300, -200), 20, clockwise=True),
        ),
        Projection(),
    )


def spacing(points):
    return np.minimum(40.0 + 0.0004 * (1100.0 - np.hypot(*points.T)) ** 1.6, 80.0)


@cache
def rough_nodes(domain: Domain, seed: int = 0) -> np.ndarray:
    """Random nodes thinned to 0.7 of the spacing, clear of the boundary."""
    generator = np.random.default_rng(seed)
    shell, *holes = [ring.points for ring in domain.rings]
    water = shapely.Polygon(shell, holes)
    points = generator.uniform(-1200.0, 1200.0, (6000, 2))
    points = points[shapely.contains_xy(water, *points.T)]
    size = spacing(points)
    clear = shapely.distance(shapely.points(points), water.boundary) > 0.5 * size
    points, size = points[clear], size[clear]
    kept = np.ones(len(points), dtype=bool)
    tree = cKDTree(points)
    for i, near in enumerate(tree.query_ball_point(points, 0.7 * size)):
        if kept[i]:
            kept[[j for j in near if j > i]] = False
    return points[kept]


def rough_mesh(seed: int = 0):
    domain = wavy_bay()
    points, triangles = triangulate(domain, rough_nodes(domain, seed))
    fixed = np.zeros(len(points), dtype=bool)
    fixed[: sum(len(ring.points) for ring in domain.rings)] = True
    return domain, points, triangles, fixed


def hexagonal_patch(rings: int = 5):
    """Equilateral triangles in a hexagon: points, triangles, fixed."""
    i, j = np.meshgrid(np.arange(-rings, rings + 1), np.arange(-rings, rings + 1))
    i, j = i.ravel(), j.ravel()
    radius = np.maximum(np.maximum(abs(i), abs(j)), abs(i + j))
    i, j, radius = (a[radius <= rings] for a in (i, j, radius))
    points = np.stack([i + 0.5 * j, 0.5 * np.sqrt(3.0) * j], axis=1)
    number = {(a, b): k for k, (a, b) in enumerate(zip(i.tolist(), j.tolist()))}
    triangles = []
    for a, b in product(range(-rings - 1, rings + 1), repeat=2):
        for corners in (
            ((a, b), (a + 1, b), (a, b + 1)),
            ((a + 1, b), (a + 1, b + 1), (a, b + 1)),
        ):
            if all(corner in number for corner in corners):
                triangles.append([number[corner] for corner in corners])
    return points, np.array(triangles), radius == rings
