"""The part of a global or regional grid that a box needs."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from tidemesh.errors import InputError
from tidemesh.geometry.projection import Projection
from tidemesh.geometry.systems import PLANE, is_degrees

Box = tuple[float, float, float, float]
"""West, south, east, north in degrees."""

MARGIN = 2
"""Cells kept around the box, so that it can be interpolated up to its edge."""

MOST_CELLS = 100_000_000
"""More would need over 4 GB on the way to the nodes."""

METRES = {
    "m": 1.0,
    "meter": 1.0,
    "meters": 1.0,
    "metre": 1.0,
    "metres": 1.0,
    "cm": 0.01,
    "dm": 0.1,
    "km": 1000.0,
    "ft": 0.3048,
    "feet": 0.3048,
    "foot": 0.3048,
    "us_survey_foot": 1200.0 / 3937.0,
    "fathom": 1.8288,
    "fathoms": 1.8288,
}
"""Lengths (m) of the units that bed elevations come in."""


@dataclass(frozen=True, eq=False)
class Window:
    """Rows and columns of a file (indices), in ascending order of `x` and `y`."""

    columns: np.ndarray
    rows: np.ndarray
    x: np.ndarray
    y: np.ndarray

    def read(self, read_slab: Callable[[slice, slice], np.ndarray]) -> np.ndarray:
        """(ny, nx) values, by as few contiguous slabs (rows, columns) as possible."""
        return np.concatenate(
            [
                np.concatenate(
                    [
                        read_slab(rows, columns)[::row_step, ::column_step]
                        for columns, column_step in _runs(self.columns)
                    ],
                    axis=1,
                )
                for rows, row_step in _runs(self.rows)
            ],
            axis=0,
        )


def find_window(
    path: Path, x: np.ndarray, y: np.ndarray, crs: str, box_deg: Box | None
) -> Window:
    """Rows and columns of a grid that cover a box.

    Parameters
    ----------
    path : Path
        For messages.
    x, y : (nx,), (ny,) float arrays
        Cell centres in the order of the file, in the units of `crs`.
    crs : str
        Coordinate system; longitudes may run over any 360 degrees.
    box_deg : (west, south, east, north), optional
        Everything when left out.

    Raises
    ------
    InputError
        If an axis is not in order, does not hold degrees though it should, or misses
        the box.
    """
    degrees = crs != PLANE and is_degrees(crs)
    for name, axis in (("x", x), ("y", y)):
        _check_axis(path, name, axis)
    if degrees:
        _check_degrees(path, x, y)
    box = None if box_deg is None else _box_in_system(crs, degrees, box_deg)
    if degrees:
        middle = 0.5 * (x.min() + x.max())
        if box is not None:
            middle = 0.5 * (box[0] + box[2])
            x = x - 360.0 * np.floor((x - middle + 180.0) / 360.0)
        else:
            x = x - 360.0 * np.ceil((middle - 180.0) / 360.0)
    columns, rows = np.argsort(x, kind="stable"), np.argsort(y, kind="stable")
    # The first and the last column of a global grid can be the same meridian.
    distinct = np.diff(x[columns], prepend=-np.inf) > 1e-9 * np.ptp(x)
    columns = columns[distinct]
    if box is not None:
        kept_columns = columns[_covering(x[columns], box[0], box[2])]
        kept_rows = rows[_covering(y[rows], box[1], box[3])]
        if len(kept_columns) < 2 or len(kept_rows) < 2:
            wanted = _extent(np.array(box[0::2]), np.array(box[1::2]), degrees)
            raise InputError(
                f"{path}: does not overlap the area wanted: the file covers "
                f"{_extent(x, y, degrees)}, wanted is {wanted}; check that it is the "
                "right file and its coordinate system the right one"
            )
        columns, rows = kept_columns, kept_rows
    if len(columns) * len(rows) > MOST_CELLS:
        raise InputError(
            f"{path}: {len(columns)} x {len(rows)} cells in the area wanted are more "
            f"than {MOST_CELLS:,}; make the grid coarser, for instance with gdalwarp "
            "-r average -tr"
        )
    return Window(columns, rows, x[columns], y[rows])


def looks_like_degrees(x: np.ndarray, y: np.ndarray) -> bool:
    """Whether coordinates could be longitudes and latitudes."""
    return bool(
        np.abs(y).max() <= 90.01 and x.min() >= -180.01 and x.max() <= 360.01
    ) and bool(np.ptp(x) <= 361.0)


def _check_axis(path: Path, name: str, axis: np.ndarray) -> None:
    if len(axis) < 2:
        raise InputError(f"{path}: the {name} axis has {len(axis)} values, at least 2")
    step = np.diff(axis)
    if not np.isfinite(axis).all() or not ((step > 0).all() or (step < 0).all()):
        at = int(np.flatnonzero(~(step * np.sign(step[0]) > 0))[0])
        raise InputError(
            f"{path}: the {name} axis is not in order: {axis[at]} is followed by "
            f"{axis[at + 1]} at index {at + 1}; sort or repair the file"
        )


def _check_degrees(path: Path, x: np.ndarray, y: np.ndarray) -> None:
    # Longitudes of a grid may start anywhere, for instance 20 to 380.
    if np.abs(y).max() > 90.01 or np.ptp(x) > 361.0 or np.abs(x).max() > 720.0:
        raise InputError(
            f"{path}: the coordinates, x {x.min():g} to {x.max():g} and y {y.min():g} "
            f"to {y.max():g}, are no longitudes and latitudes; give the coordinate "
            'system of the file, for instance crs = "EPSG:32617"'
        )


def _box_in_system(crs: str, degrees: bool, box_deg: Box) -> Box:
    if degrees or crs == PLANE:
        return box_deg
    west, south, east, north = box_deg
    longitude, latitude = np.meshgrid(
        np.linspace(west, east, 21), np.linspace(south, north, 21)
    )
    seen = Projection(crs).forward(longitude.ravel(), latitude.ravel())
    seen = seen[np.isfinite(seen).all(axis=1)]
    if len(seen) == 0:
        return (np.inf, np.inf, np.inf, np.inf)
    return (*seen.min(axis=0).tolist(), *seen.max(axis=0).tolist())


def _covering(axis: np.ndarray, low: float, high: float) -> slice:
    first = int(np.searchsorted(axis, low))
    last = int(np.searchsorted(axis, high, side="right"))
    # Without a cell in reach on one side the margin must not invent an overlap.
    reach = 1.5 * np.diff(axis).max()
    if first == len(axis) and axis[-1] < low - reach:
        return slice(0, 0)
    if last == 0 and axis[0] > high + reach:
        return slice(0, 0)
    return slice(max(first - MARGIN, 0), last + MARGIN)


def _extent(x: np.ndarray, y: np.ndarray, degrees: bool) -> str:
    unit = "degrees" if degrees else "in its own units"
    return f"x {x.min():.6g} to {x.max():.6g}, y {y.min():.6g} to {y.max():.6g} {unit}"


def _runs(indices: np.ndarray) -> list[tuple[slice, int]]:
    """Split into contiguous slices with the step (1 or -1) that restores the order."""
    if len(indices) > 1 and indices[1] < indices[0]:
        return [(s, -1) for s, _ in _runs(indices[::-1])][::-1]
    cuts = np.flatnonzero(np.diff(indices) != 1) + 1
    return [(slice(int(r[0]), int(r[-1]) + 1), 1) for r in np.split(indices, cuts)]
