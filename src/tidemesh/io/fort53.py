"""ADCIRC's harmonic constants: fort.53, fort.54 (nodes), fort.51, fort.52 (stations).

Text and NetCDF, told apart by content. Amplitudes in metres or m/s, phases are lags in
degrees: value = Re(F exp(i w t)) with F = amplitude * exp(-i phase). Node numbers in
the files count from 1.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import NamedTuple

import numpy as np

from tidemesh.datatypes import TideSolution
from tidemesh.errors import FormatError
from tidemesh.io import _adcirc_netcdf as adcirc_netcdf
from tidemesh.io._adcirc_netcdf import DRY
from tidemesh.io._fortran import read_bytes, real, whole, writing

_VARIABLES = {
    ("node", 1): (("amp", "phs"),),
    ("node", 2): (("u_amp", "u_phs"), ("v_amp", "v_phs")),
    ("station", 1): (("amp", "phs"),),
    ("station", 2): (("u-vel-amp", "u-vel-phs"), ("v-vel-amp", "v-vel-phs")),
}
"""Amplitude and phase of every component by place and number of components."""

# What ADCIRC prints where a run blew up or a number does not fit.
_NO_NUMBER = re.compile(r"\b(?:nan|inf(?:inity)?)\b|\*{3}", re.IGNORECASE)


class HarmonicConstants(NamedTuple):
    """Complex amplitudes at all nodes."""

    names: tuple[str, ...]
    """(n_c,) constituent names."""
    frequency: np.ndarray
    """(n_c,) rad/s."""
    values: np.ndarray
    """(n_c, n_points) complex m, or (n_c, n_points, 2) complex m/s; NaN where dry."""
    nodal_factor: np.ndarray
    """(n_c,)."""
    equilibrium_argument: np.ndarray
    """(n_c,) rad."""
    stations: tuple[str, ...] = ()
    """Names of the stations where the file has them (NetCDF), or empty."""


def read_fort53(path: str | Path) -> HarmonicConstants:
    """Read elevation constants at nodes: fort.53 (may be gzipped), fort.53.nc.

    Raises
    ------
    FormatError
        If the file does not follow the format or is cut off; text with the line.
    InputError
        If there is no such file.
    """
    return _read(Path(path), "node", 1)


def read_fort54(path: str | Path) -> HarmonicConstants:
    """Read velocity constants at nodes: fort.54, fort.54.nc; as `read_fort53`."""
    return _read(Path(path), "node", 2)


def read_fort51(path: str | Path) -> HarmonicConstants:
    """Read elevation constants at stations: fort.51, fort.51.nc; as `read_fort53`."""
    return _read(Path(path), "station", 1)


def read_fort52(path: str | Path) -> HarmonicConstants:
    """Read velocity constants at stations: fort.52, fort.52.nc; as `read_fort53`."""
    return _read(Path(path), "station", 2)


def require_nodes(
    constants: HarmonicConstants, n_points: int, path: str | Path
) -> None:
    """Check that harmonic constants are those of a mesh.

    Raises
    ------
    FormatError
        If their number of nodes is another one.
    """
    count = constants.values.shape[1]
    if count != n_points:
        raise FormatError(
            f"has {count} nodes, the mesh has {n_points}: it does not belong to the "
            "mesh",
            Path(path),
        )


def write_fort53(path: str | Path, tide: TideSolution) -> None:
    """Write the elevation of a solution as ADCIRC does (gzipped if named .gz)."""
    _write(Path(path), tide, tide.elevation[:, :, None])


def write_fort54(path: str | Path, tide: TideSolution) -> None:
    """Write the velocity of a solution as ADCIRC does (gzipped if named .gz).

    The components are written as they are, along x and y. On a mesh in degrees ADCIRC's
    point east and north: turn them first with `Projection.east_north`.
    """
    _write(Path(path), tide, tide.velocity)


def _read(path: Path, place: str, components: int) -> HarmonicConstants:
    if adcirc_netcdf.is_netcdf(path):
        return _read_netcdf(path, place, components)
    text = read_bytes(path).decode("latin-1")
    lines = text.split("\n")
    if lines[-1] == "":
        lines.pop()
    elif len(lines) > 1:
        raise FormatError(
            f'the last line has no end, so the file was cut off: "{lines[-1][:60]}"; '
            "if it is whole, add a line end",
            path,
            len(lines),
        )
    n_c = _count(lines, 0, "the number of constituents", path)
    names, header = [], np.empty((n_c, 3))
    for k in range(n_c):
        words = _words(lines, 1 + k, path)
        try:
            header[k] = [real(word) for word in words[:3]]
        except ValueError:
            words = []
        words = words if header[k, 0] >= 0.0 else []
        if len(words) < 3:
            raise FormatError(
                "expected frequency, nodal factor, argument and name of a constituent, "
                f'got "{lines[1 + k].strip()}"',
                path,
                2 + k,
            )
        names.append(words[3] if len(words) > 3 else f"C{k + 1}")
    n_points = _count(lines, 1 + n_c, "the number of nodes", path)

    first = 2 + n_c
    body = lines[first : first + n_points * (1 + n_c)]
    if len(body) < n_points * (1 + n_c):
        raise FormatError(
            f"the file ends early: {n_points} nodes need {n_points * (1 + n_c)} "
            f"lines after the header, there are {len(body)}",
            path,
            len(lines),
        )
    left = next((line for line in lines[first + len(body) :] if line.strip()), None)
    if left is not None:
        raise FormatError(
            f'expected the end of the file after {n_points} places, got "{left[:60]}"',
            path,
            first + len(body) + lines[first + len(body) :].index(left) + 1,
        )
    columns = 2 * components
    table = _numbers(body, 1 + n_c * columns, n_points, path, first)
    nodes = table[:, 0]
    if not (nodes == np.arange(1, n_points + 1)).all():
        wrong = int(np.flatnonzero(nodes != np.arange(1, n_points + 1))[0])
        raise FormatError(
            f"expected node {wrong + 1}, got {nodes[wrong]:g}",
            path,
            first + wrong * (1 + n_c) + 1,
        )
    pairs = table[:, 1:].reshape(n_points, n_c, components, 2).transpose(1, 0, 2, 3)
    amplitude, phase = pairs[..., 0], np.radians(pairs[..., 1])
    values = np.where(amplitude == DRY, np.nan, amplitude * np.exp(-1j * phase))
    return HarmonicConstants(
        names=tuple(names),
        frequency=header[:, 0].copy(),
        values=values[..., 0] if components == 1 else np.ascontiguousarray(values),
        nodal_factor=header[:, 1].copy(),
        equilibrium_argument=np.radians(header[:, 2]),
    )


def _numbers(
    body: list[str], width: int, n_points: int, path: Path, first: int
) -> np.ndarray:
    """All numbers of the body, one row a node."""
    try:
        joined = " ".join(body)
        numbers = np.array(joined.split(), dtype=np.float64)
        # Python reads 1_0 as ten, and what is not finite needs a message.
        plain = "_" not in joined and np.isfinite(numbers).all()
        if plain and len(numbers) == n_points * width:
            return numbers.reshape(n_points, width)
    except ValueError:
        pass
    # Slower, line by line: odd exponents, text after the numbers, or an error to name.
    lines_a_node = len(body) // max(n_points, 1)
    columns = (width - 1) // (lines_a_node - 1)
    rows = []
    for k, line in enumerate(body):
        want = 1 if k % lines_a_node == 0 else columns
        try:
            row = [real(word) for word in line.split()[:want]]
        except ValueError:
            row = []
        if len(row) < want:
            hint = ": the run blew up" if _NO_NUMBER.search(line) else ""
            raise FormatError(
                f'expected {want} number(s), got "{line.strip()}"{hint}',
                path,
                first + k + 1,
            )
        rows.extend(row)
    return np.array(rows).reshape(n_points, width)


def _words(lines: list[str], index: int, path: Path) -> list[str]:
    if index >= len(lines):
        raise FormatError("the file ends in its header", path, len(lines))
    return lines[index].split()


def _count(lines: list[str], index: int, what: str, path: Path) -> int:
    words = _words(lines, index, path)
    try:
        count = whole(words[0]) if words else 0
    except ValueError:
        count = 0
    if count < 1:
        raise FormatError(
            f'expected {what}, got "{lines[index].strip()}"', path, index + 1
        )
    if count > len(lines):
        raise FormatError(
            f"the file ends early: {count} is {what}, the file has {len(lines)} lines",
            path,
            len(lines),
        )
    return count


def _read_netcdf(path: Path, place: str, components: int) -> HarmonicConstants:
    with adcirc_netcdf.opened(path) as data:
        if place not in data.dimensions:
            raise FormatError(f'there is no dimension "{place}"', path)
        shape = (place, "num_const")
        parts = []
        for pair in _VARIABLES[place, components]:
            stored = [adcirc_netcdf.numbers(data, name, shape, path) for name in pair]
            amplitude, phase = (
                adcirc_netcdf.without_dry(variable[:], f'"{variable.name}"', path)
                for variable in stored
            )
            parts.append((amplitude * np.exp(-1j * np.radians(phase))).T)
        header = [
            adcirc_netcdf.without_dry(
                adcirc_netcdf.numbers(data, name, ("num_const",), path)[:], name, path
            )
            for name in ("frequency", "nodal_factor", "equilibrium_argument")
        ]
        names = adcirc_netcdf.names(data, "const")
        stations = adcirc_netcdf.names(data, "station_name")
    n_c = len(header[0])
    if not (header[0] >= 0.0).all():
        raise FormatError("a frequency is negative or missing", path)
    return HarmonicConstants(
        names=tuple(
            name.split()[0] if name else f"C{k + 1}"
            for k, name in enumerate(names or ("",) * n_c)
        ),
        frequency=header[0],
        values=np.ascontiguousarray(
            parts[0] if components == 1 else np.stack(parts, axis=-1)
        ),
        nodal_factor=header[1],
        equilibrium_argument=np.radians(header[2]),
        stations=stations,
    )


def _write(path: Path, tide: TideSolution, values: np.ndarray) -> None:
    n_c, n_points, components = values.shape
    amplitude = np.abs(values)
    lag = np.degrees(-np.angle(values)) % 360.0
    # Rounding to the four printed decimals must not give 360.
    lag[np.round(lag, 4) >= 360.0] = 0.0
    pairs = np.stack([amplitude, lag], axis=-1).transpose(1, 0, 2, 3)
    row = "  %16.8E %11.4f" * components + "\n"
    block = "%12d\n" + row * n_c
    table = np.column_stack(
        [np.arange(1, n_points + 1), pairs.reshape(n_points, -1)]
    ).tolist()
    with writing(path) as file:
        file.write(f"{n_c:12d}\n".encode())
        for name, frequency in zip(tide.names, tide.frequency):
            head = f"{frequency:21.10E} {1.0:10.7f} {0.0:12.8f}  {name:<10s}\n"
            file.write(head.encode())
        file.write(f"{n_points:12d}\n".encode())
        for numbers in table:
            file.write((block % tuple(numbers)).encode("ascii"))
