"""ADCIRC's wave continuity equation: against ADCIRC, closed forms, identities."""

from __future__ import annotations

import adcirc_cases
import numpy as np
import pytest
from annulus import FREQUENCY, FRICTION, Annulus, annulus_forcing, annulus_mesh
from globe import DEPTH, icosphere, mesh_of, tilted_degree_two

from tidemesh.constants import EARTH_RADIUS
from tidemesh.datatypes import TideForcing
from tidemesh.errors import EngineError, InputError
from tidemesh.tides import TideSettings, WaveEquation, solve
from tidemesh.tides.frequency_domain.gwce import (
    GwceEquation,
    GwceSymbols,
    adcirc_symbols,
    solve_gwce,
    symbols_for,
)

CORIOLIS = 1.0e-4
GWCE = TideSettings(friction=FRICTION, discretisation="gwce")

reference = pytest.mark.skipif(
    not adcirc_cases.FOLDER.is_dir(), reason="the ADCIRC reference runs are not here"
)


def relative(ours, theirs):
    return np.linalg.norm(ours - theirs) / np.linalg.norm(theirs)


def orders(errors):
    errors = np.array(errors)
    return np.log2(errors[:-1] / errors[1:])


def run(case, time_step):
    """Errors of elevation and velocity against ADCIRC's."""
    given = case.settings
    settings = TideSettings(
        discretisation="gwce",
        friction=given["friction"],
        tau0=given["tau0"],
        gravity=given["g"],
        minimum_inner_angle_deg=given["anginn"],
        metric="plane" if given["ics"] == 1 else "adcirc",
        time_step_s=time_step,
    )
    tide = solve(case.mesh, case.forcing, settings, coriolis=given["cori"])
    return (
        relative(tide.elevation[0], case.elevation),
        relative(tide.velocity[0], case.velocity),
    )


@reference
@pytest.mark.parametrize(
    ("name", "elevation", "velocity"),
    [
        # Printed with four decimals of the phase in degrees: 5e-7.
        *(
            (f"{mesh}_{what}", 6e-7, 6e-7)
            for mesh, what in [
                ("qa_ts", "lin"),
                ("qa_ts", "cor"),
                ("qa_ts", "tau0x"),
                ("qa_r2", "cor"),
                ("qa_r4", "cor"),
                ("qa_r4", "tau0x"),
                ("qa_r8", "cor"),
                ("sh", "lin"),
                ("sh", "cor"),
                ("sh", "lin_cart"),
                ("sh", "lin_ics22"),
            ]
        ),
        # In double precision, down to the tolerance of ADCIRC's own solver.
        ("qa_r1_lin_nc", 4e-12, 1e-11),
        ("qa_r1_cor_nc", 2e-11, 5e-11),
    ],
)
def test_is_adcircs_answer_with_its_time_step(name, elevation, velocity):
    case = adcirc_cases.load(name)
    errors = run(case, case.settings["dt"])
    assert errors[0] < elevation
    assert errors[1] < velocity


@reference
@pytest.mark.parametrize(
    "name", ["qa_r1_cor", "qa_r4_cor", "qa_r4_tau0x", "qa_r8_cor", "sh_cor"]
)
def test_is_adcircs_answer_within_its_time_step_error(name):
    case = adcirc_cases.load(name)
    square = (case.settings["dt"] * case.settings["omega"]) ** 2
    errors = run(case, 0.0)
    assert errors[0] < 0.2 * square + 6e-7
    assert errors[1] < 0.3 * square + 6e-7


def test_is_galerkins_equation_where_the_weight_is_the_friction():
    mesh = annulus_mesh(6, 8, 2)
    forcing = annulus_forcing(mesh)
    plain, ours = solve(mesh, forcing, TideSettings(friction=FRICTION)), None
    for tau0 in (None, FRICTION):
        ours = solve_gwce(mesh, forcing, GWCE, tau0=tau0)
        np.testing.assert_allclose(ours.elevation, plain.elevation, rtol=1e-11)
        np.testing.assert_allclose(ours.velocity, plain.velocity, rtol=1e-9, atol=1e-13)
    # In discrete time too.
    symbols = adcirc_symbols(FREQUENCY, 600.0)
    plain = solve(
        mesh,
        forcing,
        TideSettings(friction=FRICTION),
        symbols=[symbols.plain(FRICTION)],
    )
    stepped = solve_gwce(mesh, forcing, GWCE, symbols=[symbols])
    np.testing.assert_allclose(stepped.elevation, plain.elevation, rtol=1e-11)
    assert relative(stepped.elevation, ours.elevation) > 1e-5


def varying_weight(mesh):
    x, y = mesh.points.T
    return 1e-3 * (1.5 + np.sin(x / 4e4) * np.cos(y / 5e4))


VARIANTS = {
    "rotation": dict(coriolis=lambda mesh: CORIOLIS, tau0=lambda mesh: FRICTION),
    "constant weight": dict(coriolis=lambda mesh: 0.0, tau0=lambda mesh: 5e-3),
    "varying weight": dict(coriolis=lambda mesh: 0.0, tau0=varying_weight),
    "all": dict(
        coriolis=lambda mesh: CORIOLIS * (1.0 + mesh.points[:, 1] / 3e5),
        tau0=varying_weight,
    ),
}


@pytest.mark.parametrize("variant", VARIANTS)
def test_differs_from_galerkin_at_second_order(variant):
    settings = TideSettings(friction=FRICTION)
    errors = []
    for k in (1, 2, 4):
        mesh = annulus_mesh(6 * k, 8 * k, 2)
        forcing = annulus_forcing(mesh)
        given = {name: value(mesh) for name, value in VARIANTS[variant].items()}
        ours = solve_gwce(mesh, forcing, GWCE, **given)
        plain = solve(mesh, forcing, settings, coriolis=given["coriolis"])
        errors.append(relative(ours.elevation, plain.elevation))
    assert errors[0] > 1e-3
    assert np.all(orders(errors) > 1.6)


@pytest.mark.parametrize("tau0", [5e-3, varying_weight])
@pytest.mark.parametrize("power", [0, 2])
def test_converges_to_the_closed_form_whatever_the_weight(power, tau0):
    errors = []
    for k in (1, 2, 4):
        mesh = annulus_mesh(6 * k, 8 * k, power)
        weight = tau0(mesh) if callable(tau0) else tau0
        tide = solve_gwce(mesh, annulus_forcing(mesh), GWCE, tau0=weight)
        exact = Annulus(power).elevation(np.hypot(*mesh.points.T))[0]
        errors.append(relative(tide.elevation[0], exact))
    assert np.all(orders(errors) > 1.8)


@pytest.mark.parametrize("rotation", [0.0, CORIOLIS])
def test_varying_friction_differs_from_galerkin_at_second_order(rotation):
    errors = []
    for k in (1, 2, 4):
        mesh = annulus_mesh(6 * k, 8 * k, 2)
        x, y = mesh.points.T
        friction = FRICTION * (2.0 + np.sin(x / 3e4 + y / 4e4))
        given = dict(friction=friction, coriolis=rotation)
        ours = solve_gwce(mesh, annulus_forcing(mesh), GWCE, tau0=2e-3, **given)
        plain = solve(mesh, annulus_forcing(mesh), TideSettings(), **given)
        errors.append(relative(ours.elevation, plain.elevation))
    assert np.all(orders(errors) > 1.6)


@pytest.mark.parametrize("variant", VARIANTS)
@pytest.mark.parametrize("mass", ["consistent", "lumped"])
@pytest.mark.parametrize("step", [0.0, 300.0])
def test_the_matrix_is_what_the_equations_say(variant, mass, step):
    # `apply` computes velocities and fluxes one after the other, without a matrix.
    mesh = annulus_mesh(5, 7, 1)
    given = {name: value(mesh) for name, value in VARIANTS[variant].items()}
    settings = TideSettings(friction=FRICTION, mass=mass, time_step_s=step)
    friction = FRICTION * (1.0 + mesh.points[:, 0] / 2e5)
    equation = GwceEquation(mesh, mesh.open_nodes, settings, friction=friction, **given)
    symbols = symbols_for(FREQUENCY, settings)
    random = np.random.default_rng(3)
    surface = random.normal(size=(2, len(mesh.points))).T @ [1.0, 1j]
    ours = equation.matrix(symbols) @ surface
    assert relative(ours, equation.apply(symbols, surface)) < 1e-12


def test_the_transposed_equations_are_the_adjoint():
    mesh = annulus_mesh(6, 8, 2)
    equation = GwceEquation(mesh, mesh.open_nodes, GWCE, coriolis=CORIOLIS, tau0=2e-3)
    wave = equation.factorise(GwceSymbols.exact(FREQUENCY))
    random = np.random.default_rng(1)
    load, goal = random.normal(size=(2, len(mesh.points)))
    load[mesh.open_nodes] = goal[mesh.open_nodes] = 0.0
    forward = goal @ wave.respond(load)
    backward = load @ wave.respond(goal, transpose=True)
    assert abs(forward - backward) < 1e-10 * abs(forward)


def test_other_friction_is_as_if_made_with_it():
    mesh = annulus_mesh(5, 7, 2)
    symbols = GwceSymbols.exact(FREQUENCY)
    friction = FRICTION * (1.0 + mesh.points[:, 0] / 2e5)
    open_nodes = mesh.open_nodes
    ones = np.ones(len(open_nodes))
    plain = GwceEquation(mesh, open_nodes, GWCE)
    assert not plain.coupled
    changed = plain.with_friction(friction)
    made = GwceEquation(mesh, open_nodes, GWCE, friction=friction)
    assert changed.coupled
    np.testing.assert_allclose(
        changed.factorise(symbols).elevation(ones),
        made.factorise(symbols).elevation(ones),
        rtol=1e-12,
    )


@pytest.mark.parametrize("variant", VARIANTS)
def test_a_level_sea_under_its_equilibrium_stays(variant):
    # A potential that the steady sea follows exactly: no flow, elevation = potential.
    mesh = annulus_mesh(5, 7, 2)
    x, y = mesh.points.T
    potential = 0.2 + 0.1 * (x - 0.5 * y) / 1e5 + 0.05 * (x * y) / 1e10
    open_nodes = mesh.open_nodes
    forcing = TideForcing(
        ("STEADY",),
        np.zeros(1),
        open_nodes,
        potential[None, open_nodes],
        potential=potential[None],
    )
    given = {name: value(mesh) for name, value in VARIANTS[variant].items()}
    for step in (0.0, 60.0):
        settings = TideSettings(friction=FRICTION, time_step_s=step)
        tide = solve_gwce(mesh, forcing, settings, **given)
        assert relative(tide.elevation[0], potential) < 1e-9
        assert np.abs(tide.velocity).max() < 1e-8


def test_the_whole_ocean_follows_a_potential_of_degree_two():
    q = 1j * FREQUENCY + FRICTION
    s = 6.0 * 9.81 * DEPTH / (q * EARTH_RADIUS**2)
    errors = []
    for level in (2, 3, 4):
        points, triangles = icosphere(level)
        potential = tilted_degree_two(points)
        forcing = TideForcing(
            ("M2",),
            np.array([FREQUENCY]),
            np.empty(0, int),
            np.empty((1, 0)),
            potential=potential[None],
        )
        settings = TideSettings(friction=FRICTION, metric="geographic")
        mesh = mesh_of(points, triangles)
        tide = solve_gwce(mesh, forcing, settings, tau0=1e-4)
        exact = potential * s / (1j * FREQUENCY + s)
        errors.append(relative(tide.elevation[0], exact))
    assert np.all(orders(errors) > 1.85)


def test_symbols_of_small_steps_are_those_of_continuous_time():
    exact = np.array(GwceSymbols.exact(FREQUENCY))
    errors = [
        np.abs(np.array(adcirc_symbols(FREQUENCY, step)) / exact - 1.0)
        for step in (400.0, 200.0, 100.0)
    ]
    # The mean of two levels is of the time half a step later.
    order = np.array([2.0, 2.0, 2.0, 2.0, 1.0])
    assert np.all(np.abs(orders(errors) - order) < 0.01)
    steady = np.array(adcirc_symbols(0.0, 100.0))
    np.testing.assert_allclose(steady, GwceSymbols.exact(0.0), atol=1e-15)


def test_the_lumped_equation_is_explicit():
    settings = TideSettings(mass="lumped", time_step_s=100.0)
    assert symbols_for(FREQUENCY, settings).slope == 1.0
    assert symbols_for(FREQUENCY, TideSettings(time_step_s=100.0)).slope != 1.0
    assert symbols_for(FREQUENCY, TideSettings()) == GwceSymbols.exact(FREQUENCY)


def test_what_cannot_be_solved_is_named():
    mesh = annulus_mesh(4, 5, 2)
    forcing = annulus_forcing(mesh)
    steady = TideForcing(("STEADY",), np.zeros(1), forcing.nodes, forcing.elevation)
    with pytest.raises(EngineError, match="give tau0 to a steady"):
        solve_gwce(mesh, steady, GWCE, tau0=0.0)
    with pytest.raises(EngineError, match="give friction to a steady"):
        solve_gwce(mesh, steady, GWCE, friction=0.0, tau0=1e-3)
    with pytest.raises(InputError, match="tau0 must be finite"):
        solve_gwce(mesh, forcing, GWCE, tau0=-1.0)
    with pytest.raises(ValueError, match="tau0 must be a number or"):
        solve_gwce(mesh, forcing, GWCE, tau0=np.ones(3))
    with pytest.raises(InputError, match="half a period"):
        solve_gwce(mesh, forcing, TideSettings(time_step_s=30_000.0))
    with pytest.raises(InputError, match="must be positive"):
        adcirc_symbols(0.0, 0.0)
    tensor = np.full((3, len(mesh.triangles)), FRICTION)
    with pytest.raises(InputError, match="not as a tensor"):
        solve_gwce(mesh, forcing, GWCE, friction=tensor)


def test_constituents_side_by_side_give_the_same():
    mesh = annulus_mesh(5, 7, 2)
    nodes = mesh.open_nodes
    forcing = TideForcing(
        ("M2", "S2", "STEADY"),
        np.array([FREQUENCY, 1.4544e-4, 0.0]),
        nodes,
        np.ones((3, len(nodes))),
    )
    heard = []
    one = solve_gwce(mesh, forcing, GWCE, coriolis=CORIOLIS, progress=heard.append)
    settings = TideSettings(friction=FRICTION, threads=2)
    two = solve_gwce(mesh, forcing, settings, coriolis=CORIOLIS)
    np.testing.assert_array_equal(one.elevation, two.elevation)
    assert heard == sorted(heard)
    assert (heard[0], heard[-1]) == (0.0, 1.0)


def test_rotation_of_a_plain_sea_needs_no_neighbours_of_neighbours():
    mesh = annulus_mesh(6, 8, 2)
    symbols = GwceSymbols.exact(FREQUENCY)
    one = WaveEquation(mesh, mesh.open_nodes, GWCE).matrix(symbols.plain(FRICTION))
    plain = GwceEquation(mesh, mesh.open_nodes, GWCE).matrix(symbols)
    coupled = GwceEquation(mesh, mesh.open_nodes, GWCE, coriolis=CORIOLIS)
    assert abs(one - plain).sum() <= 1e-12 * abs(one).sum()
    rings = (abs(one) @ abs(one)) > 0
    outside = coupled.matrix(symbols) - coupled.matrix(symbols).multiply(rings)
    assert abs(outside).sum() == 0.0
    assert coupled.matrix(symbols).nnz > 2 * plain.nnz


def test_every_constituent_may_have_its_own_friction():
    mesh = annulus_mesh(5, 7, 2)
    nodes = mesh.open_nodes
    friction = FRICTION * np.stack([1.0 + mesh.points[:, k] / 2e5 for k in (0, 1)])
    frequency = np.array([FREQUENCY, 0.7e-4])
    elevation = np.ones((2, len(nodes)))
    both = solve_gwce(
        mesh,
        TideForcing(("M2", "K1"), frequency, nodes, elevation),
        GWCE,
        friction=friction,
    )
    np.testing.assert_array_equal(both.friction, friction)
    for k in range(2):
        one = TideForcing(("M2",), frequency[k : k + 1], nodes, elevation[:1])
        alone = solve_gwce(mesh, one, GWCE, friction=friction[k])
        np.testing.assert_allclose(both.elevation[k], alone.elevation[0], rtol=1e-11)
        assert relative(both.velocity[k], alone.velocity[0]) < 1e-11
