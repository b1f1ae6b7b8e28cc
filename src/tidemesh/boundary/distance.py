"""How far places are from the shore."""

from __future__ import annotations

import numpy as np
import shapely

from tidemesh.datatypes import LAND, Domain


def distance_to_land(domain: Domain, points: np.ndarray) -> np.ndarray:
    """Distance (m) of points to the nearest land segment of a domain.

    Parameters
    ----------
    domain : Domain
    points : (n, 2) float array
        m.

    Returns
    -------
    (n,) float array
        Infinite where the domain has no land.
    """
    start = np.concatenate([ring.points for ring in domain.rings])
    end = np.concatenate([np.roll(ring.points, -1, axis=0) for ring in domain.rings])
    kind = np.concatenate([ring.segment_kind for ring in domain.rings])
    shore = shapely.linestrings(np.stack([start, end], axis=1)[kind == LAND])
    if len(shore) == 0:
        return np.full(len(points), np.inf)
    places = shapely.points(np.asarray(points, dtype=np.float64))
    nearest = shapely.STRtree(shore).nearest(places)
    return shapely.distance(places, shore[nearest])
