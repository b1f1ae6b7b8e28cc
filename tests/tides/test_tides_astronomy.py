"""Nodal corrections, equilibrium arguments and prediction.

What is known: the arithmetic of the six astronomical angles, NOAA's speeds, the values
of NOAA's program tide_fac (Schureman's formulas), the 18.6-year swing of the textbooks.
"""

import csv
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

from tidemesh.constants import SPEED_DEG_PER_HOUR, frequency
from tidemesh.datatypes import TideForcing, TideTable
from tidemesh.errors import InputError
from tidemesh.tides.astronomy import (
    constituent_frequency,
    doodson_numbers,
    nodal_corrections,
    predict,
    prediction_basis,
    with_astronomy,
)

DATA = Path(__file__).parents[3] / "shared" / "data" / "south_carolina"

RATES_DEG_PER_HOUR = np.array(
    [14.49205212, 0.54901653, 0.04106864, 0.00464183, 0.00220641, 0.00000196]
)
"""Lunar time, moon, sun, perigee, negative node, solar perigee (Schureman, table 1)."""

TIDE_FAC = {
    "M2": (1.03579, 294.27),
    "S2": (1.00000, 0.00),
    "N2": (1.03579, 343.28),
    "K1": (0.88984, 7.13),
    "O1": (0.81955, 288.97),
    "Q1": (0.81955, 337.98),
    "P1": (1.00000, 349.55),
    "K2": (0.75976, 194.88),
    "M4": (1.07285, 228.54),
    "M6": (1.11125, 162.82),
    "MK3": (0.92169, 301.40),
    "2MK3": (0.95467, 221.41),
    "M3": (1.05425, 81.41),
    "SA": (1.00000, 280.45),
    "SSA": (1.00000, 200.90),
    "S1": (1.00000, 180.00),
    "T2": (1.00000, 2.46),
}
"""Node factor and argument (degrees) that tide_fac prints for the 90 days from
1998-01-01 00:00 GMT, the run of the paper's section 4."""


def seconds(*date):
    return datetime(*date, tzinfo=UTC).timestamp()


def turn(angle_deg):
    """The angle in -180 .. 180 degrees."""
    return (np.asarray(angle_deg) + 180.0) % 360.0 - 180.0


def forcing(*names):
    return TideForcing(
        names, [frequency(n) for n in names], [0], np.ones((len(names), 1))
    )


def table(names, elevation, latitude=(33.0,)):
    return TideTable(
        np.zeros(len(latitude)),
        latitude,
        names,
        [SPEED_DEG_PER_HOUR.get(n, 0.0) for n in names],
        elevation,
        tuple(f"gauge {k}" for k in range(len(latitude))),
    )


def test_values_of_a_fort15_as_noaa_computes_them():
    # Schureman's formulas know the node alone, the library further satellites too:
    # that is the difference of a per cent in f and of half a degree in u.
    start = seconds(1998, 1, 1)
    given = with_astronomy(
        forcing(*TIDE_FAC), start, 32.78, middle_s=start + 45 * 86400.0
    )
    factor, argument = np.array(list(TIDE_FAC.values())).T
    assert_allclose(given.nodal_factor, factor, atol=0.011)
    assert np.abs(turn(np.degrees(given.argument) - argument)).max() < 0.7
    principal = [list(TIDE_FAC).index(n) for n in ("M2", "S2", "K1", "K2", "M4", "SA")]
    off = turn(np.degrees(given.argument) - argument)[principal]
    assert np.abs(off).max() < 0.25


def test_doodson_numbers_give_the_tabulated_speeds():
    names = tuple(SPEED_DEG_PER_HOUR)
    speed = doodson_numbers(names) @ RATES_DEG_PER_HOUR
    assert_allclose(speed, list(SPEED_DEG_PER_HOUR.values()), atol=4e-6)


def test_every_line_of_the_library_keeps_its_meaning():
    # Notices a library that numbers or combines its constituents differently.
    from utide import cycles_per_hour

    names = [n for n in cycles_per_hour if n not in ("SA", "S1")]
    assert len(names) == 144
    speed = doodson_numbers(names) @ RATES_DEG_PER_HOUR
    assert_allclose(speed, [360.0 * cycles_per_hour[n] for n in names], atol=1e-5)
    assert_allclose(
        [constituent_frequency(n) for n in names],
        np.radians(speed) / 3600.0,
        atol=1e-10,
    )


def test_arguments_advance_at_the_tabulated_speeds():
    names = tuple(SPEED_DEG_PER_HOUR)
    first, last = seconds(2003, 5, 1), seconds(2003, 7, 30)
    basis = prediction_basis(names, [first, last], 33.0, nodal="none")
    assert_allclose(np.abs(basis), 1.0)
    w = np.array([frequency(n) for n in names])
    # 1e-3 rad in 90 days is 3e-5 degrees an hour.
    assert (
        np.abs(np.angle(basis[:, 1] / basis[:, 0] * np.exp(-1j * w * 7776000.0))).max()
        < 1e-3
    )


def test_argument_of_the_moon_at_the_standard_epoch():
    # Mean longitudes at 2000-01-01 noon: moon 218.3164, sun 280.4665 degrees.
    noon = seconds(2000, 1, 1, 12)
    basis = prediction_basis(["M2", "S2", "S1", "SA", "K1"], [noon], 33.0, nodal="none")
    expected = [2 * (280.4665 - 218.3164), 0.0, 0.0, 280.4665, 280.4665 - 90.0]
    assert np.abs(turn(np.degrees(np.angle(basis[:, 0])) - expected)).max() < 0.05


@pytest.mark.parametrize(
    ("name", "swing"),
    [("M2", 0.037), ("O1", 0.187), ("K1", 0.115), ("K2", 0.286), ("MF", 0.41)],
)
def test_swing_over_the_18_6_years_of_the_node(name, swing):
    times = np.arange(seconds(1997, 1, 1), seconds(2015, 9, 1), 10 * 86400.0)
    factor = nodal_corrections([name], times, 33.0).factor[0]
    # The perigee adds its own 8.85-year wobble to Mf: a year's mean is not enough.
    half = 0.5 * (factor.max() - factor.min())
    assert_allclose(half, swing, rtol=0.12)
    # The moon's orbit was steepest in mid 2006: strong diurnal, weak semidiurnal tides.
    peak = times[factor.argmin() if name == "M2" else factor.argmax()]
    assert abs(peak - seconds(2006, 7, 1)) < 500 * 86400.0


def test_compound_tides_take_the_corrections_of_their_parents():
    t = seconds(2011, 3, 4, 5)
    names = ["M2", "S2", "K1", "M4", "M6", "MS4", "MK3", "2MK3", "MSF"]
    c = nodal_corrections(names, t, 33.0)
    f, a = dict(zip(names, c.factor)), dict(zip(names, c.argument))
    assert_allclose([f["M4"], f["M6"]], [f["M2"] ** 2, f["M2"] ** 3])
    assert_allclose(f["2MK3"], f["M2"] ** 2 * f["K1"])
    assert_allclose(f["MSF"], f["M2"] * f["S2"])
    sums = {
        "M4": 2 * a["M2"],
        "MS4": a["M2"] + a["S2"],
        "MK3": a["M2"] + a["K1"],
        "2MK3": 2 * a["M2"] - a["K1"],
        "MSF": a["S2"] - a["M2"],
    }
    for name, total in sums.items():
        assert_allclose(np.exp(1j * a[name]), np.exp(1j * total), atol=1e-7)


def test_against_the_arguments_of_an_independent_program():
    constituents = pytest.importorskip(
        "pyTMD.constituents", reason="pyTMD is not installed"
    )
    named = {"LAM2": "lambda2", "RHO": "rho1"}
    # M3 has the opposite sign there, MSf no parents, M1 and L2 other satellites.
    names = [
        n for n in SPEED_DEG_PER_HOUR if n not in ("STEADY", "M3", "M1", "L2", "SA")
    ]
    theirs = [named.get(n, n.lower()) for n in names]
    days = np.arange(10000.0, 17000.0, 317.3)
    u, f, v = constituents.arguments(days + 40587.0, theirs, corrections="GOT")
    ours = nodal_corrections(names, days * 86400.0, 40.0)
    off = np.abs(
        ours.factor * np.exp(1j * ours.argument)
        - (f * np.exp(1j * (u + np.radians(v)))).T
    )
    worst = dict(zip(names, off.max(axis=1)))
    for name in ("M2", "S2", "K1", "P1", "K2", "S1", "SSA", "MM", "MF"):
        assert worst[name] < 0.012, name
    for name in ("N2", "O1", "Q1", "NU2", "MU2", "M4", "MS4", "MN4", "MK3", "2MK3"):
        assert worst[name] < 0.045, name
    assert max(worst.values()) < 0.3


def test_prediction_is_the_sum_that_the_forcing_stands_for():
    names = ("M2", "K1", "STEADY", "M4")
    constants = np.array([[0.8 * np.exp(-0.3j)], [0.1j], [0.05], [0.02 + 0.01j]])
    start = seconds(1998, 3, 16)
    times = start + np.arange(0.0, 15 * 86400.0, 1800.0)
    level = predict(table(names, constants), times, place=0, nodal="middle")
    middle = 0.5 * (times[0] + times[-1])
    run = with_astronomy(forcing(*names), start, 33.0, middle_s=middle)
    phase = run.frequency[:, None] * (times - start) + run.argument[:, None]
    direct = (run.nodal_factor[:, None] * constants * np.exp(1j * phase)).real.sum(0)
    assert_allclose(level, direct, atol=2e-6)
    assert_allclose(level.mean(), 0.05, atol=0.02)
    # f and u of each day differ little from those of the middle in a fortnight.
    daily = predict(table(names, constants), times, place=0)
    assert 0.0 < np.abs(daily - level).max() < 2e-3


def test_prediction_made_with_the_bare_library():
    path = DATA / "charleston_prediction_1998_jan_mar.csv"
    if not path.exists():
        pytest.skip("the Charleston data are not beside the repository")
    from utide import constit_index_dict
    from utide.harmonics import FUV

    with open(DATA / "charleston_8665530_constituents.csv", newline="") as file:
        rows = list(csv.DictReader(file))
    with open(path, newline="") as file:
        made = list(csv.DictReader(file))
    times = np.array([datetime.fromisoformat(r["time_utc"]).timestamp() for r in made])
    level = np.array([float(r["predicted_m_msl"]) for r in made])
    constants = {
        r["constituent"]: (
            float(r["amplitude_m"])
            * np.exp(-1j * np.radians(float(r["phase_deg_gmt"]))),
            r["utide_name"],
        )
        for r in rows
    }
    # Three constituents mean something else to NOAA than to the library, in which the
    # file took them: leave those out of both.
    days = times / 86400.0 + 719163.0
    for name in ("SA", "S1", "2MK3"):
        value, library = constants.pop(name)
        line = np.array([constit_index_dict[library]])
        f, u, v = FUV(days, days[0], line, 32.7817, [False] * 4)
        level -= (value * f * np.exp(2j * np.pi * (u + v))).real[:, 0]
    assert len(constants) == 34
    ours = predict(
        table(
            tuple(constants), [[v] for v, _ in constants.values()], latitude=(32.7817,)
        ),
        times,
        place="gauge 0",
    )
    # The file has three decimals: 1 mm / sqrt(12) = 0.29 mm.
    assert np.sqrt(np.mean((ours - level) ** 2)) < 0.35e-3


def test_places_of_several_latitudes_and_absent_constituents():
    times = seconds(2005, 1, 1) + np.arange(0.0, 86400.0, 600.0)
    constants = np.array([[0.5, 0.5, np.nan], [0.1, np.nan, np.nan]])
    three = table(("M2", "O1"), constants, latitude=(33.0, 60.0, 33.0))
    level = predict(three, times)
    assert level.shape == (3, len(times))
    alone = predict(table(("M2",), [[0.5]], latitude=(60.0,)), times)
    assert_allclose(level[1], alone[0])
    assert np.isnan(level[2]).all()
    assert np.isfinite(level[:2]).all()


def test_times_far_apart_and_no_times():
    times = np.array([seconds(1950, 1, 1), seconds(1998, 3, 2, 7, 30)])
    one = table(("N2",), [[1.0]])
    both = predict(one, times, place=0)
    assert_allclose(both, [predict(one, [t], place=0)[0] for t in times], atol=1e-9)
    c = nodal_corrections(["N2"], times, 33.0)
    assert_allclose(both, c.factor[0] * np.cos(c.argument[0]), atol=2e-5)
    assert predict(one, []).shape == (1, 0)


def test_shapes_follow_the_times():
    assert nodal_corrections(["M2", "K1"], 0.0, 33.0).factor.shape == (2,)
    c = nodal_corrections(["M2", "K1"], [0.0, 1.0, 2.0], 33.0)
    assert c.argument.shape == (2, 3)
    assert (c.argument >= 0.0).all()
    assert (c.argument < 2.0 * np.pi).all()


def test_the_equator_and_lower_case_names():
    on, beside = (nodal_corrections(["q1"], 9e8, lat).factor for lat in (0.0, 5.0))
    assert_allclose(on, beside)
    assert_allclose(
        nodal_corrections(["Lambda2", "rho", "Mm"], 9e8, 10.0).factor,
        nodal_corrections(["LAM2", "RHO1", "MM"], 9e8, 10.0).factor,
    )


def test_what_is_not_known_is_named():
    with pytest.raises(InputError, match=r'"MS2" is not known; nearest: .*S2'):
        nodal_corrections(["M2", "MS2"], 0.0, 33.0)
    with pytest.raises(InputError, match="not known"):
        doodson_numbers(["?"])
    with pytest.raises(InputError, match="between -90 and 90"):
        nodal_corrections(["M2"], 0.0, 330.0)
    with pytest.raises(InputError, match="times must be numbers"):
        nodal_corrections(["M2"], [0.0, np.nan], 33.0)
    with pytest.raises(InputError, match="times must be numbers"):
        predict(table(("M2",), [[1.0]]), [np.inf])
    with pytest.raises(InputError, match='no station "gauge 7"; nearest: gauge 0'):
        predict(table(("M2",), [[1.0]]), [0.0], place="gauge 7")
    with pytest.raises(InputError, match="1 places, no number 3"):
        predict(table(("M2",), [[1.0]]), [0.0], place=3)
    with pytest.raises(ValueError, match="nodal must be"):
        predict(table(("M2",), [[1.0]]), [0.0], nodal="yearly")
