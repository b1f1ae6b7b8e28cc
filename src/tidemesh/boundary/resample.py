"""The shoreline at its spacing, with banks and islands kept apart."""

from __future__ import annotations

import logging

import numpy as np
import shapely
from shapely import Geometry, Polygon

from tidemesh.boundary.plane import LocalRules, WorkPlane
from tidemesh.boundary.spacing import enforce_spacing
from tidemesh.boundary.water import (
    LEAST_WIDTH,
    main_part,
    narrow_parts,
    on_line,
    runs,
    without,
)
from tidemesh.datatypes import LedgerEntry
from tidemesh.errors import InputError, MeshError
from tidemesh.geometry.polygons import (
    from_rings,
    holes,
    polygon_rings,
    ring_area,
    without_holes,
)

logger = logging.getLogger(__name__)

_MOST_ROUNDS = 20
_TOUCHING = 0.02
"""Boundary lines closer than this share of the spacing count as touching."""
_BRIDGE = 0.35
"""Radius of the land put where lines touch, as a share of the spacing."""


def resample(
    body: Polygon,
    line: Geometry,
    rules: LocalRules,
    factor: float,
    plane: WorkPlane,
    grid: float,
) -> tuple[list[np.ndarray], list[LedgerEntry]]:
    """Bring the land boundary of a water body to its spacing.

    Where chords of the new boundary cross or touch, land is joined there, and water
    that came out narrower than half its least width is closed; then the spacing is
    enforced again, until nothing changes. Lines that were within bounds stay as they
    are from round to round.

    Parameters
    ----------
    body : Polygon
        Water, with the ocean nodes in place.
    line : geometry
        The open boundary through its nodes.
    rules : LocalRules
    factor : float
        Greatest over least spacing.
    plane : WorkPlane
    grid : float

    Returns
    -------
    rings : list of (n, 2) arrays
        Work coordinates, water on the left, the outer ring first.
    entries : list of LedgerEntry

    Raises
    ------
    InputError
        If the spacing is too large for the domain.
    MeshError
        If the boundary does not settle.
    """
    entries: list[LedgerEntry] = []
    gained = 0.0
    for number in range(_MOST_ROUNDS):
        before = plane.area_m2(body)
        rings = []
        for ring in polygon_rings(body):
            new = _space(ring, line, rules, factor, grid, even=number == 0)
            if len(new) >= 3 and ring_area(new) * ring_area(ring) > 0.0:
                rings.append(new)
            elif not rings:
                raise InputError(
                    "the minimum spacing is too large for the domain: its outline "
                    "keeps fewer than three nodes"
                )
        drawn = shapely.make_valid(
            from_rings(rings), method="structure", keep_collapsed=False
        )
        body, lost = main_part(drawn, line, grid)
        touching = _touching(rings, body, line, rules, grid)
        narrow = narrow_parts(body, rules, share=LEAST_WIDTH, open_line=line, grid=grid)
        logger.debug(
            "round %d: %d touching, %d narrow", number, len(touching), len(narrow)
        )
        # An island may also have come to lie in land without touching any line.
        settled = not len(touching) and not narrow and not lost
        settled &= len(body.interiors) == len(rings) - 1
        if not settled:
            reach = _BRIDGE * rules.minimum(touching)
            bridges = shapely.buffer(shapely.points(touching), reach, quad_segs=4)
            body, cut = main_part(without(body, [*narrow, *bridges], grid), line, grid)
            body = _without_islets(body, rules)
            entries += _entries("narrow water removed", narrow, plane)
            entries += _entries("water cut off", lost + cut, plane)
        gained += plane.area_m2(body) - before
        if settled:
            break
    else:
        raise MeshError(_unsettled(touching, narrow, plane))
    longitude, latitude = plane.place(body)
    net = gained - sum(entry.area_m2 for entry in entries)
    reason = "shoreline drawn with its node spacing; net change"
    entries.append(LedgerEntry("shoreline resampled", longitude, latitude, net, reason))
    return rings, entries


def _entries(action: str, parts: list[Polygon], plane: WorkPlane) -> list[LedgerEntry]:
    reason = "too narrow, or behind such water, once drawn with its node spacing"
    return [
        LedgerEntry(action, *plane.place(part), -plane.area_m2(part), reason)
        for part in sorted(parts, key=lambda part: part.bounds)
    ]


def _unsettled(touching: np.ndarray, narrow: list[Polygon], plane: WorkPlane) -> str:
    place = touching[:1]
    if not len(place):
        place = shapely.get_coordinates([part.centroid for part in narrow])[:1]
    longitude, latitude = plane.to_degrees(place)[0] if len(place) else (np.nan, np.nan)
    return (
        f"after {_MOST_ROUNDS} rounds the shoreline still touches itself, or leaves "
        f"too narrow water, at {longitude:.5f} E, {latitude:.5f} N: change the minimum "
        "spacing a little, or mend the shoreline there"
    )


def _space(
    ring: np.ndarray,
    line: Geometry,
    rules: LocalRules,
    factor: float,
    grid: float,
    *,
    even: bool,
) -> np.ndarray:
    is_open = on_line(ring, line, 3.0 * grid)
    # Only the first round may move nodes for evenness; later ones would never rest.
    evenness = 0.02 if even else 1e-6
    if not is_open.any():
        return enforce_spacing(ring, True, rules.minimum, factor, evenness=evenness)
    pieces = []
    for first, count in runs(is_open):
        whole = count == len(ring)
        if whole:
            return ring
        string = np.take(ring, np.arange(first, first + count + 1), axis=0, mode="wrap")
        if not is_open[first]:
            string = enforce_spacing(
                string, False, rules.minimum, factor, evenness=evenness
            )
        pieces.append(string[:-1])
    return np.concatenate(pieces)


def _touching(
    rings: list[np.ndarray],
    body: Polygon,
    line: Geometry,
    rules: LocalRules,
    grid: float,
) -> np.ndarray:
    """Places (k, 2) where segments that are not neighbours come too close.

    Too close is touching, and for two banks with water between them less than half
    the least width: an opening alone overlooks the strait between two sharp capes.
    """
    starts = np.concatenate(rings)
    ends = np.concatenate([np.roll(ring, -1, axis=0) for ring in rings])
    at_sea = np.concatenate([on_line(ring, line, 3.0 * grid) for ring in rings])
    first = np.cumsum([0] + [len(ring) for ring in rings])
    following = np.arange(len(starts)) + 1
    following[first[1:] - 1] = first[:-1]
    segments = shapely.linestrings(np.stack([starts, ends], axis=1))
    middle = 0.5 * (starts + ends)
    touch = _TOUCHING * rules.minimum(middle)
    width = LEAST_WIDTH * rules.width(middle)
    # At a junction the shore may leave the open boundary at a small angle.
    length = np.hypot(*(ends - starts).T)
    width = np.where(at_sea, np.minimum(width, 0.5 * length), width)
    tree = shapely.STRtree(segments)
    a, b = tree.query(segments, predicate="dwithin", distance=np.maximum(touch, width))
    a, b = np.minimum(a, b), np.maximum(a, b)
    apart = (a != b) & (following[a] != b) & (following[b] != a)
    a, b = np.unique(np.stack([a[apart], b[apart]], axis=1), axis=0).T
    nearest = shapely.shortest_line(segments[a], segments[b])
    places = shapely.get_coordinates(nearest).reshape(-1, 2, 2).mean(axis=1)
    gap = shapely.length(nearest)
    shapely.prepare(body)
    strait = (gap < np.minimum(width[a], width[b])) & ~(at_sea[a] & at_sea[b])
    strait &= shapely.contains_xy(body, *places.T)
    places = places[strait | (gap <= np.maximum(touch[a], touch[b]))]
    # Neighbours that fold back on one another.
    ahead, back = ends - starts, (ends - starts)[following]
    turn = ahead[:, 0] * back[:, 1] - ahead[:, 1] * back[:, 0]
    along = (ahead * back).sum(axis=1)
    folded = np.flatnonzero((along < 0.0) & (np.abs(turn) < 0.03 * -along))
    return np.concatenate([places, ends[folded]])


def _without_islets(body: Polygon, rules: LocalRules) -> Polygon:
    """Drop islands that the joining of land left too small for their spacing."""
    islands = holes(body)
    if not len(islands):
        return body
    least = rules.minimum(shapely.get_coordinates(shapely.centroid(islands)))
    return without_holes(body, shapely.area(islands) < 0.25 * 3.0**0.5 * least**2)
