"""Water levels at stations and fields in time as NetCDF."""

import numpy as np
import pytest
from io_meshes import small_mesh

from tidemesh.datatypes import TideRecord
from tidemesh.errors import InputError
from tidemesh.geometry.projection import Projection
from tidemesh.io.time_series import FieldWriter, read_stations, write_stations
from tidemesh.io.ugrid import read_ugrid

TIME = 883612800.0 + 360.0 * np.arange(5)


def records():
    levels = np.random.default_rng(0).standard_normal((3, 5))
    levels[1, 2] = np.nan
    names = ("Charleston", "São Tomé", "")
    return [
        TideRecord(TIME, level, station=name, longitude_deg=-80.0 + k, latitude_deg=k)
        for k, (name, level) in enumerate(zip(names, levels, strict=True))
    ]


def test_stations_come_back_with_their_names(tmp_path):
    path = tmp_path / "stations.nc"
    write_stations(path, records())
    for have, wanted in zip(read_stations(path), records(), strict=True):
        assert have.station == wanted.station
        assert have.longitude_deg == wanted.longitude_deg
        assert have.latitude_deg == wanted.latitude_deg
        np.testing.assert_array_equal(have.time, TIME)
        np.testing.assert_array_equal(have.elevation, wanted.elevation)


def test_same_records_same_bytes(tmp_path):
    for name in ("a.nc", "b.nc"):
        write_stations(tmp_path / name, records())
    assert (tmp_path / "a.nc").read_bytes() == (tmp_path / "b.nc").read_bytes()


def test_stations_open_in_xarray(tmp_path):
    xarray = pytest.importorskip("xarray")
    write_stations(tmp_path / "stations.nc", records())
    with xarray.open_dataset(tmp_path / "stations.nc") as data:
        names = [
            name.decode() if isinstance(name, bytes) else str(name)
            for name in data.station_name.values
        ]
        assert names == ["Charleston", "São Tomé", ""]
        assert data.time.values[1] == np.datetime64("1998-01-01T00:06")
        assert data.water_level.dims == ("station", "time")


def test_stations_need_common_times_and_a_folder(tmp_path):
    one, two, _ = records()
    later = TideRecord(TIME + 1.0, two.elevation, station="later")
    with pytest.raises(ValueError, match="later differ"):
        write_stations(tmp_path / "a.nc", [one, later])
    with pytest.raises(ValueError, match="no records"):
        write_stations(tmp_path / "a.nc", [])
    with pytest.raises(InputError, match="does not exist"):
        write_stations(tmp_path / "none" / "a.nc", [one])


def test_fields_go_on_where_a_restart_stands(tmp_path):
    xugrid = pytest.importorskip("xugrid")
    mesh = small_mesh(Projection.stereographic(-79.0, 33.0))
    n = len(mesh.points)
    path = tmp_path / "fields.nc"
    velocity = np.stack([np.full(n, 0.3), np.zeros(n)], axis=1)
    writer = FieldWriter(path, mesh)
    for k in range(3):
        writer.write(k, TIME[k], np.full(n, float(k)), velocity)
    writer.close()
    writer = FieldWriter(path, mesh, resume=True)
    writer.write(1, TIME[1], np.full(n, 10.0), velocity)
    writer.close()
    with xugrid.open_dataset(path) as data:
        levels = data["water_level"].values
        np.testing.assert_array_equal(levels[:, 0], [0.0, 10.0, 2.0])
        assert data.time.values[0] == np.datetime64("1998-01-01")
        speed = np.hypot(data["eastward_velocity"], data["northward_velocity"])
        np.testing.assert_allclose(speed.values, 0.3, rtol=1e-6)
    # Still a mesh file.
    again, _ = read_ugrid(path)
    np.testing.assert_array_equal(again.points, mesh.points)
    smaller = type(mesh)(mesh.points[:3], [[0, 1, 2]], mesh.depth[:3])
    with pytest.raises(InputError, match="another mesh"):
        FieldWriter(path, smaller, resume=True)
