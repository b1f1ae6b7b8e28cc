"""ADCIRC's time series: fort.63, fort.64 (nodes), fort.61, fort.62 (stations).

Text, compact text (NOUT 4) and NetCDF (3, 5), told apart by content. Elevations in
metres, velocities in m/s along x and y of the file's coordinates (east and north in
runs in degrees). Text is read a record at a time and NetCDF in blocks of 16 MB, so the
memory needed is that of the values asked for (twice while they are put together): 8
bytes a node, component and record.
"""

from __future__ import annotations

import gzip
import warnings
import zlib
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import BinaryIO, NamedTuple

import numpy as np
from netCDF4 import Dataset

from tidemesh.datatypes._arrays import FloatArray, own_fields
from tidemesh.errors import FormatError, InputError
from tidemesh.io import _adcirc_netcdf as adcirc_netcdf
from tidemesh.io._adcirc_netcdf import DRY
from tidemesh.io._fortran import MOST_NODES, real, whole

_VARIABLES = {1: ("zeta",), 2: ("u-vel", "v-vel")}
"""Names in NetCDF files by the number of components."""

_NETCDF_BLOCK = 2_000_000
"""Values of a NetCDF variable that are read at once."""


@dataclass(frozen=True, eq=False)
class NodalSeries:
    """Elevation or velocity at nodes or stations over time."""

    time: FloatArray
    """(n_t,) s since the cold start (a start day STATIM counts in)."""
    values: FloatArray
    """(n_t, n) m, or (n_t, n, 2) m/s; NaN where dry."""
    base_date: str | None = None
    """Date and time (UTC) of time 0 where the file has it, "yyyy-MM-dd hh:mm:ss"."""
    names: tuple[str, ...] = ()
    """(n,) stations' names, or empty."""

    def __post_init__(self) -> None:
        own_fields(self, time=(np.float64, (None,)))
        n_t = len(self.time)
        shape = (n_t, None, 2) if np.ndim(self.values) == 3 else (n_t, None)
        own_fields(self, values=(np.float64, shape))


class Record(NamedTuple):
    """One time of a series."""

    time: float
    """s."""
    values: FloatArray
    """(n,) m or (n, 2) m/s; NaN where dry."""


def read_fort63(
    path: str | Path,
    *,
    nodes: Sequence[int] | np.ndarray | None = None,
    start_s: float = -np.inf,
    end_s: float = np.inf,
    keep_complete: bool = False,
) -> NodalSeries:
    """Read elevations at nodes (fort.63, fort.63.nc).

    Parameters
    ----------
    path : path
        The text formats may be gzipped.
    nodes : (n,) int array, optional
        Indices (from 0) of the nodes wanted. Default: all.
    start_s, end_s : float
        Times wanted, both ends included, s.
    keep_complete : bool
        Give back the complete records of a file that is cut off (by a crash, or while
        the model runs), in place of an error.

    Returns
    -------
    series : NodalSeries

    Raises
    ------
    FormatError
        If the file does not follow the format or is cut off; with record and line.
    InputError
        If there is no such file, or it has no node of that number.
    """
    return _read(Path(path), 1, nodes, start_s, end_s, keep_complete)


def read_fort64(
    path: str | Path,
    *,
    nodes: Sequence[int] | np.ndarray | None = None,
    start_s: float = -np.inf,
    end_s: float = np.inf,
    keep_complete: bool = False,
) -> NodalSeries:
    """Read velocities at nodes (fort.64, fort.64.nc); as `read_fort63`."""
    return _read(Path(path), 2, nodes, start_s, end_s, keep_complete)


def read_fort61(path: str | Path, *, keep_complete: bool = False) -> NodalSeries:
    """Read elevations at stations (fort.61, fort.61.nc); as `read_fort63`."""
    return _read(Path(path), 1, None, -np.inf, np.inf, keep_complete)


def read_fort62(path: str | Path, *, keep_complete: bool = False) -> NodalSeries:
    """Read velocities at stations (fort.62, fort.62.nc); as `read_fort63`."""
    return _read(Path(path), 2, None, -np.inf, np.inf, keep_complete)


def iterate_fort63(
    path: str | Path, *, keep_complete: bool = False
) -> Iterator[Record]:
    """Elevations record by record, for files larger than the memory."""
    return _iterate(Path(path), 1, keep_complete)


def iterate_fort64(
    path: str | Path, *, keep_complete: bool = False
) -> Iterator[Record]:
    """Velocities record by record, for files larger than the memory."""
    return _iterate(Path(path), 2, keep_complete)


def _read(
    path: Path,
    components: int,
    nodes: Sequence[int] | np.ndarray | None,
    start_s: float,
    end_s: float,
    keep_complete: bool,
) -> NodalSeries:
    wanted = None if nodes is None else np.asarray(nodes, dtype=np.int64)
    times, values = [], []
    window = start_s, end_s
    with _opened(path, components, keep_complete, window) as (count, labels, records):
        if wanted is not None:
            if ((wanted < 0) | (wanted >= count)).any():
                raise InputError(
                    f"{path}: has {count} nodes, index {wanted.max()} is none"
                )
            count = len(wanted)
        for record in records:
            if record.time > end_s:
                break
            if record.time >= start_s:
                times.append(record.time)
                # A part is a copy: the rest of the record is let go.
                values.append(
                    record.values if wanted is None else record.values[wanted]
                )
    shape = (len(times), count) if components == 1 else (len(times), count, 2)
    return NodalSeries(np.array(times), np.array(values).reshape(shape), *labels)


def _iterate(path: Path, components: int, keep_complete: bool) -> Iterator[Record]:
    with _opened(path, components, keep_complete, (-np.inf, np.inf)) as (_, _, records):
        yield from records


@contextmanager
def _opened(
    path: Path, components: int, keep_complete: bool, window: tuple[float, float]
) -> Iterator[tuple[int, tuple, Iterator[Record]]]:
    """Number of nodes, base date and names, and the records.

    Text gives all records, NetCDF those in the window of times.
    """
    if adcirc_netcdf.is_netcdf(path):
        with adcirc_netcdf.opened(path) as data:
            file = _NetCDF(path, data, components, keep_complete)
            yield file.count, file.labels, file.records(*window)
        return
    with open(path, "rb") as start:
        packed = start.read(2) == b"\x1f\x8b"
    has_head = False
    try:
        with gzip.open(path) if packed else open(path, "rb") as lines:
            text = _Text(path, lines, components, keep_complete)
            has_head = True
            yield text.count, (None, ()), text.records()
    except (EOFError, zlib.error, gzip.BadGzipFile) as error:
        if not (keep_complete and has_head and isinstance(error, EOFError)):
            raise FormatError(
                f"the compressed file is damaged or cut off: {error}", path
            ) from error


class _Text:
    """A text file: a title, a header, then records of one line a node."""

    def __init__(
        self, path: Path, file: BinaryIO, components: int, keep_complete: bool
    ):
        self.path = path
        self._file = file
        self._components = components
        self._keep = keep_complete
        self._line = 0
        """Number of the line read last."""
        self._record = 0
        """Number of the record being read; 0 in the header."""

        self._read_head()

    def _read_head(self) -> None:
        title = self._next("the title")
        if title[:3] == b"CDF" or title[:4] == b"\x89HDF":
            raise FormatError("is compressed NetCDF: decompress it first", self.path)
        text = self._next("the numbers of records and nodes")
        self._announced, self.count, _, _, kind = self._numbers(
            text, "the numbers of records and nodes, step, interval and kind", "iirii"
        )
        if not 1 <= self.count <= MOST_NODES or self._announced < 0:
            raise self._error(
                f"expected numbers of records and of nodes (1 to {MOST_NODES}), got "
                f'"{_shown(text)}"'
            )
        if kind != self._components:
            words = {1: "elevation", 2: "velocity"}
            raise self._error(
                f"expected {words[self._components]} ({self._components} value(s) a "
                f"node), the file has {kind} a node"
            )

    def records(self) -> Iterator[Record]:
        """The records, as many as there are.

        Raises
        ------
        FormatError
            If there are fewer than the header says, or one of them is damaged.
        """
        last = -np.inf
        while True:
            self._record += 1
            head = self._file.readline()
            if not head.strip():
                break
            self._line += 1
            line = self._line
            try:
                record = self._read_record(head)
            except _CutOff as error:
                if self._keep:
                    return
                raise self._error(
                    f"{error}: the file was cut off (a crash, or the model still "
                    "runs); the complete records can be read with keep_complete"
                ) from None
            if record.time <= last:
                raise self._error(
                    f"the time {record.time:g} s does not come after {last:g} s", line
                )
            last = record.time
            yield record
        if self._file.readline().strip():
            raise self._error("expected the time of a record, got an empty line")
        if self._record - 1 < self._announced and not self._keep:
            raise self._error(
                f"the file ends after {self._record - 1} of {self._announced} records; "
                "the complete ones can be read with keep_complete"
            )

    def _read_record(self, head: bytes) -> Record:
        if not head.endswith(b"\n"):
            raise _CutOff(f'the line "{_shown(head)}" has no end')
        words = head.split()
        if len(words) not in (2, 4):
            raise self._error(
                "expected time and step, or those, the number of nodes listed and the "
                f'value of the others (compact form), got "{_shown(head)}"'
            )
        row = self._numbers(head, "time and step of a record", "riir"[: len(words)])
        if len(row) == 2:
            listed, default = self.count, DRY
        else:
            listed, default = row[2:]
            if not 0 <= listed <= self.count:
                raise self._error(f"expected 0 to {self.count} nodes, got {listed}")
        numbers, table = self._table(listed)
        if len(row) == 2:
            if not np.array_equal(numbers, np.arange(1, self.count + 1)):
                k = int(np.flatnonzero(numbers != np.arange(1, self.count + 1))[0])
                raise self._error(
                    f"expected node {k + 1}, got {numbers[k]:g}",
                    self._line - listed + k + 1,
                )
            values = table
        else:
            good = (numbers >= 1) & (numbers <= self.count)
            good &= np.diff(numbers, prepend=0.0) > 0.0
            good &= numbers == np.rint(numbers)
            if not good.all():
                k = int(np.flatnonzero(~good)[0])
                raise self._error(
                    f"expected node numbers from 1 to {self.count} in ascending "
                    f"order, got {numbers[k]:g}",
                    self._line - listed + k + 1,
                )
            values = np.full((self.count, self._components), default)
            values[numbers.astype(np.int64) - 1] = table
        values = np.where(values == DRY, np.nan, values)
        return Record(row[0], values[:, 0] if self._components == 1 else values)

    def _table(self, listed: int) -> tuple[np.ndarray, np.ndarray]:
        """(listed,) node numbers and (listed, components) values of the next lines."""
        width = 1 + self._components
        lines = list(islice(self._file, listed))
        self._line += len(lines)
        if len(lines) < listed:
            raise _CutOff(f"{len(lines)} of {listed} nodes are there")
        if lines and not lines[-1].endswith(b"\n"):
            raise _CutOff(f'the line "{_shown(lines[-1])}" has no end')
        table = _plain(b"".join(lines), listed * width)
        if table is None:
            first = self._line - listed
            rows = []
            for k, line in enumerate(lines):
                self._line = first + k + 1
                what = "node number and value" + "s" * (self._components - 1)
                rows.append(self._numbers(line, what, "i" + "r" * self._components))
            table = np.array(rows, dtype=np.float64)
        table = table.reshape(listed, width)
        return table[:, 0], table[:, 1:]

    def _next(self, what: str) -> bytes:
        line = self._file.readline()
        if not line.endswith(b"\n"):
            raise self._error(f"the file ends here; expected {what} and what follows")
        self._line += 1
        return line

    def _numbers(self, line: bytes, what: str, kinds: str) -> list:
        words = line.decode("latin-1").split()[: len(kinds)]
        try:
            values = [
                real(w) if kind == "r" else whole(w) for kind, w in zip(kinds, words)
            ]
        except ValueError:
            values = []
        if len(values) < len(kinds):
            blown = any(
                w.lower().strip("+-") in ("nan", "infinity", "inf") for w in words
            )
            hint = ": the run blew up" if blown else ""
            raise self._error(f'expected {what}, got "{_shown(line)}"{hint}')
        return values

    def _error(self, message: str, line: int | None = None) -> FormatError:
        record = f"record {self._record}: " if self._record else ""
        return FormatError(
            record + message, self.path, self._line if line is None else line
        )


class _CutOff(Exception):
    """A record is not complete."""


def _shown(line: bytes) -> str:
    return line[:80].decode("latin-1").strip()


def _plain(content: bytes, count: int) -> np.ndarray | None:
    """Plain numbers, all at once; None if they are not, or not so many."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        try:
            values = np.fromstring(content, sep=" ")
        except (ValueError, DeprecationWarning):
            return None
    return values if len(values) == count and np.isfinite(values).all() else None


class _NetCDF:
    """A NetCDF file: variables over time and nodes or stations."""

    def __init__(self, path: Path, data: Dataset, components: int, keep_complete: bool):
        self._path = path
        place = "station" if "station" in data.dimensions else "node"
        time = adcirc_netcdf.numbers(data, "time", ("time",), path)
        self._time = np.array(time[:], dtype=np.float64)
        self._variables = [
            adcirc_netcdf.numbers(data, name, ("time", place), path)
            for name in _VARIABLES[components]
        ]
        self.count = int(self._variables[0].shape[1])
        date = str(getattr(time, "base_date", "")).split("!")[0].strip()
        units = str(getattr(time, "units", ""))
        if not date and " since " in units:
            date = units.split(" since ", 1)[1].strip()
        self.labels = date or None, adcirc_netcdf.names(data, "station_name")
        complete = _complete(self._time)
        if complete < len(self._time) and not keep_complete:
            raise FormatError(
                f"record {complete + 1}: the time {self._time[complete]:g} s does not "
                "come after the one before: the file was cut off (a crash, or the "
                "model still runs); the complete records can be read with "
                "keep_complete",
                path,
            )
        self._time = self._time[:complete]

    def records(self, start_s: float, end_s: float) -> Iterator[Record]:
        """The records between two times."""
        first = int(np.searchsorted(self._time, start_s, side="left"))
        last = int(np.searchsorted(self._time, end_s, side="right"))
        block = max(1, _NETCDF_BLOCK // max(self.count, 1))
        for begin in range(first, last, block):
            end = min(begin + block, last)
            parts = [
                adcirc_netcdf.without_dry(
                    variable[begin:end],
                    f'"{variable.name}" (from record {begin + 1})',
                    self._path,
                )
                for variable in self._variables
            ]
            values = parts[0] if len(parts) == 1 else np.stack(parts, axis=-1)
            for time, table in zip(self._time[begin:end], values):
                yield Record(float(time), table)


def _complete(time: np.ndarray) -> int:
    """How many times are there and ascend."""
    good = np.isfinite(time) & (np.abs(time) < 1.0e30)
    good[1:] &= good[:-1] & (np.diff(np.where(good, time, 0.0)) > 0.0)
    return len(time) if good.all() else int(np.flatnonzero(~good)[0])
