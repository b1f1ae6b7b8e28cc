"""Tides on meshes that the user brings: solve, estimate, verify."""

from __future__ import annotations

import csv
import dataclasses
import json
import sys
from pathlib import Path

import numpy as np
import pytest

from tidemesh.cli import main
from tidemesh.constants import frequency
from tidemesh.datatypes import CoastalMesh, TideForcing, TideRecord, TideSolution
from tidemesh.geometry.projection import Projection
from tidemesh.io.fort14 import read_fort14, write_fort14
from tidemesh.io.fort15 import (
    BoundaryConstituent,
    ControlFile,
    HarmonicConstituent,
    PotentialConstituent,
    boundary_rows,
    read_fort15,
    write_fort15,
)
from tidemesh.io.fort53 import read_fort53, read_fort54, write_fort53, write_fort54
from tidemesh.io.tide_records import read_records, write_records
from tidemesh.io.tide_tables import read_tide_table
from tidemesh.io.ugrid import read_ugrid, write_ugrid
from tidemesh.pipeline.tide import solution_of, tide_fields
from tidemesh.tides import TideSettings, predict, solve, with_potential
from tidemesh.triangulation import topology

sys.path.insert(0, str(Path(__file__).parents[1] / "tides"))
from annulus import (
    AMPLITUDE,
    FREQUENCY,
    FRICTION,
    Annulus,
    annulus_mesh,
)
from globe import icosphere, mesh_of

EXACT = Annulus(2)


def relative(ours, exact):
    return np.linalg.norm(ours - exact) / np.linalg.norm(exact)


@pytest.fixture(scope="module")
def model(tmp_path_factory):
    """The ADCIRC case of a quarter annulus, fort.14 and fort.15."""
    folder = tmp_path_factory.mktemp("annulus")
    mesh = annulus_mesh(12, 16, 2)
    rows = boundary_rows(mesh, np.full(len(mesh.open_nodes), AMPLITUDE + 0j))
    write_fort14(folder / "fort.14", mesh)
    control = ControlFile(
        run_description="annulus",
        tau0=FRICTION,
        friction=FRICTION,
        time_step=30.0,
        run_days=10.0,
        minimum_depth=0.1,
        angle_minimum=110.0,
        forcing=(BoundaryConstituent("M2", FREQUENCY, 1.0, 0.0, rows),),
        harmonic=(HarmonicConstituent("M2", FREQUENCY),),
        harmonic_days=(8.0, 10.0),
        harmonic_every=1,
        harmonic_output=(0, 0, 1, 1),
    )
    write_fort15(folder / "fort.15", control)
    return folder


@pytest.fixture(scope="module")
def solved(model):
    output = model / "solved"
    arguments = ["solve", str(model / "fort.14"), "--fort15", str(model / "fort.15")]
    assert main([*arguments, "--output", str(output), "--quiet"]) == 0
    return output


def test_an_adcirc_case_is_solved_to_second_order(solved, model):
    """The closed form of Lynch and Gray; 3.9e-3 is what ADCIRC itself has here."""
    mesh = read_fort14(model / "fort.14")
    exact = EXACT.elevation(np.hypot(*mesh.points.T))[0]
    constants = read_fort53(solved / "fort.53")
    assert constants.names == ("M2",)
    assert constants.frequency[0] == pytest.approx(FREQUENCY)
    assert relative(constants.values[0], exact) == pytest.approx(3.9e-3, rel=0.05)
    summary = json.loads((solved / "summary.json").read_text())
    assert summary["constituents"] == ["M2"]
    assert summary["nodes"] == len(mesh.points)
    largest = summary["tide"]["M2"]["largest_amplitude_m"]
    assert largest == pytest.approx(np.abs(exact).max(), rel=0.02)


def test_netcdf_and_text_hold_the_same_solution(solved):
    mesh, fields = read_ugrid(solved / "tide.nc")
    tide = solution_of(mesh, fields)
    elevation = read_fort53(solved / "fort.53").values
    velocity = read_fort54(solved / "fort.54").values
    # ASCII phases have four decimals.
    assert relative(tide.elevation, elevation) < 1e-6
    assert relative(tide.velocity, velocity) < 1e-6
    assert tide.friction == pytest.approx(np.full(len(mesh.points), FRICTION))
    assert tide.frequency[0] == FREQUENCY


def test_a_setting_replaces_that_of_the_fort15(model, tmp_path):
    arguments = ["solve", str(model / "fort.14"), "--fort15", str(model / "fort.15")]
    arguments += ["--output", str(tmp_path), "--quiet", "--set", "tide.friction=0.004"]
    assert main([*arguments, "--set", "tide.discretisation=galerkin"]) == 0
    settings = json.loads((tmp_path / "summary.json").read_text())["settings"]
    assert settings["friction"] == 0.004
    exact = EXACT.elevation(np.array([60_960.0]))[0]
    ours = read_fort53(tmp_path / "fort.53").values[0]
    # Ten times the friction damps the wave on its way in.
    assert np.abs(ours).min() < 0.8 * np.abs(exact[0])


@pytest.mark.parametrize("projection", [Projection(), Projection.stereographic(5, 55)])
@pytest.mark.parametrize("each", [False, True])
def test_what_is_written_is_read_back(tmp_path, projection, each):
    generator = np.random.default_rng(1)
    mesh = dataclasses.replace(annulus_mesh(3, 4, 2), projection=projection)
    n = len(mesh.points)
    tide = TideSolution(
        names=("M2", "STEADY"),
        frequency=[1.4e-4, 0.0],
        elevation=generator.normal(size=(2, n)) + 1j * generator.normal(size=(2, n)),
        velocity=generator.normal(size=(2, n, 2)) * (1 + 1j),
        friction=generator.random((2, n) if each else n),
        coriolis=generator.random(n),
    )
    write_ugrid(tmp_path / "tide.nc", mesh, tide_fields(mesh, tide))
    read = solution_of(*read_ugrid(tmp_path / "tide.nc"))
    assert read.names == tide.names
    for name in ("frequency", "elevation", "velocity", "friction", "coriolis"):
        have, want = getattr(read, name), getattr(tide, name)
        np.testing.assert_allclose(have, want, rtol=1e-9, atol=1e-12)


def test_a_fort15_of_another_mesh_is_refused(model, tmp_path, capsys):
    write_fort14(tmp_path / "other.14", annulus_mesh(12, 15, 2))
    arguments = ["solve", str(tmp_path / "other.14"), "--output", str(tmp_path / "o")]
    assert main([*arguments, "--fort15", str(model / "fort.15"), "--quiet"]) == 2
    message = capsys.readouterr().err
    assert "fort.15: line" in message
    assert "mesh" in message
    assert not (tmp_path / "o").exists()


def test_nothing_to_drive_the_tide(model, tmp_path, capsys):
    mesh = str(model / "fort.14")
    assert main(["solve", mesh, "--output", str(tmp_path / "o"), "--quiet"]) == 2
    assert "--fort15" in capsys.readouterr().err


# ---- estimate -------------------------------------------------------------------


def test_an_existing_model_is_measured_and_meshed_again(model, solved, tmp_path):
    output = tmp_path / "again"
    arguments = ["estimate", str(model / "fort.14"), str(solved / "fort.53"), "--quiet"]
    arguments += ["--nodes", "300", "--output", str(output), "--remesh"]
    arguments += ["--set", "output.figures=false", "--set", "depth.minimum_m=0.1"]
    assert main(arguments) == 0
    mesh = read_fort14(output / "mesh.14")
    assert abs(len(mesh.points) - 300) <= 3
    assert topology.check_mesh(mesh.points, mesh.triangles, mesh.depth) == []
    assert sum(b.kind == "open" for b in mesh.boundaries) == 1
    _, fields = read_ugrid(output / "error.nc")
    assert {"truncation_error_M2", "curvature_M2"} <= set(fields)
    # The tide on the new mesh is still that of the basin.
    again, found = read_ugrid(output / "mesh_tide.nc")
    exact = EXACT.elevation(np.hypot(*again.points.T))[0]
    assert relative(found["elevation_M2"].values, exact) < 0.02
    # And so is its depth.
    radius = np.hypot(*mesh.points.T)
    assert np.abs(mesh.depth / EXACT.depth(radius) - 1.0).max() < 0.05


def test_without_remesh_only_error_and_sizes(model, solved, tmp_path):
    arguments = ["estimate", str(model / "fort.14"), str(solved), "--quiet"]
    assert main([*arguments, "--output", str(tmp_path / "o"), "--nodes", "300"]) == 0
    names = {p.name for p in (tmp_path / "o").iterdir()}
    assert {"error.nc", "size.nc", "summary.json", "manifest.json"} <= names
    assert "mesh.14" not in names


def test_dry_nodes_and_missing_velocities_of_a_fort53(model, solved, tmp_path):
    """A model with wetting: dry nodes take what is near; no fort.54 is needed."""
    mesh, fields = read_ugrid(solved / "tide.nc")
    tide = solution_of(mesh, fields)
    write_fort53(tmp_path / "fort.53", tide)
    lines = (tmp_path / "fort.53").read_text().splitlines()
    lines[4] = "  -99999.0 -99999.0"
    (tmp_path / "fort.53").write_text("\n".join(lines) + "\n")
    arguments = ["estimate", str(model / "fort.14"), str(tmp_path / "fort.53")]
    arguments += ["--quiet", "--nodes", "300", "--output", str(tmp_path / "o")]
    assert main(arguments) == 0
    _, found = read_ugrid(tmp_path / "o" / "error.nc")
    assert np.isfinite(found["curvature_M2"].values).mean() > 0.9


@pytest.mark.parametrize("fault", ["truncated", "other mesh", "other constituents"])
def test_harmonic_output_that_cannot_be_used(model, solved, tmp_path, capsys, fault):
    mesh, fields = read_ugrid(solved / "tide.nc")
    tide = solution_of(mesh, fields)
    write_fort53(tmp_path / "fort.53", tide)
    write_fort54(tmp_path / "fort.54", tide)
    words = ["fort.53", "line"]
    grid = model / "fort.14"
    if fault == "truncated":
        text = (tmp_path / "fort.53").read_text()
        (tmp_path / "fort.53").write_text(text[: len(text) // 2])
    elif fault == "other mesh":
        grid = tmp_path / "other.14"
        write_fort14(grid, annulus_mesh(12, 15, 2))
        words = ["fort.53", "221", "208"]
    else:
        text = (tmp_path / "fort.54").read_text().replace("M2", "S2")
        (tmp_path / "fort.54").write_text(text)
        words = ["fort.54", "S2", "M2"]
    arguments = ["estimate", str(grid), str(tmp_path), "--quiet"]
    assert main([*arguments, "--output", str(tmp_path / "o")]) == 2
    message = capsys.readouterr().err
    assert all(word in message for word in words)


# ---- verify ---------------------------------------------------------------------


@pytest.fixture
def placed(solved, tmp_path):
    """The solution at a place on earth."""
    mesh, fields = read_ugrid(solved / "tide.nc")
    tide = solution_of(mesh, fields)
    mesh = dataclasses.replace(mesh, projection=Projection.stereographic(5.0, 55.0))
    write_ugrid(tmp_path / "tide.nc", mesh, tide_fields(mesh, tide))
    return tmp_path


@pytest.fixture
def gauges(placed, tmp_path):
    """Two gauges with the solution's own constants, one of them ten degrees late."""
    mesh, fields = read_ugrid(placed / "tide.nc")
    elevation = fields["elevation_M2"].values
    place = mesh.projection.inverse(mesh.points)
    path = tmp_path / "gauges.csv"
    with open(path, "w", newline="") as file:
        table = csv.writer(file)
        table.writerow(["name", "lon", "lat", "constituent", "amplitude", "phase"])
        for name, node, late in (("Same", 40, 0.0), ("Early", 90, -10.0)):
            value = elevation[node]
            lag = np.degrees(-np.angle(value)) + late
            table.writerow([name, *place[node], "M2", abs(value), lag % 360.0])
    return path, np.abs(elevation[[40, 90]])


def test_constants_and_levels_against_gauges(placed, gauges, tmp_path):
    path, amplitude = gauges
    arguments = ["verify", str(placed), "--gauges", str(path), "--no-figures"]
    arguments += ["--start", "1998-03-16", "--end", "1998-03-18", "--quiet"]
    assert main([*arguments, "--output", str(tmp_path / "v")]) == 0
    found = json.loads((tmp_path / "v" / "verification.json").read_text())
    rows = {row["gauge"]: row for row in found["constants"]["rows"]}
    assert rows["Same"]["complex_error_m"] < 1e-6
    assert rows["Early"]["phase_error_deg"] == pytest.approx(10.0, abs=1e-4)
    chord = 2.0 * amplitude[1] * np.sin(np.radians(5.0))
    assert rows["Early"]["complex_error_m"] == pytest.approx(chord, rel=1e-4)
    levels = {one["station"].partition(",")[0]: one for one in found["records"]}
    assert levels["Same"]["rms_error_m"] < 1e-6
    # Ten degrees of M2 are 20.7 minutes.
    assert levels["Early"]["lag_minutes"] == pytest.approx(20.7, abs=0.3)


@pytest.mark.parametrize("kind", ["stations.csv", "fort.61"])
def test_constants_analysed_from_levels(placed, gauges, tmp_path, kind):
    """Thirty days predicted from the gauges' constants give these back."""
    table = read_tide_table(gauges[0])
    time = 883612800.0 + np.arange(0.0, 30 * 86400.0, 1800.0)
    level = predict(table, time)
    extra = []
    if kind == "stations.csv":
        write_records(
            tmp_path / kind,
            [
                TideRecord(time, row, name, *place)
                for row, name, *place in zip(
                    level, table.stations, table.longitude_deg, table.latitude_deg
                )
            ],
        )
    else:
        lines = ["levels", f"{len(time)} 2 1800.0 30 1 FileFmtVersion: 1050624"]
        for k, pair in enumerate(level.T):
            lines.append(f"{time[k] - time[0]:.6f} {30 * k}")
            lines += [f"{s + 1} {value:.10f}" for s, value in enumerate(pair)]
        (tmp_path / kind).write_text("\n".join(lines) + "\n")
        extra = ["--stations", "Same,Early", "--cold-start", "1998-01-01"]
    arguments = ["verify", str(placed), "--gauges", str(gauges[0]), "--no-figures"]
    arguments += ["--modelled", str(tmp_path / kind), "--analyse", "--quiet", *extra]
    assert main([*arguments, "--output", str(tmp_path / "v")]) == 0
    found = json.loads((tmp_path / "v" / "verification.json").read_text())
    for row in found["constants"]["rows"]:
        assert row["complex_error_m"] < 1e-4 * row["observed_m"]
    assert len(found["constants"]["rows"]) == 2


def test_a_fort61_without_names_or_start(placed, gauges, tmp_path, capsys):
    path = tmp_path / "fort.61"
    path.write_text("levels\n1 2 1800.0 30 1\n0.0 0\n1 0.1\n2 0.2\n")
    arguments = ["verify", str(placed), "--gauges", str(gauges[0]), "--quiet"]
    arguments += ["--output", str(tmp_path / "v"), "--modelled", str(path)]
    assert main(arguments) == 2
    assert "--stations" in capsys.readouterr().err
    assert main([*arguments, "--stations", "Same,Early"]) == 2
    assert "--cold-start" in capsys.readouterr().err


def test_figures_of_a_verification(placed, gauges, tmp_path):
    arguments = ["verify", str(placed), "--gauges", str(gauges[0]), "--quiet"]
    assert main([*arguments, "--output", str(tmp_path / "v")]) == 0
    drawn = {p.name for p in (tmp_path / "v" / "figures").iterdir()}
    assert drawn == {"constants.png", "gauges.png"}


def test_gauges_far_from_the_mesh(placed, tmp_path, capsys):
    path = tmp_path / "gauges.csv"
    path.write_text("name,lon,lat,constituent,amplitude,phase\nFar,-70,10,M2,1,0\n")
    arguments = ["verify", str(placed), "--gauges", str(path), "--quiet"]
    assert main([*arguments, "--output", str(tmp_path / "v")]) == 2
    assert "none of the 1 gauges" in capsys.readouterr().err


# ---- simulate -------------------------------------------------------------------

SHORT = [
    "--set",
    "simulation.days=3",
    "--set",
    "simulation.ramp_days=0.5",
    "--set",
    "simulation.station_every_s=720",
    "--set",
    "simulation.time_step_s=0",
]


@pytest.fixture(scope="module")
def simulated(model):
    output = model / "simulated"
    arguments = ["simulate", str(model / "fort.14"), "--fort15", str(model / "fort.15")]
    places = model / "places.csv"
    places.write_text("name,lon,lat,constituent,amplitude,phase\nIn,70000,9000,M2,,\n")
    arguments += ["--stations", str(places), *SHORT, "--quiet"]
    assert main([*arguments, "--output", str(output)]) == 0
    return output


def test_a_linear_simulation_settles_into_the_closed_form(simulated, solved):
    """The same fort.15 in time: lumped mass, but of the same order in space."""
    constants = read_fort53(simulated / "fort.53")
    mesh, _ = read_ugrid(simulated / "tide.nc")
    exact = EXACT.elevation(np.hypot(*mesh.points.T))[0]
    assert relative(constants.values[0], exact) < 0.02
    summary = json.loads((simulated / "summary.json").read_text())
    assert summary["time_step_s"] <= summary["step_advice"]["step_s"]
    assert summary["stations"] == ["In"]
    (record,) = read_records(simulated / "stations.csv")
    k = np.argmin(np.hypot(*(mesh.points - [70_000.0, 9_000.0]).T))
    # After two days the level at the station is that of the constants nearby.
    late = record.time - record.time[0] > 2.0 * 86400.0
    swing = np.ptp(record.elevation[late]) / 2.0
    assert swing == pytest.approx(abs(constants.values[0, k]), rel=0.05)


def test_an_unstable_step_is_refused_before_the_run(model, tmp_path, capsys):
    arguments = ["simulate", str(model / "fort.14"), "--fort15", str(model / "fort.15")]
    arguments += ["--output", str(tmp_path / "o"), "--quiet"]
    assert main([*arguments, "--set", "simulation.time_step_s=2000"]) == 2
    assert "step" in capsys.readouterr().err


# ---- meshes as ADCIRC's users have them --------------------------------------------


def two_basins(mesh: CoastalMesh) -> CoastalMesh:
    """The mesh, and beside it a lake of the same shape without open boundary."""
    n = len(mesh.points)
    away = mesh.points + np.array([0.0, 10.0 * np.ptp(mesh.points)])
    return dataclasses.replace(
        mesh,
        points=np.concatenate([mesh.points, away]),
        triangles=np.concatenate([mesh.triangles, mesh.triangles + n]),
        depth=np.tile(mesh.depth, 2),
    )


def test_a_part_without_open_boundary_stays_at_rest(model, solved, tmp_path):
    mesh = read_fort14(model / "fort.14")
    n = len(mesh.points)
    write_fort14(tmp_path / "fort.14", two_basins(mesh))
    arguments = ["solve", str(tmp_path / "fort.14")]
    arguments += ["--fort15", str(model / "fort.15"), "--output", str(tmp_path / "out")]
    assert main([*arguments, "--quiet"]) == 0
    ours = read_fort53(tmp_path / "out" / "fort.53").values[0]
    assert relative(ours[:n], read_fort53(solved / "fort.53").values[0]) < 1e-6
    assert (ours[n:] == 0.0).all()
    notes = json.loads((tmp_path / "out" / "summary.json").read_text())["left_out"]
    assert any("1 of 2 parts" in note and "at rest" in note for note in notes)


def test_the_globe_is_driven_by_the_potential_alone(tmp_path, capsys):
    """Triangles across the date line and round the poles; no open boundary."""
    mesh = mesh_of(*icosphere(3))
    write_fort14(tmp_path / "globe.14", mesh)
    arguments = ["solve", str(tmp_path / "globe.14"), "--output", str(tmp_path / "out")]
    arguments += ["--quiet", "--set", "tide.tidal_potential=true"]
    assert main(arguments) == 2
    assert 'tide.metric = "geographic"' in capsys.readouterr().err
    assert main([*arguments, "--set", "tide.metric=geographic"]) == 0
    ours = read_fort53(tmp_path / "out" / "fort.53")
    settings = TideSettings(tidal_potential=True, metric="geographic")
    nothing = TideForcing(("M2",), [frequency("M2")], [], np.empty((1, 0)))
    exact = solve(mesh, with_potential(mesh, nothing), settings)
    assert ours.names == ("M2",)
    # Phases have four decimals.
    assert relative(ours.values, exact.elevation) < 2e-6

    # The map of this fort.15 is torn at another meridian than that of the fort.14.
    control = ControlFile(
        ics=-22,
        ntip=1,
        gravity=settings.gravity,
        friction=settings.friction,
        tau0=settings.friction,
        time_step=60.0,
        run_days=1.0,
        slam0=100.0,
        sfea0=45.0,
        angle_minimum=90.0,
        potential=(
            PotentialConstituent("M2", 0.242334, frequency("M2"), 0.693, 1.0, 0.0),
        ),
        harmonic=(HarmonicConstituent("M2", frequency("M2")),),
        harmonic_days=(0.0, 1.0),
        harmonic_every=1,
        harmonic_output=(0, 0, 1, 1),
    )
    write_fort15(tmp_path / "fort.15", control)
    case = ["solve", str(tmp_path / "globe.14"), "--fort15", str(tmp_path / "fort.15")]
    assert main([*case, "--output", str(tmp_path / "theirs"), "--quiet"]) == 0
    theirs = read_fort53(tmp_path / "theirs" / "fort.53").values
    assert relative(theirs, exact.elevation) < 1e-2

    assert main(arguments[:-2]) == 2
    assert "no open boundary" in capsys.readouterr().err


def test_settings_take_the_place_of_nodal_arrays_of_a_fort15(model, tmp_path):
    """A quadratic fort.15 solved with linear friction is the linear fort.15."""
    control = read_fort15(model / "fort.15")
    quadratic = dataclasses.replace(control, nolibf=1, friction=0.003)
    write_fort15(tmp_path / "quadratic.15", quadratic)
    arguments = ["solve", str(model / "fort.14"), "--quiet", "--output"]
    answers = []
    for name, fort15, settings in (
        ("linear", model / "fort.15", ["tide.discretisation=galerkin"]),
        (
            "made_linear",
            tmp_path / "quadratic.15",
            ["tide.friction_law=linear", f"tide.friction={FRICTION}"],
        ),
        ("quadratic", tmp_path / "quadratic.15", []),
        ("stronger", tmp_path / "quadratic.15", ["tide.drag_coefficient=0.03"]),
    ):
        more = [word for setting in settings for word in ("--set", setting)]
        output = tmp_path / name
        assert main([*arguments, str(output), "--fort15", str(fort15), *more]) == 0
        answers.append(read_fort53(output / "fort.53").values[0])
    linear, made_linear, quadratic, stronger = answers
    assert relative(made_linear, linear) < 1e-6
    assert np.abs(stronger).min() < np.abs(quadratic).min()


def test_constituents_of_a_fort15_are_chosen_or_refused(model, tmp_path, capsys):
    control = read_fort15(model / "fort.15")
    made = dataclasses.replace(
        control,
        nolibf=1,
        friction=0.003,
        harmonic=(*control.harmonic, HarmonicConstituent("M6", 3.0 * FREQUENCY)),
    )
    write_fort15(tmp_path / "fort.15", made)
    arguments = ["solve", str(model / "fort.14"), "--output", str(tmp_path / "out")]
    arguments += ["--fort15", str(tmp_path / "fort.15"), "--quiet", "--set"]
    assert main([*arguments, "tide.max_iterations=60"]) == 0
    assert read_fort53(tmp_path / "out" / "fort.53").names == ("M2", "M6")
    assert main([*arguments, "tide.overtides=[]"]) == 0
    assert read_fort53(tmp_path / "out" / "fort.53").names == ("M2",)
    assert main([*arguments, 'tide.constituents=["S2"]']) == 2
    assert "no constituent S2" in capsys.readouterr().err


def test_a_fort15_with_adcirc_as_the_engine_gets_a_run_directory(
    model, tmp_path, monkeypatch, capsys
):
    monkeypatch.setenv("PATH", str(tmp_path))
    arguments = ["solve", str(model / "fort.14"), "--fort15", str(model / "fort.15")]
    arguments += ["--output", str(tmp_path / "out"), "--quiet"]
    assert main([*arguments, "--set", "tide.engine=adcirc"]) == 1
    assert "not installed" in capsys.readouterr().err
    assert (tmp_path / "out" / "adcirc" / "fort.15").is_file()


def test_an_output_that_cannot_be_made_is_refused_before_the_work(model, capsys):
    arguments = ["solve", str(model / "fort.14"), "--fort15", str(model / "fort.15")]
    assert main([*arguments, "--output", str(model / "fort.14" / "out"), "-q"]) == 2
    assert "is no folder" in capsys.readouterr().err


def test_what_a_fort15_has_beyond_the_engine_is_noted(model, tmp_path, capfd):
    """A weir and a part of the potential: in the summary, and silent with --quiet."""
    mesh = read_fort14(model / "fort.14")
    land = next(b for b in mesh.boundaries if b.kind == "mainland")
    heights = np.tile([-9.0, 1.0], (len(land.nodes), 1))
    weir = dataclasses.replace(land, ibtype=23, extra=heights)
    boundaries = tuple(weir if b is land else b for b in mesh.boundaries)
    path = tmp_path / "fort.14"
    write_fort14(path, dataclasses.replace(mesh, boundaries=boundaries))
    control = dataclasses.replace(read_fort15(model / "fort.15"), eddy_viscosity=2.0)
    write_fort15(tmp_path / "fort.15", control)
    arguments = ["solve", str(path), "--fort15", str(tmp_path / "fort.15")]
    assert main([*arguments, "--output", str(tmp_path / "out"), "--quiet"]) == 0
    notes = json.loads((tmp_path / "out" / "summary.json").read_text())["left_out"]
    assert any("1 weirs are walls" in note for note in notes)
    assert any("eddy viscosity" in note for note in notes)
    assert capfd.readouterr() == ("", "")


def test_levels_end_after_they_start(solved, tmp_path, capsys):
    arguments = ["verify", str(solved), "--output", str(tmp_path)]
    assert main([*arguments, "--start", "1998-03-31", "--end", "1998-03-16"]) == 2
    assert "is not before --end" in capsys.readouterr().err


@pytest.mark.parametrize("command", ["solve", "simulate"])
@pytest.mark.parametrize(
    ("depth", "said"),
    [
        (0.0, "the first is node 6 at"),
        (-3.0, "with a depth of -3 m"),
        (1e7, "depth beyond 12 km: 1"),
    ],
)
def test_a_node_without_water_is_named(model, tmp_path, capsys, command, depth, said):
    mesh = read_fort14(model / "fort.14")
    changed = mesh.depth.copy()
    changed[5] = depth
    projection = Projection.equirectangular(-79.0, 33.0)
    mesh = dataclasses.replace(mesh, depth=changed, projection=projection)
    path, table = tmp_path / "fort.14", tmp_path / "table.csv"
    write_fort14(path, mesh)
    longitude, latitude = projection.inverse(mesh.points[mesh.open_nodes[0]])
    rows = f"longitude,latitude,constituent,amplitude,phase\n{longitude},{latitude},"
    table.write_text(rows + "M2,0.3,0.0\n", encoding="utf-8")
    arguments = [command, str(path), "--table", str(table), "--quiet"]
    arguments += ["--set", "tide.max_forcing_distance_km=500"]
    assert main([*arguments, "--output", str(tmp_path / "out")]) in (1, 2)
    assert said in capsys.readouterr().err
    assert not (tmp_path / "out").exists()
