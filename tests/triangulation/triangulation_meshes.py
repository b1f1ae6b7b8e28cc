"""Domains and meshes made from a seed, for the tests of this room and of io."""

import numpy as np
import shapely

from tidemesh.datatypes import LAND, OCEAN, Domain, Ring
from tidemesh.geometry.projection import Projection
from tidemesh.triangulation.domain import triangulate

ISLAND_PLACES = 400.0 * np.array([[1.0, 0.0], [-1.0, 0.3], [0.0, -1.0], [0.0, 1.0]])


def circle(centre, radius, n, clockwise=False):
    angle = 2.0 * np.pi * np.arange(n) / n
    points = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    if clockwise:
        points = points[::-1]
    return np.asarray(centre) + radius * points


def bay(seed=0, islands=1, kinds="mixed", projection=None):
    """A wavy star-shaped outer ring of 60 points, with islands of 12 points."""
    rng = np.random.default_rng(seed)
    n = 60
    angle = 2.0 * np.pi * np.arange(n) / n
    wave = 1.0 + 0.12 * np.sin(3 * angle + rng.uniform(0, 6)) + rng.uniform(0, 0.05, n)
    outer = 1000.0 * np.stack([wave * np.cos(angle), wave * np.sin(angle)], axis=1)
    kind = np.full(n, OCEAN if kinds == "ocean" else LAND)
    if kinds == "mixed":
        # Two open strings; one runs over the end of the ring.
        kind[:9] = kind[54:] = OCEAN
        kind[30:36] = OCEAN
    rings = [Ring(outer, kind)]
    for place in ISLAND_PLACES[:islands]:
        points = circle(place, rng.uniform(60.0, 120.0), 12, clockwise=True)
        rings.append(Ring(points, np.full(12, LAND)))
    return Domain(tuple(rings), projection or Projection())


def polygon(domain):
    return shapely.Polygon(
        domain.rings[0].points, [ring.points for ring in domain.rings[1:]]
    )


def random_interior(domain, n, seed=0):
    rng = np.random.default_rng(seed)
    points = rng.uniform(-1200.0, 1200.0, (n, 2))
    inside = shapely.contains_xy(polygon(domain).buffer(-1.0), *points.T)
    return points[inside]


def mesh(seed=0, islands=1, n=400, **options):
    domain = bay(seed, islands, **options)
    points, triangles = triangulate(domain, random_interior(domain, n, seed))
    return domain, points, triangles
