"""Checks of depth sources before they are used: each tells the place and a remedy."""

from __future__ import annotations

import numpy as np

from tidemesh.basegrid.settings import DepthSettings
from tidemesh.datatypes import Raster, Soundings
from tidemesh.errors import InputError
from tidemesh.geometry.projection import Projection
from tidemesh.geometry.systems import PLANE, is_degrees, to_degrees

_DEEPEST_M = 12_000.0
"""No bed or summit is farther from sea level."""

_LAND_SHARE = 0.6
"""The share of nodes on land above which a source has its sign the wrong way round; in
marsh country up to a third of a fine raster's water is above mean sea level."""


def check_system(source: Raster | Soundings, projection: Projection) -> None:
    """A source must have a coordinate system if, and only if, the domain has one."""
    if projection.crs and source.crs == PLANE:
        raise InputError(
            f"{source.name}: has no coordinate system; give it, for instance "
            'crs = "EPSG:4326" for longitude and latitude'
        )
    if not projection.crs and source.crs != PLANE:
        raise InputError(
            f"{source.name}: lies on the earth ({source.crs[:40]}), the domain on a "
            'bare plane; set crs = "plane" if its coordinates are the domain\'s metres'
        )


def check_values(source: Raster | Soundings) -> None:
    """No value may be beyond the earth's relief, or a fill value left in."""
    values = source.elevation
    beyond = np.abs(values) > _DEEPEST_M
    if beyond.any():
        raise InputError(
            f"{source.name}: {int(beyond.sum())} values are beyond {_DEEPEST_M:,.0f} "
            f"m, {_first(source, beyond)}; if that number stands for "
            '"unknown", give it as fill_value; if the unit is not metres, convert it'
        )
    for fill in (999.0, 9999.0):
        size = np.abs(values)
        same = size == fill
        if same.sum() < 10 or ((size >= 0.9 * fill) & (size < fill)).any():
            continue
        raise InputError(
            f"{source.name}: {int(same.sum())} values are exactly "
            f"{values[same].flat[0]:g}, {_first(source, same)}; that looks like a "
            'number for "unknown": give it as fill_value'
        )


def check_overlap(raster: Raster, at: np.ndarray) -> None:
    """At least one node must lie on a raster; ``at`` is in the raster's system."""
    low, high = at.min(axis=0), at.max(axis=0)
    on_x = (at[:, 0] >= raster.x[0]) & (at[:, 0] <= raster.x[-1])
    on_y = (at[:, 1] >= raster.y[0]) & (at[:, 1] <= raster.y[-1])
    if not (on_x & on_y).any():
        unit = " degrees" if _in_degrees(raster) else ""
        raise InputError(
            f"{raster.name}: does not overlap the domain: it covers x "
            f"{raster.x[0]:.6g} to {raster.x[-1]:.6g}, y {raster.y[0]:.6g} to "
            f"{raster.y[-1]:.6g}{unit}; the domain covers x {low[0]:.6g} to "
            f"{high[0]:.6g}, y {low[1]:.6g} to {high[1]:.6g}{unit}; check the file and "
            "its coordinate system"
        )


def check_overlap_of_soundings(
    soundings: Soundings, at: np.ndarray, points: np.ndarray, reach: float
) -> None:
    """Soundings must hold water, some of it within reach (m) of the nodes' box."""
    if len(at) < 0.4 * len(soundings.points):
        raise InputError(
            f"{soundings.name}: {1 - len(at) / len(soundings.points):.0%} of the "
            'soundings come out as land; set positive to "down" if the numbers are '
            'depths, to "up" if they are elevations'
        )
    low, high = points.min(axis=0) - reach, points.max(axis=0) + reach
    if not ((at >= low) & (at <= high)).all(axis=1).any():
        raise InputError(
            f"{soundings.name}: no sounding lies in or near the box around the domain; "
            "check the file and its coordinate system"
        )


def check_sign(raster: Raster, ground: np.ndarray, place: np.ndarray) -> None:
    """Most nodes must come out as water; ``ground`` (n,) is NaN where not known."""
    known = np.isfinite(ground)
    land = known & (ground >= 0.0)
    if land.sum() > max(_LAND_SHARE * known.sum(), 10):
        highest = int(np.argmax(np.where(land, ground, -np.inf)))
        raise InputError(
            f"{raster.name}: {land.sum() / known.sum():.0%} of the nodes on it come "
            f"out as land, the highest {ground[highest]:.1f} m above sea level at "
            f'{_place(place[highest])}; set positive to "down" if the numbers are '
            'depths, to "up" if they are elevations'
        )


def check_holes(
    place: np.ndarray,
    covered: np.ndarray,
    gap: np.ndarray,
    settings: DepthSettings,
    names: str = "the sources of depths",
) -> None:
    """Nodes without water must be near some; ``gap`` (n,) is the distance (m)."""
    hole = ~covered & (gap > 1e3 * settings.max_hole_km)
    if hole.any():
        raise InputError(
            f"{names}: {int(hole.sum())} nodes lie in a hole of every source, up to "
            f"{gap[hole].max() / 1e3:.1f} km from the nearest known "
            f"water, {places(place[hole])}; add a source that covers them, or raise "
            f"depth.max_hole_km ({settings.max_hole_km:g} km)"
        )
    far = covered & (gap > 1e3 * settings.max_fill_km)
    if far.any():
        raise InputError(
            f"{int(far.sum())} nodes are land in every source and up to "
            f"{gap[far].max() / 1e3:.1f} km from the nearest water, "
            f"{places(place[far])}; add a finer source, or raise depth.max_fill_km "
            f"({settings.max_fill_km:g} km)"
        )


def places(place: np.ndarray, count: int = 3) -> str:
    """Words for the first few of (n, 2) places."""
    shown = "; ".join(_place(p) for p in place[:count])
    return f"the first at {shown}" if len(place) <= count else f"for instance {shown}"


def _place(place: np.ndarray) -> str:
    return f"({place[0]:.5f}, {place[1]:.5f})"


def _in_degrees(source: Raster | Soundings) -> bool:
    return source.crs != PLANE and is_degrees(source.crs)


def _first(source: Raster | Soundings, which: np.ndarray) -> str:
    """The first value of those marked and where it is."""
    index = tuple(int(i[0]) for i in np.nonzero(which))
    if isinstance(source, Raster):
        at = np.array([[source.x[index[1]], source.y[index[0]]]])
    else:
        at = source.points[index[0] : index[0] + 1]
    where = to_degrees(source.crs, at)[0]
    return f"the first {source.elevation[index]:g} at {_place(where)}"
