"""Equilateral lattice in the projected plane, halved where the boundary is finer."""

from __future__ import annotations

import math

import numpy as np

from tidemesh.basegrid.clearance import NearBoundary, inside
from tidemesh.basegrid.settings import BaseGridSettings
from tidemesh.datatypes import Domain

_NEIGHBOURS = np.array([(1, 0), (0, 1), (-1, 1), (-1, 0), (0, -1), (1, -1)])
_MAX_LEVELS = 8
_ROW = math.sqrt(3.0) / 2.0
# A lattice serves targets from its spacing down to this share of it; the next one
# takes over below. Geometric mean of 1 and 1/2.
_SHARE = math.sqrt(0.5)


def hexagonal_points(domain: Domain, settings: BaseGridSettings) -> np.ndarray:
    """Lattice points inside a domain, clear of its boundary.

    The lattice is anchored at the origin of the projection, so that neighbouring
    domains share it. A point's target spacing grows from that of the nearest boundary
    segment at the rate `transition_gradation`, up to the lattice's. Where it falls
    below, points of the lattices of half, quarter, ... the spacing are added; these
    contain one another, so no two points come closer than the finest spacing.

    Returns
    -------
    points : (n, 2) float array
        Metres, coarsest lattice first, row by row.
    """
    spacing = settings.spacing_m
    gradation = settings.transition_gradation
    boundary = NearBoundary(domain, spacing / 8.0)
    finest = float(boundary.segment_spacing.min())
    keys = _keys_in_box(domain.rings[0].points, spacing)
    chosen = []
    for level in range(_MAX_LEVELS if settings.transition else 1):
        step = spacing / 2**level
        points = _positions(keys, step)
        # Below this target the next lattice is wanted; it may be met this far out.
        limit = _SHARE * step
        reach = max((limit - finest) / gradation, 0.0) + 2.0 * step
        distance, shore = boundary.query(points, reach)
        target = spacing
        if settings.transition:
            target = np.minimum(shore + gradation * distance, spacing)
        wanted = distance >= settings.clearance * target
        if level > 0:
            # Points with two even keys belong to the coarser lattices.
            wanted &= (target < _SHARE * 2.0 * step) & (keys % 2 != 0).any(axis=1)
        candidates = points[wanted]
        chosen.append(candidates[inside(domain, candidates)])
        if finest >= limit or not settings.transition:
            break
        keys = _halved(keys[target - gradation * 2.0 * step < limit])
    return np.concatenate(chosen)


def _keys_in_box(ring: np.ndarray, spacing: float) -> np.ndarray:
    """Lattice keys (i, j) of all points in the box around a ring: (n, 2) int."""
    (x_low, y_low), (x_high, y_high) = ring.min(axis=0), ring.max(axis=0)
    rows = np.arange(
        math.ceil(y_low / (spacing * _ROW)), math.floor(y_high / (spacing * _ROW)) + 1
    )
    first = np.ceil(x_low / spacing - 0.5 * rows).astype(np.int64)
    last = np.floor(x_high / spacing - 0.5 * rows).astype(np.int64)
    count = np.maximum(last - first + 1, 0)
    j = np.repeat(rows, count)
    i = np.arange(len(j)) - np.repeat(np.cumsum(count) - count, count)
    return np.stack([i + np.repeat(first, count), j], axis=1)


def _positions(keys: np.ndarray, spacing: float) -> np.ndarray:
    i, j = keys.T
    return np.stack([(i + 0.5 * j) * spacing, j * (spacing * _ROW)], axis=1)


def _halved(keys: np.ndarray) -> np.ndarray:
    """The same points and the middles of their edges, as keys of half the spacing."""
    if len(keys) == 0:
        return keys
    children = np.concatenate([2 * keys, *(2 * keys + step for step in _NEIGHBOURS)])
    low = children.min(axis=0)
    width = int(np.ptp(children[:, 0])) + 1
    flat = np.sort((children[:, 1] - low[1]) * width + (children[:, 0] - low[0]))
    flat = flat[np.diff(flat, prepend=-1) > 0]
    return np.stack([flat % width, flat // width], axis=1) + low
