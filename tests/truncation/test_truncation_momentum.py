"""Eq. 4 against the discrete equations themselves, and its conventions."""

import numpy as np
import pytest
from truncation_meshes import (
    channel_mesh,
    equilateral_mesh,
    graded_mesh,
    polynomial,
    random_polynomials,
    tidal_mesh,
    tide,
)

from tidemesh.datatypes import TideSolution
from tidemesh.triangulation.topology import boundary_nodes
from tidemesh.truncation import TruncationSettings, error_at, momentum_series

GRAVITY = 9.81
VECTOR = TruncationSettings(components="vector")
AS_PUBLISHED = TruncationSettings(derivatives="lattice", delta="spacing")


def galerkin_average(points, triangles, nodal, gradient_of, direction):
    """P1 Galerkin momentum at the nodes over the lumped mass: plain assembly."""
    a, b, c = (points[triangles[:, i]] for i in range(3))
    area = 0.5 * ((b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0])
    opposite = np.stack([c - b, a - c, b - a], axis=1)
    slope = (
        np.stack([-opposite[:, :, 1], opposite[:, :, 0]], axis=2)
        / (2.0 * area)[:, None, None]
    )
    gradient = (slope[:, :, direction] * gradient_of[triangles]).sum(axis=1)
    total = np.zeros(len(points), dtype=complex)
    lumped = np.zeros(len(points))
    for i in range(3):
        mass = (nodal[triangles].sum(axis=1) + nodal[triangles[:, i]]) / 12.0
        np.add.at(total, triangles[:, i], area * (mass + gradient / 3.0))
        np.add.at(lumped, triangles[:, i], area / 3.0)
    return total / lumped


@pytest.mark.parametrize("rotation", [False, True])
def test_series_is_the_truncation_error_of_the_galerkin_equations(rotation):
    # On polynomials of degree 5 the series ends with the fourth order: exact.
    spacing = 0.7
    points, triangles = equilateral_mesh(14, 13, spacing, origin=(-5.0, -4.0))
    inner = np.setdiff1d(np.arange(len(points)), boundary_nodes(triangles))
    frequency = 1.3
    friction, coriolis = 0.4, None
    degree = 5
    if rotation:
        friction, coriolis = 0.4 + 0.05 * points[:, 0], 0.6 - 0.03 * points[:, 1]
        degree = 4
    scale = (1.0 / 4.0) ** np.add.outer(np.arange(6), np.arange(6))[:, :, None]
    wave = random_polynomials(5, 1, seed=1, complex_valued=True) * scale
    flow = random_polynomials(degree, 2, seed=2, complex_valued=True)
    flow = flow * scale[: degree + 1, : degree + 1]
    elevation = polynomial(wave, points)[0]
    u, v = polynomial(flow, points)
    q = 1j * frequency + friction
    f = 0.0 if coriolis is None else coriolis
    series = momentum_series(
        tidal_mesh(points, triangles),
        tide(
            elevation, u, v, frequency=frequency, friction=friction, coriolis=coriolis
        ),
        VECTOR,
    )
    assert series.known.all()
    for direction, nodal in enumerate((q * u - f * v, q * v + f * u)):
        slope = polynomial(wave, points, 1 - direction, direction)[0]
        discrete = galerkin_average(
            points, triangles, nodal, GRAVITY * elevation, direction
        )
        error = (discrete - nodal - GRAVITY * slope)[inner]
        found = (
            series.second[0, direction] * spacing**2
            + series.fourth[0, direction] * spacing**4
        )[inner]
        assert np.abs(found - error).max() < 1e-7 * np.abs(error).max()
        without = (series.second[0, direction] * spacing**2)[inner]
        assert np.abs(without - error).max() > 1e-3 * np.abs(error).max()


def equation_4(points, wave, flow, q):
    """Coefficients of Delta^2 and Delta^4 as printed (sign and bracket as read)."""

    def e(a, b):
        return polynomial(wave, points, a, b)[0]

    def speed(a, b):
        return polynomial(flow, points, a, b).sum(axis=0)

    second = q / 2 * (speed(2, 0) + speed(0, 2))
    second += GRAVITY / 2 * (e(3, 0) + e(2, 1) + e(1, 2) + e(0, 3))
    fourth = q / 8 * (speed(4, 0) + 2 * speed(2, 2) + speed(0, 4))
    fourth += (GRAVITY / 24) * (
        22 / 10 * e(5, 0)
        + e(4, 1)
        + 2 * e(3, 2)
        + 6 * e(2, 3)
        + 3 * e(1, 4)
        + 9 / 5 * e(0, 5)
    )
    return second, fourth


@pytest.mark.parametrize("derivatives", ["least_squares", "lattice"])
@pytest.mark.parametrize(("delta", "divisor"), [("spacing", 1.0), ("half_edge", 2.0)])
def test_sum_of_components_is_equation_4(derivatives, delta, divisor):
    points, triangles = graded_mesh(24)
    wave = random_polynomials(5, 1, seed=5, complex_valued=True)
    flow = random_polynomials(5, 2, seed=6, complex_valued=True)
    u, v = polynomial(flow, points)
    second, fourth = equation_4(points, wave, flow, 1.3j + 0.4)
    series = momentum_series(
        tidal_mesh(points, triangles),
        tide(polynomial(wave, points)[0], u, v, frequency=1.3, friction=0.4),
        TruncationSettings(
            derivatives=derivatives, delta=delta, lattice_spacing_m=0.05
        ),
    )
    known = series.known
    assert known.sum() > 100
    for found, exact, power in (
        (series.second, second, 2),
        (series.fourth, fourth, 4),
    ):
        exact = exact[known] / divisor**power
        assert found.shape == (1, 1, len(points))
        assert np.abs(found[0, 0, known] - exact).max() < 1e-4 * np.abs(exact).max()


def plane_wave(points, *, wave_length, direction, frequency, friction):
    k = 2.0 * np.pi / wave_length
    kx, ky = k * np.cos(direction), k * np.sin(direction)
    elevation = np.exp(1j * (kx * points[:, 0] + ky * points[:, 1]))
    q = 1j * frequency + friction
    u, v = (-GRAVITY * 1j * kn / q * elevation for kn in (kx, ky))
    return kx, ky, elevation, u, v


@pytest.mark.parametrize("settings", [VECTOR, AS_PUBLISHED])
def test_plane_wave(settings):
    points, triangles = equilateral_mesh(40, 40, 1000.0)
    frequency, friction = 1.405e-4, 4e-4
    kx, ky, elevation, u, v = plane_wave(
        points,
        wave_length=40_000.0,
        direction=0.4,
        frequency=frequency,
        friction=friction,
    )
    # A velocity twice that of the momentum balance leaves a residual to find.
    series = momentum_series(
        tidal_mesh(points, triangles), tide(elevation, 2.0 * u, 2.0 * v), settings
    )
    q = 1j * frequency + friction
    square = kx**2 + ky**2
    exact = [-0.5 * square * (2.0 * q * w + GRAVITY * 1j * k * elevation)
             for w, k in ((u, kx), (v, ky))]  # fmt: skip
    exact = np.stack(exact) / 4.0
    if settings is AS_PUBLISHED:
        exact = 4.0 * exact.sum(axis=0, keepdims=True)
    middle = (np.abs(points - points.mean(axis=0)) < 10_000.0).all(axis=1)
    assert series.known[middle].all()
    error = np.abs(series.second[0] - exact)[:, middle]
    assert error.max() < 0.01 * np.abs(exact).max()


def test_second_order_vanishes_on_an_exact_solution():
    # The insight of docs/method.md: the bracket is the Laplacian of the residual.
    points, triangles = equilateral_mesh(40, 40, 1000.0)
    _, _, elevation, u, v = plane_wave(
        points, wave_length=60_000.0, direction=1.1, frequency=1.405e-4, friction=4e-4
    )
    mesh = tidal_mesh(points, triangles)
    balanced = momentum_series(mesh, tide(elevation, u, v), VECTOR)
    still = momentum_series(mesh, tide(elevation, 0.0 * u, 0.0 * v), VECTOR)
    ratio = np.abs(balanced.second).max() / np.abs(still.second).max()
    assert ratio < 0.03


def test_vector_form_sees_errors_along_the_other_diagonal():
    points, triangles = equilateral_mesh(20, 20, 1.0)
    u = points[:, 0] ** 2
    mesh = tidal_mesh(points, triangles)
    solution = tide(np.zeros(len(u)), u, -u, frequency=0.0, friction=1.0)
    blind = momentum_series(mesh, solution)
    seen = momentum_series(mesh, solution, VECTOR)
    assert error_at(blind, 1.0).max() < 1e-9
    assert np.allclose(error_at(seen, 1.0), np.sqrt(2.0) / 4.0)
    assert np.allclose(error_at(seen, 1.0, norm="largest"), 1.0 / 4.0)
    with pytest.raises(ValueError, match='must be "vector" or "largest"'):
        error_at(seen, 1.0, norm="sum")


def test_spacing_enters_by_node_and_unknown_nodes_have_no_error():
    points, triangles = equilateral_mesh(16, 16, 1.0)
    u = points[:, 0] ** 2
    series = momentum_series(
        tidal_mesh(points, triangles),
        tide(np.zeros(len(u)), u, u, frequency=0.0, friction=1.0),
        TruncationSettings(derivatives="lattice", delta="spacing"),
    )
    spacing = np.linspace(1.0, 2.0, len(points))
    error = error_at(series, spacing)
    assert np.isnan(error[0, ~series.known]).all()
    assert np.allclose(error[0, series.known], 2.0 * spacing[series.known] ** 2)


@pytest.mark.parametrize(("rings", "unknown"), [(0, 0), (1, 28), (2, 48)])
def test_rings_along_the_boundary_can_be_left_out(rings, unknown):
    points, triangles = equilateral_mesh(8, 8, 1.0)
    zero = np.zeros(len(points))
    series = momentum_series(
        tidal_mesh(points, triangles),
        tide(zero, zero, zero),
        TruncationSettings(skip_rings=rings),
    )
    assert (~series.known).sum() == unknown


def test_constituents_are_independent():
    points, triangles = graded_mesh(14)
    random = np.random.default_rng(0)
    n = len(points)

    def draw(*shape):
        return random.normal(size=shape) + 1j * random.normal(size=shape)

    both = TideSolution(
        names=("M2", "K1"),
        frequency=np.array([1.4e-4, 0.7e-4]),
        elevation=draw(2, n),
        velocity=draw(2, n, 2),
        friction=np.full(n, 1e-4),
        coriolis=np.full(n, 8e-5),
    )
    mesh = tidal_mesh(points, triangles)
    together = momentum_series(mesh, both, VECTOR)
    for c in range(2):
        one = TideSolution(
            names=both.names[c : c + 1],
            frequency=both.frequency[c : c + 1],
            elevation=both.elevation[c : c + 1],
            velocity=both.velocity[c : c + 1],
            friction=both.friction,
            coriolis=both.coriolis,
        )
        alone = momentum_series(mesh, one, VECTOR)
        assert np.array_equal(alone.second[0], together.second[c])
        assert np.array_equal(alone.fourth[0], together.fourth[c])


@pytest.mark.parametrize("derivatives", ["least_squares", "lattice"])
def test_narrow_channel_gives_finite_numbers(derivatives):
    points, triangles = channel_mesh(40, 1, bend=3e-5, spacing=900.0)
    wave = np.exp(1j * points[:, 0] / 50_000.0)
    series = momentum_series(
        tidal_mesh(points, triangles),
        tide(wave, wave, wave),
        TruncationSettings(derivatives=derivatives),
    )
    assert np.isfinite(series.second).all()
    assert np.isfinite(series.fourth).all()
    assert series.known.all() == (derivatives == "least_squares")


def test_progress_and_mismatch():
    points, triangles = equilateral_mesh(8, 8, 1.0)
    zero = np.zeros(len(points))
    seen = []
    momentum_series(
        tidal_mesh(points, triangles), tide(zero, zero, zero), progress=seen.append
    )
    assert seen[-1] == 1.0
    with pytest.raises(ValueError, match="the tide has 64 nodes, the mesh 25 points"):
        momentum_series(
            tidal_mesh(*equilateral_mesh(5, 5, 1.0)), tide(zero, zero, zero)
        )
