"""ADCIRC's nodal attributes, fort.13: friction, tau0 and others, a value a node."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from tidemesh.datatypes import CoastalMesh
from tidemesh.datatypes._arrays import FloatArray, own
from tidemesh.errors import InputError
from tidemesh.io._fortran import MOST_NODES, Records, read_bytes, writing

_MOST_VALUES = 1000
"""More values a node than any attribute has: the number is damaged."""


@dataclass(frozen=True, eq=False)
class NodalAttributes:
    """Named values at the nodes of a mesh."""

    title: str
    names: tuple[str, ...]
    """(n_attributes,), for instance "mannings_n_at_sea_floor"."""
    units: tuple[str, ...]
    """(n_attributes,), free text."""
    defaults: tuple[FloatArray, ...]
    """(n_attributes,) arrays (k,): what nodes have that the file does not list."""
    values: tuple[FloatArray, ...]
    """(n_attributes,) arrays (n_points, k)."""

    def __post_init__(self) -> None:
        count = len(self.names)
        if not count == len(self.units) == len(self.defaults) == len(self.values):
            raise ValueError("names, units, defaults and values must be as many")
        if len(set(self.names)) < count:
            raise ValueError("two attributes have one name")
        defaults = [own(row, np.float64, (None,), "defaults") for row in self.defaults]
        n_points = len(self.values[0]) if count else 0
        values = [
            own(table, np.float64, (n_points, len(row)), name)
            for table, row, name in zip(self.values, defaults, self.names)
        ]
        object.__setattr__(self, "defaults", tuple(defaults))
        object.__setattr__(self, "values", tuple(values))

    def of(self, name: str) -> FloatArray:
        """(n_points, k) values of an attribute.

        Raises
        ------
        InputError
            If there is none of that name.
        """
        if name not in self.names:
            have = ", ".join(self.names) or "none"
            raise InputError(f'there is no nodal attribute "{name}"; there are: {have}')
        return self.values[self.names.index(name)]


def read_fort13(path: str | Path, mesh: CoastalMesh | None = None) -> NodalAttributes:
    """Read nodal attributes.

    Parameters
    ----------
    path : path
        May be gzipped.
    mesh : CoastalMesh, optional
        The mesh to which the file must belong.

    Returns
    -------
    attributes : NodalAttributes
        In the order of the file's head.

    Raises
    ------
    FormatError
        If the file does not follow the format, is cut off or does not belong to the
        mesh; with the line.
    InputError
        If there is no such file.
    """
    path = Path(path)
    lines = Records(path, read_bytes(path))
    title = lines.text("the title")
    n_points = lines.count("the number of nodes")
    if n_points > MOST_NODES:
        raise lines.error(f"expected at most {MOST_NODES} nodes, got {n_points}")
    if mesh is not None and n_points != len(mesh.points):
        raise lines.error(
            f"has {n_points} nodes, the mesh has {len(mesh.points)}: this fort.13 does "
            "not belong to the mesh"
        )
    names: list[str] = []
    units, defaults = [], []
    for _ in range(lines.count("the number of attributes")):
        (name,) = lines.values("the name of an attribute", "w")
        if name in names:
            raise lines.error(f"the attribute {name} was given before")
        names.append(name)
        units.append(lines.text(f"the unit of {name}"))
        columns = lines.integer(f"the number of values a node of {name}")
        if not 1 <= columns <= _MOST_VALUES:
            raise lines.error(
                f"expected the number of values a node of {name}, 1 to "
                f"{_MOST_VALUES}, got {columns}"
            )
        default = lines.values(f"the default of {name}", "r" * columns)
        defaults.append(np.array(default))
    values: dict[str, np.ndarray] = {}
    for _ in names:
        (name,) = lines.values("the name of an attribute", "w")
        if name not in names or name in values:
            left = ", ".join(other for other in names if other not in values)
            raise lines.error(f'expected the values of one of {left}, got "{name}"')
        default = defaults[names.index(name)]
        values[name] = _read_values(lines, name, default, n_points)
    left = lines.peek()
    if left is not None:
        lines.raw("")
        raise lines.error(f'expected the end of the file, got "{left.strip()}"')
    lines.warn_of_open_end()
    return NodalAttributes(
        title,
        tuple(names),
        tuple(units),
        tuple(defaults),
        tuple(values[name] for name in names),
    )


def write_fort13(path: str | Path, attributes: NodalAttributes) -> None:
    """Write nodal attributes; gzipped if named .gz.

    Nodes whose values are all the default are not listed.

    Raises
    ------
    InputError
        If the file cannot be written.
    """
    n_points = len(attributes.values[0]) if attributes.names else 0
    with writing(Path(path)) as file:
        lines = [attributes.title, str(n_points), str(len(attributes.names))]
        for name, unit, default in zip(
            attributes.names, attributes.units, attributes.defaults
        ):
            lines += [name, unit or "1", str(len(default)), _text(default.tolist())]
        file.write(("\n".join(lines) + "\n").encode())
        for name, default, table in zip(
            attributes.names, attributes.defaults, attributes.values
        ):
            other = np.flatnonzero((table != default).any(axis=1))
            lines = [name, str(len(other))]
            for node, row in zip((other + 1).tolist(), table[other].tolist()):
                lines.append(f"{node} {_text(row)}")
            file.write(("\n".join(lines) + "\n").encode())


def _read_values(
    lines: Records, name: str, default: np.ndarray, n_points: int
) -> np.ndarray:
    count = lines.count(f"the number of nodes of {name} that are not at the default")
    if count > n_points:
        raise lines.error(f"expected at most {n_points} nodes of {name}, got {count}")
    before = lines.line
    table = lines.table(count, 1 + len(default), f"node and value(s) of {name}")
    nodes = table[:, 0]
    wrong = (nodes != np.rint(nodes)) | (nodes < 1) | (nodes > n_points)
    if wrong.any():
        k = int(np.flatnonzero(wrong)[0])
        raise lines.error(
            f"expected a node number from 1 to {n_points}, got {nodes[k]:g}",
            # Exact where no blank lines stand between.
            min(before + k + 1, lines.line),
        )
    index = nodes.astype(np.int64) - 1
    values = np.tile(default, (n_points, 1))
    values[index] = table[:, 1:]
    twice = (values[index] != table[:, 1:]).any(axis=1)
    if twice.any():
        k = int(np.flatnonzero(twice)[0])
        raise lines.error(
            f"node {nodes[k]:g} has two different values of {name}",
            min(before + k + 1, lines.line),
        )
    return values


def _text(row: list[float]) -> str:
    return " ".join(repr(value) for value in row)
