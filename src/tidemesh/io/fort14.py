"""ADCIRC's mesh file, fort.14 (also .grd, .14; compressed if it ends in .gz)."""

from __future__ import annotations

import logging
import warnings
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import BinaryIO, Literal

import numpy as np

from tidemesh.datatypes import BoundaryString, CoastalMesh
from tidemesh.errors import FormatError, InputError
from tidemesh.geometry.projection import Projection
from tidemesh.io._fortran import unpacked, writing

logger = logging.getLogger(__name__)

Coordinates = Literal["auto", "degrees", "metres"]

EXTRA_COLUMNS = {3: 2, 13: 2, 23: 2, 4: 4, 24: 4, 5: 7, 25: 7, 64: 4, 94: 1}
"""Further columns of a boundary row by IBTYPE: heights and coefficients of weirs; of
the paired types the first one is the node across."""

PAIRED = (4, 5, 24, 25, 64, 94)
ISLANDS = (1, 11, 21)
INNER = (*ISLANDS, 4, 5, 24, 25, 64)

ROWS_AT_ONCE = 100_000


def write_fort14(path: str | Path, mesh: CoastalMesh, *, title: str = "") -> None:
    """Write a mesh as ADCIRC reads it.

    Longitude and latitude in degrees if the mesh has a projection, else metres; ten
    decimals (0.01 mm in degrees). Open strings, then mainland, then islands. A closed
    mainland string (a lake) repeats its first node at the end, so that its last
    segment is in the list; islands and closed open strings do not: ADCIRC closes
    islands itself, and an ocean node is forced once.

    Parameters
    ----------
    path : path
        Compressed if it ends in ".gz".
    mesh : CoastalMesh
    title : str
        First line.

    Raises
    ------
    InputError
        If the file cannot be written.
    """
    with writing(path) as file:
        file.write((" ".join(title.split()) + "\n").encode("utf-8"))
        file.write(b"%d %d\n" % (len(mesh.triangles), len(mesh.points)))
        place = mesh.projection.inverse(mesh.points)
        numbers = np.arange(1.0, len(place) + 1.0)
        nodes = np.column_stack([numbers, place, mesh.depth])
        _write_rows(file, "%d %.10f %.10f %.10f\n", nodes)
        numbers = np.arange(1, len(mesh.triangles) + 1)
        _write_rows(
            file, "%d 3 %d %d %d\n", np.column_stack([numbers, mesh.triangles + 1])
        )
        _write_open(file, [s for s in mesh.boundaries if s.kind == "open"])
        land = [s for s in mesh.boundaries if s.kind == "mainland"]
        land += [s for s in mesh.boundaries if s.kind == "island"]
        _write_land(file, land)


def read_fort14(
    path: str | Path,
    *,
    coordinates: Coordinates = "auto",
    projection: Projection | None = None,
) -> CoastalMesh:
    """Read a mesh in ADCIRC's format.

    Text after the numbers of a line is skipped, and so are blank lines. Nodes are
    sorted by their numbers, which may have gaps; elements stay as in the file, and
    clockwise ones are turned. Strings that close are recognised with or without a
    repeated first node. The rows of weirs keep their further columns in ``extra``, the
    node across as a 0-based index.

    Parameters
    ----------
    path : path
        Compressed if it ends in ".gz".
    coordinates : {"auto", "degrees", "metres"}
        What x and y are. "auto" takes them for degrees if all lie within -360..360 and
        -90..90.
    projection : Projection, optional
        For degrees. Default: ADCIRC's equirectangular map about the middle of the mesh.

    Returns
    -------
    mesh : CoastalMesh

    Raises
    ------
    FormatError
        If the file does not follow the format; says the line.
    InputError
        If the file cannot be read.
    """
    if coordinates not in ("auto", "degrees", "metres"):
        raise ValueError(
            f'coordinates must be "auto", "degrees" or "metres", got "{coordinates}"'
        )
    lines = _Lines(Path(path))
    lines.skip_title()
    n_elements, n_nodes = lines.integers("the numbers of elements and nodes", 2)
    if n_nodes < 3 or n_elements < 1:
        raise lines.error(
            "expected at least 1 element and 3 nodes (elements come first), got "
            f"{n_elements} and {n_nodes}"
        )
    table, at = lines.table(n_nodes, 4, "a node: number, x, y and depth")
    lines.refuse(~np.isfinite(table).all(axis=1), at, "a value is not finite")
    numbers = lines.whole(table[:, :1], at, "a node number")[:, 0]
    index = _Index(lines, numbers, at)
    table = table[index.order]

    rows, at = lines.table(n_elements, 5, "an element: number, 3 and three nodes")
    rows = lines.whole(rows, at, "an element's numbers")
    lines.refuse(rows[:, 1] != 3, at, "expected an element of 3 nodes")
    triangles = index.of(rows[:, 2:], at)
    degenerate = (np.diff(np.sort(triangles, axis=1), axis=1) == 0).any(axis=1)
    lines.refuse(degenerate, at, "an element names one node twice")

    strings: list[BoundaryString] = []
    if lines.at_end:
        logger.warning("%s: no boundary lists after the elements", path)
    else:
        strings = _read_open(lines, index) + _read_land(lines, index)

    points, projection = _to_plane(
        lines, table[:, 1:3], triangles, coordinates, projection
    )
    triangles = _counter_clockwise(points, triangles)
    strings = _recognise_closed(strings, triangles, n_nodes)
    return CoastalMesh(points, triangles, table[:, 3], tuple(strings), projection)


def _write_rows(file: BinaryIO, row: str, table: np.ndarray) -> None:
    for begin in range(0, len(table), ROWS_AT_ONCE):
        part = table[begin : begin + ROWS_AT_ONCE]
        file.write((row * len(part) % tuple(part.ravel().tolist())).encode("ascii"))


def _write_open(file: BinaryIO, strings: Sequence[BoundaryString]) -> None:
    total = sum(len(string.nodes) for string in strings)
    file.write(b"%d ! open strings\n%d ! their nodes\n" % (len(strings), total))
    for number, string in enumerate(strings, start=1):
        file.write(b"%d ! nodes of open string %d\n" % (len(string.nodes), number))
        _write_rows(file, "%d\n", string.nodes + 1)


def _write_land(file: BinaryIO, strings: Sequence[BoundaryString]) -> None:
    listed = [
        np.append(string.nodes, string.nodes[0])
        if string.kind == "mainland" and string.closed
        else string.nodes
        for string in strings
    ]
    # ADCIRC counts both sides of a weir.
    total = sum(
        len(nodes) * (2 if string.ibtype in PAIRED else 1)
        for nodes, string in zip(listed, strings)
    )
    file.write(b"%d ! land strings\n%d ! their nodes\n" % (len(strings), total))
    for number, (nodes, string) in enumerate(zip(listed, strings), start=1):
        head = f"{len(nodes)} {string.ibtype} ! nodes and type of land string {number}"
        file.write(f"{head}, {string.kind}\n".encode("ascii"))
        if string.extra is None:
            _write_rows(file, "%d\n", nodes + 1)
            continue
        extra = string.extra[np.arange(len(nodes)) % len(string.nodes)]
        columns = ["%.10g"] * extra.shape[1]
        if string.ibtype in PAIRED:
            extra[:, 0] += 1.0
            columns[0] = "%d"
        row = " ".join(["%d", *columns]) + "\n"
        _write_rows(file, row, np.column_stack([nodes + 1.0, extra]))


class _Lines:
    """The lines of a file with text on them, read one after another."""

    def __init__(self, path: Path):
        self.path = path
        self._data = _content(path)
        codes = np.frombuffer(self._data, dtype=np.uint8)
        ends = np.flatnonzero(codes == ord("\n"))
        if len(codes) and codes[-1] != ord("\n"):
            ends = np.append(ends, len(codes))
        starts = np.concatenate([[0], ends + 1])[: len(ends)]
        written = np.zeros(len(ends), dtype=bool)
        if len(ends):
            written = np.logical_or.reduceat(codes > ord(" "), starts)
            # A title may be blank.
            written[0] = True
        kept = np.flatnonzero(written)
        self._starts, self._ends, self._numbers = starts[kept], ends[kept], kept + 1
        self._codes = codes
        self._next = 0

    @property
    def at_end(self) -> bool:
        """Whether no line with text is left."""
        return self._next >= len(self._starts)

    def error(self, message: str, line: int | None = None) -> FormatError:
        """An error at a line (default: the last one read)."""
        if line is None and self._next > 0:
            line = int(self._numbers[self._next - 1])
        return FormatError(message, self.path, line)

    def refuse(self, wrong: np.ndarray, numbers: np.ndarray, message: str) -> None:
        """Raise an error at the first line of a table whose mask is true."""
        rows = np.flatnonzero(wrong)
        if len(rows):
            line = int(numbers[rows[0]])
            text = self._text(int(np.searchsorted(self._numbers, line)))
            raise self.error(f'{message}, got "{text}"', line)

    def skip_title(self) -> None:
        """Pass over the first line."""
        if self.at_end:
            raise FormatError("the file is empty", self.path)
        self._next += 1

    def integers(self, what: str, wanted: int, optional: int = 0) -> list[int]:
        """The whole numbers that a line begins with; absent optional ones are 0."""
        self._require(1, what)
        text = self._text(self._next)
        self._next += 1
        values: list[int] = []
        for token in text.replace(",", " ").split()[: wanted + optional]:
            try:
                values.append(int(token))
            except ValueError:
                break
        if len(values) < wanted:
            raise self.error(f'expected {what}, got "{text}"')
        return values + [0] * (wanted + optional - len(values))

    def table(
        self, rows: int, columns: int, what: str
    ) -> tuple[np.ndarray, np.ndarray]:
        """Numbers at the beginning of each of the next lines, and the line numbers."""
        self._require(rows, what)
        first = self._next
        table = np.empty((rows, columns))
        for begin in range(0, rows, ROWS_AT_ONCE):
            count = min(ROWS_AT_ONCE, rows - begin)
            part = self._plain(first + begin, count, columns)
            if part is None:
                part = self._careful(first + begin, count, columns, what)
            table[begin : begin + count] = part
        self._next = first + rows
        return table, self._numbers[first : first + rows]

    def whole(self, table: np.ndarray, numbers: np.ndarray, what: str) -> np.ndarray:
        """The table as integers."""
        self.refuse(
            (table != np.rint(table)).any(axis=1), numbers, f"{what} must be whole"
        )
        return table.astype(np.int64)

    def _require(self, rows: int, what: str) -> None:
        left = len(self._starts) - self._next
        if rows > left:
            last = int(self._numbers[-1]) if len(self._numbers) else None
            more = f"{rows - left} more lines, each with " if rows - left > 1 else ""
            raise FormatError(
                f"the file ends here; expected {more}{what}", self.path, last
            )

    def _text(self, line: int) -> str:
        return (
            self._data[self._starts[line] : self._ends[line]].decode("latin-1").strip()
        )

    def _plain(self, first: int, rows: int, columns: int) -> np.ndarray | None:
        """Lines of exactly so many plain numbers, all at once; None if they are not."""
        begin, end = int(self._starts[first]), int(self._ends[first + rows - 1])
        ink = self._codes[begin:end] > ord(" ")
        tokens = np.flatnonzero(ink[1:] & ~ink[:-1]) + 1
        if ink[0]:
            tokens = np.append(0, tokens)
        if len(tokens) != rows * columns:
            return None
        tokens = tokens.reshape(rows, columns) + begin
        if (tokens[:, 0] < self._starts[first : first + rows]).any() or (
            tokens[:, -1] >= self._ends[first : first + rows]
        ).any():
            return None
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            try:
                values = np.fromstring(self._data[begin:end], sep=" ")
            except (ValueError, DeprecationWarning):
                return None
        return values.reshape(rows, columns) if len(values) == rows * columns else None

    def _careful(self, first: int, rows: int, columns: int, what: str) -> np.ndarray:
        """Line by line: text after the numbers, commas, exponents with a D."""
        table = np.empty((rows, columns))
        for row in range(rows):
            text = self._text(first + row)
            tokens = text.replace(",", " ").split()[:columns]
            try:
                table[row] = [_fortran_number(token) for token in tokens]
            except ValueError:
                tokens = []
            if len(tokens) < columns:
                raise FormatError(
                    f'expected {what}, got "{text}"',
                    self.path,
                    int(self._numbers[first + row]),
                )
        return table


def _content(path: Path) -> bytes:
    try:
        content = path.read_bytes()
    except OSError as error:
        raise InputError(
            f"{path}: cannot be read ({error.strerror}); check the name"
        ) from error
    return unpacked(content, path)


def _fortran_number(token: str) -> float:
    if "_" in token:
        raise ValueError(token)
    return float(token.upper().replace("D", "E"))


class _Index:
    """From the node numbers of a file to indices in ascending order of the numbers."""

    def __init__(self, lines: _Lines, numbers: np.ndarray, at: np.ndarray):
        self._lines = lines
        self.order = np.argsort(numbers, kind="stable")
        self._sorted = numbers[self.order]
        repeated = np.zeros(len(numbers), dtype=bool)
        repeated[self.order[1:]] = self._sorted[1:] == self._sorted[:-1]
        lines.refuse(repeated, at, "this node number was given before")
        first = int(self._sorted[0])
        self._consecutive = int(self._sorted[-1]) - first + 1 == len(numbers)

    def of(self, numbers: np.ndarray, at: np.ndarray) -> np.ndarray:
        """Indices of node numbers (n, k); `at` are the lines of the rows."""
        if self._consecutive:
            index = numbers - self._sorted[0]
            unknown = (index < 0) | (index >= len(self._sorted))
        else:
            index = np.searchsorted(self._sorted, numbers)
            index = np.minimum(index, len(self._sorted) - 1)
            unknown = self._sorted[index] != numbers
        self._lines.refuse(unknown.any(axis=1), at, "there is no node of that number")
        return index


def _read_open(lines: _Lines, index: _Index) -> list[BoundaryString]:
    (number,) = lines.integers("the number of open strings", 1)
    (total,) = lines.integers("the number of open nodes", 1)
    strings = []
    for _ in range(number):
        count, kind = lines.integers("the number of nodes of an open string", 1, 1)
        nodes, _ = _read_nodes(lines, index, count, 0)
        strings.append(BoundaryString("open", nodes, ibtype=kind))
    _compare(lines, "open", total, sum(len(string.nodes) for string in strings))
    return strings


def _read_land(lines: _Lines, index: _Index) -> list[BoundaryString]:
    (number,) = lines.integers("the number of land strings", 1)
    (total,) = lines.integers("the number of land nodes", 1)
    strings = []
    have = 0
    for _ in range(number):
        count, ibtype = lines.integers(
            "the number of nodes and the type of a string", 2
        )
        columns = EXTRA_COLUMNS.get(ibtype, 0)
        nodes, extra = _read_nodes(lines, index, count, columns, ibtype in PAIRED)
        have += count * (2 if ibtype in PAIRED else 1)
        kind = "island" if ibtype in INNER else "mainland"
        strings.append(
            BoundaryString(kind, nodes, ibtype in ISLANDS, ibtype=ibtype, extra=extra)
        )
    _compare(lines, "land", total, have)
    return strings


def _read_nodes(
    lines: _Lines, index: _Index, count: int, columns: int, paired: bool = False
) -> tuple[np.ndarray, np.ndarray | None]:
    if count < 1:
        raise lines.error(f"expected a string of at least 1 node, got {count}")
    what = "a node number" + (f" and {columns} values" if columns else "")
    table, at = lines.table(count, 1 + columns, what)
    nodes = index.of(lines.whole(table[:, :1], at, "a node number"), at)[:, 0]
    if columns == 0:
        return nodes, None
    extra = table[:, 1:]
    if paired:
        across = lines.whole(extra[:, :1], at, "a node number")
        extra[:, :1] = index.of(across, at)
    return nodes, extra


def _compare(lines: _Lines, kind: str, total: int, have: int) -> None:
    if total != have:
        logger.warning(
            "%s: %d %s nodes announced, %d listed", lines.path, total, kind, have
        )


def _recognise_closed(
    strings: list[BoundaryString], triangles: np.ndarray, n_nodes: int
) -> list[BoundaryString]:
    """Mark strings that are whole rings; drop a first node repeated at the end."""
    if not strings:
        return []
    ahead = np.roll(triangles, -1, axis=1)
    keys = np.minimum(triangles, ahead) * n_nodes + np.maximum(triangles, ahead)
    edges, count = np.unique(keys, return_counts=True)
    edges = edges[count == 1]
    listed = np.concatenate(
        [
            np.minimum(string.nodes[:-1], string.nodes[1:]) * n_nodes
            + np.maximum(string.nodes[:-1], string.nodes[1:])
            for string in strings
        ]
    )
    result = []
    for string in strings:
        first, last = int(string.nodes[0]), int(string.nodes[-1])
        closed = string.closed
        if first == last and len(string.nodes) > 1:
            extra = None if string.extra is None else string.extra[:-1]
            string = replace(string, nodes=string.nodes[:-1], extra=extra)
            closed = True
        elif len(string.nodes) > 2 and string.ibtype not in PAIRED:
            key = min(first, last) * n_nodes + max(first, last)
            closed = closed or (key in edges and key not in listed)
        result.append(replace(string, closed=bool(closed)))
    return result


def _to_plane(
    lines: _Lines,
    place: np.ndarray,
    triangles: np.ndarray,
    coordinates: Coordinates,
    projection: Projection | None,
) -> tuple[np.ndarray, Projection]:
    low, high = place.min(axis=0), place.max(axis=0)
    fits = low[0] >= -360.0 and high[0] <= 360.0 and low[1] >= -90.0 and high[1] <= 90.0
    if coordinates == "degrees" and not fits:
        raise FormatError(
            f"x {low[0]:g}..{high[0]:g} and y {low[1]:g}..{high[1]:g} are not degrees",
            lines.path,
        )
    if coordinates == "metres" or not fits:
        return place, Projection() if projection is None else projection
    longitude = np.where(place[:, 0] > 180.0, place[:, 0] - 360.0, place[:, 0])
    corner = longitude[triangles]
    if (corner.max(axis=1) - corner.min(axis=1) > 180.0).any():
        # The mesh lies across the date line.
        longitude = np.where(longitude < 0.0, longitude + 360.0, longitude)
    if projection is None:
        middle = 0.5 * (longitude.min() + longitude.max())
        projection = Projection.equirectangular(
            round(float(middle), 2), round(float(0.5 * (low[1] + high[1])), 2)
        )
    return projection.forward(longitude, place[:, 1]), projection


def _counter_clockwise(points: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    x, y = np.ascontiguousarray(points.T)
    a, b, c = triangles.T
    turn = (x[b] - x[a]) * (y[c] - y[a]) - (x[c] - x[a]) * (y[b] - y[a])
    return np.where(turn[:, None] < 0.0, triangles[:, [0, 2, 1]], triangles)
