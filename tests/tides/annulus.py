"""Quarter-annulus basins with closed-form tides (Lynch & Gray 1978)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.special import jv, yv

from tidemesh.datatypes import BoundaryString, CoastalMesh, TideForcing

GRAVITY = 9.81
INNER, OUTER = 60_960.0, 152_400.0
DEPTH = 3.048
AMPLITUDE = 0.3048
FREQUENCY = 1.405257e-4
FRICTION = 4.0e-4


@dataclass(frozen=True)
class Annulus:
    """Depth DEPTH * (r / INNER)**power, AMPLITUDE at OUTER, no flow at INNER."""

    power: int

    def depth(self, r):
        return DEPTH * (r / INNER) ** self.power

    def elevation(self, r):
        """Elevation and its radial derivative."""
        q = 1j * FREQUENCY + FRICTION
        beta2 = -1j * FREQUENCY * q / (GRAVITY * DEPTH / INNER**self.power)
        first, second = _pairs(self.power, np.sqrt(beta2 + 0j), beta2)
        # No flow at INNER, AMPLITUDE at OUTER.
        rows = [
            [first(INNER)[1], second(INNER)[1]],
            [first(OUTER)[0], second(OUTER)[0]],
        ]
        a, b = np.linalg.solve(np.array(rows), np.array([0.0, AMPLITUDE]))
        f, s = first(r), second(r)
        return a * f[0] + b * s[0], a * f[1] + b * s[1]

    def velocity(self, points):
        """(n, 2) velocity."""
        r = np.hypot(*points.T)
        slope = self.elevation(r)[1]
        q = 1j * FREQUENCY + FRICTION
        return (-GRAVITY * slope / q / r)[:, None] * points


def _pairs(power, beta, beta2):
    def bessel(kind):
        if power == 0:
            return lambda r: (kind(0, beta * r), -beta * kind(1, beta * r))

        def value(r):
            z = 2.0 * beta * np.sqrt(r)
            slope = 0.5 * (kind(0, z) - kind(2, z)) * beta / np.sqrt(r)
            return kind(1, z) / np.sqrt(r), (
                slope / np.sqrt(r) - 0.5 * kind(1, z) / r**1.5
            )

        return value

    def monomial(s):
        return lambda r: ((r / OUTER) ** s, s * (r / OUTER) ** (s - 1.0) / OUTER)

    if power == 2:
        root = np.sqrt(1.0 - beta2)
        return monomial(-1.0 + root), monomial(-1.0 - root)
    return bessel(jv), bessel(yv)


def annulus_mesh(n_r: int, n_theta: int, power: int) -> CoastalMesh:
    """Polar lattice of n_r by n_theta cells, diagonals alternating."""
    r = np.linspace(INNER, OUTER, n_r + 1)
    theta = np.linspace(0.0, 0.5 * np.pi, n_theta + 1)
    rr, tt = np.meshgrid(r, theta)
    points = np.stack([rr * np.cos(tt), rr * np.sin(tt)], axis=-1).reshape(-1, 2)
    node = np.arange(rr.size).reshape(rr.shape)
    a, b = node[:-1, :-1].ravel(), node[:-1, 1:].ravel()
    c, d = node[1:, 1:].ravel(), node[1:, :-1].ravel()
    row, column = np.divmod(np.arange(len(a)), n_r)
    even = ((row + column) % 2 == 0)[:, None]
    one = np.where(even, np.stack([a, b, c], 1), np.stack([a, b, d], 1))
    two = np.where(even, np.stack([a, c, d], 1), np.stack([b, c, d], 1))
    ocean = node[:, -1]
    land = np.concatenate([node[-1, ::-1], node[-2::-1, 0], node[0, 1:]])
    return CoastalMesh(
        points=points,
        triangles=np.concatenate([one, two]),
        depth=Annulus(power).depth(rr.ravel()),
        boundaries=(BoundaryString("open", ocean), BoundaryString("mainland", land)),
    )


def annulus_forcing(mesh: CoastalMesh) -> TideForcing:
    """M2 of Lynch & Gray's amplitude at phase zero."""
    nodes = mesh.open_nodes
    return TideForcing(
        names=("M2",),
        frequency=np.array([FREQUENCY]),
        nodes=nodes,
        elevation=np.full((1, len(nodes)), AMPLITUDE, dtype=complex),
    )
