"""Tidal constants brought to the ocean nodes."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from tidemesh.datatypes import BoundaryString, CoastalMesh, TideTable
from tidemesh.errors import EngineError, InputError
from tidemesh.geometry.projection import Projection
from tidemesh.tides import boundary_forcing

PROJECTION = Projection.stereographic(-79.4, 33.0)


def mesh_with_ocean(longitude, latitude):
    """A mesh in name only: forcing looks at its open nodes alone."""
    points = PROJECTION.forward(longitude, latitude)
    nodes = np.arange(len(points))
    return CoastalMesh(
        points,
        np.empty((0, 3), dtype=int),
        np.ones(len(points)),
        (BoundaryString("open", nodes),),
        PROJECTION,
    )


def arc(n, radius=1.5, centre=(-79.4, 33.0)):
    angle = np.radians(np.linspace(-147.0, 33.0, n))
    return centre[0] + radius * np.cos(angle), centre[1] + radius * np.sin(angle)


def table(longitude, latitude, *values, names=("M2", "K1")):
    return TideTable(
        longitude,
        latitude,
        names[: len(values)],
        np.array([1.405189e-4, 7.29e-5])[: len(values)],
        np.array(values),
    )


def wave(longitude, latitude):
    """A smooth tide whose phase runs through 0 = 360 degrees."""
    return (0.6 + 0.05 * (latitude - 33.0)) * np.exp(1j * 0.3 * (longitude + 79.4))


def plane(longitude, latitude):
    x, y = PROJECTION.forward(longitude, latitude).T
    return 0.5 + (1e-6 + 2e-6j) * x - 1e-6j * y


def test_own_places_keep_their_values():
    lon, lat = arc(90)
    forcing = boundary_forcing(
        mesh_with_ocean(lon, lat), table(lon, lat, wave(lon, lat)), ["m2"]
    )
    assert forcing.names == ("M2",)
    assert_allclose(forcing.elevation[0], wave(lon, lat), rtol=1e-9)


def test_places_along_the_boundary_are_joined_linearly():
    # Nodes on the arc lie outside the chords of the places: second order all the same.
    errors = []
    for n in (31, 61, 121):
        lon, lat = arc(n)
        fine = arc(331)
        forcing = boundary_forcing(
            mesh_with_ocean(*fine), table(lon, lat, wave(lon, lat)), ["M2"]
        )
        errors.append(np.abs(forcing.elevation[0] - wave(*fine)).max())
    assert errors[-1] < 1e-4
    assert np.log2(errors[0] / errors[-1]) / 2 > 1.7


def test_gridded_places_reproduce_a_plane_and_nan_places_are_left_out():
    lon, lat = np.meshgrid(np.arange(-82.0, -76.5, 0.25), np.arange(31.0, 35.2, 0.25))
    lon, lat = lon.ravel(), lat.ravel()
    values = plane(lon, lat)
    values[::7] = np.nan
    ocean = arc(50)
    forcing = boundary_forcing(
        mesh_with_ocean(*ocean), table(lon, lat, values, 2.0 * values), ["K1", "M2"]
    )
    assert forcing.names == ("K1", "M2")
    assert_allclose(forcing.elevation[1], plane(*ocean), rtol=1e-9)
    assert_allclose(forcing.elevation[0], 2.0 * plane(*ocean), rtol=1e-9)
    assert_allclose(forcing.frequency, [7.29e-5, 1.405189e-4])


def test_places_on_a_line_and_a_single_place():
    ocean = (np.full(9, -79.4), np.linspace(32.0, 32.4, 9))
    line = (np.full(4, -79.5), np.array([32.3, 31.9, 32.5, 32.1]))
    forcing = boundary_forcing(
        mesh_with_ocean(*ocean), table(*line, line[1] + 0j), ["M2"]
    )
    assert_allclose(forcing.elevation[0], ocean[1], atol=1e-3)
    one = table([-79.5], [32.2], [0.4 - 0.1j])
    forcing = boundary_forcing(mesh_with_ocean(*ocean), one, ["M2"])
    assert_allclose(forcing.elevation[0], 0.4 - 0.1j)


def test_a_global_atlas_has_places_that_the_map_cannot_hold():
    lon, lat = np.meshgrid(np.arange(-180.0, 180.0, 0.5), np.arange(-90.0, 90.1, 5.0))
    near = np.meshgrid(np.arange(-82.0, -76.0, 0.5), np.arange(31.0, 35.5, 0.5))
    lon = np.concatenate([lon.ravel(), near[0].ravel()])
    lat = np.concatenate([lat.ravel(), near[1].ravel() + 0.01])
    ocean = arc(20)
    forcing = boundary_forcing(
        mesh_with_ocean(*ocean), table(lon, lat, np.full(len(lon), 0.3)), ["M2"]
    )
    assert_allclose(forcing.elevation[0], 0.3)


def test_constituent_that_the_table_lacks():
    lon, lat = arc(10)
    given = table(lon, lat, wave(lon, lat), wave(lon, lat))
    with pytest.raises(InputError, match="has no S2; it has M2, K1"):
        boundary_forcing(mesh_with_ocean(lon, lat), given, ["M2", "S2"])


def test_places_too_far_away():
    lon, lat = arc(10)
    given = table(lon + 3.0, lat, wave(lon, lat))
    with pytest.raises(InputError, match=r"too far .* km from the nearest place") as e:
        boundary_forcing(mesh_with_ocean(lon, lat), given, ["M2"])
    assert "more than 50 km" in str(e.value)
    positive_east = table(lon + 360.0, lat, wave(lon, lat))
    forcing = boundary_forcing(mesh_with_ocean(lon, lat), positive_east, ["M2"])
    assert_allclose(forcing.elevation[0], wave(lon, lat), rtol=1e-9)


def test_constituent_without_any_value():
    lon, lat = arc(10)
    given = table(lon, lat, wave(lon, lat), np.full(10, np.nan))
    with pytest.raises(InputError, match="no value of K1"):
        boundary_forcing(mesh_with_ocean(lon, lat), given, ["M2", "K1"])


def test_mesh_without_ocean():
    closed = CoastalMesh([[0, 0], [1, 0], [0, 1]], [[0, 1, 2]], np.ones(3))
    lon, lat = arc(10)
    with pytest.raises(EngineError, match="no open"):
        boundary_forcing(closed, table(lon, lat, wave(lon, lat)), ["M2"])
