"""Interior points of the base grid."""

from __future__ import annotations

import math

import numpy as np

from tidemesh.basegrid.lattice import hexagonal_points
from tidemesh.basegrid.polar import polar_points
from tidemesh.basegrid.settings import BaseGridSettings
from tidemesh.datatypes import Domain
from tidemesh.errors import InputError
from tidemesh.geometry.polygons import ring_area

MOST_POINTS = 10_000_000
"""A base grid is there to be quick; ten million nodes take some 20 GB to solve."""


def build_base_points(
    domain: Domain, settings: BaseGridSettings | None = None
) -> np.ndarray:
    """Interior points of the base grid (paper, section 3.2).

    Parameters
    ----------
    domain : Domain
    settings : BaseGridSettings, optional

    Returns
    -------
    points : (n, 2) float array
        Metres; strictly inside the domain and clear of its boundary. The same input
        gives the same points in the same order.

    Raises
    ------
    InputError
        If the lattice would have more than `MOST_POINTS` points.
    """
    settings = BaseGridSettings() if settings is None else settings
    if settings.kind == "polar":
        return polar_points(domain, settings)
    water = sum(ring_area(ring.points) for ring in domain.rings)
    expected = 2.0 / math.sqrt(3.0) * water / settings.spacing_m**2
    if expected > MOST_POINTS:
        least = math.sqrt(2.0 / math.sqrt(3.0) * water / MOST_POINTS)
        raise InputError(
            f"base_grid.spacing_m = {settings.spacing_m:g} m gives {expected:,.0f} "
            f"nodes in {water / 1e6:,.0f} km2 of water; give at least {least:.3g} m"
        )
    return hexagonal_points(domain, settings)
