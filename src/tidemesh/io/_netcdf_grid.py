"""Find the bed elevation in a NetCDF file, its axes, coordinate system and sign."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import netCDF4
import numpy as np
import pyproj

from tidemesh.errors import InputError
from tidemesh.geometry.systems import DEGREES
from tidemesh.io._windows import METRES, Window

_LONGITUDE = ("lon", "longitude", "long", "nav_lon")
_LATITUDE = ("lat", "latitude", "nav_lat")
_BED_NAMES = ("elevation", "bathymetry", "depth", "topo", "z", "altitude", "band1")


@dataclass(frozen=True, eq=False)
class NetcdfGrid:
    """One variable on one-dimensional axes, still on disk."""

    variable: netCDF4.Variable
    transposed: bool
    """True where the file has (x, y) instead of (y, x)."""
    x: np.ndarray
    y: np.ndarray
    crs: str | None
    positive_down: bool
    metres: float
    """Length (m) of the file's unit."""

    def read(self, window: Window) -> np.ndarray:
        """(ny, nx) metres with the file's sign, NaN where unknown."""
        single = (0,) * (self.variable.ndim - 2)

        def read_slab(rows: slice, columns: slice) -> np.ndarray:
            if self.transposed:
                values = self.variable[(*single, columns, rows)].T
            else:
                values = self.variable[(*single, rows, columns)]
            return np.ma.filled(np.ma.asarray(values).astype(np.float64), np.nan)

        return window.read(read_slab) * self.metres


@contextmanager
def open_grid(path: Path, name: str | None) -> Iterator[NetcdfGrid]:
    """Open a NetCDF file at the variable asked for, or at the only one that fits.

    Raises
    ------
    InputError
        If there is no such variable, several fit, or it has no one-dimensional axes.
    """
    try:
        dataset = netCDF4.Dataset(path)
    except OSError as error:
        raise InputError(f"{path}: cannot be read as NetCDF: {error}") from None
    with dataset:
        variable = _choose(path, dataset, name)
        x_axis, y_axis, transposed = _axes(dataset, variable)
        try:
            yield NetcdfGrid(
                variable,
                transposed,
                _values(path, x_axis),
                _values(path, y_axis),
                _system(path, dataset, variable, x_axis, y_axis),
                _positive_down(variable),
                _unit(path, variable),
            )
        except (OSError, RuntimeError) as error:
            raise InputError(
                f'{path}: variable "{variable.name}" cannot be read: {error}; the file '
                "may be damaged"
            ) from None


def _choose(path: Path, dataset: netCDF4.Dataset, name: str | None) -> netCDF4.Variable:
    fitting = [v for v in dataset.variables.values() if _axes(dataset, v) is not None]
    candidates = [v for v in fitting if not _is_flag(v)]
    listed = ", ".join(v.name for v in candidates) or "none"
    if name is not None:
        for variable in fitting:
            if variable.name == name:
                return variable
        if name in dataset.variables:
            shape = ", ".join(dataset.variables[name].dimensions)
            raise InputError(
                f'{path}: variable "{name}" ({shape}) is not on two one-dimensional '
                "axes; put it on a regular grid, or give its cells as soundings. "
                f"Variables that fit: {listed}"
            )
        raise InputError(
            f'{path}: no variable "{name}"; those on a regular grid: {listed}'
        )
    if len(candidates) > 1:
        named = [v for v in candidates if v.name.lower() in _BED_NAMES]
        candidates = named if len(named) == 1 else candidates
    if len(candidates) == 1:
        return candidates[0]
    if not candidates:
        shapes = "; ".join(
            f"{v.name} ({', '.join(v.dimensions)})" for v in dataset.variables.values()
        )
        raise InputError(
            f"{path}: no variable on two one-dimensional axes. Its variables: {shapes}"
            ". "
            "Put curvilinear or scattered data on a regular grid, or give it as "
            "soundings"
        )
    raise InputError(f"{path}: which variable? Name one of: {listed}")


def _is_flag(variable: netCDF4.Variable) -> bool:
    attributes = variable.ncattrs()
    return "flag_values" in attributes or "flag_masks" in attributes


def _axes(dataset: netCDF4.Dataset, variable: netCDF4.Variable):
    """Axis of x, axis of y, whether x comes first; None if there are no such axes."""
    if variable.ndim < 2 or any(n != 1 for n in variable.shape[:-2]):
        return None
    if getattr(variable.dtype, "kind", "O") not in "iuf":
        return None
    first, second = (_axis(dataset, d) for d in variable.dimensions[-2:])
    if first is None or second is None:
        return None
    transposed = _direction(first) == "x" or _direction(second) == "y"
    return (first, second, True) if transposed else (second, first, False)


def _axis(dataset: netCDF4.Dataset, dimension: str) -> netCDF4.Variable | None:
    if dimension in dataset.variables:
        axis = dataset.variables[dimension]
        return axis if axis.ndim == 1 else None
    on_it = [v for v in dataset.variables.values() if v.dimensions == (dimension,)]
    on_it = [v for v in on_it if _direction(v) is not None] or on_it
    return on_it[0] if len(on_it) == 1 else None


def _direction(axis: netCDF4.Variable) -> str | None:
    said = getattr(axis, "axis", "").lower()
    if said in ("x", "y"):
        return said
    standard = getattr(axis, "standard_name", "")
    name = axis.name.lower()
    units = getattr(axis, "units", "").lower()
    if (
        standard in ("longitude", "projection_x_coordinate")
        or units.startswith(("degrees_e", "degree_e"))
        or name in (*_LONGITUDE, "x", "easting")
    ):
        return "x"
    if (
        standard in ("latitude", "projection_y_coordinate")
        or units.startswith(("degrees_n", "degree_n"))
        or name in (*_LATITUDE, "y", "northing")
    ):
        return "y"
    return None


def _values(path: Path, axis: netCDF4.Variable) -> np.ndarray:
    values = np.ma.asarray(axis[:])
    if np.ma.count_masked(values):
        raise InputError(f'{path}: the axis "{axis.name}" has missing values')
    return np.asarray(values, dtype=np.float64)


def _system(path, dataset, variable, x_axis, y_axis) -> str | None:
    mapping = getattr(variable, "grid_mapping", None)
    if mapping in dataset.variables:
        attributes = dataset.variables[mapping].__dict__
        for key in ("crs_wkt", "spatial_ref"):
            if key in attributes:
                return attributes[key]
        for key in ("epsg_code", "EPSG_code", "epsg"):
            if key in attributes:
                code = str(attributes[key]).upper().removeprefix("EPSG:")
                return f"EPSG:{code}"
        try:
            return pyproj.CRS.from_cf(attributes).to_wkt()
        except (pyproj.exceptions.CRSError, KeyError):
            raise InputError(
                f'{path}: the grid mapping "{mapping}" cannot be understood; give the '
                'coordinate system, for instance crs = "EPSG:4326"'
            ) from None
    units = getattr(x_axis, "units", "").lower()
    named = x_axis.name.lower() in _LONGITUDE and y_axis.name.lower() in _LATITUDE
    return DEGREES if units.startswith("degree") or named else None


def _positive_down(variable: netCDF4.Variable) -> bool:
    said = getattr(variable, "positive", "").lower()
    if said in ("up", "down"):
        return said == "down"
    for text in (getattr(variable, "standard_name", ""), variable.name.lower()):
        if any(word in text for word in ("elevation", "height", "altitude")):
            return False
        if text.startswith(("depth", "deptho")) or "_depth" in text:
            return True
    return False


def _unit(path: Path, variable: netCDF4.Variable) -> float:
    text = str(getattr(variable, "units", "m")).strip().lower()
    word = text.split()[0] if text else "m"
    if word not in METRES:
        raise InputError(
            f'{path}: variable "{variable.name}" is in "{text}", not in a unit of '
            "length; name the variable that holds the bed elevation, or correct the "
            "attribute units"
        )
    return METRES[word]
