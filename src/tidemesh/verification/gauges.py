"""Modelled constants at the places of gauges."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from tidemesh.datatypes import CoastalMesh, TideSolution, TideTable
from tidemesh.triangulation import locate


class LeftOut(NamedTuple):
    """A gauge that the mesh does not serve."""

    gauge: str
    longitude_deg: float
    latitude_deg: float
    distance_m: float
    """From the mesh; NaN where the map of the mesh cannot hold the gauge."""
    reason: str


class GaugeTide(NamedTuple):
    """Modelled constants at gauges."""

    table: TideTable
    """At the gauges that are served, in the order of the observed table."""
    left_out: tuple[LeftOut, ...]
    distance_m: np.ndarray
    """(n_places,) m, of each gauge from the wet triangle whose tide it takes; zero
    inside the mesh."""


def constants_at_gauges(
    mesh: CoastalMesh,
    tide: TideSolution,
    observed: TideTable,
    *,
    farthest_m: float = 3000.0,
) -> GaugeTide:
    """Modelled constants at the gauges that lie in or near the mesh.

    Parameters
    ----------
    mesh : CoastalMesh
    tide : TideSolution
        On its nodes; NaN at nodes that fell dry.
    observed : TideTable
        Gauges.
    farthest_m : float
        A gauge on land, or in water that the mesh leaves out, takes the tide of the
        nearest place of the mesh up to this distance.

    Returns
    -------
    modelled : GaugeTide

    Notes
    -----
    Complex amplitudes are interpolated linearly, never amplitudes and phases apart.
    """
    wet = np.isfinite(tide.elevation[:, mesh.triangles]).all(axis=(0, 2))
    stations = station_names(observed)
    longitude, latitude = observed.longitude_deg, observed.latitude_deg
    n_gauges = len(longitude)
    elevation = np.full((len(tide.names), n_gauges), np.nan, dtype=np.complex128)
    distance = np.full(n_gauges, np.nan)
    if wet.any():
        locator = locate.Locator(mesh.points, mesh.triangles[wet])
        places = mesh.projection.forward(longitude, latitude)
        triangle, weight, gap = locator.nearest(places)
        known = triangle >= 0
        nodes = mesh.triangles[wet][triangle[known]]
        elevation[:, known] = (tide.elevation[:, nodes] * weight[known]).sum(axis=-1)
        distance[known] = gap[known]
    served = distance <= farthest_m
    left_out = tuple(
        LeftOut(
            stations[g],
            float(longitude[g]),
            float(latitude[g]),
            float(distance[g]),
            _reason(distance[g], farthest_m),
        )
        for g in np.flatnonzero(~served)
    )
    table = TideTable(
        longitude_deg=longitude[served],
        latitude_deg=latitude[served],
        names=tide.names,
        frequency=tide.frequency,
        elevation=elevation[:, served],
        stations=tuple(stations[g] for g in np.flatnonzero(served)),
    )
    return GaugeTide(table, left_out, distance[served])


def station_names(table: TideTable) -> tuple[str, ...]:
    """Names of the places of a table, their numbers where it has none."""
    return table.stations or tuple(
        f"place {k}" for k in range(1, len(table.longitude_deg) + 1)
    )


def _reason(distance: float, farthest: float) -> str:
    if math.isnan(distance):
        return "no place on the map of the mesh, or no wet triangle"
    return f"{distance / 1e3:.1f} km from the mesh, more than {farthest / 1e3:g} km"
