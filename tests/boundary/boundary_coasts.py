"""Coasts on the bare plane, whose areas are known."""

from __future__ import annotations

import msgspec
import numpy as np
import shapely

from tidemesh.boundary import DomainSettings
from tidemesh.datatypes import Domain
from tidemesh.geometry.polygons import polygonal

WIDTH = 40_000.0
"""Half width of the box (m)."""


def case(**changes) -> DomainSettings:
    """A half disc of water of 30 km radius, south of a coast along y = 0."""
    values = {
        "shoreline": "synthetic",
        "box_deg": [-WIDTH, -WIDTH, WIDTH, WIDTH],
        "projection": "none",
        "min_spacing_m": 1000.0,
        "ocean": {
            "kind": "arc",
            "center_deg": [0.0, 0.0],
            "radius_deg": 30_000.0,
            "spacing_m": 2000.0,
        },
    }
    return msgspec.convert(values | changes, DomainSettings)


def half_plane() -> shapely.Polygon:
    return shapely.box(-WIDTH, 0.0, WIDTH, WIDTH)


def outline(domain: Domain) -> shapely.Polygon:
    first, *islands = (ring.points for ring in domain.rings)
    return shapely.Polygon(first, islands)


def gaps(points: np.ndarray) -> np.ndarray:
    return np.hypot(*(np.roll(points, -1, axis=0) - points).T)


def total(domain: Domain, action: str) -> float:
    return sum(e.area_m2 for e in domain.ledger if e.action == action)


def count(domain: Domain, action: str) -> int:
    return sum(e.action == action for e in domain.ledger)


def rough_line(rng: np.random.Generator, levels: int, roughness: float) -> np.ndarray:
    """Midpoint displacement between (0, 0) and (1, 0): a fractal coast."""
    points = np.array([[0.0, 0.0], [1.0, 0.0]])
    for _ in range(levels):
        step = np.diff(points, axis=0)
        normal = np.stack([-step[:, 1], step[:, 0]], axis=1)
        push = roughness * rng.uniform(-1.0, 1.0, (len(step), 1))
        middle = 0.5 * (points[1:] + points[:-1]) + push * normal
        merged = np.empty((len(points) + len(middle), 2))
        merged[::2], merged[1::2] = points, middle
        points = merged
    return points


def fractal_land(seed: int) -> shapely.Geometry:
    """A rough mainland with rough islands in front, some of them touching it."""
    rng = np.random.default_rng(seed)
    coast = rough_line(rng, 10, 0.45) * 2.0 * WIDTH - [WIDTH, 0.0]
    corners = [[WIDTH, WIDTH], [-WIDTH, WIDTH]]
    parts = [shapely.Polygon(np.concatenate([coast, corners]))]
    for _ in range(8):
        size = rng.uniform(500.0, 6000.0)
        angle = np.linspace(0.0, 2.0 * np.pi, 60, endpoint=False)
        radius = size * (1.0 + 0.4 * rng.uniform(-1.0, 1.0, 60))
        center = rng.uniform([-25_000.0, -15_000.0], [25_000.0, 3000.0])
        circle = np.stack([np.cos(angle), np.sin(angle)], axis=1)
        parts.append(shapely.Polygon(center + radius[:, None] * circle))
    parts = [shapely.make_valid(p, method="structure") for p in parts]
    box = shapely.box(-WIDTH, -WIDTH, WIDTH, WIDTH)
    return polygonal(shapely.intersection(shapely.union_all(parts), box))
