"""Linear interpolation between scattered soundings."""

from __future__ import annotations

import numpy as np
from scipy.spatial import ConvexHull, QhullError

from tidemesh.triangulation.delaunay import constrained_delaunay
from tidemesh.triangulation.locate import Locator


def interpolate_scattered(
    places: np.ndarray, values: np.ndarray, points: np.ndarray
) -> np.ndarray:
    """Linear on the Delaunay triangulation of scattered places.

    Parameters
    ----------
    places : (n, 2) float array
        Soundings at the same place count with their mean.
    values : (n,) float array
    points : (m, 2) float array

    Returns
    -------
    interpolated : (m,) float array
        NaN outside the convex hull, and everywhere if the places span no area.
    """
    places, values = _merged(places, values)
    try:
        hull = ConvexHull(places).vertices
    except (QhullError, ValueError):
        return np.full(len(points), np.nan)
    segments = np.stack([hull, np.roll(hull, -1)], axis=1)
    triangles = constrained_delaunay(places, segments)
    return Locator(places, triangles).interpolate(values, points, outside="nan")


def _merged(places: np.ndarray, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Distinct places in order of x, then y, and the mean of the values at each."""
    order = np.lexsort((places[:, 1], places[:, 0]))
    places, values = places[order], values[order]
    new = np.ones(len(places), dtype=bool)
    new[1:] = (np.diff(places, axis=0) != 0.0).any(axis=1)
    group = np.cumsum(new) - 1
    return places[new], np.bincount(group, values) / np.bincount(group)
