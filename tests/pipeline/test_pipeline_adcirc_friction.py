"""ADCIRC cases with quadratic friction alone: in ADCIRC's own discretisation."""

from __future__ import annotations

import dataclasses
import gzip
import json
import sys
from pathlib import Path

import numpy as np
import pytest

from tidemesh.cli import main
from tidemesh.constants import frequency
from tidemesh.datatypes import TideForcing
from tidemesh.io.fort14 import write_fort14
from tidemesh.io.fort15 import (
    BoundaryConstituent,
    ControlFile,
    HarmonicConstituent,
    boundary_rows,
    write_fort15,
)
from tidemesh.io.fort53 import read_fort53, read_fort54
from tidemesh.pipeline.adcirc_case import with_odd_overtides
from tidemesh.tides import TideSettings

sys.path.insert(0, str(Path(__file__).parents[1] / "tides"))
import adcirc_cases
from annulus import AMPLITUDE, annulus_mesh

M2 = frequency("M2")
GWCE = TideSettings(friction_law="quadratic", discretisation="gwce")


def solved(folder, control="fort.15"):
    output = folder / f"{control}.out"
    arguments = ["solve", str(folder / "fort.14"), "--fort15", str(folder / control)]
    assert main([*arguments, "--output", str(output), "--quiet"]) == 0
    return output, json.loads((output / "summary.json").read_text())


@pytest.mark.skipif(
    not adcirc_cases.FOLDER.is_dir(), reason="the ADCIRC reference runs are not here"
)
def test_a_case_with_quadratic_friction_has_the_answer_of_adcirc(tmp_path):
    folder = adcirc_cases.FOLDER / "qa_r4_qf"
    for name in ("fort.14", "fort.15"):
        text = gzip.decompress((folder / f"{name}.gz").read_bytes())
        (tmp_path / name).write_bytes(text)
    output, summary = solved(tmp_path)
    for name, read in (("fort.53", read_fort53), ("fort.54", read_fort54)):
        ours, theirs = read(output / name), read(folder / f"{name}.gz")
        # What ADCIRC analyses, and nothing else.
        assert sorted(ours.names) == sorted(theirs.names)
        size = np.linalg.norm(theirs.values[theirs.names.index("M2")])
        for constituent in ("M2", "M6", "M4", "STEADY"):
            gap = ours.values[ours.names.index(constituent)]
            gap = gap - theirs.values[theirs.names.index(constituent)]
            # The step of 44 s, which the file has and the solution has not.
            assert np.linalg.norm(gap) < 6e-4 * size
    assert summary["left_out"] == []
    assert summary["tide"]["iterations"]["converged"]


def test_the_discretisation_follows_the_terms_of_the_case(tmp_path):
    mesh = annulus_mesh(6, 8, 2)
    rows = boundary_rows(mesh, np.full(len(mesh.open_nodes), AMPLITUDE + 0j))
    write_fort14(tmp_path / "fort.14", mesh)
    control = ControlFile(
        run_description="annulus",
        nolibf=1,
        tau0=5.0e-3,
        friction=3.0e-3,
        time_step=30.0,
        run_days=10.0,
        minimum_depth=0.1,
        angle_minimum=110.0,
        forcing=(BoundaryConstituent("M2", M2, 1.0, 0.0, rows),),
        harmonic=(
            HarmonicConstituent("M2", M2),
            HarmonicConstituent("M6", 3.0 * M2),
        ),
        harmonic_days=(8.0, 10.0),
        harmonic_every=1,
        harmonic_output=(0, 0, 1, 1),
    )
    for name, changes, discretisation, note in (
        ("plain.15", {}, "gwce", ""),
        ("varying.15", {"tau0": -3.0}, "galerkin", "Galerkin's method"),
        ("finite.15", {"nolifa": 1}, "galerkin", ""),
    ):
        write_fort15(tmp_path / name, dataclasses.replace(control, **changes))
        _, summary = solved(tmp_path, name)
        assert summary["settings"]["discretisation"] == discretisation
        assert note in " ".join(summary["left_out"])
        assert summary["constituents"] == ["M2", "M6"]


def forcing_of(multiples, amplitudes, **more):
    return TideForcing(
        tuple(f"line {m}" for m in multiples),
        M2 * np.array(multiples, dtype=float),
        np.arange(4),
        np.outer(amplitudes, np.ones(4)),
        **more,
    )


def test_overtides_inside_are_odd_and_follow_what_drives():
    factor, argument = np.array([1.1, 1.0]), np.array([0.3, 0.9])
    given = forcing_of([1, 3], [0.5, 0.0], nodal_factor=factor, argument=argument)
    longer, asked = with_odd_overtides(given, GWCE)
    assert asked == 2
    np.testing.assert_allclose(longer.frequency / M2, [1, 3, 5, 7, 9, 11, 13])
    np.testing.assert_allclose(longer.nodal_factor[2:], 1.1 ** np.arange(5, 14, 2))
    np.testing.assert_allclose(longer.argument[2:], 0.3 * np.arange(5, 14, 2))
    assert not longer.elevation[1:].any()


@pytest.mark.parametrize(
    ("forcing", "settings"),
    [
        (forcing_of([1, 3], [0.5, 0.0]), TideSettings(friction_law="quadratic")),
        (forcing_of([1], [0.5]), TideSettings(discretisation="gwce")),
        (forcing_of([1, 1.03], [0.5, 0.1]), GWCE),
        (forcing_of([1, 0.51], [0.5, 0.0]), GWCE),
    ],
)
def test_no_overtides_inside(forcing, settings):
    same, asked = with_odd_overtides(forcing, settings)
    assert same is forcing
    assert asked == len(forcing.names)
