"""Boundary lines join up to the rings, and the ledger stands beside them."""

import json

import numpy as np

from tidemesh.datatypes import LAND, OCEAN, Domain, LedgerEntry, Ring
from tidemesh.geometry.projection import Projection
from tidemesh.io.domain_geojson import write_domain


def test_lines_and_ledger(tmp_path):
    projection = Projection.stereographic(-79.0, 33.0)
    outer = np.array([[0.0, 0.0], [9e3, 0.0], [9e3, 9e3], [0.0, 9e3]])
    island = np.array([[4e3, 4e3], [4e3, 5e3], [5e3, 5e3]])
    kinds = [OCEAN, LAND, LAND, OCEAN]
    entry = LedgerEntry("island dropped", -79.05, 33.01, 2.5e6, "below 4 km2")
    rings = (Ring(outer, kinds), Ring(island, [LAND] * 3))
    write_domain(tmp_path / "d.geojson", Domain(rings, projection, (entry,)))

    features = json.loads((tmp_path / "d.geojson").read_text())["features"]
    lines = [f for f in features if f["geometry"]["type"] == "LineString"]
    assert [(f["properties"]["ring"], f["properties"]["kind"]) for f in lines] == [
        (0, "land"),
        (0, "ocean"),
        (1, "land"),
    ]
    # The ocean run goes on over the start of the ring: 3 -> 0 -> 1.
    expected = projection.inverse(outer[[3, 0, 1]])
    np.testing.assert_allclose(lines[1]["geometry"]["coordinates"], expected, atol=1e-7)
    # A whole ring is closed.
    whole = lines[2]["geometry"]["coordinates"]
    assert whole[0] == whole[-1]
    assert len(whole) == 4
    (point,) = [f for f in features if f["geometry"]["type"] == "Point"]
    assert point["properties"]["area_km2"] == 2.5
