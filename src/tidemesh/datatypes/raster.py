"""Bed elevations as they come from files."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tidemesh.datatypes._arrays import FloatArray, own_fields


@dataclass(frozen=True, eq=False)
class Raster:
    """Bed elevation on a rectangular grid, rows from south to north."""

    x: FloatArray
    """(nx,) cell centres, ascending, in the units of `crs`."""
    y: FloatArray
    """(ny,) cell centres, ascending, in the units of `crs`."""
    elevation: FloatArray
    """(ny, nx) m, positive up, NaN where unknown."""
    crs: str
    """Anything pyproj reads, for instance "EPSG:4326"."""
    name: str = ""
    """File name, for messages."""

    def __post_init__(self) -> None:
        own_fields(self, x=(np.float64, (None,)), y=(np.float64, (None,)))
        own_fields(self, elevation=(np.float64, (len(self.y), len(self.x))))


@dataclass(frozen=True, eq=False)
class Soundings:
    """Scattered bed elevations."""

    points: FloatArray
    """(n, 2) in the units of `crs` (longitude, latitude for "EPSG:4326")."""
    elevation: FloatArray
    """(n,) m, positive up."""
    crs: str
    name: str = ""

    def __post_init__(self) -> None:
        own_fields(self, points=(np.float64, (None, 2)))
        own_fields(self, elevation=(np.float64, (len(self.points),)))
