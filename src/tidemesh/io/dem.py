"""Bed elevations: rasters (NetCDF, GeoTIFF and whatever else GDAL reads), soundings."""

from __future__ import annotations

import logging
from pathlib import Path
from typing import Literal

import numpy as np
import rasterio
from rasterio.errors import RasterioError

from tidemesh.datatypes import Raster
from tidemesh.errors import InputError
from tidemesh.geometry.systems import DEGREES, PLANE
from tidemesh.io._netcdf_grid import open_grid
from tidemesh.io._windows import METRES, Box, find_window, looks_like_degrees
from tidemesh.io.soundings import read_soundings

__all__ = ["read_raster", "read_soundings"]

logger = logging.getLogger(__name__)

Positive = Literal["up", "down", "auto"]


def read_raster(
    path: str | Path,
    *,
    variable: str | None = None,
    positive: Positive = "auto",
    crs: str | None = None,
    fill_value: float | None = None,
    box_deg: Box | None = None,
) -> Raster:
    """Read a bed elevation raster, or the part of it that a box needs.

    Scale, offset, fill value and units of the file are honoured; rows and columns may
    run either way, longitudes over any 360 degrees.

    Parameters
    ----------
    path : path
        NetCDF (classic or 4) with one-dimensional coordinates, or any raster that GDAL
        reads, not rotated.
    variable : str, optional
        NetCDF variable, or band number. Needed if several could be meant.
    positive : "up", "down" or "auto"
        Whether the numbers are elevations or depths. "auto" goes by the attribute
        ``positive``, the standard name and the name, and takes what says nothing for
        an elevation.
    crs : str, optional
        Coordinate system, instead of what the file says; "plane" for bare metres.
    fill_value : float, optional
        A number (as stored, scale and offset applied) that stands for "unknown".
    box_deg : (west, south, east, north), optional
        Degrees (metres on the bare plane). Two more cells are kept on every side.

    Returns
    -------
    raster : Raster
        Elevation in metres, positive up, NaN where unknown.

    Raises
    ------
    InputError
        If the file cannot be read as such a raster; the message says what to do.
    """
    path = Path(path)
    if not path.is_file():
        raise InputError(f"{path}: no such file")
    if positive not in ("up", "down", "auto"):
        raise ValueError(f'positive must be "up", "down" or "auto", got "{positive}"')
    read = _read_netcdf if _is_netcdf(path) else _read_gdal
    raster, down = read(path, variable, crs, box_deg)
    elevation, x, y, system = raster
    if fill_value is not None:
        # Fill values pass through float32 in many files.
        unknown = np.isclose(elevation, fill_value, rtol=1e-6, atol=0.0)
        elevation[unknown] = np.nan
    if positive == "down" or (positive == "auto" and down):
        np.negative(elevation, out=elevation)
    if not np.isfinite(elevation).any():
        raise InputError(
            f"{path}: not one known value in the area wanted; check the file, the "
            "variable and the fill value"
        )
    return Raster(x, y, elevation, system, path.name)


def _is_netcdf(path: Path) -> bool:
    with path.open("rb") as file:
        start = file.read(8)
    # Bathymetry Attributed Grids are HDF5 as NetCDF 4 is, but GDAL's to read.
    hdf5 = start == b"\x89HDF\r\n\x1a\n" and path.suffix.lower() != ".bag"
    return start[:3] == b"CDF" or hdf5


def _read_netcdf(path: Path, variable, crs, box_deg):
    with open_grid(path, variable) as grid:
        system = _system(path, crs, grid.crs, grid.x, grid.y)
        window = find_window(path, grid.x, grid.y, system, box_deg)
        return (grid.read(window), window.x, window.y, system), grid.positive_down


def _read_gdal(path: Path, variable, crs, box_deg):
    try:
        with rasterio.open(path) as dataset:
            transform = dataset.transform
            if transform.b or transform.d:
                raise InputError(
                    f"{path}: the raster is rotated against its axes; turn it first, "
                    "for instance with gdalwarp"
                )
            if transform.is_identity:
                raise InputError(
                    f"{path}: not georeferenced: neither the file nor a world file "
                    "beside it says where its cells lie"
                )
            band = _band(path, dataset, variable)
            x = transform.c + transform.a * (np.arange(dataset.width) + 0.5)
            y = transform.f + transform.e * (np.arange(dataset.height) + 0.5)
            found = None if dataset.crs is None else _short_name(dataset.crs)
            system = _system(path, crs, found, x, y)
            window = find_window(path, x, y, system, box_deg)

            def read_slab(rows: slice, columns: slice) -> np.ndarray:
                part = rasterio.windows.Window.from_slices(rows, columns)
                values = dataset.read(band, window=part, masked=True)
                return values.astype(np.float64).filled(np.nan)

            elevation = window.read(read_slab)
            scale, offset = dataset.scales[band - 1], dataset.offsets[band - 1]
            # What is no length here says nothing: most files leave it out.
            metres = METRES.get((dataset.units[band - 1] or "m").lower(), 1.0)
            elevation = (elevation * scale + offset) * metres
            named = f"{dataset.descriptions[band - 1] or ''}".lower()
    except RasterioError as error:
        raise InputError(
            f"{path}: cannot be read as a raster: {error}; NetCDF, GeoTIFF and most "
            "formats of GDAL are understood"
        ) from None
    return (elevation, window.x, window.y, system), "depth" in named


def _band(path: Path, dataset: rasterio.DatasetReader, variable: str | None) -> int:
    names = [
        f"{number}" + (f" ({name})" if name else "")
        for number, name in enumerate(dataset.descriptions, start=1)
    ]
    if variable is None and dataset.count == 1:
        return 1
    if variable is not None:
        for number, name in enumerate(dataset.descriptions, start=1):
            if variable in (str(number), name):
                return number
    asked = "" if variable is None else f'no band "{variable}"; '
    raise InputError(
        f"{path}: {asked}name one of its bands as variable: {', '.join(names)}"
    )


def _short_name(crs: rasterio.crs.CRS) -> str:
    code = crs.to_epsg()
    return crs.to_wkt() if code is None else f"EPSG:{code}"


def _system(
    path: Path, given: str | None, found: str | None, x: np.ndarray, y: np.ndarray
) -> str:
    """Coordinate system: the caller's word, the file's, or degrees if they must be."""
    if given is not None:
        return PLANE if given == "plane" else given
    if found is not None:
        return found
    if looks_like_degrees(x, y):
        logger.warning(
            "%s: no coordinate system; taken for longitude and latitude", path
        )
        return DEGREES
    raise InputError(
        f"{path}: names no coordinate system, and its coordinates (x {x.min():g} to "
        f"{x.max():g}, y {y.min():g} to {y.max():g}) are not degrees; give it, for "
        'instance crs = "EPSG:32617"'
    )
