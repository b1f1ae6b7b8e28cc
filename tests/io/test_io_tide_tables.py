"""Tables of tidal constants."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from tidemesh.constants import frequency
from tidemesh.errors import FormatError, InputError
from tidemesh.io.tide_tables import read_tide_table

LONG = """\
# source: made up
point,lon,lat,constituent,speed_deg_per_hour,amplitude_m,phase_deg_greenwich
0,-80.5,32.0,M2,28.9841042,0.5,90
1,-79.5,32.5,M2,28.9841042,1.0,0

0,-80.5,32.0,k1,15.0410686,0.1,180
"""

WIDE = """\
station_id;name;lon;lat;M2_amp_m;M2_phase_deg_gmt;NU2_amp_m;NU2_phase_deg_gmt
8665530;Charleston;-79.92;32.78;0.767;10.1;0.03;350
8661070;Springmaid;-78.92;33.65;0.730;357.9;;
"""


@pytest.fixture
def write(tmp_path):
    def to_file(text):
        path = tmp_path / "tide.csv"
        path.write_text(text, encoding="utf-8")
        return path

    return to_file


def test_long_layout(write):
    table = read_tide_table(write(LONG))
    assert table.names == ("M2", "K1")
    assert_allclose(table.frequency, [frequency("M2"), frequency("K1")])
    assert_allclose(table.longitude_deg, [-80.5, -79.5])
    assert_allclose(table.latitude_deg, [32.0, 32.5])
    # A phase lag of a quarter period: the crest comes a quarter period later.
    assert_allclose(table.elevation[0], [-0.5j, 1.0], atol=1e-15)
    assert table.elevation[1, 0] == pytest.approx(-0.1)
    assert np.isnan(table.elevation[1, 1])
    assert table.stations == ()


def test_wide_layout_with_stations_and_gaps(write):
    table = read_tide_table(write(WIDE))
    assert table.names == ("M2", "NU2")
    assert table.stations == ("Charleston", "Springmaid")
    lag = np.degrees(-np.angle(table.elevation[0])) % 360.0
    assert_allclose(np.abs(table.elevation[0]), [0.767, 0.730])
    assert_allclose(lag, [10.1, 357.9])
    assert np.isnan(table.elevation[1, 1])


@pytest.mark.parametrize(
    "header",
    [
        "lon,lat,constituent,amplitude,phase",
        "LONGITUDE,Latitude,Constituent,amplitude_m,phase_deg_gmt",
        "longitude_deg,latitude_deg,con,amp_m,greenwich_phase_deg",
    ],
)
def test_names_of_columns(write, header):
    table = read_tide_table(write(header + "\n1.0,2.0,M2,0.4,180\n"))
    assert table.elevation[0, 0] == pytest.approx(-0.4)


def test_speed_of_the_table_comes_first(write):
    text = "lon,lat,constituent,speed,amplitude,phase\n0,0,M2,29.0,1,0\n"
    table = read_tide_table(write(text))
    assert table.frequency[0] == pytest.approx(np.radians(29.0) / 3600.0)


def test_unknown_constituent_lists_the_known(write):
    text = "lon,lat,constituent,amplitude,phase\n0,0,XYZ9,1,0\n"
    with pytest.raises(InputError, match=r"XYZ9 is not known.*M2, S2"):
        read_tide_table(write(text))


@pytest.mark.parametrize(
    ("text", "line", "message"),
    [
        ("", None, "the table is empty"),
        ("lon,lat,constituent,amplitude,phase\n", None, "no rows"),
        ("lat,constituent,amplitude,phase\n", 1, "no longitude column"),
        ("lon,lat,constituent,amplitude\n0,0,M2,1\n", 1, "no phase column"),
        ("lon,lat,depth\n0,0,1\n", 1, 'expected a column "constituent"'),
        ("lon,lat,M2_amp_m\n0,0,1\n", 1, "M2 has an amplitude column and no phase"),
        (LONG + "1,2\n", 7, "expected 7 columns"),
        (LONG.replace("0.5,90", "half,90"), 3, 'amplitude of M2, got "half"'),
        (LONG.replace("0.5,90", "-0.5,90"), 3, "amplitude of M2 is negative"),
        (LONG.replace("0.5,90", "0.5,inf"), 3, "phase of M2"),
        (LONG.replace("-79.5", "west"), 4, 'as longitude, got "west"'),
        (LONG.replace("1,-79.5,32.5", "0,-80.5,32.0"), 4, "given a second time"),
        (LONG.replace("1,-79.5,32.5,M2,28.9841042", "1,-79.5,32.5,M2,29"), 4, "before"),
        (LONG.replace(",k1,", ",,"), 6, "no name"),
    ],
)
def test_what_cannot_be_used_is_named_with_its_line(write, text, line, message):
    with pytest.raises(FormatError, match=message) as caught:
        read_tide_table(write(text))
    assert caught.value.line == line
    assert "tide.csv" in str(caught.value)


def test_missing_and_binary_files(tmp_path):
    with pytest.raises(InputError, match="no such file"):
        read_tide_table(tmp_path / "none.csv")
    binary = tmp_path / "tide.nc"
    binary.write_bytes(b"\x89HDF\xff\xfe")
    with pytest.raises(FormatError, match="not a text file"):
        read_tide_table(binary)
