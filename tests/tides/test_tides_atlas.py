"""Tide atlases written in the formats of their makers, read back at the ocean nodes."""

import gzip
import importlib.util
import sys

import netCDF4
import numpy as np
import pyproj
import pytest
from numpy.testing import assert_allclose

from tidemesh.constants import frequency
from tidemesh.datatypes import BoundaryString, CoastalMesh
from tidemesh.errors import EngineError, FormatError, InputError
from tidemesh.geometry.projection import Projection
from tidemesh.tides.astronomy import prediction_basis
from tidemesh.tides.atlas import atlas_forcing, atlas_names

TPXO = "TPXO9-atlas-v5-nc"
LAND_WEST_OF = -80.3


needs_library = pytest.mark.skipif(
    importlib.util.find_spec("pyTMD") is None, reason="pyTMD is not installed"
)


def mesh_with_ocean(longitude, latitude):
    """A mesh in name only: forcing looks at its open nodes alone."""
    projection = Projection.stereographic(float(longitude[0]), float(latitude[0]))
    points = projection.forward(longitude, latitude)
    return CoastalMesh(
        points,
        np.empty((0, 3), dtype=int),
        np.ones(len(points)),
        (BoundaryString("open", np.arange(len(points))),),
        projection,
    )


OFFSHORE = np.linspace(-79.7, -78.3, 23), np.linspace(31.8, 33.1, 23)


def wave(longitude, latitude):
    """A smooth tide (m); its Greenwich lag passes through 0 = 360 degrees."""
    lag = np.radians(3.0 * (longitude + 79.0) - 2.0 * (latitude - 32.5))
    return (0.6 + 0.05 * (latitude - 32.5)) * np.exp(-1j * lag)


def grid(step=0.25, west=275.0, east=287.0):
    """Longitudes (0 .. 360), latitudes, and the tide (n_lat, n_lon), zero on land."""
    lon, lat = np.arange(west, east, step), np.arange(28.0, 37.0, step)
    east_west = np.where(lon > 180.0, lon - 360.0, lon)
    tide = wave(*np.meshgrid(east_west, lat))
    return lon, lat, np.where(east_west < LAND_WEST_OF, 0.0, tide)


def write_amplitude_phase(path, lon, lat, tide, constituent):
    """GOT and FES: amplitude (cm) and Greenwich lag (degrees) on (lat, lon)."""
    path.parent.mkdir(parents=True, exist_ok=True)
    land = tide == 0.0
    with netCDF4.Dataset(path, "w") as file:
        file.Constituent = constituent
        file.createDimension("lon", len(lon))
        file.createDimension("lat", len(lat))
        # GOT names its coordinates in full, FES like the dimensions.
        for dimension, names, values in (
            ("lon", ("lon", "longitude"), lon),
            ("lat", ("lat", "latitude"), lat),
        ):
            for name in names if "GOT" not in str(path) else names[1:]:
                file.createVariable(name, "f8", (dimension,))[:] = values
        for name, unit, values in (
            ("amplitude", "cm", 100.0 * np.abs(tide)),
            ("phase", "degrees", np.degrees(-np.angle(tide)) % 360.0),
        ):
            variable = file.createVariable(
                name, "f4", ("lat", "lon"), fill_value=np.float32(999.0)
            )
            variable.units = unit
            variable[:] = np.ma.masked_array(values, land)


def write_got(folder, *constituents, **kwargs):
    for name in constituents:
        path = folder / "GOT5.5" / "ocean_tides" / f"{name}.nc"
        write_amplitude_phase(path, *grid(**kwargs), name.upper())


def write_fes(folder, *constituents, **kwargs):
    for name in constituents:
        path = folder / "fes2014" / "ocean_tide" / f"{name}.nc"
        write_amplitude_phase(path, *grid(**kwargs), name)


def write_tpxo(folder, *constituents):
    """TPXO: real and imaginary part (whole mm) on (nx, ny), zero on land."""
    lon, lat, tide = grid()
    folder = folder / "TPXO9_atlas_v5"
    folder.mkdir(parents=True)
    for name in ("grid", *constituents):
        stem = "grid_tpxo9_atlas" if name == "grid" else f"h_{name}_tpxo9_atlas"
        with netCDF4.Dataset(folder / f"{stem}_30_v5.nc", "w") as file:
            file.createDimension("nx", len(lon))
            file.createDimension("ny", len(lat))
            file.createDimension("nct", 4)
            file.createVariable("lon_z", "f8", ("nx",))[:] = lon
            file.createVariable("lat_z", "f8", ("ny",))[:] = lat
            if name == "grid":
                depth = file.createVariable("hz", "f4", ("nx", "ny"))
                depth.units = "meter"
                depth[:] = np.where(tide == 0.0, 0.0, 50.0).T
                continue
            letters = np.array(list(name.ljust(4)), dtype="S1")
            file.createVariable("con", "S1", ("nct",))[:] = letters
            for part, values in (("hRe", tide.real), ("hIm", tide.imag)):
                variable = file.createVariable(part, "i4", ("nx", "ny"))
                variable.units = "millimeter"
                variable[:] = np.rint(1000.0 * values).T


def record(*arrays):
    """One record of a big-endian unformatted Fortran file."""
    body = b"".join(np.asarray(a).tobytes() for a in arrays)
    length = np.array(len(body), ">i4").tobytes()
    return length + body + length


def write_otis(folder, x, y, tides):
    """A regional model of the TPXO family: all constituents in one file (m), and grid.

    `x`, `y` are km on the map of CATS2008.
    """
    half = 0.5 * (x[1] - x[0])
    limits = np.array([y[0] - half, y[-1] + half, x[0] - half, x[-1] + half], ">f4")
    shape = np.array([len(x), len(y)], ">i4")
    sea = np.ones((len(y), len(x)))
    names = "".join(name.ljust(4) for name in tides).encode()
    folder = folder / "CATS2008"
    folder.mkdir()
    with open(folder / "grid_CATS2008", "wb") as file:
        file.write(record(shape, limits, np.array(12.0, ">f4"), np.array(0, ">i4")))
        file.write(record(np.array(0, ">i4")))
        file.write(record((100.0 * sea).astype(">f4")))
        file.write(record(sea.astype(">i4")))
    with open(folder / "hf.CATS2008.out", "wb") as file:
        header = shape, np.array(len(tides), ">i4"), limits, np.frombuffer(names, "S1")
        file.write(record(*header))
        for tide in tides.values():
            file.write(record(np.stack([tide.real, tide.imag], axis=-1).astype(">f4")))


@needs_library
def test_one_file_on_the_map_of_a_polar_model(tmp_path):
    x, y = np.arange(900.0, 1800.0, 20.0), np.arange(300.0, 1200.0, 20.0)
    grid_x, grid_y = np.meshgrid(x, y)
    tides = {"m2": 0.3 + 1e-4j * grid_x, "k1": 0.5 - 1e-4 * grid_y + 0.1j}
    write_otis(tmp_path, x, y, tides)
    cats = "+proj=stere +lat_0=-90 +lat_ts=-71 +lon_0=-70 +units=km +datum=WGS84"
    node_x, node_y = np.linspace(1200.0, 1500.0, 11), np.linspace(900.0, 500.0, 11)
    longitude, latitude = pyproj.Proj(cats)(node_x, node_y, inverse=True)
    mesh = mesh_with_ocean(np.array(longitude), np.array(latitude))
    forcing = atlas_forcing(mesh, ["K1", "M2"], tmp_path, "CATS2008")
    expected = 0.5 - 1e-4 * node_y + 0.1j, 0.3 + 1e-4j * node_x
    assert_allclose(forcing.elevation, expected, atol=1e-5)
    with pytest.raises(InputError, match="CATS2008 has no N2; it has K1, M2"):
        atlas_forcing(mesh, ["N2"], tmp_path, "CATS2008")
    with pytest.raises(InputError, match=r"M1 .* is another tidal line than NOAA's M1"):
        atlas_forcing(mesh, ["M1"], tmp_path, "CATS2008")


@needs_library
def test_got(tmp_path):
    write_got(tmp_path, "m2", "q1", "sig1")
    mesh = mesh_with_ocean(*OFFSHORE)
    forcing = atlas_forcing(mesh, ["Q1", "m2", "SIG1"], tmp_path, "GOT5.5")
    assert forcing.names == ("Q1", "m2", "SIG1")
    assert_allclose(forcing.frequency[:2], [frequency("Q1"), frequency("M2")])
    assert_allclose(forcing.elevation, [wave(*OFFSHORE)] * 3, atol=1e-4)
    assert_allclose(forcing.nodes, mesh.open_nodes)
    assert forcing.nodal_factor is None


@needs_library
def test_fes_in_the_folder_of_the_files_themselves(tmp_path):
    write_fes(tmp_path, "m2", "la2")
    mesh = mesh_with_ocean(*OFFSHORE)
    folder = tmp_path / "fes2014" / "ocean_tide"
    forcing = atlas_forcing(mesh, ["M2", "LAM2"], folder, "FES2014")
    assert_allclose(forcing.elevation, [wave(*OFFSHORE)] * 2, atol=1e-4)


@needs_library
def test_a_packed_file_is_read_or_to_be_unpacked(tmp_path):
    write_fes(tmp_path, "m2")
    path = tmp_path / "fes2014" / "ocean_tide" / "m2.nc"
    path.with_name("m2.nc.gz").write_bytes(gzip.compress(path.read_bytes()))
    path.unlink()
    mesh = mesh_with_ocean(*OFFSHORE)
    if importlib.util.find_spec("h5py"):
        forcing = atlas_forcing(mesh, ["M2"], tmp_path, "FES2014")
        assert_allclose(forcing.elevation, [wave(*OFFSHORE)], atol=1e-4)
    else:
        with pytest.raises(InputError, match=r"m2\.nc\.gz cannot be .*: unpack it"):
            atlas_forcing(mesh, ["M2"], tmp_path, "FES2014")


@needs_library
def test_tpxo(tmp_path):
    write_tpxo(tmp_path, "m2", "n2")
    forcing = atlas_forcing(mesh_with_ocean(*OFFSHORE), ["M2", "N2"], tmp_path, TPXO)
    # Whole millimetres.
    assert_allclose(forcing.elevation, [wave(*OFFSHORE)] * 2, atol=8e-4)


@needs_library
def test_finer_atlases_are_nearer_at_second_order(tmp_path):
    errors = []
    for step in (1.0, 0.5, 0.25):
        write_got(tmp_path / str(step), "m2", step=step)
        forcing = atlas_forcing(
            mesh_with_ocean(*OFFSHORE),
            ["M2"],
            tmp_path / str(step),
            "GOT5.5",
            max_distance_m=100e3,
        )
        errors.append(np.abs(forcing.elevation[0] - wave(*OFFSHORE)).max())
    assert np.log2(errors[0] / errors[2]) / 2.0 > 1.6


@needs_library
def test_nodes_on_the_land_of_the_atlas_take_the_nearest_sea(tmp_path):
    write_tpxo(tmp_path, "m2")
    ashore = np.linspace(-80.7, -79.7, 9), np.full(9, 32.3)
    forcing = atlas_forcing(mesh_with_ocean(*ashore), ["M2"], tmp_path, TPXO)
    edge = np.maximum(ashore[0], -80.25)
    # Constant beyond the last sea point, and without a jump at it.
    assert_allclose(forcing.elevation[0], wave(edge, ashore[1]), atol=5e-3)
    with pytest.raises(InputError, match=r"too far .* more than 20 km"):
        atlas_forcing(
            mesh_with_ocean(*ashore), ["M2"], tmp_path, TPXO, max_distance_m=20e3
        )


@needs_library
@pytest.mark.parametrize("centre", [0.0, 180.0])
def test_across_the_seam_of_the_longitudes(tmp_path, centre):
    lon, lat = np.arange(0.0, 360.0, 0.5), np.arange(-5.0, 5.1, 0.5)

    def smooth(longitude, latitude):
        return np.exp(-1j * np.radians(longitude)) * (1.0 + 0.1 * latitude)

    tide = smooth(*np.meshgrid(lon, lat))
    write_amplitude_phase(
        tmp_path / "GOT5.5" / "ocean_tides" / "m2.nc", lon, lat, tide, "M2"
    )
    ocean = centre + np.linspace(-0.9, 0.9, 13), np.linspace(-1.0, 1.0, 13)
    mesh = mesh_with_ocean(*ocean)
    forcing = atlas_forcing(mesh, ["M2"], tmp_path, "GOT5.5")
    assert_allclose(forcing.elevation[0], smooth(*ocean), atol=1e-4)


@needs_library
@pytest.mark.filterwarnings("ignore::UserWarning")
@pytest.mark.parametrize(
    ("write", "model", "ours", "theirs"),
    [
        (write_tpxo, TPXO, "M2", "m2"),
        (write_got, "GOT5.5", "S1", "s1"),
        (write_fes, "FES2014", "M2", "m2"),
        (write_fes, "FES2014", "SA", "sa"),
        (write_fes, "FES2014", "M3", "m3"),
    ],
)
def test_phases_count_from_the_arguments_of_the_prediction(
    tmp_path, write, model, ours, theirs
):
    # The level that pyTMD predicts from the atlas's own constants.
    import pyTMD.io
    import pyTMD.predict

    write(tmp_path, theirs)
    description = pyTMD.io.model(tmp_path, verify=False).from_database(model, "z")
    files = description.z.model_file
    description.z.model_file = [f for f in files if f.exists()]
    data = description.open_dataset(group="z")
    column = int(np.abs(data.x.values - 281.25).argmin())
    row = int(np.abs(data.y.values - 32.75).argmin())
    node = data.isel(x=column, y=row)
    days = np.arange(10.0, 390.0, 3.7)
    theirs_level = (
        pyTMD.predict.time_series(days, node, corrections=description.corrections)
        .to_numpy()
        .ravel()
    )
    at = np.array([-78.75]), np.array([32.75])
    forcing = atlas_forcing(mesh_with_ocean(*at), [ours], tmp_path, model)
    time = 694224000.0 + 86400.0 * days
    level = (forcing.elevation[0, 0] * prediction_basis([ours], time, 45.0)[0]).real
    assert np.abs(theirs_level).max() > 0.5
    assert_allclose(level, theirs_level, atol=8e-3)


@needs_library
def test_names_of_the_atlases():
    names = atlas_names()
    assert {TPXO, "FES2014", "FES2022", "GOT5.5", "EOT20", "TPXO9.1"} <= set(names)
    assert not any("load" in name or "SAL" in name for name in names)


@needs_library
def test_what_is_missing_is_named(tmp_path):
    mesh = mesh_with_ocean(*OFFSHORE)
    write_got(tmp_path, "m2")
    with pytest.raises(InputError, match=r'"GOT5.4" is not known; nearest: .*GOT5\.5'):
        atlas_forcing(mesh, ["M2"], tmp_path, "GOT5.4")
    with pytest.raises(InputError, match=r"nowhere, does not exist"):
        atlas_forcing(mesh, ["M2"], tmp_path / "nowhere", "GOT5.5")
    with pytest.raises(InputError, match=r"no file GOT5\.5/ocean_tides/k1\.nc in "):
        atlas_forcing(mesh, ["M2", "K1"], tmp_path, "GOT5.5")
    with pytest.raises(InputError, match=r"GOT5\.5 has no L2; it has .*M2"):
        atlas_forcing(mesh, ["L2"], tmp_path, "GOT5.5")
    with pytest.raises(InputError, match=r"has no M6; it has"):
        atlas_forcing(mesh, ["M6"], tmp_path, "GOT5.5")
    with pytest.raises(InputError, match=r'"XX" is not known'):
        atlas_forcing(mesh, ["XX"], tmp_path, "GOT5.5")
    write_tpxo(tmp_path, "s1")
    with pytest.raises(InputError, match="disagree on where the phase of S1 counts"):
        atlas_forcing(mesh, ["S1"], tmp_path, TPXO)
    far = mesh_with_ocean(OFFSHORE[0] + 90.0, OFFSHORE[1])
    with pytest.raises(InputError, match=r"no sea within 50 km of the ocean boundary"):
        atlas_forcing(far, ["M2"], tmp_path, "GOT5.5")


@needs_library
def test_a_file_that_is_not_what_its_name_says(tmp_path):
    write_fes(tmp_path, "m2")
    path = tmp_path / "fes2014" / "ocean_tide" / "m2.nc"
    mesh = mesh_with_ocean(*OFFSHORE)
    path.write_bytes(path.read_bytes()[:300])
    with pytest.raises(
        FormatError, match=r"m2\.nc: is not a file of the atlas FES2014"
    ):
        atlas_forcing(mesh, ["M2"], tmp_path, "FES2014")
    with netCDF4.Dataset(path, "w") as file:
        file.createDimension("lon", 3)
        file.createVariable("tide", "f4", ("lon",))
    with pytest.raises(
        FormatError, match=r"m2\.nc: is not a file of the atlas FES2014"
    ):
        atlas_forcing(mesh, ["M2"], tmp_path, "FES2014")


def test_meshes_that_cannot_be_forced(tmp_path):
    write_got(tmp_path, "m2")
    plane = CoastalMesh([[0, 0], [1, 0], [0, 1]], [[0, 1, 2]], np.ones(3))
    with pytest.raises(EngineError, match="no open"):
        atlas_forcing(plane, ["M2"], tmp_path, "GOT5.5")
    plane = CoastalMesh(
        plane.points, plane.triangles, plane.depth, (BoundaryString("open", [0, 1]),)
    )
    with pytest.raises(InputError, match="bare plane"):
        atlas_forcing(plane, ["M2"], tmp_path, "GOT5.5")


def test_without_the_library(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "pyTMD", None)
    with pytest.raises(InputError, match=r'pip install "tidemesh\[atlas\]"'):
        atlas_forcing(mesh_with_ocean(*OFFSHORE), ["M2"], tmp_path, "GOT5.5")
