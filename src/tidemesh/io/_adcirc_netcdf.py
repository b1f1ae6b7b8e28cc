"""ADCIRC's NetCDF files (classic and HDF5): found out by content, whole, by name."""

from __future__ import annotations

import struct
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import netCDF4
import numpy as np
from scipy.io import netcdf_file

from tidemesh.errors import FormatError, InputError

DRY = -99999.0
"""What ADCIRC writes where a node has no value."""

# What the libraries raise when the content of a file is damaged.
_DAMAGE = (
    OSError,
    RuntimeError,
    ValueError,
    TypeError,
    KeyError,
    IndexError,
    AttributeError,
    ArithmeticError,
    MemoryError,
    struct.error,
)


def is_netcdf(path: Path) -> bool:
    """Whether a file is NetCDF by its first bytes.

    Raises
    ------
    InputError
        If there is no such file or it cannot be read.
    """
    try:
        with open(path, "rb") as file:
            start = file.read(4)
    except FileNotFoundError as error:
        raise InputError(f"{path}: there is no such file") from error
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror})") from error
    return start[:3] == b"CDF" or start == b"\x89HDF"


@contextmanager
def opened(path: Path) -> Iterator[netCDF4.Dataset]:
    """A NetCDF file whose values come as they are stored.

    Raises
    ------
    FormatError
        If the file is damaged or cut off, here or inside the block.
    """
    try:
        _require_whole(path)
        with netCDF4.Dataset(path) as data:
            data.set_auto_mask(False)
            data.set_auto_scale(False)
            yield data
    except InputError:
        raise
    except _DAMAGE as error:
        raise FormatError(
            f"the NetCDF file is damaged or cut off: {error or type(error).__name__}",
            path,
        ) from error


def _require_whole(path: Path) -> None:
    """The library reads zeros beyond the end of a classic file that was cut off."""
    with open(path, "rb") as file:
        if file.read(4) not in (b"CDF\x01", b"CDF\x02"):
            return
    with netcdf_file(path, "r", mmap=True):
        pass


def numbers(
    data: netCDF4.Dataset, name: str, dimensions: tuple[str, ...], path: Path
) -> netCDF4.Variable:
    """A variable of numbers with these dimensions.

    Raises
    ------
    FormatError
        If it is not there, or of another form.
    """
    variable = data.variables.get(name)
    if variable is None:
        have = ", ".join(sorted(data.variables)) or "none"
        raise FormatError(f'there is no variable "{name}"; there are: {have}', path)
    if variable.dimensions != dimensions or np.dtype(variable.dtype).kind not in "fiu":
        raise FormatError(
            f'the variable "{name}" must be numbers over ({", ".join(dimensions)}), '
            f"got {variable.dtype} over ({', '.join(variable.dimensions)})",
            path,
        )
    return variable


def names(data: netCDF4.Dataset, name: str) -> tuple[str, ...]:
    """Texts of a variable of characters; empty if it is not there."""
    if name not in data.variables:
        return ()
    letters = np.asarray(data.variables[name][:])
    if letters.dtype.kind not in "SU" or letters.ndim != 2:
        return ()
    return tuple(
        b"".join(row).decode("utf-8", errors="replace").strip("\0 ")
        for row in letters.astype("S1")
    )


def without_dry(values: np.ndarray, what: str, path: Path) -> np.ndarray:
    """Float copy with NaN where dry.

    Raises
    ------
    FormatError
        If a value is not finite: the run blew up, or the file is damaged.
    """
    values = np.array(values, dtype=np.float64)
    wrong = ~np.isfinite(values)
    if wrong.any():
        place = tuple(int(k) + 1 for k in np.argwhere(wrong)[0])
        raise FormatError(f"{what} is not finite at {place}: the run blew up", path)
    values[values == DRY] = np.nan
    return values
