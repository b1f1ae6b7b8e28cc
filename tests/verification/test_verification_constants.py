"""Harmonic constants, modelled against observed."""

import csv
import json
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from verification_cases import table

from tidemesh.datatypes import CoastalMesh, TideSolution
from tidemesh.errors import InputError
from tidemesh.geometry.projection import Projection
from tidemesh.verification import (
    compare_constants,
    constants_at_gauges,
    write_verification,
)
from tidemesh.verification.constants import phase_deg

AMPLITUDE = st.floats(1e-3, 10.0)
PHASE = st.floats(0.0, 360.0)


def test_equal_constants_have_no_error():
    same = table({"M2": [(0.7, 10.0), (0.8, 350.0)], "M4": [(0.01, 0), (0.02, 180)]})
    found = compare_constants(same, same)
    assert len(found.rows) == 4
    assert found.rss_error_m == 0.0
    assert found.relative_error == 0.0
    for row in found.rows:
        assert (
            row.amplitude_error_m == row.phase_error_deg == row.complex_error_m == 0.0
        )
    for one in found.summary:
        assert one.amplitude_ratio == 1.0
        assert one.gauges == 2


@given(AMPLITUDE, PHASE, AMPLITUDE, PHASE)
def test_rms_of_the_difference_of_two_cosines(a, g, b, h):
    found = compare_constants(table({"M2": [(a, g)]}), table({"M2": [(b, h)]}))
    # The mean of a squared cosine is one half, and the law of cosines.
    square = a**2 + b**2 - 2 * a * b * np.cos(np.radians(g - h))
    (one,) = found.summary
    assert one.rms_error_m == pytest.approx(
        np.sqrt(max(square, 0.0) / 2), abs=1e-7 * (a + b)
    )
    turn = 2 * np.pi * np.arange(48) / 48
    difference = a * np.cos(turn - np.radians(g)) - b * np.cos(turn - np.radians(h))
    assert_allclose(
        one.rms_error_m, np.sqrt(np.mean(difference**2)), atol=1e-9 * (a + b)
    )
    assert one.observed_rms_m == pytest.approx(b / np.sqrt(2))


@given(PHASE, st.floats(-179.0, 179.0))
def test_phase_error_does_not_jump_at_360(observed, error):
    found = compare_constants(
        table({"M2": [(1.0, observed + error)]}), table({"M2": [(1.0, observed)]})
    )
    assert found.rows[0].phase_error_deg == pytest.approx(error, abs=1e-9)
    assert found.summary[0].phase_error_deg == pytest.approx(error, abs=1e-9)


def test_mean_lag_is_taken_on_the_circle():
    found = compare_constants(
        table({"M2": [(1, 5), (1, 355)]}), table({"M2": [(1, 350), (1, 350)]})
    )
    assert [row.phase_error_deg for row in found.rows] == pytest.approx([15, 5])
    assert found.summary[0].phase_error_deg == pytest.approx(10)
    assert phase_deg(1.0 + 1e-20j) == 0.0


def test_figures_over_gauges_and_constituents():
    found = compare_constants(
        table({"M2": [(1.2, 0), (0.9, 0)], "K1": [(0.1, 90), (0.3, 0)]}),
        table({"M2": [(1.0, 0), (1.0, 0)], "K1": [(0.1, 0), (0.3, 0)]}),
    )
    m2, k1 = found.summary
    assert m2.amplitude_ratio == pytest.approx(1.05)
    assert m2.rms_error_m == pytest.approx(np.sqrt((0.04 + 0.01) / 4))
    assert k1.rms_error_m == pytest.approx(np.sqrt(0.02 / 4))
    assert (m2.largest_error_gauge, m2.largest_error_m) == (
        "Charleston",
        pytest.approx(0.2),
    )
    assert found.rss_error_m == pytest.approx(np.sqrt(0.05 / 4 + 0.02 / 4))
    assert found.observed_rss_m == pytest.approx(np.sqrt(1 / 2 + 0.1 / 4))
    assert found.rows[1].constituent == "K1"
    assert found.rows[2].amplitude_error_percent == pytest.approx(-10)


def test_mean_level_counts_in_full():
    found = compare_constants(
        table({"STEADY": [(0.3, 0)]}), table({"STEADY": [(0.1, 0)]})
    )
    assert found.summary[0].rms_error_m == pytest.approx(0.2)


def test_gauges_in_another_order_and_constants_that_are_absent():
    observed = table({"K1": [(0.1, 0), (0.2, 0)], "M2": [(0.0, 0.0), (np.nan, 0)]})
    swapped = replace(
        table({"M2": [(0.5, 0), (0.6, 0)], "K1": [(0.2, 0), (0.1, 0)]}),
        longitude_deg=observed.longitude_deg[::-1],
        latitude_deg=observed.latitude_deg[::-1],
        stations=observed.stations[::-1],
    )
    found = compare_constants(swapped, observed)
    # Of M2 one gauge has zero, which is how NOAA writes "not known", the other nothing.
    assert [row.constituent for row in found.rows] == ["K1", "K1"]
    assert found.rss_error_m == 0.0
    assert [one.constituent for one in found.summary] == ["K1"]


def test_gauges_of_one_name_are_told_apart_by_their_place():
    twins = ("Beaufort", "Beaufort")
    observed = table({"M2": [(0.5, 0), (1.0, 0)]}, stations=twins)
    modelled = replace(
        table({"M2": [(1.1, 0)]}, stations=("Beaufort",)),
        longitude_deg=observed.longitude_deg[1:],
        latitude_deg=observed.latitude_deg[1:],
    )
    (row,) = compare_constants(modelled, observed).rows
    assert (row.observed_m, row.longitude_deg) == (1.0, -79.0)


def test_what_is_not_in_common():
    m2, k1 = table({"M2": [(1, 0)]}), table({"K1": [(1, 0)]})
    with pytest.raises(InputError, match="no constituent in common"):
        compare_constants(m2, k1)
    with pytest.raises(InputError, match="the observed constants have no M2"):
        compare_constants(m2, k1, names=["M2"])
    with pytest.raises(InputError, match="none of the 1 modelled gauges"):
        compare_constants(m2, replace(m2, longitude_deg=[79.0]))
    with pytest.raises(InputError, match="no gauge has a constant of M2"):
        compare_constants(m2, replace(m2, elevation=[[np.nan]]))


# ---- on a mesh -------------------------------------------------------------------

PLACE = Projection.stereographic(-80.0, 33.0)


def square(side=10_000.0):
    """Two triangles; the elevation is linear, so known everywhere."""
    points = np.array([[0, 0], [side, 0], [side, side], [0, side]])
    mesh = CoastalMesh(
        points, [[0, 1, 2], [0, 2, 3]], np.full(4, 5.0), projection=PLACE
    )
    elevation = linear(points)
    tide = TideSolution(
        ("M2", "K1"),
        [1.4e-4, 7.3e-5],
        np.stack([elevation, 2j * elevation]),
        np.zeros((2, 4, 2)),
        np.zeros(4),
    )
    return mesh, tide


def linear(points):
    return 1.0 + (2e-5 + 1e-5j) * points[:, 0] - 3e-5j * points[:, 1]


def gauges(places, stations=()):
    longitude, latitude = PLACE.inverse(np.array(places, dtype=float)).T
    return replace(
        table({"M2": [(1.0, 0.0)] * len(places)}, stations=(), longitude=longitude),
        latitude_deg=latitude,
        stations=stations,
    )


def test_constants_inside_and_beside_the_mesh():
    mesh, tide = square()
    observed = gauges(
        [[4000, 3000], [5000, -2000], [5000, -4000], [12000, 12000]],
        ("inside", "near", "far", "corner"),
    )
    modelled, left_out, distance = constants_at_gauges(mesh, tide, observed)
    assert modelled.stations == ("inside", "near", "corner")
    assert modelled.names == ("M2", "K1")
    # The near ones take the tide of the nearest place of the mesh.
    nearest = np.array([[4000, 3000], [5000, 0], [10000, 10000]])
    assert_allclose(modelled.elevation[0], linear(nearest), rtol=1e-8)
    assert_allclose(modelled.elevation[1], 2j * linear(nearest), rtol=1e-8)
    assert_allclose(distance, [0, 2000, 2000 * np.sqrt(2)], atol=1e-2)
    (far,) = left_out
    assert far.gauge == "far"
    assert far.distance_m == pytest.approx(4000)
    assert far.reason == "4.0 km from the mesh, more than 3 km"
    rows = compare_constants(modelled, observed, distance_m=distance).rows
    assert [row.distance_m for row in rows] == pytest.approx(
        [0, 2000, 2828.427], abs=1e-2
    )


def test_gauges_on_the_other_side_of_the_earth_are_left_out():
    mesh, tide = square()
    observed = replace(gauges([[1, 1]]), longitude_deg=[100.0], latitude_deg=[-33.0])
    modelled, left_out, distance = constants_at_gauges(mesh, tide, observed)
    assert len(modelled.longitude_deg) == len(distance) == 0
    assert left_out[0].gauge == "place 1"
    assert left_out[0].reason


def test_dry_triangles_do_not_serve():
    mesh, tide = square()
    elevation = tide.elevation.copy()
    elevation[:, 3] = np.nan
    dry = replace(tide, elevation=elevation)
    modelled, _, distance = constants_at_gauges(mesh, dry, gauges([[4000, 6000]]))
    # Nearest on the edge from corner 0 to corner 2.
    assert_allclose(modelled.elevation[0], linear(np.array([[5000, 5000]])), rtol=1e-8)
    assert_allclose(distance, np.sqrt(2) * 1000, rtol=1e-5)
    nowhere = replace(tide, elevation=np.full_like(elevation, np.nan))
    _, left_out, _ = constants_at_gauges(mesh, nowhere, gauges([[4000, 6000]]))
    assert "no wet triangle" in left_out[0].reason


# ---- files -----------------------------------------------------------------------


def test_tables_and_files(tmp_path):
    found = compare_constants(
        table({"M2": [(1.2, 5), (0.9, 355)]}),
        table({"M2": [(1.0, 355), (1.0, 355)]}),
        distance_m=np.array([0.0, np.nan]),
    )
    text = found.as_text().splitlines()
    assert " ".join(text[1].split()[:9]) == (
        "Charleston M2 1.000 1.200 +20.0 355.0 5.0 +10.0 0.277"
    )
    assert len({line.index("M2") for line in text[1:3]}) == 1
    mesh, tide = square()
    _, left_out, _ = constants_at_gauges(mesh, tide, gauges([[5000, -4000]]))
    paths = write_verification(
        tmp_path / "new" / "folder", constants=found, left_out=left_out, title="Trial"
    )
    assert [path.name for path in paths] == [
        "verification.json",
        "verification.md",
        "constants.csv",
    ]
    content = json.loads(paths[0].read_text())
    assert content["constants"]["rss_error_m"] == found.rss_error_m
    assert content["constants"]["rows"][0]["phase_error_deg"] == pytest.approx(10)
    assert content["constants"]["rows"][1]["distance_m"] is None
    assert content["left_out"][0]["reason"].startswith("4.0 km")
    assert "| M2 | 2 |" in paths[1].read_text()
    with open(paths[2], newline="") as file:
        rows = list(csv.DictReader(file))
    assert [row["gauge"] for row in rows] == ["Charleston", "Springmaid"]
    assert float(rows[0]["amplitude_error_percent"]) == pytest.approx(20)
    before = [path.read_bytes() for path in paths]
    again = write_verification(
        tmp_path / "other", constants=found, left_out=left_out, title="Trial"
    )
    assert [path.read_bytes() for path in again] == before
