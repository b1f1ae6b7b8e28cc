"""Between longitude and latitude and the plane in which everything is computed."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import pyproj
from numpy.typing import ArrayLike

from tidemesh.constants import EARTH_RADIUS
from tidemesh.errors import InputError


@dataclass(frozen=True)
class Projection:
    """A map projection, or the bare plane (``crs = ""``) for cases without a place.

    On the bare plane "degrees" are metres: both ways are the identity.
    """

    crs: str = ""
    """Projected system in metres: EPSG code, PROJ string or WKT; "" for none."""

    @classmethod
    def stereographic(cls, longitude_deg: float, latitude_deg: float) -> Projection:
        """Conformal map about a centre: angles and equilateral triangles stay."""
        return cls(
            f"+proj=stere +lat_0={latitude_deg:.6f} +lon_0={longitude_deg:.6f} "
            "+k=1 +ellps=WGS84 +units=m +no_defs"
        )

    @classmethod
    def equirectangular(cls, longitude_deg: float, latitude_deg: float) -> Projection:
        """ADCIRC's map: x = R dlon cos(lat0), y = R dlat (its ICS = 2)."""
        return cls(
            f"+proj=eqc +lat_ts={latitude_deg:.6f} +lat_0={latitude_deg:.6f} "
            f"+lon_0={longitude_deg:.6f} +R={EARTH_RADIUS} +units=m +no_defs"
        )

    @cached_property
    def _transformer(self) -> pyproj.Transformer:
        try:
            target = pyproj.CRS.from_user_input(self.crs)
            if not target.is_projected:
                raise InputError(
                    f'projection "{self.crs}" is not in metres: name a projected '
                    'system, for instance "EPSG:32617", or "stereographic"'
                )
            # The longitudes and latitudes of a sphere are taken over unchanged: that
            # is what ADCIRC does with its degrees.
            return pyproj.Transformer.from_crs(
                target.geodetic_crs, target, always_xy=True
            )
        except pyproj.exceptions.ProjError as error:
            raise InputError(
                f'projection "{self.crs}" is not known: {error}'
            ) from error

    @cached_property
    def _central_meridian(self) -> float:
        """Longitude (degrees) of the natural origin; 0 if the map has none."""
        operation = pyproj.CRS.from_user_input(self.crs).coordinate_operation
        for parameter in operation.params if operation else ():
            if parameter.name == "Longitude of natural origin":
                return math.degrees(parameter.value * parameter.unit_conversion_factor)
        return 0.0

    def forward(self, longitude_deg: ArrayLike, latitude_deg: ArrayLike) -> np.ndarray:
        """Degrees to metres: (n,) and (n,) -> (n, 2)."""
        lon = np.asarray(longitude_deg, dtype=np.float64)
        lat = np.asarray(latitude_deg, dtype=np.float64)
        if not self.crs:
            return np.stack([lon, lat], axis=-1)
        x, y = self._transformer.transform(lon, lat)
        return np.stack([np.asarray(x), np.asarray(y)], axis=-1)

    def inverse(self, points: ArrayLike) -> np.ndarray:
        """Metres to degrees: (n, 2) -> (n, 2) longitude, latitude.

        Longitudes lie within 180 degrees of the map's central meridian, so that they
        do not jump at the date line.
        """
        xy = np.asarray(points, dtype=np.float64)
        if not self.crs:
            return xy.copy()
        lon, lat = self._transformer.transform(
            xy[..., 0], xy[..., 1], direction="INVERSE"
        )
        lon = np.asarray(lon)
        # Only those beyond are moved, since moving costs the last digit.
        turns = np.floor((lon - self._central_meridian + 180.0) / 360.0)
        lon = np.where(turns == 0.0, lon, lon - 360.0 * turns)
        return np.stack([lon, np.asarray(lat)], axis=-1)

    def east_north(self, points: ArrayLike, vectors: ArrayLike) -> np.ndarray:
        """Components along x and y to components towards east and north.

        North is turned against the y axis by the convergence of the meridians, a degree
        and more in a wide domain. Unchanged on the bare plane.

        Parameters
        ----------
        points : (n, 2) array
            m.
        vectors : (..., n, 2) real or complex array

        Returns
        -------
        turned : (..., n, 2) array
        """
        return self._turned(points, vectors, 1.0)

    def from_east_north(self, points: ArrayLike, vectors: ArrayLike) -> np.ndarray:
        """Components towards east and north to components along x and y.

        The inverse of `east_north`, with the same arguments.
        """
        return self._turned(points, vectors, -1.0)

    def _turned(self, points: ArrayLike, vectors: ArrayLike, way: float) -> np.ndarray:
        xy = np.asarray(vectors)
        if not self.crs:
            return xy.copy()
        longitude, latitude = self.inverse(points).T
        factors = pyproj.Proj(self.crs).get_factors(longitude, latitude)
        turn = way * np.radians(factors.meridian_convergence)
        cos, sin = np.cos(turn), np.sin(turn)
        x, y = xy[..., 0], xy[..., 1]
        return np.stack([cos * x + sin * y, cos * y - sin * x], axis=-1)
