"""Scattered soundings as text with a header line."""

from __future__ import annotations

import gzip
import io
import warnings
import zlib
from pathlib import Path
from typing import Literal

import numpy as np

from tidemesh.datatypes import Soundings
from tidemesh.errors import FormatError, InputError
from tidemesh.geometry.systems import DEGREES, PLANE, is_degrees
from tidemesh.io._windows import Box

_X = ("lon", "longitude", "long", "lon_deg", "longitude_deg", "x", "easting")
_Y = ("lat", "latitude", "lat_deg", "latitude_deg", "y", "northing")
_UP = ("elevation", "height", "altitude", "z", "topo")
_DOWN = ("depth", "sounding")


def read_soundings(
    path: str | Path,
    *,
    variable: str | None = None,
    positive: Literal["up", "down", "auto"] = "auto",
    crs: str | None = None,
    fill_value: float | None = None,
    box_deg: Box | None = None,
) -> Soundings:
    """Read scattered soundings.

    Parameters
    ----------
    path : path
        Text, also gzipped, with a header line; columns lon, lat (or x, y) and one that
        begins with depth or elevation, in metres. Separated by comma, semicolon, tab
        or blanks; lines that begin with # are left out.
    variable : str, optional
        Name of the column of depths or elevations.
    positive : "up", "down" or "auto"
        Whether the numbers are elevations or depths; "auto" goes by the column's name.
    crs : str, optional
        Coordinate system; degrees when left out, "plane" for bare metres.
    fill_value : float, optional
        A number that stands for "unknown"; such rows and NaN are left out.
    box_deg : (west, south, east, north), optional
        Soundings outside are left out.

    Raises
    ------
    InputError
        If the file or a column is missing, or no sounding is left.
    FormatError
        If a line does not hold numbers.
    """
    path = Path(path)
    if not path.is_file():
        raise InputError(f"{path}: no such file")
    if positive not in ("up", "down", "auto"):
        raise ValueError(f'positive must be "up", "down" or "auto", got "{positive}"')
    text = _text(path)
    header, first_line, separator = _header(path, text)
    x_column = _column(path, header, _X)
    y_column = _column(path, header, _Y)
    z_column, down = _depth_column(path, header, variable, positive)
    x, y, z = _numbers(
        path, text, first_line, separator, (x_column, y_column, z_column)
    )
    system = DEGREES if crs is None else PLANE if crs == "plane" else crs
    degrees = system != PLANE and is_degrees(system)
    if degrees and (np.abs(y).max() > 90.01 or np.abs(x).max() > 360.01):
        at = int(np.argmax((np.abs(y) > 90.01) | (np.abs(x) > 360.01)))
        raise InputError(
            f"{path}: x {x[at]:g}, y {y[at]:g} is no longitude and latitude; give the "
            'coordinate system of the file, for instance crs = "EPSG:32617"'
        )
    keep = np.isfinite(z)
    if fill_value is not None:
        keep &= ~np.isclose(z, fill_value, rtol=1e-6, atol=0.0)
    if degrees:
        middle = 0.0 if box_deg is None else 0.5 * (box_deg[0] + box_deg[2])
        x = x - 360.0 * np.floor((x - middle + 180.0) / 360.0)
    if box_deg is not None and (degrees or system == PLANE):
        west, south, east, north = box_deg
        inside = (x >= west) & (x <= east) & (y >= south) & (y <= north)
        if not inside.any():
            raise InputError(
                f"{path}: does not overlap the area wanted: soundings lie within x "
                f"{x.min():.6g} to {x.max():.6g}, y {y.min():.6g} to {y.max():.6g}, "
                f"wanted is x {west:.6g} to {east:.6g}, y {south:.6g} to {north:.6g}"
            )
        keep &= inside
    if not keep.any():
        raise InputError(f"{path}: not one known depth in the area wanted")
    z = z[keep]
    points = np.stack([x[keep], y[keep]], axis=1)
    return Soundings(points, -z if down else z, system, path.name)


def _text(path: Path) -> str:
    try:
        raw = path.read_bytes()
        if raw[:2] == b"\x1f\x8b":
            raw = gzip.decompress(raw)
        return raw.decode("utf-8-sig")
    except (OSError, EOFError, zlib.error, UnicodeDecodeError) as error:
        raise InputError(f"{path}: cannot be read as text: {error}") from None


def _header(path: Path, text: str) -> tuple[list[str], int, str | None]:
    """Column names, number of lines up to and with them, separator (None: blanks)."""
    for number, line in enumerate(io.StringIO(text), start=1):
        if line.strip() and not line.startswith("#"):
            separator = next((s for s in ",;\t" if s in line), None)
            names = [n.strip().strip('"').lower() for n in line.split(separator)]
            if _is_number(names[0]):
                raise FormatError(
                    "expected a header line with the names of the columns, for "
                    f"instance lon,lat,depth; came {line.strip()[:60]}",
                    path,
                    number,
                )
            return names, number, separator
    raise InputError(f"{path}: the file is empty")


def _is_number(word: str) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return True


def _column(path: Path, header: list[str], names: tuple[str, ...]) -> int:
    for name in names:
        if name in header:
            return header.index(name)
    raise InputError(
        f'{path}: no column "{names[0]}" (or {", ".join(names[1:])}); it has '
        + ", ".join(header)
    )


def _depth_column(
    path: Path, header: list[str], variable: str | None, positive: str
) -> tuple[int, bool]:
    """Column number and whether its numbers are depths."""
    up = [i for i, name in enumerate(header) if name.split("_")[0] in _UP]
    down = [i for i, name in enumerate(header) if name.split("_")[0] in _DOWN]
    if variable is not None:
        if variable.lower() not in header:
            raise InputError(
                f'{path}: no column "{variable}"; it has {", ".join(header)}'
            )
        found = header.index(variable.lower())
    elif len(up) + len(down) == 1:
        found = (up + down)[0]
    else:
        several = ", ".join(header[i] for i in up + down)
        raise InputError(
            f"{path}: which column holds the depth? Name it as variable; "
            f"{several or 'none'} of {', '.join(header)} would do"
        )
    if positive != "auto":
        return found, positive == "down"
    if found not in up + down:
        raise InputError(
            f'{path}: the column "{header[found]}" does not say whether it counts up '
            'or down; set positive to "up" or "down"'
        )
    return found, found in down


def _numbers(path, text, first_line, separator, columns) -> np.ndarray:
    """(3, n) x, y, z; whole-file parse, line by line only to name a bad line."""
    try:
        with warnings.catch_warnings():
            # An empty table is told below, by name.
            warnings.simplefilter("ignore", UserWarning)
            values = np.loadtxt(
                io.StringIO(text),
                delimiter=separator,
                skiprows=first_line,
                usecols=columns,
                comments="#",
                quotechar='"',
                ndmin=2,
            )
    except (ValueError, IndexError):
        _name_bad_line(path, text, first_line, separator, columns)
        raise
    if len(values) == 0:
        raise InputError(f"{path}: has a header and no soundings")
    if not np.isfinite(values[:, :2]).all():
        at = int(np.flatnonzero(~np.isfinite(values[:, :2]).all(axis=1))[0])
        raise InputError(f"{path}: sounding {at + 1} has no position: {values[at, :2]}")
    return values.T


def _name_bad_line(path, text, first_line, separator, columns) -> None:
    for number, line in enumerate(io.StringIO(text), start=1):
        line = line.split("#")[0]
        if number <= first_line or not line.strip():
            continue
        words = [word.strip().strip('"') for word in line.rstrip("\n").split(separator)]
        for column in columns:
            word = words[column] if column < len(words) else None
            if word is None or not _is_number(word):
                came = "nothing" if not word else f'"{word}"'
                raise FormatError(
                    f"expected a number in column {column + 1}, came {came}",
                    path,
                    number,
                )
