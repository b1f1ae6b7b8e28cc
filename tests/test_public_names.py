"""The public names exist, the gallery runs, and importing the package stays light."""

from __future__ import annotations

import runpy
import subprocess
import sys

import pytest

import tidemesh
from tidemesh.triangulation.topology import check_mesh


@pytest.mark.parametrize("name", [n for n in tidemesh.__all__ if n != "__version__"])
def test_name_exists_and_is_documented(name):
    public = getattr(tidemesh, name)
    assert callable(public)
    assert public.__doc__


def test_unknown_name():
    with pytest.raises(AttributeError, match="no attribute 'mesh_it'"):
        _ = tidemesh.mesh_it


def test_step_by_step(examples):
    mesh = runpy.run_path(str(examples / "gallery" / "step_by_step.py"))["main"]()
    assert abs(len(mesh.points) / 800 - 1) <= 0.01
    assert not check_mesh(mesh.points, mesh.triangles, mesh.depth, mesh.boundaries)


def test_harmonics_and_time_stepping_agree(examples):
    """Two schemes without a line in common."""
    found = runpy.run_path(str(examples / "gallery" / "tide_two_ways.py"))["main"]()
    assert found["M2"] < 0.01
    assert found["M4"] < 0.05


@pytest.mark.parametrize("statement", ["import tidemesh", "import tidemesh.cli"])
def test_import_is_light(statement):
    """Heavy libraries are loaded on first use: start-up stays below half a second."""
    code = f"import sys; {statement}; print(*sys.modules)"
    shown = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True
    )
    heavy = {"numpy", "scipy", "numba", "matplotlib", "shapely", "netCDF4", "rasterio"}
    assert not heavy & set(shown.stdout.split())
