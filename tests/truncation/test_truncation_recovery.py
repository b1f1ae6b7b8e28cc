"""Local polynomial fits: exactness, order, narrow water."""

import numpy as np
import pytest
from truncation_meshes import (
    channel_mesh,
    equilateral_mesh,
    graded_mesh,
    polynomial,
    random_polynomials,
)

from tidemesh.triangulation.delaunay import constrained_delaunay
from tidemesh.truncation import _kernels
from tidemesh.truncation.recovery import PolynomialFit, fit_polynomials, index


@pytest.mark.parametrize("degree", [1, 2, 3, 4, 5, 6])
@pytest.mark.parametrize("mesh", [equilateral_mesh(14, 12, 0.08), graded_mesh(24)])
def test_exact_on_polynomials_at_every_node(mesh, degree):
    points, triangles = mesh
    coefficients = random_polynomials(degree, 3, seed=degree)
    fit = fit_polynomials(
        points, triangles, polynomial(coefficients, points), degree=degree
    )
    # Degree 6 is too much for a few patches between the island and the irregular
    # points about it.
    whole = fit.complete == degree
    assert whole.all() if degree < 6 else whole.mean() > 0.95
    assert fit.known.all()
    for a in range(degree + 1):
        b = degree - a
        exact = polynomial(coefficients, points, a, b)[:, whole]
        found = fit.derivative(a, b)[:, whole]
        assert np.allclose(found, exact, rtol=0, atol=1e-6 * 720)


def test_complex_values_are_fitted_as_two_real_ones():
    points, triangles = graded_mesh(12)
    value = np.exp(1j * points[:, 0] * 3.0) * (1.0 + points[:, 1])
    both = fit_polynomials(points, triangles, value, degree=4).coefficients
    parts = np.array([value.real, value.imag])
    real = fit_polynomials(points, triangles, parts, degree=4).coefficients
    assert np.array_equal(both[..., 0], real[..., 0] + 1j * real[..., 1])


@pytest.mark.parametrize(("degree", "order"), [(3, 2), (4, 3), (5, 4)])
def test_second_derivatives_converge_on_graded_meshes(degree, order):
    errors = []
    for n in (20, 40):
        points, triangles = graded_mesh(n)
        x, y = points.T
        value = np.sin(2.0 * x + y) * np.cos(x - 1.5 * y)
        fit = fit_polynomials(points, triangles, value, degree=degree)
        step = 1e-4
        exact = (
            np.sin(2.0 * (x + step) + y) * np.cos(x + step - 1.5 * y)
            - 2.0 * value
            + np.sin(2.0 * (x - step) + y) * np.cos(x - step - 1.5 * y)
        ) / step**2
        errors.append(np.sqrt(np.mean((fit.derivative(2, 0)[0] - exact) ** 2)))
    assert np.log2(errors[0] / errors[1]) > order - 1.3


@pytest.mark.parametrize("elements", [1, 2, 3])
@pytest.mark.parametrize("bend", [0.0, 0.01, 0.05])
def test_derivatives_along_narrow_channels(elements, bend):
    points, triangles = channel_mesh(60, elements, bend=bend)
    if bend:
        along = np.arctan2(points[:, 0], -points[:, 1]) / bend
        direction = np.stack([np.cos(along * bend), np.sin(along * bend)])
    else:
        along = points[:, 0]
        direction = np.array([[1.0], [0.0]])
    k = 2.0 * np.pi / 80.0
    # At a radius other than 1 / bend the same wave is longer or shorter.
    slope = -k * np.sin(k * along) / (bend * np.hypot(*points.T) if bend else 1.0)
    fit = fit_polynomials(points, triangles, np.cos(k * along), degree=5)
    assert fit.known.all()
    assert np.isfinite(fit.coefficients).all()
    gradient = np.stack([fit.derivative(1, 0)[0], fit.derivative(0, 1)[0]])
    error = np.abs((gradient * direction).sum(axis=0) - slope)
    assert error.max() < 0.02 * k


def test_patches_do_not_cross_a_spit():
    # Two basins side by side, joined only far away: a U of two elements' width.
    left = [(0.0, float(j)) for j in range(11)]
    right = [(2.2, float(j)) for j in range(11)]
    outer = [(-2.0, float(j)) for j in range(11)]
    outer_right = [(4.2, float(j)) for j in range(11)]
    bottom = [(-2.0, -2.0), (0.0, -2.0), (2.2, -2.0), (4.2, -2.0)]
    points = np.array(outer + left + right + outer_right + bottom)
    ring = [
        *range(10, -1, -1),
        *range(44, 48),
        *range(33, 44),
        *range(32, 21, -1),
        *range(11, 22),
    ]
    triangles = constrained_delaunay(
        points, np.stack([ring, np.roll(ring, -1)], axis=1)
    )
    value = np.where(points[:, 0] > 1.1, 5.0, 0.0) * (points[:, 1] > 0.0)
    fit = fit_polynomials(points, triangles, value, degree=1, patch_points=4)
    top = points[:, 1] > 3.5
    slope = np.hypot(fit.derivative(1, 0)[0], fit.derivative(0, 1)[0])
    assert np.abs(slope[top]).max() < 1e-12


def test_nodes_that_nothing_can_be_said_of():
    points = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [9.0, 9.0]])
    triangles = np.array([[0, 1, 2]])
    fit = fit_polynomials(points, triangles, points[:, 0] + 2.0, degree=3)
    assert not fit.known.any()
    assert np.isfinite(fit.coefficients).all()
    assert fit.complete.tolist()[3] == 0
    assert fit.derivative(0, 0)[0, 3] == pytest.approx(11.0)


def test_some_nodes_as_all_nodes():
    points, triangles = graded_mesh(12)
    fit = PolynomialFit(points, triangles, 3)
    nodes = np.array([7, 3, 100])
    every = fit.fit(points.T)
    some = fit.fit(points.T, nodes)
    assert np.array_equal(some.coefficients, every.coefficients[nodes])
    rows = np.array([7, 7, 3])
    offset = np.array([[0.0, 0.1], [0.2, 0.0], [0.05, 0.05]])
    assert np.allclose(every.values_at(rows, offset), (points[rows] + offset).T)


def test_compiled_and_plain_kernels_agree(monkeypatch):
    points, triangles = channel_mesh(12, 2)
    value = np.sin(points[:, 0])
    compiled = fit_polynomials(points, triangles, value, degree=3)
    for name in ("gather_rings", "fit_patches"):
        monkeypatch.setattr(_kernels, name, getattr(_kernels, name).py_func)
    plain = fit_polynomials(points, triangles, value, degree=3)
    assert np.array_equal(compiled.rank, plain.rank)
    assert np.allclose(compiled.coefficients, plain.coefficients, rtol=0, atol=1e-12)


def test_arguments_are_checked():
    points, triangles = equilateral_mesh(5, 5, 1.0)
    with pytest.raises(ValueError, match="degree must be between 1 and 8"):
        fit_polynomials(points, triangles, points.T, degree=9)
    with pytest.raises(ValueError, match="at least 10 points"):
        fit_polynomials(points, triangles, points.T, degree=3, patch_points=9)
    with pytest.raises(ValueError, match=r"values must have shape \(k, 25\)"):
        fit_polynomials(points, triangles, points, degree=2)
    with pytest.raises(ValueError, match="must be finite"):
        fit_polynomials(points, triangles, np.full(25, np.nan), degree=2)
    assert index(0, 5) == 20
