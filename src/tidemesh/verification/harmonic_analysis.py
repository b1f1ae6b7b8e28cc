"""Harmonic constants of a water level record, by UTide."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations
from types import ModuleType

import numpy as np

from tidemesh import constants
from tidemesh.datatypes import TideRecord, TideTable
from tidemesh.errors import EngineError, InputError

UTIDE_NAMES = {
    "LAM2": "LDA2",
    "M1": "NO1",
    "RHO": "RHO1",
    # One speed, 2 M2 - K1 = M2 + O1; see `_to_noaa` for their nodal factors.
    "2MK3": "MO3",
}
"""Names of UTide where they differ from those of NOAA, which this program uses."""

STEADY = "STEADY"
_HOUR, _DAY = 3600.0, 86400.0
_UTIDE_DAY_OF_1970 = 719163.0
"""Days of 1970-01-01 from the day before year 1."""


@dataclass(frozen=True, eq=False)
class HarmonicAnalysis:
    """Harmonic constants of one record, and how well they describe it."""

    table: TideTable
    """One place; Greenwich phases, nodal factors divided out."""
    amplitude_error_m: np.ndarray | None
    """(n_c,) half width of the 95 % confidence interval, or None if not asked for."""
    phase_error_deg: np.ndarray | None
    """(n_c,) the same of the phase."""
    mean_m: float
    trend_m_per_year: float
    residual_rms_m: float
    """Root mean square of what the constants (and mean, trend) do not describe."""
    n_values: int
    """Levels used, gaps not counted."""


def harmonic_analysis(
    record: TideRecord,
    names: Sequence[str],
    latitude_deg: float | None = None,
    *,
    trend: bool = False,
    nodal: bool = True,
    rayleigh: float = 1.0,
) -> TideTable:
    """Harmonic constants of a record: `analyse` without its report."""
    return analyse(
        record, names, latitude_deg, trend=trend, nodal=nodal, rayleigh=rayleigh
    ).table


def analyse(
    record: TideRecord,
    names: Sequence[str],
    latitude_deg: float | None = None,
    *,
    trend: bool = False,
    nodal: bool = True,
    rayleigh: float = 1.0,
    confidence: bool = False,
) -> HarmonicAnalysis:
    """Fit tidal constituents to a record by least squares (UTide).

    Parameters
    ----------
    record : TideRecord
        Any times, gaps as NaN.
    names : sequence of str
        Constituents; STEADY is the mean level.
    latitude_deg : float, optional
        For the nodal corrections; that of the record if not given.
    trend : bool
        Fit a linear trend as well.
    nodal : bool
        Divide the nodal factors of each time out of the amplitudes.
    rayleigh : float
        Least length of the record in periods of the difference of any two
        constituents. Less than 1 trusts a record without noise.
    confidence : bool
        Estimate 95 % intervals from the spectrum of the residual.

    Returns
    -------
    analysis : HarmonicAnalysis

    Raises
    ------
    InputError
        If a constituent is not known, the record is too short to tell two of them
        apart or too sparse for the fastest, or the latitude is missing.
    EngineError
        If UTide is not installed.

    Notes
    -----
    Codiga, D. L. (2011), Unified tidal analysis and prediction using the UTide Matlab
    functions, Technical Report 2011-01, University of Rhode Island. The nodal
    corrections and the equilibrium argument are those of every single time ("exact"),
    not of the middle of the record. UTide knows no nodal factors of MM, MF and MSF.
    Constituents that are left out of `names` stay in the residual and leak into those
    of nearly the same speed.
    """
    latitude = record.latitude_deg if latitude_deg is None else float(latitude_deg)
    known = np.isfinite(record.time) & np.isfinite(record.elevation)
    time, level = record.time[known], record.elevation[known]
    utide = _utide()
    fitted = [name.upper() for name in names if name.upper() != STEADY]
    frequency = _frequencies(names, utide)
    where = f' at "{record.station}"' if record.station else ""
    if not -90.0 <= latitude <= 90.0:
        raise InputError(
            f"the nodal corrections need the latitude of the record{where}; got "
            f"{latitude}"
        )
    _check_names(names)
    _check_length(time, names, frequency, rayleigh, trend, where)
    if not fitted:
        mean = float(level.mean())
        table = _table(record, names, frequency, {STEADY: complex(mean)})
        rms = float(np.sqrt(np.mean((level - mean) ** 2)))
        return HarmonicAnalysis(table, None, None, mean, 0.0, rms, len(time))

    coefficients = utide.solve(
        time / _DAY,
        level,
        # Diurnal corrections are divided by the sine of the latitude.
        lat=latitude if abs(latitude) >= 1e-3 else 1e-3,
        constit=[_utide_name(name) for name in fitted],
        order_constit="frequency",
        epoch="1970-01-01",
        trend=trend,
        nodal=nodal,
        phase="Greenwich",
        method="ols",
        conf_int="linear" if confidence else "none",
        Rayleigh_min=0.0,
        verbose=False,
    )
    place = {str(name): k for k, name in enumerate(coefficients.name)}
    order = [place[_utide_name(name)] for name in fitted]
    values = {
        name: complex(
            coefficients.A[k] * np.exp(-1j * math.radians(float(coefficients.g[k])))
        )
        for name, k in zip(fitted, order)
    }
    middle = 0.5 * (time[0] + time[-1])
    values = {
        name: value * _to_noaa(name, middle, latitude, nodal)
        for name, value in values.items()
    }
    mean = float(coefficients.mean)
    values[STEADY] = complex(mean)
    slope = float(coefficients.slope) if trend else 0.0
    fit = utide.reconstruct(
        time / _DAY,
        coefficients,
        epoch="1970-01-01",
        constit=list(coefficients.name),
        verbose=False,
    ).h
    return HarmonicAnalysis(
        table=_table(record, names, frequency, values),
        amplitude_error_m=_errors(names, fitted, order, coefficients, "A_ci"),
        phase_error_deg=_errors(names, fitted, order, coefficients, "g_ci"),
        mean_m=mean,
        trend_m_per_year=slope * 365.25,
        residual_rms_m=float(np.sqrt(np.mean((level - fit) ** 2))),
        n_values=len(time),
    )


def _utide() -> ModuleType:
    try:
        # Takes a second to load, and only those pay who analyse a record.
        import utide
    except ImportError as error:
        raise EngineError(
            "the harmonic analysis of records needs UTide: pip install utide"
        ) from error
    return utide


def _utide_name(name: str) -> str:
    return UTIDE_NAMES.get(name, name)


def _to_noaa(name: str, second: float, latitude: float, nodal: bool) -> complex:
    """From a constant of UTide to that of NOAA, where their arguments differ.

    The signal is Re(constant * E) with E = f exp(i (V + u)), so it is the ratio of the
    two E; these change by degrees in decades, and the middle of the record will do.
    """
    if name not in ("SA", "S1", "2MK3"):
        return 1.0

    from utide._ut_constants import constit_index_dict
    from utide.astronomy import ut_astron
    from utide.harmonics import FUV

    days = np.array([second / _DAY + _UTIDE_DAY_OF_1970])

    def argument(utide_name: str) -> complex:
        index = np.array([constit_index_dict[utide_name]])
        f, u, v = FUV(days, days[0], index, latitude, [False, not nodal, False, False])
        return complex(f[0, 0] * np.exp(2j * np.pi * (u + v)[0, 0]))

    if name == "S1":
        # The hour angle of the mean sun and nothing else.
        return argument("S1") / np.exp(2j * np.pi * (days[0] + 0.5))
    if name == "2MK3":
        return argument("MO3") / (argument("M2") ** 2 * np.conj(argument("K1")))
    # UTide counts the longitude of the sun from its perigee, the last of its six.
    return complex(np.exp(-2j * np.pi * ut_astron(days)[0][5, 0]))


# ---- what a record can tell ------------------------------------------------------


def _frequencies(names: Sequence[str], utide: ModuleType) -> np.ndarray:
    """(n_c,) rad/s."""
    if len(names) == 0:
        raise InputError("no constituents to analyse: name at least one")
    from utide._ut_constants import cycles_per_hour

    frequency = []
    for name in (name.upper() for name in names):
        if name != STEADY and _utide_name(name) not in cycles_per_hour:
            raise InputError(f"the constituent {name} is not known to UTide")
        if name in constants.SPEED_DEG_PER_HOUR:
            frequency.append(constants.frequency(name))
        else:
            cycles = float(cycles_per_hour[_utide_name(name)])
            frequency.append(2.0 * math.pi * cycles / _HOUR)
    return np.array(frequency)


def _check_names(names: Sequence[str]) -> None:
    seen: dict[str, str] = {}
    for name in names:
        twin = seen.setdefault(_utide_name(name.upper()), name)
        if twin is not name:
            raise InputError(f"the constituents {twin} and {name} are one: drop one")


def _check_length(
    time: np.ndarray,
    names: Sequence[str],
    frequency: np.ndarray,
    rayleigh: float,
    trend: bool,
    where: str,
) -> None:
    """Rayleigh's criterion for every two constituents, and for each and the mean."""
    unknowns = 1 + trend + 2 * int((frequency > 0.0).sum())
    if len(time) <= unknowns:
        raise InputError(
            f"the record{where} has {len(time)} levels, which do not determine "
            f"{unknowns} unknowns"
        )
    span = float(time[-1] - time[0])
    every = [*zip(names, frequency), *([] if 0.0 in frequency else [("the mean", 0.0)])]
    (first, second), gap = min(
        (((a, b), abs(fa - fb)) for (a, fa), (b, fb) in combinations(every, 2)),
        key=lambda pair: pair[1],
        default=(("", ""), math.inf),
    )
    needed = rayleigh * 2.0 * math.pi / gap
    # Hourly records of 29 days end an hour short of them.
    if span + float(np.median(np.diff(time))) < needed * (1.0 - 1e-9):
        raise InputError(
            f"the record{where} is {span / _DAY:.1f} days long and cannot tell "
            f"{first} and {second} apart, which takes {needed / _DAY:.1f} days: give a "
            f"longer record or drop {first if second == 'the mean' else second}"
        )
    fastest = int(np.argmax(frequency))
    step = float(np.median(np.diff(time)))
    if step * frequency[fastest] > math.pi * (1.0 + 1e-9):
        raise InputError(
            f"the record{where} has a level every {step / _HOUR:g} hours, too few for "
            f"{names[fastest]} with a period of "
            f"{2.0 * math.pi / frequency[fastest] / _HOUR:.2f} hours"
        )


# ---- results ---------------------------------------------------------------------


def _table(
    record: TideRecord,
    names: Sequence[str],
    frequency: np.ndarray,
    values: dict[str, complex],
) -> TideTable:
    upper = tuple(name.upper() for name in names)
    return TideTable(
        longitude_deg=[record.longitude_deg],
        latitude_deg=[record.latitude_deg],
        names=upper,
        frequency=frequency,
        elevation=np.array([[values[name]] for name in upper]),
        stations=(record.station,) if record.station else (),
    )


def _errors(
    names: Sequence[str], fitted: list[str], order: list[int], coefficients, key: str
) -> np.ndarray | None:
    if key not in coefficients:
        return None
    known = dict(zip(fitted, coefficients[key][order]))
    return np.array([known.get(name.upper(), math.nan) for name in names])
