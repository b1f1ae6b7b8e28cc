"""Boundary rings resampled to a size function, their topology unchanged.

New points lie on the old rings. A segment that crosses another one, or that is long
against the width of the water before it, lowers the size around it, and the rings are
resampled again; crossings that remain get the old vertices back. At last the points of
land move a little across the shore, so that the water area stays what it was along
every stretch.
"""

from __future__ import annotations

import logging
from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
import shapely

from tidemesh.datatypes import LAND, OCEAN, Domain, Ring
from tidemesh.errors import InputError, MeshError
from tidemesh.hierarchy.grading import BoundaryLimitedSpacing, graded_lengths
from tidemesh.hierarchy.line_tree import divide_lines
from tidemesh.hierarchy.settings import HierarchySettings

log = logging.getLogger(__name__)

Spacing = Callable[[np.ndarray], np.ndarray]

SAMPLES_PER_SIZE = 2.0
MOST_SAMPLES = 10_000_000
MAXIMUM_ROUNDS = 10
MAXIMUM_REPAIRS = 60
# Channels far narrower than the size are followed with segments of this fraction of
# it, longer than wide, rather than with ever smaller ones.
NARROWEST = 1.0 / 8.0
# Opposite banks of a bay head are one bank: this many segment lengths along the shore
# must lie between two places that face each other.
ALONG_SHORE = 2.5
# Farthest that a point moves off the old shore: parts of the segments that meet there,
# and of the water before them.
MOVE_PER_LENGTH = 0.25
MOVE_PER_WIDTH = 0.2


@dataclass(frozen=True, eq=False)
class Resampled:
    """Rings that follow a size function."""

    domain: Domain
    spacing: Spacing
    """The size function, lowered where the shore needs finer segments."""
    report: dict[str, float]


@dataclass(frozen=True, eq=False)
class _Lines:
    """All rings as one row of samples; each ring ends with its first point again."""

    points: np.ndarray
    """(m, 2) m."""
    arc: np.ndarray
    """(m,) m, increasing; a jump of one metre leads from ring to ring."""
    kind: np.ndarray
    """(m,) kind of the piece that follows the sample, -1 at the end of a ring."""
    vertex: np.ndarray
    """(m,) bool, a point of the given ring."""
    first: np.ndarray
    """(n_rings,) first sample of every ring."""
    last: np.ndarray
    """(n_rings,) last sample of every ring."""

    def at(self, arc: np.ndarray) -> np.ndarray:
        """Points of the lines: (k,) -> (k, 2)."""
        return np.stack(
            [np.interp(arc, self.arc, self.points[:, axis]) for axis in range(2)],
            axis=1,
        )


@dataclass(frozen=True, eq=False)
class _Segments:
    """Segments between consecutive breaks of the lines."""

    breaks: np.ndarray
    """(k,) m, arc lengths; every ring begins and ends with a break."""
    points: np.ndarray
    """(k, 2) m."""
    start: np.ndarray
    """(n,) index of the break where the segment starts; the next one ends it."""
    ring: np.ndarray
    """(n,)."""
    count: np.ndarray
    """(n_rings,) segments of every ring."""

    @property
    def length(self) -> np.ndarray:
        step = self.points[self.start + 1] - self.points[self.start]
        return np.hypot(step[:, 0], step[:, 1])

    @property
    def lines(self) -> np.ndarray:
        ends = np.stack([self.points[self.start], self.points[self.start + 1]], axis=1)
        return shapely.linestrings(ends)

    def kind(self, lines: _Lines) -> np.ndarray:
        """(n,) kind of the stretch under every segment."""
        middle = 0.5 * (self.breaks[self.start] + self.breaks[self.start + 1])
        return lines.kind[np.searchsorted(lines.arc, middle) - 1]

    def with_points(self, points: np.ndarray) -> _Segments:
        """The same segments from new points (n, 2), the first of a ring its last."""
        new = self.points.copy()
        new[self.start] = points
        ends = np.cumsum(self.count)
        new[self.start[ends - 1] + 1] = points[ends - self.count]
        return replace(self, points=new)

    def adjacent(self, one: np.ndarray, other: np.ndarray) -> np.ndarray:
        """Whether two segments follow one another on a ring."""
        gap = np.abs(one - other)
        around = self.count[self.ring[one]] - 1
        same = self.ring[one] == self.ring[other]
        return same & ((gap <= 1) | (gap == around))


def resample_rings(
    domain: Domain, spacing: Spacing, settings: HierarchySettings
) -> Resampled:
    """Resample every ring to a size function without changing the topology.

    Parameters
    ----------
    domain : Domain
        Simple rings that neither cross nor touch.
    spacing : callable
        Target size at points: (n, 2) m -> (n,) m.
    settings : HierarchySettings
        With ``near_shore = "keep"`` land keeps its vertices and the ocean boundary is
        divided by its line tree.

    Returns
    -------
    Resampled
        The points lie on the given rings, or with ``conserve_area`` a little beside
        them; points between land and ocean are kept, and so is the order of the rings.
        The report counts points before and after, and gives the area (m2) between the
        old rings and chords of them, and the change of the water area (m2).

    Raises
    ------
    MeshError
        If the given rings cross one another.
    """
    lines, target = _sampled(domain, spacing)
    if settings.minimum_size_m is not None:
        target = np.maximum(target, settings.minimum_size_m)
    size = target.copy()
    rounds = 0
    keep = settings.near_shore == "keep"
    while True:
        segments = _segments(lines, _breaks(lines, size, settings))
        if keep or rounds == MAXIMUM_ROUNDS:
            break
        allowed = _allowed_lengths(segments, lines, target, settings)
        rounds += 1
        if not _lower(size, lines, segments, allowed):
            break
        size = _graded_along(lines, size, settings.gradation)
    segments, repairs = _uncrossed(lines, segments)
    moved = float(np.abs(_lost_areas(lines, segments)).sum())
    if settings.conserve_area and not keep:
        segments = _area_conserved(lines, segments)
    new = _domain(domain, lines, segments)

    boundary, length = _point_lengths(segments)
    report = {
        "boundary_points_given": float(lines.vertex.sum() - len(lines.first)),
        "boundary_points": float(len(segments.start)),
        "boundary_rounds": float(rounds),
        "boundary_repairs": float(repairs),
        "shore_area_moved_m2": moved,
        "water_area_change_m2": -float(_lost_areas(lines, segments).sum()),
    }
    if keep:
        return Resampled(new, spacing, report)
    limited = BoundaryLimitedSpacing(spacing, boundary, length, settings.gradation)
    return Resampled(new, limited, report)


# Sampling


def _sampled(domain: Domain, spacing: Spacing) -> tuple[_Lines, np.ndarray]:
    """Samples no further apart than half the local size, and the size there."""
    rings = [_canonical(ring) for ring in domain.rings]
    points = np.concatenate([np.vstack([xy, xy[:1]]) for xy, _ in rings])
    kind = np.concatenate([np.append(kinds, -1) for _, kinds in rings])
    vertex = np.ones(len(points), dtype=bool)
    size = np.asarray(spacing(points), dtype=np.float64)
    for _ in range(4):
        step = np.diff(points, axis=0)
        length = np.hypot(step[:, 0], step[:, 1])
        finest = np.minimum(size[1:], size[:-1])
        pieces = np.ceil(SAMPLES_PER_SIZE * length / finest - 1e-9)
        # A count beyond all bounds must not overflow.
        pieces = np.minimum(pieces, 2.0 * MOST_SAMPLES).astype(np.int64)
        pieces = np.append(np.maximum(pieces, 1), 1)
        pieces[kind == -1] = 1
        if pieces.max() == 1:
            break
        if pieces.sum() > MOST_SAMPLES:
            raise InputError(
                f"sizes down to {size.min():.3g} m need more than "
                f"{int(MOST_SAMPLES / SAMPLES_PER_SIZE):,} boundary points: raise the "
                "smallest size"
            )
        source = np.repeat(np.arange(len(points)), pieces)
        number = np.arange(len(source)) - np.repeat(np.cumsum(pieces) - pieces, pieces)
        share = number / pieces[source]
        inserted = number > 0
        following = np.minimum(source + 1, len(points) - 1)
        xy = points[source] + share[:, None] * (points[following] - points[source])
        new_size = size[source]
        new_size[inserted] = spacing(xy[inserted])
        points, kind, size = xy, kind[source], new_size
        vertex = vertex[source] & ~inserted
    last = np.flatnonzero(kind == -1)
    first = np.append(0, last[:-1] + 1)
    step = np.diff(points, axis=0)
    length = np.hypot(step[:, 0], step[:, 1])
    length[last[:-1]] = 1.0
    arc = np.append(0.0, np.cumsum(length))
    return _Lines(points, arc, kind, vertex, first, last), size


def _canonical(ring: Ring) -> tuple[np.ndarray, np.ndarray]:
    """The ring from a point that does not depend on where the caller began."""
    points, kind = ring.points, ring.segment_kind
    candidates = np.flatnonzero(kind != np.roll(kind, 1))
    if not len(candidates):
        candidates = np.arange(len(points))
    order = np.lexsort((points[candidates, 1], points[candidates, 0]))
    start = -int(candidates[order[0]])
    return np.roll(points, start, axis=0), np.roll(kind, start)


# Placing the breaks


def _breaks(lines: _Lines, size: np.ndarray, settings: HierarchySettings) -> np.ndarray:
    """Arc lengths of the new points, every ring's end included."""
    measure = _measure(lines, size)
    junctions = _junctions(lines, measure, settings)
    runs = np.flatnonzero(lines.kind[junctions] != -1)
    begin, end = junctions[runs], junctions[runs + 1]
    if settings.near_shore == "keep":
        ocean = lines.kind[begin] == OCEAN
        kept = lines.arc[lines.vertex & (_following_kind(lines) != OCEAN)]
        divided = _divided(lines, size, begin[ocean], end[ocean], settings)
        return np.unique(np.concatenate([kept, lines.arc[junctions], divided]))
    if settings.line_rule == "tree":
        divided = _divided(lines, size, begin, end, settings)
        return np.unique(np.concatenate([lines.arc[junctions], divided]))

    total = measure[end] - measure[begin]
    number = np.floor(total).astype(np.int64)
    number += total * total > number * (number + 1)
    number = np.maximum(number, 1)
    ring = np.searchsorted(lines.last, begin)
    count = np.bincount(ring, weights=number, minlength=len(lines.first))
    ring_total = np.bincount(ring, weights=total, minlength=len(lines.first))
    small = count[ring] < settings.island_points
    share = settings.island_points * total / ring_total[ring]
    number[small] = np.maximum(np.ceil(share[small] - 1e-9), 1).astype(np.int64)

    run = np.repeat(np.arange(len(begin)), number)
    step = np.arange(len(run)) - np.repeat(np.cumsum(number) - number, number)
    wanted = measure[begin[run]] + total[run] * (step / number[run])
    breaks = np.interp(wanted, measure, lines.arc)
    breaks[step == 0] = lines.arc[begin[run[step == 0]]]
    return np.sort(np.concatenate([breaks, lines.arc[lines.last]]))


def _measure(lines: _Lines, size: np.ndarray) -> np.ndarray:
    """Integral of ds / size along the lines; a jump of one from ring to ring."""
    inverse = 1.0 / size
    step = np.diff(lines.arc) * 0.5 * (inverse[1:] + inverse[:-1])
    step[lines.last[:-1]] = 1.0
    return np.append(0.0, np.cumsum(step))


def _following_kind(lines: _Lines) -> np.ndarray:
    kind = lines.kind.copy()
    kind[lines.last] = LAND
    return kind


def _divided(
    lines: _Lines,
    size: np.ndarray,
    begin: np.ndarray,
    end: np.ndarray,
    settings: HierarchySettings,
) -> np.ndarray:
    start, stop = lines.arc[begin], lines.arc[end]
    small = (begin == lines.first[np.searchsorted(lines.last, begin)]) & np.isin(
        end, lines.last
    )
    if small.any():
        # A ring without junctions begins with its four quarters.
        quarters = start[small, None] + (stop - start)[small, None] * (
            np.arange(5) / 4.0
        )
        start = np.concatenate([start[~small], quarters[:, :-1].ravel()])
        stop = np.concatenate([stop[~small], quarters[:, 1:].ravel()])
    return divide_lines(
        start,
        stop,
        lambda arc: np.interp(arc, lines.arc, size),
        rule=settings.rule,
        minimum_length=settings.minimum_size_m or 0.0,
    )


def _junctions(
    lines: _Lines, measure: np.ndarray, settings: HierarchySettings
) -> np.ndarray:
    """Samples that stay points: ring ends, changes of kind, corners."""
    fixed = np.zeros(len(lines.arc), dtype=bool)
    fixed[lines.first] = fixed[lines.last] = True
    fixed[1:] |= lines.vertex[1:] & (lines.kind[1:] != lines.kind[:-1])
    if settings.near_shore == "keep":
        return np.flatnonzero(fixed)
    turn = _turns(lines, measure)
    # Corners within 0.7 of a size of one another: the sharpest one stays. Those next
    # to a fixed point go.
    candidate = np.flatnonzero(
        lines.vertex & ~fixed & (turn > np.radians(settings.corner_angle_deg))
    )
    if len(candidate):
        place = measure[candidate]
        fixed_place = measure[fixed]
        after = np.searchsorted(fixed_place, place)
        clear = (place - fixed_place[after - 1] > 0.7) & (
            fixed_place[np.minimum(after, len(fixed_place) - 1)] - place > 0.7
        )
        candidate, place = candidate[clear], place[clear]
    if len(candidate):
        low = np.searchsorted(place, place - 0.7)
        high = np.searchsorted(place, place + 0.7, side="right")
        windows = np.stack([low, high], axis=1).ravel()
        padded = np.append(turn[candidate], -1.0)
        sharpest = np.maximum.reduceat(padded, windows)[::2]
        kept = candidate[turn[candidate] >= sharpest]
        spaced = np.append(True, np.diff(measure[kept]) > 0.7)
        fixed[kept[spaced]] = True
    return np.flatnonzero(fixed)


def _turns(lines: _Lines, measure: np.ndarray) -> np.ndarray:
    """Turning angle (rad) at every sample between chords half a size long."""
    ring = np.searchsorted(lines.last, np.arange(len(measure)))
    low = np.maximum(measure - 0.5, measure[lines.first[ring]])
    high = np.minimum(measure + 0.5, measure[lines.last[ring]])
    columns = []
    for axis in range(2):
        values = lines.points[:, axis]
        columns.append(values - np.interp(low, measure, values))
        columns.append(np.interp(high, measure, values) - values)
    ax, bx, ay, by = columns
    return np.abs(np.arctan2(ax * by - ay * bx, ax * bx + ay * by))


# Keeping the topology


def _segments(lines: _Lines, breaks: np.ndarray) -> _Segments:
    ends = np.searchsorted(breaks, lines.arc[lines.last])
    is_end = np.zeros(len(breaks), dtype=bool)
    is_end[ends] = True
    start = np.flatnonzero(~is_end)
    ring = np.searchsorted(ends, start)
    count = np.bincount(ring, minlength=len(ends))
    return _Segments(breaks, lines.at(breaks), start, ring, count)


def _allowed_lengths(
    segments: _Segments,
    lines: _Lines,
    target: np.ndarray,
    settings: HierarchySettings,
) -> np.ndarray:
    """(n,) m, what each segment may measure: infinite where it may stay."""
    allowed = np.full(len(segments.start), np.inf)
    length = segments.length
    geometry = segments.lines
    tree = shapely.STRtree(geometry)
    one, other = _crossing(tree, geometry, segments)
    for crossing in (one, other):
        allowed[crossing] = 0.5 * length[crossing]
    bad_ring = _folded_rings(segments)
    allowed[bad_ring[segments.ring]] = 0.5 * length[bad_ring[segments.ring]]
    hidden = _swallowing(segments, lines, tree)
    allowed[hidden] = 0.5 * length[hidden]

    if settings.width_fraction > 0.0:
        middle = 0.5 * (
            segments.breaks[segments.start] + segments.breaks[segments.start + 1]
        )
        wanted = np.interp(middle, lines.arc, target)
        floor = NARROWEST * wanted
        width = _water_widths(
            tree, geometry, segments, settings.width_fraction * length
        )
        narrow = np.maximum(width / settings.width_fraction, floor)
        narrow[narrow > 0.9 * length] = np.inf
        allowed = np.minimum(allowed, narrow)

    points, point_length = _point_lengths(segments)
    graded = graded_lengths(points, point_length, settings.gradation)
    ahead = _next_of_ring(segments)
    graded = 0.5 * (graded + graded[ahead]) + 0.25 * settings.gradation * length
    return np.where(graded < 0.75 * length, np.minimum(allowed, graded), allowed)


def _crossing(
    tree: shapely.STRtree, geometry: np.ndarray, segments: _Segments
) -> tuple[np.ndarray, np.ndarray]:
    one, other = tree.query(geometry, predicate="intersects")
    pair = (one < other) & ~segments.adjacent(one, other)
    return one[pair], other[pair]


def _water_widths(
    tree: shapely.STRtree,
    geometry: np.ndarray,
    segments: _Segments,
    reach: np.ndarray,
) -> np.ndarray:
    """(n,) m, distance to the opposite bank where it is within reach, else infinite."""
    width = np.full(len(geometry), np.inf)
    one, other = tree.query(geometry, predicate="dwithin", distance=reach)
    pair = ~segments.adjacent(one, other)
    one, other = one[pair], other[pair]
    if not len(one):
        return width
    bridge = shapely.get_coordinates(
        shapely.shortest_line(geometry[one], geometry[other])
    )
    bridge = bridge.reshape(-1, 2, 2)
    across = bridge[:, 1] - bridge[:, 0]
    start = segments.points[segments.start[one]]
    along = segments.points[segments.start[one] + 1] - start
    # Water lies on the left.
    water = along[:, 0] * across[:, 1] - along[:, 1] * across[:, 0] > 0.0
    middle = 0.5 * (
        segments.breaks[segments.start] + segments.breaks[segments.start + 1]
    )
    apart = np.abs(middle[one] - middle[other])
    ends = np.append(0, np.cumsum(segments.count))
    first = segments.breaks[segments.start[ends[segments.ring[one]]]]
    final = segments.breaks[segments.start[ends[segments.ring[one] + 1] - 1] + 1]
    apart = np.minimum(apart, final - first - apart)
    same = segments.ring[one] == segments.ring[other]
    far = ~same | (apart > ALONG_SHORE * segments.length[one])
    opposite = water & far
    distance = np.hypot(across[:, 0], across[:, 1])
    np.minimum.at(width, one[opposite], distance[opposite])
    return width


def _folded_rings(segments: _Segments) -> np.ndarray:
    """(n_rings,) True for rings turned inside out: the first must wind positively."""
    area = _ring_areas(segments)
    area[0] = -area[0]
    return area >= 0.0


def _ring_areas(segments: _Segments) -> np.ndarray:
    a = segments.points[segments.start]
    b = segments.points[segments.start + 1]
    # Relative to the ring's first point, so that small islands far from the origin
    # keep their digits.
    first = np.append(0, np.cumsum(segments.count)[:-1])
    origin = a[first][segments.ring]
    a, b = a - origin, b - origin
    cross = a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]
    return 0.5 * np.bincount(segments.ring, weights=cross, minlength=len(first))


def _swallowing(
    segments: _Segments, lines: _Lines, tree: shapely.STRtree
) -> np.ndarray:
    """Segments that may have cut a whole ring off the water."""
    lost = _lost_rings(segments)
    if not len(lost):
        return np.empty(0, dtype=np.int64)
    points = shapely.points(lines.points[lines.first[lost]])
    guilty: list[np.ndarray] = []
    for ring in np.unique(segments.ring):
        span = np.flatnonzero(segments.ring == ring)
        hulls = shapely.convex_hull(_spans(segments, lines, span))
        _, hit = shapely.STRtree(hulls).query(points[lost != ring], predicate="within")
        guilty.append(span[hit])
    return np.unique(np.concatenate(guilty))


def _spans(segments: _Segments, lines: _Lines, chosen: np.ndarray) -> np.ndarray:
    """The stretch of the old line under each chosen segment, as linestrings."""
    start, stop = (
        segments.breaks[segments.start[chosen]],
        segments.breaks[segments.start[chosen] + 1],
    )
    low = np.searchsorted(lines.arc, start, side="right")
    high = np.searchsorted(lines.arc, stop, side="left")
    rows = [
        np.vstack(
            [
                segments.points[segments.start[k]],
                lines.points[i:j],
                segments.points[segments.start[k] + 1],
            ]
        )
        for k, i, j in zip(chosen, low, high)
    ]
    index = np.repeat(np.arange(len(rows)), [len(row) for row in rows])
    return shapely.linestrings(np.concatenate(rows), indices=index)


def _lost_rings(segments: _Segments) -> np.ndarray:
    """Islands outside the outer ring or within another island."""
    polygons = _polygons(segments)
    if len(polygons) == 1:
        return np.empty(0, dtype=np.int64)
    ends = np.append(0, np.cumsum(segments.count))
    probe = segments.points[segments.start[ends[1:-1]]]
    shapely.prepare(polygons[0])
    lost = ~shapely.contains_xy(polygons[0], probe[:, 0], probe[:, 1])
    inner, outer = shapely.STRtree(polygons[1:]).query(
        shapely.points(probe), predicate="within"
    )
    lost[inner[inner != outer]] = True
    return np.flatnonzero(lost) + 1


def _polygons(segments: _Segments) -> np.ndarray:
    points = segments.points[segments.start]
    first = np.append(0, np.cumsum(segments.count)[:-1])
    order = np.insert(np.arange(len(points)), np.cumsum(segments.count), first)
    ring = np.repeat(np.arange(len(segments.count)), segments.count + 1)
    return shapely.polygons(shapely.linearrings(points[order], indices=ring))


def _lower(
    size: np.ndarray, lines: _Lines, segments: _Segments, allowed: np.ndarray
) -> bool:
    """Lower the size along segments that are too long; False if nothing changed."""
    bad = np.flatnonzero(np.isfinite(allowed))
    if not len(bad):
        return False
    begin = segments.breaks[segments.start[bad]]
    end = segments.breaks[segments.start[bad] + 1]
    low = np.searchsorted(lines.arc, begin, side="right") - 1
    high = np.searchsorted(lines.arc, end, side="left")
    number = high - low + 1
    sample = (
        np.repeat(low, number)
        + np.arange(number.sum())
        - np.repeat(np.cumsum(number) - number, number)
    )
    before = size.copy()
    np.minimum.at(size, sample, np.repeat(allowed[bad], number))
    return bool((size < 0.98 * before).any())


def _graded_along(lines: _Lines, size: np.ndarray, gradation: float) -> np.ndarray:
    """Limit the growth of the size along every ring, around its end."""
    around = lines.arc[lines.last] - lines.arc[lines.first]
    ring = np.searchsorted(lines.last, np.arange(len(size)))
    within = lines.arc - lines.arc[lines.first[ring]]
    # Every ring twice in a row, the rings out of each other's reach.
    apart = 2.0 * around + size.max() / gradation
    offset = np.append(0.0, np.cumsum(apart)[:-1])
    order = np.argsort(np.concatenate([2 * ring, 2 * ring + 1]), kind="stable")
    place = np.concatenate(
        [within + offset[ring], within + offset[ring] + around[ring]]
    )[order]
    twice = np.concatenate([size, size])[order]
    forward = gradation * place + np.minimum.accumulate(twice - gradation * place)
    backward = np.minimum.accumulate((twice + gradation * place)[::-1])[::-1]
    graded = np.minimum(forward, backward - gradation * place)
    back = np.empty(len(order))
    back[order] = graded
    return np.minimum(np.minimum(back[: len(size)], back[len(size) :]), size)


def _uncrossed(lines: _Lines, segments: _Segments) -> tuple[_Segments, int]:
    """Give old vertices back to segments that still cross, until none does."""
    vertex_arc = lines.arc[lines.vertex]
    repairs = 0
    for _ in range(MAXIMUM_REPAIRS):
        geometry = segments.lines
        tree = shapely.STRtree(geometry)
        one, other = _crossing(tree, geometry, segments)
        bad = np.concatenate([one, other, _swallowing(segments, lines, tree)])
        folded = _folded_rings(segments)
        bad = np.unique(np.append(bad, np.flatnonzero(folded[segments.ring])))
        if not len(bad):
            return segments, repairs
        begin = segments.breaks[segments.start[bad]]
        end = segments.breaks[segments.start[bad] + 1]
        low = np.searchsorted(vertex_arc, begin, side="right")
        high = np.searchsorted(vertex_arc, end, side="left")
        middle = np.searchsorted(vertex_arc, 0.5 * (begin + end))
        middle = np.clip(middle, low, np.maximum(high - 1, low))
        whole = high > low
        if not whole.any():
            break
        new = vertex_arc[middle[whole]]
        repairs += len(new)
        segments = _segments(lines, np.union1d(segments.breaks, new))
    x, y = segments.points[segments.start[bad[0]]]
    raise MeshError(
        f"the given boundary crosses itself near x = {x:.0f}, y = {y:.0f} m"
    )


# Results


def _next_of_ring(segments: _Segments) -> np.ndarray:
    """(n,) for every segment the number of the one that follows it on its ring."""
    ahead = np.arange(1, len(segments.start) + 1)
    ends = np.cumsum(segments.count)
    ahead[ends - 1] = np.append(0, ends[:-1])
    return ahead


def _point_lengths(segments: _Segments) -> tuple[np.ndarray, np.ndarray]:
    """Boundary points and the mean length of the two segments that meet there."""
    length = segments.length
    mean = np.empty_like(length)
    ahead = _next_of_ring(segments)
    mean[ahead] = 0.5 * (length + length[ahead])
    return segments.points[segments.start], mean


def _lost_areas(lines: _Lines, segments: _Segments) -> np.ndarray:
    """(n,) m2 of water that each segment leaves out; negative where it takes in land.

    The area between the stretch of the old line under a segment, the segment, and the
    ways from the ends of the one to the ends of the other.
    """
    step = np.diff(lines.points, axis=0)
    origin = lines.points.mean(axis=0)
    middle = 0.5 * (lines.points[1:] + lines.points[:-1]) - origin
    swept = _cross(middle, step)
    swept[lines.last[:-1]] = 0.0
    along = np.append(0.0, np.cumsum(swept))
    # The swept area is linear in the arc length along one straight piece.
    along = np.interp(segments.breaks, lines.arc, along)
    new = segments.points - origin
    aside = _cross(lines.at(segments.breaks) - origin, new)
    a, b = segments.start, segments.start + 1
    return 0.5 * (along[b] - along[a] + aside[b] - aside[a] - _cross(new[a], new[b]))


def _cross(one: np.ndarray, other: np.ndarray) -> np.ndarray:
    return one[:, 0] * other[:, 1] - one[:, 1] * other[:, 0]


def _area_conserved(lines: _Lines, segments: _Segments) -> _Segments:
    """Move land points across the shore by the water their segments leave out.

    A chord cuts water off a bay and land off a head; with every point moved by the area
    that its two segments lost over their length, the water area is conserved along the
    shore. Points whose move would change the topology stay.
    """
    ahead = _next_of_ring(segments)
    before = np.empty_like(ahead)
    before[ahead] = np.arange(len(ahead))
    on_line = segments.points[segments.start]
    length = segments.length
    pair = length + length[before]
    chord = on_line[ahead] - on_line[before]
    size = np.maximum(np.hypot(chord[:, 0], chord[:, 1]), 1e-9 * pair)
    # Water lies on the left, so this points to the land.
    normal = np.stack([chord[:, 1], -chord[:, 0]], axis=1) / size[:, None]

    width = _water_widths(
        shapely.STRtree(segments.lines), segments.lines, segments, length
    )
    limit = np.minimum(MOVE_PER_LENGTH * length, MOVE_PER_WIDTH * width)
    limit = np.minimum(limit, limit[before])
    land = segments.kind(lines) == LAND
    limit[~(land & land[before])] = 0.0
    move = np.zeros(len(length))
    moved = segments
    # The first step leaves errors of second order, the others what limits cut off.
    for _ in range(3):
        lost = np.where(land, _lost_areas(lines, moved), 0.0)
        move = np.clip(move + (lost + lost[before]) / pair, -limit, limit)
        moved = segments.with_points(on_line + move[:, None] * normal)
    for _ in range(MAXIMUM_REPAIRS):
        geometry = moved.lines
        crossing = _crossing(shapely.STRtree(geometry), geometry, moved)
        bad = np.concatenate(crossing)
        bad = np.append(bad, np.flatnonzero(_folded_rings(moved)[moved.ring]))
        if not len(bad):
            break
        move[bad] = move[ahead[bad]] = 0.0
        moved = segments.with_points(on_line + move[:, None] * normal)
    else:
        return segments
    return segments if len(_lost_rings(moved)) else moved


def _domain(domain: Domain, lines: _Lines, segments: _Segments) -> Domain:
    kind = segments.kind(lines)
    ends = np.append(0, np.cumsum(segments.count))
    rings = tuple(
        Ring(segments.points[segments.start[a:b]], kind[a:b]) for a, b in pairwise(ends)
    )
    return replace(domain, rings=rings)
