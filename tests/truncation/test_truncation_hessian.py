"""Recovered Hessians and their magnitude."""

import numpy as np
import pytest
from truncation_meshes import channel_mesh, equilateral_mesh, graded_mesh

from tidemesh.truncation import hessian_magnitude, recovered_hessian


@pytest.mark.parametrize("mesh", [equilateral_mesh(12, 11, 0.1), graded_mesh(14)])
def test_exact_on_quadratics_up_to_the_boundary(mesh):
    points, triangles = mesh
    x, y = points.T
    values = np.stack([x**2 + 3.0 * x * y - 2.0 * y**2 + x, (1.0 + 2.0j) * x * y + 4.0])
    found = recovered_hessian(points, triangles, values)
    assert np.allclose(found[0], [2.0, 3.0, -4.0], atol=1e-9)
    assert np.allclose(found[1], [0.0, 1.0 + 2.0j, 0.0], atol=1e-9)


def test_second_order_up_to_the_boundary():
    errors = []
    for n in (15, 30, 60):
        points, triangles = graded_mesh(n)
        x, y = points.T
        found = recovered_hessian(points, triangles, np.exp(1j * (3.0 * x + 2.0 * y)))
        wave = np.exp(1j * (3.0 * x + 2.0 * y))
        exact = -np.stack([9.0 * wave, 6.0 * wave, 4.0 * wave], axis=1)
        errors.append(np.abs(found[0] - exact).max())
    assert np.log2(errors[0] / errors[2]) / 2.0 > 1.6


def test_magnitude_is_that_of_the_eigenvalues_for_real_fields():
    points, triangles = graded_mesh(12)
    x, y = points.T
    value = 1.5 * x**2 - 2.0 * x * y + 0.5 * y**2
    eigenvalues = np.linalg.eigvalsh([[3.0, -2.0], [-2.0, 1.0]])
    assert np.allclose(
        hessian_magnitude(points, triangles, value, norm="spectral"),
        np.abs(eigenvalues).max(),
    )
    assert np.allclose(
        hessian_magnitude(points, triangles, value), np.sqrt(np.sum(eigenvalues**2))
    )


@pytest.mark.parametrize("norm", ["frobenius", "spectral"])
def test_magnitude_ignores_phase_and_direction(norm):
    points, triangles = graded_mesh(12)

    def value(points):
        x, y = points.T
        return np.exp(1j * (2.0 * x + y)) + 0.3 * np.exp(-1j * (x - 2.0 * y))

    plain = hessian_magnitude(points, triangles, value(points), norm=norm)
    later = hessian_magnitude(
        points, triangles, value(points) * np.exp(1.1j), norm=norm
    )
    assert np.allclose(plain, later, rtol=1e-9)
    turn = np.array([[0.6, 0.8], [-0.8, 0.6]])
    turned = hessian_magnitude(points @ turn, triangles, value(points), norm=norm)
    assert np.allclose(plain, turned, rtol=1e-6)


def test_spectral_magnitude_is_the_largest_curvature_over_all_directions():
    random = np.random.default_rng(2)
    xx, xy, yy = random.normal(size=3) + 1j * random.normal(size=3)
    points, triangles = equilateral_mesh(8, 8, 1.0)
    x, y = points.T
    value = 0.5 * xx * x**2 + xy * x * y + 0.5 * yy * y**2
    angle = np.linspace(0.0, np.pi, 2001)
    direction = np.stack([np.cos(angle), np.sin(angle)])
    curved = np.linalg.norm(np.array([[xx, xy], [xy, yy]]) @ direction, axis=0)
    found = hessian_magnitude(points, triangles, value, norm="spectral")
    assert np.allclose(found, curved.max(), rtol=1e-5)


def test_depth_weights_by_its_square_root():
    points, triangles = equilateral_mesh(8, 8, 1.0)
    value = points[:, 0] ** 2
    depth = np.linspace(1.0, 9.0, len(points))
    weighted = hessian_magnitude(points, triangles, value, depth=depth)
    assert np.allclose(weighted, 2.0 * np.sqrt(depth))
    with pytest.raises(ValueError, match='"frobenius" or "spectral"'):
        hessian_magnitude(points, triangles, value, norm="l2")


@pytest.mark.parametrize("elements", [1, 2])
def test_narrow_channel(elements):
    points, triangles = channel_mesh(50, elements)
    k = 2.0 * np.pi / 40.0
    found = hessian_magnitude(points, triangles, np.exp(1j * k * points[:, 0]))
    assert np.allclose(found, k**2, rtol=0.1)


def test_nodes_without_neighbours_are_unknown():
    points = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0], [5.0, 5.0]])
    triangles = np.array([[0, 1, 3], [0, 3, 2]])
    found = recovered_hessian(points, triangles, points[:, 0] ** 2)
    assert np.isnan(found[0, 4]).all()
