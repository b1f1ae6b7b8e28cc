"""Water levels as time series, modelled against observed."""

import json

import numpy as np
import pytest
from numpy.testing import assert_allclose
from verification_cases import DAY, HOUR, cosine

from tidemesh.datatypes import TideRecord
from tidemesh.errors import InputError
from tidemesh.verification import compare_records, write_verification


def test_equal_records_have_no_error():
    record = cosine(0.7, 0.0)
    found = compare_records(record, record)
    assert found.rms_error_m == pytest.approx(0.0, abs=1e-12)
    assert found.bias_m == 0.0
    assert found.correlation == pytest.approx(1.0)
    assert found.amplitude_ratio == pytest.approx(1.0)
    assert found.skill == pytest.approx(1.0)
    assert found.lag_minutes == pytest.approx(0.0, abs=1e-3)
    assert len(found.time) == len(record.time)


def test_closed_form_of_amplitude_and_phase_difference():
    # 30 periods of 12 hours, the last level being that of the first.
    lag, period = 0.5 * HOUR, 12 * HOUR
    observed = cosine(0.8, 0.0, days=15, period_s=period)
    observed = TideRecord(observed.time[:-1], observed.elevation[:-1])
    modelled = cosine(0.6, lag, days=15, period_s=period)
    found = compare_records(modelled, observed)
    cos = np.cos(2 * np.pi * lag / period)
    square = 0.6**2 + 0.8**2 - 2 * 0.6 * 0.8 * cos
    assert found.rms_error_m == pytest.approx(np.sqrt(square / 2), rel=1e-6)
    assert found.largest_error_m**2 == pytest.approx(square, rel=1e-2)
    assert found.correlation == pytest.approx(cos, rel=1e-6)
    assert found.amplitude_ratio == pytest.approx(0.75, rel=1e-6)
    assert found.lag_minutes == pytest.approx(30.0, abs=0.01)
    # What a shift cannot mend is the amplitude.
    assert found.rms_error_without_lag_m == pytest.approx(0.2 / np.sqrt(2), rel=1e-3)


@pytest.mark.parametrize("minutes", [-90.0, -7.0, 0.0, 20.0, 123.0])
def test_lag_of_a_shifted_record_is_found(minutes):
    rng = np.random.default_rng(5)
    observed = cosine(0.8, 0.0, step_s=360.0)
    weather = np.interp(
        observed.time, np.arange(0, 31 * DAY, 6 * HOUR), rng.normal(0, 0.1, 124)
    )
    observed = TideRecord(observed.time, observed.elevation + weather)
    modelled = TideRecord(observed.time + 60 * minutes, observed.elevation)
    found = compare_records(modelled, observed, interpolation="linear")
    assert found.lag_minutes == pytest.approx(minutes, abs=0.1)
    assert found.rms_error_without_lag_m < 2e-3


def test_no_lag_within_those_tried():
    found = compare_records(cosine(1, 2 * HOUR), cosine(1, 0), largest_lag_minutes=60.0)
    assert np.isnan(found.lag_minutes)
    assert np.isnan(found.rms_error_without_lag_m)


def test_means():
    modelled, observed = cosine(1, 0, mean=0.3), cosine(1, 0, mean=0.1)
    about = compare_records(modelled, observed)
    assert about.bias_m == pytest.approx(0.2)
    assert about.rms_error_m == pytest.approx(0.0, abs=1e-12)
    above = compare_records(modelled, observed, remove_mean=False)
    assert above.bias_m == above.rms_error_m == pytest.approx(0.2)
    assert above.observed.mean() == pytest.approx(observed.elevation.mean())


def test_interpolation_between_hourly_levels():
    observed = cosine(1.0, 0.0, step_s=600.0)
    hourly = cosine(1.0, 0.0, step_s=HOUR)
    cubic = compare_records(hourly, observed)
    linear = compare_records(hourly, observed, interpolation="linear")
    # Half way along a chord the cosine is higher by its sagitta.
    sagitta = 1.0 - np.cos(np.pi * 1.0 / 12.42)
    assert np.abs(linear.residual).max() == pytest.approx(sagitta, rel=0.05)
    assert np.abs(cubic.residual).max() < 2e-3
    assert cubic.rms_error_m < 2e-4


def test_window_gaps_and_missing_levels():
    modelled = cosine(1.0, 0.0, step_s=HOUR)
    level = modelled.elevation.copy()
    level[240:250] = np.nan  # hours 240 to 249 of the model
    modelled = TideRecord(modelled.time, level)
    observed = cosine(1.0, 0.0, step_s=1800.0)
    level = observed.elevation.copy()
    level[400:410] = np.nan  # hours 200 to 204.5
    observed = TideRecord(observed.time, level)
    start, end = 5 * DAY, 20 * DAY
    found = compare_records(modelled, observed, start=start, end=end)
    hours = found.time / HOUR
    assert hours[0] == 120
    assert hours[-1] == 480
    missing = np.setdiff1d(np.arange(240, 961) / 2, hours)
    expected = [*np.arange(400, 410) / 2, *np.arange(479, 500) / 2]
    assert_allclose(missing, expected)
    assert found.rms_error_m < 1e-3


def test_nothing_in_common():
    first = cosine(1, 0, days=2)
    later = TideRecord(first.time + 10 * DAY, first.elevation, station="Springmaid")
    with pytest.raises(InputError, match="Springmaid have 0 times in common") as caught:
        compare_records(first, later)
    assert "1970-01-01T00:00:00Z to 1970-01-03T00:00:00Z" in str(caught.value)
    with pytest.raises(InputError, match="observed within the time asked for nothing"):
        compare_records(first, first, start=30 * DAY)
    unsorted = TideRecord(first.time[::-1], first.elevation)
    with pytest.raises(InputError, match="do not increase"):
        compare_records(unsorted, first)
    with pytest.raises(ValueError, match="interpolation"):
        compare_records(first, first, interpolation="nearest")


def test_still_water_has_no_correlation():
    still = TideRecord(np.arange(10) * HOUR, np.zeros(10))
    found = compare_records(still, still)
    assert np.isnan(found.correlation)
    assert np.isnan(found.skill)
    assert np.isnan(found.lag_minutes)


def test_file(tmp_path):
    found = compare_records(cosine(0.9, 600.0), cosine(1.0, 0.0), start=1 * DAY)
    paths = write_verification(tmp_path, records=[found])
    assert [path.name for path in paths][2] == "records.csv"
    (told,) = json.loads(paths[0].read_text())["records"]
    assert told["station"] == "Charleston"
    assert told["start"] == "1970-01-02T00:00:00Z"
    assert told["rms_error_m"] == found.rms_error_m
    rows = paths[2].read_text().splitlines()
    assert len(rows) == 1 + len(found.time)
    assert rows[1].startswith("Charleston,1970-01-02T00:00:00Z,")
    assert "rms error" in paths[1].read_text()
    assert f"{found.lag_minutes:+.1f} min" in found.as_text()
