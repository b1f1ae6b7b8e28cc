"""Tidal forcing and solutions: value = Re(amplitude * exp(+i * frequency * t))."""

from __future__ import annotations

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
    """(n_c, n_ocean) m."""

    def __post_init__(self) -> None:
        own_fields(self, nodes=(np.int64, (None,)))
        n_c = len(self.names)
        own_fields(
            self,
            frequency=(np.float64, (n_c,)),
            elevation=(np.complex128, (n_c, len(self.nodes))),
        )


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
    """(n_points,) linear friction coefficient tau, 1/s."""
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
            friction=(np.float64, (n_points,)),
        )
        if self.coriolis is not None:
            own_fields(self, coriolis=(np.float64, (n_points,)))
