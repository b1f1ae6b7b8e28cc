"""ADCIRC's harmonic constants."""

import gzip
from pathlib import Path

import netCDF4
import numpy as np
import pytest
from numpy.testing import assert_allclose

from tidemesh.datatypes import TideSolution
from tidemesh.errors import FormatError, InputError
from tidemesh.io.fort53 import (
    read_fort51,
    read_fort52,
    read_fort53,
    read_fort54,
    require_nodes,
    write_fort53,
    write_fort54,
)

ELEVATION = """\
           2
     0.0000000000E+00  1.0000000   0.00000000  STEADY
     0.1405257000E-03  1.1000000  90.00000000  M2
           2
           1
  -1.00000000E-001      0.0000
   2.00000000E+000     90.0000
           2
   3.00000000-101      0.0000
  -9.99990000E+004 -99999.0000
"""

VELOCITY = """\
 1
 1.4E-4 1.0 0.0 M2
 2
 1
 1.0 0.0 2.0 180.0
 2
 0.5 270.0 0.0 0.0   trailing text
"""


@pytest.fixture
def tide():
    rng = np.random.default_rng(1)
    shape = (2, 50)
    elevation = rng.normal(size=shape) + 1j * rng.normal(size=shape)
    velocity = rng.normal(size=(*shape, 2)) + 1j * rng.normal(size=(*shape, 2))
    elevation[0, 0] = 1.0 * np.exp(1e-9j)  # a phase that rounds to 360
    return TideSolution(
        names=("M2", "K1"),
        frequency=np.array([1.405189e-4, 7.292116e-5]),
        elevation=elevation,
        velocity=velocity,
        friction=np.zeros(50),
    )


def test_reads_elevation(tmp_path):
    path = tmp_path / "fort.53"
    path.write_text(ELEVATION)
    constants = read_fort53(path)
    assert constants.names == ("STEADY", "M2")
    assert_allclose(constants.frequency, [0.0, 1.405257e-4])
    assert_allclose(constants.nodal_factor, [1.0, 1.1])
    assert_allclose(constants.equilibrium_argument, [0.0, np.pi / 2])
    assert_allclose(constants.values[:, 0], [-0.1, -2j], atol=1e-15)
    assert constants.values[0, 1] == 3e-101
    assert np.isnan(constants.values[1, 1])


def test_reads_velocity(tmp_path):
    path = tmp_path / "fort.54.gz"
    path.write_bytes(gzip.compress(VELOCITY.encode()))
    constants = read_fort54(path)
    assert constants.values.shape == (1, 2, 2)
    assert_allclose(constants.values[0], [[1.0, -2.0], [0.5j, 0.0]], atol=1e-15)


@pytest.mark.parametrize("suffix", ["", ".gz"])
def test_written_is_read_and_the_same_bytes_twice(tmp_path, tide, suffix):
    for name, write, read, values in (
        ("fort.53", write_fort53, read_fort53, tide.elevation),
        ("fort.54", write_fort54, read_fort54, tide.velocity),
    ):
        path = tmp_path / (name + suffix)
        write(path, tide)
        first = path.read_bytes()
        write(path, tide)
        assert path.read_bytes() == first
        constants = read(path)
        assert constants.names == tide.names
        assert_allclose(constants.frequency, tide.frequency)
        # Four decimals of a degree.
        assert_allclose(constants.values, values, atol=1e-5 * np.abs(values).max())
    assert "360.0000" not in gzip.decompress(first).decode() if suffix else True


@pytest.mark.parametrize(
    ("old", "new", "line", "message"),
    [
        ("           2\n     0.0", "many\n     0.0", 1, "number of constituents"),
        ("           2\n     0.0", "\u00b2\n     0.0", 1, "number of constituents"),
        ("           2\n     0.0", "999999999999\n     0.0", 10, "ends early"),
        ("1.1000000  90.00000000  M2", "one", 3, "expected frequency, nodal factor"),
        ("M2\n           2\n", "M2\n    -2\n", 4, "number of nodes"),
        ("     90.0000", "      east", 7, r'expected 2 number\(s\), got "2.0'),
        ("           2\n   3.0", "           3\n   3.0", 8, "expected node 2, got 3"),
        ("  -9.99990000E+004 -99999.0000\n", "", 9, "ends early"),
    ],
)
def test_what_cannot_be_read_is_named_with_its_line(tmp_path, old, new, line, message):
    assert old in ELEVATION
    path = tmp_path / "fort.53"
    path.write_text(ELEVATION.replace(old, new, 1), encoding="latin-1")
    with pytest.raises(FormatError, match=message) as caught:
        read_fort53(path)
    assert caught.value.line == line


def test_missing_empty_and_broken_files(tmp_path):
    with pytest.raises(InputError, match="no such file"):
        read_fort53(tmp_path / "fort.53")
    empty = tmp_path / "empty"
    empty.write_text("")
    with pytest.raises(FormatError, match="ends in its header"):
        read_fort53(empty)
    broken = tmp_path / "fort.53.gz"
    broken.write_bytes(gzip.compress(ELEVATION.encode())[:60])
    with pytest.raises(FormatError, match="compressed file is damaged"):
        read_fort53(broken)


def write_netcdf(path, values, place, pairs, form, stations=()):
    """As ADCIRC does; values (n_c, n, components)."""
    with netCDF4.Dataset(path, "w", format=form) as data:
        data.createDimension(place, values.shape[1])
        data.createDimension("num_const", len(values))
        data.createDimension("letters", 10)
        name = data.createVariable("const", "S1", ("num_const", "letters"))
        for k in range(len(values)):
            name[k] = netCDF4.stringtochar(np.array(f"C{k}".ljust(10), "S10"))
        for name, number in (
            ("frequency", 1.4e-4),
            ("nodal_factor", 1.1),
            ("equilibrium_argument", 90.0),
        ):
            data.createVariable(name, "f8", ("num_const",))[:] = number
        for k, names in enumerate(pairs):
            dry = np.isnan(values[..., k])
            stored = (np.abs(values[..., k]), np.degrees(-np.angle(values[..., k])))
            for name, numbers in zip(names, stored):
                variable = data.createVariable(
                    name, "f8", (place, "num_const"), fill_value=-99999.0
                )
                variable[:] = np.where(dry, -99999.0, numbers).T
        if stations:
            name = data.createVariable("station_name", "S1", (place, "letters"))
            for k, text in enumerate(stations):
                name[k] = netCDF4.stringtochar(np.array(text.ljust(10), "S10"))


NETCDF = {
    read_fort51: ("station", (("amp", "phs"),)),
    read_fort52: ("station", (("u-vel-amp", "u-vel-phs"), ("v-vel-amp", "v-vel-phs"))),
    read_fort53: ("node", (("amp", "phs"),)),
    read_fort54: ("node", (("u_amp", "u_phs"), ("v_amp", "v_phs"))),
}


@pytest.mark.parametrize("form", ["NETCDF3_CLASSIC", "NETCDF4"])
@pytest.mark.parametrize("read", list(NETCDF))
def test_reads_netcdf(tmp_path, tide, read, form):
    place, pairs = NETCDF[read]
    values = np.concatenate([tide.velocity] * len(pairs), axis=2)[..., : len(pairs)]
    values = values.copy()
    values[1, 7] = np.nan
    stations = [f"gauge {k}" for k in range(50)] if place == "station" else ()
    path = tmp_path / "constants"
    write_netcdf(path, values, place, pairs, form, stations)
    constants = read(path)
    assert constants.names == ("C0", "C1")
    wanted = values if len(pairs) == 2 else values[..., 0]
    assert_allclose(constants.values, wanted, rtol=1e-14)
    assert_allclose(constants.frequency, 1.4e-4)
    assert_allclose(constants.nodal_factor, 1.1)
    assert_allclose(constants.equilibrium_argument, np.pi / 2)
    assert constants.stations == tuple(stations)
    for other in NETCDF:
        if other is not read:
            with pytest.raises(FormatError, match=r"there is no (variable|dimension)"):
                other(path)
    content = path.read_bytes()
    for k, cut in enumerate((10, 200, len(content) // 2, len(content) - 9)):
        cut_off = tmp_path / f"cut{k}"
        cut_off.write_bytes(content[:cut])
        with pytest.raises(FormatError, match="cut off"):
            read(cut_off)


def test_stations_as_text_are_read_like_nodes(tmp_path):
    (tmp_path / "fort.51").write_text(ELEVATION)
    (tmp_path / "fort.52").write_text(VELOCITY)
    assert_allclose(
        read_fort51(tmp_path / "fort.51").values,
        read_fort53(tmp_path / "fort.51").values,
    )
    assert read_fort52(tmp_path / "fort.52").values.shape == (1, 2, 2)


def test_a_run_that_blew_up(tmp_path):
    path = tmp_path / "fort.53"
    for bad in ("NaN    ", "*" * 16, "Infinity"):
        path.write_text(ELEVATION.replace("2.00000000E+000", bad))
        with pytest.raises(FormatError, match=r"line 7: .*the run blew up"):
            read_fort53(path)
    values = np.full((1, 3, 1), np.inf + 0j)
    write_netcdf(path, values, "node", (("amp", "phs"),), "NETCDF4")
    with pytest.raises(FormatError, match="the run blew up"):
        read_fort53(path)


def test_constants_of_another_mesh(tmp_path):
    path = tmp_path / "fort.53"
    path.write_text(ELEVATION)
    constants = read_fort53(path)
    require_nodes(constants, 2, path)
    with pytest.raises(FormatError, match=r"fort\.53: has 2 nodes, the mesh has 3"):
        require_nodes(constants, 3, path)


def test_every_cut_is_noticed(tmp_path):
    path = tmp_path / "fort.53"
    for read, text in ((read_fort53, ELEVATION), (read_fort54, VELOCITY)):
        for cut in range(0, len(text), 3):
            path.write_text(text[:cut])
            with pytest.raises(FormatError) as caught:
                read(path)
            assert caught.value.line is not None
    path.write_text(ELEVATION + "           3\n")
    with pytest.raises(FormatError, match="line 11: expected the end of the file"):
        read_fort53(path)


def test_garbled_files_are_refused_or_read_but_nothing_else(tmp_path):
    rng = np.random.default_rng(9)
    content = ELEVATION.encode()
    refused = []
    for k in range(200):
        damaged = bytearray(content)
        for place in rng.integers(0, len(damaged), rng.integers(1, 4)):
            damaged[place] = rng.integers(0, 256)
        path = tmp_path / str(k)
        path.write_bytes(bytes(damaged))
        try:
            constants = read_fort53(path)
        except FormatError as error:
            refused.append(error.line)
            continue
        assert constants.values.shape == (2, 2)
    assert len(refused) > 50
    assert None not in refused


@pytest.mark.parametrize("case", ["qa_r1_lin", "qa_r1_cor"])
def test_netcdf_and_text_of_the_kept_adcirc_runs(case):
    folder = Path(__file__).parents[3] / "shared" / "reference" / "adcirc"
    if not folder.is_dir():
        pytest.skip("the reference runs of ADCIRC are not there")
    for number, read in ((53, read_fort53), (54, read_fort54)):
        text = read(folder / case / f"fort.{number}.gz")
        precise = read(folder / f"{case}_nc" / f"fort.{number}.nc")
        assert text.names == precise.names
        # Phases of the text have four decimals of a degree.
        difference = np.linalg.norm(text.values - precise.values)
        assert difference < 6e-7 * np.linalg.norm(precise.values)
