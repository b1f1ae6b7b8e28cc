"""Shorelines: land polygons or coastlines from any vector file."""

from __future__ import annotations

import logging
import re
from pathlib import Path
from typing import Literal

import numpy as np
import pyogrio
import pyproj
import shapely
from shapely import Geometry, MultiPolygon, Polygon

from tidemesh.datatypes import LedgerEntry
from tidemesh.errors import FormatError, InputError
from tidemesh.geometry.polygons import polygon_parts, polygonal

logger = logging.getLogger(__name__)

Box = tuple[float, float, float, float]
"""West, south, east, north (degrees)."""


def read_shoreline(
    path: str | Path,
    box_deg: Box | None = None,
    *,
    layer: str | None = None,
    land_on: Literal["left", "right"] = "left",
    repair: bool = False,
    ledger: list[LedgerEntry] | None = None,
) -> MultiPolygon:
    """Read the land of a box from a file of land polygons or of coastlines.

    Parameters
    ----------
    path : path
        GeoJSON, GeoPackage, Shapefile or any other vector file that GDAL reads, in any
        coordinate system.
    box_deg : (west, south, east, north), optional
        What to read (degrees); west > east crosses the date line. Open coastlines need
        it: together with its sides they enclose the land.
    layer : str, optional
        Layer to read; needed where the file has several.
    land_on : "left" or "right"
        Side of the land along open coastlines. Closed ones enclose land, or a lake
        where they lie in land.
    repair : bool
        Mend self-crossings, join duplicate and overlapping polygons, and skip features
        without geometry, instead of refusing them.
    ledger : list of LedgerEntry, optional
        One entry for every repair is appended.

    Returns
    -------
    land : MultiPolygon
        Longitude and latitude (degrees), valid, cut at the box.

    Raises
    ------
    InputError
        If the file is missing, holds no shoreline of the box, or is not a valid one.
        The message names file, feature (counted as in the file), place and remedy.
    """
    path = Path(path)
    source = _read(path, layer, box_deg)
    repairs = [] if ledger is None else ledger
    geometries, features = source.geometries, source.features

    missing = shapely.is_missing(geometries) | shapely.is_empty(geometries)
    if missing.any() and not repair:
        raise InputError(
            f"{path}: feature {features[missing][0]} has no geometry: "
            "delete it, or set repair = true to skip such features"
        )
    # What has no place is listed at the middle of what is read.
    extent = box_deg or source.extent or (0.0, 0.0, 0.0, 0.0)
    middle = 0.5 * (np.array(extent[:2]) + np.array(extent[2:]))
    for feature in features[missing]:
        repairs.append(_repair(feature, middle, "no geometry; skipped"))
    geometries, features = geometries[~missing], features[~missing]

    geometries = _degrees(path, geometries, features, source.crs)
    geometries, features = _in_box(path, geometries, features, box_deg, source.extent)
    parts, owner = shapely.get_parts(geometries, return_index=True)
    features = features[owner]
    dimensions = shapely.get_dimensions(parts)
    if (dimensions == 2).all():
        land = _from_polygons(path, parts, features, repair, repairs)
    elif (dimensions == 1).all():
        land = _from_lines(path, parts, features, box_deg, land_on, repair, repairs)
    else:
        names = sorted({str(part.geom_type) for part in parts})
        raise InputError(
            f"{path}: expected land polygons or coastlines, found {' and '.join(names)}"
        )
    if box_deg is not None:
        land = shapely.intersection(land, shapely.box(*_unwrapped(box_deg)))
    land = polygonal(land)
    if land.is_empty:
        place = "" if box_deg is None else f" in the box {_shown_box(box_deg)}"
        raise InputError(f"{path}: no land{place}: correct box_deg or the shoreline")
    return land


def read_polygon(path: str | Path, *, layer: str | None = None) -> Polygon:
    """Read a single polygon, such as a drawn open boundary, in degrees.

    Raises
    ------
    InputError
        If the file is missing or holds anything but one polygon.
    """
    path = Path(path)
    source = _read(path, layer, None)
    found = ~shapely.is_missing(source.geometries)
    geometries = _degrees(
        path, source.geometries[found], source.features[found], source.crs
    )
    polygons = [p for geometry in geometries for p in polygon_parts(geometry)]
    if len(polygons) != 1:
        raise InputError(f"{path}: expected one polygon, found {len(polygons)}")
    return polygons[0]


# ---- the file ---------------------------------------------------------------------


class _Source:
    def __init__(self, geometries, features, crs, extent):
        self.geometries: np.ndarray = geometries
        self.features: np.ndarray = features
        self.crs: str | None = crs
        self.extent: Box | None = extent


def _read(path: Path, layer: str | None, box: Box | None) -> _Source:
    if not path.exists():
        raise InputError(f"{path}: no such file")
    try:
        layers = [str(name) for name in pyogrio.list_layers(path)[:, 0]]
        if layer is not None and layer not in layers:
            raise InputError(
                f'{path}: no layer "{layer}"; there are: {", ".join(layers)}'
            )
        if layer is None and len(layers) > 1:
            raise InputError(
                f"{path}: has several layers, name one as layer: {', '.join(layers)}"
            )
        info = pyogrio.read_info(path, layer=layer, force_total_bounds=True)
        crs = info["crs"]
        extent = info["total_bounds"]
        select = box if _counts_alike(box, crs, extent) else None
        _, features, wkb, _ = pyogrio.raw.read(
            path,
            layer=layer,
            columns=[],
            force_2d=True,
            bbox=select,
            return_fids=True,
        )
        geometries = shapely.from_wkb(wkb, on_invalid="raise")
    except (pyogrio.errors.DataSourceError, pyogrio.errors.DataLayerError) as error:
        raise FormatError(f"cannot be read as a vector file: {error}", path) from None
    except (pyogrio.errors.FeatureError, shapely.errors.ShapelyError) as error:
        raise FormatError(f"has a feature that cannot be read: {error}", path) from None
    except pyproj.exceptions.CRSError as error:
        raise FormatError(f"has an unknown coordinate system: {error}", path) from None
    return _Source(geometries, np.asarray(features), crs, extent)


def _degrees(
    path: Path, geometries: np.ndarray, features: np.ndarray, crs: str | None
) -> np.ndarray:
    """Longitude and latitude, checked to be such."""
    if not len(geometries):
        return geometries
    system = None if crs is None else pyproj.CRS(crs)
    if system is not None and not system.equals("EPSG:4326", ignore_axis_order=True):
        transformer = pyproj.Transformer.from_crs(system, "EPSG:4326", always_xy=True)

        def to_degrees(points: np.ndarray) -> np.ndarray:
            return np.stack(transformer.transform(*points.T), axis=1)

        geometries = shapely.transform(geometries, to_degrees)
    points, owner = shapely.get_coordinates(geometries, return_index=True)
    sound = (np.abs(points[:, 1]) <= 90.0) & (points[:, 0] >= -180.0 - 1e-6)
    sound &= points[:, 0] <= 360.0 + 1e-6
    if not sound.all():
        bad = np.flatnonzero(~sound)[0]
        x, y = points[bad]
        remedy = (
            "it has no coordinate system and these are no degrees: define it (for a "
            "shapefile, add its .prj file)"
            if crs is None
            else f'its coordinate system is given as "{system.name}": correct it'
        )
        raise InputError(
            f"{path}: feature {features[owner[bad]]} has a point at ({x:g}, {y:g}), "
            f"which is no longitude and latitude; {remedy}"
        )
    return geometries


def _in_box(
    path: Path,
    geometries: np.ndarray,
    features: np.ndarray,
    box_deg: Box | None,
    extent: Box | None,
) -> tuple[np.ndarray, np.ndarray]:
    """Features that meet the box, moved by whole turns to where the box counts."""
    if box_deg is None:
        if not len(geometries):
            raise InputError(f"{path}: holds no features")
        return geometries, features
    west, south, east, north = _unwrapped(box_deg)
    if not (west < east <= west + 360.0 and south < north):
        raise InputError(
            f"the box {_shown_box(box_deg)} is empty: give west, south, east, north "
            "in degrees"
        )
    moved, owners = [], []
    bounds = shapely.bounds(geometries)
    for turn in (-360.0, 0.0, 360.0):
        meets = (bounds[:, 0] + turn <= east) & (bounds[:, 2] + turn >= west)
        meets &= (bounds[:, 1] <= north) & (bounds[:, 3] >= south)
        if meets.any():
            shift = np.array([turn, 0.0])
            moved.append(
                shapely.transform(geometries[meets], lambda p, by=shift: p + by)
            )
            owners.append(features[meets])
    if not moved:
        file_extent = shapely.total_bounds(geometries) if len(geometries) else extent
        covers = (
            "holds no features"
            if file_extent is None
            else f"covers {_shown_box(file_extent)}"
        )
        raise InputError(
            f"{path}: has nothing in the box {_shown_box(box_deg)}; it {covers} "
            "(west, south, east, north). Correct box_deg, or take another shoreline"
        )
    return np.concatenate(moved), np.concatenate(owners)


def _counts_alike(box: Box | None, crs: str | None, extent: Box | None) -> bool:
    """Whether a box in degrees may be handed on to select features of the file."""
    if box is None or crs is None or extent is None:
        return False
    turned = box[0] < -180.0 or box[2] > 180.0 or box[0] >= box[2]
    turned |= extent[0] < -180.0 or extent[2] > 180.0
    return not turned and pyproj.CRS(crs).is_geographic


def _unwrapped(box_deg: Box) -> Box:
    west, south, east, north = box_deg
    return west, south, east + 360.0 if east < west else east, north


# ---- polygons ---------------------------------------------------------------------


def _from_polygons(
    path: Path,
    polygons: np.ndarray,
    features: np.ndarray,
    repair: bool,
    repairs: list[LedgerEntry],
) -> Geometry:
    for i in np.flatnonzero(~shapely.is_valid(polygons)):
        reason, place = _fault(polygons[i])
        if not repair:
            raise InputError(
                f"{path}: feature {features[i]}: {reason} at {_shown(place)}: "
                "correct it, or set repair = true to have it mended"
            )
        polygons[i] = polygonal(shapely.make_valid(polygons[i], method="structure"))
        repairs.append(_repair(features[i], place, f"{reason}; mended"))
    polygons, owner = shapely.get_parts(polygons, return_index=True)
    features = features[owner]
    first, second, what = _clash(polygons)
    if len(first) and not repair:
        i, j = first[0], second[0]
        raise InputError(
            f"{path}: features {features[i]} and {features[j]} {what[0]} at "
            f"{_shown(_meeting(polygons[i], polygons[j]))}: delete one, or set "
            "repair = true to join them"
        )
    for i, j, word in zip(first, second, what):
        reason = f"features {features[i]} and {features[j]} {word}; joined"
        place = _meeting(polygons[i], polygons[j])
        repairs.append(_repair(None, place, reason))
    return shapely.union_all(polygons)


def _clash(polygons: np.ndarray) -> tuple[np.ndarray, np.ndarray, list[str]]:
    """Pairs of polygons that are the same or overlap, in file order."""
    a, b = shapely.STRtree(polygons).query(polygons)
    a, b = a[a < b], b[a < b]
    # A mainland meets the bounds of every island: it is indexed once, and asked.
    size = shapely.get_num_coordinates(polygons)
    large, small = np.where(size[a] >= size[b], (a, b), (b, a))
    shapely.prepare(polygons)
    meet = shapely.intersects(polygons[large], polygons[small])
    a, b = a[meet], b[meet]
    same = shapely.equals(polygons[a], polygons[b])
    over = shapely.overlaps(polygons[a], polygons[b])
    pairs = sorted(
        (int(i), int(j), "are the same" if equal else "overlap")
        for i, j, equal in zip(a[same | over], b[same | over], same[same | over])
    )
    first = np.array([p[0] for p in pairs], dtype=np.int64)
    second = np.array([p[1] for p in pairs], dtype=np.int64)
    return first, second, [p[2] for p in pairs]


def _meeting(one: Polygon, other: Polygon) -> np.ndarray:
    shared = shapely.intersection(one, other)
    return shapely.get_coordinates(shapely.point_on_surface(shared))[0]


def _fault(polygon: Polygon) -> tuple[str, np.ndarray]:
    text = shapely.is_valid_reason(polygon)
    found = re.match(r"(.+)\[(\S+) (\S+)\]", text)
    if not found:
        return text.lower(), shapely.get_coordinates(polygon)[0]
    return found[1].strip().lower(), np.array([float(found[2]), float(found[3])])


# ---- coastlines -------------------------------------------------------------------


def _from_lines(
    path: Path,
    lines: np.ndarray,
    features: np.ndarray,
    box_deg: Box | None,
    land_on: str,
    repair: bool,
    repairs: list[LedgerEntry],
) -> Geometry:
    """Land enclosed by closed coastlines, and by open ones with the box's sides."""
    lines = _without_crossings(path, lines, features, repair, repairs)
    lines = shapely.get_parts(
        shapely.line_merge(shapely.multilinestrings(lines), directed=True)
    )
    closed = shapely.is_closed(lines)
    mainland = Polygon()
    if not closed.all():
        mainland = _mainland(path, lines[~closed], box_deg, land_on)
    rings = [polygonal(shapely.make_valid(Polygon(line))) for line in lines[closed]]
    return _with_rings(mainland, rings)


def _without_crossings(
    path: Path,
    lines: np.ndarray,
    features: np.ndarray,
    repair: bool,
    repairs: list[LedgerEntry],
) -> np.ndarray:
    for i in np.flatnonzero(~shapely.is_simple(lines)):
        place = _self_crossing(lines[i])
        if not repair:
            raise InputError(
                f"{path}: feature {features[i]} crosses itself at {_shown(place)}: "
                "correct it, or set repair = true to have it mended"
            )
        repairs.append(_repair(features[i], place, "crosses itself; mended"))
    tree = shapely.STRtree(lines)
    a, b = tree.query(lines, predicate="intersects")
    a, b = a[a < b], b[a < b]
    same = shapely.equals(lines[a], lines[b])
    clash = same | shapely.crosses(lines[a], lines[b])
    clash |= shapely.overlaps(lines[a], lines[b])
    keep = np.ones(len(lines), dtype=bool)
    for i, j, equal in sorted(zip(a[clash], b[clash], same[clash])):
        word = "are the same" if equal else "cross"
        place = shapely.get_coordinates(shapely.intersection(lines[i], lines[j]))[0]
        if not repair:
            raise InputError(
                f"{path}: features {features[i]} and {features[j]} {word} at "
                f"{_shown(place)}: correct them, or set repair = true"
            )
        keep[j] &= not equal
        reason = f"features {features[i]} and {features[j]} {word}; mended"
        repairs.append(_repair(None, place, reason))
    return lines[keep]


def _self_crossing(line: Geometry) -> np.ndarray:
    points = shapely.get_coordinates(line)
    segments = shapely.linestrings(np.stack([points[:-1], points[1:]], axis=1))
    a, b = shapely.STRtree(segments).query(segments, predicate="intersects")
    count = len(segments)
    around = b - a == count - 1 if shapely.is_closed(line) else np.zeros(len(a), bool)
    apart = np.flatnonzero((b - a > 1) & ~around)
    if not len(apart):
        return points[0]
    first = apart[np.lexsort((b[apart], a[apart]))[0]]
    shared = shapely.intersection(segments[a[first]], segments[b[first]])
    return shapely.get_coordinates(shared)[0]


def _mainland(
    path: Path, lines: np.ndarray, box_deg: Box | None, land_on: str
) -> Geometry:
    """Land beside open coastlines: cells of the box, judged by the coast's side."""
    if box_deg is None:
        raise InputError(
            f"{path}: holds open coastlines, which enclose land only together with the "
            "sides of a box: give box_deg"
        )
    box = shapely.box(*_unwrapped(box_deg))
    ends = shapely.points(
        np.concatenate([_end_points(lines, 0), _end_points(lines, -1)])
    )
    dangling = shapely.contains_properly(box, ends)
    if dangling.any():
        end = ends[dangling][0]
        others = shapely.union_all(ends[ends != end])
        gap = (
            ""
            if others.is_empty
            else (f"; the next end is {end.distance(others):.5f} degrees away")
        )
        raise InputError(
            f"{path}: a coastline ends inside the box at "
            f"{_shown(shapely.get_coordinates(end)[0])}{gap}: close the gap, or choose "
            "a box that the file covers"
        )
    cells = np.array(
        polygon_parts(shapely.polygonize([shapely.union_all([*lines, box.exterior])]))
    )
    cells = cells[shapely.contains_properly(box, shapely.point_on_surface(cells))]
    middle, along = _segments_in(box.bounds, lines)
    # A step aside far shorter than the segment, yet far above rounding.
    aside = 1e-4 * np.stack([-along[:, 1], along[:, 0]], axis=1)
    if land_on == "right":
        aside = -aside
    votes = np.zeros((2, len(cells)))
    tree = shapely.STRtree(cells)
    for side, sign in enumerate((-1.0, 1.0)):
        segment, cell = tree.query(
            shapely.points(middle + sign * aside), predicate="within"
        )
        weight = np.hypot(*along[segment].T)
        votes[side] = np.bincount(cell, weights=weight, minlength=len(cells))
    doubtful = np.minimum(*votes) > 0.01 * np.maximum(*votes)
    if doubtful.any():
        place = shapely.get_coordinates(shapely.point_on_surface(cells[doubtful]))[0]
        raise InputError(
            f"{path}: the coastlines around {_shown(place)} run in opposite "
            "directions, so land and water cannot be told apart: turn one round "
            f"(land is expected on the {land_on}; see land_on)"
        )
    return shapely.union_all(cells[votes[1] > votes[0]])


def _segments_in(box: Box, lines: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Middle and extent of the segments of lines, cut at a box: (n, 2) each."""
    points, owner = shapely.get_coordinates(lines, return_index=True)
    same = owner[1:] == owner[:-1]
    start, along = points[:-1][same], np.diff(points, axis=0)[same]
    with np.errstate(divide="ignore", invalid="ignore"):
        low = (np.array(box[:2]) - start) / along
        high = (np.array(box[2:]) - start) / along
    enter = np.fmin(low, high).max(axis=1, initial=0.0, where=along != 0.0)
    leave = np.fmax(low, high).min(axis=1, initial=1.0, where=along != 0.0)
    inside = leave > enter
    middle = start + (0.5 * (enter + leave))[:, None] * along
    return middle[inside], ((leave - enter)[:, None] * along)[inside]


def _end_points(lines: np.ndarray, index: int) -> np.ndarray:
    return shapely.get_coordinates(shapely.get_point(lines, index))


def _with_rings(mainland: Geometry, rings: list[MultiPolygon]) -> Geometry:
    """Add islands, and take out the closed lines that lie in land: lakes."""
    rings = [ring for ring in rings if not ring.is_empty]
    if not rings:
        return mainland
    within = shapely.point_on_surface(rings)
    shapely.prepare(mainland)
    depth = shapely.contains_properly(mainland, within).astype(np.int64)
    inner, outer = shapely.STRtree(rings).query(within, predicate="within")
    depth += np.bincount(inner[inner != outer], minlength=len(rings))
    land = mainland
    for level in range(int(depth.max()) + 1):
        here = shapely.union_all(np.array(rings, dtype=object)[depth == level])
        combine = shapely.union if level % 2 == 0 else shapely.difference
        land = combine(land, here)
    return land


# ---- messages ---------------------------------------------------------------------


def _repair(feature: int | None, place: np.ndarray, what: str) -> LedgerEntry:
    longitude, latitude = map(float, place)
    named = what if feature is None else f"feature {feature}: {what}"
    logger.info("shoreline repaired: %s", named)
    return LedgerEntry("shoreline repaired", longitude, latitude, 0.0, named)


def _shown(place: np.ndarray) -> str:
    return f"{place[0]:.5f} E, {place[1]:.5f} N"


def _shown_box(box: Box) -> str:
    return "[" + ", ".join(f"{value:g}" for value in box) + "]"
