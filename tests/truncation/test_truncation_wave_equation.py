"""S against the discrete wave equation on an equilateral patch."""

import numpy as np
import pytest
from truncation_meshes import channel_mesh, equilateral_mesh, polynomial

from tidemesh.datatypes import CoastalMesh, TideSolution
from tidemesh.truncation import wave_equation_error

GRAVITY = 9.81
FREQUENCY = 1.3
FRICTION = 0.7
DEGREE = 6


def residual(wave, tensor, points):
    """I w e - div(K grad e) by the product rule; wave (n, n), tensor [ks, ka]."""

    def e(a, b):
        return polynomial(wave[..., None], points, a, b)[0]

    def k(i, a, b):
        return polynomial(tensor[i][..., None], points, a, b)[0]

    return (
        1j * FREQUENCY * e(0, 0)
        - k(0, 0, 0) * (e(2, 0) + e(0, 2))
        - k(0, 1, 0) * e(1, 0)
        - k(0, 0, 1) * e(0, 1)
        - (k(1, 1, 0) * e(0, 1) - k(1, 0, 1) * e(1, 0))
    )


def local_solution(tensor, seed):
    """Polynomial e whose residual vanishes to high order at the origin."""
    i, j = np.indices((DEGREE + 1, DEGREE + 1))
    terms = np.flatnonzero((i + j <= DEGREE).ravel())
    # Column by column: the residual of every monomial, expanded by sampling it on a
    # small grid and dividing by the grid's monomials.
    t = np.linspace(-1.0, 1.0, 2 * DEGREE)
    points = np.stack(np.meshgrid(t, t), axis=-1).reshape(-1, 2)
    columns = []
    for term in terms:
        unit = np.zeros((DEGREE + 1) ** 2, dtype=complex)
        unit[term] = 1.0
        columns.append(residual(unit.reshape(i.shape), tensor, points))
    n = DEGREE + 4
    sampled = np.polynomial.polynomial.polyvander2d(*points.T, [n, n])
    expanded = np.linalg.lstsq(sampled, np.array(columns).T, rcond=None)[0]
    a, b = np.divmod(np.arange((n + 1) ** 2), n + 1)
    equations = expanded[a + b <= DEGREE - 2]
    random = np.random.default_rng(seed)
    free = (j.ravel()[terms] <= 1).astype(float)
    given = random.normal(size=len(terms)) + 1j * random.normal(size=len(terms))
    system = np.concatenate([equations, np.eye(len(terms))[free > 0]])
    right = np.concatenate([np.zeros(len(equations)), given[free > 0]])
    wave = np.zeros((DEGREE + 1) ** 2, dtype=complex)
    wave[terms] = np.linalg.lstsq(system, right, rcond=None)[0]
    return wave.reshape(i.shape)


def discrete_residual(points, triangles, node, elevation, ks, ka):
    """P1 Galerkin residual at a node over its lumped mass: plain assembly."""
    total = area_sum = 0.0
    for triangle in triangles[(triangles == node).any(axis=1)]:
        corner = points[triangle]
        matrix = np.column_stack([np.ones(3), corner])
        slopes = np.linalg.inv(matrix)[1:]
        area = 0.5 * np.linalg.det(matrix)
        here = int(np.flatnonzero(triangle == node)[0])
        gradient = slopes @ elevation[triangle]
        s, a = ks[triangle].mean(), ka[triangle].mean()
        flux = np.array([[s, a], [-a, s]]) @ gradient
        mass = (elevation[triangle].sum() + elevation[node]) / 12.0
        total += area * (1j * FREQUENCY * mass + flux @ slopes[:, here])
        area_sum += area / 3.0
    return total / area_sum


@pytest.mark.parametrize("coriolis", [None, 0.4])
@pytest.mark.parametrize("seed", [0, 1])
def test_second_order_of_the_galerkin_wave_equation(coriolis, seed):
    random = np.random.default_rng(seed + 20)
    bed = 0.3 * random.normal(size=(4, 4))
    bed[np.add.outer(np.arange(4), np.arange(4)) > 3] = 0.0
    bed[0, 0] = 1.0
    q = 1j * FREQUENCY + FRICTION
    f = 0.0 if coriolis is None else coriolis
    scale = GRAVITY / (q**2 + f**2)
    wave = local_solution([scale * q * bed, scale * f * bed], seed)

    leading = []
    for spacing in (0.04, 0.02):
        points, triangles = equilateral_mesh(9, 9, spacing)
        node = 40
        points = points - points[node]
        elevation = polynomial(wave[..., None], points)[0]
        depth = polynomial(bed[..., None], points)[0]
        ks, ka = scale * q * depth, scale * f * depth
        found = discrete_residual(points, triangles, node, elevation, ks, ka)
        leading.append(found / (spacing / 2.0) ** 2)
    exact = (4.0 * leading[1] - leading[0]) / 3.0

    n = len(points)
    tide = TideSolution(
        names=("M2",),
        frequency=np.array([FREQUENCY]),
        elevation=elevation[None],
        velocity=np.zeros((1, n, 2)),
        friction=np.full(n, FRICTION),
        coriolis=None if coriolis is None else np.full(n, coriolis),
        gravity=GRAVITY,
    )
    mesh = CoastalMesh(points=points, triangles=triangles, depth=depth)
    found = wave_equation_error(mesh, tide)[0, node]
    assert abs(found - exact) < 2e-3 * abs(exact)


def test_constant_depth_gives_the_dispersion_error():
    # S = (i w)^2 e / (4 kappa): the wave length rule.
    points, triangles = equilateral_mesh(30, 30, 2000.0)
    frequency, friction, depth = 1.405e-4, 4e-4, 20.0
    n = len(points)
    kappa = GRAVITY * depth / (1j * frequency + friction)
    root = np.sqrt(1j * frequency / kappa)
    wave = np.exp(root * (0.6 * points[:, 0] + 0.8 * points[:, 1]))
    tide = TideSolution(
        names=("M2",),
        frequency=np.array([frequency]),
        elevation=wave[None],
        velocity=np.zeros((1, n, 2)),
        friction=np.full(n, friction),
    )
    mesh = CoastalMesh(points=points, triangles=triangles, depth=np.full(n, depth))
    found = wave_equation_error(mesh, tide)[0]
    exact = (1j * frequency) ** 2 * wave / (4.0 * kappa)
    assert np.allclose(found, exact, rtol=1e-3, atol=0.0)


def test_narrow_channel_and_arguments():
    points, triangles = channel_mesh(40, 1, spacing=900.0)
    n = len(points)
    tide = TideSolution(
        names=("M2",),
        frequency=np.array([1.4e-4]),
        elevation=np.exp(1j * points[:, 0] / 30_000.0)[None],
        velocity=np.zeros((1, n, 2)),
        friction=np.full(n, 1e-4),
        coriolis=np.full(n, 8e-5),
    )
    mesh = CoastalMesh(points=points, triangles=triangles, depth=np.full(n, 5.0))
    seen = []
    assert np.isfinite(wave_equation_error(mesh, tide, progress=seen.append)).all()
    assert seen == [1.0]
    with pytest.raises(ValueError, match="degree must be 3 or more"):
        wave_equation_error(mesh, tide, degree=2)
