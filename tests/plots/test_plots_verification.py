"""Figures of modelled beside observed tides hold the data that they should."""

from dataclasses import replace
from datetime import UTC, datetime
from functools import partial
from typing import NamedTuple

import numpy as np
import pytest
from matplotlib.collections import LineCollection, PathCollection
from matplotlib.dates import num2date
from numpy.testing import assert_allclose

from tidemesh import plots
from tidemesh.datatypes import BoundaryString, CoastalMesh, TideTable
from tidemesh.geometry.projection import Projection

HOUR = 3600.0
START = datetime(1998, 3, 16, tzinfo=UTC).timestamp()


class Constants(NamedTuple):
    modelled: TideTable
    observed: TideTable


class Levels(NamedTuple):
    station: str
    time: np.ndarray
    observed: np.ndarray
    modelled: np.ndarray


def table(values):
    """Table of {constituent: [(amplitude, phase in degrees) of each gauge]}."""
    elevation = [
        [a * np.exp(-1j * np.radians(g)) for a, g in gauges]
        for gauges in values.values()
    ]
    n = len(elevation[0])
    return TideTable(
        np.linspace(-80.0, -79.9, n),
        np.linspace(33.0, 33.1, n),
        tuple(values),
        np.arange(1.0, 1.0 + len(values)),
        elevation,
        tuple("ABCDEFGH"[:n]),
    )


OBSERVED = table({"M2": [(1.0, 10), (0.8, 355), (0.5, 100)], "K1": [(0.1, 200)] * 3})
MODELLED = table(
    {"M2": [(1.05, 5), (0.6, 20), (0.5, 100)], "K1": [(0.1, 200), (0.1, 212), (0.2, 0)]}
)
BOTH = Constants(MODELLED, OBSERVED)


def points(axis):
    """Of every constituent (x, y)."""
    return {
        line.get_label(): np.stack(line.get_data())
        for line in axis.lines
        if line.get_label() in ("M2", "K1")
    }


def test_amplitudes_and_errors():
    axis = plots.plot_constants(BOTH)
    amplitudes = points(axis)
    assert_allclose(amplitudes["M2"], [[1.0, 0.8, 0.5], [1.05, 0.6, 0.5]])
    assert axis.get_title() == "6 constants of 3 gauges: 3 within 10 % and 10°"
    panel = axis.figure.axes[1]
    errors = points(panel)
    assert_allclose(errors["M2"], [[5, -25, 0], [-5, 25, 0]], atol=1e-9)
    assert_allclose(errors["K1"][1], [0, 12, 160], atol=1e-9)
    for one in (axis, panel):
        for data in points(one).values():
            for values, (low, high) in zip(data, (one.get_xlim(), one.get_ylim())):
                assert (values > low).all()
                assert (values < high).all()


def test_absent_constants_are_not_drawn():
    gaps = OBSERVED.elevation.copy()
    gaps[0, 0], gaps[0, 1], gaps[1, :] = np.nan, 0.0, np.nan
    axis = plots.plot_constants(Constants(MODELLED, replace(OBSERVED, elevation=gaps)))
    assert_allclose(points(axis)["M2"], [[0.5], [0.5]])
    assert points(axis)["K1"].size == 0


def test_phases_about_360_degrees_lie_on_the_line():
    axis = plots.plot_phases(BOTH)
    shown = points(axis)
    assert_allclose(shown["M2"], [[10, -5, 100], [5, 20, 100]], atol=1e-9)
    assert_allclose(shown["K1"], [[-160] * 3, [-160, -148, 0]], atol=1e-9)


def test_tables_that_do_not_fit():
    with pytest.raises(ValueError, match="same gauges: modelled 1, observed 3"):
        plots.plot_constants(Constants(table({"M2": [(1, 0)]}), OBSERVED))
    with pytest.raises(ValueError, match='no constituent "S2" among M2, K1'):
        plots.plot_constants(BOTH, names=["S2"])
    with pytest.raises(ValueError, match="no constituent in common"):
        plots.plot_phases(Constants(table({"S2": [(1, 0)] * 3}), OBSERVED))


def levels(step=HOUR):
    time = START + np.arange(0.0, 15 * 86400.0 + 1.0, step)
    cosine = np.cos(2e-4 * time)
    return Levels("Charleston", time, cosine, 0.9 * cosine)


def lines_of(axis):
    return {line.get_label(): line for line in axis.lines}


def test_records_and_their_residual():
    compared = levels()
    axis = plots.plot_records(compared)
    dots, line = (lines_of(axis)[name] for name in ("observed", "modelled"))
    assert_allclose(dots.get_ydata(), compared.observed)
    assert num2date(dots.get_xdata()[5]) == datetime(1998, 3, 16, 5, tzinfo=UTC)
    assert num2date(line.get_xdata()[-1]) == datetime(1998, 3, 31, tzinfo=UTC)
    # Between hourly levels the line is a curve, not a chord.
    seconds = np.asarray(line.get_xdata()[:-1]) * 86400.0
    assert len(seconds) > 5 * len(compared.time)
    assert_allclose(line.get_ydata()[:-1], 0.9 * np.cos(2e-4 * seconds), atol=0.01)
    beneath = axis.figure.axes[1]
    assert_allclose(beneath.lines[0].get_ydata()[:-1], -0.1 * compared.observed)
    rms = np.sqrt(np.mean((0.1 * compared.observed) ** 2))
    assert axis.get_title() == f"Charleston: rms error {rms:.3f} m"
    assert beneath.get_xlabel() == "1998, UTC"
    assert axis.get_ylim()[1] > 1.0


def test_gaps_stay_open_and_dense_levels_are_thinned():
    whole = levels()
    keep = np.ones(len(whole.time), dtype=bool)
    keep[100:110] = False
    gappy = Levels("", *(values[keep] for values in whole[1:]))
    axis = plots.plot_records(gappy)
    line = lines_of(axis)["modelled"]
    nothing = np.isnan(line.get_ydata())
    days = np.asarray(line.get_xdata())
    assert nothing.sum() == 2
    gap = (whole.time[[100, 109]]) / 86400.0
    assert not ((days > gap[0]) & (days < gap[1]) & ~nothing).any()
    assert axis.get_title().startswith("rms error")
    assert lines_of(axis)["observed"].get_markevery() == 1
    dense = lines_of(plots.plot_records(levels(step=360.0)))
    assert dense["observed"].get_markevery() == 10
    assert len(dense["modelled"].get_xdata()) == 15 * 240 + 2


def square():
    side = Projection.stereographic(-80.0, 33.0)
    corners = np.array([[-5e3, -5e3], [1e4, -5e3], [1e4, 1e4], [-5e3, 1e4]])
    strings = (
        BoundaryString("open", np.array([0, 1])),
        BoundaryString("mainland", np.array([1, 2, 3, 0])),
    )
    return CoastalMesh(corners, [[0, 1, 2], [0, 2, 3]], np.full(4, 9.0), strings, side)


def test_gauges_on_the_map():
    axis = plots.plot_gauge_map(square(), BOTH, "K1", labels=2)
    (spots,) = (c for c in axis.collections if isinstance(c, PathCollection))
    error = np.abs(MODELLED.elevation[1] - OBSERVED.elevation[1])
    # The worst comes last, on top.
    assert_allclose(spots.get_array(), np.sort(error))
    order = np.argsort(error)
    assert_allclose(
        spots.get_offsets(),
        np.stack([OBSERVED.longitude_deg, OBSERVED.latitude_deg], axis=1)[order],
    )
    assert [text.get_text() for text in axis.texts] == ["C", "B"]
    rms = np.sqrt(np.mean(error**2) / 2)
    assert axis.get_title() == f"K1 at 3 gauges: rms error {rms:.3f} m"
    lines = [c for c in axis.collections if isinstance(c, LineCollection)]
    assert [len(c.get_segments()) for c in lines] == [3, 1]


@pytest.mark.parametrize("suffix", [".png", ".svg"])
def test_same_bytes(tmp_path, suffix):
    for name, draw in {
        "constants": partial(plots.plot_constants, BOTH),
        "records": partial(plots.plot_records, levels()),
    }.items():
        paths = [tmp_path / f"{name}{k}{suffix}" for k in range(2)]
        for path in paths:
            plots.save_figure(path, draw, size_inches=(5, 4), dpi=60)
        assert paths[0].read_bytes() == paths[1].read_bytes()
