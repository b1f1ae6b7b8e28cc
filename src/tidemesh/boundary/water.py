"""Water bodies: narrow parts found, the sea side of the open boundary chosen."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import shapely
from shapely import Geometry, Polygon

from tidemesh.boundary.plane import LocalRules
from tidemesh.geometry.polygons import polygon_parts, polygon_rings, polygonal

_ROUGHNESS = 0.01
"""Share of the width below which the shape of the shore does not count."""
_TOLERANCE = 0.03
"""Share of the width within which water counts as wide enough: the roughness, and what
the openings, made of chords of 11 degrees, lack of circles (0.5 % of the radius)."""

LEAST_WIDTH = 0.5
"""Water in the result is at least this share of the narrow-water width wide."""


def narrow_parts(
    water: Geometry,
    rules: LocalRules,
    *,
    share: float = 1.0,
    open_line: Geometry | None = None,
    grid: float,
) -> list[Polygon]:
    """Parts of a water body narrower than the width set for their place.

    Morphological opening finds all that a disc of that width cannot reach. Of this,
    the rounding of corners is left alone: a part counts if it joins water at two or
    more mouths, or reaches further from its mouth than it may be wide.

    Parameters
    ----------
    water : geometry
        Work coordinates.
    rules : LocalRules
        Widths by place.
    share : float
        Share of the widths to apply.
    open_line : geometry, optional
        Open boundary; parts at it are left, for the water goes on behind it.
    grid : float
        Coordinates closer than this are one.
    """
    found: list[Polygon] = []
    for i, part in enumerate(rules.parts):
        later = [other.polygon for other in rules.parts[i + 1 :]]
        if part.width == 0.0:
            continue
        width = share * part.width
        area = water
        if part.polygon is not None:
            around = part.polygon.buffer(3.0 * width)
            area = polygonal(shapely.intersection(water, around, grid_size=grid))
        parts = _narrower(area, width, open_line, grid)
        if part.polygon is not None and parts:
            parts = shapely.intersection(np.array(parts), part.polygon, grid_size=grid)
        if later and len(parts):
            elsewhere = shapely.union_all(later)
            parts = shapely.difference(np.array(parts), elsewhere, grid_size=grid)
        for piece in parts:
            found += polygon_parts(piece)
    return found


def _narrower(
    water: Geometry, width: float, open_line: Geometry | None, grid: float
) -> list[Polygon]:
    radius = 0.5 * width
    # Buffering takes its time with every vertex; those that move the shore by less than
    # the tolerance are left out of the search, not of the water.
    core = water.simplify(_ROUGHNESS * width).buffer(-radius, quad_segs=8)
    wide = core.buffer(radius + _TOLERANCE * width, quad_segs=8)
    if wide.is_empty:
        return polygon_parts(water)
    # Snapping to the grid is slow and needed for the few parts that count only.
    rest = polygon_parts(shapely.difference(water, wide))
    if not rest:
        return []
    rest = np.array(rest)
    if open_line is not None:
        shapely.prepare(open_line)
        rest = rest[~shapely.dwithin(rest, open_line, 2.0 * grid)]
    if not len(rest):
        return []
    counts = _mouths(rest, wide.boundary, grid) >= 2
    west, south, east, north = shapely.bounds(rest).T
    large = np.flatnonzero(~counts & (np.hypot(east - west, north - south) > width))
    shapely.prepare(wide)
    corners, owner = shapely.get_coordinates(rest[large], return_index=True)
    far = ~shapely.dwithin(wide, shapely.points(corners), width)
    counts[large] = np.bincount(owner, weights=far, minlength=len(large)) > 0
    return list(shapely.set_precision(rest[counts], grid))


def _mouths(parts: np.ndarray, shore: Geometry, grid: float) -> np.ndarray:
    """Number of separate runs of each part's outline along the wide water: (n,)."""
    shapely.prepare(shore)
    outlines = shapely.get_exterior_ring(parts)
    corners, owner = shapely.get_coordinates(outlines, return_index=True)
    same = owner[1:] == owner[:-1]
    middle = 0.5 * (corners[1:] + corners[:-1])[same]
    owner = owner[1:][same]
    at = shapely.dwithin(shore, shapely.points(middle), 2.0 * grid)
    first = np.concatenate([[True], owner[1:] != owner[:-1]])
    last = np.append(first[1:], True)
    # The side before the first one of an outline is its last one.
    before = np.append(at[-1:], at[:-1])
    before[first] = at[last]
    return np.bincount(owner, weights=at & ~before, minlength=len(parts))


def without(water: Geometry, parts: Sequence[Geometry], grid: float) -> Geometry:
    """Water less the given parts."""
    if not len(parts):
        return water
    return polygonal(
        shapely.difference(water, shapely.union_all(parts), grid_size=grid)
    )


def inside_limit(
    water: Geometry, limit: Polygon, edge: Geometry, grid: float
) -> tuple[list[Polygon], list[Polygon]]:
    """Split water at the seaward limit.

    Parameters
    ----------
    water : geometry
        All water in the box.
    limit : Polygon
        Polygon of the seaward limit.
    edge : geometry
        Outline of the box.
    grid : float

    Returns
    -------
    bodies : list of Polygon
        Water inside the limit, with those bays behind it that have no other way out:
        a circle that cuts across the head of a bay does not close it.
    outside : list of Polygon
        The sea outside.
    """
    inner = polygon_parts(shapely.intersection(water, limit, grid_size=grid))
    outer = polygon_parts(shapely.difference(water, limit, grid_size=grid))
    shapely.prepare(edge)
    shapely.prepare(limit)
    sea = [p for p in outer if shapely.dwithin(edge, p, 2.0 * grid)]
    bays = [
        p
        for p in outer
        if not shapely.dwithin(edge, p, 2.0 * grid)
        and shapely.dwithin(limit, p, 2.0 * grid)
    ]
    if bays:
        inner = polygon_parts(shapely.union_all(inner + bays, grid_size=grid))
    return inner, sea


def main_part(
    water: Geometry, line: Geometry, grid: float
) -> tuple[Polygon, list[Polygon]]:
    """The part with most of the open boundary, and the other parts."""
    parts = polygon_parts(water)
    if len(parts) == 1:
        return parts[0], []

    def weight(part: Polygon) -> tuple[int, float]:
        at_sea = [on_line(r, line, 3.0 * grid).sum() for r in polygon_rings(part)]
        return int(sum(at_sea)), part.area

    main = max(parts, key=weight)
    return main, [part for part in parts if part is not main]


def on_line(points: np.ndarray, line: Geometry, tolerance: float) -> np.ndarray:
    """Segments of a closed ring that lie on a line: (n, 2) -> (n,) bool."""
    shapely.prepare(line)
    middle = 0.5 * (points + np.roll(points, -1, axis=0))
    west, south, east, north = line.bounds
    x, y = points.T
    at = (x > west - tolerance) & (x < east + tolerance)
    at &= (y > south - tolerance) & (y < north + tolerance)
    at[at] = shapely.dwithin(line, shapely.points(points[at]), tolerance)
    at &= np.roll(at, -1)
    at[at] = shapely.dwithin(line, shapely.points(middle[at]), tolerance)
    return at


def runs(kind: np.ndarray) -> list[tuple[int, int]]:
    """Runs of equal segments around a ring as (first segment, count), in order.

    A ring of one kind is a single run from segment 0.

    Examples
    --------
    >>> runs(np.array([1, 0, 0, 1]))
    [(3, 2), (1, 2)]
    """
    change = np.flatnonzero(kind != np.roll(kind, 1))
    if not len(change):
        return [(0, len(kind))]
    ends = np.append(change[1:], change[0] + len(kind))
    found = [(int(a), int(b - a)) for a, b in zip(change, ends)]
    # The run that passes over the start of the ring comes first.
    return found if change[0] == 0 else found[-1:] + found[:-1]
