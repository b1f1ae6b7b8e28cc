"""Tidal forcing and solutions: value = Re(amplitude * exp(+i * frequency * t))."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from tidemesh.datatypes._arrays import ComplexArray, FloatArray, IntArray, own_fields


@dataclass(frozen=True, eq=False)
class TideTable:
    """Harmonic constants of elevation at places: a boundary table, gauges."""

    longitude_deg: FloatArray
    """(n_places,)."""
    latitude_deg: FloatArray
    """(n_places,)."""
    names: tuple[str, ...]
    """(n_c,) constituent names, for instance ("M2", "S2")."""
    frequency: FloatArray
    """(n_c,) rad/s."""
    elevation: ComplexArray
    """(n_c, n_places) m, amplitude * exp(-i * Greenwich phase), NaN where absent."""
    stations: tuple[str, ...] = ()
    """(n_places,) station names, or empty."""

    def __post_init__(self) -> None:
        own_fields(self, longitude_deg=(np.float64, (None,)))
        n_places, n_c = len(self.longitude_deg), len(self.names)
        own_fields(
            self,
            latitude_deg=(np.float64, (n_places,)),
            frequency=(np.float64, (n_c,)),
            elevation=(np.complex128, (n_c, n_places)),
        )


@dataclass(frozen=True, eq=False)
class TideForcing:
    """Prescribed elevation at the ocean nodes of a mesh."""

    names: tuple[str, ...]
    """(n_c,) constituent names."""
    frequency: FloatArray
    """(n_c,) rad/s."""
    nodes: IntArray
    """(n_ocean,) node indices."""
    elevation: ComplexArray
    """(n_c, n_ocean) m, amplitude * exp(-i * Greenwich phase), nodal factors not in."""
    nodal_factor: FloatArray | None = None
    """(n_c,) factor f of the amplitudes at the time of interest; None for 1."""
    argument: FloatArray | None = None
    """(n_c,) rad, equilibrium argument V + u at the reference time; None for 0."""
    potential: ComplexArray | None = None
    """(n_c, n_points) m, equilibrium tide at the nodes of the mesh times the body-tide
    factor, with Greenwich phases like `elevation`; None where the astronomical forces
    are left out."""

    def __post_init__(self) -> None:
        own_fields(self, nodes=(np.int64, (None,)))
        n_c = len(self.names)
        own_fields(
            self,
            frequency=(np.float64, (n_c,)),
            elevation=(np.complex128, (n_c, len(self.nodes))),
        )
        for name in ("nodal_factor", "argument"):
            if getattr(self, name) is not None:
                own_fields(self, **{name: (np.float64, (n_c,))})
        if self.potential is not None:
            own_fields(self, potential=(np.complex128, (n_c, None)))


@dataclass(frozen=True, eq=False)
class TideSolution:
    """Complex amplitudes of a tide on the nodes of a mesh."""

    names: tuple[str, ...]
    """(n_c,) constituent names."""
    frequency: FloatArray
    """(n_c,) rad/s."""
    elevation: ComplexArray
    """(n_c, n_points) m."""
    velocity: ComplexArray
    """(n_c, n_points, 2) m/s, along x and y of the mesh."""
    friction: FloatArray
    """(n_points,) linear friction coefficient tau, 1/s; or (n_c, n_points) where every
    constituent has its own (quadratic friction)."""
    gravity: float = 9.81
    """m/s2."""
    coriolis: FloatArray | None = None
    """(n_points,) Coriolis parameter f, rad/s; None for no rotation."""

    def __post_init__(self) -> None:
        n_c = len(self.names)
        own_fields(self, elevation=(np.complex128, (n_c, None)))
        n_points = self.elevation.shape[1]
        own_fields(
            self,
            frequency=(np.float64, (n_c,)),
            velocity=(np.complex128, (n_c, n_points, 2)),
        )
        each = np.ndim(self.friction) == 2
        shape = (n_c, n_points) if each else (n_points,)
        own_fields(self, friction=(np.float64, shape))
        if self.coriolis is not None:
            own_fields(self, coriolis=(np.float64, (n_points,)))


@dataclass(frozen=True, eq=False)
class TideRecord:
    """Water level at one place as a time series, observed or modelled."""

    time: FloatArray
    """(n,) s since 1970-01-01 00:00 UTC, ascending."""
    elevation: FloatArray
    """(n,) m above the datum, NaN in gaps."""
    station: str = ""
    longitude_deg: float = math.nan
    latitude_deg: float = math.nan
    datum: str = "mean sea level"

    def __post_init__(self) -> None:
        own_fields(self, time=(np.float64, (None,)))
        own_fields(self, elevation=(np.float64, (len(self.time),)))
