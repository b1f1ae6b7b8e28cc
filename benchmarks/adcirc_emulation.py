"""CPU seconds of ADCIRC's wave equation beside Galerkin's, one constituent.

    python benchmarks/adcirc_emulation.py [number of nodes ...]

The shelf of `tide_solve.py`, with rotation and tau0 = 0.002 1/s, from the mesh to
elevation and velocities: the fastest of three runs. The last columns are the ratio of
the two and how far their answers are apart (relative L2). Set OMP_NUM_THREADS=1 for
figures that mean something on a busy machine.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable

import numpy as np
from tide_solve import forcing, shelf

from tidemesh.tides import Symbols, TideSettings, WaveEquation
from tidemesh.tides.frequency_domain.gwce import GwceEquation, GwceSymbols
from tidemesh.tides.frequency_domain.velocity import nodal_velocity

SETTINGS = TideSettings(coriolis="constant", tau0=2.0e-3)
PARTS = ("order", "assemble", "factor", "solve", "velocity")


def timed(make: Callable, symbols: Symbols | GwceSymbols, mesh, given) -> tuple:
    """CPU seconds of the parts of one solution, and the elevation."""
    ticks = [time.process_time()]
    equation = make(mesh, given.nodes, SETTINGS)
    ticks.append(time.process_time())
    equation._assemble(symbols)
    ticks.append(time.process_time())
    wave = equation.factorise(symbols)
    ticks.append(time.process_time())
    elevation = wave.elevation(given.elevation[0])
    ticks.append(time.process_time())
    nodal_velocity(equation, elevation, symbols)
    ticks.append(time.process_time())
    parts = np.diff(ticks)
    parts[2] -= parts[1]  # factorise assembles again
    return parts, elevation


def measure(nodes: int) -> None:
    mesh = shelf(nodes)
    given = forcing(mesh)
    frequency = given.frequency[0]
    kinds = {
        "Galerkin": (WaveEquation, Symbols.exact(frequency)),
        "GWCE": (GwceEquation, GwceSymbols.exact(frequency)),
    }
    totals, answers = [], []
    for name, (make, symbols) in kinds.items():
        runs = [timed(make, symbols, mesh, given) for _ in range(3)]
        parts, elevation = min(runs, key=lambda run: run[0].sum())
        totals.append(parts.sum())
        answers.append(elevation)
        print(
            f"{len(mesh.points):>9,}{name:>10}"
            + "".join(f"{part:>10.3f}" for part in parts)
            + f"{parts.sum():>10.3f}",
            end="" if name == "GWCE" else "\n",
        )
    apart = np.linalg.norm(answers[1] - answers[0]) / np.linalg.norm(answers[0])
    print(f"{totals[1] / totals[0]:>8.1f}{apart:>10.1e}")


def main() -> None:
    sizes = [int(float(size)) for size in sys.argv[1:]] or [3_000, 30_000, 70_000]
    heads = "".join(f"{head:>10}" for head in (*PARTS, "total"))
    print(f"{'nodes':>9}{'equation':>10}{heads}{'ratio':>8}{'apart':>10}")
    for size in sizes:
        measure(size)


if __name__ == "__main__":
    main()
