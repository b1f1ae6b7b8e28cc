"""CPU seconds and memory of the frequency-domain tide.

    python benchmarks/tide_solve.py [number of nodes ...]

A shelf of 200 km by 150 km with a ragged coast, triangles near equilateral. The
smallest mesh is also solved by scipy's default `splu` (COLAMD) for comparison. A second
table compares the sparse solvers that are installed, without and with rotation (a
symmetric and an unsymmetric matrix), each in a process of its own for its memory. Set
OMP_NUM_THREADS=1 for figures that mean something on a busy machine.
"""

from __future__ import annotations

import multiprocessing
import resource
import sys
import time

import numpy as np
import psutil
from scipy.sparse.linalg import splu
from threadpoolctl import threadpool_limits

from tidemesh.datatypes import BoundaryString, CoastalMesh, TideForcing
from tidemesh.tides import Symbols, TideSettings, WaveEquation
from tidemesh.tides.frequency_domain.direct import Factorisation, available_solvers
from tidemesh.tides.frequency_domain.velocity import nodal_velocity
from tidemesh.triangulation.delaunay import constrained_delaunay

WIDTH, LENGTH = 150.0e3, 200.0e3


def coast(x: np.ndarray) -> np.ndarray:
    """Northward position of the shore (m): bays of several sizes."""
    t = 2.0 * np.pi * x / LENGTH
    return WIDTH + 9e3 * np.sin(3 * t) + 4e3 * np.sin(11 * t + 1) + 2e3 * np.sin(31 * t)


def shelf(nodes: int) -> CoastalMesh:
    """A hexagonal lattice of about that many nodes, fitted to the coast."""
    spacing = np.sqrt(2.0 / np.sqrt(3.0) * WIDTH * LENGTH / nodes)
    x = np.linspace(0.0, LENGTH, int(LENGTH / spacing) + 1)
    shore = np.column_stack([x[::-1], coast(x[::-1])])
    side = np.linspace(0.0, coast(np.zeros(1))[0], int(WIDTH / spacing) + 1)[1:-1]
    ring = np.concatenate(
        [
            np.column_stack([np.zeros_like(side), side])[::-1],
            np.column_stack([x, np.zeros_like(x)]),
            np.column_stack([np.full_like(side, LENGTH), side]),
            shore,
        ]
    )
    rows = np.arange(1, int(1.2 * WIDTH / (spacing * np.sqrt(0.75)))) * spacing
    lattice = np.stack(
        np.broadcast_arrays(
            np.arange(int(LENGTH / spacing) + 1)[None, :] * spacing
            + 0.5 * spacing * (np.arange(len(rows)) % 2)[:, None],
            rows[:, None] * np.sqrt(0.75),
        ),
        axis=-1,
    ).reshape(-1, 2)
    px, py = lattice.T
    gap = 0.6 * spacing
    inside = (px > gap) & (px < LENGTH - gap) & (py < coast(px) - 2.0 * gap)
    points = np.concatenate([ring, lattice[inside]])
    number = np.arange(len(ring))
    triangles = constrained_delaunay(
        points, np.column_stack([number, np.roll(number, -1)])
    )
    n_ocean = len(ring) - len(shore)
    offshore = np.maximum(coast(points[:, 0]) - points[:, 1], 0.0)
    return CoastalMesh(
        points=points,
        triangles=triangles,
        depth=3.0 + 80.0 * (offshore / WIDTH) ** 1.2,
        boundaries=(
            BoundaryString("open", number[: n_ocean + 1]),
            BoundaryString("mainland", np.append(number[n_ocean:], 0)),
        ),
    )


def forcing(mesh: CoastalMesh) -> TideForcing:
    """An M2 tide that travels along the shelf."""
    nodes = mesh.open_nodes
    phase = mesh.points[nodes, 0] / 5.0e5
    return TideForcing(
        ("M2",), np.array([1.405189e-4]), nodes, 0.8 * np.exp(-1j * phase)[None]
    )


def peak_mb() -> float:
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0


def measure(nodes: int, *, compare: bool) -> None:
    mesh = shelf(nodes)
    given = forcing(mesh)
    symbols = Symbols.exact(given.frequency[0])
    before = peak_mb()

    ticks = [time.process_time()]
    equation = WaveEquation(mesh, given.nodes, TideSettings())
    ticks.append(time.process_time())
    wave = equation.factorise(symbols)
    ticks.append(time.process_time())
    elevation = wave.elevation(given.elevation[0])
    ticks.append(time.process_time())
    peak = peak_mb() - before
    interior = wave._factorisation.matrix
    del wave
    nodal_velocity(equation, elevation, symbols)
    ticks.append(time.process_time())
    equation._assemble(symbols)
    assembly = time.process_time() - ticks[-1]

    order, factor, solution, velocity = np.diff(ticks)
    total = ticks[-1] - ticks[0]
    row = (order, assembly, factor - assembly, solution, velocity, total)
    print(
        f"{len(mesh.points):>9,}"
        + "".join(f"{t:>10.2f}" for t in row)
        + f"{peak:>9.0f}"
    )
    if compare:
        start = time.process_time()
        with threadpool_limits(1, "blas"):
            plain = splu(interior)
            plain.solve(np.ones(interior.shape[0], dtype=complex))
        plain_time = time.process_time() - start
        ours = order + factor - assembly + solution
        print(
            f"{'':>9}   order + factor + solve {ours:.2f} s, scipy's default splu "
            f"{plain_time:.2f} s: {plain_time / ours:.1f} times"
        )


LOADS = 20


def measure_solver(task: tuple[int, str, str]) -> str:
    """One row of the table of solvers."""
    nodes, solver, coriolis = task
    mesh = shelf(nodes)
    given = forcing(mesh)
    equation = WaveEquation(mesh, given.nodes, TideSettings(coriolis=coriolis))
    columns = equation._assemble(Symbols.exact(given.frequency[0]))
    interior = columns[:, : equation._n_free][: equation._n_free]
    loads = np.random.default_rng(1).standard_normal((interior.shape[0], LOADS)) + 0j
    Factorisation(interior[:9][:, :9], solver)  # loads the library
    before = psutil.Process().memory_info().rss
    ticks = [time.process_time()]
    factors = Factorisation(interior, solver)
    ticks.append(time.process_time())
    memory = (psutil.Process().memory_info().rss - before) / 2**20
    factors.solve(loads[:, 0])
    ticks.append(time.process_time())
    factors.solve(loads)
    ticks.append(time.process_time())
    factors.solve(loads, transpose=True)
    ticks.append(time.process_time())
    row = "".join(f"{t:>10.2f}" for t in np.diff(ticks))
    return f"{len(mesh.points):>9,}{solver:>10}{coriolis:>10}{row}{memory:>9.0f}"


def main() -> None:
    sizes = [int(float(size)) for size in sys.argv[1:]] or [70_000, 300_000, 1_000_000]
    heads = ("order", "assemble", "factor", "solve", "velocity", "total")
    print(f"{'nodes':>9}" + "".join(f"{h:>10}" for h in heads) + f"{'MB':>9}")
    for size in sizes:
        measure(size, compare=size == min(sizes) <= 300_000)

    heads = ("solver", "rotation", "factor", "1 load", f"{LOADS} loads", "adjoints")
    print(f"\n{'nodes':>9}" + "".join(f"{h:>10}" for h in heads) + f"{'MB':>9}")
    tasks = [
        (size, solver, coriolis)
        for size in sizes
        if size <= 300_000
        for coriolis in ("none", "constant")
        for solver in available_solvers()
    ]
    with multiprocessing.get_context("spawn").Pool(1, maxtasksperchild=1) as pool:
        for row in pool.imap(measure_solver, tasks):
            print(row, flush=True)


if __name__ == "__main__":
    main()
