"""Water levels as time series."""

import json
import logging
from datetime import UTC, datetime

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

from tidemesh.datatypes import TideRecord
from tidemesh.errors import FormatError, InputError
from tidemesh.io.tide_records import read_records, write_records

START = datetime(1998, 3, 16, tzinfo=UTC).timestamp()

PLAIN = """\
# hourly levels
time_utc,level_m
1998-03-16T00:00Z,0.5
1998-03-16T01:00,-0.25
1998-03-16T03:30,
1998-03-16T05:00:00+01:00,-99999
1998-03-16 06:00:00.5,1e-1
"""

COOPS_LEVELS = """\
Date Time, Water Level, Sigma, O or I (for verified), F, R, L, Quality
1998-03-16 00:00,1.234,0.010,0,0,0,0,v
1998-03-16 00:06,,,,,,,v
1998-03-16 00:12,-1.000,0.010,0,0,0,0,v
"""

WEB_PAGE = """\
"Date","Time (GMT)","Predicted (ft)","Preliminary (ft)","Verified (ft)"
"1998/03/16","00:00","1.00","-","2.0"
"1998/03/16","01:00","-1.00","-","2.5"
"""


@pytest.fixture
def write(tmp_path):
    def to_file(text, name="levels.csv"):
        path = tmp_path / name
        path.write_text(text, encoding="utf-8")
        return path

    return to_file


def test_plain_columns(write):
    (record,) = read_records(write(PLAIN))
    hours = np.array([0.0, 1.0, 3.5, 4.0, 6.0])
    assert_allclose(record.time - START, 3600 * hours + [0, 0, 0, 0, 0.5])
    assert_array_equal(record.elevation, [0.5, -0.25, np.nan, np.nan, 0.1])
    assert record.station == ""
    assert record.datum == "not stated"
    assert np.isnan(record.longitude_deg)


def test_a_service_file_is_taken_as_metres_and_utc_with_a_warning(write, caplog):
    with caplog.at_level(logging.WARNING):
        (record,) = read_records(write(COOPS_LEVELS))
    assert "taken as UTC and metres" in caplog.text
    assert_allclose(record.time - START, [0, 360, 720])
    assert_array_equal(record.elevation, [1.234, np.nan, -1.0])


def test_stated_by_keyword(write, caplog):
    path = write("Date Time, Prediction\n1998-03-16 00:00,10\n1998-03-16 01:00,20\n")
    (record,) = read_records(path, unit="ft", utc_offset_hours=-5)
    assert not caplog.records
    assert_allclose(record.time - START, [5 * 3600, 6 * 3600])
    assert_allclose(record.elevation, [3.048, 6.096])


def test_date_and_time_apart_and_several_levels_in_feet(write):
    records = read_records(write(WEB_PAGE))
    assert [r.station for r in records] == ["Predicted", "Preliminary", "Verified"]
    assert_allclose(records[0].elevation, [0.3048, -0.3048])
    assert np.isnan(records[1].elevation).all()
    assert_allclose(records[2].time - START, [0, 3600])


def test_columns_called_by_their_stations(write):
    path = write("time_utc;Charleston_m;Springmaid (ft)\n1998-03-16;1;2\n")
    records = read_records(path)
    assert [r.station for r in records] == ["Charleston", "Springmaid"]
    assert_allclose([r.elevation[0] for r in records], [1, 0.6096])


def test_datum_from_the_header(write):
    (record,) = read_records(write("time_utc,predicted_m_msl\n1998-03-16,1\n"))
    assert record.datum == "mean sea level"
    assert record.station == ""


@pytest.mark.parametrize("key", ["data", "predictions"])
def test_service_json(write, key):
    entries = [
        {"t": "1998-03-16 00:00", "v": "0.1"},
        {"t": "1998-03-16 00:06", "v": ""},
    ]
    content = {key: entries}
    if key == "data":
        content["metadata"] = {"name": "Charleston", "lat": "32.78", "lon": "-79.92"}
    (record,) = read_records(write(json.dumps(content), "levels.json"))
    assert_allclose(record.time - START, [0, 360])
    assert_array_equal(record.elevation, [0.1, np.nan])
    if key == "data":
        assert record.station == "Charleston"
        assert (record.longitude_deg, record.latitude_deg) == (-79.92, 32.78)


def row(time="1998-03-16T00:00Z", level="1"):
    return f"time,level_m\n{time},{level}\n"


@pytest.mark.parametrize(
    ("text", "line", "message"),
    [
        ("", None, "the file is empty"),
        ("time_utc,level_m\n", None, "a header and no rows"),
        ("when,level_m\n0,1\n", 1, "no time column"),
        ("time_utc,flag\n0,1\n", 1, "no column of water levels"),
        ("time_utc,level\n1998-01-01,1\n", 1, "does not state its unit"),
        ("time (LST),level_m\n1998-01-01,1\n", 1, "local"),
        (row(time="1998-03-16 00:00"), 2, "states no zone"),
        (row(time="03/16/1998 00:00"), 2, "is not a time"),
        (row(time="noon"), 2, "is not a time"),
        (row(level="high"), 2, 'got "high"'),
        (row(level="inf"), 2, "not finite"),
        (row() + "1998-03-16T01:00Z\n", 3, "expected 2 columns"),
        (row() + "1998-03-16T00:00Z,2\n", 3, "given a second time"),
        (row() + "1998-03-15T23:00Z,2\n", 3, "do not increase"),
        ('{"data": [', 1, "is not JSON"),
        ('{"error": {"message": "No data was found"}}', None, "No data was found"),
        ('{"data": []}', None, "expected a list"),
        ('{"data": [{"t": "1998-01-01"}]}', None, "entry 1 has no"),
        ('{"data": [{"t": "x", "v": "1"}]}', None, 'entry 1: "x" is not a time'),
    ],
)
def test_what_cannot_be_used(write, text, line, message):
    with pytest.raises(FormatError, match=message) as caught:
        read_records(write(text))
    assert caught.value.line == line
    assert "levels.csv" in str(caught.value)


def test_missing_file_and_unknown_unit(tmp_path, write):
    with pytest.raises(InputError, match="there is no such file"):
        read_records(tmp_path / "absent.csv")
    with pytest.raises(InputError, match='unit "fathom"'):
        read_records(write(PLAIN), unit="fathom")
    (tmp_path / "bytes.csv").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(FormatError, match="not a text file"):
        read_records(tmp_path / "bytes.csv")


LEVEL = st.floats(-15, 15, allow_nan=False) | st.just(float("nan"))


@settings(max_examples=40, deadline=None)
@given(
    steps=st.lists(st.tuples(st.integers(1, 10**13), LEVEL), min_size=1, max_size=6),
    name=st.text("abc ,;\"'é", max_size=8).map(str.strip),
    longitude=st.floats(-180, 180) | st.just(float("nan")),
)
def test_write_read(tmp_path_factory, steps, name, longitude):
    path = tmp_path_factory.mktemp("records") / "levels.csv"
    microseconds = np.cumsum([step for step, _ in steps])
    first = TideRecord(
        time=microseconds / 1e6 - 1e9,
        elevation=[level for _, level in steps],
        station=name,
        longitude_deg=longitude,
        latitude_deg=33.0,
        datum="NAVD88",
    )
    second = TideRecord([0.0, 1.5], [1.0, 2.0], station="other")
    write_records(path, [first, second])
    got, other = read_records(path)
    assert_allclose(got.time, first.time, rtol=0, atol=1e-6)
    assert_array_equal(got.elevation, first.elevation)
    assert_array_equal(
        [got.longitude_deg, got.latitude_deg], [longitude, first.latitude_deg]
    )
    assert (got.station, got.datum) == (name, "NAVD88")
    assert_array_equal(other.time, second.time)
    before = path.read_bytes()
    write_records(path, (got, other))
    assert path.read_bytes() == before


def test_two_records_of_one_station(tmp_path):
    record = TideRecord([0.0], [1.0], station="Charleston")
    with pytest.raises(InputError, match='two records are called "Charleston"'):
        write_records(tmp_path / "levels.csv", [record, record])
