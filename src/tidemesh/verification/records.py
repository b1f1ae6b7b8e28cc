"""Water levels as time series, modelled against observed (paper, Fig. 9)."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, fields
from datetime import UTC, datetime, timedelta
from itertools import pairwise
from typing import Any, Literal

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.optimize import minimize_scalar

from tidemesh.datatypes import TideRecord
from tidemesh.errors import InputError

Interpolation = Literal["cubic", "linear"]

_LAG_STEP_S = 120.0
"""Spacing of the lags that are tried before the best is refined."""


@dataclass(frozen=True, eq=False)
class RecordComparison:
    """Two records at the times of the observed one."""

    station: str
    time: np.ndarray
    """(n,) s since 1970-01-01 00:00 UTC."""
    observed: np.ndarray
    """(n,) m, about its mean where the means were removed."""
    modelled: np.ndarray
    """(n,) m, the same."""
    means_removed: bool
    bias_m: float
    """Mean of modelled less observed, before the means were removed."""
    rms_error_m: float
    largest_error_m: float
    """Modelled less observed, where it is largest in size,"""
    largest_error_time: float
    """and when (s)."""
    correlation: float
    amplitude_ratio: float
    """Standard deviation of the modelled over that of the observed level."""
    skill: float
    """Willmott's index of agreement, 1 = equal."""
    lag_minutes: float
    """Shift of best fit, positive where the model is late; NaN if none lies within the
    lags that were tried."""
    rms_error_without_lag_m: float
    """What is left when the model is shifted by that."""

    @property
    def residual(self) -> np.ndarray:
        """(n,) m, modelled less observed."""
        return self.modelled - self.observed

    def as_dict(self) -> dict[str, Any]:
        """The figures, without the series, as plain values for JSON."""
        skipped = {"time", "observed", "modelled", "largest_error_time"}
        return {
            **{
                one.name: getattr(self, one.name)
                for one in fields(self)
                if one.name not in skipped
            },
            "values": len(self.time),
            "start": iso_time(self.time[0]),
            "end": iso_time(self.time[-1]),
            "largest_error_time": iso_time(self.largest_error_time),
        }

    def as_text(self) -> str:
        """A few lines to print."""
        told = self.as_dict()
        return (
            f"{self.station or 'record'}: {told['values']} levels from {told['start']} "
            f"to {told['end']}\n"
            f"  rms error {self.rms_error_m:.3f} m"
            f"{' about the means' if self.means_removed else ''}, "
            f"bias {self.bias_m:+.3f} m, largest {self.largest_error_m:+.3f} m at "
            f"{told['largest_error_time']}\n"
            f"  amplitude ratio {self.amplitude_ratio:.3f}, correlation "
            f"{self.correlation:.4f}, skill {self.skill:.4f}, lag "
            f"{self.lag_minutes:+.1f} min (rms {self.rms_error_without_lag_m:.3f} m "
            "without it)"
        )


def compare_records(
    modelled: TideRecord,
    observed: TideRecord,
    *,
    start: float | None = None,
    end: float | None = None,
    remove_mean: bool = True,
    interpolation: Interpolation = "cubic",
    longest_gap_s: float | None = None,
    largest_lag_minutes: float = 180.0,
) -> RecordComparison:
    """Compare water levels at the times of the observations.

    Parameters
    ----------
    modelled : TideRecord
        Interpolated in time.
    observed : TideRecord
    start, end : float, optional
        s since 1970-01-01 00:00 UTC, both inclusive; all that the records have in
        common if not given.
    remove_mean : bool
        Compare the levels about their means, where the two datums differ.
    interpolation : {"cubic", "linear"}
        A cubic spline follows the tide between hourly levels to a millimetre; a line
        cuts 3 % off a semi-diurnal crest.
    longest_gap_s : float, optional
        The model is not interpolated over longer gaps; 1.5 times its median step if not
        given.
    largest_lag_minutes : float
        The lag of best fit is looked for up to this.

    Returns
    -------
    comparison : RecordComparison

    Raises
    ------
    InputError
        If fewer than three times are common to both records.

    Notes
    -----
    The lag minimises the rms error about the means over shifts of the model, at the
    observed times that the model reaches for the largest shifts both ways. Skill:
    Willmott, C. J. (1981), On the validation of models, Physical Geography 2, 184-194.
    """
    low = -math.inf if start is None else start
    high = math.inf if end is None else end
    wanted = np.isfinite(observed.elevation)
    wanted &= (observed.time >= low) & (observed.time <= high)
    model = _Interpolated(modelled, interpolation, longest_gap_s)
    time, truth = observed.time[wanted], observed.elevation[wanted]
    level = model(time)
    common = np.isfinite(level)
    if common.sum() < 3:
        raise InputError(_nothing_common(modelled, observed, wanted, int(common.sum())))
    time, truth, level = time[common], truth[common], level[common]
    bias = float(np.mean(level - truth))
    lag, shifted = _best_lag(model, time, truth, 60.0 * largest_lag_minutes)
    correlation = _correlation(level, truth)
    ratio = float(np.std(level) / np.std(truth)) if np.std(truth) > 0.0 else math.nan
    if remove_mean:
        level, truth = level - level.mean(), truth - truth.mean()
    error = level - truth
    worst = int(np.argmax(np.abs(error)))
    spread = np.abs(level - truth.mean()) + np.abs(truth - truth.mean())
    total = float(np.sum(spread**2))
    return RecordComparison(
        station=observed.station or modelled.station,
        time=time,
        observed=truth,
        modelled=level,
        means_removed=remove_mean,
        bias_m=bias,
        rms_error_m=_rms(error),
        largest_error_m=float(error[worst]),
        largest_error_time=float(time[worst]),
        correlation=correlation,
        amplitude_ratio=ratio,
        skill=1.0 - float(np.sum(error**2)) / total if total > 0.0 else math.nan,
        lag_minutes=lag / 60.0,
        rms_error_without_lag_m=shifted,
    )


def iso_time(second: float) -> str:
    """1998-03-16T00:00:00Z of seconds since 1970."""
    when = datetime.fromtimestamp(0, UTC) + timedelta(seconds=round(float(second)))
    return when.isoformat().replace("+00:00", "Z")


# ---- the model at any time -------------------------------------------------------


class _Interpolated:
    """A record as a function of time: NaN outside it and in its gaps."""

    def __init__(
        self, record: TideRecord, kind: Interpolation, longest_gap_s: float | None
    ):
        if kind not in ("cubic", "linear"):
            raise ValueError(f'interpolation must be "cubic" or "linear", got "{kind}"')
        known = np.isfinite(record.elevation)
        self.time, self.level = record.time[known], record.elevation[known]
        steps = np.diff(self.time)
        if (steps <= 0.0).any():
            raise InputError(
                f'the times of the modelled record "{record.station}" do not increase'
            )
        longest = longest_gap_s
        if longest is None:
            longest = 1.5 * float(np.median(steps)) if len(steps) else 0.0
        self.open = steps > longest
        ends = [0, *(np.flatnonzero(self.open) + 1), len(self.time)]
        self.runs = [
            (a, b, _curve(self.time[a:b], self.level[a:b], kind))
            for a, b in pairwise(ends)
            if b > a
        ]

    def __call__(self, time: np.ndarray) -> np.ndarray:
        level = np.full(len(time), np.nan)
        for a, b, curve in self.runs:
            within = (time >= self.time[a]) & (time <= self.time[b - 1])
            level[within] = curve(time[within])
        return level


def _curve(time: np.ndarray, level: np.ndarray, kind: Interpolation) -> Callable:
    if kind == "cubic" and len(time) >= 4:
        return CubicSpline(time, level)
    return lambda when: np.interp(when, time, level)


# ---- measures --------------------------------------------------------------------


def _rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(values**2)))


def _correlation(level: np.ndarray, truth: np.ndarray) -> float:
    a, b = level - level.mean(), truth - truth.mean()
    size = math.sqrt(float(a @ a) * float(b @ b))
    return float(a @ b) / size if size > 0.0 else math.nan


def _best_lag(
    model: _Interpolated, time: np.ndarray, truth: np.ndarray, largest: float
) -> tuple[float, float]:
    """Lag (s) and the rms error (m) left when it is taken out; NaN if there is none."""
    lags = np.arange(-math.ceil(largest / _LAG_STEP_S), largest / _LAG_STEP_S + 1.0)
    lags = lags * _LAG_STEP_S
    kept = np.isfinite(model(time + lags[0])) & np.isfinite(model(time + lags[-1]))
    kept &= np.isfinite(model(time))
    if kept.sum() < 3 or np.ptp(truth[kept]) == 0.0:
        return math.nan, math.nan
    time, truth = time[kept], truth[kept] - truth[kept].mean()

    def error(lag: float) -> float:
        difference = model(time + lag) - truth
        difference = difference[np.isfinite(difference)]
        return float(np.std(difference)) if difference.size else math.inf

    errors = [error(lag) for lag in lags]
    best = int(np.argmin(errors))
    if best in (0, len(lags) - 1):
        return math.nan, math.nan
    found = minimize_scalar(
        error,
        bounds=(lags[best - 1], lags[best + 1]),
        method="bounded",
        options={"xatol": 1e-3},
    )
    if found.fun < errors[best]:
        return float(found.x), float(found.fun)
    return float(lags[best]), errors[best]


def _nothing_common(
    modelled: TideRecord, observed: TideRecord, wanted: np.ndarray, number: int
) -> str:
    def span(time: np.ndarray) -> str:
        if not len(time):
            return "nothing"
        return f"{iso_time(time[0])} to {iso_time(time[-1])}"

    known = np.isfinite(modelled.elevation)
    name = observed.station or modelled.station
    return (
        f"the records{f' of {name}' if name else ''} have {number} times in common, at "
        f"least 3 are needed: modelled {span(modelled.time[known])}, observed within "
        f"the time asked for {span(observed.time[wanted])}"
    )
