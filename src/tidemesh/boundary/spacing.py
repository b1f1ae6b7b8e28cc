"""Node spacing along a shoreline: delete what is too close, insert in gaps."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from tidemesh.boundary._kernels import choose_nodes
from tidemesh.geometry.polygons import lexicographic_first, path_length, ring_area

Minimum = float | Callable[[np.ndarray], np.ndarray]
"""Least spacing: one number, or a function of (n, 2) points giving (n,)."""


def enforce_spacing(
    points: np.ndarray,
    closed: bool,
    minimum: Minimum,
    factor: float = 1.75,
    *,
    evenness: float = 0.02,
) -> np.ndarray:
    """Bring the node spacing of a line between a minimum and `factor` minima.

    Nodes are deleted where they are closer than the minimum and inserted where a gap
    exceeds `factor` minima (paper, section 3.1). Which ones to delete is free in the
    paper; here it is the choice that keeps the line closest to the old one.

    Parameters
    ----------
    points : (n, 2) array
        Open line, or ring without its first point repeated.
    closed : bool
        Whether the points are a ring.
    minimum : float or function
        Least spacing, in the units of the points; between points of different minimum
        both bounds are taken at their widest.
    factor : float
        Greatest spacing over the minimum.
    evenness : float
        Weight of an even spacing (about 1.25 minima) against closeness to the old line.

    Returns
    -------
    nodes : (k, 2) array
        Both ends of an open line are kept. A ring starts at its westernmost point and
        keeps its direction. A line that no division suits (a straight one between
        `factor` and two minima long) keeps the gap nearest to the bounds; a ring too
        small for three nodes comes back with fewer.

    Notes
    -----
    A line that obeys the bounds comes back unchanged, so twice is once.

    Examples
    --------
    >>> line = np.array([[0.0, 0.0], [0.4, 0.0], [1.0, 0.0], [4.0, 0.0]])
    >>> enforce_spacing(line, False, 1.0)[:, 0].tolist()
    [0.0, 1.25, 2.5, 4.0]
    """
    points = np.ascontiguousarray(points, dtype=np.float64)
    least = minimum if callable(minimum) else lambda p: np.full(len(p), float(minimum))
    if closed:
        return _ring(points, least, factor, evenness)
    # A line and its reverse must give the same nodes, so direction is settled first.
    if tuple(points[-1]) < tuple(points[0]):
        return _settle(points[::-1], least, factor, evenness)[::-1]
    return _settle(points, least, factor, evenness)


def within_bounds(points: np.ndarray, closed: bool, least, factor: float) -> bool:
    """Whether every gap lies between the minimum and `factor` minima."""
    if closed:
        points = np.concatenate([points, points[:1]])
    length = np.hypot(*np.diff(points, axis=0).T)
    d = least(points)
    lower = np.minimum(d[1:], d[:-1]) * (1.0 - 1e-9)
    upper = np.maximum(d[1:], d[:-1]) * factor * (1.0 + 1e-9)
    return bool(((length >= lower) & (length <= upper)).all())


def _ring(points, least, factor, evenness):
    clockwise = ring_area(points) < 0.0
    if clockwise:
        points = points[::-1]
    points = np.roll(points, -lexicographic_first(points), axis=0)
    loop = np.concatenate([points, points[:1]])
    nodes = _settle(loop, least, factor, evenness)[:-1]
    return np.roll(nodes[::-1], 1, axis=0) if clockwise else nodes


def _settle(line, least, factor, evenness):
    # Where no division is within bounds the first answer, being a new line, may
    # have a better one; a few rounds reach the one that stays.
    for _ in range(5):
        if within_bounds(line, False, least, factor):
            break
        nodes = _choose(line, least, factor, evenness)
        if np.array_equal(nodes, line):
            break
        line = nodes
    return line


def _choose(line, least, factor, evenness):
    for fineness in (4.0, 16.0):
        candidates, added = _candidates(line, least, fineness)
        chosen = choose_nodes(candidates, least(candidates), added, factor, evenness)
        nodes = candidates[chosen]
        if within_bounds(nodes, False, least, factor):
            break
    return nodes


def _candidates(line, least, fineness):
    """Vertices no closer than 1/12 of the minimum, and points on long segments."""
    keep = np.ones(len(line), dtype=bool)
    length = path_length(line)
    d = least(line)
    last = 0
    close = np.diff(length) < d[1:] / 12.0
    for i in np.flatnonzero(close) + 1:
        last = i - 1 if keep[i - 1] else last
        keep[i] = length[i] - length[last] >= d[i] / 12.0
    keep[[0, -1]] = True
    line, d = line[keep], d[keep]
    steps = np.hypot(*np.diff(line, axis=0).T)
    parts = np.maximum(1, np.ceil(steps * fineness / np.minimum(d[1:], d[:-1])))
    parts = np.append(parts.astype(np.int64), 1)
    first = np.concatenate([[0], np.cumsum(parts)[:-1]])
    number = np.arange(parts.sum()) - np.repeat(first, parts)
    share = (number / np.repeat(parts, parts))[:, None]
    ahead = np.append(line[1:], line[-1:], axis=0)
    candidates = np.repeat(line, parts, axis=0) * (1.0 - share)
    candidates += np.repeat(ahead, parts, axis=0) * share
    return candidates, number > 0
