"""Nodes per second of every stage of mesh generation, and the quality reached.

A bay with a ragged coast and islands; the size grows off a point of the coast. One
thread, CPU seconds; the last column of the table is the time of scipy's Delaunay
triangulation of the same points over that of all stages.

    python benchmarks/mesh_generation.py [nodes ...]
"""

from __future__ import annotations

import sys
import time

import numpy as np
import scipy.spatial

from tidemesh import hierarchy, improve
from tidemesh.datatypes import LAND, OCEAN, Domain, Ring
from tidemesh.geometry.projection import Projection
from tidemesh.triangulation import quality
from tidemesh.triangulation.domain import triangulate

WIDTH = 100_000.0


def ragged(start, end, halvings, roughness, generator):
    """Midpoint displacement between two points, the end left out."""
    line = np.array([start, end], dtype=float)
    for _ in range(halvings):
        step = np.diff(line, axis=0)
        normal = np.stack([-step[:, 1], step[:, 0]], axis=1)
        shift = generator.uniform(-roughness, roughness, len(step))[:, None]
        middle = 0.5 * (line[1:] + line[:-1]) + shift * normal
        line = np.insert(line, np.arange(1, len(line)), middle, axis=0)
    return line[:-1]


def bay(generator) -> Domain:
    """A square of sea with a ragged western coast and islands."""
    corners = WIDTH * np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    coast = ragged(corners[3], corners[0], 9, 0.18, generator)
    outer = np.concatenate([coast, corners[:3]])
    kind = np.full(len(outer), LAND)
    kind[len(coast) :] = OCEAN
    rings = [Ring(outer, kind)]
    for centre in WIDTH * np.array([[0.45, 0.2], [0.4, 0.5], [0.5, 0.8]]):
        angle = -np.arange(4) * np.pi / 2.0
        turning = centre + 3000.0 * np.stack([np.cos(angle), np.sin(angle)], axis=1)
        island = np.concatenate(
            [
                ragged(a, b, 6, 0.15, generator)
                for a, b in zip(turning, np.roll(turning, -1, axis=0))
            ]
        )
        rings.append(Ring(island, np.full(len(island), LAND)))
    return Domain(tuple(rings), Projection())


def growing(finest):
    """Size that grows twenty-fold off the middle of the coast."""

    def spacing(points):
        distance = np.hypot(points[:, 0], points[:, 1] - 0.5 * WIDTH)
        return np.minimum(finest * (1.0 + distance / 4000.0), 12.0 * finest)

    return spacing


def seconds(action):
    start = time.process_time()
    result = action()
    return result, time.process_time() - start


def row(domain, wanted):
    finest = 60.0 * np.sqrt(1e6 / wanted)
    count = hierarchy.count_points(domain, growing(finest))
    spacing = growing(finest * np.sqrt(count / wanted))
    selection, select = seconds(lambda: hierarchy.select_points(domain, spacing))
    first, delaunay = seconds(lambda: triangulate(selection.domain, selection.interior))
    (points, triangles, _), both = seconds(
        lambda: improve.improve_mesh(
            selection.domain, selection.interior, selection.spacing
        )
    )
    _, qhull = seconds(lambda: scipy.spatial.Delaunay(first[0]))
    shape = quality.shape_quality(points, triangles)
    total = select + both
    return (
        f"{len(points):9d} {select:9.2f} {delaunay:9.2f} {both - delaunay:9.2f} "
        f"{total:9.2f} {len(points) / total:9.0f} {shape.mean():7.4f} "
        f"{shape.min():6.3f} {qhull / total:8.2f}"
    )


def main():
    wanted = [int(float(word)) for word in sys.argv[1:]] or [10_000, 100_000, 1_000_000]
    domain = bay(np.random.default_rng(7))
    row(domain, 1000)  # compile
    print(
        "    nodes hierarchy  Delaunay   improve     total   nodes/s  mean q  min q"
        "  scipy/us"
    )
    for number in wanted:
        print(row(domain, number), flush=True)


if __name__ == "__main__":
    main()
