"""The shoreline at its spacing, with banks and islands kept apart."""

from __future__ import annotations

import logging

import numpy as np
import shapely
from shapely import Geometry, Polygon

from tidemesh.boundary.plane import LocalRules, WorkPlane
from tidemesh.boundary.spacing import enforce_spacing
from tidemesh.boundary.water import narrow_parts, on_line, runs, without
from tidemesh.datatypes import LedgerEntry
from tidemesh.errors import InputError, MeshError
from tidemesh.geometry.polygons import (
    from_rings,
    holes,
    polygon_parts,
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
_LEAST_WIDTH = 0.5
"""Water in the result is at least this share of the narrow-water width wide."""


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
        touching = _touching(rings, rules)
        body = _main_part(
            shapely.make_valid(
                from_rings(rings), method="structure", keep_collapsed=False
            ),
            line,
            grid,
        )
        narrow = narrow_parts(
            body, rules, share=_LEAST_WIDTH, open_line=line, grid=grid
        )
        logger.debug(
            "round %d: %d touching, %d narrow", number, len(touching), len(narrow)
        )
        if not len(touching) and not narrow:
            gained += plane.area_m2(body) - before
            break
        bridges = list(
            shapely.buffer(
                shapely.points(touching), _BRIDGE * rules.minimum(touching), quad_segs=4
            )
        )
        body = _main_part(without(body, narrow + bridges, grid), line, grid)
        body = _without_islets(body, rules)
        gained += plane.area_m2(body) - before
    else:
        longitude, latitude = plane.to_degrees(touching[:1])[0]
        raise MeshError(
            f"the shoreline does not settle at its spacing; it still touches itself at "
            f"{longitude:.5f} E, {latitude:.5f} N"
        )
    longitude, latitude = plane.place(body)
    entries.append(
        LedgerEntry(
            "shoreline resampled",
            longitude,
            latitude,
            gained,
            "shoreline drawn with its node spacing; net change",
        )
    )
    return rings, entries


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


def _touching(rings: list[np.ndarray], rules: LocalRules) -> np.ndarray:
    """Places where segments that are not neighbours cross or nearly touch: (k, 2)."""
    starts = np.concatenate(rings)
    ends = np.concatenate([np.roll(ring, -1, axis=0) for ring in rings])
    number = np.arange(len(starts))
    first = np.cumsum([0] + [len(ring) for ring in rings])
    following = number + 1
    following[first[1:] - 1] = first[:-1]
    segments = shapely.linestrings(np.stack([starts, ends], axis=1))
    reach = _TOUCHING * rules.minimum(0.5 * (starts + ends))
    tree = shapely.STRtree(segments)
    a, b = tree.query(segments, predicate="dwithin", distance=reach)
    a, b = np.minimum(a, b), np.maximum(a, b)
    apart = (a != b) & (following[a] != b) & (following[b] != a)
    pairs = np.unique(np.stack([a[apart], b[apart]], axis=1), axis=0)
    # Neighbours that fold back on one another.
    ahead, back = ends - starts, (ends - starts)[following]
    turn = ahead[:, 0] * back[:, 1] - ahead[:, 1] * back[:, 0]
    along = (ahead * back).sum(axis=1)
    folded = np.flatnonzero((along < 0.0) & (np.abs(turn) < 0.03 * -along))
    nearest = shapely.shortest_line(segments[pairs[:, 0]], segments[pairs[:, 1]])
    places = shapely.get_coordinates(nearest).reshape(-1, 2, 2).mean(axis=1)
    return np.concatenate([places, ends[folded]])


def _main_part(water: Geometry, line: Geometry, grid: float) -> Polygon:
    """The part with most of the open boundary."""
    parts = polygon_parts(water)
    if len(parts) == 1:
        return parts[0]

    def weight(part: Polygon) -> tuple[int, float]:
        at_sea = [on_line(r, line, 3.0 * grid).sum() for r in polygon_rings(part)]
        return int(sum(at_sea)), part.area

    return max(parts, key=weight)


def _without_islets(body: Polygon, rules: LocalRules) -> Polygon:
    """Drop islands that the joining of land left too small for their spacing."""
    islands = holes(body)
    if not len(islands):
        return body
    least = rules.minimum(shapely.get_coordinates(shapely.centroid(islands)))
    return without_holes(body, shapely.area(islands) < 0.25 * 3.0**0.5 * least**2)
