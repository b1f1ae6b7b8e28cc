"""Quadratic friction in ADCIRC's wave equation: ADCIRC, closed forms, identities."""

from __future__ import annotations

from dataclasses import replace

import adcirc_cases
import numpy as np
import pytest
from numpy.testing import assert_allclose

from tidemesh import constants
from tidemesh.datatypes import BoundaryString, CoastalMesh, TideForcing
from tidemesh.errors import ConvergenceError, InputError
from tidemesh.io.fort53 import read_fort53, read_fort54
from tidemesh.tides import TideSettings, solve
from tidemesh.tides.frequency_domain import solve_with_report
from tidemesh.tides.frequency_domain.gwce import solve_gwce

OMEGA = constants.frequency("M2")
QUADRATIC = TideSettings(
    friction_law="quadratic", discretisation="gwce", tau0=2.0e-3, tolerance=1.0e-9
)


def changed(**more):
    known = {name: getattr(QUADRATIC, name) for name in QUADRATIC.__struct_fields__}
    return TideSettings(**{**known, **more})


def relative(ours, theirs):
    return np.linalg.norm(ours - theirs) / np.linalg.norm(theirs)


def grid(x, y, depth, open_nodes):
    """Rectangles, each cut into two triangles, in a regular pattern."""
    px, py = np.meshgrid(x, y)
    points = np.stack([px, py], axis=-1).reshape(-1, 2)
    node = np.arange(px.size).reshape(px.shape)
    a, b = node[:-1, :-1].ravel(), node[:-1, 1:].ravel()
    c, d = node[1:, 1:].ravel(), node[1:, :-1].ravel()
    triangles = np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)])
    strings = tuple(BoundaryString("open", nodes) for nodes in open_nodes(node))
    return CoastalMesh(points, triangles, depth(points[:, 0]), strings)


def channel(n, length=6.0e4):
    """Channel along x, open at x = length, three nodes wide."""
    side = length / n
    return grid(
        np.linspace(0.0, length, n + 1),
        side * np.arange(3),
        lambda x: 6.0 + 6.0 * x / length,
        lambda node: [node[:, -1]],
    )


def driven(mesh, amplitudes, **more):
    nodes = mesh.open_nodes
    return TideForcing(
        tuple(amplitudes),
        np.array([constants.frequency(name) for name in amplitudes]),
        nodes,
        np.array([np.full(len(nodes), value) for value in amplitudes.values()]),
        **more,
    )


# --- ADCIRC -----------------------------------------------------------------------


@pytest.mark.skipif(
    not adcirc_cases.FOLDER.is_dir(), reason="the ADCIRC reference runs are not here"
)
@pytest.mark.parametrize(
    # Overtides up to which multiple of M2; elevation and velocity of M2 and of M6,
    # relative to M2. Phases are printed with four decimals of a degree: 5e-7.
    ("name", "time_step", "highest", "bounds"),
    [
        ("qa_ts_qf", True, 19, {"M2": (8e-7, 8e-7), "M6": (3e-7, 3e-7)}),
        ("qa_r4_qf", True, 13, {"M2": (1e-6, 1e-6), "M6": (5e-7, 1e-6)}),
        ("qa_r4_qf", False, 7, {"M2": (6e-4, 7e-4), "M6": (1e-4, 2e-4)}),
        # In the inlet friction is so strong that overtides fade slowly.
        ("sh_qf", True, 9, {"M2": (1.5e-4, 1.2e-3), "M6": (9e-5, 1.5e-3)}),
        pytest.param(
            "sh_qf",
            True,
            19,
            {"M2": (4e-6, 1.2e-4), "M6": (2e-6, 1.2e-4)},
            marks=pytest.mark.slow,
        ),
    ],
)
def test_agrees_with_adcirc(name, time_step, highest, bounds):
    case = adcirc_cases.load(name)
    given, ocean = case.settings, case.mesh.open_nodes
    # What ADCIRC makes of odd overtides beyond M6 acts back on M2 and M6.
    odd = np.arange(1, highest + 1, 2)
    rest = np.zeros((len(odd) - 1, len(ocean)))
    forcing = TideForcing(
        tuple(f"M{2 * k}" for k in odd),
        given["omega"] * odd,
        ocean,
        np.concatenate([case.forcing.elevation, rest]),
    )
    settings = changed(
        drag_coefficient=given["friction"],
        tau0=given["tau0"],
        minimum_inner_angle_deg=given["anginn"],
        metric="plane" if given["ics"] == 1 else "adcirc",
        time_step_s=given["dt"] if time_step else 0.0,
        tolerance=1e-7,
    )
    tide = solve(case.mesh, forcing, settings)
    heights = read_fort53(adcirc_cases.FOLDER / name / "fort.53.gz")
    currents = read_fort54(adcirc_cases.FOLDER / name / "fort.54.gz")
    for kind, ours, theirs in (
        (0, tide.elevation, heights),
        (1, tide.velocity, currents),
    ):
        size = np.linalg.norm(theirs.values[theirs.names.index("M2")])
        for constituent, bound in bounds.items():
            k = tide.names.index(constituent)
            gap = ours[k] - theirs.values[theirs.names.index(constituent)]
            assert np.linalg.norm(gap) < bound[kind] * size


# --- closed forms and identities --------------------------------------------------


def test_one_current_has_the_friction_of_lorentz():
    # With a shore at every node all water moves to and fro along it.
    n, length = 12, 6.0e4
    mesh = grid(
        np.linspace(0.0, length, n + 1),
        np.array([0.0, length / n]),
        lambda x: 6.0 + 6.0 * x / length,
        lambda node: [node[:, -1]],
    )
    shore = np.concatenate([np.arange(2 * n + 1, n, -1), np.arange(n + 1)])
    mesh = replace(
        mesh, boundaries=(*mesh.boundaries, BoundaryString("mainland", shore))
    )
    forcing = driven(mesh, {"M2": 0.6})
    settings = changed(minimum_inner_angle_deg=100.0)
    tide, report = solve_with_report(mesh, forcing, settings)
    assert report.converged
    assert 3 < report.iterations < 30
    lorentz = 8.0 / (3.0 * np.pi) * QUADRATIC.drag_coefficient / mesh.depth
    speed = np.linalg.norm(np.abs(tide.velocity[0]), axis=1)
    flows = speed > 0.1
    assert_allclose(tide.friction[0, flows], (lorentz * speed)[flows], rtol=2e-3)
    # The linear tide with that friction is the same tide, but for the sampling.
    linear = changed(friction_law="linear", minimum_inner_angle_deg=100.0)
    again = solve_gwce(mesh, forcing, linear, friction=tide.friction)
    assert relative(again.elevation, tide.elevation) < 2e-6
    assert relative(again.velocity, tide.velocity) < 2e-6


def test_becomes_the_tide_of_galerkin_as_the_mesh_is_refined():
    # The weight tau0 is of the discretisation alone.
    gaps = []
    for n in (8, 16, 32):
        mesh = channel(n)
        forcing = driven(mesh, {"M2": 0.6, "M6": 0.0})
        ours = solve(mesh, forcing, QUADRATIC)
        theirs = solve(mesh, forcing, changed(discretisation="galerkin"))
        gaps.append(relative(ours.elevation, theirs.elevation))
    assert gaps[-1] < 2e-3
    assert (np.log2(np.array(gaps[:-1]) / gaps[1:]) > 1.8).all()


def test_a_time_step_acts_on_the_friction_as_in_steps_of_time():
    """Uniform flow under a given slope, by stepping in time at one point."""
    steps, side, slope = 360, 2.0e3, 2.0e-5
    step = 2.0 * np.pi / OMEGA / steps
    depth, drag, g = 4.0, 3.0e-3, QUADRATIC.gravity
    line = side * np.arange(-1, 2)
    # The slope is given at all nodes but the one in the middle, which stays at rest.
    mesh = grid(
        line,
        line,
        lambda x: np.full(len(x), depth),
        lambda node: [[0, 1, 2, 5, 8, 7, 6, 3]],
    )
    odd = np.arange(1, 25, 2)
    elevation = np.zeros((len(odd), 8))
    elevation[0] = slope * mesh.points[mesh.open_nodes, 0]
    names = tuple(f"line{k}" for k in odd)
    forcing = TideForcing(names, OMEGA * odd, mesh.open_nodes, elevation)
    tide = solve(mesh, forcing, changed(time_step_s=step, land_rule="none"))

    push = -g * slope * np.cos(2.0 * np.pi / steps * np.arange(10 * steps + 1))
    u = np.zeros(len(push))
    for n in range(len(push) - 1):
        half = 0.5 * step * drag * abs(u[n]) / depth
        mean = 0.5 * (push[n] + push[n + 1])
        u[n + 1] = ((1.0 - half) * u[n] + step * mean) / (1.0 + half)
    lines = np.fft.fft(u[-steps - 1 : -1])[[1, 3]] * 2.0 / steps
    assert_allclose(tide.velocity[:2, 4, 0], lines, rtol=0, atol=2e-5 * abs(lines[0]))
    # In continuous time it is another one: the speed is that of half a step before.
    smooth = solve(mesh, forcing, changed(land_rule="none"))
    gap = abs(smooth.velocity[0, 4, 0] - lines[0]) / abs(lines[0])
    assert 1e-3 < gap < OMEGA * step
    assert np.abs(tide.elevation[:, 4]).max() < 1e-12
    assert_allclose(tide.velocity[:, :, 1], 0.0, atol=1e-15)


def test_formula_of_manning_is_a_drag_by_the_depth():
    mesh = channel(8)
    forcing = driven(mesh, {"M2": 0.5, "K1": 0.1})
    manning = changed(friction_law="manning", manning_n=0.03)
    drag = QUADRATIC.gravity * 0.03**2 / np.cbrt(mesh.depth)
    ours = solve(mesh, forcing, manning)
    theirs = solve(mesh, forcing, QUADRATIC, drag=drag)
    assert relative(ours.elevation, theirs.elevation) < 1e-8
    assert relative(ours.velocity, theirs.velocity) < 1e-8


def test_rotation_potential_and_several_constituents():
    """Against Galerkin's method, where every part of the drive is strong."""
    mesh = channel(48)
    rng = np.random.default_rng(5)
    names = ("M2", "S2", "K1")
    potential = np.stack([a * mesh.points[:, 0] / 6e4 for a in (0.4, 0.2j, 0.1)])
    forcing = driven(
        mesh,
        dict(zip(names, (0.5, 0.15j, 0.1))),
        potential=potential,
        nodal_factor=1.0 + 0.1 * rng.random(3),
        argument=rng.random(3),
    )
    given = {"coriolis": 1e-4}
    ours = solve(mesh, forcing, changed(overtides=("M6",)), **given)
    theirs = solve(
        mesh,
        forcing,
        changed(overtides=("M6",), discretisation="galerkin"),
        **given,
    )
    assert ours.names == theirs.names == (*names, "M6")
    still = solve(mesh, driven(mesh, dict(zip(names, (0.5, 0.15j, 0.1)))), QUADRATIC)
    assert relative(ours.elevation[:3], still.elevation) > 0.1
    for k in range(4):
        gap = np.abs(ours.elevation[k] - theirs.elevation[k]).max()
        assert gap < 4e-3 * np.abs(theirs.elevation[k]).max() + 1e-4


def test_recovered_velocities_are_near_the_mean_ones():
    mesh = channel(32)
    forcing = driven(mesh, {"M2": 0.6})
    mean = solve(mesh, forcing, QUADRATIC)
    fitted = solve(mesh, forcing, changed(velocity="recovered"))
    assert (fitted.elevation == mean.elevation).all()
    inside = (mesh.points[:, 0] > 5e3) & (mesh.points[:, 0] < 5.5e4)
    gap = relative(fitted.velocity[:, inside], mean.velocity[:, inside])
    assert 1e-9 < gap < 1e-2


# --- refusals ---------------------------------------------------------------------


def test_refuses_what_it_does_not_solve():
    mesh = channel(4)
    forcing = driven(mesh, {"M2": 0.6})
    for term in ("finite_amplitude", "advection"):
        with pytest.raises(InputError, match=f"neither.*{term}"):
            solve(mesh, forcing, changed(**{term: True}))
    with pytest.raises(InputError, match="goes with linear equations"):
        solve(mesh, forcing, QUADRATIC, friction=np.full((1, len(mesh.points)), 1e-3))
    with pytest.raises(ConvergenceError, match="raise max_iterations"):
        solve(mesh, forcing, changed(max_iterations=2))


def test_a_time_step_goes_with_the_equations_that_know_it():
    mesh = channel(4)
    settings = TideSettings(time_step_s=30.0)
    with pytest.raises(InputError, match='time_step_s goes with discretisation = "g'):
        solve(mesh, driven(mesh, {"M2": 0.6}), settings)
