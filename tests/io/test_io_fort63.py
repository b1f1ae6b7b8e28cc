"""ADCIRC's time series at nodes and stations."""

import gzip

import netCDF4
import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from tidemesh.errors import FormatError, InputError
from tidemesh.io.fort63 import (
    NodalSeries,
    iterate_fort63,
    iterate_fort64,
    read_fort61,
    read_fort62,
    read_fort63,
    read_fort64,
)

DRY = -99999.0
TIME = np.array([90.0, 180.0, 270.0, 360.0])
READ = {1: read_fort63, 2: read_fort64}


def values_of(components):
    """(4, 6, components), dry at some nodes."""
    values = np.random.default_rng(3).normal(size=(len(TIME), 6, components))
    values[1, 2] = values[3, 0] = values[3, 5] = np.nan
    return values


def text_of(values, *, compact=False, announced=None, odd=False):
    """As ADCIRC prints it; odd numbers as other compilers print them."""
    count, components = values.shape[1:]
    announced = len(values) if announced is None else announced
    lines = [
        " a bay                             a run                   a mesh",
        f" {announced:10d} {count:10d}  0.9000000E+002 {30:8d} {components:5d}"
        " FileFmtVersion:    1050624",
    ]
    for k, table in enumerate(np.where(np.isnan(values), DRY, values)):
        listed = [i for i in range(count) if not compact or table[i, 0] != DRY]
        head = f"{TIME[k]:22.10E} {30 * (k + 1):14d}"
        lines.append(head + (f" {len(listed):14d} {DRY:22.10E}" if compact else ""))
        for i in listed:
            row = "".join(f"{value:20.10E}" for value in table[i])
            lines.append(f"{i + 1:10d}" + (row.replace("E", "D") if odd else row))
    return "\n".join(lines) + "\n"


def write_netcdf(path, values, form, *, time=TIME, stations=()):
    place = "station" if stations else "node"
    names = ("zeta",) if values.shape[2] == 1 else ("u-vel", "v-vel")
    with netCDF4.Dataset(path, "w", format=form) as data:
        data.createDimension("time", None)
        data.createDimension(place, values.shape[1])
        variable = data.createVariable("time", "f8", ("time",))
        variable.base_date = "1998-01-01 00:00:00"
        variable[:] = time
        for k, name in enumerate(names):
            variable = data.createVariable(name, "f8", ("time", place), fill_value=DRY)
            variable[:] = np.where(np.isnan(values[..., k]), DRY, values[..., k])
        if stations:
            data.createDimension("namelen", 50)
            variable = data.createVariable("station_name", "S1", ("station", "namelen"))
            for k, name in enumerate(stations):
                variable[k] = netCDF4.stringtochar(np.array(name.ljust(50), "S50"))


@pytest.fixture(params=["full", "odd", "compact", "gz", "NETCDF3_CLASSIC", "NETCDF4"])
def make(request, tmp_path):
    """Write values in a form; the path."""

    def write(values):
        form = request.param
        if form.startswith("NETCDF"):
            path = tmp_path / "series.nc"
            write_netcdf(path, values, form)
            return path
        text = text_of(values, compact=form == "compact", odd=form == "odd").encode()
        path = tmp_path / ("series.gz" if form == "gz" else "series")
        path.write_bytes(gzip.compress(text) if form == "gz" else text)
        return path

    return write


@pytest.mark.parametrize("components", [1, 2])
def test_every_form_gives_the_same_series(make, components):
    values = values_of(components)
    path = make(values)
    series = READ[components](path)
    wanted = values[..., 0] if components == 1 else values
    assert_array_equal(series.time, TIME)
    assert_allclose(series.values, wanted, rtol=1e-10)
    if path.suffix == ".nc":
        assert series.base_date == "1998-01-01 00:00:00"
    # A part of it, and record by record.
    part = READ[components](path, nodes=[5, 0], start_s=180.0, end_s=300.0)
    assert_array_equal(part.time, TIME[1:3])
    assert_allclose(part.values, wanted[1:3][:, [5, 0]], rtol=1e-10)
    iterate = iterate_fort63 if components == 1 else iterate_fort64
    for record, time, table in zip(iterate(path), TIME, wanted, strict=True):
        assert record.time == time
        assert_allclose(record.values, table, rtol=1e-10)
    # Past the end there is nothing, of the right shape.
    empty = READ[components](path, nodes=[1], start_s=1e6)
    assert empty.values.shape == (0, 1) + (2,) * (components == 2)
    with pytest.raises(InputError, match="has 6 nodes, index 6 is none"):
        READ[components](path, nodes=[6])
    with pytest.raises(FormatError):
        READ[3 - components](path)


def test_stations(tmp_path):
    for components, read in ((1, read_fort61), (2, read_fort62)):
        values = values_of(components)[:, :2]
        write_netcdf(
            tmp_path / "61.nc", values, "NETCDF4", stations=("Fort Pulaski", "")
        )
        series = read(tmp_path / "61.nc")
        assert series.names == ("Fort Pulaski", "")
        (tmp_path / "61").write_text(text_of(values))
        text = read(tmp_path / "61")
        assert text.names == ()
        assert_allclose(series.values, text.values, rtol=1e-10)


@pytest.mark.parametrize("compact", [False, True])
def test_every_cut_is_noticed_and_complete_records_can_be_kept(tmp_path, compact):
    values = values_of(1)
    text = text_of(values, compact=compact)
    path = tmp_path / "fort.63"
    ends = []
    for k in range(1, 5):
        ends.append(len(text_of(values[:k], compact=compact, announced=4)))
    for cut in range(0, len(text), 7):
        path.write_text(text[:cut])
        with pytest.raises(FormatError) as caught:
            read_fort63(path)
        assert caught.value.line is not None
        if cut < text.index("FileFmt") + 30:
            continue
        complete = sum(end <= cut for end in ends)
        assert f"record {complete + 1}: " in str(caught.value)
        series = read_fort63(path, keep_complete=True)
        assert_array_equal(series.time, TIME[:complete])
        assert_allclose(series.values, values[:complete, :, 0], rtol=1e-10)


def test_a_compressed_file_that_is_cut_off(tmp_path):
    path = tmp_path / "fort.63.gz"
    # Stored, so that the cut leaves whole records.
    content = gzip.compress(text_of(values_of(1)).encode(), compresslevel=0)
    path.write_bytes(content[: len(content) // 2])
    with pytest.raises(FormatError, match="damaged or cut off"):
        read_fort63(path)
    assert 1 <= len(read_fort63(path, keep_complete=True).time) < 4
    path.write_bytes(content[:60])
    with pytest.raises(FormatError, match="damaged or cut off"):
        read_fort63(path, keep_complete=True)


@pytest.mark.parametrize("form", ["NETCDF3_CLASSIC", "NETCDF3_64BIT_OFFSET", "NETCDF4"])
def test_netcdf_that_is_cut_off(tmp_path, form):
    """Beyond the end of a classic file the library itself reads zeros."""
    write_netcdf(tmp_path / "whole.nc", values_of(2), form)
    content = (tmp_path / "whole.nc").read_bytes()
    for k, cut in enumerate((10, 100, len(content) // 2, len(content) - 20)):
        path = tmp_path / f"cut{k}.nc"
        path.write_bytes(content[:cut])
        with pytest.raises(FormatError, match="cut off"):
            read_fort64(path)


def test_netcdf_of_a_running_model(tmp_path):
    """Times that are not written yet, or not finite."""
    path = tmp_path / "fort.63.nc"
    for bad in (9.969e36, np.nan, 180.0):
        write_netcdf(path, values_of(1), "NETCDF4", time=[90.0, 180.0, 270.0, bad])
        with pytest.raises(FormatError, match=r"record 4: the time .* keep_complete"):
            read_fort63(path)
        assert_array_equal(read_fort63(path, keep_complete=True).time, TIME[:3])


@pytest.mark.parametrize(
    ("old", "new", "line", "message"),
    [
        ("         4          6", "         4          0", 2, "numbers of records"),
        ("         4          6", "      four          6", 2, 'got "four'),
        ("   9.0000000000E+01", "   now", 3, "record 1: expected time and step"),
        ("   1.8000000000E+02", "   9.0000000000E+01", 10, "90 s does not come after"),
        ("\n         3 ", "\n         4 ", 6, "record 1: expected node 3, got 4"),
        (
            "\n         3 ",
            "\n         3   NaN",
            6,
            "number and value.* the run blew up",
        ),
        ("\n         3 ", "\n\n         3 ", 6, "expected node number and value"),
    ],
)
def test_what_cannot_be_read_is_named_with_its_line(tmp_path, old, new, line, message):
    text = text_of(values_of(1))
    assert old in text
    path = tmp_path / "fort.63"
    path.write_text(text.replace(old, new, 1))
    with pytest.raises(FormatError, match=message) as caught:
        read_fort63(path)
    assert caught.value.line == line


def test_nodes_of_a_compact_record_ascend(tmp_path):
    text = text_of(values_of(1), compact=True)
    path = tmp_path / "fort.63"
    for old, new in (("\n         3 ", "\n         2 "), ("\n         6 ", "\n 7 ")):
        path.write_text(text.replace(old, new, 1))
        with pytest.raises(FormatError, match="node numbers from 1 to 6 in ascending"):
            read_fort63(path)


def test_other_files(tmp_path):
    with pytest.raises(InputError, match="no such file"):
        read_fort63(tmp_path / "fort.63")
    write_netcdf(tmp_path / "fort.63.nc", values_of(1), "NETCDF3_CLASSIC")
    packed = tmp_path / "fort.63.nc.gz"
    packed.write_bytes(gzip.compress((tmp_path / "fort.63.nc").read_bytes()))
    with pytest.raises(FormatError, match="decompress it first"):
        read_fort63(packed)
    with pytest.raises(
        FormatError, match=r'no variable "u-vel"; there are: time, zeta'
    ):
        read_fort64(tmp_path / "fort.63.nc")
    blown = values_of(1)
    blown[2, 3] = np.inf
    write_netcdf(tmp_path / "blown.nc", blown, "NETCDF4")
    with pytest.raises(FormatError, match=r"not finite at .3, 4.: the run blew up"):
        read_fort63(tmp_path / "blown.nc")


def test_garbled_files_are_refused_or_read_but_nothing_else(tmp_path):
    rng = np.random.default_rng(8)
    refused = []
    for compact in (False, True):
        content = text_of(values_of(2), compact=compact).encode()
        for k in range(120):
            damaged = bytearray(content)
            for place in rng.integers(0, len(damaged), rng.integers(1, 4)):
                damaged[place] = rng.integers(0, 256)
            path = tmp_path / f"{compact}{k}"
            path.write_bytes(bytes(damaged))
            try:
                series = read_fort64(path)
            except FormatError as error:
                refused.append(error.line)
                continue
            assert series.values.shape == (4, 6, 2)
    assert len(refused) > 100
    assert None not in refused


def test_series_is_checked():
    with pytest.raises(ValueError, match="values must have shape"):
        NodalSeries(TIME, np.zeros((3, 2)))
