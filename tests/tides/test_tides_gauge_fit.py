"""Boundary values from gauges: twin experiments whose truth is known."""

from dataclasses import replace

import numpy as np
import pytest

from tidemesh.datatypes import BoundaryString, CoastalMesh, TideForcing, TideTable
from tidemesh.errors import EngineError, InputError
from tidemesh.tides import TideSettings, gauge_fit, solve
from tidemesh.tides.gauge_fit import SLOPE_PENALTY, Roughness, fit_boundary
from tidemesh.triangulation.locate import Locator

WIDTH, LENGTH = 60e3, 40e3
M2, K1 = 1.405189e-4, 7.2921e-5


def bay(nx=13, ny=9):
    """A shelf open to the south and the east, deeper offshore; no map projection."""
    x, y = np.meshgrid(np.linspace(0, WIDTH, nx), np.linspace(0, LENGTH, ny))
    points = np.column_stack([x.ravel(), y.ravel()])
    corner = (np.arange(ny - 1)[:, None] * nx + np.arange(nx - 1)).ravel()
    triangles = np.concatenate(
        [
            np.column_stack([corner, corner + 1, corner + nx + 1]),
            np.column_stack([corner, corner + nx + 1, corner + nx]),
        ]
    )
    south, east = np.arange(nx), np.arange(1, ny) * nx + nx - 1
    north = (ny - 1) * nx + np.arange(nx - 1)[::-1]
    west = np.arange(ny - 2, -1, -1) * nx
    return CoastalMesh(
        points,
        triangles,
        10.0 + 40.0 * (1.0 - points[:, 1] / LENGTH),
        (
            BoundaryString("open", np.concatenate([south, east])),
            BoundaryString("mainland", np.concatenate([east[-1:], north, west])),
        ),
    )


MESH = bay()
LINEAR = TideSettings(
    constituents=("M2", "K1"), friction=2e-4, coriolis="constant", latitude_deg=33.0
)


def fraction_along(mesh):
    run = mesh.points[mesh.open_nodes]
    steps = np.hypot(*np.diff(run, axis=0).T)
    return np.append(0.0, np.cumsum(steps)) / steps.sum()


def smooth_truth(mesh):
    s = fraction_along(mesh)
    m2 = (0.9 - 0.4 * s + 0.15 * np.sin(2.5 * s)) * np.exp(-0.6j * s)
    return np.stack([m2, (0.1 + 0.02 * s) * np.exp(-2.0j - 0.3j * s)])


def forcing_of(mesh, boundary):
    return TideForcing(("M2", "K1"), np.array([M2, K1]), mesh.open_nodes, boundary)


def gauges_at(places, elevation):
    return TideTable(
        places[:, 0],
        places[:, 1],
        ("M2", "K1"),
        np.array([M2, K1]),
        elevation,
        tuple(f"gauge {k}" for k in range(len(places))),
    )


def observe(mesh, places, tide):
    locator = Locator(mesh.points, mesh.triangles)
    return gauges_at(places, locator.interpolate(tide.elevation, places))


def shore_places(n):
    return np.column_stack([np.linspace(1e3, WIDTH - 1.5e3, n), np.full(n, 38e3)])


def twin(n, settings=LINEAR, mesh=MESH):
    tide = solve(mesh, forcing_of(mesh, smooth_truth(mesh)), settings)
    return observe(mesh, shore_places(n), tide)


def noisy(table, size, seed=3):
    rng = np.random.default_rng(seed)
    noise = rng.standard_normal((2, *table.elevation.shape))
    return replace(table, elevation=table.elevation + size * (noise[0] + 1j * noise[1]))


@pytest.mark.parametrize("discretisation", ["galerkin", "gwce"])
def test_effect_is_the_answer_to_one_metre_at_one_node(discretisation):
    settings = TideSettings(
        constituents=("M2",),
        friction=2e-4,
        tau0=5e-4,
        coriolis="constant",
        discretisation=discretisation,
    )
    places = np.array([[3e3, 37e3], [41e3, 12e3], [30e3, 0.0]])
    locator = Locator(MESH.points, MESH.triangles)
    triangle, weight = locator.find(places)
    place = np.zeros((3, len(MESH.points)))
    np.add.at(place, (np.arange(3)[:, None], MESH.triangles[triangle]), weight)
    equation = gauge_fit._equation(MESH, MESH.open_nodes, settings, None)
    effect = gauge_fit._effects(equation, None, np.array([M2]), place)[0]
    for column in (0, 5, 12, 20):
        unit = np.zeros((1, len(MESH.open_nodes)), dtype=complex)
        unit[0, column] = 1.0
        forcing = TideForcing(("M2",), np.array([M2]), MESH.open_nodes, unit)
        tide = solve(MESH, forcing, settings)
        expected = locator.interpolate(tide.elevation[0], places)
        assert np.abs(effect[:, column] - expected).max() < 1e-11


def test_as_many_gauges_as_nodes_recover_any_boundary():
    # One gauge near every node of the boundary, and values without any smoothness.
    rng = np.random.default_rng(5)
    n = len(MESH.open_nodes)
    truth = rng.standard_normal((2, n)) + 1j * rng.standard_normal((2, n))
    inward = np.array([-0.1e3, 0.1e3])
    places = np.clip(MESH.points[MESH.open_nodes] + inward, 0.0, [WIDTH, LENGTH])
    tide = solve(MESH, forcing_of(MESH, truth), LINEAR)
    fit = fit_boundary(MESH, observe(MESH, places, tide), LINEAR, smoothness=1e-14)
    assert np.abs(fit.forcing.elevation - truth).max() < 1e-6
    assert np.abs(fit.residual).max() < 1e-6


@pytest.mark.parametrize("smoothness", [1e-4, 1.0, 1e6, None])
def test_constants_cost_nothing(smoothness):
    tide = solve(MESH, forcing_of(MESH, np.full((2, 21), 0.7 - 0.2j)), LINEAR)
    table = observe(MESH, shore_places(4), tide)
    fit = fit_boundary(MESH, table, LINEAR, smoothness=smoothness)
    assert np.abs(fit.forcing.elevation - (0.7 - 0.2j)).max() < 1e-9
    assert np.abs(fit.leave_one_out).max() < 1e-9


def test_one_gauge_gives_a_constant_boundary():
    table = twin(1)
    fit = fit_boundary(MESH, table, LINEAR)
    assert np.ptp(fit.forcing.elevation.real, axis=1).max() < 1e-9
    assert np.abs(fit.residual).max() < 1e-12
    assert np.isnan(fit.leave_one_out).all()
    assert np.isnan(fit.standard_error).all()


def test_more_gauges_come_nearer_to_a_smooth_truth():
    truth = smooth_truth(MESH)
    error = [
        np.abs(fit_boundary(MESH, twin(n), LINEAR).forcing.elevation - truth).max()
        for n in (2, 4, 12)
    ]
    assert error[0] > error[1] > error[2]
    # The arc is 100 km long and the gauges are on the opposite shore alone.
    assert error[2] < 0.02


def test_errors_of_gauges_left_out_are_those_of_fits_without_them():
    table = noisy(twin(7), 0.02)
    gap = table.elevation.copy()
    gap[1, 2] = np.nan
    table = replace(table, elevation=gap)
    smoothness = np.array([3e-3, 2e-2])
    fit = fit_boundary(MESH, table, LINEAR, smoothness=smoothness)
    assert np.isnan(fit.leave_one_out[1, 2])
    assert np.isnan(fit.residual[1, 2])
    locator = Locator(MESH.points, MESH.triangles)
    for k in range(7):
        kept = np.delete(np.arange(7), k)
        without = fit_boundary(
            MESH, gauge_fit._subset(table, kept), LINEAR, smoothness=smoothness
        )
        tide = solve(MESH, without.forcing, LINEAR)
        place = np.array([[table.longitude_deg[k], table.latitude_deg[k]]])
        predicted = locator.interpolate(tide.elevation, place)[:, 0]
        expected = table.elevation[:, k] - predicted
        known = np.isfinite(expected)
        assert np.abs(fit.leave_one_out[known, k] - expected[known]).max() < 1e-9


def test_fit_is_linear_in_the_observations():
    one, two = noisy(twin(6), 0.1, seed=1), noisy(twin(6), 0.1, seed=2)
    factor = 0.3 - 1.2j
    both = replace(one, elevation=one.elevation + factor * two.elevation)

    def fitted(table):
        fit = fit_boundary(MESH, table, LINEAR, smoothness=1e-3)
        return fit.forcing.elevation

    expected = fitted(one) + factor * fitted(two)
    assert np.abs(fitted(both) - expected).max() < 1e-11


def test_fit_minimises_misfit_and_roughness():
    table = noisy(twin(5), 0.05)
    fit = fit_boundary(MESH, table, LINEAR, smoothness=2e-3)
    matrix = Roughness(MESH).matrix
    locator = Locator(MESH.points, MESH.triangles)
    places = np.column_stack([table.longitude_deg, table.latitude_deg])

    def cost(boundary):
        tide = solve(MESH, forcing_of(MESH, boundary), LINEAR)
        misfit = table.elevation - locator.interpolate(tide.elevation, places)
        rough = np.einsum("ki,ij,kj->", boundary.conj(), matrix, boundary).real
        return (np.abs(misfit) ** 2).sum() + 2e-3 * rough

    least = cost(fit.forcing.elevation)
    rng = np.random.default_rng(8)
    for _ in range(4):
        step = 1e-3 * (rng.standard_normal((2, 21)) + 1j * rng.standard_normal((2, 21)))
        ahead = cost(fit.forcing.elevation + step)
        behind = cost(fit.forcing.elevation - step)
        # A parabola whose vertex is at the fit.
        assert abs(ahead - behind) < 1e-6 * (ahead - least)
        assert ahead > least


def test_standard_error_is_that_of_the_full_normal_equations():
    table, smoothness = noisy(twin(6), 0.05), 2e-3
    fit = fit_boundary(MESH, table, LINEAR, smoothness=smoothness)
    unit = np.eye(len(MESH.open_nodes))
    locator = Locator(MESH.points, MESH.triangles)
    places = np.column_stack([table.longitude_deg, table.latitude_deg])
    columns = []
    for column in unit:
        tide = solve(MESH, forcing_of(MESH, np.stack([column, column])), LINEAR)
        columns.append(locator.interpolate(tide.elevation, places))
    for k, effect in enumerate(np.stack(columns, axis=-1)):
        adjoint = effect.conj().T
        inverse = np.linalg.inv(adjoint @ effect + smoothness * Roughness(MESH).matrix)
        freedom = 6 - np.trace(effect @ inverse @ adjoint).real
        variance = (np.abs(fit.residual[k]) ** 2).sum() / freedom
        expected = np.sqrt(variance * np.diag(inverse).real)
        assert np.abs(fit.standard_error[k] - expected).max() < 1e-6 * expected.max()
    # The gauges are on the north shore: the boundary's north end is known best.
    assert (fit.standard_error.argmin(axis=1) > 12).all()


def test_noise_is_smoothed_away():
    truth = smooth_truth(MESH)
    table = noisy(twin(10), 0.02)
    chosen = fit_boundary(MESH, table, LINEAR)
    close = fit_boundary(MESH, table, LINEAR, smoothness=1e-9)
    error = [np.abs(fit.forcing.elevation - truth).max() for fit in (chosen, close)]
    assert error[0] < 0.3 * error[1]
    # Left out, a gauge is predicted to its own error and little more.
    assert np.sqrt((np.abs(chosen.leave_one_out) ** 2).mean()) < 0.05


def test_right_first_guess_stays():
    guess = forcing_of(MESH, smooth_truth(MESH))
    for smoothness in (1e-6, 10.0, None):
        fit = fit_boundary(
            MESH, twin(5), LINEAR, first_guess=guess, smoothness=smoothness
        )
        assert np.abs(fit.forcing.elevation - guess.elevation).max() < 1e-9


def test_quadratic_friction_is_iterated():
    settings = TideSettings(
        constituents=("M2", "K1"),
        friction_law="quadratic",
        drag_coefficient=5e-3,
        coriolis="constant",
        tolerance=1e-6,
    )
    table = twin(12, settings)
    found = fit_boundary(MESH, table, settings, smoothness=1e-6)
    tide = solve(MESH, found.forcing, settings)
    places = np.column_stack([table.longitude_deg, table.latitude_deg])
    at_gauges = Locator(MESH.points, MESH.triangles).interpolate(tide.elevation, places)
    # What the fit claims is what the nonlinear model gives, and it matches the gauges.
    assert np.abs(at_gauges - found.modelled).max() < 1e-3
    assert np.abs(found.residual).max() < 2e-3
    assert np.abs(found.forcing.elevation - smooth_truth(MESH)).max() < 0.03


def test_tidal_potential_is_not_blamed_on_the_boundary():
    potential = np.outer([0.2, 0.1j], MESH.points[:, 0] / WIDTH)

    def complete(forcing):
        return replace(forcing, potential=potential)

    truth = forcing_of(MESH, smooth_truth(MESH))
    tide = solve(MESH, complete(truth), LINEAR)
    table = observe(MESH, shore_places(5), tide)
    fit = fit_boundary(MESH, table, LINEAR, first_guess=truth, complete=complete)
    assert np.abs(fit.forcing.elevation - truth.elevation).max() < 1e-9
    assert np.abs(fit.residual).max() < 1e-9
    assert fit.forcing.potential is not None
    bare = fit_boundary(MESH, table, LINEAR, first_guess=truth)
    assert np.abs(bare.forcing.elevation - truth.elevation).max() > 1e-2


def test_gauge_of_another_water_is_found():
    table = noisy(twin(9), 0.005)
    wrong = table.elevation.copy()
    wrong[0, 4] *= 0.6 * np.exp(-0.7j)
    table = replace(table, elevation=wrong)
    kept = fit_boundary(MESH, table, LINEAR)
    assert len(kept.gauges.stations) == 9
    fit = fit_boundary(MESH, table, LINEAR, outlier=4.0)
    assert [row.station for row in fit.left_out] == ["gauge 4"]
    assert "disagrees with the others by 0." in fit.left_out[0].reason


def test_roughness_of_known_curves():
    # A straight open string of n nodes at uneven distances.
    n = 801
    s = np.linspace(0.0, 1.0, n) ** 1.2
    points = np.column_stack([5e4 * s, np.zeros(n)])
    mesh = CoastalMesh(
        points,
        np.empty((0, 3), dtype=int),
        np.ones(n),
        (BoundaryString("open", np.arange(n)),),
    )
    matrix = Roughness(mesh).matrix
    assert np.abs(matrix @ np.ones(n)).max() < 1e-9 * np.abs(matrix).max()
    # b = s**2 has b'' = 2 and the mean square slope 4/3.
    expected = 4.0 + SLOPE_PENALTY * 4.0 / 3.0
    assert s**2 @ matrix @ s**2 == pytest.approx(expected, rel=6e-3)


def test_roughness_is_measured_along_the_travel_time():
    # Depth h = (1 + 3 s)**4: the time is the integral of ds / (1 + 3 s)**2.
    n = 2001
    s = np.linspace(0.0, 1.0, n)
    mesh = CoastalMesh(
        np.column_stack([3e5 * s, np.zeros(n)]),
        np.empty((0, 3), dtype=int),
        5.0 * (1.0 + 3.0 * s) ** 4,
        (BoundaryString("open", np.arange(n)),),
    )
    time = (1.0 - 1.0 / (1.0 + 3.0 * s)) / 0.75
    expected = 4.0 + SLOPE_PENALTY * 4.0 / 3.0
    found = time**2 @ Roughness(mesh).matrix @ time**2
    assert found == pytest.approx(expected, rel=6e-3)


def test_roughness_of_a_ring_and_of_several_strings():
    n = 400
    angle = 2.0 * np.pi * np.arange(n) / n
    points = 1e4 * np.column_stack([np.cos(angle), np.sin(angle)])
    none = np.empty((0, 3), dtype=int)
    ring = CoastalMesh(
        points, none, np.ones(n), (BoundaryString("open", np.arange(n), closed=True),)
    )
    wave = np.cos(angle)
    k = 2.0 * np.pi
    expected = 0.5 * (k**4 + SLOPE_PENALTY * k**2)
    assert wave @ Roughness(ring).matrix @ wave == pytest.approx(expected, rel=1e-3)

    halves = [BoundaryString("open", half) for half in np.split(np.arange(n), 2)]
    matrix = Roughness(CoastalMesh(points, none, np.ones(n), tuple(halves))).matrix
    step = np.repeat([0.0, 1.0], n // 2)
    # Each string is constant; their means differ by half a metre from the common one.
    assert step @ matrix @ step == pytest.approx(0.5, rel=1e-3)
    assert np.linalg.eigvalsh(matrix)[1] > 1e-6


def test_rows_left_out_are_listed_with_the_reason():
    places = shore_places(3)
    places = np.concatenate([places, places[1:2] + 100.0, [[30e3, 52e3], [9e3, 30e3]]])
    elevation = np.full((2, 6), 0.5 + 0.1j)
    # Zero amplitude: not determined.
    elevation[:, 5] = 0.0, np.nan
    elevation[1, 0] = 0.0
    fit = fit_boundary(MESH, gauges_at(places, elevation), LINEAR)
    assert fit.gauges.stations == ("gauge 0", "gauge 1", "gauge 2")
    assert np.isnan(fit.observed[1, 0])
    assert fit.forcing.names == ("M2", "K1")
    reasons = {row.station: row.reason for row in fit.left_out}
    assert reasons == {
        "gauge 3": "repeats gauge 1",
        "gauge 4": "12.0 km outside the mesh",
        "gauge 5": "none of the constituents is known there",
    }
    near = fit_boundary(MESH, gauges_at(places, elevation), LINEAR, max_distance_m=13e3)
    assert "gauge 4" in near.gauges.stations


def test_constituents_come_in_the_order_of_the_settings():
    settings = TideSettings(constituents=("k1", "M2"), friction=2e-4)
    table = twin(3)
    fit = fit_boundary(MESH, table, settings)
    assert fit.gauges.names == ("K1", "M2")
    assert (fit.observed == table.elevation[::-1]).all()
    assert fit.forcing.frequency.tolist() == [K1, M2]


def test_bad_input_is_refused():
    table = twin(3)
    far = replace(table, longitude_deg=table.longitude_deg + 1e6)
    with pytest.raises(InputError, match=r"0 gauges in the mesh or within 3 km .*M2"):
        fit_boundary(MESH, far, LINEAR)
    with pytest.raises(InputError, match=r"3 gauges .* know M2, .* needs 4"):
        fit_boundary(MESH, table, LINEAR, minimum_gauges=4)
    with pytest.raises(InputError, match=r"gauges has no S2; it has M2, K1"):
        fit_boundary(MESH, table, TideSettings(constituents=("M2", "S2")))
    with pytest.raises(InputError, match=r"must be positive"):
        fit_boundary(MESH, table, LINEAR, smoothness=0.0)
    with pytest.raises(ValueError, match=r"got shape \(3,\)"):
        fit_boundary(MESH, table, LINEAR, smoothness=np.ones(3))
    guess = forcing_of(MESH, smooth_truth(MESH))
    other = replace(guess, nodes=guess.nodes[::-1])
    with pytest.raises(InputError, match=r"not for the open nodes of this mesh"):
        fit_boundary(MESH, table, LINEAR, first_guess=other)
    short = TideForcing(("M2",), guess.frequency[:1], guess.nodes, guess.elevation[:1])
    with pytest.raises(InputError, match=r"first guess .* has no K1; it has M2"):
        fit_boundary(MESH, table, LINEAR, first_guess=short)
    with pytest.raises(EngineError, match=r"no open \(ocean\) boundary"):
        fit_boundary(replace(MESH, boundaries=()), table, LINEAR)


def test_gauge_that_stands_alone_is_no_outlier():
    # Left out, the one gauge in the east is predicted badly, and it is right.
    table = twin(9)
    kept = np.array([0, 1, 2, 3, 8])
    table = noisy(gauge_fit._subset(table, kept), 0.003)
    fit = fit_boundary(MESH, table, LINEAR, outlier=4.0, smoothness=1e-4)
    errors = np.abs(fit.leave_one_out[0])
    assert errors[4] > 4.0 * np.median(errors)
    assert fit.left_out == ()
