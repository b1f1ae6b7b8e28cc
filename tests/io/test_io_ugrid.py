import time
from dataclasses import replace

import netCDF4
import numpy as np
import pytest
from io_meshes import assert_same_strings, small_mesh

from tidemesh.datatypes import BoundaryString
from tidemesh.errors import FormatError, InputError
from tidemesh.geometry.projection import Projection
from tidemesh.io.ugrid import Field, read_ugrid, write_ugrid

STEREOGRAPHIC = Projection.stereographic(-79.0, 33.0)
PROJECTIONS = [Projection(), STEREOGRAPHIC, Projection("EPSG:32617")]


def fields_of(mesh):
    rng = np.random.default_rng(0)
    n, m = len(mesh.points), len(mesh.triangles)
    tide = rng.normal(size=n) + 1j * rng.normal(size=n)
    tide[:3] = [0.0, 1.0, np.nan]
    gaps = np.where(np.arange(n) % 3 == 0, np.nan, rng.normal(size=n))
    return [
        Field("elevation_M2", tide, "m", "M2 elevation"),
        Field("error", gaps, "m s-2", "truncation error"),
        Field("known", gaps > 0.0, "1", "where the estimator is defined"),
        Field("level", np.arange(m), "1", "level in the hierarchy"),
    ]


@pytest.mark.parametrize("projection", PROJECTIONS)
def test_everything_comes_back(tmp_path, projection):
    mesh = small_mesh(projection)
    fields = fields_of(mesh)
    write_ugrid(tmp_path / "mesh.nc", mesh, fields, title="a title")
    read, found = read_ugrid(tmp_path / "mesh.nc")
    assert np.array_equal(read.points, mesh.points)
    assert np.array_equal(read.triangles, mesh.triangles)
    assert np.array_equal(read.depth, mesh.depth)
    assert read.projection == mesh.projection
    assert_same_strings(read.boundaries, mesh.boundaries)
    assert list(found) == [field.name for field in fields]
    for field in fields:
        have = found[field.name]
        assert (have.units, have.long_name) == (field.units, field.long_name)
        assert have.values.dtype == field.values.dtype
        assert have.location == ("face" if field.name == "level" else "node")
        if np.iscomplexobj(field.values):
            assert have.values == pytest.approx(field.values, abs=1e-15, nan_ok=True)
        else:
            assert np.array_equal(have.values, field.values, equal_nan=True)


def test_further_attributes_come_back(tmp_path):
    mesh = small_mesh(STEREOGRAPHIC)
    tide = np.full(len(mesh.points), 1.0 - 0.5j)
    speed = {"angular_frequency": 1.405189e-4}
    field = Field("eta", tide, "m", "elevation", attributes=speed)
    plain = Field("level", tide.real, "1", "level", attributes={"comment": "none"})
    write_ugrid(tmp_path / "a.nc", mesh, [field, plain])
    _, found = read_ugrid(tmp_path / "a.nc")
    assert found["eta"].attributes == speed
    assert found["level"].attributes == {"comment": "none"}


def test_complex_fields_are_amplitude_and_greenwich_lag(tmp_path):
    mesh = small_mesh(STEREOGRAPHIC)
    lag = np.linspace(0.0, 359.0, 25)
    tide = 0.5 * np.exp(-1j * np.radians(lag))
    write_ugrid(tmp_path / "a.nc", mesh, [Field("eta", tide, "m", "elevation", "x")])
    with netCDF4.Dataset(tmp_path / "a.nc") as file:
        file.set_auto_mask(False)
        assert file["eta_amplitude"][:] == pytest.approx(np.full(25, 0.5))
        assert file["eta_phase"][:] == pytest.approx(lag)
        assert file["eta_phase"].units == "degree"
        assert file["eta_amplitude"].standard_name == "x_amplitude"
    tiny = np.full(25, 1.0 + 1e-18j)
    write_ugrid(tmp_path / "a.nc", mesh, [Field("eta", tiny, "m", "elevation")])
    with netCDF4.Dataset(tmp_path / "a.nc") as file:
        assert (file["eta_phase"][:] == 0.0).all()


def test_conventions_and_meaning(tmp_path):
    mesh = small_mesh(STEREOGRAPHIC)
    write_ugrid(tmp_path / "a.nc", mesh)
    with netCDF4.Dataset(tmp_path / "a.nc") as file:
        assert file.Conventions == "CF-1.11 UGRID-1.0"
        names = [*file.ncattrs(), *file.variables]
        assert not any("date" in name or "history" in name for name in names)
        topology = file["mesh2d"]
        assert topology.cf_role == "mesh_topology"
        lon, lat = (file[name] for name in topology.node_coordinates.split())
        assert (lon.standard_name, lat.units) == ("longitude", "degrees_north")
        place = STEREOGRAPHIC.inverse(mesh.points)
        assert np.array_equal(np.stack([lon[:], lat[:]], axis=1), place)
        faces = file[topology.face_node_connectivity]
        assert faces.start_index == 0
        assert np.array_equal(faces[:], mesh.triangles)
        depth = file["depth"]
        assert depth.standard_name == "sea_floor_depth_below_geoid"
        assert depth.positive == "down"
        assert depth.grid_mapping in file.variables
        assert depth.filters()["zlib"]
        kind = file["boundary_kind"]
        assert kind.flag_meanings == "none open mainland island"
        # Shared ends count as open.
        assert kind[:].tolist()[:10] == [1, 1, 1, 1, 1, 2, 0, 3, 3, 2]
        assert file["projection"].grid_mapping_name == "stereographic"


def test_same_mesh_same_bytes(tmp_path):
    mesh = small_mesh(STEREOGRAPHIC)
    write_ugrid(tmp_path / "a.nc", mesh, fields_of(mesh))
    # The clock of the file format ticks in seconds.
    time.sleep(1.01)
    write_ugrid(tmp_path / "b.nc", mesh, fields_of(mesh))
    assert (tmp_path / "a.nc").read_bytes() == (tmp_path / "b.nc").read_bytes()


def test_no_strings_and_strings_with_further_columns(tmp_path):
    mesh = replace(small_mesh(), boundaries=())
    write_ugrid(tmp_path / "a.nc", mesh)
    assert read_ugrid(tmp_path / "a.nc")[0].boundaries == ()
    extra = np.array([[12.0, 2.5, 1.0, 1.0], [13.0, 2.75, 1.0, 0.5]])
    strings = (
        BoundaryString("open", [0, 1, 2, 3, 4]),
        BoundaryString("island", [7, 8], ibtype=24, extra=extra),
    )
    write_ugrid(tmp_path / "a.nc", replace(mesh, boundaries=strings))
    assert_same_strings(read_ugrid(tmp_path / "a.nc")[0].boundaries, strings)


@pytest.mark.parametrize("projection", PROJECTIONS)
def test_opens_in_xarray_and_xugrid(tmp_path, projection):
    xarray = pytest.importorskip("xarray")
    xugrid = pytest.importorskip("xugrid")
    mesh = small_mesh(projection)
    write_ugrid(tmp_path / "a.nc", mesh, fields_of(mesh))
    with xarray.open_dataset(tmp_path / "a.nc") as plain:
        assert np.array_equal(plain["depth"], mesh.depth)
        assert plain["error"].isnull().sum() == 9
    with xugrid.open_dataset(tmp_path / "a.nc") as opened:
        grid = opened.ugrid.grid
        assert (grid.n_node, grid.n_face) == (25, 30)
        assert np.array_equal(grid.face_node_connectivity, mesh.triangles)
        place = projection.inverse(mesh.points)
        assert np.array_equal(grid.node_coordinates, place)
        assert opened["depth"].dims == (grid.node_dimension,)
        assert opened["level"].dims == (grid.face_dimension,)


def foreign(path, depth_on="nodes", **changes):
    """A mesh as another program may write it: 1-based, degrees only, 3 by n faces."""
    with netCDF4.Dataset(path, "w") as file:
        file.createDimension("nodes", 4)
        file.createDimension("cells", 2)
        file.createDimension("three", 3)
        topology = file.createVariable("grid", "i4")
        topology.setncatts(
            {
                "cf_role": "mesh_topology",
                "topology_dimension": 2,
                "node_coordinates": "lon lat",
                "face_node_connectivity": "faces",
                "face_dimension": "cells",
            }
            | changes
        )
        for name, word, values in [
            ("lon", "longitude", [280.0, 281.0, 281.0, 280.0]),
            ("lat", "latitude", [33.0, 33.0, 34.0, 34.0]),
        ]:
            variable = file.createVariable(name, "f8", ("nodes",))
            variable.standard_name = word
            variable[:] = values
        faces = file.createVariable("faces", "i4", ("three", "cells"))
        faces.start_index = 1
        faces[:] = np.array([[1, 2, 3], [1, 3, 4]]).T
        depth = file.createVariable("h", "f4", (depth_on,), fill_value=-999.0)
        depth.standard_name = "sea_floor_depth_below_geoid"
        depth[:] = [1, 2, 3, -999][: len(file.dimensions[depth_on])]
    return path


def test_a_file_of_another_maker(tmp_path):
    mesh, fields = read_ugrid(foreign(tmp_path / "a.nc"))
    assert mesh.triangles.tolist() == [[0, 1, 2], [0, 2, 3]]
    assert np.array_equal(mesh.depth, [1.0, 2.0, 3.0, np.nan], equal_nan=True)
    assert "+lon_0=-79.5" in mesh.projection.crs
    back = mesh.projection.inverse(mesh.points)
    assert back[:, 0] == pytest.approx([-80.0, -79.0, -79.0, -80.0])
    assert fields == {}


def test_files_that_cannot_be_read(tmp_path):
    with pytest.raises(InputError, match=r"none\.nc: there is no such file"):
        read_ugrid(tmp_path / "none.nc")
    (tmp_path / "text.nc").write_text("no")
    with pytest.raises(FormatError, match="not a NetCDF file"):
        read_ugrid(tmp_path / "text.nc")
    with pytest.raises(FormatError, match="no two-dimensional mesh"):
        read_ugrid(foreign(tmp_path / "a.nc", cf_role="other"))
    with pytest.raises(FormatError, match='a variable "cells_" that is missing'):
        read_ugrid(foreign(tmp_path / "a.nc", face_node_connectivity="cells_"))
    with pytest.raises(FormatError, match=r"shape \(2,\); expected one depth for each"):
        read_ugrid(foreign(tmp_path / "a.nc", depth_on="cells"))
    with pytest.raises(FormatError, match="no node coordinates"):
        read_ugrid(foreign(tmp_path / "a.nc", node_coordinates="a"))


def test_wrong_fields_and_places(tmp_path):
    mesh = small_mesh()
    path = tmp_path / "a.nc"
    with pytest.raises(
        ValueError, match=r'"a" must have 25 values .* got shape \(3,\)'
    ):
        write_ugrid(path, mesh, [Field("a", np.zeros(3), "m", "a")])
    with pytest.raises(ValueError, match='already a variable of the name "depth"'):
        write_ugrid(path, mesh, [Field("depth", np.zeros(25), "m", "a")])
    assert not list(tmp_path.iterdir())
    with pytest.raises(InputError, match="does not exist; create it"):
        write_ugrid(tmp_path / "none" / "a.nc", mesh)


def test_no_byte_sized_data_on_nodes(tmp_path):
    """QGIS 3.22 refuses the whole file otherwise (seen with its mesh layer)."""
    write_ugrid(tmp_path / "mesh.nc", small_mesh())
    with netCDF4.Dataset(tmp_path / "mesh.nc") as file:
        on_mesh = [v for v in file.variables.values() if "mesh" in v.ncattrs()]
        assert {"depth", "boundary_kind"} <= {v.name for v in on_mesh}
        assert all(v.dtype.itemsize >= 4 for v in on_mesh)
