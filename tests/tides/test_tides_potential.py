"""The equilibrium tide against the moon and the sun themselves, and the catalogue."""

from datetime import UTC, datetime

import numpy as np
import pytest
from numpy.testing import assert_allclose

from tidemesh.constants import frequency
from tidemesh.datatypes import CoastalMesh, TideForcing
from tidemesh.errors import InputError
from tidemesh.geometry.projection import Projection
from tidemesh.tides.astronomy import doodson_numbers, prediction_basis
from tidemesh.tides.potential import POTENTIAL, equilibrium_tide, with_potential

MEAN_RADIUS = 6371.0e3
MASS_RATIO = {"moon": 1.0 / 81.3006, "sun": 332_946.0}
ASTRONOMICAL_UNIT = 1.495979e11
EQUATORIAL_RADIUS = 6378.137e3


def mesh_at(longitude, latitude):
    """A mesh in name only: the potential looks at its points alone."""
    projection = Projection.stereographic(longitude[0], latitude[0])
    points = projection.forward(longitude, latitude)
    return CoastalMesh(
        points,
        np.empty((0, 3), dtype=int),
        np.ones(len(points)),
        projection=projection,
    )


def sine(centuries, start, rate):
    return np.sin(np.radians(start + rate * centuries))


def cosine(centuries, start, rate):
    return sine(centuries, start + 90.0, rate)


def moon(t):
    """Longitude, latitude (rad), distance (m): Almanac's low-precision formulas."""
    longitude = (
        218.32
        + 481267.881 * t
        + 6.29 * sine(t, 135.0, 477198.87)
        - 1.27 * sine(t, 259.3, -413335.36)
        + 0.66 * sine(t, 235.7, 890534.22)
        + 0.21 * sine(t, 269.9, 954397.74)
        - 0.19 * sine(t, 357.5, 35999.05)
        - 0.11 * sine(t, 186.5, 966404.03)
    )
    latitude = (
        5.13 * sine(t, 93.3, 483202.02)
        + 0.28 * sine(t, 228.2, 960400.89)
        - 0.28 * sine(t, 318.3, 6003.15)
        - 0.17 * sine(t, 217.6, -407332.21)
    )
    parallax = (
        0.9508
        + 0.0518 * cosine(t, 135.0, 477198.87)
        + 0.0095 * cosine(t, 259.3, -413335.36)
        + 0.0078 * cosine(t, 235.7, 890534.22)
        + 0.0028 * cosine(t, 269.9, 954397.74)
    )
    distance = EQUATORIAL_RADIUS / np.sin(np.radians(parallax))
    return np.radians(longitude), np.radians(latitude), distance


def sun(t):
    anomaly = np.radians(357.528 + 35999.050 * t)
    longitude = 280.460 + 36000.771 * t
    longitude += 1.915 * np.sin(anomaly) + 0.020 * np.sin(2.0 * anomaly)
    distance = ASTRONOMICAL_UNIT * (1.00014 - 0.01671 * np.cos(anomaly))
    return np.radians(longitude), np.zeros_like(t), distance


def direct_tide(time, longitude, latitude):
    """Degree-two equilibrium tide on a rigid earth (m) from where the bodies stand."""
    days = time / 86400.0 - 10957.5
    t = days / 36525.0
    sidereal = np.radians(280.46062 + 360.98564737 * days)
    tilt = np.radians(23.4393)
    level = np.zeros_like(time)
    for body, place in (("moon", moon), ("sun", sun)):
        lon, lat, distance = place(t)
        x = np.cos(lat) * np.cos(lon)
        y = np.cos(lat) * np.sin(lon) * np.cos(tilt) - np.sin(lat) * np.sin(tilt)
        z = np.cos(lat) * np.sin(lon) * np.sin(tilt) + np.sin(lat) * np.cos(tilt)
        hour_angle = sidereal + np.radians(longitude) - np.arctan2(y, x)
        phi = np.radians(latitude)
        cos_zenith = np.sin(phi) * z + np.cos(phi) * np.hypot(x, y) * np.cos(hour_angle)
        size = MASS_RATIO[body] * MEAN_RADIUS**4 / distance**3
        level += size * (1.5 * cos_zenith**2 - 0.5)
    return level


@pytest.mark.parametrize(
    "place", [(-79.9, 32.8), (-79.9, -33.0), (140.0, 5.0), (10.0, 62.0)]
)
@pytest.mark.parametrize("date", [(1998, 3, 1), (2006, 9, 1)])
def test_constituents_found_in_the_pull_of_moon_and_sun(place, date):
    start = datetime(*date, tzinfo=UTC).timestamp()
    time = start + np.arange(0.0, 365.0 * 86400.0, 7200.0)
    names = tuple(POTENTIAL)
    tide = equilibrium_tide(
        mesh_at(*np.array([place]).T), names, body_factor=np.ones(len(names))
    )[:, 0]
    basis = prediction_basis(names, time, place[1])
    matrix = np.vstack([basis.real, -basis.imag, np.ones((1, len(time)))]).T
    found = np.linalg.lstsq(matrix, direct_tide(time, *place))[0]
    off = np.abs(found[: len(names)] + 1j * found[len(names) : -1] - tide)
    # Of the many lines near M1, the library's satellites take in those of degree three.
    tolerance = np.where(np.array(names) == "M1", 2.5e-3, 1.0e-3)
    assert dict(zip(names, off > tolerance)) == dict.fromkeys(names, False)


def test_amplitudes_of_the_catalogue():
    constituents = pytest.importorskip(
        "pyTMD.constituents", reason="pyTMD is not installed"
    )
    from pyTMD.utilities import get_data_path

    catalogue = constituents._parse_tide_potential_table(
        get_data_path(["data", "cte1973_tab.txt"])
    )
    angles = np.array([catalogue[n] for n in ("tau", "s", "h", "p", "n", "pp")]).T
    # From normalised harmonics to the shapes that the module names.
    norm = (
        np.sqrt(5.0 / (4.0 * np.pi)),
        1.5 * np.sqrt(5.0 / (24.0 * np.pi)),
        3.0 * np.sqrt(5.0 / (96.0 * np.pi)),
    )
    for name, numbers in zip(POTENTIAL, doodson_numbers(tuple(POTENTIAL))):
        row = (angles == numbers).all(axis=1) & (catalogue["l"] == 2)
        size = np.abs(catalogue["Hs1"][row]) * norm[POTENTIAL[name].species]
        assert len(size) == 1, name
        # 0.993 is the ratio of the two sources; small ones have few digits.
        assert_allclose(
            POTENTIAL[name].amplitude, 0.993 * size[0], rtol=1.5e-3, err_msg=name
        )


def test_body_factors_follow_the_resonance_of_the_core():
    earth = pytest.importorskip("pyTMD.earth", reason="pyTMD is not installed")
    for name, constituent in POTENTIAL.items():
        h, k, _ = earth.love_numbers(frequency(name), model="1066A")
        assert_allclose(constituent.body_factor, 1.0 + k - h, atol=6e-4, err_msg=name)


def test_shapes_over_the_globe():
    mesh = mesh_at(np.array([30.0, 30.0, 75.0]), np.array([0.0, 40.0, 40.0]))
    m2, k1, mf = equilibrium_tide(mesh, ["m2", "K1", "Mf"])
    # The moon stands highest over the equator, V + longitude = 0: Greenwich lag -30.
    assert_allclose(m2[0], 0.693 * 0.242334 * np.exp(2j * np.radians(30.0)))
    assert_allclose(k1[0], 0.0, atol=1e-12)
    assert_allclose(m2[2] / m2[1], np.exp(2j * np.radians(45.0)), atol=1e-9)
    assert_allclose(k1[2] / k1[1], np.exp(1j * np.radians(45.0)), atol=1e-9)
    assert_allclose(mf[2], mf[1], atol=1e-12)
    assert mf[0].real > 0.0 > mf[1].real - mf[0].real


def test_constituents_that_nothing_pulls_at():
    mesh = mesh_at(np.array([-79.0]), np.array([33.0]))
    assert not equilibrium_tide(mesh, ["M4", "STEADY", "SA", "S1", "what"]).any()
    assert_allclose(
        equilibrium_tide(mesh, ["RHO1", "LAMBDA2"]),
        equilibrium_tide(mesh, ["RHO", "LAM2"]),
    )


def test_forcing_with_the_amplitudes_of_a_fort15():
    mesh = mesh_at(np.array([-79.0, -78.0]), np.array([33.0, 32.0]))
    forcing = TideForcing(
        ("M2", "M4"), [frequency("M2"), frequency("M4")], [0], np.ones((2, 1))
    )
    given = with_potential(mesh, forcing, amplitude=[0.2, 9.0], body_factor=[0.5, 1.0])
    assert given.names == forcing.names
    assert_allclose(given.elevation, forcing.elevation)
    assert_allclose(np.abs(given.potential[0, 0]), 0.1 * np.cos(np.radians(33.0)) ** 2)
    assert not given.potential[1].any()


def test_a_mesh_that_lies_nowhere():
    plane = CoastalMesh([[0, 0], [1, 0], [0, 1]], [[0, 1, 2]], np.ones(3))
    with pytest.raises(InputError, match="bare plane: name the projection"):
        equilibrium_tide(plane, ["M2"])
