"""ADCIRC's harmonic constants: fort.53 (elevation) and fort.54 (velocity), ASCII.

Amplitudes in metres or m/s, phases are lags in degrees: value = Re(F exp(i w t)) with
F = amplitude * exp(-i phase). Node numbers in the files count from 1.
"""

from __future__ import annotations

import gzip
import io
import re
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import NamedTuple, TextIO

import numpy as np

from tidemesh.datatypes import TideSolution
from tidemesh.errors import FormatError, InputError
from tidemesh.io.files import atomic

DRY = -99999.0
"""What ADCIRC writes where a node has no value."""

# Fortran leaves the E out when an exponent has three digits, and may write D for it.
_SHORT_EXPONENT = re.compile(r"(?<=[\d.])[dD]?([+-]\d{3})\b")


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


def read_fort53(path: str | Path) -> HarmonicConstants:
    """Read elevation constants; the file may be gzipped.

    Raises
    ------
    FormatError
        If the file does not follow the format; with the line.
    """
    return _read(Path(path), components=1)


def read_fort54(path: str | Path) -> HarmonicConstants:
    """Read velocity constants; the file may be gzipped.

    Raises
    ------
    FormatError
        If the file does not follow the format; with the line.
    """
    return _read(Path(path), components=2)


def write_fort53(path: str | Path, tide: TideSolution) -> None:
    """Write the elevation of a solution as ADCIRC does (gzipped if named .gz)."""
    _write(Path(path), tide, tide.elevation[:, :, None])


def write_fort54(path: str | Path, tide: TideSolution) -> None:
    """Write the velocity of a solution as ADCIRC does (gzipped if named .gz).

    The components are written as they are, along x and y. On a mesh in degrees ADCIRC's
    point east and north: turn them first with `Projection.east_north`.
    """
    _write(Path(path), tide, tide.velocity)


def _read(path: Path, components: int) -> HarmonicConstants:
    try:
        with _reading(path) as file:
            lines = file.read().splitlines()
    except FileNotFoundError as error:
        raise InputError(f"{path}: there is no such file") from error
    except (OSError, EOFError) as error:
        raise FormatError(f"cannot be read: {error}", path) from error
    n_c = _count(lines, 0, "the number of constituents", path)
    names, header = [], np.empty((n_c, 3))
    for k in range(n_c):
        words = _words(lines, 1 + k, path)
        try:
            header[k] = [_number(word) for word in words[:3]]
        except ValueError:
            words = []
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
        numbers = np.array(" ".join(body).split(), dtype=np.float64)
        if len(numbers) == n_points * width:
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
            row = [_number(word) for word in line.split()[:want]]
        except ValueError:
            row = []
        if len(row) < want:
            raise FormatError(
                f'expected {want} number(s), got "{line.strip()}"', path, first + k + 1
            )
        rows.extend(row)
    return np.array(rows).reshape(n_points, width)


def _number(word: str) -> float:
    return float(_SHORT_EXPONENT.sub(r"E\1", word).replace("D", "E").replace("d", "e"))


def _words(lines: list[str], index: int, path: Path) -> list[str]:
    if index >= len(lines):
        raise FormatError("the file ends in its header", path, len(lines))
    return lines[index].split()


def _count(lines: list[str], index: int, what: str, path: Path) -> int:
    words = _words(lines, index, path)
    if not words or not words[0].isdigit() or int(words[0]) == 0:
        raise FormatError(
            f'expected {what}, got "{lines[index].strip()}"', path, index + 1
        )
    return int(words[0])


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
    with _writing(path) as file:
        file.write(f"{n_c:12d}\n")
        for name, frequency in zip(tide.names, tide.frequency):
            file.write(f"{frequency:21.10E} {1.0:10.7f} {0.0:12.8f}  {name:<10s}\n")
        file.write(f"{n_points:12d}\n")
        for numbers in table:
            file.write(block % tuple(numbers))


@contextmanager
def _reading(path: Path) -> Iterator[TextIO]:
    if path.suffix == ".gz":
        with gzip.open(path, "rt", encoding="utf-8", errors="replace") as file:
            yield file
    else:
        with open(path, encoding="utf-8", errors="replace") as file:
            yield file


@contextmanager
def _writing(path: Path) -> Iterator[TextIO]:
    with atomic(path) as temporary:
        if path.suffix != ".gz":
            with open(temporary, "w", encoding="utf-8", newline="\n") as file:
                yield file
            return
        # No name and no time in the header: the same solution gives the same bytes.
        with (
            open(temporary, "wb") as raw,
            gzip.GzipFile("", "wb", fileobj=raw, mtime=0) as packed,
            io.TextIOWrapper(packed, encoding="utf-8", newline="\n") as file,
        ):
            yield file
