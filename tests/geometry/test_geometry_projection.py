import numpy as np
import pytest

from tidemesh.geometry.projection import Projection

LONGITUDE = np.array([-81.3, -80.0, -79.1, -77.4])
LATITUDE = np.array([31.6, 33.0, 34.2, 32.1])


def test_convergence_of_a_transverse_mercator_map():
    """On the sphere tan(convergence) = tan(longitude from the middle) sin(latitude)."""
    projection = Projection("+proj=tmerc +lon_0=-79.5 +lat_0=33 +R=6378206.4 +units=m")
    points = projection.forward(LONGITUDE, LATITUDE)
    angle = np.arctan(
        np.tan(np.radians(LONGITUDE + 79.5)) * np.sin(np.radians(LATITUDE))
    )
    east, north = projection.east_north(points, np.tile([0.0, 1.0], (4, 1))).T
    np.testing.assert_allclose(np.arctan2(east, north), angle, atol=1e-9)


@pytest.mark.parametrize(
    "projection",
    [
        Projection.stereographic(-79.75, 33.0),
        Projection.equirectangular(-79.75, 33.0),
        Projection("EPSG:32617"),
    ],
)
def test_a_step_along_the_meridian_points_north(projection):
    points = projection.forward(LONGITUDE, LATITUDE)
    step = projection.forward(LONGITUDE, LATITUDE + 1e-4) - points
    east, north = projection.east_north(points, step).T
    np.testing.assert_allclose(north, np.hypot(*step.T), rtol=1e-9)
    assert np.abs(east / north).max() < 1e-6


def test_vectors_of_any_number_of_constituents_keep_their_length():
    projection = Projection.stereographic(-79.75, 33.0)
    points = projection.forward(LONGITUDE, LATITUDE)
    generator = np.random.default_rng(5)
    vectors = generator.normal(size=(3, 4, 2)) + 1j * generator.normal(size=(3, 4, 2))
    turned = projection.east_north(points, vectors)
    assert turned.shape == vectors.shape
    np.testing.assert_allclose(
        (np.abs(turned) ** 2).sum(axis=-1), (np.abs(vectors) ** 2).sum(axis=-1)
    )
    back = projection.from_east_north(points, turned)
    np.testing.assert_allclose(back, vectors, rtol=1e-12)


def test_bare_plane_and_equirectangular_map_leave_vectors_alone():
    vectors = np.arange(8.0).reshape(4, 2)
    points = np.stack([LONGITUDE, LATITUDE], axis=1)
    np.testing.assert_array_equal(Projection().east_north(points, vectors), vectors)
    projection = Projection.equirectangular(-79.75, 33.0)
    points = projection.forward(LONGITUDE, LATITUDE)
    np.testing.assert_allclose(projection.east_north(points, vectors), vectors)


@pytest.mark.parametrize(
    ("crs", "first"),
    [
        (Projection.stereographic(180.5, -17.0).crs, 178.0),
        (Projection.equirectangular(-179.5, 52.0).crs, -182.0),
        ("EPSG:32601", -182.0),
        ("EPSG:32660", 178.0),
    ],
)
def test_longitudes_do_not_jump_at_the_date_line(crs, first):
    """Both sides of 180 degrees come back as neighbours, near the map's middle."""
    projection = Projection(crs)
    longitude = first + np.arange(5.0)
    latitude = np.full(5, 10.0)
    wrapped = (longitude + 180.0) % 360.0 - 180.0
    places = projection.inverse(projection.forward(wrapped, latitude))
    np.testing.assert_allclose(places[:, 0], longitude, atol=1e-9)
