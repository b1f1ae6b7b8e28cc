"""CPU seconds and memory of eight constituents with quadratic friction.

    python benchmarks/quadratic_friction.py [number of nodes ...]

The shelf of `tide_solve.py` with the constituents of the paper's section 4 (M2, M4, M6,
O1, N2, S2, K1, STEADY), once with linear friction and once with converged quadratic
friction; and with a finite amplitude too.
Set OMP_NUM_THREADS=1 for figures that mean something on a busy machine.
"""

from __future__ import annotations

import sys
import time

import numpy as np
from tide_solve import peak_mb, shelf

from tidemesh.constants import frequency
from tidemesh.datatypes import CoastalMesh, TideForcing
from tidemesh.tides import TideSettings
from tidemesh.tides.frequency_domain import solve_with_report

AMPLITUDE = {"M2": 0.8, "N2": 0.18, "S2": 0.13, "K1": 0.1, "O1": 0.08}
NAMES = ("M2", "M4", "M6", "O1", "N2", "S2", "K1", "STEADY")
RUNS = {
    "linear": {},
    "quadratic": {"friction_law": "quadratic"},
    "finite": {"friction_law": "quadratic", "finite_amplitude": True},
}


def forcing(mesh: CoastalMesh) -> TideForcing:
    """Constituents that travel along the shelf, and overtides at rest."""
    nodes = mesh.open_nodes
    rates = np.array([frequency(name) for name in NAMES])
    lag = rates[:, None] / rates[0] * mesh.points[nodes, 0] / 5.0e5
    amplitude = np.array([AMPLITUDE.get(name, 0.0) for name in NAMES])
    return TideForcing(NAMES, rates, nodes, amplitude[:, None] * np.exp(-1j * lag))


def main() -> None:
    sizes = [int(float(word)) for word in sys.argv[1:]] or [70_000]
    heads = ("CPU s", "/ linear", "iterations", "change", "peak MB")
    print(f"{'nodes':>9}  {'friction':<10}" + "".join(f"{h:>12}" for h in heads))
    for size in sizes:
        mesh = shelf(size)
        given = forcing(mesh)
        linear = 0.0
        for run, settings in RUNS.items():
            start = time.process_time()
            _, report = solve_with_report(mesh, given, TideSettings(**settings))
            spent = time.process_time() - start
            linear = linear or spent
            print(
                f"{len(mesh.points):>9,}  {run:<10}{spent:>12.2f}"
                f"{spent / linear:>12.1f}"
                f"{report.iterations:>12}{report.change:>12.1e}{peak_mb():>12.0f}"
            )


if __name__ == "__main__":
    main()
