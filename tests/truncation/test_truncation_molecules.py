"""Difference molecules and lattice values, as published."""

import numpy as np
import pytest
from truncation_meshes import (
    equilateral_mesh,
    graded_mesh,
    polynomial,
    random_polynomials,
)

from tidemesh.truncation.molecules import NEEDED, REACH, lattice_values, molecule
from tidemesh.truncation.recovery import PolynomialFit

ORDERS = [(a, m - a) for m in range(1, 6) for a in range(m + 1)]
OFFSETS = np.arange(-REACH, REACH + 1)


def order_of(a, b):
    return 4 if a + b <= 3 else 2


@pytest.mark.parametrize(("a", "b"), ORDERS)
def test_molecules_are_exact_on_polynomials(a, b):
    # Up to the degree a + b + order - 1; symmetry gives one degree more.
    x, y = np.meshgrid(OFFSETS, OFFSETS)
    points = np.stack([x.ravel(), y.ravel()], axis=1).astype(float)
    degree = a + b + order_of(a, b) - 1
    coefficients = random_polynomials(degree, 1, seed=a + 10 * b)
    values = polynomial(coefficients, points)[0].reshape(7, 7)
    exact = polynomial(coefficients, np.zeros((1, 2)), a, b)[0, 0]
    assert (molecule(a, b) * values).sum() == pytest.approx(exact, rel=1e-9, abs=1e-9)


@pytest.mark.parametrize(("a", "b"), ORDERS)
def test_order_of_convergence(a, b):
    def value(x, y):
        return np.exp(1j * (0.8 * x + 0.6 * y))

    errors = []
    for step in (0.4, 0.2):
        x, y = np.meshgrid(0.3 + step * OFFSETS, 0.1 + step * OFFSETS)
        found = (molecule(a, b) * value(x, y)).sum() / step ** (a + b)
        errors.append(abs(found - (0.8j) ** a * (0.6j) ** b * value(0.3, 0.1)))
    assert np.log2(errors[0] / errors[1]) == pytest.approx(order_of(a, b), abs=0.15)


def test_molecules_use_no_other_lattice_points():
    assert len(NEEDED) == 29
    unused = np.ones((7, 7), dtype=bool)
    for i, j in NEEDED:
        unused[REACH + j, REACH + i] = False
    for a, b in ORDERS:
        assert not molecule(a, b)[unused].any()


def test_sixth_derivatives_are_refused():
    with pytest.raises(ValueError, match="up to order 5"):
        molecule(4, 2)


def test_lattice_derivatives_of_polynomials_on_an_irregular_mesh():
    points, triangles = graded_mesh(30)
    coefficients = random_polynomials(5, 2, seed=3, complex_valued=True)
    fit = PolynomialFit(points, triangles, 5)
    values = polynomial(coefficients, points)
    known = []
    for nodes, lattice in lattice_values(fit, triangles, values, 0.05):
        known.append(lattice.known)
        here = points[nodes][lattice.known]
        for a, b in [(2, 0), (1, 2), (3, 0), (2, 2), (5, 0), (2, 3)]:
            exact = polynomial(coefficients, here, a, b)
            found = lattice.derivative(a, b)[:, lattice.known]
            assert np.allclose(found, exact, rtol=0, atol=1e-7 / 0.05 ** (a + b - 1))
    assert 0 < np.concatenate(known).sum() < len(points)


def test_nodes_are_known_three_spacings_from_the_boundary():
    points, triangles = equilateral_mesh(25, 25, 1.0)
    fit = PolynomialFit(points, triangles, 5)
    (part,) = lattice_values(fit, triangles, points.T, 1.0)
    inside = (points > 3.0 + 0.5).all(axis=1) & (points < points.max(axis=0) - 3.5).all(
        axis=1
    )
    outside = (points < 3.0 - 1e-6).any(axis=1) | (
        points > points.max(axis=0) - 3.0 + 1e-6
    ).any(axis=1)
    assert part[1].known[inside].all()
    assert not part[1].known[outside].any()
