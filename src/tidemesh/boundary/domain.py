"""From land polygons to the domain: section 3.1 of the paper."""

from __future__ import annotations

import logging
from collections.abc import Sequence

import numpy as np
import shapely
from shapely import Geometry, Polygon

from tidemesh.boundary.ocean import box_polygon, ocean_nodes, ocean_polygon
from tidemesh.boundary.plane import (
    LocalRules,
    WorkPlane,
    box_in_degrees,
    follow_in_degrees,
    unwrapped_box,
    work_plane,
)
from tidemesh.boundary.resample import resample
from tidemesh.boundary.settings import DomainSettings
from tidemesh.boundary.water import (
    LEAST_WIDTH,
    inside_limit,
    main_part,
    narrow_parts,
    on_line,
    runs,
    without,
)
from tidemesh.datatypes import LAND, OCEAN, Domain, LedgerEntry, Ring
from tidemesh.errors import InputError
from tidemesh.geometry.polygons import (
    from_rings,
    holes,
    lexicographic_first,
    open_ring,
    polygon_parts,
    polygon_rings,
    polygonal,
    transform,
    without_holes,
)

logger = logging.getLogger(__name__)

_TRIANGLE = 0.25 * 3.0**0.5
"""Area of the equilateral triangle of side one."""
_COMPARABLE = 0.2
"""Share of the largest water body from which a second one is no mere remainder."""
_MOST_NODES = 5_000_000


def build_domain(
    land: Geometry,
    settings: DomainSettings,
    region_land: Sequence[Geometry | None] = (),
    *,
    drawn_ocean: Geometry | None = None,
    repairs: Sequence[LedgerEntry] = (),
) -> Domain:
    """Build the water body to be meshed, with typed boundary rings.

    Parameters
    ----------
    land : geometry
        Land polygons in degrees, valid, as `tidemesh.io.read_shoreline` gives them.
    settings : DomainSettings
        Box, open boundary, spacing, narrow water and islands, regions.
    region_land : sequence of geometry or None
        The finer land of each region, in the order of ``settings.regions``; None or a
        missing entry where the region has none.
    drawn_ocean : geometry, optional
        The polygon of ``settings.ocean.file``, in degrees.
    repairs : sequence of LedgerEntry
        What was mended while reading; put at the head of the ledger.

    Returns
    -------
    Domain
        Rings with the water on their left, the outer one first; islands from west to
        east. Every change to the geography stands in the ledger, with the change of
        water area it made.

    Raises
    ------
    InputError
        If the open boundary misses the sea or ends in it, the water is parted in two,
        no water is left, or the spacing suits neither numbers nor domain.

    Notes
    -----
    Narrow water is closed (1), the sea side of the open boundary taken (2), islands
    dropped (3), ocean nodes set (4), and the shoreline brought to its spacing (5),
    which is repeated with the few places where that made banks meet.
    """
    plane = work_plane(settings)
    rules = LocalRules(settings, plane)
    grid = _grid(settings, rules, plane)
    ledger = list(repairs)

    sea, islets = _water(land, settings, region_land, plane, rules, grid)
    narrow = narrow_parts(sea, rules, grid=grid)
    water = without(sea, narrow, grid)
    limit, line = ocean_polygon(settings, plane, drawn_ocean)
    limit = shapely.set_precision(limit, grid)
    box = box_polygon(settings, plane)
    edge = box.exterior
    if not box.contains_properly(limit):
        water = polygonal(shapely.intersection(water, box, grid_size=grid))
    bodies, _ = inside_limit(water, limit, edge, grid)
    body = _choose_body(bodies, line, box, settings, plane, grid)
    ledger += _lost_water(body, bodies, narrow, line, limit, plane, grid)
    ledger += _check_the_box(body, line, edge, plane, grid)

    body, entries = _leave_the_shore(body, line, rules, plane, grid)
    ledger += entries
    body, entries = _drop_islands(body, islets, line, rules, plane, grid)
    ledger += entries

    body, line = _set_ocean_nodes(body, line, settings, plane, grid)

    rings, entries = resample(
        body, line, rules, settings.max_spacing_factor, plane, grid
    )
    ledger += entries
    domain = Domain(_typed_rings(rings, line, plane, grid), plane.projection)
    logger.info(
        "domain: %d nodes, %d islands, %d ledger entries",
        sum(len(ring.points) for ring in domain.rings),
        len(domain.rings) - 1,
        len(ledger),
    )
    return Domain(domain.rings, plane.projection, tuple(ledger))


def _grid(settings: DomainSettings, rules: LocalRules, plane: WorkPlane) -> float:
    """Coordinates closer than this are one, which makes the overlays exact."""
    corners = shapely.get_coordinates(box_polygon(settings, plane))
    extent = float(np.ptp(corners, axis=0).max())
    largest = float(np.abs(corners).max())
    unit, key = ("degrees", "deg") if plane.in_degrees else ("m", "m")
    if rules.finest < 1e8 * np.spacing(largest):
        raise InputError(
            f"min_spacing_{key} = {rules.finest:g} {unit} is below what the "
            f"coordinates of this box can resolve ({1e8 * np.spacing(largest):.1g} "
            f"{unit}): give a larger one"
        )
    if rules.coarsest > 0.25 * extent:
        raise InputError(
            f"min_spacing_{key} = {rules.coarsest:g} {unit} does not suit a box of "
            f"{extent:g} {unit}: give at most a quarter of that"
        )
    return 1e-6 * rules.finest


def _water(
    land: Geometry,
    settings: DomainSettings,
    region_land: Sequence[Geometry | None],
    plane: WorkPlane,
    rules: LocalRules,
    grid: float,
) -> tuple[Geometry, list[Polygon]]:
    """Water of the box and a margin, in work coordinates, and islets too small."""
    land = shapely.intersection(polygonal(land), box_in_degrees(settings))
    for region, finer in zip(settings.regions, region_land):
        if finer is not None:
            polygon = Polygon(region.polygon_deg)
            inside = shapely.intersection(finer, polygon)
            land = shapely.union(shapely.difference(land, polygon), inside)
    # Beyond the box nothing is known: as open water it makes nothing narrow there.
    west, south, east, north = unwrapped_box(settings)
    margin = 0.05 * max(east - west, north - south)
    frame = shapely.box(west - margin, south - margin, east + margin, north + margin)
    water = follow_in_degrees(shapely.difference(frame, land), settings)
    water = transform(water, plane.from_degrees)
    water = shapely.set_precision(water, grid)
    _check_size(water, settings, rules, plane)
    # Islands that do not count must not make the water around them narrow either.
    kept, islets = [], []
    for polygon in polygon_parts(water):
        islands = holes(polygon)
        small = _negligible(islands, rules, plane)
        kept.append(without_holes(polygon, small))
        islets += list(islands[small])
    return shapely.MultiPolygon(kept), islets


def _negligible(islands: np.ndarray, rules: LocalRules, plane: WorkPlane) -> np.ndarray:
    """Islands below the least area, or too small for a triangle of the spacing."""
    if not len(islands):
        return np.zeros(0, dtype=bool)
    at = shapely.get_coordinates(shapely.centroid(islands))
    small = shapely.area(islands) < _TRIANGLE * rules.minimum(at) ** 2
    area_m2 = shapely.area(transform(islands, plane.to_metres))
    return small | (area_m2 < rules.island_m2(at))


def _check_size(
    water: Geometry, settings: DomainSettings, rules: LocalRules, plane: WorkPlane
) -> None:
    if water.is_empty:
        raise InputError(
            f"{settings.shoreline}: no water in the box {list(settings.box_deg)}"
        )
    nodes = water.length / rules.parts[0].minimum
    if nodes > _MOST_NODES:
        raise InputError(
            f"the shoreline in the box would take some {nodes:.2g} nodes at the given "
            f"minimum spacing, more than {_MOST_NODES:.0e}: give a larger spacing"
        )


# ---- the sea side of the open boundary ------------------------------------------


def _choose_body(
    bodies: list[Polygon],
    line: Geometry,
    box: Polygon,
    settings: DomainSettings,
    plane: WorkPlane,
    grid: float,
) -> Polygon:
    open_length = [_open_length(body, line, grid) for body in bodies]
    bodies = [b for b, length in zip(bodies, open_length) if length > 10.0 * grid]
    if not bodies:
        raise InputError(_misses_the_sea(line, box, plane))
    bodies.sort(key=lambda body: (-body.area, body.bounds))
    if settings.inside_deg is not None:
        place = plane.from_degrees(np.array([settings.inside_deg]))
        point = shapely.points(place)[0]
        for body in bodies:
            if body.covers(point):
                return body
        raise InputError(
            f"inside_deg = {list(settings.inside_deg)} is not in water that the open "
            "boundary reaches: it lies on land, outside, or in removed narrow water"
        )
    if len(bodies) > 1 and bodies[1].area > _COMPARABLE * bodies[0].area:
        parts = " and ".join(
            f"{plane.area_m2(body) / 1e6:.4g} km2 at {_shown(plane.place(body))}"
            for body in bodies[:2]
        )
        raise InputError(
            f"the open boundary parts the domain in two: {parts}. Move it, set "
            "inside_deg to a place in the part to keep, or lower narrow_water_width_m "
            "if they should be joined by a channel"
        )
    return bodies[0]


def _open_length(body: Polygon, line: Geometry, grid: float) -> float:
    total = 0.0
    if not shapely.dwithin(line, body, 3.0 * grid):
        return total
    for ring in polygon_rings(body):
        at = on_line(ring, line, 3.0 * grid)
        total += np.hypot(*(np.roll(ring, -1, axis=0) - ring)[at].T).sum()
    return total


def _misses_the_sea(line: Geometry, box: Polygon, plane: WorkPlane) -> str:
    west, south, east, north = transform(line, plane.to_degrees).bounds
    extent = f"{west:.4f} to {east:.4f} E, {south:.4f} to {north:.4f} N"
    if not line.intersects(box):
        return (
            f"the open boundary ({extent}) lies outside the box: "
            "correct the ocean boundary or enlarge box_deg"
        )
    return (
        f"the open boundary ({extent}) never touches the sea: in the box it runs over "
        "land only. Check its place, the sign of the longitude and the shoreline"
    )


def _lost_water(
    body: Polygon,
    bodies: list[Polygon],
    narrow: list[Polygon],
    line: Geometry,
    limit: Polygon,
    plane: WorkPlane,
    grid: float,
) -> list[LedgerEntry]:
    """Narrow water at the body and all that was reached only through it."""
    others = [other for other in bodies if other is not body]
    pieces = narrow + others
    if not pieces:
        return []
    separate = [_open_length(other, line, grid) > 10.0 * grid for other in others]
    reached = np.zeros(len(pieces), dtype=bool)
    reached[len(narrow) :] = separate
    tree = shapely.STRtree(pieces)
    front = [body]
    while front:
        near = np.unique(tree.query(front, predicate="dwithin", distance=2 * grid)[1])
        new = near[~reached[near]]
        reached[new] = True
        front = [pieces[i] for i in new]
    entries = []
    for i in np.flatnonzero(reached):
        piece = pieces[i]
        if i >= len(narrow):
            apart = separate[i - len(narrow)]
            action = "separate water left out" if apart else "water cut off"
            reason = (
                "reached by the open boundary but apart from the main water"
                if apart
                else "joined to the domain by removed narrow water only"
            )
        else:
            if shapely.dwithin(line, piece, 2.0 * grid):
                piece = shapely.intersection(piece, limit, grid_size=grid)
            action = "narrow water removed"
            reason = "narrower than the width set here"
        if not piece.is_empty:
            entries.append(_entry(action, piece, -1.0, reason, plane))
    return sorted(entries, key=_by_place)


def _leave_the_shore(
    body: Polygon, line: Geometry, rules: LocalRules, plane: WorkPlane, grid: float
) -> tuple[Polygon, list[LedgerEntry]]:
    """Fill slivers of water between the open boundary and a shore along it."""
    narrow = narrow_parts(body, rules, share=LEAST_WIDTH, grid=grid)
    slivers = [part for part in narrow if shapely.dwithin(line, part, 2.0 * grid)]
    if not slivers:
        return body, []
    body, cut = main_part(without(body, slivers, grid), line, grid)
    behind = "behind a sliver of water at the open boundary"
    between = "sliver between the open boundary and the shore"
    entries = [
        _entry("narrow water removed", part, -1.0, between, plane) for part in slivers
    ]
    entries += [_entry("water cut off", part, -1.0, behind, plane) for part in cut]
    return body, sorted(entries, key=_by_place)


def _check_the_box(
    body: Polygon, line: Geometry, edge: Geometry, plane: WorkPlane, grid: float
) -> list[LedgerEntry]:
    """Refuse an open string that ends at the box; list other water closed there."""
    entries = []
    for ring in polygon_rings(body):
        at_box = on_line(ring, edge, 3.0 * grid)
        if not at_box.any():
            continue
        is_open = on_line(ring, line, 3.0 * grid)
        at_box &= ~is_open
        after = is_open & np.roll(at_box, -1)
        before = is_open & np.roll(at_box, 1)
        ends = np.concatenate([np.roll(ring, -1, axis=0)[after], ring[before]])
        if len(ends):
            raise InputError(
                "the open boundary leaves the box at "
                f"{_shown(plane.to_degrees(ends[:1])[0])} without meeting land: "
                "enlarge box_deg, move the boundary, or name the neighbouring edge of "
                "the box as ocean too"
            )
        for first, count in runs(at_box):
            if at_box[first]:
                middle = np.take(ring, [first + count // 2], axis=0, mode="wrap")
                longitude, latitude = map(float, plane.to_degrees(middle)[0])
                reason = "water goes on beyond the box; treated as land"
                entries.append(
                    LedgerEntry("closed at the box", longitude, latitude, 0.0, reason)
                )
    return entries


# ---- islands and ocean nodes -----------------------------------------------------


def _drop_islands(
    body: Polygon,
    islets: list[Polygon],
    line: Geometry,
    rules: LocalRules,
    plane: WorkPlane,
    grid: float,
) -> tuple[Polygon, list[LedgerEntry]]:
    """Drop what is below the least area; list all that is dropped in the body."""
    islands = holes(body)
    small = _negligible(islands, rules, plane)
    for i in np.flatnonzero(small):
        small[i] = not on_line(open_ring(body.interiors[i]), line, 3.0 * grid).any()
    kept = without_holes(body, small)
    shapely.prepare(body)
    gone = [islet for islet in islets if body.covers(islet)] + list(islands[small])
    entries = []
    for island in gone:
        at = shapely.get_coordinates(island.centroid)
        least = float(rules.island_m2(at)[0])
        reason = (
            f"smaller than {least / 1e6:g} km2"
            if plane.area_m2(island) < least
            else "too small for its spacing"
        )
        entries.append(_entry("island dropped", island, 1.0, reason, plane))
    return kept, sorted(entries, key=_by_place)


def _set_ocean_nodes(
    body: Polygon,
    line: Geometry,
    settings: DomainSettings,
    plane: WorkPlane,
    grid: float,
) -> tuple[Polygon, Geometry]:
    """Put the ocean nodes in place of the dense line; the new line goes with them."""
    rings, lines = [], []
    for ring in polygon_rings(body):
        is_open = on_line(ring, line, 3.0 * grid)
        pieces = []
        for first, count in runs(is_open):
            whole = count == len(ring)
            places = np.arange(first, first + count + (not whole))
            string = np.take(ring, places, axis=0, mode="wrap")
            if is_open[first]:
                string = ocean_nodes(string, whole, settings, plane)
                loop = np.concatenate([string, string[:1]]) if whole else string
                lines.append(shapely.LineString(loop))
            pieces.append(string if whole else string[:-1])
        rings.append(np.concatenate(pieces))
    return from_rings(rings), shapely.MultiLineString(lines)


def _typed_rings(
    rings: list[np.ndarray], line: Geometry, plane: WorkPlane, grid: float
) -> tuple[Ring, ...]:
    islands = sorted(rings[1:], key=lambda ring: tuple(ring.min(axis=0)))
    typed = []
    for ring in [rings[0], *islands]:
        kind = np.where(on_line(ring, line, 3.0 * grid), OCEAN, LAND)
        start = _first_node(ring, kind)
        points = plane.to_metres(np.roll(ring, -start, axis=0))
        typed.append(Ring(points, np.roll(kind, -start)))
    return tuple(typed)


def _first_node(ring: np.ndarray, kind: np.ndarray) -> int:
    """A ring starts with its longest open string, else at its westernmost point."""
    strings = [run for run in runs(kind) if kind[run[0]] == OCEAN]
    if not strings or len(runs(kind)) == 1:
        return lexicographic_first(ring)
    return max(strings, key=lambda run: run[1])[0]


def _entry(
    action: str, part: Geometry, sign: float, reason: str, plane: WorkPlane
) -> LedgerEntry:
    longitude, latitude = plane.place(part)
    return LedgerEntry(action, longitude, latitude, sign * plane.area_m2(part), reason)


def _by_place(entry: LedgerEntry) -> tuple:
    return (entry.action, entry.longitude_deg, entry.latitude_deg)


def _shown(place: Sequence[float]) -> str:
    return f"{place[0]:.5f} E, {place[1]:.5f} N"
