"""Stages are skipped only when nothing that they read has changed."""

import json

import numpy as np
import pytest

from tidemesh.errors import InputError
from tidemesh.pipeline.case import input_files, read_case
from tidemesh.pipeline.run import run_case
from tidemesh.pipeline.runner import Stage, run_stages


@pytest.fixture
def ran(island, tmp_path):
    """A function that runs two toy stages and tells which of them ran."""

    def run(overrides=(), until=None, broken=None):
        calls = []

        def first(context):
            calls.append("first")
            return {"nodes": np.arange(context.case.sizing.nodes)}

        def second(context):
            calls.append("second")
            if broken:
                raise broken
            path = context.path("figures/sum.txt")
            total = int(context["first"]["nodes"].sum())
            path.write_text(f"{total + context.case.base_grid.spacing_m}")
            context.report["total"] = total
            return {}

        stages = (
            Stage("first", first, ("sizing",), ("depth.",)),
            Stage("second", second, ("title", "base_grid"), (), ("first",)),
        )
        case = read_case(island, overrides)
        files = input_files(case, island.parent)
        result = run_stages(stages, case, files, tmp_path / "out", until=until)
        return calls, result

    return run


def test_second_run_takes_everything_over(ran):
    calls, first = ran()
    assert calls == ["first", "second"]
    calls, second = ran()
    assert calls == []
    assert second.resumed == ("first", "second")
    assert second.summary == first.summary


def test_change_of_settings(ran):
    ran()
    assert ran(["sizing.nodes=900"])[0] == ["first", "second"]
    assert ran(["sizing.nodes=900", "base_grid.spacing_m=2500"])[0] == ["second"]
    assert ran(["sizing.nodes=900", "title=new"])[0] == ["second"]


def test_change_of_an_input_file(ran, island):
    ran()
    path = island.parent / "data" / "bathymetry.nc"
    path.write_bytes(path.read_bytes() + b"\0")
    assert ran()[0] == ["first", "second"]


def test_damaged_result_is_made_again(ran, tmp_path):
    ran()
    (tmp_path / "out" / "figures" / "sum.txt").write_text("0")
    assert ran()[0] == ["second"]


def test_until(ran, tmp_path):
    assert ran(until="first")[0] == ["first"]
    assert not (tmp_path / "out" / "figures").exists()
    with pytest.raises(InputError, match="expected one of first, second"):
        ran(until="third")


def test_until_keeps_what_still_stands_in_the_record(ran, tmp_path):
    _, whole = ran()
    assert ran(until="first")[1].summary == whole.summary
    _, changed = ran(["sizing.nodes=900"], until="first")
    assert "total" in whole.summary
    assert "total" not in changed.summary


def test_interrupt_keeps_what_was_done(ran, tmp_path):
    with pytest.raises(KeyboardInterrupt):
        ran(broken=KeyboardInterrupt())
    assert not (tmp_path / "out" / "stages" / "second.json").exists()
    assert ran()[0] == ["second"]


def test_manifest(ran, tmp_path, island):
    import hashlib

    ran()
    manifest = json.loads((tmp_path / "out" / "manifest.json").read_text())
    for name, digest in manifest["outputs"].items():
        content = (tmp_path / "out" / name).read_bytes()
        assert hashlib.sha256(content).hexdigest() == digest
    table = (island.parent / "data" / "open_boundary.csv").read_bytes()
    entry = manifest["inputs"]["forcing.table"]
    assert entry["sha256"] == hashlib.sha256(table).hexdigest()
    assert manifest["settings"]["sizing"]["nodes"] == 800


def test_unwritable_output(ran, tmp_path):
    (tmp_path / "out").write_text("a file where the folder should be")
    with pytest.raises(InputError, match="cannot be written"):
        ran()


def test_infinite_settings_are_strict_json(ran, tmp_path):
    ran(["sizing.gradation=inf"])
    text = (tmp_path / "out" / "manifest.json").read_text()

    def refuse(name):
        raise AssertionError(f"{name} is not JSON")

    manifest = json.loads(text, parse_constant=refuse)
    assert manifest["settings"]["sizing"]["gradation"] == "inf"


def test_a_nonlinear_tide_is_resumed(island, tmp_path):
    """What the stages of a nonlinear case leave is read back by a later run."""
    overrides = [
        "tide.friction_law=quadratic",
        'tide.overtides=["M6"]',
        "base_grid.spacing_m=4000",
        "sizing.nodes=400",
        "output.figures=false",
    ]
    first = run_case(island, output=tmp_path / "out", overrides=overrides, until="tide")
    tide = first.summary["base_tide"]
    assert tide["iterations"]["converged"]
    total = sum(tide[n]["energy_inflow_w"] for n in ("M2", "M6"))
    lost = sum(tide[n]["energy_dissipation_w"] for n in ("M2", "M6"))
    assert total == pytest.approx(lost, rel=1e-6)
    assert tide["M6"]["largest_amplitude_m"] > 0.0
    again = run_case(island, output=tmp_path / "out", overrides=overrides)
    assert again.resumed == ("domain", "base_grid", "tide")
    assert again.summary["nodes"] == 400
