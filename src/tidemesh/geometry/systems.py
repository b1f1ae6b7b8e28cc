"""Coordinate reference systems of data files: degrees, a projected plane, or none."""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np
import pyproj
from numpy.typing import ArrayLike

from tidemesh.constants import EARTH_RADIUS
from tidemesh.errors import InputError
from tidemesh.geometry.projection import Projection

DEGREES = "EPSG:4326"
"""Longitude and latitude (WGS 84)."""

PLANE = ""
"""No place on earth: metres on a bare plane, as `Projection("")`."""


def is_degrees(crs: str) -> bool:
    """Whether coordinates in a system are longitudes and latitudes.

    Raises
    ------
    InputError
        If the system is unknown, or neither geographic nor projected.
    """
    if crs == PLANE:
        return False
    system = _system(crs)
    if not (system.is_geographic or system.is_projected):
        raise InputError(
            f'coordinate system "{crs}" is neither longitude and latitude nor a map '
            'projection: name one that is, for instance "EPSG:4326"'
        )
    return system.is_geographic


def from_degrees(crs: str, longitude_deg: ArrayLike, latitude_deg: ArrayLike):
    """Longitude and latitude -> (n, 2) coordinates in a system.

    Geographic systems are taken as one: their datums differ by metres.
    """
    if crs == PLANE or is_degrees(crs):
        return np.stack([longitude_deg, latitude_deg], axis=-1)
    return Projection(crs).forward(longitude_deg, latitude_deg)


def to_degrees(crs: str, coordinates: ArrayLike) -> np.ndarray:
    """(n, 2) coordinates in a system -> (n, 2) longitude and latitude."""
    coordinates = np.asarray(coordinates, dtype=np.float64)
    if crs == PLANE or is_degrees(crs):
        return coordinates.copy()
    return Projection(crs).inverse(coordinates)


def metres_per_unit(crs: str, y: ArrayLike) -> tuple[np.ndarray, np.ndarray]:
    """Lengths (m) of one unit along x and along y, at the given y coordinates."""
    y = np.asarray(y, dtype=np.float64)
    if crs != PLANE and is_degrees(crs):
        degree = math.pi / 180.0 * EARTH_RADIUS
        return degree * np.cos(np.radians(y)), np.full(y.shape, degree)
    unit = 1.0 if crs == PLANE else _system(crs).axis_info[0].unit_conversion_factor
    return np.full(y.shape, unit), np.full(y.shape, unit)


@lru_cache(maxsize=32)
def _system(crs: str) -> pyproj.CRS:
    try:
        return pyproj.CRS.from_user_input(crs)
    except pyproj.exceptions.CRSError as error:
        raise InputError(
            f'coordinate system "{crs}" is not known: {error}; name it as for instance '
            '"EPSG:4326" or "EPSG:32617"'
        ) from None
