"""The wave equation against closed forms, identities and another assembly."""

import numpy as np
import pytest
import scipy.sparse as sparse
import skfem
from annulus import Annulus, annulus_forcing, annulus_mesh
from numpy.testing import assert_allclose
from scipy.special import jv, yv

from tidemesh.constants import EARTH_ROTATION
from tidemesh.datatypes import BoundaryString, CoastalMesh, TideForcing
from tidemesh.errors import EngineError, InputError, MeshError
from tidemesh.geometry.projection import Projection
from tidemesh.tides import (
    FrequencyDomain,
    Symbols,
    TideSettings,
    WaveEquation,
    energy_balance,
    solve,
)
from tidemesh.tides.frequency_domain.direct import Factorisation
from tidemesh.tides.frequency_domain.elements import Elements

G = 9.81
OMEGA = 1.405189e-4
TAU = 4.0e-4


def relative(ours, exact):
    return np.linalg.norm(ours - exact) / np.linalg.norm(exact)


def rectangle(nx, ny, x, y, depth, *, projection=None):
    """Lattice with alternating diagonals; open at x[1], or all round."""
    xx, yy = np.meshgrid(np.linspace(*x, nx + 1), np.linspace(*y, ny + 1))
    points = np.stack([xx, yy], axis=-1).reshape(-1, 2)
    node = np.arange(xx.size).reshape(xx.shape)
    a, b = node[:-1, :-1].ravel(), node[:-1, 1:].ravel()
    c, d = node[1:, 1:].ravel(), node[1:, :-1].ravel()
    row, column = np.divmod(np.arange(len(a)), nx)
    even = ((row + column) % 2 == 0)[:, None]
    one = np.where(even, np.stack([a, b, c], 1), np.stack([a, b, d], 1))
    two = np.where(even, np.stack([a, c, d], 1), np.stack([b, c, d], 1))
    land = np.concatenate([node[-1, ::-1], node[-2::-1, 0], node[0, 1:]])
    return CoastalMesh(
        points,
        np.concatenate([one, two]),
        depth(*points.T),
        (BoundaryString("open", node[:, -1]), BoundaryString("mainland", land)),
        Projection() if projection is None else projection,
    )


def rim(mesh):
    x, y = mesh.points.T
    return np.flatnonzero(
        (x == x.min()) | (x == x.max()) | (y == y.min()) | (y == y.max())
    )


def forced(nodes, values, frequency=OMEGA):
    return TideForcing(("M2",), np.array([frequency]), nodes, np.array([values]))


def orders(errors):
    return np.log2(np.array(errors[:-1]) / errors[1:])


# --- closed forms -----------------------------------------------------------------


@pytest.mark.parametrize("power", [0, 1, 2])
@pytest.mark.parametrize(
    ("velocity", "velocity_order"),
    # One-sided at the boundary, the projections converge at 3/2 over all nodes; the
    # fit is of second order everywhere.
    [("lumped", 1.4), ("consistent", 1.4), ("recovered", 1.8)],
)
def test_quarter_annulus_is_second_order(power, velocity, velocity_order):
    settings = TideSettings(velocity=velocity, land_rule="none")
    elevation_errors, velocity_errors = [], []
    for n in (12, 24, 48):
        mesh = annulus_mesh(n, n * 4 // 3, power)
        tide = solve(mesh, annulus_forcing(mesh), settings)
        exact = Annulus(power)
        eta = exact.elevation(np.hypot(*mesh.points.T))[0]
        elevation_errors.append(relative(tide.elevation[0], eta))
        velocity_errors.append(relative(tide.velocity[0], exact.velocity(mesh.points)))
    assert orders(elevation_errors) == pytest.approx(2.0, abs=0.06)
    assert elevation_errors[-1] < 6e-4
    assert (orders(velocity_errors)[-1:] > velocity_order).all()


def test_annulus_velocity_is_second_order_away_from_the_boundary():
    errors = []
    for n in (12, 24, 48):
        mesh = annulus_mesh(n, n * 4 // 3, 2)
        tide = solve(mesh, annulus_forcing(mesh))
        inner = np.ones(len(mesh.points), dtype=bool)
        for string in mesh.boundaries:
            inner[string.nodes] = False
        exact = Annulus(2).velocity(mesh.points)
        errors.append(relative(tide.velocity[0][inner], exact[inner]))
    assert orders(errors)[-1] > 1.85


def channel_shapes():
    """Depth and two solutions of a channel, with their slopes at the closed end."""
    beta2 = (OMEGA**2 - 1j * OMEGA * TAU) / G

    def flat(x):
        k = np.sqrt(beta2 / 12.0)
        return np.cos(k * (x - 20e3)), np.sin(k * (x - 20e3))

    def linear(x):
        z = 2.0 * np.sqrt(beta2 / 4e-4 * x)
        return jv(0, z), yv(0, z)

    def quadratic(x):
        root = np.sqrt(0.25 - beta2 / 1e-8)
        return (x / 1e5) ** (-0.5 + root), (x / 1e5) ** (-0.5 - root)

    return {
        "flat": (lambda x: 12.0 + 0.0 * x, flat),
        "linear": (lambda x: 4e-4 * x, linear),
        "quadratic": (lambda x: 1e-8 * x**2, quadratic),
    }


@pytest.mark.parametrize("shape", ["flat", "linear", "quadratic"])
def test_channel(shape):
    depth, pair = channel_shapes()[shape]
    start, end = 20e3, 100e3
    # No flow at the closed end, by a fine one-sided difference of the closed form.
    near = np.array([start, start + 0.5, start + 1.0])
    slope = [
        np.dot([-3.0, 4.0, -1.0], values) / 1.0 for values in pair(near.astype(complex))
    ]
    top = [values[0] for values in pair(np.array([end + 0j]))]
    a, b = np.linalg.solve(np.array([slope, top]), np.array([0.0, 1.0]))
    errors = []
    for n in (20, 40, 80):
        mesh = rectangle(n, n // 10, (start, end), (0.0, 8e3), lambda x, y: depth(x))
        tide = solve(mesh, forced(mesh.open_nodes, np.ones(len(mesh.open_nodes))))
        first, second = pair(mesh.points[:, 0] + 0j)
        errors.append(relative(tide.elevation[0], a * first + b * second))
    assert orders(errors) == pytest.approx(2.0, abs=0.1)
    assert errors[-1] < 3e-4


def test_two_kelvin_waves_make_an_amphidrome():
    h, f = 40.0, 1.0e-4
    c = np.sqrt(G * h)
    k = OMEGA / c
    length, width = 1.6 * np.pi / k, 200e3
    errors = []
    for n in (20, 40, 80):
        mesh = rectangle(
            2 * n, n, (0.0, length), (-width / 2, width / 2), lambda x, y: h + 0.0 * x
        )
        x, y = mesh.points.T
        exact = np.exp(-f * y / c - 1j * k * x) + np.exp(f * y / c + 1j * k * x)
        ends = np.flatnonzero((x == 0.0) | (x == length))
        settings = TideSettings(friction=0.0, land_rule="none", velocity="recovered")
        tide = solve(mesh, forced(ends, exact[ends]), settings, coriolis=f)
        errors.append(relative(tide.elevation[0], exact))
    assert orders(errors) == pytest.approx(2.0, abs=0.1)
    assert errors[-1] < 2e-3

    # The crest turns once, to the left, about the point of no tide.
    centre = np.array([0.5 * np.pi / k, 0.0])
    ring = np.hypot(*(mesh.points - centre).T)
    near = np.argsort(ring)
    assert abs(tide.elevation[0][near[0]]) < 0.05
    around = (ring > 60e3) & (ring < 80e3)
    angle = np.arctan2(*(mesh.points[around] - centre).T[::-1])
    lag = np.unwrap(-np.angle(tide.elevation[0][around])[np.argsort(angle)])
    assert lag[-1] - lag[0] == pytest.approx(2.0 * np.pi, rel=0.1)
    # A Kelvin wave has no flow across the channel.
    u, v = tide.velocity[0].T
    assert np.abs(v).max() < 0.02 * np.abs(u).max()


def test_manufactured_solution_with_variable_depth_friction_and_rotation():
    a, b = 2.1e-5, -1.3e-5

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

    def source(x, y):
        step = 5.0
        symmetric, _ = conductivity(x, y)
        across = conductivity(x + step, y) - conductivity(x - step, y)
        along = conductivity(x, y + step) - conductivity(x, y - step)
        (sx, kx), (sy, ky) = across / (2 * step), along / (2 * step)
        e = exact(x, y)
        ex, ey = 1j * a * e, 1j * b * e
        lap = -(a * a + b * b) * e
        return 1j * OMEGA * e - (
            sx * ex + sy * ey + symmetric * lap + kx * ey - ky * ex
        )

    errors = []
    for n in (16, 32, 64):
        mesh = rectangle(n, n, (0.0, 150e3), (0.0, 120e3), depth)
        x, y = mesh.points.T
        equation = WaveEquation(
            mesh, rim(mesh), friction=friction(x, y), coriolis=coriolis(x, y)
        )
        corner = source(x, y)[equation.elements.corners]
        share = equation.elements.area / 12.0
        load = equation.elements.scatter(share * (corner.sum(axis=0) + corner))
        wave = equation.factorise(Symbols.exact(OMEGA))
        elevation = wave.elevation(exact(x, y)[equation.open_nodes])
        errors.append(relative(elevation + wave.respond(load), exact(x, y)))
    assert orders(errors) == pytest.approx(2.0, abs=0.1)
    assert errors[-1] < 1e-3


# --- identities -------------------------------------------------------------------


@pytest.fixture
def island():
    """A small mesh with a hole, uneven depth, friction and rotation."""
    mesh = annulus_mesh(7, 10, 1)
    rng = np.random.default_rng(3)
    centre = mesh.points[mesh.triangles].mean(axis=1)
    wet = np.hypot(*(centre - [70e3, 80e3]).T) > 12e3
    used = np.unique(mesh.triangles[wet])
    number = np.zeros(len(mesh.points), dtype=int)
    number[used] = np.arange(len(used))
    jitter = rng.uniform(-1e3, 1e3, (len(used), 2))
    return CoastalMesh(
        mesh.points[used] + jitter,
        number[mesh.triangles[wet]],
        rng.uniform(5.0, 30.0, len(used)),
        (BoundaryString("open", number[mesh.open_nodes]),),
    )


def test_matrix_equals_another_assembly(island):
    rng = np.random.default_rng(4)
    tau = rng.uniform(1e-4, 1e-3, len(island.points))
    f = rng.uniform(5e-5, 1e-4, len(island.points))
    equation = WaveEquation(island, island.open_nodes, friction=tau, coriolis=f)
    ours = equation.matrix(Symbols.exact(OMEGA))

    basis = skfem.CellBasis(
        skfem.MeshTri(island.points.T, island.triangles.T), skfem.ElementTriP1()
    )
    mean = {
        name: values[island.triangles].mean(axis=1)[:, None]
        for name, values in (("h", island.depth), ("tau", tau), ("f", f))
    }

    @skfem.BilinearForm(dtype=np.complex128)
    def form(e, z, w):
        q = 1j * OMEGA + w.tau
        factor = G * w.h / (q**2 + w.f**2)
        flow = factor * (q * e.grad[0] + w.f * e.grad[1])
        flow_y = factor * (q * e.grad[1] - w.f * e.grad[0])
        return 1j * OMEGA * e * z + flow * z.grad[0] + flow_y * z.grad[1]

    theirs = form.assemble(basis, **mean)
    assert abs(ours - theirs).max() < 1e-12 * abs(theirs).max()

    e = rng.normal(size=len(island.points)) + 1j * rng.normal(size=len(island.points))
    assert_allclose(equation.apply(Symbols.exact(OMEGA), e), ours @ e, rtol=1e-10)


def test_symmetric_without_rotation_only(island):
    symbols = Symbols.exact(OMEGA)
    still = WaveEquation(island, island.open_nodes).matrix(symbols)
    assert abs(still - still.T).max() <= 1e-14 * abs(still).max()
    turning = WaveEquation(island, island.open_nodes, coriolis=1e-4).matrix(symbols)
    reverse = WaveEquation(island, island.open_nodes, coriolis=-1e-4).matrix(symbols)
    assert abs(turning - turning.T).max() > 1e-3 * abs(turning).max()
    assert abs(turning - reverse.T).max() <= 1e-14 * abs(turning).max()


def test_transposed_solution_is_the_adjoint(island):
    equation = WaveEquation(island, island.open_nodes, coriolis=1e-4)
    wave = equation.factorise(Symbols.exact(OMEGA))
    rng = np.random.default_rng(5)
    free = np.ones(len(island.points))
    free[equation.open_nodes] = 0.0
    goal, load = free * rng.normal(size=(2, len(island.points)))
    forward = goal @ wave.respond(load)
    backward = load @ wave.respond(goal, transpose=True)
    assert forward == pytest.approx(backward, rel=1e-10)
    assert (wave.respond(load)[equation.open_nodes] == 0.0).all()


def test_effect_of_every_open_node_is_that_of_moving_it_alone(island):
    equation = WaveEquation(island, island.open_nodes, coriolis=1e-4)
    wave = equation.factorise(Symbols.exact(OMEGA))
    places = np.array([[3, 40], [0, equation.open_nodes[1]]])
    weights = np.zeros((2, len(island.points)))
    weights[np.arange(2)[:, None], places] = [[0.3, 0.7], [0.5, 0.5]]
    effect = wave.effect_of_open_nodes(sparse.csr_array(weights))
    moved = np.eye(len(equation.open_nodes))
    expected = np.stack([weights @ wave.elevation(row) for row in moved], axis=1)
    assert_allclose(effect, expected, rtol=0, atol=1e-11 * np.abs(expected).max())


@pytest.mark.parametrize("mass", ["consistent", "half_lumped", "lumped"])
@pytest.mark.parametrize("coriolis", [0.0, 9e-5])
def test_inflow_of_energy_is_lost_to_friction(island, mass, coriolis):
    tau = np.linspace(1e-4, 2e-3, len(island.points))
    nodes = island.open_nodes
    settings = TideSettings(mass=mass)
    values = np.exp(0.2j * np.arange(len(nodes)))
    tide = solve(
        island, forced(nodes, values), settings, friction=tau, coriolis=coriolis
    )
    balance = energy_balance(island, tide, nodes, settings)
    assert balance.dissipation[0] > 1e3
    assert_allclose(balance.inflow, balance.dissipation, rtol=1e-10)


def test_linear_in_the_forcing(island):
    nodes = island.open_nodes
    first = np.linspace(0.5, 1.0, len(nodes)) + 0j
    second = np.exp(0.3j * np.arange(len(nodes)))
    settings = TideSettings(coriolis="constant", latitude_deg=33.0)
    tides = [
        solve(island, forced(nodes, values), settings)
        for values in (first, second, 2.0 * first - 1j * second)
    ]
    for name in ("elevation", "velocity"):
        one, two, both = (getattr(tide, name)[0] for tide in tides)
        assert_allclose(both, 2.0 * one - 1j * two, atol=1e-12)


def test_a_steady_level_is_level(island):
    nodes = island.open_nodes
    tide = solve(island, forced(nodes, 0.3 * np.ones(len(nodes)), frequency=0.0))
    assert_allclose(tide.elevation[0], 0.3, atol=1e-12)
    assert_allclose(tide.velocity[0], 0.0, atol=1e-12)


def test_constituents_do_not_mix_and_report_progress(island):
    nodes = island.open_nodes
    values = np.ones((2, len(nodes)))
    both = TideForcing(("M2", "K1"), np.array([OMEGA, 7.29e-5]), nodes, values)
    seen = []
    tide = solve(island, both, progress=seen.append)
    alone = FrequencyDomain().solve(island, forced(nodes, values[0], 7.29e-5))
    assert tide.names == ("M2", "K1")
    assert_allclose(tide.elevation[1], alone.elevation[0], rtol=1e-13)
    assert seen[0] == 0.0
    assert seen[-1] == 1.0
    assert seen == sorted(seen)


def test_friction_of_elements_and_of_nodes(island):
    given = forced(island.open_nodes, np.ones(len(island.open_nodes)))
    one = solve(island, given, TideSettings(friction=7e-4))
    for shape in (len(island.points), len(island.triangles)):
        other = solve(island, given, friction=np.full(shape, 7e-4))
        assert_allclose(other.elevation, one.elevation, rtol=1e-12)
        assert_allclose(other.friction, 7e-4)
    with pytest.raises(ValueError, match="friction must be"):
        solve(island, given, friction=np.ones(3))
    with pytest.raises(InputError, match="finite and not negative"):
        solve(island, given, friction=-1.0)


def test_friction_of_every_constituent(island):
    nodes = island.open_nodes
    given = TideForcing(
        ("M2", "K1"), np.array([OMEGA, 7.29e-5]), nodes, np.ones((2, len(nodes)))
    )
    tau = np.stack([np.full(len(island.points), t) for t in (3e-4, 9e-4)])
    tide = solve(island, given, friction=tau)
    for k in range(2):
        alone = solve(island, given, TideSettings(friction=tau[k, 0]))
        assert_allclose(tide.elevation[k], alone.elevation[k], rtol=1e-12)
        assert_allclose(tide.velocity[k], alone.velocity[k], rtol=1e-12)
    assert_allclose(tide.friction, tau)
    balance = energy_balance(island, tide, nodes)
    assert_allclose(balance.inflow, balance.dissipation, rtol=1e-10)
    with pytest.raises(ValueError, match="3 rows of friction for 2 constituents"):
        solve(island, given, friction=np.ones((3, len(island.points))))


def test_friction_that_differs_with_the_direction(island):
    # Turning the mesh and the tensor together leaves the elevation.
    rng = np.random.default_rng(6)
    m = len(island.triangles)
    large, small = rng.uniform(2e-4, 9e-4, m), rng.uniform(1e-5, 1e-4, m)
    symbols = Symbols.exact(OMEGA)
    answers = []
    for angle in (0.0, 0.7):
        c, s = np.cos(angle), np.sin(angle)
        mesh = CoastalMesh(
            island.points @ np.array([[c, s], [-s, c]]),
            island.triangles,
            island.depth,
            island.boundaries,
        )
        tensor = np.stack(
            [
                c * c * large + s * s * small,
                c * s * (large - small),
                s * s * large + c * c * small,
            ]
        )
        equation = WaveEquation(mesh, mesh.open_nodes, friction=tensor, coriolis=9e-5)
        e = equation.factorise(symbols).elevation(np.ones(len(mesh.open_nodes)))
        answers.append(e)
        other = rng.normal(size=len(e)) + 0j
        by_matrix = equation.matrix(symbols) @ other
        assert_allclose(equation.apply(symbols, other), by_matrix, rtol=1e-9)
        # The momentum equation of every triangle.
        slope = equation.elements.gradient_of(e)
        u, v = equation.flow(symbols, slope)
        drag = equation.resistance(np.stack([u, v]))
        assert_allclose(1j * OMEGA * u - 9e-5 * v + drag[0], -G * slope[0], rtol=1e-9)
        assert_allclose(1j * OMEGA * v + 9e-5 * u + drag[1], -G * slope[1], rtol=1e-9)
    assert_allclose(answers[0], answers[1], rtol=1e-9)
    plain = WaveEquation(island, island.open_nodes, friction=large, coriolis=9e-5)
    same = plain.with_friction(np.stack([large, 0.0 * large, large]))
    assert_allclose(
        same.matrix(symbols).toarray(), plain.matrix(symbols).toarray(), atol=1e-9
    )


# --- place on the earth -----------------------------------------------------------


def test_coriolis_parameter_of_each_node():
    projection = Projection.stereographic(-79.4, 33.0)
    mesh = rectangle(
        4, 4, (-2e5, 2e5), (-2e5, 2e5), lambda x, y: 10.0 + 0 * x, projection=projection
    )
    given = forced(mesh.open_nodes, np.ones(5))
    tide = solve(mesh, given, TideSettings(coriolis="latitude"))
    latitude = np.radians(projection.inverse(mesh.points)[:, 1])
    assert_allclose(tide.coriolis, 2.0 * EARTH_ROTATION * np.sin(latitude), rtol=1e-12)
    fixed = solve(mesh, given, TideSettings(coriolis="constant", latitude_deg=30.0))
    assert_allclose(fixed.coriolis, EARTH_ROTATION, rtol=1e-12)


def test_areas_on_the_sphere_are_true():
    radius = 6378206.4
    projection = Projection(f"+proj=merc +lat_ts=40 +R={radius} +units=m")
    (x0, y0), (x1, y1) = projection.forward([0.0, 4.0], [38.0, 44.0])
    mesh = rectangle(
        60, 60, (x0, x1), (y0, y1), lambda x, y: 9.0 + 0 * x, projection=projection
    )
    settings = TideSettings(metric="sphere")
    area = WaveEquation(mesh, mesh.open_nodes, settings).elements.area.sum()
    south, north = np.sin(np.radians([38.0, 44.0]))
    assert area == pytest.approx(
        radius**2 * np.radians(4.0) * (north - south), rel=1e-4
    )


@pytest.mark.parametrize(
    "settings", [TideSettings(coriolis="latitude"), TideSettings(metric="sphere")]
)
def test_bare_plane_has_no_place(island, settings):
    given = forced(island.open_nodes, np.ones(len(island.open_nodes)))
    with pytest.raises(InputError, match="bare plane"):
        solve(island, given, settings)


# --- refusals ---------------------------------------------------------------------


def test_refuses_a_mesh_without_open_boundary(island):
    given = TideForcing(("M2",), np.array([OMEGA]), [], np.empty((1, 0)))
    with pytest.raises(EngineError, match="no open"):
        solve(island, given)


def test_refuses_forcing_of_another_mesh(island):
    with pytest.raises(EngineError, match="another mesh"):
        solve(island, forced([0, 10_000], [1.0, 1.0]))


def test_refuses_forcing_that_is_not_finite(island):
    with pytest.raises(InputError, match="M2 at ocean node 5 is not a finite"):
        solve(island, forced([4, 5], [1.0, np.nan]))


def test_refuses_dry_triangles(island):
    dry = CoastalMesh(island.points, island.triangles, island.depth - 15.0)
    with pytest.raises(MeshError, match=r"have no water.*raise the minimum depth"):
        solve(dry, forced([0, 1], [1.0, 1.0]))


def test_refuses_inverted_triangles_and_loose_nodes(island):
    flipped = CoastalMesh(island.points, island.triangles[:, ::-1], island.depth)
    with pytest.raises(MeshError, match="not counter-clockwise"):
        solve(flipped, forced([0, 1], [1.0, 1.0]))
    loose = CoastalMesh(
        np.vstack([island.points, [[0.0, 0.0]]]),
        island.triangles,
        np.append(island.depth, 1.0),
    )
    with pytest.raises(MeshError, match="belong to no triangle"):
        solve(loose, forced([0, 1], [1.0, 1.0]))


def test_refuses_a_steady_tide_without_friction(island):
    given = forced(island.open_nodes, np.ones(len(island.open_nodes)), frequency=0.0)
    with pytest.raises(EngineError, match="give friction"):
        solve(island, given, TideSettings(friction=0.0))


def test_factors_again_with_pivoting_and_names_a_singular_system():
    awkward = sparse.csc_array(np.array([[1e-30, 1.0], [1.0, 1e-30]], dtype=complex))
    rhs = np.array([1.0, 2.0 + 1j])
    solution = Factorisation(awkward).solve(rhs)
    assert_allclose(solution, [2.0 + 1j, 1.0], atol=1e-12)
    singular = sparse.csc_array(np.array([[1.0, 1.0], [1.0, 1.0]], dtype=complex))
    with pytest.raises(EngineError, match=r"cannot be solved|singular"):
        Factorisation(singular).solve(rhs)


def test_elements_of_one_triangle():
    mesh = CoastalMesh([[0, 0], [4, 0], [0, 2]], [[0, 1, 2]], [1.0, 2.0, 6.0])
    elements = Elements.of(mesh)
    assert elements.area[0] == 4.0
    assert elements.mean(mesh.depth)[0] == 3.0
    assert_allclose(elements.gradient_of(mesh.points @ [3.0, -5.0])[:, 0], [3.0, -5.0])
