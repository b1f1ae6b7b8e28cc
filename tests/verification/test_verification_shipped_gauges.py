"""The gauges that come with the South Carolina example."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from verification_cases import DAY, HOUR

from tidemesh.datatypes import TideRecord
from tidemesh.io.tide_tables import read_tide_table
from tidemesh.tides.astronomy import predict
from tidemesh.verification import compare_constants, harmonic_analysis


@pytest.fixture(scope="module")
def data(examples):
    return examples / "south_carolina" / "data"


def test_extracts_agree_with_the_table_of_gauges(data):
    gauges = read_tide_table(data / "gauges.csv")
    piers = read_tide_table(data / "open_coast_gauges.csv")
    found = compare_constants(piers, gauges)
    assert found.rss_error_m == 0.0
    assert len(found.observed.stations) == 6
    charleston = read_tide_table(data / "charleston_constants.csv")
    assert len(charleston.names) == 37
    row = gauges.stations.index("Charleston (Customhouse Wharf)")
    for name in ("M2", "S2", "N2", "K1", "O1", "M4", "M6"):
        assert_allclose(
            gauges.elevation[gauges.names.index(name), row],
            charleston.elevation[charleston.names.index(name), 0],
        )


def test_analysis_gives_back_what_the_prediction_was_made_of(data):
    """The almanac of the prediction and that of UTide agree."""
    pytest.importorskip("utide")
    published = read_tide_table(data / "charleston_constants.csv")
    long_period = ("SA", "SSA", "MM", "MF", "MSF")
    annual = ("S1", "T2", "R2")
    names = [n for n in published.names if n not in long_period + annual]
    elevation = published.elevation.copy()
    for name in long_period + annual:
        elevation[published.names.index(name)] = np.nan
    table = replace(published, elevation=elevation)
    start = float(np.datetime64("1998-01-01", "s").astype(int))
    time = start + np.arange(0.0, 210 * DAY, HOUR)
    record = TideRecord(time, predict(table, time, place=0), latitude_deg=32.78)
    found = harmonic_analysis(record, names)
    expected = [published.elevation[published.names.index(n), 0] for n in names]
    # A millimetre is the last digit that NOAA publishes.
    assert_allclose(found.elevation[:, 0], expected, atol=1.5e-3)
