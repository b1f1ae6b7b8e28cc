"""The time step: exact solutions, identities, ADCIRC's answers."""

from pathlib import Path

import adcirc_cases
import numba
import numpy as np
import pytest
from annulus import (
    FREQUENCY,
    FRICTION,
    GRAVITY,
    Annulus,
    annulus_forcing,
    annulus_mesh,
)

from tidemesh.datatypes import BoundaryString, CoastalMesh, TideForcing
from tidemesh.errors import InputError, MeshError
from tidemesh.tides import Symbols, TideSettings, solve
from tidemesh.tides.time_domain import (
    SimulationSettings,
    Stepper,
    simulate,
    stable_step,
)
from tidemesh.tides.time_domain import _kernels as kernels

NONLINEAR = TideSettings(
    friction_law="quadratic",
    drag_coefficient=0.003,
    tau0=0.009,
    finite_amplitude=True,
    advection=True,
)


def relative(ours, exact):
    return np.linalg.norm(ours - exact) / np.linalg.norm(exact)


def strip(nx, ny, length, width, depth, *, open_ends=(True, False)):
    """A straight channel, ends at x = 0 and x = length open or closed."""
    x, y = np.meshgrid(np.linspace(0, length, nx + 1), np.linspace(0, width, ny + 1))
    points = np.stack([x.ravel(), y.ravel()], axis=1)
    node = np.arange(x.size).reshape(x.shape)
    a, b = node[:-1, :-1].ravel(), node[:-1, 1:].ravel()
    c, d = node[1:, 1:].ravel(), node[1:, :-1].ravel()
    row, column = np.divmod(np.arange(len(a)), nx)
    even = ((row + column) % 2 == 0)[:, None]
    one = np.where(even, np.stack([a, b, c], 1), np.stack([a, b, d], 1))
    two = np.where(even, np.stack([a, c, d], 1), np.stack([b, c, d], 1))
    west, east = node[::-1, 0], node[:, -1]
    south, north = node[0], node[-1, ::-1]
    if open_ends == (True, True):
        strings = [("open", west), ("mainland", south)]
        strings += [("open", east), ("mainland", north)]
    elif open_ends == (True, False):
        land = np.concatenate([south, east[1:], north[1:]])
        strings = [("open", west), ("mainland", land)]
    else:
        strings = []
    return CoastalMesh(
        points,
        np.concatenate([one, two]),
        np.broadcast_to(depth, len(points)),
        tuple(BoundaryString(kind, nodes) for kind, nodes in strings),
    )


def no_forcing():
    return TideForcing(("M2",), [FREQUENCY], [], np.zeros((1, 0)))


# --- against ADCIRC -----------------------------------------------------------------


@pytest.mark.parametrize("case", ["linear", "nonlinear"])
def test_is_adcircs_explicit_lumped_scheme_to_the_last_digits(case):
    answers = np.loadtxt(
        Path(__file__).parent / "time_domain_adcirc.csv", delimiter=","
    )
    elevation, u, v = answers.T[:3] if case == "linear" else answers.T[3:]
    latitude = np.degrees(np.arcsin(1.0e-4 / (2 * 7.29212e-5)))
    settings = TideSettings(friction=4.0e-4, tau0=0.009, minimum_inner_angle_deg=80.0)
    if case == "nonlinear":
        settings = TideSettings(
            friction_law="quadratic",
            drag_coefficient=0.003,
            tau0=0.009,
            finite_amplitude=True,
            advection=True,
            coriolis="constant",
            latitude_deg=latitude,
            minimum_inner_angle_deg=80.0,
        )
    mesh = annulus_mesh(8, 6, 2)
    plain = annulus_forcing(mesh)
    forcing = TideForcing(
        plain.names,
        plain.frequency,
        plain.nodes,
        plain.elevation,
        nodal_factor=[1.1],
        argument=[np.radians(30.0)],
    )
    water = Stepper(
        mesh,
        forcing,
        settings,
        180.0,
        ramp=0.2 * 86400.0,
        viscosity=20.0 if case == "nonlinear" else 0.0,
        ocean_advection=True,
    )
    assert water.advance(240) is None
    assert np.abs(elevation).max() > 0.3
    np.testing.assert_allclose(water.elevation, elevation, rtol=0, atol=1e-13)
    np.testing.assert_allclose(water.velocity, np.stack([u, v], 1), rtol=0, atol=1e-13)


@pytest.mark.skipif(
    not adcirc_cases.FOLDER.is_dir(), reason="the ADCIRC reference runs are not here"
)
@pytest.mark.parametrize(
    ("name", "bounds"),
    [
        # Consistent mass there, lumped here: second-order differences.
        ("qa_r4_qf", {"M2": 1.2e-3, "M6": 2.5e-2}),
        ("qa_r4_nl", {"STEADY": 3e-2, "M2": 1.2e-3, "M4": 7e-3, "M6": 2.5e-2}),
        ("qa_r4_nlcor", {"STEADY": 2e-2, "M2": 1e-3, "M4": 9e-3, "M6": 3.5e-2}),
    ],
)
def test_nonlinear_harmonics_differ_from_adcirc_by_the_mass_matrix(name, bounds):
    case = adcirc_cases.load(name)
    given = case.settings
    nonlinear = given["nolifa"] == 1
    tide = simulate(
        case.mesh,
        case.forcing,
        TideSettings(
            friction_law="quadratic",
            drag_coefficient=given["friction"],
            tau0=given["tau0"],
            finite_amplitude=nonlinear,
            advection=nonlinear,
            coriolis="constant" if given["cori"] else "none",
            latitude_deg=float(np.degrees(np.arcsin(given["cori"] / 1.458424e-4))),
            minimum_inner_angle_deg=given["anginn"],
        ),
        SimulationSettings(
            days=9.0,
            ramp_days=1.5,
            analysis_start_day=5.0,
            time_step_s=150.0,
            expected_level_m=0.5,
            expected_speed_m_s=0.5,
            constituents=("STEADY", "M2", "M4", "M6", "M8"),
            ocean_advection=True,
            restart_every_days=0.0,
        ),
    ).constants
    folder = adcirc_cases.FOLDER / name
    theirs = adcirc_cases.read_fort53(folder / "fort.53.gz").values
    for constituent, bound in bounds.items():
        k = tide.names.index(constituent)
        assert relative(tide.elevation[k], theirs[k]) < bound, constituent


# --- exact solutions ------------------------------------------------------------------


def test_continues_the_discrete_solution_of_the_frequency_domain():
    # With lumped mass and the symbols of this time stepping both solve one system.
    mesh = annulus_mesh(10, 8, 1)
    forcing = annulus_forcing(mesh)
    step, tau = 150.0, FRICTION
    z = np.exp(1j * FREQUENCY * step)
    momentum = 2.0 / step * (z - 1.0) / (z + 1.0)
    second = (z - 2.0 + 1.0 / z) / step**2 + tau * (z - 1.0 / z) / (2.0 * step)
    symbols = Symbols(second / (momentum + tau), momentum)
    settings = TideSettings(mass="lumped", friction=tau, minimum_inner_angle_deg=80.0)
    exact = solve(mesh, forcing, settings, symbols=[symbols])
    e, u = exact.elevation[0], exact.velocity[0]
    water = Stepper(mesh, forcing, settings, step)
    water.set_state(e.real, u.real, before=(e / z).real)
    water.advance(500)
    turned = z**500
    np.testing.assert_allclose(water.elevation, (e * turned).real, rtol=0, atol=1e-12)
    np.testing.assert_allclose(water.velocity, (u * turned).real, rtol=0, atol=1e-12)


def standing_wave_error(n_r):
    mesh = annulus_mesh(n_r, n_r, 0)
    exact = Annulus(0)
    wave = exact.elevation(np.hypot(*mesh.points.T))[0]
    current = exact.velocity(mesh.points)
    steps = 24 * n_r
    step = 2.0 * np.pi / FREQUENCY / steps
    settings = TideSettings(friction=FRICTION, minimum_inner_angle_deg=80.0)
    water = Stepper(mesh, annulus_forcing(mesh), settings, step)
    back = np.exp(-1j * FREQUENCY * step)
    water.set_state(wave.real, current.real, before=(wave * back).real)
    water.advance(3 * steps)
    return relative(water.elevation, wave.real)


def test_standing_wave_with_friction_at_second_order():
    coarse, fine = standing_wave_error(14), standing_wave_error(28)
    assert fine < 2e-3
    assert np.log2(coarse / fine) == pytest.approx(2.0, abs=0.15)


def kelvin_wave_error(nx):
    length, width, depth, f = 4.0e5, 2.0e5, 20.0, 1.0e-4
    mesh = strip(nx, nx // 2, length, width, depth, open_ends=(True, True))
    c = np.sqrt(GRAVITY * depth)
    x, y = mesh.points.T
    wave = np.exp(-f * y / c) * np.exp(-1j * FREQUENCY / c * x)
    nodes = mesh.open_nodes
    forcing = TideForcing(("M2",), [FREQUENCY], nodes, wave[nodes][None])
    settings = TideSettings(
        friction=0.0,
        tau0=1.0e-3,
        coriolis="constant",
        latitude_deg=float(np.degrees(np.arcsin(f / 1.458424e-4))),
        minimum_inner_angle_deg=80.0,
    )
    steps = 40 * nx
    step = 2.0 * np.pi / FREQUENCY / steps
    water = Stepper(mesh, forcing, settings, step)
    current = np.stack([np.sqrt(GRAVITY / depth) * wave, 0.0 * wave], axis=1)
    back = np.exp(-1j * FREQUENCY * step)
    water.set_state(wave.real, current.real, before=(wave * back).real)
    water.advance(steps)
    return relative(water.elevation, wave.real), relative(water.velocity, current.real)


def test_kelvin_wave_converges():
    coarse, fine = kelvin_wave_error(12), kelvin_wave_error(24)
    assert fine[0] < 0.025
    assert np.log2(coarse[0] / fine[0]) == pytest.approx(2.0, abs=0.1)
    # One-sided gradients along the shores.
    assert np.log2(coarse[1] / fine[1]) > 1.6


def test_second_order_in_time():
    mesh = annulus_mesh(8, 6, 1)
    forcing = annulus_forcing(mesh)
    settings = TideSettings(mass="lumped", friction=FRICTION)
    exact = solve(mesh, forcing, settings)
    e, u = exact.elevation[0], exact.velocity[0]
    errors = []
    for steps in (256, 512):
        step = 2.0 * np.pi / FREQUENCY / steps
        water = Stepper(mesh, forcing, settings, step)
        back = np.exp(-1j * FREQUENCY * step)
        water.set_state(e.real, u.real, before=(e * back).real)
        water.advance(4 * steps)
        errors.append(relative(water.elevation, e.real))
    assert np.log2(errors[0] / errors[1]) == pytest.approx(2.0, abs=0.1)


def test_overtide_of_a_short_channel():
    # u = x a w sin(wt)/(h + a cos(wt)) from continuity; the second harmonic of
    # -(u_t + u u_x)/g, integrated from the mouth, is -3/4 (a w L/h)^2/g at the head,
    # the mean +1/4 (a w L/h)^2/g; both up to (w L/c)^2 and friction over w.
    length, depth, a = 3000.0, 4.0, 0.3
    mesh = strip(12, 1, length, 500.0, depth)
    nodes = mesh.open_nodes
    forcing = TideForcing(("M2",), [FREQUENCY], nodes, np.full((1, len(nodes)), a))
    tide = simulate(
        mesh,
        forcing,
        TideSettings(friction=2e-5, tau0=1e-3, finite_amplitude=True, advection=True),
        SimulationSettings(
            days=10.0,
            ramp_days=2.0,
            analysis_start_day=6.0,
            ocean_advection=True,
            expected_level_m=1.0,
            expected_speed_m_s=0.5,
            constituents=("M2", "M4", "M6", "STEADY"),
            restart_every_days=0.0,
        ),
    ).constants
    head = np.argmax(mesh.points[:, 0])
    unit = (a * FREQUENCY * length / depth) ** 2 / GRAVITY
    level = dict(zip(tide.names, tide.elevation[:, head] / unit, strict=True))
    assert level["M4"].real == pytest.approx(-0.75, rel=0.02)
    # What linear friction adds: tau/(3 w) of it, a quarter of a period later.
    assert level["M4"].imag == pytest.approx(2e-5 / (3 * FREQUENCY), abs=0.01)
    assert level["STEADY"].real == pytest.approx(0.25, rel=0.03)


def test_water_lies_on_the_equilibrium_tide_of_a_small_basin():
    mesh = strip(10, 4, 20e3, 8e3, 30.0, open_ends=(False, False))
    tilt = 0.05 * (mesh.points[:, 0] / 20e3 - 0.5) * np.exp(-0.3j)
    forcing = TideForcing(
        ("M2",), [FREQUENCY], [], np.zeros((1, 0)), potential=tilt[None]
    )
    settings = TideSettings(friction=1e-4, finite_amplitude=True)
    water = Stepper(mesh, forcing, settings, 60.0, ramp=86400.0)
    water.advance(4 * 1440)
    exact = (tilt * np.exp(1j * FREQUENCY * water.time)).real
    # Friction lets it lag by w tau L^2/(pi^2 g h) = 0.002, and waves add as much.
    assert np.abs(water.elevation - exact).max() < 0.005 * np.abs(tilt).max()
    assert np.abs(exact).max() > 0.1 * np.abs(tilt).max()


# --- identities -----------------------------------------------------------------------


@pytest.mark.parametrize("settings", [TideSettings(tau0=0.002), NONLINEAR])
def test_closed_basin_keeps_its_water(settings):
    mesh = strip(12, 8, 30e3, 20e3, 8.0, open_ends=(False, False))
    x, y = mesh.points.T
    water = Stepper(mesh, no_forcing(), settings, 60.0)
    start = 0.5 * np.cos(np.pi * x / 30e3) + 0.2 * np.cos(np.pi * y / 20e3)
    water.set_state(start)
    volume = water.volume
    water.advance(2000)
    moved = np.abs(water.elevation - start).max()
    assert moved > 0.05
    assert water.volume == pytest.approx(volume, rel=1e-13)


def test_rest_stays_rest_over_any_bottom():
    mesh = annulus_mesh(6, 6, 2)
    plain = annulus_forcing(mesh)
    forcing = TideForcing(
        plain.names, plain.frequency, plain.nodes, plain.elevation * 0
    )
    water = Stepper(mesh, forcing, NONLINEAR, 100.0)
    water.advance(50)
    assert not water.elevation.any()
    assert not water.velocity.any()


def test_manning_is_the_quadratic_law_with_the_coefficient_of_the_depth():
    mesh = strip(10, 2, 50e3, 10e3, 8.0)
    nodes = mesh.open_nodes
    forcing = TideForcing(("M2",), [FREQUENCY], nodes, np.full((1, len(nodes)), 0.5))
    coefficient = GRAVITY * 0.025**2 / 2.0  # 8 ** (1/3) = 2
    answers = []
    for settings in (
        TideSettings(friction_law="manning", manning_n=0.025),
        TideSettings(friction_law="quadratic", drag_coefficient=coefficient),
    ):
        water = Stepper(mesh, forcing, settings, 100.0, ramp=20e3)
        water.advance(400)
        answers.append(water.elevation)
    np.testing.assert_allclose(answers[0], answers[1], rtol=1e-12)


def test_nodal_drag_takes_the_place_of_the_number():
    mesh = annulus_mesh(6, 5, 1)
    forcing = annulus_forcing(mesh)
    answers = []
    for drag in (None, np.full(len(mesh.points), 0.003)):
        water = Stepper(mesh, forcing, NONLINEAR, 150.0, ramp=20e3, drag=drag)
        water.advance(200)
        answers.append(water.elevation)
    np.testing.assert_array_equal(*answers)


@pytest.mark.skipif(numba.config.NUMBA_NUM_THREADS < 2, reason="needs two threads")
def test_threads_change_no_bit():
    mesh = annulus_mesh(40, 40, 2)
    assert len(mesh.points) > 3 * kernels.BLOCK
    forcing = annulus_forcing(mesh)
    states = []
    for threads in (1, 2):
        water = Stepper(mesh, forcing, NONLINEAR, 30.0, ramp=20e3, threads=threads)
        water.advance(150)
        states.append(water.state)
    assert np.abs(states[0][kernels.U]).max() > 1e-3
    np.testing.assert_array_equal(*states)


def test_compiled_is_uncompiled(monkeypatch):
    mesh = annulus_mesh(3, 3, 1)
    plain = annulus_forcing(mesh)
    forcing = TideForcing(
        plain.names,
        plain.frequency,
        plain.nodes,
        plain.elevation,
        potential=np.outer([0.1], mesh.points[:, 0] / 1e5),
    )
    settings = TideSettings(
        friction_law="manning",
        tau0=0.009,
        finite_amplitude=True,
        advection=True,
        coriolis="constant",
    )

    def run():
        water = Stepper(mesh, forcing, settings, 200.0, ramp=5e3, viscosity=10.0)
        water.advance(20)
        return water.state[: kernels.TIDE]

    compiled = run()
    for name in dir(kernels):
        if hasattr(getattr(kernels, name), "py_func"):
            monkeypatch.setattr(kernels, name, getattr(kernels, name).py_func)
    plain_python = run()
    assert np.abs(compiled[kernels.U]).max() > 1e-2
    np.testing.assert_allclose(compiled, plain_python, rtol=1e-10, atol=1e-14)


def test_thin_water_becomes_a_film_and_is_counted():
    mesh = strip(20, 2, 10e3, 1e3, 5.0 - 4.6 * np.tile(np.linspace(0, 1, 21), 3))
    nodes = mesh.open_nodes
    forcing = TideForcing(("M2",), [FREQUENCY], nodes, np.full((1, len(nodes)), -1.0))
    settings = TideSettings(
        friction_law="quadratic", drag_coefficient=0.003, finite_amplitude=True
    )
    water = Stepper(mesh, forcing, settings, 20.0, ramp=20e3, minimum_column=0.1)
    water.advance(1000)
    films = water.films
    assert films[np.argmax(mesh.points[:, 0])] > 0
    assert not films[mesh.depth > 2.0].any()
    assert water.film_volume > 0.0
    assert (water.elevation + mesh.depth).min() >= 0.1 - 1e-12


# --- the stable step ------------------------------------------------------------------


def equilateral(n, spacing, depth):
    """Rows of equilateral triangles."""
    k, j = np.meshgrid(np.arange(n), np.arange(n))
    points = np.stack([k + 0.5 * (j % 2), j * np.sqrt(0.75)], -1).reshape(-1, 2)
    node = np.arange(n * n).reshape(n, n)
    triangles = []
    for row in range(n - 1):
        low, high = node[row], node[row + 1]
        if row % 2:
            low, high = high, low
        for a, b, c, d in zip(low, low[1:], high, high[1:], strict=False):
            corners = [(a, b, c), (b, d, c)]
            triangles += [t[::-1] for t in corners] if row % 2 else corners
    return CoastalMesh(points * spacing, triangles, np.full(n * n, depth))


def test_step_of_equilateral_triangles_has_a_closed_form():
    # Largest symbol of M^-1 K on the lattice: 6 g h/s^2, that of one triangle too.
    advice = stable_step(equilateral(24, 1000.0, 10.0))
    exact = 2.0 / np.sqrt(6.0 * GRAVITY * 10.0) * 1000.0
    assert advice.step_s == pytest.approx(exact, rel=0.02)
    assert advice.bound_s <= advice.step_s * (1 + 1e-6)


@pytest.mark.parametrize("power", [0, 2])
def test_stable_just_below_the_step_and_not_above(power):
    mesh = annulus_mesh(12, 9, power)
    forcing = annulus_forcing(mesh)
    settings = TideSettings(friction=FRICTION)
    longest = stable_step(mesh).step_s
    rng = np.random.default_rng(1)
    start = 1e-3 * rng.standard_normal(len(mesh.points))
    levels = []
    for part in (0.99, 1.1):
        water = Stepper(mesh, forcing, settings, part * longest, limit=50.0, ramp=1e9)
        water.set_state(start)
        lost = water.advance(3000)
        levels.append((lost, np.abs(water.elevation).max()))
    assert levels[0][0] is None
    assert levels[0][1] < 0.1
    assert levels[1][0] is not None


def test_step_names_the_shallowest_finest_place():
    mesh = annulus_mesh(12, 9, 2)
    advice = stable_step(mesh)
    # Waves cross the triangles fastest at the inner radius: there they are narrowest.
    rate = np.sqrt(GRAVITY * mesh.depth)
    assert advice.step_s < 2e3 * 12 / rate.min()
    assert "gravity waves" in advice.reason
    longer = stable_step(mesh, SimulationSettings(expected_level_m=5.0), NONLINEAR)
    assert longer.step_s < advice.step_s
    assert "current" in longer.reason


# --- bad input ------------------------------------------------------------------------


def test_bad_forcing_and_meshes():
    mesh = annulus_mesh(4, 4, 0)
    good = annulus_forcing(mesh)
    settings = TideSettings()

    def attempt(match, error=InputError, mesh=mesh, settings=settings, **change):
        fields = {
            "names": good.names,
            "frequency": good.frequency,
            "nodes": good.nodes,
            "elevation": good.elevation,
            **change,
        }
        with pytest.raises(error, match=match):
            Stepper(mesh, TideForcing(**fields), settings, 10.0)

    attempt("misses 1 of 5", nodes=good.nodes[1:], elevation=good.elevation[:, 1:])
    attempt("belongs to another mesh", nodes=good.nodes + 1000)
    attempt("twice", nodes=np.full(5, good.nodes[0]))
    attempt("elevation of M2 is not a finite", elevation=good.elevation * np.nan)
    attempt("argument of M2", argument=[np.inf])
    attempt("potential is given at 3 nodes", potential=np.zeros((1, 3)))
    depth = mesh.depth.copy()
    depth[7] = 0.0
    dry = CoastalMesh(mesh.points, mesh.triangles, depth, mesh.boundaries)
    attempt("a depth of 0 m at node 7", MeshError, mesh=dry)
    with pytest.raises(InputError, match="drag coefficient"):
        Stepper(mesh, good, NONLINEAR, 10.0, drag=np.full(len(mesh.points), -1.0))
