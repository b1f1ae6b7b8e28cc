"""The domain of a rough coast: CPU seconds, and over one overlay of its land and box.

A mainland by midpoint displacement with rough islands; the last column is the ratio to
shapely's own union of the same land with a disc. One thread.

    python benchmarks/boundary.py [halvings ...]
"""

from __future__ import annotations

import sys
import time

import msgspec
import numpy as np
import shapely

from tidemesh.boundary import DomainSettings, build_domain

WIDTH = 40_000.0


def coast(halvings: int) -> shapely.Polygon:
    """A mainland whose coast has 2**halvings segments."""
    generator = np.random.default_rng(1)
    line = np.array([[-WIDTH, 0.0], [WIDTH, 0.0]])
    for _ in range(halvings):
        step = np.diff(line, axis=0)
        normal = np.stack([-step[:, 1], step[:, 0]], axis=1)
        shift = generator.uniform(-0.3, 0.3, len(step))[:, None]
        middle = 0.5 * (line[1:] + line[:-1]) + shift * normal
        line = np.insert(line, np.arange(1, len(line)), middle, axis=0)
    corners = [[WIDTH, WIDTH], [-WIDTH, WIDTH]]
    land = shapely.Polygon(np.concatenate([line, corners]))
    return shapely.make_valid(land, method="structure", keep_collapsed=False)


def settings(spacing: float) -> DomainSettings:
    """The water within 30 km."""
    values = {
        "shoreline": "synthetic",
        "box_deg": [-WIDTH, -WIDTH, WIDTH, WIDTH],
        "projection": "none",
        "min_spacing_m": spacing,
        "ocean": {"kind": "arc", "center_deg": [0.0, 0.0], "radius_km": 30.0},
    }
    return msgspec.convert(values, DomainSettings)


def main() -> None:
    build_domain(coast(8), settings(500.0))  # compiles
    disc = shapely.Point(0.0, 0.0).buffer(30_000.0, quad_segs=1800)
    print(f"{'vertices':>9} {'spacing m':>10} {'nodes':>7} {'CPU s':>7} {'ratio':>7}")
    for halvings in map(int, sys.argv[1:] or [12, 14, 15]):
        land = coast(halvings)
        start = time.process_time()
        shapely.union(land, disc)
        overlay = time.process_time() - start
        for spacing in (200.0, 500.0):
            start = time.process_time()
            domain = build_domain(land, settings(spacing))
            seconds = time.process_time() - start
            nodes = sum(len(ring.points) for ring in domain.rings)
            vertices = shapely.get_num_coordinates(land)
            print(
                f"{vertices:9d} {spacing:10.0f} {nodes:7d} {seconds:7.2f} "
                f"{seconds / overlay:7.1f}"
            )


if __name__ == "__main__":
    main()
