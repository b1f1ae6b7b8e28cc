"""Error per sizing rule at equal node count, against a fine graded mesh.

    python validation/sizing_rules.py examples/south_carolina/fine.toml out/rules

Runs the case with every rule at one budget and once, finely, as the reference; prints
the relative L2 error of the complex M2 elevation at the reference's nodes: over the
domain, in water shallower than 10 m, and in two estuaries (Winyah Bay, Charleston).
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

from tidemesh.datatypes import CoastalMesh, TideSolution
from tidemesh.pipeline import store
from tidemesh.pipeline.run import run_case
from tidemesh.sizing import RULES
from tidemesh.triangulation import locate, quality

NODES, REFERENCE_NODES = 5_000, 150_000
COMMON = ["output.figures=false"]
ESTUARIES_DEG = ((-79.35, 33.18, -79.1, 33.5), (-80.05, 32.72, -79.85, 32.9))


def solve(case: str, folder: Path, *overrides: str) -> tuple[CoastalMesh, TideSolution]:
    """Run a case; its mesh and the tide on it."""
    run_case(case, output=folder, overrides=[*COMMON, *overrides])
    check = store.load(folder / "stages" / "check.npz")
    return store.load(folder / "stages" / "mesh.npz"), check["tide"]


def main(case: str, output: str = "out/rules") -> None:
    """Print one table."""
    folder = Path(output)
    reference, exact = solve(
        case,
        folder / "reference",
        f"sizing.nodes={REFERENCE_NODES}",
        "sizing.min_m=100",
    )
    weight = np.bincount(
        reference.triangles.ravel(),
        np.repeat(quality.area(reference.points, reference.triangles), 3),
    )
    place = reference.projection.inverse(reference.points)
    estuary = np.zeros(len(place), dtype=bool)
    for west, south, east, north in ESTUARIES_DEG:
        estuary |= ((place > (west, south)) & (place < (east, north))).all(axis=1)
    parts = {
        "domain": np.ones(len(place), dtype=bool),
        "< 10 m": reference.depth < 10.0,
        "estuaries": estuary & (reference.depth < 30.0),
    }
    print(f"{'rule':18} {'nodes':>7} " + " ".join(f"{name:>9}" for name in parts))
    for rule in RULES:
        mesh, tide = solve(
            case,
            folder / rule,
            f"sizing.nodes={NODES}",
            "sizing.min_m=150",
            f"sizing.rule={rule}",
        )
        locator = locate.Locator(mesh.points, mesh.triangles)
        there = locator.interpolate(tide.elevation[0], reference.points)
        error = np.abs(there - exact.elevation[0]) ** 2 * weight
        size = np.abs(exact.elevation[0]) ** 2 * weight
        row = [np.sqrt(error[p].sum() / size[p].sum()) for p in parts.values()]
        print(f"{rule:18} {len(mesh.points):7,} " + " ".join(f"{r:9.1e}" for r in row))


if __name__ == "__main__":
    main(*sys.argv[1:])
