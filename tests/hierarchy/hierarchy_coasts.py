"""Synthetic domains: rectangles, and ragged coasts with islands and channels."""

from __future__ import annotations

from functools import cache
from itertools import pairwise

import numpy as np
import shapely

from tidemesh.datatypes import LAND, OCEAN, Domain, Ring
from tidemesh.geometry.projection import Projection


def domain_of(polygon: shapely.Polygon, is_ocean=None) -> Domain:
    """A domain from a polygon; segments with both ends on the ocean are open."""
    rings = []
    for number, line in enumerate([polygon.exterior, *polygon.interiors]):
        points = np.array(line.coords)[:-1]
        if line.is_ccw != (number == 0):
            points = points[::-1]
        kind = np.full(len(points), LAND)
        if number == 0 and is_ocean is not None:
            wet = is_ocean(points)
            kind[wet & np.roll(wet, -1)] = OCEAN
        rings.append(Ring(points, kind))
    return Domain(tuple(rings), Projection())


def rectangle(width: float, height: float) -> Domain:
    return domain_of(shapely.box(0.0, 0.0, width, height))


def polygon_of(domain: Domain) -> shapely.Polygon:
    shell, *holes = [ring.points for ring in domain.rings]
    return shapely.Polygon(shell, holes)


def ragged_line(start, end, halvings, roughness, generator) -> np.ndarray:
    line = np.array([start, end], dtype=float)
    for _ in range(halvings):
        step = np.diff(line, axis=0)
        normal = np.stack([-step[:, 1], step[:, 0]], axis=1)
        shift = generator.uniform(-roughness, roughness, len(step))[:, None]
        middle = 0.5 * (line[1:] + line[:-1]) + shift * normal
        line = np.insert(line, np.arange(1, len(line)), middle, axis=0)
    return line


@cache
def ragged_bay(seed: int, *, size: float = 50_000.0, islands: int = 8) -> Domain:
    """A square of sea; the western coast is ragged, with islands and river mouths."""
    generator = np.random.default_rng(seed)
    coast = ragged_line([0.0, size], [0.0, 0.0], 8, 0.4, generator)
    sea = shapely.make_valid(
        shapely.Polygon(np.vstack([coast, [[size, 0.0], [size, size]]]))
    )
    for _ in range(islands):
        centre = generator.uniform(0.05 * size, 0.7 * size, 2)
        angle = generator.uniform(0.0, 2.0 * np.pi) + np.arange(4) * 2.0 * np.pi / 3.0
        radius = generator.uniform(0.01, 0.08) * size
        corner = centre + radius * np.stack([np.cos(angle), np.sin(angle)], axis=1)
        shore = [ragged_line(a, b, 5, 0.4, generator)[:-1] for a, b in pairwise(corner)]
        sea = sea.difference(shapely.make_valid(shapely.Polygon(np.concatenate(shore))))
    # Rivers into the land, and no water narrower than they are.
    for _ in range(3):
        mouth = coast[generator.integers(20, len(coast) - 20)]
        river = ragged_line(mouth, mouth - [0.3 * size, 0.0], 5, 0.3, generator)
        sea = sea.union(shapely.LineString(river).buffer(0.006 * size))
    sea = sea.buffer(-0.002 * size).buffer(0.002 * size, quad_segs=2)
    parts = shapely.get_parts(sea)
    sea = parts[shapely.area(parts).argmax()]
    holes = [hole for hole in sea.interiors if shapely.Polygon(hole).area > 1e4]
    sea = shapely.Polygon(sea.exterior, holes)
    sea = shapely.Polygon(sea).simplify(0.0002 * size)
    edge = 1e-6 * size

    def is_ocean(points):
        return (points[:, 0] > size - edge) | (
            (points[:, 0] > 0.5 * size)
            & ((points[:, 1] < edge) | (points[:, 1] > size - edge))
        )

    return domain_of(sea, is_ocean)
