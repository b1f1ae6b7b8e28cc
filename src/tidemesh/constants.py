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
    "STEADY": 0.0,
}
"""Speeds (degrees per mean solar hour) of the common constituents, as published by
NOAA CO-OPS with its harmonic constants."""


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
