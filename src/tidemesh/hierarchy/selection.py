"""Nodes of a domain that follow a size function (paper, section 3.5)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
import shapely
from scipy.spatial import cKDTree

from tidemesh.datatypes import LAND, Domain
from tidemesh.errors import InputError
from tidemesh.hierarchy.settings import HierarchySettings
from tidemesh.hierarchy.shoreline import resample_rings
from tidemesh.hierarchy.triangle_tree import lattice_nodes, select_triangles

Spacing = Callable[[np.ndarray], np.ndarray]
# Points of the lattice on which the typical spacing is measured.
PROBES = 60


@dataclass(frozen=True, eq=False)
class Selection:
    """Boundary and interior nodes."""

    domain: Domain
    """The domain, its rings resampled."""
    interior: np.ndarray
    """(n, 2) m, nodes strictly inside."""
    spacing: Spacing
    """The size function that was followed: the given one, lowered near fine shores."""
    report: dict[str, float] = field(default_factory=dict)
    """Counts, and the area (m2) between the old and the new boundary."""

    @property
    def n_points(self) -> int:
        """Number of nodes, those of the boundary included."""
        return len(self.interior) + sum(len(ring.points) for ring in self.domain.rings)


def select_points(
    domain: Domain,
    spacing: Spacing,
    settings: HierarchySettings | None = None,
    *,
    near_shore_points: np.ndarray | None = None,
) -> Selection:
    """Place nodes so that their spacing follows a size function.

    Parameters
    ----------
    domain : Domain
        The water, as bounded by the full shoreline.
    spacing : callable
        Target edge length at points: (n, 2) m -> (n,) m, positive, defined (by
        extrapolation) on the domain and a little beyond it.
    settings : HierarchySettings, optional
    near_shore_points : (n, 2) float array, optional
        m, nodes of the base mesh. With ``near_shore = "keep"`` those within
        ``strip_width_m`` of land are taken over unmodified.

    Returns
    -------
    Selection

    Raises
    ------
    InputError
        If the size function gives anything but positive finite numbers, or a size
        below the resolution of the hierarchy.

    Notes
    -----
    The eight steps of the paper's section 3.5 (docs/method.md, section 7).
    """
    settings = settings or HierarchySettings()
    spacing = _checked(spacing)
    if settings.minimum_size_m is not None:
        spacing = _at_least(spacing, settings.minimum_size_m)

    # 1-4. Boundary: sizes up to it, its line hierarchy, segmentation, merging.
    shore = resample_rings(domain, spacing, settings)
    # 5. Planar hierarchy.
    water = _Water(shore.domain)
    base = settings.root_size_m or _typical_spacing(water, spacing)
    selection = select_triangles(
        water.bounds,
        base,
        shore.spacing,
        rule=settings.rule,
        minimum_edge=settings.minimum_size_m or 0.0,
        classify=water.classify,
    )
    nodes, inside = lattice_nodes(selection, rule=settings.rule)
    interior = water.interior(nodes, inside, shore.spacing, settings.boundary_clearance)
    # 6-7. Its nodes and, if wanted, those of the strip along the shore.
    report = dict(shore.report)
    if settings.near_shore == "keep":
        width = settings.strip_width_m
        interior = interior[~_near_land(shore.domain, interior, width)]
        strip = np.empty((0, 2))
        if near_shore_points is not None and len(near_shore_points):
            near = _near_land(shore.domain, near_shore_points, width)
            strip = np.asarray(near_shore_points, dtype=np.float64)[near]
        interior = _with_strip(interior, strip, shore.spacing, settings)
        report["strip_points"] = float(len(strip))
    report["interior_points"] = float(len(interior))
    return Selection(shore.domain, interior, shore.spacing, report)


def count_points(
    domain: Domain,
    spacing: Spacing,
    settings: HierarchySettings | None = None,
    *,
    near_shore_points: np.ndarray | None = None,
) -> int:
    """Count the nodes that `select_points` places; same arguments."""
    return select_points(
        domain, spacing, settings, near_shore_points=near_shore_points
    ).n_points


class _Water:
    """The polygon of a domain, asked about many triangles and points."""

    def __init__(self, domain: Domain) -> None:
        shell, *holes = [ring.points for ring in domain.rings]
        self.polygon = shapely.Polygon(shell, holes)
        shapely.prepare(self.polygon)
        ends = [
            np.stack([ring.points, np.roll(ring.points, -1, axis=0)], axis=1)
            for ring in domain.rings
        ]
        self.segments = shapely.linestrings(np.concatenate(ends))
        self.tree = shapely.STRtree(self.segments)
        self.bounds = tuple(shapely.bounds(self.polygon))

    def classify(
        self, centres: np.ndarray, edge: float
    ) -> tuple[np.ndarray, np.ndarray]:
        """Tell triangles on land (dropped) and those well inside the water.

        A triangle is well inside where a box that reaches one edge beyond it meets no
        boundary segment.
        """
        reach = 1.6 * edge
        boxes = shapely.box(*(centres - reach).T, *(centres + reach).T)
        near = np.zeros(len(centres), dtype=bool)
        near[np.unique(self.tree.query(boxes)[0])] = True
        clear = np.flatnonzero(~near)
        wet = shapely.contains_xy(self.polygon, centres[clear])
        dropped = np.zeros(len(centres), dtype=bool)
        dropped[clear[~wet]] = True
        inside = np.zeros(len(centres), dtype=bool)
        inside[clear[wet]] = True
        return dropped, inside

    def interior(
        self,
        points: np.ndarray,
        known: np.ndarray,
        spacing: Spacing,
        clearance: float,
    ) -> np.ndarray:
        """Return the points in the water, clear of the boundary, in the given order."""
        doubtful = np.flatnonzero(~known)
        wet = shapely.contains_xy(self.polygon, points[doubtful])
        doubtful = doubtful[wet]
        kept = known.copy()
        if len(doubtful):
            need = clearance * spacing(points[doubtful])
            geometry = shapely.points(points[doubtful])
            crowded, _ = self.tree.query(geometry, predicate="dwithin", distance=need)
            kept[doubtful] = True
            kept[doubtful[crowded]] = False
        return points[kept]


def _checked(spacing: Spacing) -> Spacing:
    def checked(points: np.ndarray) -> np.ndarray:
        size = np.asarray(spacing(points), dtype=np.float64)
        good = np.isfinite(size) & (size > 0.0)
        if not good.all():
            bad = int(np.flatnonzero(~good)[0])
            x, y = points[bad]
            raise InputError(
                f"the size function gives {size[bad]} at x = {x:.0f}, y = {y:.0f} m; "
                "expected a positive finite spacing in metres"
            )
        return size

    return checked


def _at_least(spacing: Spacing, minimum: float) -> Spacing:
    return lambda points: np.maximum(spacing(points), minimum)


def _typical_spacing(water: _Water, spacing: Spacing) -> float:
    """Spacing of the uniform lattice with as many nodes as the size function needs."""
    x0, y0, x1, y1 = water.bounds
    step = max(x1 - x0, y1 - y0) / PROBES
    x, y = np.meshgrid(
        np.arange(x0 + 0.5 * step, x1, step), np.arange(y0 + 0.5 * step, y1, step)
    )
    points = np.stack([x.ravel(), y.ravel()], axis=1)
    points = points[shapely.contains_xy(water.polygon, points)]
    if not len(points):
        points = shapely.get_coordinates(water.polygon.representative_point())
    return float(1.0 / np.sqrt(np.mean(spacing(points) ** -2.0)))


def _near_land(domain: Domain, points: np.ndarray, width: float) -> np.ndarray:
    """(n,) bool, points within a distance of land."""
    ends = [
        np.stack([ring.points, np.roll(ring.points, -1, axis=0)], axis=1)[
            ring.segment_kind == LAND
        ]
        for ring in domain.rings
    ]
    land = shapely.multilinestrings(shapely.linestrings(np.concatenate(ends)))
    shapely.prepare(land)
    return shapely.dwithin(land, shapely.points(points), width)


def _with_strip(
    interior: np.ndarray,
    strip: np.ndarray,
    spacing: Spacing,
    settings: HierarchySettings,
) -> np.ndarray:
    """Offshore nodes clear of the strip, then the strip's own."""
    if not len(strip) or not len(interior):
        return np.concatenate([interior, strip])
    need = settings.seam_factor * spacing(interior)
    distance, _ = cKDTree(strip).query(interior, distance_upper_bound=need.max())
    return np.concatenate([interior[distance >= need], strip])
