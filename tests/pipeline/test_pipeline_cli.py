"""The whole program on the island case, as a user meets it."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time

import netCDF4
import numpy as np
import pytest

from tidemesh.cli import main
from tidemesh.io.fort14 import read_fort14
from tidemesh.io.ugrid import read_ugrid
from tidemesh.triangulation import topology

FAST = ["--quiet", "--set", "output.figures=false"]


def run(case, output, *arguments):
    return main(["run", str(case), "--output", str(output), *FAST, *arguments])


@pytest.fixture(scope="module")
def result(tmp_path_factory, examples):
    """Results of the island case, figures included."""
    output = tmp_path_factory.mktemp("island") / "out"
    case = examples / "island" / "island.toml"
    assert main(["run", str(case), "--output", str(output), "--quiet"]) == 0
    return output


def test_files(result):
    names = {p.relative_to(result).as_posix() for p in result.rglob("*.*")}
    assert {
        "mesh.14",
        "mesh.nc",
        "base_mesh.nc",
        "tide.nc",
        "error.nc",
        "size.nc",
        "mesh_tide.nc",
        "domain.geojson",
        "summary.json",
        "manifest.json",
        "figures/domain.png",
        "figures/boundary.png",
        "figures/sizes.png",
        "figures/mesh.png",
        "figures/tide_M2.png",
        "figures/error_M2.png",
        "figures/quality.png",
        "figures/boundary_strings.png",
    } <= names
    assert not [n for n in names if "tmp" in n or "part" in n]


def test_mesh_is_valid_and_within_budget(result):
    mesh = read_fort14(result / "mesh.14")
    assert abs(len(mesh.points) / 800 - 1) <= 0.01
    assert not topology.check_mesh(
        mesh.points, mesh.triangles, mesh.depth, mesh.boundaries, minimum_depth=1.5
    )
    kinds = [b.kind for b in mesh.boundaries]
    assert kinds == ["open", "mainland", "island"]


def test_both_mesh_files_hold_the_same(result):
    text = read_fort14(result / "mesh.14")
    binary, _ = read_ugrid(result / "mesh.nc")
    np.testing.assert_array_equal(text.triangles, binary.triangles)
    place = binary.projection.inverse(binary.points)
    np.testing.assert_allclose(
        text.projection.inverse(text.points), place, atol=1e-8, rtol=0
    )
    np.testing.assert_allclose(text.depth, binary.depth, rtol=1e-6)


def test_summary_agrees_with_the_files(result):
    summary = json.loads((result / "summary.json").read_text())
    mesh = read_fort14(result / "mesh.14")
    assert summary["nodes"] == len(mesh.points)
    assert summary["elements"] == len(mesh.triangles)
    assert summary["quality"]["quality_mean"] >= 0.94
    assert summary["quality"]["quality_minimum"] >= 0.30
    balance = summary["tide"]["M2"]
    assert balance["energy_inflow_w"] == pytest.approx(
        balance["energy_dissipation_w"], rel=1e-6
    )
    for stage in summary["stages"].values():
        assert stage["peak_mb"] > 0


def test_tide_reaches_the_island(result):
    """The bay is short against the wave: amplitude within 20 % of the boundary's."""
    with netCDF4.Dataset(result / "mesh_tide.nc") as file:
        name = next(n for n in file.variables if n.startswith("elevation_M2_amp"))
        amplitude = file[name][:]
    assert 0.4 < amplitude.min() <= amplitude.max() < 0.75


def test_same_input_same_bytes(result, tmp_path, examples):
    assert run(examples / "island" / "island.toml", tmp_path / "again") == 0
    for name in ("mesh.14", "mesh.nc", "tide.nc", "size.nc", "domain.geojson"):
        first = (result / name).read_bytes()
        assert (tmp_path / "again" / name).read_bytes() == first, name


def test_resumes_where_something_changed(island, tmp_path, capsys):
    assert run(island, tmp_path / "out", "--until", "sizing") == 0
    times = {
        p.name: p.stat().st_mtime_ns for p in (tmp_path / "out/stages").glob("*.json")
    }
    assert set(times) == {
        f"{s}.json" for s in ("domain", "base_grid", "tide", "truncation", "sizing")
    }
    assert run(island, tmp_path / "out", "--set", "sizing.nodes=700") == 0
    after = {
        p.name: p.stat().st_mtime_ns for p in (tmp_path / "out/stages").glob("*.json")
    }
    kept = {n for n in times if after[n] == times[n]}
    assert kept == {"domain.json", "base_grid.json", "tide.json", "truncation.json"}
    capsys.readouterr()
    assert main(["info", str(tmp_path / "out" / "mesh.14"), "--json"]) == 0
    assert abs(json.loads(capsys.readouterr().out)["nodes"] / 700 - 1) <= 0.01


@pytest.mark.parametrize(
    "rule",
    ["truncation_error", "energy_hessian", "wavelength", "wavelength_slope", "uniform"],
)
def test_every_rule_obeys_the_budget(rule, island, tmp_path):
    code = run(island, tmp_path / "out", "--set", f"sizing.rule={rule}")
    assert code == 0
    summary = json.loads((tmp_path / "out" / "summary.json").read_text())
    assert abs(summary["nodes"] / 800 - 1) <= 0.01


def test_json_and_quiet(island, tmp_path, capsys):
    arguments = ["run", str(island), "-o", str(tmp_path / "o"), "--json", *FAST]
    assert main([*arguments, "--until", "domain"]) == 0
    assert json.loads(capsys.readouterr().out)["domain"]["islands"] == 1


def test_init_writes_a_case_that_runs(tmp_path, capsys):
    assert main(["init", str(tmp_path / "new"), "--example", "island"]) == 0
    case = tmp_path / "new" / "island.toml"
    assert run(case, tmp_path / "out", "--until", "domain") == 0
    assert main(["init", str(tmp_path / "new"), "--example", "island"]) == 2
    assert "exists already" in capsys.readouterr().err


def test_info_text(result, capsys):
    assert main(["info", str(result / "mesh.nc")]) == 0
    out = capsys.readouterr().out
    assert "no faults found" in out
    assert "open         1 strings" in out


def test_usage_errors(tmp_path, capsys):
    assert main(["run"]) == 2
    assert main(["runn", "x"]) == 2
    assert main(["info", str(tmp_path / "none.14")]) == 2
    assert "no such mesh file" in capsys.readouterr().err


@pytest.mark.skipif(os.name == "nt", reason="signals differ on Windows")
def test_ctrl_c(island, tmp_path):
    """Interrupted: exit code 3, no half file, and the next run goes on."""
    output = tmp_path / "out"
    command = [sys.executable, "-c", "from tidemesh.cli import main; main()"]
    command += [
        "run",
        str(island),
        "-o",
        str(output),
        "--set",
        "base_grid.spacing_m=300",
    ]
    process = subprocess.Popen(command, stderr=subprocess.PIPE, text=True)
    for _ in range(600):
        if (output / "stages" / "domain.json").exists():
            break
        time.sleep(0.05)
    process.send_signal(signal.SIGINT)
    _, errors = process.communicate(timeout=60)
    assert process.returncode == 3, errors
    assert "run the same command again" in errors
    for path in (output / "stages").glob("*"):
        assert path.suffix in (".json", ".npz"), path
    assert run(island, output) == 0


def test_init_copies_what_runs_by_itself(tmp_path):
    assert main(["init", str(tmp_path / "new")]) == 0
    cases = {p.name for p in (tmp_path / "new").glob("*.toml")}
    assert cases == {"south_carolina.toml", "as_published.toml"}
    assert (tmp_path / "new" / "data" / "LICENSE-GSHHG.txt").is_file()


def test_init_names_the_examples(tmp_path, capsys):
    assert main(["init", str(tmp_path / "new"), "--example", "gallery"]) == 2
    assert "there are: island, south_carolina" in capsys.readouterr().err
    assert not (tmp_path / "new").exists()
