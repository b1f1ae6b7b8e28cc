"""Node-steps per second of the nonlinear time step, beside whole-array numpy.

    python benchmarks/time_stepping.py [number of nodes ...]

The shelf of tide_solve.py, with quadratic friction, finite amplitude, advection and
rotation. The numpy step does the same arithmetic with whole arrays and sparse matrices;
both must agree. On a machine that is busy with other work set OMP_WAIT_POLICY=passive,
or leave the two threads out: they wait for one another by spinning.
"""

from __future__ import annotations

import sys
import time

import numba
import numpy as np
import scipy.sparse as sparse
from tide_solve import forcing, shelf

from tidemesh.tides import TideSettings
from tidemesh.tides.time_domain import Stepper, stable_step
from tidemesh.tides.time_domain import _kernels as kernels

PHYSICS = TideSettings(
    friction_law="quadratic",
    drag_coefficient=0.003,
    tau0=0.009,
    finite_amplitude=True,
    advection=True,
    coriolis="constant",
)
RAMP = 86400.0
NODE_STEPS = 2.0e7
"""Of one measurement."""


class ArrayStep:
    """The scheme of `Stepper` in numpy and scipy, one thread."""

    def __init__(self, water: Stepper):
        grid, rows = water.discretisation, water.constants
        self.water, self.rows = water, rows
        n, m = len(grid.mass), len(grid.corners)
        self.corners = grid.corners.astype(np.int64)
        bx, cx, by, cy, self.area, self.depth, self.weight, self.part = grid.geometry
        self.x, self.y = np.stack([-bx - cx, bx, cx]), np.stack([-by - cy, by, cy])
        pattern = (self.corners.ravel(), np.arange(3 * m))
        self.scatter = sparse.csr_array((np.ones(3 * m), pattern), shape=(n, 3 * m))
        pairs = grid.others.astype(np.int64), grid.starts.astype(np.int64)
        weights = water._weights
        self.slope_x = sparse.csr_array((weights[:, 0], *pairs), shape=(n, n))
        self.slope_y = sparse.csr_array((weights[:, 1], *pairs), shape=(n, n))
        tau0, step = PHYSICS.tau0, water.step
        self.keep = (1.0 / step - 0.5 * tau0) / (1.0 / step + 0.5 * tau0)
        self.e, self.rise, self.u, self.v, self.tau = np.zeros((5, n))
        self.px, self.py = np.zeros((2, n))
        self.qx, self.qy = np.zeros((2, n))

    def advance(self, steps: int) -> None:
        """Take some steps from rest."""
        water, rows = self.water, self.rows
        step, g, tau0 = water.step, PHYSICS.gravity, PHYSICS.tau0
        c, f = self.corners, rows[kernels.CORIOLIS]
        real, imaginary = water._elevation
        for number in range(1, steps + 1):
            rest = tau0 - self.tau
            sx, sy = rest * self.qx + f * self.qy, rest * self.qy - f * self.qx
            e, u, v = self.e[c], self.u[c], self.v[c]
            column = self.depth + 0.5 * g * (e + e[:, :1]).T
            lift = (e - e[:, :1]).T * column
            fx = sx[c].mean(axis=1) - (self.x * lift).sum(axis=0)
            fy = sy[c].mean(axis=1) - (self.y * lift).sum(axis=0)
            ux, uy = (self.x * u.T).sum(axis=0), (self.y * u.T).sum(axis=0)
            vx, vy = (self.x * v.T).sum(axis=0), (self.y * v.T).sum(axis=0)
            um, vm = u.mean(axis=1), v.mean(axis=1)
            qx, qy = self.qx[c].mean(axis=1), self.qy[c].mean(axis=1)
            rate = self.rise[c].mean(axis=1) / step
            fx += um * rate - self.part * (qx * ux + qy * uy)
            fy += vm * rate - self.part * (qx * vx + qy * vy)
            load = self.area * (self.x * fx + self.y * fy)
            carried = self.part * self.weight
            ax = np.repeat(carried * (um * ux + vm * uy), 3)
            ay = np.repeat(carried * (um * vx + vm * vy), 3)
            ax = rows[kernels.AROUND] * (self.scatter @ ax)
            ay = rows[kernels.AROUND] * (self.scatter @ ay)

            rise = self.scatter @ load.T.ravel()
            rise = self.keep * self.rise + rows[kernels.INVERSE] * rise
            level = self.e + rise
            moment = number * step
            phase = water._frequency * moment + water._argument
            growth = np.tanh(2.0 * moment / RAMP) * water._factor
            level[water._ocean] = (growth * np.cos(phase)) @ real - (
                growth * np.sin(phase)
            ) @ imaginary
            self.rise, self.e = level - self.e, level

            px, py = self.slope_x @ level, self.slope_y @ level
            a = 0.5 * step * self.tau
            b = 0.5 * step * rows[kernels.SPIN]
            x = ax + self.px + px + (1.0 - a) * self.u + b * self.v
            y = ay + self.py + py + (1.0 - a) * self.v - b * self.u
            self.px, self.py = px, py
            a = 1.0 + a
            scale = 1.0 / (a * a + b * b)
            u, v = scale * (a * x + b * y), scale * (a * y - b * x)
            xx, xy = rows[kernels.ALONG_XX], rows[kernels.ALONG_XY]
            self.u, self.v = xx * u + xy * v, xy * u + rows[kernels.ALONG_YY] * v
            column = rows[kernels.DEPTH] + level
            speed = np.sqrt(self.u**2 + self.v**2)
            self.tau = np.minimum(rows[kernels.DRAG] * speed / column, 2.0 / step)
            self.qx, self.qy = self.u * column, self.v * column


def measure(nodes: int) -> None:
    mesh = shelf(nodes)
    given, n = forcing(mesh), len(mesh.points)
    step = 0.9 * stable_step(mesh, None, PHYSICS).step_s

    def started(threads: int) -> Stepper:
        water = Stepper(mesh, given, PHYSICS, step, ramp=RAMP, threads=threads)
        water.advance(1)
        return water

    array = ArrayStep(started(1))
    few = max(10, int(NODE_STEPS / 40 / n))
    start = time.process_time()
    array.advance(few)
    plain = n * few / (time.process_time() - start)
    same = Stepper(mesh, given, PHYSICS, step, ramp=RAMP)
    same.advance(few)
    levels = same.state[kernels.LEVEL]
    error = np.abs(levels - array.e).max() / np.abs(levels).max()
    print(f"{n:>9,}{'numpy':>9}{plain / 1e6:>14.2f}{'':>12}{'':>9}")
    for threads in (1, 2):
        if threads > numba.config.NUMBA_NUM_THREADS:
            continue
        water, steps = started(threads), int(NODE_STEPS / n)
        wall, start = time.perf_counter(), time.process_time()
        water.advance(steps)
        cpu = n * steps / (time.process_time() - start)
        wall = n * steps / (time.perf_counter() - wall)
        print(
            f"{n:>9,}{threads:>9}{cpu / 1e6:>14.2f}{wall / 1e6:>12.2f}"
            f"{cpu / plain:>9.1f}"
        )
    print(f"{'':>9}  difference from numpy after {few} steps: {error:.1e}")


def main() -> None:
    sizes = [int(float(size)) for size in sys.argv[1:]] or [10_000, 70_000]
    print("million node-steps per second")
    heads = ("threads", "of CPU", "of time", "times")
    print(f"{'nodes':>9}" + "".join(f"{h:>{w}}" for h, w in zip(heads, (9, 14, 12, 9))))
    for size in sizes:
        measure(size)


if __name__ == "__main__":
    main()
