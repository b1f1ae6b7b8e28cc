"""Domains of known area."""

from __future__ import annotations

import numpy as np

from tidemesh.datatypes import LAND, Domain, Ring
from tidemesh.geometry.projection import Projection


def circle(radius, n_points, *, centre=(0.0, 0.0), island=False):
    angle = np.arange(n_points) * 2.0 * np.pi / n_points
    points = np.stack([np.cos(angle), np.sin(angle)], axis=1) * radius + centre
    return Ring(points[::-1] if island else points, np.full(n_points, LAND))


def disc(radius, spacing, *, projection=None, island_radius=0.0):
    """A disc, its boundary nodes `spacing` apart, perhaps with an island off centre."""
    rings = [circle(radius, round(2.0 * np.pi * radius / spacing))]
    if island_radius:
        count = round(2.0 * np.pi * island_radius / spacing)
        centre = (0.4 * radius, 0.1 * radius)
        rings.append(circle(island_radius, count, centre=centre, island=True))
    return Domain(tuple(rings), projection or Projection())


def far_from(points, domain):
    """Exact distance (m) of each point to the nearest boundary segment, all pairs."""
    best = np.full(len(points), np.inf)
    for ring in domain.rings:
        start, end = ring.points, np.roll(ring.points, -1, axis=0)
        for a, b in zip(start, end):
            along = np.clip((points - a) @ (b - a) / ((b - a) @ (b - a)), 0.0, 1.0)
            gap = np.hypot(*(points - a - along[:, None] * (b - a)).T)
            best = np.minimum(best, gap)
    return best
