"""What users get wrong: one clear error, exit code 2, before long work."""

from __future__ import annotations

import json

import netCDF4
import numpy as np
import pytest

from tidemesh.cli import main


@pytest.fixture
def fails(island, tmp_path, capsys):
    """Run with overrides; must stop with exit code 2; returns the message."""

    def run(*overrides):
        arguments = ["run", str(island), "-o", str(tmp_path / "out"), "--quiet"]
        for override in overrides:
            arguments += ["--set", override]
        assert main(arguments) == 2
        message = capsys.readouterr().err
        assert message.startswith("error: ")
        assert "Traceback" not in message
        stages = {p.stem for p in (tmp_path / "out").glob("stages/*.json")}
        assert not stages & {"tide", "mesh"}, "the error came after long work"
        return message

    return run


@pytest.fixture
def land(island):
    """Read and write the features of the shoreline."""
    path = island.parent / "data" / "shoreline.geojson"
    collection = json.loads(path.read_text())

    def write():
        path.write_text(json.dumps(collection))

    return collection["features"], write


@pytest.fixture
def bathymetry(island):
    return island.parent / "data" / "bathymetry.nc"


def test_missing_file(fails):
    message = fails("domain.shoreline=data/coast.shp")
    assert "domain.shoreline" in message
    assert "no such file" in message


def test_wrong_crs(fails, land):
    features, write = land
    for feature in features:
        ring = np.array(feature["geometry"]["coordinates"][0])
        feature["geometry"]["coordinates"][0] = (1e5 * ring).tolist()
    write()
    message = fails()
    assert "shoreline.geojson" in message
    assert "coordinate system" in message


def test_shoreline_outside_the_box(fails):
    message = fails("domain.box_deg=[10.0, 50.0, 12.0, 52.0]")
    assert "shoreline.geojson" in message
    assert "box" in message


def test_raster_elsewhere(fails, bathymetry):
    with netCDF4.Dataset(bathymetry, "a") as file:
        file["lon"][:] = file["lon"][:] + 90.0
    message = fails()
    assert "bathymetry.nc" in message
    assert "overlap" in message


def test_depth_sign_flipped(fails):
    message = fails('depth.sources=[{path="data/bathymetry.nc", positive="down"}]')
    assert "bathymetry.nc" in message
    assert "positive" in message


def test_raster_with_a_hole(fails, bathymetry):
    with netCDF4.Dataset(bathymetry, "a") as file:
        file["elevation"][8:20, 15:30] = np.nan
    message = fails()
    assert "bathymetry.nc" in message
    assert "-40." in message


def test_open_boundary_on_land(fails):
    message = fails('domain.ocean.edges=["north"]')
    assert "open boundary" in message


def test_open_boundary_ends_in_the_sea(fails, land):
    """Without the western shore the southern edge meets land at its east end only."""
    features, write = land
    ring = features[0]["geometry"]["coordinates"][0]
    kept = [p for p in ring if p[0] > -39.9]
    features[0]["geometry"]["coordinates"][0] = [*kept, kept[0]]
    write()
    assert "open boundary" in fails()


def test_self_crossing_shoreline(fails, land):
    features, write = land
    ring = features[1]["geometry"]["coordinates"][0]
    ring[10], ring[30] = ring[30], ring[10]
    write()
    message = fails()
    assert "shoreline.geojson" in message
    assert "cross" in message
    assert "repair" in message


def test_duplicate_shoreline(fails, land):
    features, write = land
    features.append(features[1])
    write()
    message = fails()
    assert "duplicate" in message.lower() or "overlap" in message.lower()
    assert "repair" in message


def test_domain_split_in_two(fails, land):
    """A wall of land through the middle of the bay, island and all."""
    features, write = land
    wall = [[-40.02, 29.4], [-39.98, 29.4], [-39.98, 30.6], [-40.02, 30.6]]
    features[1]["geometry"]["coordinates"][0] = [*wall, wall[0]]
    write()
    message = fails("domain.repair=true")
    assert "two" in message or "parts" in message


def test_constituent_missing(fails):
    message = fails('tide.constituents=["S2"]')
    assert "open_boundary.csv" in message
    assert "M2" in message


def test_forcing_far_away(fails, island):
    path = island.parent / "data" / "open_boundary.csv"
    path.write_text(path.read_text().replace("29.60", "19.60"))
    message = fails()
    assert "km" in message
    assert "forcing" in message or "constants" in message


def test_budget_below_the_boundary(island, tmp_path, capsys):
    arguments = ["run", str(island), "-o", str(tmp_path / "out"), "--quiet"]
    assert main([*arguments, "--set", "sizing.nodes=12"]) == 2
    message = capsys.readouterr().err
    assert "nodes = 12" in message
    assert "below what the boundary" in message


def test_size_below_float_resolution(fails):
    message = fails("domain.min_spacing_m=1e-9")
    assert "min_spacing" in message


def test_unwritable_output(island, tmp_path, capsys):
    (tmp_path / "file").write_text("")
    assert main(["run", str(island), "-o", str(tmp_path / "file" / "out")]) == 2
    assert "cannot be written" in capsys.readouterr().err
