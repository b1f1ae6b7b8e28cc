"""Tides that the astronomical forces make, against closed forms."""

import numpy as np
import pytest
from globe import DEPTH, icosphere, mesh_of, tilted_degree_two
from numpy.testing import assert_allclose

from tidemesh.constants import EARTH_RADIUS
from tidemesh.datatypes import BoundaryString, CoastalMesh, TideForcing
from tidemesh.errors import EngineError, InputError
from tidemesh.tides import (
    Symbols,
    TideSettings,
    WaveEquation,
    energy_balance,
    solve,
)

G = 9.81
OMEGA = 1.405189e-4
TAU = 2.0e-5
NONE = np.empty(0, int)


def relative(ours, exact):
    return np.linalg.norm(ours - exact) / np.linalg.norm(exact)


def orders(errors):
    return np.log2(np.array(errors[:-1]) / errors[1:])


def lake(n, length=800e3, width=500e3, depth=None):
    """Rectangle without an open boundary."""
    x, y = np.meshgrid(np.linspace(0.0, length, n + 1), np.linspace(0.0, width, n + 1))
    points = np.stack([x, y], axis=-1).reshape(-1, 2)
    node = np.arange(x.size).reshape(x.shape)
    a, b = node[:-1, :-1].ravel(), node[:-1, 1:].ravel()
    c, d = node[1:, 1:].ravel(), node[1:, :-1].ravel()
    row, column = np.divmod(np.arange(len(a)), n)
    even = ((row + column) % 2 == 0)[:, None]
    one = np.where(even, np.stack([a, b, c], 1), np.stack([a, b, d], 1))
    two = np.where(even, np.stack([a, c, d], 1), np.stack([b, c, d], 1))
    height = np.full(len(points), 40.0) if depth is None else depth(*points.T)
    return CoastalMesh(points, np.concatenate([one, two]), height)


def moved(potential, frequency=OMEGA, nodes=NONE, elevation=None):
    """A forcing by a potential, and by elevations at nodes."""
    if elevation is None:
        elevation = np.empty((1, 0))
    return TideForcing(
        ("M2",), np.array([frequency]), nodes, elevation, potential=potential[None]
    )


def test_a_lake_follows_a_potential_of_one_mode():
    # e - p has no slope across the shore, so e = p s/(i w + s), s = g h kappa**2/q.
    settings = TideSettings(friction=TAU, velocity="recovered", land_rule="none")
    q = 1j * OMEGA + TAU
    a, b = np.pi / 800e3, 2.0 * np.pi / 500e3
    s = G * 40.0 * (a**2 + b**2) / q
    heights, currents = [], []
    for n in (12, 24, 48):
        mesh = lake(n)
        x, y = mesh.points.T
        potential = 0.3j * np.cos(a * x) * np.cos(b * y)
        tide = solve(mesh, moved(potential), settings)
        heights.append(relative(tide.elevation[0], potential * s / (1j * OMEGA + s)))
        slope = -1j * OMEGA / (1j * OMEGA + s) * 0.3j
        gradient = -slope * np.column_stack(
            [a * np.sin(a * x) * np.cos(b * y), b * np.cos(a * x) * np.sin(b * y)]
        )
        currents.append(relative(tide.velocity[0], -G / q * gradient))
    assert orders(heights) == pytest.approx(2.0, abs=0.15)
    assert heights[-1] < 3e-3
    assert orders(currents)[-1] > 1.7


def test_the_whole_ocean_follows_a_potential_of_degree_two():
    # e = p s/(i w + s), s = 6 g h/(q R**2), since lap p = -6 p/R**2.
    q = 1j * OMEGA + TAU
    s = 6.0 * G * DEPTH / (q * EARTH_RADIUS**2)
    settings = TideSettings(friction=TAU, metric="geographic")
    errors = []
    for level in (2, 3, 4):
        points, triangles = icosphere(level)
        potential = tilted_degree_two(points)
        tide = solve(mesh_of(points, triangles), moved(potential), settings)
        errors.append(relative(tide.elevation[0], potential * s / (1j * OMEGA + s)))
    assert np.all(orders(errors) > 1.9)


def test_variable_depth_friction_rotation_and_potential_at_second_order():
    a, b = 2.1e-5, -1.3e-5
    c, d = -0.9e-5, 1.7e-5

    def depth(x, y):
        return 20.0 + 12.0 * np.sin(x / 3e4) * np.cos(y / 4e4)

    def friction(x, y):
        return 3e-4 + 2e-4 * np.cos(x / 5e4 + y / 6e4)

    def coriolis(x, y):
        return 1e-4 + 4e-10 * y

    def conductivity(x, y):
        q, f = 1j * OMEGA + friction(x, y), coriolis(x, y)
        return G * depth(x, y) * np.array([q, f]) / (q * q + f * f)

    def exact(x, y):
        return np.exp(1j * (a * x + b * y))

    def potential(x, y):
        return 0.4 * np.exp(1j * (c * x + d * y))

    def source(x, y):
        step = 5.0
        symmetric, _ = conductivity(x, y)
        across = conductivity(x + step, y) - conductivity(x - step, y)
        along = conductivity(x, y + step) - conductivity(x, y - step)
        (sx, kx), (sy, ky) = across / (2 * step), along / (2 * step)
        e, p = exact(x, y), potential(x, y)
        ex, ey = 1j * a * e - 1j * c * p, 1j * b * e - 1j * d * p
        lap = -(a * a + b * b) * e + (c * c + d * d) * p
        return 1j * OMEGA * e - (
            sx * ex + sy * ey + symmetric * lap + kx * ey - ky * ex
        )

    errors = []
    for n in (16, 32, 64):
        mesh = lake(n, 150e3, 120e3, depth)
        x, y = mesh.points.T
        edge = (x == 0) | (x == x.max()) | (y == 0) | (y == y.max())
        rim = np.flatnonzero(edge)
        equation = WaveEquation(
            mesh, rim, friction=friction(x, y), coriolis=coriolis(x, y)
        )
        symbols = Symbols.exact(OMEGA)
        corner = source(x, y)[equation.elements.corners]
        share = equation.elements.area / 12.0
        load = equation.elements.scatter(share * (corner.sum(axis=0) + corner))
        # The slope of the equilibrium tide moves the water as does that of the sea.
        slope = -equation.elements.gradient_of(potential(x, y))
        load += equation.divergence(equation.depth * equation.flow(symbols, slope))
        wave = equation.factorise(symbols)
        ours = wave.elevation(exact(x, y)[rim], load)
        errors.append(relative(ours, exact(x, y)))
    assert orders(errors) == pytest.approx(2.0, abs=0.1)
    assert errors[-1] < 1e-3


@pytest.mark.parametrize("law", ["linear", "quadratic"])
def test_a_sea_in_equilibrium_is_at_rest(law):
    # An ocean boundary that is in equilibrium, too: no slope of e - p anywhere.
    mesh = lake(8)
    x, y = mesh.points.T
    potential = 0.2 * np.exp(1j * (x + 2.0 * y) / 1e6) + 0.1
    slow = 1e-12
    nodes = np.flatnonzero(x == x.max())
    forcing = moved(potential, slow, nodes, potential[None, nodes])
    tide = solve(mesh, forcing, TideSettings(friction_law=law, tolerance=1e-8))
    assert_allclose(tide.elevation[0], potential, atol=1e-6)
    assert np.abs(tide.velocity).max() < 1e-4


def test_water_stays_in_a_lake_and_energy_is_balanced():
    def depth(x, y):
        return 30.0 + 20.0 * np.sin(x / 1e5) * np.cos(y / 1e5)

    mesh = lake(10, depth=depth)
    x, y = mesh.points.T
    potential = 0.3 * np.exp(1j * (2 * x - y) / 1e6)
    for law in ("linear", "quadratic"):
        settings = TideSettings(
            friction_law=law, friction=TAU, coriolis="constant", latitude_deg=45.0
        )
        tide = solve(mesh, moved(potential), settings)
        elements = WaveEquation(mesh, NONE, settings).elements
        volume = (elements.area * elements.mean(tide.elevation[0])).sum()
        swing = (elements.area * np.abs(elements.mean(tide.elevation[0]))).sum()
        assert abs(volume) < 1e-9 * swing
        balance = energy_balance(mesh, tide, NONE, settings)
        assert balance.inflow[0] == 0.0
        assert balance.dissipation[0] > 0.0
        assert balance.potential[0] == pytest.approx(balance.dissipation[0], rel=1e-9)


def test_potential_and_boundary_add_up():
    mesh = lake(8)
    x, y = mesh.points.T
    nodes = np.flatnonzero(x == x.max())
    potential = 0.3 * np.exp(1j * (2 * x - y) / 1e6)
    level = np.exp(1j * y[nodes] / 1e6)[None]
    settings = TideSettings(friction=TAU)
    both = solve(mesh, moved(potential, nodes=nodes, elevation=level), settings)
    inside = solve(mesh, moved(potential, nodes=nodes, elevation=0 * level), settings)
    outside = solve(mesh, moved(0 * potential, nodes=nodes, elevation=level), settings)
    assert_allclose(both.elevation, inside.elevation + outside.elevation, atol=1e-12)
    assert_allclose(both.velocity, inside.velocity + outside.velocity, atol=1e-12)


# --- refusals ---------------------------------------------------------------------


def test_refuses_a_lake_that_nothing_drives():
    forcing = TideForcing(("M2",), np.array([OMEGA]), NONE, np.empty((1, 0)))
    with pytest.raises(EngineError, match=r"no open .* nothing drives the tide"):
        solve(lake(4), forcing)


def test_refuses_a_potential_that_does_not_fit():
    mesh = lake(4)
    with pytest.raises(InputError, match="has 3 nodes, the mesh 25: it belongs"):
        solve(mesh, moved(np.ones(3)))
    potential = np.ones(25, dtype=complex)
    potential[6] = np.nan
    with pytest.raises(InputError, match="potential of M2 at node 6 is not a finite"):
        solve(mesh, moved(potential))


def test_refuses_forcing_that_misses_an_ocean_node():
    mesh = lake(4)
    mesh = CoastalMesh(
        mesh.points, mesh.triangles, mesh.depth, (BoundaryString("open", [0, 1, 2]),)
    )
    forcing = TideForcing(("M2",), np.array([OMEGA]), [0, 2], np.ones((1, 2)))
    with pytest.raises(InputError, match=r"misses 1 of 3 nodes.*first is node 1"):
        solve(mesh, forcing)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"nodal_factor": [0.0]}, "nodal factor of M2 must be positive"),
        ({"argument": [np.nan]}, "argument of M2 is not a finite"),
        ({"frequency": [-1e-4]}, "frequencies of the forcing must be finite"),
    ],
)
def test_refuses_forcing_without_sense(change, message):
    mesh = lake(4)
    given = {
        "names": ("M2",),
        "frequency": [OMEGA],
        "nodes": [0, 1],
        "elevation": np.ones((1, 2)),
    }
    with pytest.raises(InputError, match=message):
        solve(mesh, TideForcing(**{**given, **change}))
