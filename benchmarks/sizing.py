"""CPU seconds of the sizing steps on a 70,000-node mesh, beside Qhull's Delaunay."""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np
from scipy.spatial import Delaunay

from tidemesh import sizing
from tidemesh.datatypes import CoastalMesh, TruncationSeries
from tidemesh.triangulation import topology

N_POINTS = 70_000
BUDGET = 10_000


def cpu_seconds(work: Callable, repeats: int = 3) -> float:
    best = np.inf
    for _ in range(repeats):
        start = time.process_time()
        work()
        best = min(best, time.process_time() - start)
    return best


def main() -> None:
    rng = np.random.default_rng(0)
    points = rng.random((N_POINTS, 2)) * 2.6e5
    mesh = CoastalMesh(points, Delaunay(points).simplices, 5.0 + points[:, 0] / 1e3)
    edges = topology.edges(mesh.triangles)
    lengths = np.linalg.norm(points[edges[:, 0]] - points[edges[:, 1]], axis=1)

    shape = (1, 2, N_POINTS)
    decay = np.exp(-points[:, 0] / 3e4)
    noise = rng.normal(size=(4, *shape))
    series = TruncationSeries(
        1e-12 * decay * (noise[0] + 1j * noise[1]),
        1e-18 * decay * (noise[2] + 1j * noise[3]),
        points[:, 0] < 2.4e5,
    )
    settings = sizing.SizingSettings(nodes=BUDGET, channel_elements=0.0)
    magnitude = np.where(series.known, decay * (1.0 + rng.random(N_POINTS)), np.nan)
    rule = sizing.power_rule(magnitude)
    rough = rule(1000.0)
    rough[np.isnan(rough)] = 1e4
    sizes = sizing.size_builder(mesh, rule, settings)
    field = sizes(1000.0)

    rows = {
        "Qhull Delaunay": lambda: Delaunay(points),
        "allowable spacing (Eq. 4)": lambda: sizing.allowable_spacing(series, 1e-6),
        "gradation": lambda: sizing.limit_gradation(rough, edges, lengths, 0.25),
        "extrapolation, prepared": lambda: sizing.harmonic_extension(
            points, edges, series.known
        ),
        "sizes, first level": lambda: sizing.allowable_sizes(
            mesh, rule, 1000.0, settings
        ),
        "sizes, further level": lambda: sizes(1000.0),
        "expected nodes": lambda: sizing.expected_nodes(field),
        "level for a budget": lambda: sizing.choose_level(mesh, rule, sizes, settings),
    }
    seconds = {name: cpu_seconds(work) for name, work in rows.items()}
    reference = seconds["Qhull Delaunay"]
    print(f"{N_POINTS:,} nodes{'':18} CPU s   of Qhull")
    for name, value in seconds.items():
        print(f"{name:28} {value:9.3f} {value / reference:9.2f}")


if __name__ == "__main__":
    main()
