"""Nodal corrections, equilibrium arguments and harmonic prediction.

The sum of the tide of a constituent is ``f A cos(w (t - t_ref) + (V + u) - G)`` with
amplitude A and Greenwich phase G, nodal factor f, and equilibrium argument V + u at the
reference time. Longitudes of moon and sun, satellites and shallow-water combinations
come from UTide; names and arguments are those of NOAA's tables (Schureman 1958), the
convention of published constants and of ADCIRC's fort.15.
"""

from __future__ import annotations

import difflib
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from tidemesh.constants import SPEED_DEG_PER_HOUR
from tidemesh.constants import frequency as tabulated_frequency
from tidemesh.datatypes import TideForcing, TideTable
from tidemesh.errors import InputError

Nodal = Literal["daily", "middle", "none"]

_DAY = 86400.0
_DAYS_TO_1970 = 719163.0
"""Day number of 1970-01-01 where 0001-01-01 is day 1 (`datetime.date.toordinal`)."""

_TURN = 2.0 * math.pi

_LIBRARY_NAMES = {
    "LAM2": "LDA2",
    "LAMBDA2": "LDA2",
    "RHO": "RHO1",
    "M1": "NO1",
    "STEADY": "Z0",
}
"""Names that the library spells otherwise. M1 is the line of speed 14.4966939."""

_COMPOUND = {
    # The library knows this speed as MO3 = M2 + O1, whose nodal factor is another.
    "2MK3": {"M2": 2, "K1": -1},
    # NOAA takes it for the beat of M2 and S2 in shallow water, with M2's nodal factor.
    "MSF": {"S2": 1, "M2": -1},
}
"""Constituents as sums of others, where NOAA's definition is not the library's."""

_SOLAR = {
    "SA": ((0, 0, 1, 0, 0, 0), 0.0),
    "S1": ((1, 1, -1, 0, 0, 0), 0.5),
}
"""Constituents of the weather: Doodson numbers, phase (turns). Their argument is the
mean sun's (V = h, V = T), without the perihelion that the library adds to it, and they
have no nodal factor."""

_SATELLITES = {
    "MM": ((0, -1, -0.0657), (0, 1, -0.0651), (2, 0, -0.0534), (2, 1, -0.0219)),
    "MF": ((0, 1, 0.4145), (0, 2, 0.0387), (-2, 0, 0.0432)),
}
"""Multiples of the longitudes of perigee and (negative) node, and amplitudes relative
to the main line, for constituents whose satellites the library lacks (Cartwright and
Edden 1973, Geophys. J. R. astr. Soc. 33)."""


@dataclass(frozen=True, eq=False)
class NodalCorrections:
    """What the positions of moon and sun make of harmonic constants."""

    names: tuple[str, ...]
    """(n_c,) constituent names."""
    factor: np.ndarray
    """(n_c,) or (n_c, n_times): nodal factor f of the amplitudes."""
    argument: np.ndarray
    """(n_c,) or (n_c, n_times) rad in [0, 2 pi): equilibrium argument V + u."""


def nodal_corrections(
    names: Sequence[str], time_s: ArrayLike, latitude_deg: float
) -> NodalCorrections:
    """Nodal factors and equilibrium arguments.

    Parameters
    ----------
    names : sequence of str
        Constituents, as NOAA names them (`tidemesh.constants.SPEED_DEG_PER_HOUR`), or
        any other that UTide knows.
    time_s : float or (n_times,) array
        s since 1970-01-01 UTC.
    latitude_deg : float
        Degrees north; satellites of the third degree vary with it.

    Returns
    -------
    corrections : NodalCorrections
        Arrays (n_c,) for one time, (n_c, n_times) for several.

    Raises
    ------
    InputError
        If a constituent is not known, or a time or the latitude is not a number.

    Examples
    --------
    >>> mid_1998 = nodal_corrections(["M2", "O1"], 899251200.0, 33.0)
    >>> [round(float(f), 2) for f in mid_1998.factor]
    [1.03, 0.83]
    """
    times = np.asarray(time_s, dtype=np.float64)
    factor, nodal, greenwich = _corrections(names, times.ravel(), latitude_deg)
    shape = (len(names), *times.shape)
    return NodalCorrections(
        names=tuple(names),
        factor=factor.reshape(shape),
        argument=np.mod(nodal + greenwich, _TURN).reshape(shape),
    )


def with_astronomy(
    forcing: TideForcing,
    time_s: float,
    latitude_deg: float,
    *,
    middle_s: float | None = None,
) -> TideForcing:
    """Forcing with the nodal factors and equilibrium arguments of a model run.

    As in ADCIRC's fort.15: the factor f and the angle u are those of the middle of the
    run, V that of the reference time.

    Parameters
    ----------
    forcing : TideForcing
    time_s : float
        Reference time of the run, from which its own time counts, s since 1970-01-01
        UTC.
    latitude_deg : float
    middle_s : float, optional
        Middle of the run, s since 1970-01-01 UTC; left out: the reference time.

    Returns
    -------
    forcing : TideForcing
        The same with `nodal_factor` and `argument`.

    Raises
    ------
    InputError
        As `nodal_corrections`.
    """
    middle = time_s if middle_s is None else middle_s
    times = np.array([time_s, middle], dtype=np.float64)
    factor, nodal, greenwich = _corrections(forcing.names, times, latitude_deg)
    return replace(
        forcing,
        nodal_factor=factor[:, 1],
        argument=np.mod(greenwich[:, 0] + nodal[:, 1], _TURN),
    )


def predict(
    table: TideTable,
    time_s: ArrayLike,
    *,
    place: int | str | None = None,
    nodal: Nodal = "daily",
) -> np.ndarray:
    """Water level from harmonic constants.

    Parameters
    ----------
    table : TideTable
        Its names say what the constituents are; its frequencies are not used.
        Constituents that a place lacks (NaN) are left out of its sum.
    time_s : (n_times,) array
        s since 1970-01-01 UTC.
    place : int or str, optional
        Row, or name of the station, of the one place wanted.
    nodal : {"daily", "middle", "none"}
        Nodal corrections of every day, of the middle of the times, or none.

    Returns
    -------
    elevation : (n_places, n_times) array, or (n_times,) for one place
        m; NaN at a place without any constant.

    Raises
    ------
    InputError
        If a constituent or the place is not known, or a time is not a number.
    """
    index = np.arange(len(table.longitude_deg))
    if place is not None:
        index = np.array([_place(table, place)])
    times = np.atleast_1d(np.asarray(time_s, dtype=np.float64))
    elevation = np.empty((len(index), len(times)))
    latitude = table.latitude_deg[index]
    for value in np.unique(latitude):
        rows = np.flatnonzero(latitude == value)
        basis = prediction_basis(table.names, times, value, nodal=nodal)
        constants = table.elevation[:, index[rows]]
        known = np.isfinite(constants)
        elevation[rows] = (np.where(known, constants, 0.0).T @ basis).real
        elevation[rows[~known.any(axis=0)]] = np.nan
    return elevation if place is None else elevation[0]


def prediction_basis(
    names: Sequence[str],
    time_s: ArrayLike,
    latitude_deg: float,
    *,
    nodal: Nodal = "daily",
) -> np.ndarray:
    """Time functions of constituents of amplitude 1 and Greenwich phase 0.

    Parameters
    ----------
    names : sequence of str
    time_s : (n_times,) array
        s since 1970-01-01 UTC.
    latitude_deg : float
    nodal : {"daily", "middle", "none"}
        As in `predict`.

    Returns
    -------
    basis : (n_c, n_times) complex array
        f exp(i (V + u)); the level is Re(sum over c of elevation[c] * basis[c]).

    Raises
    ------
    InputError
        As `nodal_corrections`.
    """
    if nodal not in ("daily", "middle", "none"):
        raise ValueError(f'nodal must be "daily", "middle" or "none", got {nodal!r}')
    times = np.atleast_1d(np.asarray(time_s, dtype=np.float64))
    if len(times) == 0:
        return np.empty((len(names), 0), dtype=np.complex128)
    speed = np.array([constituent_frequency(name) for name in names])
    if not np.isfinite(times).all():
        raise InputError(_BAD_TIME)
    day = np.floor(times / _DAY)
    midnights = np.unique(np.concatenate([day, day + 1.0])) * _DAY
    factor, angle, greenwich = _corrections(names, midnights, latitude_deg)
    if nodal == "none":
        factor, angle = np.ones_like(factor), np.zeros_like(angle)
    elif nodal == "middle":
        middle = np.array([0.5 * (times.min() + times.max())])
        factor, angle, _ = _corrections(names, middle, latitude_deg)
    # What is left beside the carrier exp(i w t) turns by less than a degree a day, so
    # that a straight line from midnight to midnight is exact to 1e-5.
    origin = midnights[0]
    carried = speed[:, None] * (midnights - origin)
    slow = factor * np.exp(1j * (greenwich + angle - carried))
    before = np.searchsorted(midnights, day * _DAY)
    share = times / _DAY - day
    basis = slow[:, before] * (1.0 - share) + slow[:, before + 1] * share
    return basis * np.exp(1j * speed[:, None] * (times - origin))


def doodson_numbers(names: Sequence[str]) -> np.ndarray:
    """Multiples of the six astronomical angles in the argument of each constituent.

    Parameters
    ----------
    names : sequence of str

    Returns
    -------
    numbers : (n_c, 6) int array
        Of mean lunar time, longitudes of moon, sun, lunar perigee, the negative of the
        ascending node, and solar perigee.

    Raises
    ------
    InputError
        If a constituent is not known.

    Examples
    --------
    >>> doodson_numbers(["N2", "M4"]).tolist()
    [[2, -1, 0, 1, 0, 0], [4, 0, 0, 0, 0, 0]]
    """
    numbers = np.zeros((len(names), 6), dtype=np.int64)
    for k, name in enumerate(names):
        for line, multiple in _lines(name).items():
            if line in _SOLAR:
                numbers[k] += multiple * np.array(_SOLAR[line][0])
            else:
                numbers[k] += multiple * _library_numbers(line)
    return numbers


def constituent_frequency(name: str) -> float:
    """Angular frequency (rad/s) of any constituent that has nodal corrections here.

    The tabulated one of `tidemesh.constants` where there is one, UTide's otherwise.

    Raises
    ------
    InputError
        If the constituent is not known.
    """
    if name.upper() in SPEED_DEG_PER_HOUR:
        return tabulated_frequency(name)
    from utide import cycles_per_hour

    ((line, multiple),) = _lines(name).items()
    return multiple * _TURN * float(cycles_per_hour[line]) / 3600.0


_BAD_TIME = "times must be numbers (s since 1970-01-01 UTC), got NaN or infinity"


def _corrections(
    names: Sequence[str], time_s: np.ndarray, latitude_deg: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Nodal factor f, nodal angle u and argument V (rad), each (n_c, n_times)."""
    if not np.isfinite(time_s).all():
        raise InputError(_BAD_TIME)
    if not -90.0 <= latitude_deg <= 90.0:
        raise InputError(
            "the latitude of nodal corrections must lie between -90 and 90 degrees "
            f"north, got {latitude_deg}"
        )
    days = time_s / _DAY + _DAYS_TO_1970
    parts = [_lines(name) for name in names]
    lines = sorted({line for part in parts for line in part})
    of_line = _line_corrections(lines, days, latitude_deg)
    factor = np.ones((len(names), len(days)))
    nodal = np.zeros_like(factor)
    greenwich = np.zeros_like(factor)
    for k, part in enumerate(parts):
        for line, multiple in part.items():
            f, u, v = of_line[line]
            factor[k] *= f ** abs(multiple)
            nodal[k] += multiple * u
            greenwich[k] += multiple * v
    return factor, _TURN * nodal, _TURN * greenwich


def _lines(name: str) -> dict[str, int]:
    """A constituent as multiples of lines of the library or of `_SOLAR`."""
    key = name.upper()
    if key in _COMPOUND:
        return _COMPOUND[key]
    line = _LIBRARY_NAMES.get(key, key)
    if line in _SOLAR or line in _library_index():
        return {line: 1}
    known = sorted({*SPEED_DEG_PER_HOUR, *_library_index()})
    near = difflib.get_close_matches(key, known, n=3, cutoff=0.4)
    raise InputError(
        f'tidal constituent "{name}" is not known; '
        + (f"nearest: {', '.join(near)}" if near else "names are for instance M2, K1")
    )


def _place(table: TideTable, place: int | str) -> int:
    n = len(table.longitude_deg)
    if isinstance(place, str):
        if place in table.stations:
            return table.stations.index(place)
        near = difflib.get_close_matches(place, table.stations, n=3, cutoff=0.4)
        raise InputError(
            f'the tidal constants have no station "{place}"'
            + (f"; nearest: {', '.join(near)}" if near else "")
        )
    if not 0 <= place < n:
        raise InputError(f"the tidal constants have {n} places, no number {place}")
    return int(place)


# The library is met in the four functions below and nowhere else. It is imported when
# first needed, since it brings the whole of scipy.signal and scipy.stats.


def _library_index() -> dict[str, int]:
    from utide import constit_index_dict

    return constit_index_dict


def _library_numbers(line: str) -> np.ndarray:
    """Doodson numbers of a line, or their sum for a shallow-water constituent."""
    from utide import ut_constants

    row = _library_index()[line]
    count = ut_constants.const.nshallow[row]
    if np.isnan(count):
        return ut_constants.const.doodson[row].astype(np.int64)
    first = int(ut_constants.const.ishallow[row]) - 1
    terms = slice(first, first + int(count))
    parents = ut_constants.shallow.iname[terms].astype(np.int64) - 1
    # Multiples may be fractions: M7 is 3.5 times M2.
    total = ut_constants.shallow.coef[terms] @ ut_constants.const.doodson[parents]
    return np.rint(total).astype(np.int64)


def _longitudes(days: np.ndarray) -> np.ndarray:
    """(6, n) turns: lunar time, moon, sun, perigee, negative node, solar perigee."""
    from utide.astronomy import ut_astron

    return ut_astron(days)[0]


def _line_corrections(
    lines: Sequence[str], days: np.ndarray, latitude_deg: float
) -> dict[str, tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """Factor, angle and argument (turns), each (n_days,), of every line."""
    from utide.harmonics import FUV

    found = {}
    longitudes = _longitudes(days)
    of_library = [line for line in lines if line not in _SOLAR]
    if of_library:
        index = np.array([_library_index()[line] for line in of_library])
        # The library holds latitudes at least 5 degrees from the equator, but divides
        # by zero on it.
        latitude = latitude_deg if latitude_deg != 0.0 else 5.0
        exact = [False, False, False, False]
        fuv = FUV(days, days[0], index, latitude, exact)
        for line, f, u, v in zip(of_library, *(part.T for part in fuv)):
            found[line] = f, u, v
    for line in lines:
        if line in _SOLAR:
            numbers, phase = _SOLAR[line]
            argument = np.array(numbers) @ longitudes + phase
            found[line] = np.ones(len(days)), np.zeros(len(days)), argument
        elif line in _SATELLITES:
            perigee, node = longitudes[3], longitudes[4]
            total = 1.0 + sum(
                size * np.exp(1j * _TURN * (k * perigee + m * node))
                for k, m, size in _SATELLITES[line]
            )
            found[line] = np.abs(total), np.angle(total) / _TURN, found[line][2]
    return found
