"""Interior points of the base grid."""

from __future__ import annotations

import numpy as np

from tidemesh.basegrid.lattice import hexagonal_points
from tidemesh.basegrid.polar import polar_points
from tidemesh.basegrid.settings import BaseGridSettings
from tidemesh.datatypes import Domain


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
    """
    settings = BaseGridSettings() if settings is None else settings
    if settings.kind == "polar":
        return polar_points(domain, settings)
    return hexagonal_points(domain, settings)
