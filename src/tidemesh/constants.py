"""Physical constants: value, unit, source."""

from __future__ import annotations

import math

GRAVITY = 9.81
"""Acceleration of gravity (m/s2), the value of ADCIRC and of the paper."""

EARTH_RADIUS = 6378206.4
"""Earth radius (m) of ADCIRC's spherical maps (equatorial radius, Clarke 1866)."""

EARTH_ROTATION = 7.29212e-5
"""Rotation rate of the earth (rad/s), the value of ADCIRC."""

SPEED_DEG_PER_HOUR = {
    "M2": 28.9841042,
    "S2": 30.0,
    "N2": 28.4397295,
    "K2": 30.0821373,
    "K1": 15.0410686,
    "O1": 13.9430356,
    "P1": 14.9589314,
    "Q1": 13.3986609,
    "M4": 57.9682084,
    "M6": 86.9523127,
    "MS4": 58.9841042,
    "MN4": 57.4238337,
    "NU2": 28.5125831,
    "MU2": 27.9682085,
    "2N2": 27.8953549,
    "LAM2": 29.4556253,
    "L2": 29.5284789,
    "T2": 29.9589333,
    "R2": 30.0410667,
    "2SM2": 31.0158958,
    "J1": 15.5854433,
    "M1": 14.4966939,
    "OO1": 16.1391017,
    "RHO": 13.4715145,
    "2Q1": 12.8542862,
    "S1": 15.0,
    "M3": 43.4761563,
    "MK3": 44.0251729,
    "2MK3": 42.9271398,
    "S4": 60.0,
    "S6": 90.0,
    "M8": 115.9364166,
    "MM": 0.5443747,
    "MF": 1.0980331,
    "MSF": 1.0158958,
    "SA": 0.0410686,
    "SSA": 0.0821373,
    "STEADY": 0.0,
}
"""Speeds (degrees per mean solar hour) of the constituents that NOAA CO-OPS publishes,
and of the steady part."""


def frequency(constituent: str) -> float:
    """Angular frequency of a tidal constituent (rad/s).

    Raises
    ------
    KeyError
        If the constituent is not in `SPEED_DEG_PER_HOUR`.

    Examples
    --------
    >>> round(frequency("M2") * 1e4, 6)
    1.405189
    """
    return math.radians(SPEED_DEG_PER_HOUR[constituent.upper()]) / 3600.0
