"""Harmonic constants of records."""

from datetime import UTC, datetime

import numpy as np
import pytest
from numpy.testing import assert_allclose
from verification_cases import DAY, HOUR

from tidemesh import constants
from tidemesh.datatypes import TideRecord
from tidemesh.errors import InputError
from tidemesh.verification import analyse, harmonic_analysis
from tidemesh.verification.harmonic_analysis import UTIDE_NAMES

utide = pytest.importorskip("utide")

START = datetime(1998, 1, 1, tzinfo=UTC).timestamp()
NAMES = ("M2", "S2", "N2", "K1", "O1", "M4", "M6")
SIZES = np.array([0.767, 0.116, 0.175, 0.105, 0.079, 0.038, 0.008])
LAGS = np.array([10.1, 36.0, 354.9, 198.4, 202.0, 207.8, 129.1])


def astronomical_tide(time, names=NAMES, sizes=SIZES, lags=LAGS, latitude=32.78):
    """Sum of f A cos(V + u - G), the factors taken at every time."""
    from utide._ut_constants import constit_index_dict
    from utide.harmonics import FUV

    days = time / DAY + datetime(1970, 1, 1).toordinal()
    index = np.array([constit_index_dict[UTIDE_NAMES.get(n, n)] for n in names])
    f, u, v = FUV(days, days.mean(), index, latitude, [False] * 4)
    return (f * sizes * np.cos(2 * np.pi * (u + v) - np.radians(lags))).sum(axis=1)


def hourly(days):
    return START + np.arange(days * 24) * HOUR


def record(time, level, **about):
    return TideRecord(time, level, latitude_deg=32.78, **about)


def test_synthetic_constituents_are_recovered():
    time = hourly(60)
    found = analyse(
        record(time, 0.2 + astronomical_tide(time), station="Charleston"),
        [*NAMES, "STEADY"],
    )
    table = found.table
    assert table.names == (*NAMES, "STEADY")
    assert table.stations == ("Charleston",)
    expected = SIZES * np.exp(-1j * np.radians(LAGS))
    assert_allclose(table.elevation[:-1, 0], expected, atol=1e-6)
    assert table.elevation[-1, 0] == pytest.approx(0.2, abs=1e-6)
    assert found.mean_m == pytest.approx(0.2, abs=1e-6)
    assert found.residual_rms_m < 1e-6
    assert_allclose(table.frequency[0], constants.frequency("M2"))


def test_greenwich_phase_of_the_sun_needs_no_almanac():
    # The mean sun crosses the meridian of Greenwich at noon: V = 30 degrees an hour
    # from midnight, twice that of the sun.
    time = hourly(20)
    level = 0.5 * np.cos(np.radians(30.0 * (time - START) / HOUR - 70.0))
    table = harmonic_analysis(record(time, level), ["S2"], nodal=False)
    assert_allclose(
        table.elevation[0, 0], 0.5 * np.exp(-1j * np.radians(70)), atol=1e-6
    )


def test_greenwich_phase_of_the_moon():
    # Mean longitudes of moon and sun after Meeus, Astronomical Algorithms, chapters 47
    # and 25: V of M2 is twice the hour angle of the mean moon at Greenwich.
    time = hourly(30)
    century = (time - datetime(2000, 1, 1, 12, tzinfo=UTC).timestamp()) / (36525 * DAY)
    moon = 218.3164477 + 481267.88123421 * century
    sun = 280.46646 + 36000.76983 * century
    hour_angle = 15.0 * (time - START) / HOUR + 180.0 + sun - moon
    level = np.cos(np.radians(2.0 * hour_angle - 100.0))
    table = harmonic_analysis(record(time, level), ["M2"], nodal=False)
    assert_allclose(table.elevation[0, 0], np.exp(-1j * np.radians(100)), atol=2e-3)


def test_annual_and_daily_tides_have_the_arguments_of_noaa():
    # Schureman: V of SA is the mean longitude of the sun (280.466 degrees at the noon
    # that began the year 2000), that of S1 the hour angle of the mean sun.
    time = START + np.arange(0.0, 800 * DAY, 3 * HOUR)
    century = (time - datetime(2000, 1, 1, 12, tzinfo=UTC).timestamp()) / (36525 * DAY)
    sun = np.radians(280.46646 + 36000.76983 * century)
    hour_angle = 2 * np.pi * (time - START) / DAY + np.pi
    level = 0.1 * np.cos(sun - np.radians(173)) + 0.02 * np.cos(hour_angle - 1.0)
    table = harmonic_analysis(record(time, level), ["SA", "S1"])
    expected = [0.1 * np.exp(-1j * np.radians(173)), 0.02 * np.exp(-1j)]
    assert_allclose(table.elevation[:, 0], expected, atol=3e-4)


def test_nodal_factors_of_2mk3_are_those_of_its_name():
    from utide._ut_constants import constit_index_dict
    from utide.harmonics import FUV

    time = hourly(40)
    days = time / DAY + datetime(1970, 1, 1).toordinal()
    index = np.array([constit_index_dict[name] for name in ("M2", "K1")])
    f, u, v = FUV(days, days.mean(), index, 32.78, [False] * 4)
    argument = 2 * np.pi * ((u + v) @ [2, -1])
    level = 0.03 * f[:, 0] ** 2 * f[:, 1] * np.cos(argument - np.radians(50))
    table = harmonic_analysis(record(time, level), ["2MK3"])
    assert_allclose(
        table.elevation[0, 0], 0.03 * np.exp(-1j * np.radians(50)), atol=2e-4
    )


def test_gaps_uneven_times_names_of_noaa_and_trend():
    rng = np.random.default_rng(3)
    time = hourly(100) + rng.uniform(0, 1800, 2400)
    names = ("LAM2", "M2", "RHO", "M1")
    sizes, lags = (
        np.array([0.015, 0.767, 0.002, 0.005]),
        np.array([358.8, 10, 191, 219]),
    )
    level = astronomical_tide(time, names, sizes, lags) + (time - START) / DAY * 1e-3
    level[300:400] = np.nan
    found = analyse(record(time, level), names, trend=True)
    assert_allclose(
        found.table.elevation[:, 0], sizes * np.exp(-1j * np.radians(lags)), atol=1e-6
    )
    assert found.trend_m_per_year == pytest.approx(0.36525, rel=1e-6)
    assert found.n_values == 2300
    assert found.amplitude_error_m is None


def test_confidence_of_noise():
    # White noise of 5 cm over n values leaves each amplitude uncertain by about
    # 0.05 sqrt(2 / n) (one standard deviation).
    time = hourly(60)
    noise = np.random.default_rng(1).normal(0, 0.05, len(time))
    found = analyse(
        record(time, astronomical_tide(time) + noise), NAMES, confidence=True
    )
    sigma = 0.05 * np.sqrt(2 / len(time))
    error = np.abs(np.abs(found.table.elevation[:, 0]) - SIZES)
    assert (error < 4 * sigma).all()
    assert found.amplitude_error_m.shape == found.phase_error_deg.shape == (7,)
    assert_allclose(found.amplitude_error_m, 1.96 * sigma, rtol=0.6)
    assert found.residual_rms_m == pytest.approx(0.05, rel=0.05)


def test_is_quiet(capsys):
    time = hourly(20)
    harmonic_analysis(record(time, astronomical_tide(time)), ["M2", "K1"])
    assert capsys.readouterr() == ("", "")


def test_mean_alone():
    found = analyse(record(hourly(2), np.tile([1.0, 2.0], 24)), ["steady"])
    assert found.table.elevation[0, 0] == 1.5
    assert found.residual_rms_m == 0.5


@pytest.mark.parametrize(
    ("days", "names", "message"),
    [
        (16, ["M2", "N2", "K1"], "tell M2 and N2 apart, which takes 27.6 days"),
        (60, ["K1", "P1"], "tell K1 and P1 apart, which takes 182.6 days"),
        (0.4, ["M2"], "tell M2 and the mean apart"),
        (30, ["M2", "MSF", "MM"], "apart"),
        (30, ["M2", "XY7"], "XY7 is not known"),
        (30, [], "name at least one"),
        (30, ["M2", "m2"], "M2 and m2 are one"),
        (0.1, ["M2"], "2 levels, which do not determine 3 unknowns"),
    ],
)
def test_records_that_do_not_do(days, names, message):
    time = hourly(60)[: int(days * 24)]
    with pytest.raises(InputError, match=message):
        harmonic_analysis(record(time, np.cos(time)), names)


def test_exact_synodic_length_is_enough():
    # 29.53 hourly days tell M2 and S2 apart twice; 14.77 days are the least.
    hours = int(np.ceil(360 / (30 - 28.9841042)))
    time = START + np.arange(hours) * HOUR
    level = astronomical_tide(time, NAMES[:2], SIZES[:2], LAGS[:2])
    found = harmonic_analysis(record(time, level), ["M2", "S2"])
    assert_allclose(np.abs(found.elevation[:, 0]), SIZES[:2], atol=1e-6)
    with pytest.raises(InputError, match="M2 and S2 apart"):
        harmonic_analysis(record(time[:-2], level[:-2]), ["M2", "S2"])
    shorter = harmonic_analysis(
        record(time[:300], level[:300]), ["M2", "S2"], rayleigh=0.5
    )
    assert_allclose(np.abs(shorter.elevation[:, 0]), SIZES[:2], atol=1e-6)


def test_too_few_levels_for_the_fastest():
    time = START + np.arange(200) * 4 * HOUR
    with pytest.raises(InputError, match="every 4 hours, too few for M4"):
        harmonic_analysis(record(time, np.cos(time)), ["M2", "M4"])


def test_latitude_is_needed():
    time = hourly(30)
    with pytest.raises(InputError, match="latitude"):
        harmonic_analysis(TideRecord(time, np.cos(time)), ["M2"])
    harmonic_analysis(TideRecord(time, np.cos(time)), ["O1"], 0.0)
