"""Seconds of the truncation error stage on 70,000 nodes.

Run with OMP_NUM_THREADS=1; every stage has been called once before it is timed.
"""

from __future__ import annotations

from time import process_time

import numpy as np
from scipy.spatial import KDTree

from tidemesh.constants import frequency
from tidemesh.datatypes import CoastalMesh, TideSolution
from tidemesh.triangulation.delaunay import constrained_delaunay
from tidemesh.truncation import (
    TruncationSettings,
    fit_polynomials,
    hessian_magnitude,
    momentum_series,
    wave_equation_error,
)

SPACING = 900.0


def jittered_square(side: int) -> CoastalMesh:
    """An irregular mesh of side x side nodes."""
    i, j = np.meshgrid(np.arange(side), np.arange(side))
    inner = ((i > 0) & (i < side - 1) & (j > 0) & (j < side - 1)).ravel()
    points = np.stack([i + 0.5 * (j % 2), np.sqrt(0.75) * j], axis=-1).reshape(-1, 2)
    shift = np.random.default_rng(1).uniform(-0.2, 0.2, points.shape)
    points = SPACING * (points + np.where(inner[:, None], shift, 0.0))
    index = np.arange(side * side).reshape(side, side)
    ring = [*index[0, :-1], *index[:-1, -1], *index[-1, :0:-1], *index[:0:-1, 0]]
    segments = np.stack([ring, np.roll(ring, -1)], axis=1)
    depth = 10.0 + points[:, 0] / 5000.0
    return CoastalMesh(
        points=points, triangles=constrained_delaunay(points, segments), depth=depth
    )


def tide_on(mesh: CoastalMesh) -> TideSolution:
    wave = np.exp(1j * (mesh.points @ [2.0e-5, 1.0e-5]))
    return TideSolution(
        names=("M2",),
        frequency=np.array([frequency("M2")]),
        elevation=wave[None],
        velocity=np.stack([wave, 0.5j * wave], axis=1)[None],
        friction=np.full(len(wave), 4e-4),
    )


def main() -> None:
    small, large = jittered_square(40), jittered_square(265)

    def stages(mesh):
        tide = tide_on(mesh)
        points, triangles = mesh.points, mesh.triangles
        parts = np.concatenate([tide.elevation, *np.moveaxis(tide.velocity, 2, 0)])
        lattice = TruncationSettings(derivatives="lattice", delta="spacing")
        fits = {
            f"local polynomials, degree {degree}, 6 fields": (
                lambda degree=degree: fit_polynomials(
                    points, triangles, parts, degree=degree
                )
            )
            for degree in (3, 4, 5, 6)
        }
        return {
            "36 nearest neighbours (scipy KDTree)": lambda: KDTree(points).query(
                points, 36
            ),
            **fits,
            "Eq. 4, least squares": lambda: momentum_series(mesh, tide),
            "Eq. 4, lattice": lambda: momentum_series(mesh, tide, lattice),
            "Hessian": lambda: hessian_magnitude(points, triangles, tide.elevation),
            "wave equation error": lambda: wave_equation_error(mesh, tide),
        }

    first = {}
    for name, stage in stages(small).items():
        start = process_time()
        stage()
        first[name] = process_time() - start
    reference = None
    print(f"{len(large.points)} nodes, {len(large.triangles)} triangles")
    print(f"{'stage':44s} {'CPU s':>7s} {'ratio':>6s} {'first call':>11s}")
    for name, stage in stages(large).items():
        start = process_time()
        stage()
        seconds = process_time() - start
        reference = reference or seconds
        print(
            f"{name:44s} {seconds:7.2f} {seconds / reference:6.2f} {first[name]:11.2f}"
        )


if __name__ == "__main__":
    main()
