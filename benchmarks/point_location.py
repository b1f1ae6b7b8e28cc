"""A million point locations in a uniform and in a graded mesh.

Prints CPU seconds to build and to search, and the search against a sort of the same
number of values and a Qhull triangulation of the mesh's nodes.
"""

from __future__ import annotations

import time

import numpy as np
from scipy.spatial import Delaunay

from tidemesh.triangulation.locate import Locator


def cpu(function, *arguments):
    start = time.process_time()
    result = function(*arguments)
    return time.process_time() - start, result


def uniform(n, rng):
    return rng.uniform(-2.5e5, 2.5e5, (n, 2))


def graded(n, rng):
    # Spacing in proportion to the distance from the middle: 30 m to 20 km.
    radius = np.exp(rng.uniform(np.log(1e3), np.log(3.5e5), n))
    angle = rng.uniform(0.0, 2.0 * np.pi, n)
    return np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=1)


def main():
    rng = np.random.default_rng(1)
    warm = uniform(100, rng)
    Locator(warm, Delaunay(warm).simplices.astype(np.int64)).nearest(3 * warm)
    sort_seconds, _ = cpu(np.sort, rng.random(1_000_000))
    print(
        f"{'mesh':>10} {'triangles':>10} {'queries':>18} {'build':>7} {'find':>7} "
        f"{'outside':>8} {'value':>7} {'find/sort':>10} {'all/Qhull':>10} {'MB':>6}"
    )
    for name, n in [("uniform", 50_000), ("graded", 50_000), ("graded", 1_000_000)]:
        points = uniform(n, rng) if name == "uniform" else graded(n, rng)
        qhull_seconds, qhull = cpu(Delaunay, points)
        triangles = qhull.simplices.astype(np.int64)
        build, locator = cpu(Locator, points, triangles)
        corner = rng.dirichlet(np.ones(3), 1_000_000)
        near = rng.integers(0, len(triangles), 1_000_000)
        even = np.einsum("ij,ijk->ik", corner, points[triangles[near]])
        for where, query in [
            ("anywhere", rng.uniform(-2.5e5, 2.5e5, (1_000_000, 2))),
            ("as the nodes", even),
        ]:
            find, _ = cpu(locator.find, query)
            outside, _ = cpu(locator.nearest, query + 1e6)
            value, _ = cpu(locator.interpolate, points[:, 0], query)
            size = sum(
                array.nbytes
                for array in (locator._child, locator._start, locator._entries)
            )
            print(
                f"{name:>10} {len(triangles):>10} {where:>18} {build:7.3f} "
                f"{find:7.3f} {outside:8.3f} {value:7.3f} "
                f"{find / sort_seconds:10.2f} "
                f"{(build + find) / qhull_seconds:10.2f} {size / 1e6:6.0f}"
            )


if __name__ == "__main__":
    main()
