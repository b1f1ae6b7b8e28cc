"""Depths at nodes from rasters and soundings."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from tidemesh.basegrid import source_checks
from tidemesh.basegrid.raster_sampling import WeightedRaster
from tidemesh.basegrid.scattered import interpolate_scattered
from tidemesh.basegrid.settings import DepthSettings
from tidemesh.basegrid.volume import volume_corrected
from tidemesh.datatypes import Raster, Soundings
from tidemesh.errors import InputError
from tidemesh.geometry.projection import Projection
from tidemesh.geometry.systems import (
    PLANE,
    from_degrees,
    is_degrees,
    metres_per_unit,
    to_degrees,
)

logger = logging.getLogger(__name__)

# A node of an equilateral lattice of spacing s stands for a hexagon of area
# (sqrt(3)/2) s²; this is the side of the square of the same area.
_SIDE_PER_SPACING = (3.0**0.5 / 2.0) ** 0.5


@dataclass(frozen=True)
class DepthReport:
    """Where the depths of a mesh came from."""

    nodes: int
    from_source: tuple[tuple[str, int], ...]
    """Name of each source and the number of nodes that it decided."""
    averaged: int
    """Nodes with the mean over their area instead of the value at their place."""
    filled: int
    """Nodes without water in any source: the nearest water was taken."""
    farthest_fill_m: float
    """Largest distance over which a depth was taken."""
    raised: int
    """Nodes set to the minimum depth."""
    minimum_m: float
    """The minimum depth."""
    shallowest_m: float
    deepest_m: float
    corrected: int = 0
    """Nodes whose depth was corrected for the volume of their triangles."""
    filled_deg: tuple[tuple[float, float], ...] = ()
    """Longitude and latitude of the filled nodes, those filled from farthest first, at
    most ten."""


def sample_depths(
    points: np.ndarray,
    projection: Projection,
    sources: Sequence[Raster | Soundings],
    settings: DepthSettings | None = None,
    *,
    spacing: np.ndarray | None = None,
    triangles: np.ndarray | None = None,
) -> tuple[np.ndarray, DepthReport]:
    """Depths at points of a mesh.

    Rasters are interpolated between water cells alone, or, where a node stands for an
    area larger than a cell, averaged over it. Soundings are interpolated linearly on
    their Delaunay triangulation. The first source with water at a place decides; where
    there is none the nearest water is taken. With triangles the volume under the linear
    depths is brought to that of the sources (docs/method.md, "Depths and shore").

    Parameters
    ----------
    points : (n, 2) float array
        Metres; places that are water by the shoreline.
    projection : Projection
    sources : sequence of Raster and Soundings
        In order of priority.
    settings : DepthSettings, optional
        What it says about files is not used here.
    spacing : (n,) float array, optional
        Node spacing (m), for the averaging; values at the places when left out.
    triangles : (n_triangles, 3) int array, optional
        Counter-clockwise, for the volume; left alone when not given.

    Returns
    -------
    depth : (n,) float array
        Metres, positive down, finite, at least the minimum depth.
    report : DepthReport

    Raises
    ------
    InputError
        If a source has no coordinate system, does not overlap the points, has its sign
        the wrong way round or fill values in it, or if the sources leave a hole.
    """
    settings = DepthSettings() if settings is None else settings
    points = np.asarray(points, dtype=np.float64).reshape(-1, 2)
    if not sources:
        raise InputError(
            "no source of depths: name at least one raster or file of soundings under "
            "depth.sources"
        )
    place = projection.inverse(points)
    elevation, known = _from_sources(
        points, place, projection, sources, settings, spacing
    )
    empty = np.flatnonzero(np.isnan(elevation))
    gap = np.zeros(0)
    if len(empty):
        elevation[empty], gap = _nearest_water(
            points[empty],
            place[empty],
            known.covered[empty],
            projection,
            sources,
            settings,
        )
    depth = -elevation
    raised = depth < settings.minimum_m
    depth[raised] = settings.minimum_m
    corrected = np.zeros(len(points), dtype=bool)
    if triangles is not None and settings.conserve_volume:

        def bed(at: np.ndarray, size: np.ndarray) -> np.ndarray:
            found, _ = _from_sources(
                at, projection.inverse(at), projection, sources, settings, size
            )
            return np.maximum(-found, settings.minimum_m)

        finest = min(_cell_size(source) for source in sources)
        before = depth
        depth = volume_corrected(points, triangles, depth, bed, finest)
        corrected = depth != before
    farthest = empty[np.argsort(-gap, kind="stable")[:10]]
    report = DepthReport(
        nodes=len(points),
        from_source=known.from_source,
        averaged=int(known.averaged.sum()),
        filled=len(empty),
        farthest_fill_m=float(gap.max(initial=0.0)),
        raised=int(raised.sum()),
        minimum_m=settings.minimum_m,
        shallowest_m=float(depth.min(initial=np.inf)),
        deepest_m=float(depth.max(initial=-np.inf)),
        corrected=int(corrected.sum()),
        filled_deg=tuple((float(x), float(y)) for x, y in place[farthest].round(5)),
    )
    logger.info("depths: %s", report)
    return depth, report


@dataclass(frozen=True)
class _Known:
    """What the sources know of the places."""

    covered: np.ndarray
    """(n,) bool: known land (a harbour that a raster does not show) against not known
    at all."""
    averaged: np.ndarray
    """(n,) bool, a mean over an area."""
    from_source: tuple[tuple[str, int], ...]


def _from_sources(
    points, place, projection: Projection, sources, settings: DepthSettings, spacing
) -> tuple[np.ndarray, _Known]:
    """Elevation by the first source with water at each place, NaN without."""
    elevation = np.full(len(points), np.nan)
    covered = np.zeros(len(points), dtype=bool)
    averaged = np.zeros(len(points), dtype=bool)
    from_source = []
    for source in sources:
        source_checks.check_system(source, projection)
        source_checks.check_values(source)
        if isinstance(source, Raster):
            found, knows, means = _from_raster(source, place, settings, spacing)
        else:
            found = _from_soundings(source, points, projection, settings)
            knows, means = np.isfinite(found), np.zeros(len(points), dtype=bool)
        new = np.isnan(elevation) & np.isfinite(found)
        elevation[new] = found[new]
        averaged |= new & means
        covered |= knows
        from_source.append((source.name or "unnamed", int(new.sum())))
    return elevation, _Known(covered, averaged, tuple(from_source))


def _cell_size(source: Raster | Soundings) -> float:
    """Side (m) of the cells of a raster at its middle; 0 for soundings."""
    if isinstance(source, Soundings):
        return 0.0
    along_x, along_y = metres_per_unit(source.crs, np.median(source.y))
    steps = np.diff(source.x).mean() * along_x, np.diff(source.y).mean() * along_y
    return float(np.mean(steps))


def _from_raster(raster: Raster, place, settings: DepthSettings, spacing):
    """Elevation, whether the raster knows anything there, whether it is a mean."""
    at = _in_system_of(raster, place)
    source_checks.check_overlap(raster, at)
    known = np.isfinite(raster.elevation)
    bed = WeightedRaster(
        raster.x, raster.y, np.where(known, raster.elevation, 0.0), known * 1.0
    )
    ground = bed.bilinear(at)
    source_checks.check_sign(raster, ground, place)
    water = _water_cells(raster.elevation, settings)
    wet = WeightedRaster(raster.x, raster.y, *water)
    found = wet.bilinear(at)
    means = np.zeros(len(at), dtype=bool)
    if spacing is not None and settings.averaging:
        unit = np.stack(metres_per_unit(raster.crs, at[:, 1]), axis=1)
        half_width = 0.5 * _SIDE_PER_SPACING * np.asarray(spacing)[:, None] / unit
        cell = np.array([np.diff(raster.x).max(), np.diff(raster.y).max()])
        large = np.flatnonzero((2.0 * half_width > cell).all(axis=1) & wet.covers(at))
        if len(large):
            mean = wet.box_mean(at[large], half_width[large])
            # A box cut to nothing at the edge has no mean.
            use = np.isfinite(mean)
            found[large[use]] = mean[use]
            means[large[use]] = True
    return found, np.isfinite(ground), means


def _water_cells(
    elevation: np.ndarray, settings: DepthSettings
) -> tuple[np.ndarray, np.ndarray]:
    """Values and weights of the cells that count."""
    known = np.isfinite(elevation)
    counts = known & (elevation < 0.0) if settings.land == "drop" else known
    values = np.where(counts, elevation, 0.0)
    if settings.land == "minimum":
        values[counts & (elevation >= 0.0)] = -settings.minimum_m
    return values, counts * 1.0


def _from_soundings(
    soundings: Soundings, points, projection: Projection, settings: DepthSettings
) -> np.ndarray:
    """Linear on the Delaunay triangulation; NaN outside."""
    at, elevation = _wet_soundings(soundings, projection, settings)
    reach = 1e3 * settings.max_hole_km
    source_checks.check_overlap_of_soundings(soundings, at, points, reach)
    return interpolate_scattered(at, elevation, points)


def _wet_soundings(
    soundings: Soundings, projection: Projection, settings: DepthSettings
) -> tuple[np.ndarray, np.ndarray]:
    """Places in the domain's plane (m) and elevations of the soundings that count."""
    elevation = soundings.elevation
    at = projection.forward(*to_degrees(soundings.crs, soundings.points).T)
    counts = np.isfinite(elevation) & np.isfinite(at).all(axis=1)
    if settings.land == "drop":
        counts &= elevation <= 0.0
    elsewhere = elevation[counts]
    if settings.land == "minimum":
        elsewhere = np.where(elsewhere >= 0.0, -settings.minimum_m, elsewhere)
    return at[counts], elsewhere


def _in_system_of(raster: Raster, place: np.ndarray) -> np.ndarray:
    """Coordinates (n, 2) in the raster's system, longitudes in its range."""
    at = from_degrees(raster.crs, *place.T)
    if raster.crs != PLANE and is_degrees(raster.crs):
        middle = 0.5 * (raster.x[0] + raster.x[-1])
        at[:, 0] += 360.0 * np.round((middle - at[:, 0]) / 360.0)
    return at


def _nearest_water(points, place, covered, projection, sources, settings):
    """Elevation of, and distance (m) to, the nearest water of any source."""
    if settings.fill == "error":
        raise InputError(
            f"{len(points)} nodes have no depth, {source_checks.places(place)}; add a "
            'source that covers them, or set depth.fill to "nearest"'
        )
    rims = [_rim(source, projection, settings) for source in sources]
    at = np.concatenate([rim[0] for rim in rims])
    elevation = np.concatenate([rim[1] for rim in rims])
    if len(at) == 0:
        raise InputError(
            "no source holds any water (an elevation below 0 m); check the sign: set "
            'positive = "down" for depths'
        )
    gap, nearest = cKDTree(at).query(points)
    names = ", ".join(source.name or "unnamed source" for source in sources)
    source_checks.check_holes(place, covered, gap, settings, names)
    return elevation[nearest], gap


def _rim(source, projection: Projection, settings: DepthSettings):
    """Places (m) and elevations of the water cells beside cells that do not count.

    The water nearest to a place without water is always one of them.
    """
    if isinstance(source, Soundings):
        return _wet_soundings(source, projection, settings)
    values, weights = _water_cells(source.elevation, settings)
    surrounded = np.ones(values.shape, dtype=bool)
    padded = np.pad(weights > 0.0, 1)
    ny, nx = values.shape
    for dj in range(3):
        for di in range(3):
            surrounded &= padded[dj : dj + ny, di : di + nx]
    j, i = np.nonzero((weights > 0.0) & ~surrounded)
    degrees = to_degrees(source.crs, np.stack([source.x[i], source.y[j]], axis=1))
    at = projection.forward(*degrees.T)
    seen = np.isfinite(at).all(axis=1)
    return at[seen], values[j, i][seen]
