"""The ADCIRC engine, with programs that imitate what ADCIRC leaves behind."""

import gzip
import json
import math
import os
import shutil
import signal
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import adcirc_cases
import numpy as np
import pytest
from annulus import FREQUENCY, annulus_forcing, annulus_mesh

from tidemesh import constants
from tidemesh.datatypes import BoundaryString, CoastalMesh, TideForcing, TideSolution
from tidemesh.errors import EngineError, InputError, MeshError
from tidemesh.geometry.projection import Projection
from tidemesh.io.fort13 import read_fort13
from tidemesh.io.fort14 import read_fort14
from tidemesh.io.fort15 import fort15_forcing, read_fort15
from tidemesh.io.fort53 import write_fort53, write_fort54
from tidemesh.tides.adcirc import (
    Adcirc,
    AdcircPending,
    AdcircSettings,
    check_run,
    plan_run,
    run_inputs,
    write_run,
)
from tidemesh.tides.adcirc.bottom import equivalent_friction
from tidemesh.tides.adcirc.launch import command_line
from tidemesh.tides.frequency_domain.solve import solve
from tidemesh.tides.potential import with_potential
from tidemesh.tides.settings import TideSettings

FAKE = Path(__file__).parent / "fake_adcirc" / "fake_adcirc.py"
SETTINGS = AdcircSettings()
TIDE = TideSettings(minimum_inner_angle_deg=110.0)

pytestmark = pytest.mark.skipif(os.name == "nt", reason="scripts need a first line")


@pytest.fixture(scope="module")
def mesh():
    return annulus_mesh(6, 8, 2)


@pytest.fixture(scope="module")
def forcing(mesh):
    return annulus_forcing(mesh)


@pytest.fixture(scope="module")
def answer(mesh, forcing):
    return solve(mesh, forcing, TIDE)


@pytest.fixture
def program(tmp_path, answer):
    """Makes a program that behaves in one of the ways of fake_adcirc.py."""
    results = tmp_path / "results"
    results.mkdir()
    write_fort53(results / "fort.53", answer)
    write_fort54(results / "fort.54", answer)

    def make(behaviour, name="adcirc"):
        text = FAKE.read_text()
        text = text.replace('BEHAVIOUR = "success"', f'BEHAVIOUR = "{behaviour}"')
        text = text.replace('RESULTS = ""', f'RESULTS = "{results}"')
        path = tmp_path / f"{name}_{behaviour}"
        path.write_text(f"#!{sys.executable} -IS\n{text}")
        path.chmod(0o755)
        return str(path)

    return make


@pytest.fixture
def engine(tmp_path, program):
    def make(behaviour, **more):
        settings = AdcircSettings(adcirc=program(behaviour), **more)
        return Adcirc(settings, TIDE, tmp_path / "run")

    return make


def relative(ours, theirs):
    return np.linalg.norm(ours - theirs) / np.linalg.norm(theirs)


# ---- a run that succeeds --------------------------------------------------------


def test_reads_the_results_of_a_good_run(engine, mesh, forcing, answer):
    adcirc, fractions = engine("success"), []
    tide = adcirc.solve(mesh, forcing, progress=fractions.append)
    assert tide.names == ("M2",)
    # Phases are printed to 1e-4 degree.
    assert relative(tide.elevation, answer.elevation) < 2e-6
    assert relative(tide.velocity, answer.velocity) < 2e-6
    np.testing.assert_array_equal(tide.friction, answer.friction)
    assert tide.coriolis is None
    assert adcirc.report()["version"] == "v56.2.0"
    assert adcirc.report()["solver_iterations"] == 12
    assert all(0.0 < fraction <= 1.0 for fraction in fractions)


def test_a_second_call_needs_no_program(engine, tmp_path, mesh, forcing, answer):
    engine("success").solve(mesh, forcing)
    absent = AdcircSettings(adcirc=str(tmp_path / "absent"))
    tide = Adcirc(absent, TIDE, tmp_path / "run").solve(mesh, forcing)
    assert relative(tide.elevation, answer.elevation) < 2e-6


def test_warnings_are_reported_once(engine, mesh, forcing):
    adcirc = engine("warns")
    adcirc.solve(mesh, forcing)
    warnings = adcirc.report()["warnings"]
    assert len(warnings) == 2
    assert any("TAU0 SHOULD BE SET EQUAL TO TAU" in text for text in warnings)
    assert any("Elevation.gt.WarnElev" in text for text in warnings)


def test_east_and_north_are_turned_to_the_axes_of_the_mesh(tmp_path, program):
    mesh = _on_the_sphere()
    forcing = _one_wave(mesh)
    settings = AdcircSettings(adcirc=program("success"), coordinates="adcirc")
    there = solve(mesh, forcing, TideSettings())
    turned = mesh.projection.east_north(mesh.points, there.velocity)
    results = tmp_path / "results"
    write_fort53(results / "fort.53", there)
    write_fort54(
        results / "fort.54",
        TideSolution(
            there.names, there.frequency, there.elevation, turned, there.friction
        ),
    )
    tide = Adcirc(settings, TideSettings(), tmp_path / "run").solve(mesh, forcing)
    assert relative(turned, there.velocity) > 1e-2
    assert relative(tide.velocity, there.velocity) < 2e-6


def test_the_steady_part_goes_first_and_comes_back_in_its_place(tmp_path, program):
    mesh = annulus_mesh(6, 8, 2)
    one = annulus_forcing(mesh)
    forcing = TideForcing(
        ("M2", "STEADY"),
        np.array([FREQUENCY, 0.0]),
        one.nodes,
        np.concatenate([one.elevation, 0.1 + 0.0 * one.elevation]),
    )
    run = write_run(tmp_path / "run", mesh, forcing, TIDE, SETTINGS)
    control = read_fort15(run.path / "fort.15")
    assert [row.name for row in control.harmonic] == ["STEADY", "M2"]
    answer = solve(mesh, forcing, TIDE)
    order = [1, 0]
    results = TideSolution(
        ("STEADY", "M2"),
        answer.frequency[order],
        answer.elevation[order],
        answer.velocity[order],
        answer.friction,
    )
    settings = AdcircSettings(adcirc=program("success"))
    write_fort53(tmp_path / "results" / "fort.53", results)
    write_fort54(tmp_path / "results" / "fort.54", results)
    tide = Adcirc(settings, TIDE, tmp_path / "run").solve(mesh, forcing)
    assert tide.names == forcing.names
    assert relative(tide.elevation, answer.elevation) < 2e-6


# ---- runs that fail -------------------------------------------------------------


@pytest.mark.parametrize(
    ("behaviour", "quote", "remedy"),
    [
        ("blow_up", r"NODE 6 .*Elevation\.gt\.ErrorElev", "shorter adcirc.time_step_s"),
        ("blow_up_of_rank_0", r"Elevation\.gt\.ErrorElev", "shorter adcirc.time_step"),
        ("not_a_number", "NaN", "shorter adcirc.time_step_s"),
        ("huge", "M2 at node 1 is 2.47e\\+151 m", "shorter adcirc.time_step_s"),
        ("no_elevation", "fort.53: is not there although", "harmonic analysis"),
        ("cut_off", r"fort\.54: line \d+: .*cut off", "run again"),
        (
            "of_another_mesh",
            "has 62 nodes and 1 constituents, the run has 63",
            "another",
        ),
        ("bad_option", "not an allowable value", "extra_lines"),
        ("fort15_ends", "End of file", "fort.16"),
        ("garbage_mesh", "Reading line 5 gave", "damaged"),
        ("no_file", "Required file not found: ./fort.15", "write the directory anew"),
        ("not_converged", "ITERATIONS = 100", "solver_iterations"),
        ("converged_but_once", "failure to converge in 100", "solver_tolerance"),
        ("crash", "exit code -11", "look at both logs"),
        ("stops_in_between", "step 30 of", "kept"),
        ("root_refused", "attempt to run as root", "--allow-run-as-root"),
        ("nothing", "ended without", "kept"),
    ],
)
def test_a_failed_run_says_why(engine, mesh, forcing, behaviour, quote, remedy):
    adcirc = engine(behaviour)
    with pytest.raises(EngineError, match=quote) as caught:
        adcirc.solve(mesh, forcing)
    assert remedy in str(caught.value)
    assert "screen.log" in str(caught.value) or "fort." in str(caught.value)
    assert not isinstance(caught.value, AdcircPending)
    # Kept, with its inputs and logs.
    assert (adcirc.folder / "fort.15").exists()
    assert (adcirc.folder / "screen.log").exists()


def test_a_failed_run_is_run_again(engine, mesh, forcing, answer):
    with pytest.raises(EngineError, match="blew up"):
        engine("blow_up").solve(mesh, forcing)
    tide = engine("success").solve(mesh, forcing)
    assert relative(tide.elevation, answer.elevation) < 2e-6


def test_results_older_than_the_inputs_are_refused(engine, mesh, forcing):
    adcirc = engine("success")
    adcirc.solve(mesh, forcing)
    os.utime(adcirc.folder / "fort.53", (1.0, 1.0))
    with pytest.raises(EngineError, match="older than the inputs"):
        check_run(adcirc.folder)


def test_results_of_other_constituents_are_refused(engine, mesh, forcing):
    adcirc = engine("success")
    other = replace(forcing, frequency=forcing.frequency * 1.0001)
    with pytest.raises(EngineError, match=r"frequency .* belongs to another run"):
        adcirc.solve(mesh, other)


def test_a_run_that_does_not_end_is_stopped(engine, mesh, forcing):
    adcirc, fractions = engine("hangs", timeout_s=2.0), []
    begin = time.monotonic()
    with pytest.raises(EngineError, match=r"stopped after adcirc\.timeout_s = 2 s"):
        adcirc.solve(mesh, forcing, progress=fractions.append)
    assert time.monotonic() - begin < 20.0
    assert fractions
    assert _processes_of(adcirc.settings.adcirc) == []


def test_control_c_ends_the_program_and_keeps_the_directory(engine, mesh, forcing):
    adcirc = engine("hangs")
    with pytest.raises(KeyboardInterrupt):
        adcirc.solve(
            mesh, forcing, progress=lambda _: os.kill(os.getpid(), signal.SIGINT)
        )
    assert _processes_of(adcirc.settings.adcirc) == []
    assert (adcirc.folder / "fort.14").exists()


def _processes_of(program):
    listed = subprocess.run(["ps", "-eo", "args"], capture_output=True, text=True)
    return [line for line in listed.stdout.splitlines() if program in line]


def test_a_program_that_is_none_is_named(tmp_path, mesh, forcing):
    path = tmp_path / "adcirc"
    path.write_bytes(b"\x7fELF no program")
    path.chmod(0o755)
    adcirc = Adcirc(AdcircSettings(adcirc=str(path)), TIDE, tmp_path / "run")
    with pytest.raises(EngineError, match="cannot be started"):
        adcirc.solve(mesh, forcing)


# ---- several processes ----------------------------------------------------------


def _launcher(tmp_path):
    """Takes what follows `-np N` for the program, as mpirun does."""
    path = tmp_path / "launch"
    path.write_text('#!/bin/sh\nshift 2\nexec "$@"\n')
    path.chmod(0o755)
    return f"{path} -np {{ranks}}"


def test_parallel_runs_are_prepared_and_launched(tmp_path, program, mesh, forcing):
    settings = AdcircSettings(
        ranks=2,
        launcher=_launcher(tmp_path),
        adcprep=program("nothing", "adcprep"),
        padcirc=program("success", "padcirc"),
    )
    adcirc = Adcirc(settings, TIDE, tmp_path / "run")
    adcirc.solve(mesh, forcing)
    first = (adcirc.folder / "adcprep_partmesh.log").read_text()
    second = (adcirc.folder / "adcprep_prepall.log").read_text()
    assert "['--np', '2', '--partmesh']" in first
    assert "['--np', '2', '--prepall']" in second


def test_a_crash_of_the_preparation_is_told(tmp_path, program, mesh, forcing):
    settings = AdcircSettings(
        ranks=2,
        launcher=_launcher(tmp_path),
        adcprep=program("crash_136", "adcprep"),
        padcirc=program("success", "padcirc"),
    )
    adcirc = Adcirc(settings, TIDE, tmp_path / "run")
    with pytest.raises(EngineError, match=r"crashed .*136.*SIGFPE") as caught:
        adcirc.solve(mesh, forcing)
    assert "adcprep_partmesh.log" in str(caught.value)


def test_without_launcher_the_directory_is_left_ready(tmp_path, mesh, forcing):
    settings = AdcircSettings(
        ranks=4, adcprep="no_adcprep", launcher="no_such_launcher -n {ranks}"
    )
    with pytest.raises(AdcircPending, match="no_adcprep is not installed") as caught:
        Adcirc(settings, TIDE, tmp_path / "run").solve(mesh, forcing)
    assert "no_such_launcher -n 4 padcirc" in str(caught.value)
    assert (tmp_path / "run" / "fort.14").exists()


# ---- runs elsewhere -------------------------------------------------------------


def test_a_job_script_stops_and_goes_on(tmp_path, program, mesh, forcing, answer):
    template = tmp_path / "job.sh"
    template.write_text('#!/bin/sh\ncd "{folder}" # ${HOME} {ranks}\n{command}\n')
    settings = AdcircSettings(adcirc=program("success"), batch_template=str(template))
    adcirc = Adcirc(settings, TIDE, tmp_path / "run")
    with pytest.raises(AdcircPending, match=r"submit .*job\.sh; when"):
        adcirc.solve(mesh, forcing)
    script = (tmp_path / "run" / "job.sh").read_text()
    assert "${HOME} 1" in script
    assert command_line(settings) in script
    with pytest.raises(AdcircPending, match="has not run here yet"):
        adcirc.solve(mesh, forcing)
    subprocess.run(["sh", tmp_path / "run" / "job.sh"], check=True)
    tide = adcirc.solve(mesh, forcing)
    assert relative(tide.elevation, answer.elevation) < 2e-6


def test_a_job_on_its_way_is_left_alone(tmp_path, program, mesh, forcing):
    template = tmp_path / "job.sh"
    template.write_text('cd "{folder}"\n{command}\n')
    settings = AdcircSettings(
        adcirc=program("stops_in_between"), batch_template=str(template)
    )
    adcirc = Adcirc(settings, TIDE, tmp_path / "run")
    with pytest.raises(AdcircPending):
        adcirc.solve(mesh, forcing)
    subprocess.run(["sh", tmp_path / "run" / "job.sh"], check=True)
    with pytest.raises(AdcircPending, match=r"not come to its end .step 30 of"):
        adcirc.solve(mesh, forcing)
    assert (adcirc.folder / "screen.log").exists()


def test_a_failed_job_is_no_pending_one(tmp_path, program, mesh, forcing):
    template = tmp_path / "job.sh"
    template.write_text('cd "{folder}"\n{command}\n')
    settings = AdcircSettings(
        adcirc=program("blow_up_of_rank_0"), batch_template=str(template)
    )
    adcirc = Adcirc(settings, TIDE, tmp_path / "run")
    with pytest.raises(AdcircPending):
        adcirc.solve(mesh, forcing)
    subprocess.run(["sh", tmp_path / "run" / "job.sh"], check=True)
    with pytest.raises(EngineError, match="blew up") as caught:
        adcirc.solve(mesh, forcing)
    assert not isinstance(caught.value, AdcircPending)


def test_a_template_without_command_is_refused(tmp_path, mesh, forcing):
    template = tmp_path / "job.sh"
    template.write_text("srun padcirc\n")
    settings = AdcircSettings(batch_template=str(template))
    with pytest.raises(InputError, match=r"job\.sh: has no \{command\}"):
        Adcirc(settings, TIDE, tmp_path / "run").solve(mesh, forcing)


# ---- the run directory ----------------------------------------------------------


def test_the_directory_holds_mesh_and_forcing(tmp_path, mesh, forcing):
    run = write_run(tmp_path / "deep" / "run", mesh, forcing, TIDE, SETTINGS)
    assert run.written
    again = read_fort14(run.path / "fort.14", coordinates="metres")
    np.testing.assert_allclose(again.points, mesh.points, atol=1e-9)
    np.testing.assert_array_equal(again.triangles, mesh.triangles)
    control = read_fort15(run.path / "fort.15", again)
    back = fort15_forcing(control, again)
    np.testing.assert_allclose(back.elevation, forcing.elevation, rtol=1e-13)
    assert back.frequency == forcing.frequency
    assert not (run.path / "fort.13").exists()
    assert [p.name for p in (tmp_path / "deep").iterdir()] == ["run"]


def test_the_same_inputs_are_not_written_again(tmp_path, mesh, forcing):
    first = write_run(tmp_path / "run", mesh, forcing, TIDE, SETTINGS)
    before = (first.path / "fort.15").stat().st_mtime_ns
    (first.path / "fort.53").write_text("result")
    again = write_run(tmp_path / "run", mesh, forcing, TIDE, SETTINGS)
    assert not again.written
    assert (first.path / "fort.15").stat().st_mtime_ns == before
    assert (first.path / "fort.53").exists()


def test_other_inputs_remove_the_results_and_say_so(tmp_path, mesh, forcing, caplog):
    folder = tmp_path / "run"
    write_run(folder, mesh, forcing, replace_tide(manning=True), SETTINGS)
    assert (folder / "fort.13").exists()
    for name in ("fort.53", "fort.54.nc", "fort.16", "maxele.63", "screen.log"):
        (folder / name).write_text("old")
    (folder / "PE0000").mkdir()
    (folder / "PE0000" / "fort.16").write_text("old")
    (folder / "notes.txt").write_text("mine")
    run = write_run(folder, mesh, forcing, TIDE, SETTINGS)
    assert run.written
    assert "fort.13, fort.15 replaced, its results removed" in caplog.text
    kept = sorted(path.name for path in folder.iterdir())
    assert kept == ["fort.14", "fort.15", "notes.txt", "tidemesh_run.json"]


def replace_tide(manning=False, **more):
    law = {"friction_law": "manning", "manning_n": 0.025} if manning else {}
    return TideSettings(minimum_inner_angle_deg=110.0, **law, **more)


def test_foreign_and_edited_files_are_not_touched(tmp_path, mesh, forcing):
    folder = tmp_path / "run"
    folder.mkdir()
    (folder / "fort.15").write_text("precious")
    with pytest.raises(InputError, match=r"did not write .fort\.15"):
        write_run(folder, mesh, forcing, TIDE, SETTINGS)
    assert (folder / "fort.15").read_text() == "precious"
    (folder / "fort.15").unlink()
    write_run(folder, mesh, forcing, TIDE, SETTINGS)
    with open(folder / "fort.15", "a") as file:
        file.write("&metControl /\n")
    with pytest.raises(InputError, match=r"fort\.15: was changed since"):
        write_run(folder, mesh, forcing, TIDE, SETTINGS)
    with pytest.raises(EngineError, match="no run directory of this program"):
        check_run(tmp_path)
    (folder / "tidemesh_run.json").write_text("{")
    with pytest.raises(EngineError, match=r"tidemesh_run\.json: is damaged"):
        check_run(folder)


def test_the_bytes_are_the_same_every_time(tmp_path, mesh, forcing):
    runs = [
        write_run(tmp_path / name, mesh, forcing, replace_tide(manning=True), SETTINGS)
        for name in ("one", "two")
    ]
    for name in ("fort.13", "fort.14", "fort.15", "tidemesh_run.json"):
        one, two = (run.path / name for run in runs)
        assert one.read_bytes() == two.read_bytes()


# ---- what is written ------------------------------------------------------------


@pytest.mark.parametrize(
    ("settings", "expected"),
    [
        ({}, (0, 0, 0, 0)),
        ({"friction_law": "quadratic"}, (1, 0, 0, 0)),
        ({"finite_amplitude": True}, (0, 1, 0, 0)),
        ({"advection": True}, (0, 0, 1, 1)),
        (
            {"friction_law": "manning", "finite_amplitude": True, "advection": True},
            (1, 1, 1, 1),
        ),
    ],
)
def test_switches_follow_the_physics(mesh, forcing, settings, expected):
    control = run_inputs(mesh, forcing, replace_tide(**settings), SETTINGS).control
    got = control.nolibf, control.nolifa, control.nolica, control.nolicat
    assert got == expected
    assert control.nscreen != 0
    # What ADCIRC calls inconsistent it only takes when it may go on.
    assert control.nfover == (expected == (0, 0, 1, 1))


def test_friction_at_the_nodes_goes_into_the_fort13(tmp_path, mesh, forcing):
    values = np.linspace(1e-3, 5e-3, len(mesh.points))
    name = "quadratic_friction_coefficient_at_sea_floor"
    quadratic = replace_tide(friction_law="quadratic")
    run = write_run(tmp_path / "a", mesh, forcing, quadratic, SETTINGS, drag=values)
    again = read_fort13(run.path / "fort.13")
    np.testing.assert_allclose(again.of(name)[:, 0], values, rtol=1e-12)
    assert read_fort15(run.path / "fort.15").nwp == (name,)
    manning = replace_tide(manning=True)
    run = write_run(tmp_path / "b", mesh, forcing, manning, SETTINGS)
    again = read_fort13(run.path / "fort.13")
    assert (again.of("mannings_n_at_sea_floor") == 0.025).all()
    control = read_fort15(run.path / "fort.15")
    # The number in the control file would be a floor to C_f.
    assert (control.nolibf, control.friction) == (1, 0.0)
    run = write_run(tmp_path / "c", mesh, forcing, quadratic, SETTINGS, drag=0.004)
    assert not (run.path / "fort.13").exists()
    assert read_fort15(run.path / "fort.15").friction == 0.004


def test_momentum_is_not_advected_across_the_ocean_boundary(tmp_path, mesh, forcing):
    tide = replace_tide(finite_amplitude=True, advection=True, friction_law="manning")
    run = write_run(tmp_path / "run", mesh, forcing, tide, SETTINGS)
    names = read_fort15(run.path / "fort.15").nwp
    assert names == ("mannings_n_at_sea_floor", "advection_state")
    # ADCIRC advects where all nodes of an element are deeper than the attribute.
    limit = read_fort13(run.path / "fort.13").of("advection_state")[:, 0]
    still = (mesh.depth < limit)[mesh.triangles].any(axis=1)
    at_ocean = np.isin(mesh.triangles, mesh.open_nodes).any(axis=1)
    np.testing.assert_array_equal(still, at_ocean)
    two = AdcircSettings(ocean_rings_without_advection=2)
    limit = run_inputs(mesh, forcing, tide, two).attributes.of("advection_state")[:, 0]
    np.testing.assert_array_equal(
        limit > mesh.depth, np.isin(np.arange(63), mesh.triangles[at_ocean])
    )
    none = AdcircSettings(ocean_rings_without_advection=0)
    assert run_inputs(mesh, forcing, tide, none).control.nwp == names[:1]


def test_astronomy_goes_with_forcing_and_analysis(mesh, forcing):
    given = replace(forcing, nodal_factor=[0.97], argument=[math.radians(-30.0)])
    control = run_inputs(mesh, given, TIDE, SETTINGS).control
    for row in (control.forcing[0], control.harmonic[0]):
        assert row.nodal_factor == 0.97
        assert row.argument_deg == pytest.approx(330.0)


def test_overtides_are_analysed_and_not_forced(mesh, forcing):
    tide = replace_tide(friction_law="quadratic", overtides=("M6", "STEADY"))
    inputs = run_inputs(mesh, forcing, tide, SETTINGS)
    assert [row.name for row in inputs.control.forcing] == ["M2"]
    assert [row.name for row in inputs.control.harmonic] == ["STEADY", "M2", "M6"]
    assert inputs.control.harmonic[2].frequency == pytest.approx(3 * FREQUENCY)


def _on_the_sphere():
    """A square of some 100 km at 50 degrees north, off its map's meridian."""
    projection = Projection.stereographic(0.0, 50.0)
    n = 5
    lon, lat = np.meshgrid(np.linspace(4.0, 5.4, n), np.linspace(50.0, 51.0, n))
    points = projection.forward(lon.ravel(), lat.ravel())
    node = np.arange(n * n).reshape(n, n)
    a, b = node[:-1, :-1].ravel(), node[:-1, 1:].ravel()
    c, d = node[1:, 1:].ravel(), node[1:, :-1].ravel()
    triangles = np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)])
    ocean = node[0, ::-1][::-1]
    land = np.concatenate([node[:, -1], node[-1, -2::-1], node[-2::-1, 0]])
    return CoastalMesh(
        points,
        triangles,
        np.full(n * n, 20.0),
        (BoundaryString("open", ocean), BoundaryString("mainland", land)),
        projection,
    )


def _one_wave(mesh, name="M2"):
    nodes = mesh.open_nodes
    return TideForcing(
        (name,),
        np.array([constants.frequency(name)]),
        nodes,
        np.full((1, len(nodes)), 0.5 + 0.2j),
    )


@pytest.mark.parametrize(
    ("tide", "settings", "ics", "ncor"),
    [
        ({}, {}, 1, 0),
        ({"metric": "sphere"}, {}, 22, 0),
        ({"metric": "adcirc"}, {}, 2, 0),
        ({"coriolis": "latitude"}, {}, 22, 1),
        ({"coriolis": "constant"}, {}, 1, 0),
        ({}, {"coordinates": "equal_area"}, 20, 0),
    ],
)
def test_coordinates_follow_the_metric(tmp_path, tide, settings, ics, ncor):
    mesh = _on_the_sphere()
    run = write_run(
        tmp_path / "run",
        mesh,
        _one_wave(mesh),
        TideSettings(**tide),
        AdcircSettings(**settings),
    )
    control = read_fort15(run.path / "fort.15")
    assert (control.ics, control.ncor) == (ics, ncor)
    kind = "metres" if ics == 1 else "degrees"
    again = read_fort14(run.path / "fort.14", coordinates=kind)
    place = mesh.points if ics == 1 else mesh.projection.inverse(mesh.points)
    np.testing.assert_allclose(again.projection.inverse(again.points), place, atol=1e-9)
    if tide.get("coriolis") == "constant":
        f = 2.0 * 7.29212e-5 * math.sin(math.radians(33.0))
        assert control.cori == pytest.approx(f)


@pytest.mark.parametrize("name", ["M2", "K1"])
def test_the_potential_comes_back_from_the_fort15(tmp_path, name):
    mesh = _on_the_sphere()
    forcing = with_potential(mesh, _one_wave(mesh, name))
    forcing = replace(forcing, nodal_factor=[1.1], argument=[0.7])
    tide = TideSettings(tidal_potential=True)
    run = write_run(tmp_path / "run", mesh, forcing, tide, SETTINGS)
    control = read_fort15(run.path / "fort.15")
    assert control.ntip == 1
    # As ADCIRC's users know it.
    assert control.potential[0].earth_tide_factor < 0.75
    back = fort15_forcing(control, mesh)
    np.testing.assert_allclose(back.potential, forcing.potential, rtol=1e-9)


def test_rivers_stay_still(mesh, forcing):
    land = next(s for s in mesh.boundaries if s.kind == "mainland")
    river = replace(land, nodes=land.nodes[5:8], ibtype=22)
    strings = (*mesh.boundaries, river)
    inputs = run_inputs(replace(mesh, boundaries=strings), forcing, TIDE, SETTINGS)
    assert inputs.control.nffr == 1
    assert len(inputs.control.flux[0].flux) == 3
    assert not inputs.control.flux[0].flux.any()


def test_two_open_strings_and_forcing_in_another_order(mesh, forcing):
    ocean = mesh.open_nodes
    strings = (
        BoundaryString("open", ocean[:4]),
        BoundaryString("open", ocean[3:]),
        *(s for s in mesh.boundaries if s.kind != "open"),
    )
    split = replace(mesh, boundaries=strings)
    values = np.arange(1.0, len(ocean) + 1.0)[None]
    turned = replace(forcing, nodes=ocean[::-1], elevation=values[:, ::-1])
    control = run_inputs(split, turned, TIDE, SETTINGS).control
    # The shared node has two rows, which ADCIRC adds up.
    expected = [1.0, 2.0, 3.0, 4.0, 0.0, *np.arange(5.0, len(ocean) + 1.0)]
    np.testing.assert_array_equal(control.forcing[0].elevation, expected)


# ---- length, step, analysis -----------------------------------------------------


def test_a_linear_run_may_step_as_it_likes(mesh, forcing):
    plan = plan_run(mesh, forcing, TIDE, SETTINGS)
    assert (plan.time_step_s, plan.tau0) == (30.0, TIDE.friction)
    assert plan.harmonic_days == (8.0, 10.0)
    assert plan.steps == 10 * 2880
    # ADCIRC rounds down.
    assert math.floor(plan.run_days * 86400.0 / plan.time_step_s) == plan.steps


def test_other_runs_step_by_the_shortest_edge(mesh, forcing):
    tide = replace_tide(friction_law="quadratic")
    plan = plan_run(mesh, forcing, tide, SETTINGS)
    edges = mesh.points[mesh.triangles] - mesh.points[np.roll(mesh.triangles, 1, 1)]
    slowest = np.sqrt(9.81 * mesh.depth.max())
    assert plan.time_step_s <= np.hypot(*edges.T).max() / slowest
    assert plan.tau0 == 0.009
    fine = plan_run(annulus_mesh(48, 64, 2), forcing, tide, SETTINGS)
    coarse = plan_run(annulus_mesh(24, 32, 2), forcing, tide, SETTINGS)
    ratio = coarse.time_step_s / fine.time_step_s
    assert fine.time_step_s < 30.0 or ratio == 1.0
    long = plan_run(mesh, forcing, tide, AdcircSettings(time_step_s=3000.0))
    assert any("likely to blow up" in note for note in long.notes)


@pytest.mark.parametrize(
    ("names", "days"),
    [(("M2", "S2"), 14.765), (("M2", "N2", "S2"), 27.555), (("K1", "P1"), 182.62)],
)
def test_the_analysis_is_long_enough_to_tell_constituents_apart(mesh, names, days):
    nodes = mesh.open_nodes
    forcing = TideForcing(
        names,
        np.array([constants.frequency(name) for name in names]),
        nodes,
        np.ones((len(names), len(nodes))),
    )
    plan = plan_run(mesh, forcing, TIDE, SETTINGS)
    start, end = plan.harmonic_days
    assert end - start == pytest.approx(days, rel=2e-4)
    short = plan_run(mesh, forcing, TIDE, AdcircSettings(run_days=12.0))
    assert any("is too short" in note for note in short.notes)


def test_settings_that_contradict_each_other_are_refused(mesh, forcing):
    def refused(text, tide=TIDE, forced=forcing, error=InputError, on=mesh, **settings):
        with pytest.raises(error, match=text):
            run_inputs(on, forced, tide, AdcircSettings(**settings))

    refused("add up to 1.2", weights=(0.5, 0.5, 0.2))
    refused("needs tide.finite_amplitude", wetting=True)
    refused("tau0 = -3", tau0=-3.0)
    refused("leaves nothing to analyse", run_days=5.0)
    refused(
        "no Coriolis force by latitude",
        TideSettings(coriolis="latitude"),
        on=_on_the_sphere(),
        forced=_one_wave(_on_the_sphere()),
        coordinates="metres",
    )
    refused("needs a mesh with a map", coordinates="mercator")
    refused(
        "only 9.81",
        TideSettings(gravity=9.7),
        on=_on_the_sphere(),
        forced=_one_wave(_on_the_sphere()),
        coordinates="adcirc",
    )
    fewer = replace(
        forcing, nodes=forcing.nodes[1:], elevation=forcing.elevation[:, 1:]
    )
    refused(f"node {forcing.nodes[0]} has no forcing", forced=fewer)
    twice = replace(
        forcing,
        names=("M2", "X2"),
        frequency=np.repeat(forcing.frequency, 2),
        elevation=np.repeat(forcing.elevation, 2, axis=0),
    )
    refused("M2 and X2 have the same frequency", forced=twice)
    nan = replace(forcing, elevation=forcing.elevation * np.nan)
    refused("not a finite number", forced=nan)
    dry = replace(mesh, depth=mesh.depth - 4.0)
    refused("deepen the mesh", on=dry, error=MeshError)
    closed = replace(mesh, boundaries=mesh.boundaries[1:])
    refused("no open .ocean. boundary", on=closed, error=EngineError)
    turned = replace(mesh, triangles=mesh.triangles[:, ::-1])
    refused("inverted or flat", on=turned, error=MeshError)
    lonely = replace(
        mesh,
        points=np.vstack([mesh.points, [[0.0, 0.0]]]),
        depth=np.append(mesh.depth, 1.0),
    )
    refused("node 63 has no triangle", on=lonely, error=MeshError)
    with pytest.raises(InputError, match="one Coriolis parameter"):
        run_inputs(mesh, forcing, TIDE, SETTINGS, coriolis=np.arange(63) * 1e-6)
    with pytest.raises(InputError, match="linear friction as one number"):
        run_inputs(mesh, forcing, TIDE, SETTINGS, friction=np.arange(63) * 1e-5)
    with pytest.raises(InputError, match="friction coefficient of node 3"):
        run_inputs(
            mesh,
            forcing,
            TIDE,
            SETTINGS,
            friction=np.where(np.arange(63) == 3, -1.0, 1e-4),
        )


def test_steps_that_are_hard_to_solve_are_watched(mesh, forcing):
    easy = run_inputs(mesh, forcing, TIDE, SETTINGS).control
    hard = run_inputs(mesh, forcing, TIDE, AdcircSettings(time_step_s=6000.0)).control
    few = run_inputs(mesh, forcing, TIDE, AdcircSettings(solver_iterations=9)).control
    assert (easy.solver[1], hard.solver[1], few.solver[1]) == (0, 1, 1)


def test_shallow_nodes_are_deepened_and_told(mesh, forcing):
    settings = AdcircSettings(minimum_depth_m=5.0)
    inputs = run_inputs(mesh, forcing, TIDE, settings)
    count = int((mesh.depth < 5.0).sum())
    assert inputs.control.minimum_depth == 5.0
    assert any(f"{count} nodes shallower" in note for note in inputs.plan.notes)
    high = replace(forcing, elevation=20.0 * forcing.elevation)
    finite = replace_tide(finite_amplitude=True)
    assert any("fall dry" in n for n in plan_run(mesh, high, finite, SETTINGS).notes)
    assert not any("fall dry" in n for n in plan_run(mesh, high, TIDE, SETTINGS).notes)
    # Left to itself, ADCIRC must change no depth.
    inputs = run_inputs(mesh, forcing, TIDE, SETTINGS)
    assert inputs.control.minimum_depth < mesh.depth.min()


# ---- friction -------------------------------------------------------------------


def test_one_constituent_along_a_line_is_lorentz():
    speed = np.array([0.3, 1.0])
    velocity = np.zeros((1, 2, 2), dtype=complex)
    velocity[0, :, 0] = 0.6 * speed * np.exp(0.4j)
    velocity[0, :, 1] = -0.8 * speed * np.exp(0.4j)
    tau = equivalent_friction(
        np.array([FREQUENCY]),
        velocity,
        np.zeros((1, 2)),
        np.array([10.0, 4.0]),
        np.array([0.003, 0.003]),
        TideSettings(friction_law="quadratic"),
    )
    lorentz = 8.0 / (3.0 * math.pi) * 0.003 * speed / [10.0, 4.0]
    np.testing.assert_allclose(tau[0], lorentz, rtol=2e-3)


def test_a_small_tide_beside_a_large_one_feels_half_as_much_again():
    # d(|u| u)/du = 2 |u|, against 4/3 of the mean that the large one feels itself.
    velocity = np.zeros((2, 1, 2), dtype=complex)
    velocity[:, 0, 0] = 1.0, 0.1
    frequency = np.array([constants.frequency(name) for name in ("M2", "S2")])
    tau = equivalent_friction(
        frequency,
        velocity,
        np.zeros((2, 1)),
        np.array([1.0]),
        np.array([1.0]),
        TideSettings(friction_law="quadratic"),
    )
    assert tau[1, 0] / tau[0, 0] == pytest.approx(1.5, rel=1e-2)


# ---- ADCIRC's own runs ----------------------------------------------------------

reference = pytest.mark.skipif(
    not adcirc_cases.FOLDER.is_dir(), reason="the ADCIRC reference runs are not here"
)


@reference
@pytest.mark.parametrize("name", ["qa_r4_lin", "sh_lin", "sh_cor", "qa_r4_tau0x"])
def test_writes_the_settings_of_the_reference_runs(tmp_path, name):
    case = adcirc_cases.load(name)
    given = case.settings
    theirs = read_fort15(adcirc_cases.FOLDER / name / "fort.15.gz", case.mesh)
    start, end, every, _ = given["harmonic"]
    tide = TideSettings(
        friction=given["friction"],
        minimum_inner_angle_deg=given["anginn"],
        metric="adcirc" if given["ics"] == 2 else "plane",
        tau0=given["tau0"],
    )
    settings = AdcircSettings(
        time_step_s=given["dt"],
        ramp_days=given["dramp"],
        spin_up_days=start,
        run_days=end,
        harmonic_every_s=given["dt"] * every,
        weights=tuple(given["weights"]),
        minimum_depth_m=given["h0"],
        solver_iterations=int(given["solver"].split()[3]),
    )
    run = write_run(
        tmp_path / "run",
        case.mesh,
        case.forcing,
        tide,
        settings,
        coriolis=given["cori"] or None,
    )
    ours = read_fort15(run.path / "fort.15", case.mesh)
    for field in (
        *("ihot", "ics", "im", "nolibf", "nolifa", "nolica", "nolicat", "nwp", "ncor"),
        *("ntip", "nws", "nramp", "gravity", "tau0", "time_step", "statim", "reftim"),
        *("ramp_days", "weights", "minimum_depth", "slam0", "sfea0", "friction"),
        *("eddy_viscosity", "cori", "potential", "angle_minimum", "harmonic"),
        *("harmonic_every", "harmonic_output", "hot_start", "global_elevation"),
    ):
        assert getattr(ours, field) == getattr(theirs, field), field
    np.testing.assert_allclose(ours.harmonic_days, theirs.harmonic_days, atol=2e-3)
    assert ours.run_days == pytest.approx(theirs.run_days, abs=2e-3)
    assert len(ours.forcing) == len(theirs.forcing) == 1
    np.testing.assert_allclose(
        ours.forcing[0].elevation, theirs.forcing[0].elevation, rtol=1e-12
    )
    assert (ours.nscreen, theirs.nscreen) != (0, ours.nscreen)


@reference
def test_reads_a_reference_run(tmp_path, program):
    case = adcirc_cases.load("qa_r1_lin")
    for number in (53, 54):
        packed = adcirc_cases.FOLDER / "qa_r1_lin" / f"fort.{number}.gz"
        text = gzip.decompress(packed.read_bytes())
        (tmp_path / "results" / f"fort.{number}").write_bytes(text)
    adcirc = Adcirc(AdcircSettings(adcirc=program("success")), TIDE, tmp_path / "run")
    tide = adcirc.solve(case.mesh, case.forcing)
    np.testing.assert_array_equal(tide.elevation[0], case.elevation)
    np.testing.assert_array_equal(tide.velocity[0], case.velocity)
    manifest = json.loads((adcirc.folder / "tidemesh_run.json").read_text())
    assert manifest["nodes"] == 63


@pytest.mark.external
@pytest.mark.skipif(shutil.which("adcirc") is None, reason="there is no ADCIRC here")
@pytest.mark.parametrize("physics", ["linear", "nonlinear"])
def test_adcirc_itself_agrees(tmp_path, mesh, forcing, physics):
    more, bounds = {}, (1e-5, 1e-5)
    if physics == "nonlinear":
        # On so coarse a mesh the two discretisations differ by some percent.
        more = {"friction_law": "manning", "finite_amplitude": True, "advection": True}
        bounds = (0.1, 0.15)
    tide = replace_tide(**more)
    settings = AdcircSettings(ramp_days=0.5)
    adcirc = Adcirc(settings, tide, tmp_path / "run")
    there = adcirc.solve(mesh, forcing)
    here = solve(mesh, forcing, tide)
    assert relative(there.elevation, here.elevation) < bounds[0]
    assert relative(there.velocity, here.velocity) < bounds[1]
    assert adcirc.report()["warnings"] == []
