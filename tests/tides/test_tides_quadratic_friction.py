"""Quadratic friction against closed forms, averages over time and another model."""

import adcirc_cases
import numpy as np
import pytest
from annulus import annulus_mesh
from numpy.testing import assert_allclose

from tidemesh import constants
from tidemesh.datatypes import BoundaryString, CoastalMesh, TideForcing
from tidemesh.errors import ConvergenceError, InputError, MeshError
from tidemesh.io.fort53 import read_fort53, read_fort54
from tidemesh.tides import TideSettings, WaveEquation, energy_balance, solve
from tidemesh.tides.frequency_domain import harmonic_balance, solve_with_report
from tidemesh.tides.frequency_domain.metric import adcirc_elements
from tidemesh.tides.frequency_domain.nonlinear_terms import NonlinearTerms, Places
from tidemesh.tides.frequency_domain.sampling import (
    PhaseLattice,
    as_combination,
    integer_phases,
)
from tidemesh.tides.frequency_domain.velocity import nodal_gradient

G = 9.81
OMEGA = constants.frequency("M2")
NAMES = ("M2", "M4", "M6", "O1", "N2", "S2", "K1", "STEADY")
QUADRATIC = TideSettings(friction_law="quadratic")


def relative(ours, exact):
    return np.linalg.norm(ours - exact) / np.linalg.norm(exact)


def strip(n, length, depth, width=2):
    """Channel along x, open at x = length."""
    side = length / n
    x, y = np.meshgrid(np.linspace(0.0, length, n + 1), side * np.arange(width + 1))
    points = np.stack([x, y], axis=-1).reshape(-1, 2)
    node = np.arange(x.size).reshape(x.shape)
    a, b = node[:-1, :-1].ravel(), node[:-1, 1:].ravel()
    c, d = node[1:, 1:].ravel(), node[1:, :-1].ravel()
    row, column = np.divmod(np.arange(len(a)), n)
    even = ((row + column) % 2 == 0)[:, None]
    one = np.where(even, np.stack([a, b, c], 1), np.stack([a, b, d], 1))
    two = np.where(even, np.stack([a, c, d], 1), np.stack([b, c, d], 1))
    return CoastalMesh(
        points,
        np.concatenate([one, two]),
        depth(points[:, 0]),
        (BoundaryString("open", node[:, -1]),),
    )


def driven(mesh, amplitudes, **more):
    """The same amplitude at all ocean nodes, constituent by constituent."""
    nodes = mesh.open_nodes
    return TideForcing(
        tuple(amplitudes),
        np.array([constants.frequency(name) for name in amplitudes]),
        nodes,
        np.array([np.full(len(nodes), value) for value in amplitudes.values()]),
        **more,
    )


@pytest.fixture(scope="module")
def bay():
    return annulus_mesh(6, 8, 1)


# --- sampling ---------------------------------------------------------------------


def test_phases_of_the_paper_follow_from_four():
    frequency = np.array([constants.frequency(name) for name in NAMES])
    weight = np.array([1.0, 0.0, 0.0, 0.1, 0.2, 0.15, 0.12, 0.0])
    phases = integer_phases(frequency, weight)
    assert phases.shape == (8, 4)
    found = dict(zip(NAMES, phases))
    assert_allclose(found["M4"], 2 * found["M2"])
    assert_allclose(found["M6"], 3 * found["M2"])
    assert_allclose(found["O1"], found["M2"] - found["K1"])
    assert (found["STEADY"] == 0).all()
    base = np.array([frequency[np.argmax((phases == row).all(1))] for row in np.eye(4)])
    assert_allclose(phases @ base, frequency, atol=1e-9)


def test_lines_of_the_nodal_cycle_are_not_the_same():
    turn = 2.0 * np.pi / (18.6 * 365.25 * 86400.0)
    assert as_combination(2.0 * OMEGA + turn, np.array([OMEGA])) is None
    assert_allclose(as_combination(2.0 * OMEGA + 1e-12, np.array([OMEGA])), [2])


def test_lattice_is_exact_for_products():
    frequency = np.array([constants.frequency(name) for name in NAMES])
    phases = integer_phases(frequency, np.arange(8.0, 0.0, -1.0))
    lattice = PhaseLattice(phases)
    rng = np.random.default_rng(1)
    a, b = rng.normal(size=(2, 8, 3)) + 1j * rng.normal(size=(2, 8, 3))
    a[-1], b[-1] = a[-1].real, b[-1].real
    assert_allclose(lattice.amplitudes(lattice.samples(a)), a, atol=1e-12)
    product = lattice.amplitudes(lattice.samples(a) * lattice.samples(b))
    expected = np.zeros((8, 3), dtype=complex)
    for i in range(8):
        for j in range(8):
            # Re(a) Re(b) = Re(a b)/2 + Re(a b*)/2; a steady amplitude is its own mean.
            for row, value in (
                (phases[i] + phases[j], 0.5 * a[i] * b[j]),
                (phases[i] - phases[j], 0.5 * a[i] * b[j].conj()),
            ):
                for k in range(8):
                    if not row.any():
                        expected[k] += value.real * (not phases[k].any())
                    elif (row == phases[k]).all():
                        expected[k] += value
                    elif (row == -phases[k]).all():
                        expected[k] += value.conj()
    assert_allclose(product, expected, atol=1e-12)


def terms_of(phases, depth=10.0, drag=0.003, **settings):
    settings = TideSettings(friction_law="quadratic", **settings)
    places = Places(np.full(1, depth), np.full(1, drag))
    return NonlinearTerms(PhaseLattice(phases), places, settings)


def test_lorentz_friction_of_one_rectilinear_and_one_circular_current():
    terms = terms_of(np.array([[1]]))
    along = 0.8 * np.exp(0.7j) * np.array([0.6, 0.8])
    force = terms.evaluate(along.reshape(1, 2, 1)).friction[0, :, 0]
    lorentz = 8.0 / (3.0 * np.pi) * 0.003 * 0.8 / 10.0
    assert_allclose(force, lorentz * along, rtol=1e-4)
    # The current does not change its speed: its friction is linear at once.
    round_ = 0.8 * np.array([1.0, -1j])
    force = terms.evaluate(round_.reshape(1, 2, 1)).friction[0, :, 0]
    assert_allclose(force, 0.003 * 0.8 / 10.0 * round_, rtol=1e-12)
    # Time mean of d(|u| u)/du: twice the mean speed along, once across.
    slope = terms.mean_slope(along.reshape(1, 2, 1))[:, 0]
    mean = 0.003 / 10.0 * 0.8 * 2.0 / np.pi
    expected = mean * np.array([1.0 + 0.36, 0.48, 1.0 + 0.64])
    assert_allclose(slope, expected, rtol=2e-3)


def test_friction_of_many_constituents_is_the_average_over_a_long_time():
    frequency = np.array([constants.frequency(name) for name in NAMES])
    size = np.array([0.8, 0.04, 0.05, 0.07, 0.15, 0.12, 0.1, 0.02])
    rng = np.random.default_rng(2)
    phase = 2.0 * np.pi * rng.random((8, 2))
    velocity = (size[:, None] * [1.0, 0.5] * np.exp(1j * phase))[:, :, None]
    velocity[-1] = velocity[-1].real
    force = terms_of(integer_phases(frequency, size)).evaluate(velocity).friction
    # Thirty years, tapered, every 37 minutes.
    time = np.arange(0.0, 30 * 3.15e7, 2220.0)
    window = np.hanning(len(time))
    rotation = np.exp(1j * frequency[:, None] * time)
    u, v = (rotation.T @ velocity[:, :, 0]).real.T
    for component, speed in enumerate((u, v)):
        drag = window * 0.003 / 10.0 * np.hypot(u, v) * speed
        mean = rotation.conj() @ drag / window.sum() * np.where(frequency > 0, 2.0, 1.0)
        assert relative(force[:, component, 0], mean) < 1e-3


# --- tides ------------------------------------------------------------------------


def channel_in_time(length, depth, drag, amplitude, cells=200):
    """M2, M6 and M10 at the closed end by a staggered scheme in time."""
    side = length / cells
    # Elevation in the cells, velocity between them; the open end is a cell's centre.
    period = 2.0 * np.pi / OMEGA
    steps = int(np.ceil(period / (0.6 * side / np.sqrt(G * depth))))
    step = period / steps
    level, speed = np.zeros(cells + 1), np.zeros(cells)
    harmonics = np.zeros(3, dtype=complex)
    periods = 12
    rate = OMEGA * np.array([1.0, 3.0, 5.0])
    for k in range(periods * steps):
        time = (k + 1) * step
        # Friction half ahead: exact for the sign, second order at the periodic end.
        force = drag / depth * step
        driving = speed - step * G * np.diff(level) / side
        guess = driving / (1.0 + force * np.abs(speed))
        mean = 0.5 * (speed + guess)
        speed = driving - force * np.abs(mean) * mean
        level[1:-1] -= step * depth * np.diff(speed) / side
        level[0] -= step * depth * speed[0] / (0.5 * side)
        ramp = np.tanh(2.0 * time / (3.0 * period))
        level[-1] = amplitude * ramp * np.cos(OMEGA * time)
        if k >= (periods - 1) * steps:
            harmonics += level[0] * np.exp(-1j * rate * time) * 2.0 / steps
    return harmonics


def test_channel_with_quadratic_friction_is_that_of_a_model_in_time():
    length, depth, drag, amplitude = 120e3, 8.0, 0.003, 0.8
    mesh = strip(120, length, lambda x: np.full(len(x), depth), width=1)
    forcing = TideForcing(
        ("M2", "M6", "M10"),
        OMEGA * np.array([1.0, 3.0, 5.0]),
        mesh.open_nodes,
        np.outer([amplitude, 0.0, 0.0], np.ones(2)),
    )
    settings = TideSettings(
        friction_law="quadratic", drag_coefficient=drag, tolerance=1e-6
    )
    tide, report = solve_with_report(mesh, forcing, settings)
    assert report.converged
    assert 3 <= report.iterations <= 20
    ours = tide.elevation[:, np.argmin(mesh.points[:, 0])]
    theirs = channel_in_time(length, depth, drag, amplitude)
    assert abs(theirs[0]) > 0.3
    assert abs(theirs[1]) > 0.02
    assert abs(ours[0] - theirs[0]) < 2e-3 * abs(theirs[0])
    assert abs(ours[1] - theirs[1]) < 0.03 * abs(theirs[1])
    # Without the harmonics of its own current the answer is Lorentz's, and off.
    alone = solve(mesh, driven(mesh, {"M2": amplitude}), settings).elevation[0]
    lorentz = alone[np.argmin(mesh.points[:, 0])]
    assert abs(lorentz - theirs[0]) > 2.0 * abs(ours[0] - theirs[0])


def test_friction_coefficient_of_one_constituent_is_lorentz(bay):
    channel = strip(40, 60e3, lambda x: 6.0 + x / 2e4)
    settings = TideSettings(friction_law="quadratic", tolerance=1e-7, land_rule="none")
    tide = solve(channel, driven(channel, {"M2": 0.5}), settings)
    speed = np.hypot(*np.abs(tide.velocity[0].T))
    moving = speed > 0.1
    lorentz = 8.0 / (3.0 * np.pi) * 0.003 * speed / channel.depth
    assert_allclose(tide.friction[0][moving], lorentz[moving], rtol=2e-3)
    # The momentum equation holds with it, up to the mean of gradients at the nodes.
    assert tide.friction.shape == (1, len(channel.points))


def test_elevation_and_drag_scale_against_each_other(bay):
    one = solve(bay, driven(bay, {"M2": 0.4, "K1": 0.1j}), QUADRATIC)
    half = TideSettings(friction_law="quadratic", drag_coefficient=1.5e-3)
    two = solve(bay, driven(bay, {"M2": 0.8, "K1": 0.2j}), half)
    assert_allclose(two.elevation, 2.0 * one.elevation, rtol=1e-9, atol=1e-12)
    assert_allclose(two.velocity, 2.0 * one.velocity, rtol=1e-8, atol=1e-12)
    assert_allclose(two.friction, one.friction, rtol=1e-7, atol=1e-15)


def test_nodal_factors_act_and_are_taken_out_again(bay):
    plain = solve(bay, driven(bay, {"M2": 0.6, "O1": 0.11}), QUADRATIC)
    factor = np.array([1.2, 1.1])
    forcing = driven(bay, {"M2": 0.5, "O1": 0.1}, nodal_factor=factor)
    tide = solve(bay, forcing, QUADRATIC)
    assert_allclose(factor[:, None] * tide.elevation, plain.elevation, rtol=1e-9)
    assert_allclose(
        factor[:, None, None] * tide.velocity, plain.velocity, rtol=1e-8, atol=1e-12
    )


def test_equilibrium_arguments_set_the_phase_between_related_constituents(bay):
    # K1 + O1 = M2: turning the clock leaves the answer, turning M2 alone does not.
    given = {"M2": 0.5, "O1": 0.2, "K1": 0.25}
    plain = solve(bay, driven(bay, given), QUADRATIC).elevation
    moment = np.array([0.9, 0.5, 0.4])
    same = solve(bay, driven(bay, given, argument=moment), QUADRATIC).elevation
    assert_allclose(same, plain, rtol=1e-9, atol=1e-12)
    moment[0] += 1.0
    other = solve(bay, driven(bay, given, argument=moment), QUADRATIC).elevation
    assert relative(other, plain) > 1e-4


def test_manning_is_a_drag_that_depends_on_the_depth(bay):
    given = driven(bay, {"M2": 0.5})
    manning = TideSettings(friction_law="manning", manning_n=0.025, tolerance=1e-8)
    tide = solve(bay, given, manning)
    again = solve(bay, given, manning, drag=np.full(len(bay.points), 0.025))
    assert_allclose(again.elevation, tide.elevation, rtol=1e-12)
    flat = CoastalMesh(
        bay.points, bay.triangles, np.full(len(bay.points), 7.0), bay.boundaries
    )
    quadratic = TideSettings(
        friction_law="quadratic",
        drag_coefficient=G * 0.025**2 / np.cbrt(7.0),
        tolerance=1e-8,
    )
    assert_allclose(
        solve(flat, given, manning).elevation,
        solve(flat, given, quadratic).elevation,
        rtol=1e-10,
    )


def test_drag_of_every_node(bay):
    given = driven(bay, {"M2": 0.5})
    one = solve(bay, given, QUADRATIC)
    same = solve(bay, given, QUADRATIC, drag=np.full(len(bay.points), 0.003))
    assert_allclose(same.elevation, one.elevation, rtol=1e-12)
    rough = np.where(bay.points[:, 0] > bay.points[:, 1], 0.02, 0.003)
    more = solve(bay, given, QUADRATIC, drag=rough)
    assert relative(more.elevation, one.elevation) > 0.02


def test_without_drag_the_tide_is_linear_without_friction(bay):
    given = driven(bay, {"M2": 0.5, "S2": 0.1})
    free = TideSettings(friction_law="quadratic", drag_coefficient=0.0, tolerance=1e-10)
    tide = solve(bay, given, free)
    linear = solve(bay, given, TideSettings(friction=0.0))
    assert_allclose(tide.elevation, linear.elevation, rtol=1e-8)
    assert_allclose(tide.velocity, linear.velocity, rtol=1e-7, atol=1e-9)


@pytest.mark.parametrize("velocity", ["lumped", "consistent", "recovered"])
def test_momentum_equation_holds_at_the_nodes(bay, velocity):
    settings = TideSettings(
        friction_law="quadratic", velocity=velocity, land_rule="none", tolerance=1e-9
    )
    f = 9e-5
    tide = solve(bay, driven(bay, {"M2": 0.5, "M6": 0.0}), settings, coriolis=f)
    equation = WaveEquation(bay, bay.open_nodes, settings)
    lattice = PhaseLattice(np.array([[1], [3]]))
    places = Places(bay.depth, np.full(len(bay.points), 0.003))
    velocities = tide.velocity.transpose(0, 2, 1)
    force = NonlinearTerms(lattice, places, settings).evaluate(velocities).friction
    for k in range(2):
        u, v = velocities[k]
        gx, gy = nodal_gradient(equation, tide.elevation[k])
        rate = 1j * tide.frequency[k]
        scale = np.abs(G * gx).max()
        assert np.abs(rate * u - f * v + force[k, 0] + G * gx).max() < 1e-6 * scale
        assert np.abs(rate * v + f * u + force[k, 1] + G * gy).max() < 1e-6 * scale


@pytest.mark.parametrize(
    "settings",
    [
        {},
        {"mass": "lumped", "coriolis": "constant"},
        {"friction_law": "manning", "mass": "half_lumped"},
        {"finite_amplitude": True, "advection": True, "coriolis": "constant"},
        {"friction_law": "linear", "finite_amplitude": True, "advection": True},
    ],
)
def test_energy_balances_to_rounding(bay, settings):
    settings = TideSettings(
        **{"friction_law": "quadratic", "overtides": ("M4", "STEADY"), **settings}
    )
    x, y = bay.points.T
    potential = np.stack([0.2 * np.exp(1j * (x + 2 * y) / 1e5), 0.1 * x / 1e5 + 0j])
    forcing = driven(bay, {"M2": 0.3, "K1": 0.1}, potential=potential)
    tide = solve(bay, forcing, settings)
    balance = energy_balance(bay, tide, bay.open_nodes, settings)
    scale = np.abs(balance.dissipation).max()
    assert scale > 1e3
    assert np.abs(balance.potential).max() > 1e-3 * scale
    assert_allclose(
        balance.inflow + balance.potential,
        balance.dissipation + balance.transfer,
        atol=1e-9 * scale,
    )
    if settings.finite_amplitude:
        assert np.abs(balance.transfer).max() > 1e-5 * scale
    else:
        assert_allclose(balance.transfer, 0.0, atol=0.0)


def test_friction_gives_an_overtide_what_it_takes_from_it(bay):
    settings = TideSettings(friction_law="quadratic", overtides=("M6",))
    tide = solve(bay, driven(bay, {"M2": 0.5}), settings)
    balance = energy_balance(bay, tide, bay.open_nodes, settings)
    # At rest on the ocean boundary M6 takes nothing out of the bay.
    assert np.abs(tide.elevation[1]).max() > 0.01
    assert balance.dissipation[0] > 0.0
    assert abs(balance.dissipation[1]) < 1e-12 * balance.dissipation[0]


def test_threads_and_memory_leave_the_answer(bay, monkeypatch):
    given = driven(bay, {"M2": 0.5, "S2": 0.1, "K1": 0.1})
    one = solve(bay, given, QUADRATIC)
    two = solve(bay, given, TideSettings(friction_law="quadratic", threads=2))
    monkeypatch.setattr(harmonic_balance, "KEPT_UNKNOWNS", 0)
    spare = solve(bay, given, QUADRATIC)
    for other in (two, spare):
        assert (other.elevation == one.elevation).all()
        assert (other.velocity == one.velocity).all()
    linear = [
        solve(bay, given, TideSettings(threads=threads)).velocity for threads in (1, 3)
    ]
    assert (linear[0] == linear[1]).all()


def test_tighter_tolerance_and_progress(bay):
    given = driven(bay, {"M2": 0.5, "K1": 0.1})
    seen = []
    loose, first = solve_with_report(bay, given, QUADRATIC, progress=seen.append)
    fine = TideSettings(friction_law="quadratic", tolerance=1e-9)
    tight, second = solve_with_report(bay, given, fine)
    assert first.iterations < second.iterations < 30
    assert second.change <= 1e-9
    size = np.sqrt((np.abs(tight.elevation) ** 2).sum(axis=0).mean())
    assert np.abs(tight.elevation - loose.elevation).max() < 2e-4 * size
    assert seen == sorted(seen)
    assert (seen[0], seen[-1]) == (0.0, 1.0)
    assert solve_with_report(bay, given)[1].iterations == 0


# --- ADCIRC -----------------------------------------------------------------------


@pytest.mark.skipif(
    not adcirc_cases.FOLDER.is_dir(), reason="the ADCIRC reference runs are not here"
)
@pytest.mark.parametrize(
    # Relative to M2. What is left is the mesh: ADCIRC's wave equation has a weight of
    # 0.009 1/s in these runs, and friction at the nodes.
    ("name", "elevation", "velocity"),
    [
        ("qa_ts_qf", {"M2": 5.5e-2, "M6": 1.4e-2}, {"M2": 8e-2, "M6": 2.5e-2}),
        ("qa_r4_qf", {"M2": 2.2e-3, "M6": 1.5e-3}, {"M2": 6.5e-3, "M6": 3e-3}),
        ("sh_qf", {"M2": 1.3e-2, "M6": 3.6e-3}, {"M2": 0.13, "M6": 3.4e-2}),
    ],
)
def test_agrees_with_adcirc(name, elevation, velocity):
    case = adcirc_cases.load(name)
    given = case.settings
    ocean = case.mesh.open_nodes
    forcing = TideForcing(
        ("M2", "M6", "M10"),
        given["omega"] * np.array([1.0, 3.0, 5.0]),
        ocean,
        np.stack([case.forcing.elevation[0], 0j * ocean, 0j * ocean]),
    )
    settings = TideSettings(
        friction_law="quadratic",
        drag_coefficient=given["friction"],
        minimum_inner_angle_deg=given["anginn"],
    )
    elements = None
    if given["ics"] == 2:
        elements = adcirc_elements(case.mesh, given["slam0_sfea0"][1])
    tide = solve(case.mesh, forcing, settings, elements=elements)
    heights = read_fort53(adcirc_cases.FOLDER / name / "fort.53.gz")
    currents = read_fort54(adcirc_cases.FOLDER / name / "fort.54.gz")
    row = heights.names.index("M2")
    for name, bound in elevation.items():
        theirs, k = heights.values[heights.names.index(name)], tide.names.index(name)
        gap = np.linalg.norm(tide.elevation[k] - theirs)
        assert gap < bound * np.linalg.norm(heights.values[row])
        theirs = currents.values[heights.names.index(name)]
        gap = np.linalg.norm(tide.velocity[k] - theirs)
        assert gap < velocity[name] * np.linalg.norm(currents.values[row])


# --- refusals ---------------------------------------------------------------------


def test_says_how_far_the_iteration_came(bay):
    few = TideSettings(friction_law="quadratic", max_iterations=2, tolerance=1e-8)
    with pytest.raises(
        ConvergenceError, match=r"after 2 iterations .* changes by .* raise max_iter"
    ):
        solve(bay, driven(bay, {"M2": 0.5}), few)


def test_jets_do_not_converge_and_say_so():
    bay = annulus_mesh(24, 32, 1)
    wild = TideSettings(
        friction_law="quadratic",
        drag_coefficient=5e-4,
        advection=True,
        overtides=("M4", "STEADY"),
        max_iterations=8,
    )
    with pytest.raises(ConvergenceError, match="leave out advection"):
        solve(bay, driven(bay, {"M2": 5.0}), wild)


def test_tells_where_the_tide_falls_dry(caplog):
    bay = annulus_mesh(6, 8, 1)
    settings = TideSettings(
        friction_law="quadratic", finite_amplitude=True, overtides=("M4", "STEADY")
    )
    solve(bay, driven(bay, {"M2": 0.3}), settings)
    assert "less water" not in caplog.text
    tide = solve(bay, driven(bay, {"M2": 4.0}), settings)
    assert np.isfinite(tide.velocity).all()
    assert "less water" in caplog.text


def test_refuses_coefficients_that_are_none(bay):
    given = driven(bay, {"M2": 0.5})
    drag = np.full(len(bay.points), 0.003)
    drag[3] = np.nan
    with pytest.raises(InputError, match="must be finite and not negative; at node 3"):
        solve(bay, given, QUADRATIC, drag=drag)
    with pytest.raises(InputError, match=r'friction_law = "linear" has none'):
        solve(bay, given, drag=0.003)
    with pytest.raises(ValueError, match="drag must be a number or"):
        solve(bay, given, QUADRATIC, drag=np.ones(4))


def test_refuses_a_node_without_water(bay):
    depth = bay.depth.copy()
    depth[7] = 0.0
    dry = CoastalMesh(bay.points, bay.triangles, depth, bay.boundaries)
    with pytest.raises(MeshError, match=r"0 m at node 7.*raise the minimum depth"):
        solve(dry, driven(dry, {"M2": 0.5}), QUADRATIC)
