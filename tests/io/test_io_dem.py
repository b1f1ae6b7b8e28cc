"""Rasters and soundings: known surfaces in every disguise, and every refusal."""

import gzip

import netCDF4
import numpy as np
import pytest
import rasterio
from rasterio.transform import from_origin

from tidemesh.errors import FormatError, InputError
from tidemesh.geometry.systems import from_degrees
from tidemesh.io.dem import read_raster, read_soundings

LON = np.arange(-82.0, -76.99, 0.25)
LAT = np.arange(31.0, 35.01, 0.25)


def plane(x, y):
    return -20.0 + 3.0 * (np.asarray(x) + 80.0) - 2.0 * (np.asarray(y) - 33.0)


def write_netcdf(
    path, *, lon=LON, lat=LAT, name="elevation", values=None, **attributes
):
    if values is None:
        values = plane(lon[None, :] - 360.0 * (lon[None, :] > 180), lat[:, None])
    with netCDF4.Dataset(path, "w") as file:
        file.createDimension("lat", len(lat))
        file.createDimension("lon", len(lon))
        y = file.createVariable("lat", "f8", ("lat",))
        x = file.createVariable("lon", "f8", ("lon",))
        y.units, x.units = "degrees_north", "degrees_east"
        y[:], x[:] = lat, lon
        fill = attributes.pop("_FillValue", None)
        dtype = attributes.pop("dtype", "f8")
        z = file.createVariable(name, dtype, ("lat", "lon"), fill_value=fill)
        z.setncatts({"units": "m"} | attributes)
        z[:] = values
    return path


def write_geotiff(path, values, transform, crs, **options):
    values = np.atleast_3d(np.asarray(values).T).T
    with rasterio.open(
        path,
        "w",
        driver="GTiff",
        height=values.shape[1],
        width=values.shape[2],
        count=len(values),
        dtype=values.dtype,
        transform=transform,
        crs=crs,
        **options,
    ) as file:
        file.write(values)
    return path


def is_plane(raster):
    return np.allclose(
        raster.elevation, plane(raster.x[None, :], raster.y[:, None]), atol=1e-4
    )


def test_every_orientation_of_the_axes_gives_the_same_raster(tmp_path):
    for number, (lon, lat) in enumerate(
        [(LON, LAT), (LON[::-1], LAT), (LON, LAT[::-1]), (LON + 360.0, LAT)]
    ):
        raster = read_raster(write_netcdf(tmp_path / f"{number}.nc", lon=lon, lat=lat))
        assert np.allclose(raster.x, LON)
        assert np.allclose(raster.y, LAT)
        assert raster.crs == "EPSG:4326"
        assert is_plane(raster)


def test_box_keeps_two_cells_around_it(tmp_path):
    path = write_netcdf(tmp_path / "a.nc")
    raster = read_raster(path, box_deg=(-80.3, 32.1, -79.1, 33.4))
    assert np.allclose(raster.x[[0, -1]], [-80.75, -78.75])
    assert np.allclose(raster.y[[0, -1]], [31.75, 33.75])
    assert is_plane(raster)


def test_box_over_the_cut_of_a_global_grid(tmp_path):
    lon = np.arange(0.0, 360.1, 1.0)
    values = np.where(lon > 180.0, lon - 360.0, lon)[None, :] + 0.0 * LAT[:, None]
    path = write_netcdf(tmp_path / "global.nc", lon=lon, values=values)
    raster = read_raster(path, box_deg=(-3.5, 32.0, 4.5, 34.0))
    assert np.allclose(raster.x, np.arange(-5.0, 6.1))
    assert np.allclose(raster.elevation, raster.x[None, :])
    assert np.allclose(read_raster(path).x, np.arange(0.0, 360.1))
    pacific = read_raster(path, box_deg=(175.0, 32.0, 185.0, 34.0))
    assert np.allclose(pacific.x, np.arange(173.0, 187.1))


def test_scale_offset_fill_value_and_units(tmp_path):
    values = np.ma.masked_array(plane(LON[None, :], LAT[:, None]))
    values[3, 4] = np.ma.masked
    raster = read_raster(
        write_netcdf(
            tmp_path / "packed.nc",
            values=values,
            dtype="i2",
            _FillValue=-32768,
            scale_factor=0.01,
            add_offset=-5.0,
        )
    )
    assert np.isnan(raster.elevation[3, 4])
    assert np.isfinite(raster.elevation).sum() == values.size - 1
    assert np.nanmax(np.abs(raster.elevation - values)) <= 0.0051
    feet = plane(LON[None, :], LAT[:, None]) / 0.3048
    assert is_plane(
        read_raster(write_netcdf(tmp_path / "ft.nc", values=feet, units="ft"))
    )


def test_fill_value_given_by_the_caller(tmp_path):
    values = plane(LON[None, :], LAT[:, None])
    values[0, :3] = -9999.0
    path = write_netcdf(tmp_path / "a.nc", values=values)
    assert np.isnan(read_raster(path, fill_value=-9999).elevation).sum() == 3


@pytest.mark.parametrize(
    ("name", "attributes"),
    [
        ("depth", {}),
        ("bathymetry", {"positive": "down"}),
        ("b", {"standard_name": "sea_floor_depth_below_geoid"}),
    ],
)
def test_depths_are_turned_into_elevations(tmp_path, name, attributes):
    values = -plane(LON[None, :], LAT[:, None])
    path = write_netcdf(tmp_path / "a.nc", name=name, values=values, **attributes)
    assert is_plane(read_raster(path))
    assert not is_plane(read_raster(path, positive="up"))
    assert is_plane(read_raster(path, positive="down"))


def test_projected_geotiff_and_its_crop(tmp_path):
    x, y = 500_000.0 + 1000.0 * np.arange(200), 3_700_000.0 - 1000.0 * np.arange(150)
    values = (0.001 * (x[None, :] - 6e5) + 0.002 * (y[:, None] - 3.6e6)).astype("f4")
    values[5, 5] = -9999.0
    path = write_geotiff(
        tmp_path / "utm.tif",
        values,
        from_origin(x[0] - 500.0, y[0] + 500.0, 1000.0, 1000.0),
        "EPSG:32617",
        nodata=-9999.0,
    )
    raster = read_raster(path)
    assert raster.crs == "EPSG:32617"
    assert np.allclose(raster.x, x)
    assert np.allclose(raster.y, y[::-1])
    assert np.isnan(raster.elevation[-6, 5])
    part = read_raster(path, box_deg=(-80.5, 32.5, -80.0, 33.0))
    west_south = from_degrees(raster.crs, -80.5, 32.5)
    assert part.elevation.size < raster.elevation.size / 4
    assert part.x[0] < west_south[0] - 1000.0
    expected = 0.001 * (part.x[None, :] - 6e5) + 0.002 * (part.y[:, None] - 3.6e6)
    assert np.allclose(part.elevation, expected, atol=1e-3)


def test_bare_plane(tmp_path):
    path = write_geotiff(
        tmp_path / "plane.tif",
        np.ones((20, 30), "f4"),
        from_origin(0.0, 20_000.0, 1000.0, 1000.0),
        None,
    )
    assert read_raster(path, crs="plane").crs == ""
    with pytest.raises(InputError, match="names no coordinate system"):
        read_raster(path)


def test_which_variable(tmp_path):
    path = write_netcdf(tmp_path / "a.nc", name="first")
    with netCDF4.Dataset(path, "a") as file:
        file.createVariable("second", "f4", ("lat", "lon"))[:] = -7.0
        flags = file.createVariable("origin", "i1", ("lat", "lon"))
        flags.flag_values = np.array([0, 1], "i1")
        file.createVariable("loose", "f4", ("lon",))
    with pytest.raises(InputError, match=r"Name one of: first, second$"):
        read_raster(path)
    assert (read_raster(path, variable="second").elevation == -7.0).all()
    with pytest.raises(InputError, match=r'no variable "third".*first, second'):
        read_raster(path, variable="third")
    with pytest.raises(InputError, match="not on two one-dimensional axes"):
        read_raster(path, variable="loose")


def test_refused_rasters(tmp_path):
    with pytest.raises(InputError, match="no such file"):
        read_raster(tmp_path / "none.nc")
    text = tmp_path / "text.tif"
    text.write_text("no raster")
    with pytest.raises(InputError, match="cannot be read as a raster"):
        read_raster(text)
    cut = tmp_path / "cut.nc"
    cut.write_bytes(write_netcdf(tmp_path / "a.nc").read_bytes()[:3000])
    with pytest.raises(InputError, match=r"cut\.nc: cannot be read"):
        read_raster(cut)
    with pytest.raises(InputError, match=r"does not overlap.*-82 to -77.*10 to 12"):
        read_raster(tmp_path / "a.nc", box_deg=(10.0, 31.0, 12.0, 33.0))
    with pytest.raises(InputError, match="is not known"):
        read_raster(tmp_path / "a.nc", crs="EPSG:123456")
    with pytest.raises(InputError, match='in "degc", not in a unit of length'):
        read_raster(write_netcdf(tmp_path / "b.nc", units="degC"))
    empty = write_netcdf(
        tmp_path / "e.nc", values=np.full((len(LAT), len(LON)), np.nan)
    )
    with pytest.raises(InputError, match="not one known value"):
        read_raster(empty)
    unordered = LON.copy()
    unordered[4] = -70.0
    with pytest.raises(InputError, match=r"x axis is not in order.*index 5"):
        read_raster(write_netcdf(tmp_path / "u.nc", lon=unordered))
    with pytest.raises(InputError, match="no longitudes and latitudes"):
        read_raster(write_netcdf(tmp_path / "m.nc", lon=LON * 1e4), crs="EPSG:4326")


def test_refused_geotiffs(tmp_path):
    values = np.ones((10, 10), "f4")
    turned = from_origin(5e5, 3.7e6, 1e3, 1e3) @ rasterio.Affine.rotation(10.0)
    path = write_geotiff(tmp_path / "turned.tif", values, turned, "EPSG:32617")
    with pytest.raises(InputError, match="rotated"):
        read_raster(path)
    square = from_origin(-80.0, 33.0, 0.1, 0.1)
    two = write_geotiff(
        tmp_path / "two.tif", np.stack([values, 2 * values]), square, "EPSG:4326"
    )
    with pytest.raises(InputError, match="name one of its bands as variable: 1, 2"):
        read_raster(two)
    assert (read_raster(two, variable="2").elevation == 2.0).all()


def test_soundings(tmp_path):
    path = tmp_path / "s.csv"
    path.write_text("# survey\nname,Lon,Lat,Depth_m\na,-80,33,5\nb,279.5,32,7.5\n")
    soundings = read_soundings(path)
    assert soundings.crs == "EPSG:4326"
    assert np.allclose(soundings.points, [[-80.0, 33.0], [-80.5, 32.0]])
    assert np.allclose(soundings.elevation, [-5.0, -7.5])
    packed = tmp_path / "s.csv.gz"
    packed.write_bytes(gzip.compress(path.read_bytes()))
    assert np.array_equal(read_soundings(packed).points, soundings.points)
    inside = read_soundings(path, box_deg=(-80.1, 32.5, -79.0, 34.0))
    assert np.allclose(inside.elevation, [-5.0])
    blanks = tmp_path / "s.txt"
    blanks.write_text("x y z\n1000 2000 -3\n4000 5000 -99\n")
    plain = read_soundings(blanks, crs="plane", fill_value=-99.0)
    assert np.allclose(plain.points, [[1000.0, 2000.0]])


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "the file is empty"),
        ("lon,lat,depth\n", "no soundings"),
        ("-80,33,5\n", "line 1: expected a header line"),
        ("lon,lat,depth\n-80,33,5\n-80,,6\n", "line 3: .*column 2, came nothing"),
        ("lon,lat,depth\n-80,33,5\n\n-80,32,x\n", 'line 4: .*column 3, came "x"'),
        ("lon,lat,depth\n-80,33\n", "line 2: .*column 3, came nothing"),
        ("lon,depth\n-80,33\n", 'no column "lat"'),
        ("lon,lat,depth,elevation\n-80,33,1,-1\n", "which column"),
        ("lon,lat,depth\n500000,3600000,1\n", "no longitude and latitude"),
        ("lon,lat,depth\n-80,33,nan\n", "not one known depth"),
    ],
)
def test_refused_soundings(tmp_path, text, message):
    path = tmp_path / "s.csv"
    path.write_text(text)
    with pytest.raises(InputError, match=message) as caught:
        read_soundings(path)
    assert "s.csv" in str(caught.value)
    if "line" in message:
        assert isinstance(caught.value, FormatError)


def test_geotiff_in_feet_with_scale(tmp_path):
    path = write_geotiff(
        tmp_path / "feet.tif",
        np.full((6, 8), -1000, "i2"),
        from_origin(-80.0, 33.0, 0.1, 0.1),
        "EPSG:4326",
    )
    with rasterio.open(path, "r+") as file:
        file.units = ["ft"]
        file.scales = [0.1]
        file.offsets = [2.0]
    assert np.allclose(read_raster(path).elevation, -98.0 * 0.3048)


def test_more_cells_than_memory_are_refused(tmp_path):
    path = tmp_path / "huge.nc"
    with netCDF4.Dataset(path, "w") as file:
        for name, unit, count, last in (
            ("lat", "degrees_north", 12_000, 40.0),
            ("lon", "degrees_east", 12_000, 50.0),
        ):
            file.createDimension(name, count)
            axis = file.createVariable(name, "f8", (name,))
            axis.units = unit
            axis[:] = np.linspace(0.0, last, count)
        file.createVariable("elevation", "i2", ("lat", "lon"), chunksizes=(100, 100))
    with pytest.raises(InputError, match=r"12000 x 12000 cells.*gdalwarp"):
        read_raster(path)
