"""Derivatives on a square lattice about every node, as published (section 3.3)."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from tidemesh.triangulation.locate import Locator
from tidemesh.truncation.recovery import PolynomialFit

REACH = 3
"""Lattice points on either side of the node."""

CHUNK = 2048
"""Nodes evaluated at a time: bounds the memory to some 60 MB."""

# Weights from -k to +k; docs/method.md, "Difference molecules".
_FOURTH_ORDER = {
    0: np.array([1.0]),
    1: np.array([1.0, -8.0, 0.0, 8.0, -1.0]) / 12.0,
    2: np.array([-1.0, 16.0, -30.0, 16.0, -1.0]) / 12.0,
    3: np.array([1.0, -8.0, 13.0, 0.0, -13.0, 8.0, -1.0]) / 8.0,
}
_SECOND_ORDER = {
    0: np.array([1.0]),
    1: _FOURTH_ORDER[1],
    2: np.array([1.0, -2.0, 1.0]),
    3: np.array([-1.0, 2.0, 0.0, -2.0, 1.0]) / 2.0,
    4: np.array([1.0, -4.0, 6.0, -4.0, 1.0]),
    5: np.array([-1.0, 4.0, -5.0, 0.0, 5.0, -4.0, 1.0]) / 2.0,
}


def molecule(a: int, b: int) -> np.ndarray:
    """Weights of d^(a+b) / dx^a dy^b on the unit lattice, rows along y: (7, 7).

    Tensor product of one-dimensional molecules. Second and third derivatives are of
    order 4, fourth and fifth of order 2.

    Examples
    --------
    >>> print((12.0 * molecule(2, 0)[REACH]).round().astype(int))
    [  0  -1  16 -30  16  -1   0]
    """
    table = _FOURTH_ORDER if a + b <= 3 else _SECOND_ORDER
    if not 0 <= a + b <= 5:
        raise ValueError(f"derivatives up to order 5 are known, got {a} + {b}")
    return np.outer(_padded(table[b]), _padded(table[a]))


NEEDED = tuple(
    (i, j)
    for j in range(-REACH, REACH + 1)
    for i in range(-REACH, REACH + 1)
    if max(abs(i), abs(j)) < REACH or i == 0 or j == 0
)
"""The 29 of the 49 lattice points that the molecules of Eq. 4 use, as (x, y)."""


class LatticeValues:
    """Values at the lattice points of some nodes."""

    def __init__(self, values: np.ndarray, spacing: float, known: np.ndarray):
        self._values = values
        self._spacing = spacing
        self.known = known
        """(n,) bool, True where all lattice points lie in the mesh."""

    def derivative(self, a: int, b: int) -> np.ndarray:
        """Derivative a times in x and b times in y at the nodes: (k, n)."""
        weights = molecule(a, b)
        weight = np.array([weights[REACH + j, REACH + i] for i, j in NEEDED])
        return self._values @ weight / self._spacing ** (a + b)


def lattice_values(
    fit: PolynomialFit,
    triangles: np.ndarray,
    values: np.ndarray,
    spacing: float,
) -> Iterator[tuple[slice, LatticeValues]]:
    """Values on the square lattice about every node, some nodes at a time.

    The value at a lattice point is that of the local polynomial of the nearest corner
    of the triangle that holds it: linear interpolation would destroy the third and
    higher derivatives.

    Parameters
    ----------
    fit : PolynomialFit
        Of degree 5 or more, on the mesh of the nodes.
    triangles : (n_triangles, 3) int array
    values : (k, n_points) float or complex array
    spacing : float
        Of the lattice, m.

    Yields
    ------
    nodes : slice
    lattice : LatticeValues
        Of those nodes and k fields; arbitrary where not known.
    """
    polynomials = fit.fit(values)
    locator = Locator(fit.points, triangles)
    offsets = spacing * np.array(NEEDED, dtype=np.float64)
    for start in range(0, len(fit.points), CHUNK):
        nodes = slice(start, min(start + CHUNK, len(fit.points)))
        places = (fit.points[nodes, None, :] + offsets).reshape(-1, 2)
        triangle, weight = locator.find(places)
        inside = triangle >= 0
        corner = np.where(inside, np.nanargmax(np.nan_to_num(weight), axis=1), 0)
        nearest = triangles[triangle, corner]
        found = polynomials.values_at(nearest, places - fit.points[nearest])
        shape = (-1, len(NEEDED))
        known = inside & polynomials.known[nearest]
        yield (
            nodes,
            LatticeValues(
                found.reshape(found.shape[0], *known.reshape(shape).shape),
                spacing,
                known.reshape(shape).all(axis=1),
            ),
        )


def _padded(weights: np.ndarray) -> np.ndarray:
    return np.pad(weights, REACH - len(weights) // 2)
