"""Hierarchy of equilateral triangles, walked level by level on whole arrays.

A triangle is two integers and an orientation. In the skewed lattice of its level,
"up" (i, j) has the corners (i, j), (i + 1, j), (i, j + 1) and "down" (i, j) the
corners (i + 1, j), (i + 1, j + 1), (i, j + 1); lattice point (i, j) lies at
x = (i + j / 2) edge, y = (sqrt(3) / 2) j edge from the anchor.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from tidemesh.errors import InputError

ROW_HEIGHT = 0.5 * np.sqrt(3.0)
MAXIMUM_LEVELS = 20
# Some 2 GB; twice as many triangles as nodes.
MOST_TRIANGLES = 40_000_000
# A size equal to the edge within rounding is equal: a constant target must give one
# level.
ROUNDING = 1e-6
# Lattice units of a finest edge: halves and thirds are whole numbers.
UNITS = 6
# Bits of a column in a node's key: 20 levels of 6 units on some 8 roots need 26.
KEY_BITS = 31

# Corners (i, j) of the up and of the down triangle, the horizontal side first.
CORNERS = np.array([[[0, 0], [1, 0], [0, 1]], [[0, 1], [1, 1], [1, 0]]])
# Children (i, j, down) relative to (2 i, 2 j) of the up and of the down triangle.
CHILDREN = np.array(
    [
        [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]],
        [[1, 0, 1], [1, 1, 1], [0, 1, 1], [1, 1, 0]],
    ]
)

Spacing = Callable[[np.ndarray], np.ndarray]
Classifier = Callable[[np.ndarray, float], tuple[np.ndarray, np.ndarray]]


@dataclass(frozen=True, eq=False)
class Triangles:
    """Triangles of one level: integers and an orientation."""

    i: np.ndarray
    """(n,) int64."""
    j: np.ndarray
    """(n,) int64."""
    down: np.ndarray
    """(n,) bool, points downwards."""
    inside: np.ndarray
    """(n,) bool, wholly in the region and clear of its boundary."""

    def __len__(self) -> int:
        return len(self.i)

    def where(self, mask: np.ndarray) -> Triangles:
        """Return the triangles that a mask or an index array selects."""
        return Triangles(self.i[mask], self.j[mask], self.down[mask], self.inside[mask])


@dataclass(frozen=True, eq=False)
class TriangleSelection:
    """Triangles chosen from the hierarchy, level by level."""

    anchor: np.ndarray
    """(2,) m, position of lattice point (0, 0)."""
    root_edge: float
    """m, edge of level 0; that of level k is ``root_edge / 2**k``."""
    levels: tuple[Triangles, ...]
    """Triangles chosen on level 0, 1, ..."""
    targets: tuple[np.ndarray, ...]
    """(n,) m for every level: size function at the centres."""

    def __len__(self) -> int:
        return sum(len(triangles) for triangles in self.levels)


def select_triangles(
    bounds: tuple[float, float, float, float],
    base_edge: float,
    spacing: Spacing,
    *,
    rule: str = "graded",
    minimum_edge: float = 0.0,
    classify: Classifier | None = None,
) -> TriangleSelection:
    """Choose triangles by their edge against the target size at their centres.

    Parameters
    ----------
    bounds : (xmin, ymin, xmax, ymax)
        m, the box to cover.
    base_edge : float
        m, an edge that the hierarchy contains: level 0 is ``base_edge`` times a power
        of two.
    spacing : callable
        Target size at points: (n, 2) m -> (n,) m.
    rule : {"balanced", "graded", "strict"}
        Choose below twice the target, or ("strict") below the target (docs/method.md,
        reading 5). An edge equal to the target is below it.
    minimum_edge : float
        m, triangles whose children would be smaller are chosen whatever the target.
    classify : callable, optional
        ``classify(centres, edge)`` -> (dropped, inside), both (n,) bool: triangles
        without anything of the region, and those wholly in it.

    Raises
    ------
    InputError
        If the hierarchy would be deeper than 20 levels, or hold more than 40 million
        triangles.

    Notes
    -----
    Paper, section 3.5; docs/method.md, section 7.
    """
    x0, y0, x1, y1 = bounds
    extent = max(x1 - x0, y1 - y0)
    doublings = int(np.floor(np.log2(max(extent / (4.0 * base_edge), 1.0))))
    edge = root_edge = base_edge * 2.0**doublings
    anchor = np.array([x0, y0])
    # At exactly twice the target the four children meet it exactly.
    limit = 1.0 + ROUNDING if rule == "strict" else 2.0 * (1.0 - ROUNDING)

    triangles = _roots(x1 - x0, y1 - y0, edge)
    levels: list[Triangles] = []
    targets: list[np.ndarray] = []
    while True:
        centres = _centres(triangles, anchor, edge)
        if classify is not None:
            triangles, centres = _prune(triangles, centres, edge, classify)
        target = np.asarray(spacing(centres), dtype=np.float64)
        chosen = edge < limit * target
        if 0.5 * edge < minimum_edge * (1.0 - ROUNDING):
            chosen[:] = True
        levels.append(triangles.where(chosen))
        targets.append(target[chosen])
        left = ~chosen
        if not left.any():
            return TriangleSelection(anchor, root_edge, tuple(levels), tuple(targets))
        if len(levels) > MAXIMUM_LEVELS:
            x, y = centres[left][0]
            raise InputError(
                f"the size {target[left][0]:.3g} m wanted near x = {x:.0f}, "
                f"y = {y:.0f} m is some {2**MAXIMUM_LEVELS} times smaller than the "
                "domain: raise the smallest size"
            )
        if sum(map(len, levels)) + 4 * int(left.sum()) > MOST_TRIANGLES:
            raise InputError(
                f"sizes down to {target.min():.3g} m need more than "
                f"{MOST_TRIANGLES // 2:,} nodes: raise the smallest size"
            )
        triangles = _split(triangles.where(left))
        edge *= 0.5


def lattice_nodes(
    selection: TriangleSelection, *, rule: str = "graded"
) -> tuple[np.ndarray, np.ndarray]:
    """Nodes of the chosen triangles: corners and grading nodes, each once.

    With the rule "graded" a triangle with an edge above 4/3 of its target gets one
    node, on its horizontal side; above 5/3 one at its centre instead (paper, section
    3.5). With "balanced" it gets the centre node above 4/3 already: a lattice and its
    centres are an equilateral lattice again, a lattice and its horizontal midpoints
    are not. "strict" has no such triangles. A centre node is left out where a finer
    neighbour's corner already divides a side.

    Returns
    -------
    points : (n, 2) float array
        m, row after row of the lattice.
    inside : (n,) bool array
        True where one of the node's triangles lies wholly in the region.
    """
    finest = len(selection.levels) - 1
    unit = selection.root_edge / (UNITS * 2.0**finest)
    corner_keys = [
        _packed(*_corner(triangles, corner, finest - level), triangles.inside)
        for level, triangles in enumerate(selection.levels)
        for corner in range(3)
    ]
    keys = np.sort(np.concatenate(corner_keys))
    if rule != "strict":
        extra = _grading_keys(selection, keys >> 1, rule)
        if len(extra):
            keys = np.sort(np.concatenate([keys, extra]))
    # The lowest bit is clear where the triangle is inside, so a node's first key
    # tells whether any of its triangles is.
    first = np.empty(len(keys), dtype=bool)
    first[:1] = True
    np.not_equal(keys[1:] >> 1, keys[:-1] >> 1, out=first[1:])
    keys = keys[first]
    return _positions(keys >> 1, selection.anchor, unit), (keys & 1) == 0


def _grading_keys(
    selection: TriangleSelection, corners: np.ndarray, rule: str
) -> np.ndarray:
    finest = len(selection.levels) - 1
    keys = [np.empty(0, dtype=np.int64)]
    for level, triangles in enumerate(selection.levels):
        ratio = selection.root_edge * 0.5**level / selection.targets[level]
        graded = ratio > 4.0 / 3.0 * (1.0 + ROUNDING)
        centre = graded if rule == "balanced" else ratio > 5.0 / 3.0
        middle = graded & ~centre
        for mask, number in ((middle, 2), (centre, 3)):
            chosen = triangles.where(mask)
            ends = [_corner(chosen, corner, finest - level) for corner in range(3)]
            if number == 3:
                divided = np.zeros(len(chosen), dtype=bool)
                for (i, j), (k, m) in zip(ends, ends[1:] + ends[:1]):
                    divided |= _contains(corners, _key((i + k) // 2, (j + m) // 2))
                whole = ~divided
                ends = [(i[whole], j[whole]) for i, j in ends]
                chosen = chosen.where(whole)
            i = sum(i for i, _ in ends[:number]) // number
            j = sum(j for _, j in ends[:number]) // number
            keys.append(_packed(i, j, chosen.inside))
    return np.concatenate(keys)


def _roots(width: float, height: float, edge: float) -> Triangles:
    """Triangles of level 0 that cover the box from the anchor."""
    rows = int(np.ceil(height / (ROW_HEIGHT * edge) + ROUNDING))
    columns = int(np.ceil(width / edge + ROUNDING))
    i, j = np.meshgrid(np.arange(-1, columns + 1), np.arange(rows))
    i = (i - j // 2).ravel()
    down = np.repeat([False, True], i.size)
    return Triangles(
        np.tile(i, 2), np.tile(j.ravel(), 2), down, np.zeros(2 * i.size, dtype=bool)
    )


def _prune(
    triangles: Triangles, centres: np.ndarray, edge: float, classify: Classifier
) -> tuple[Triangles, np.ndarray]:
    open_question = np.flatnonzero(~triangles.inside)
    if not len(open_question):
        return triangles, centres
    dropped, whole = classify(centres[open_question], edge)
    inside = triangles.inside.copy()
    inside[open_question[whole]] = True
    triangles = Triangles(triangles.i, triangles.j, triangles.down, inside)
    if not dropped.any():
        return triangles, centres
    kept = np.ones(len(triangles), dtype=bool)
    kept[open_question[dropped]] = False
    return triangles.where(kept), centres[kept]


def _split(triangles: Triangles) -> Triangles:
    steps = CHILDREN[triangles.down.view(np.int8)]
    return Triangles(
        (2 * triangles.i[:, None] + steps[:, :, 0]).ravel(),
        (2 * triangles.j[:, None] + steps[:, :, 1]).ravel(),
        steps[:, :, 2].ravel() == 1,
        np.repeat(triangles.inside, 4),
    )


def _centres(triangles: Triangles, anchor: np.ndarray, edge: float) -> np.ndarray:
    third = (1.0 + triangles.down) / 3.0
    centres = np.empty((len(triangles), 2))
    centres[:, 1] = (triangles.j + third) * (ROW_HEIGHT * edge) + anchor[1]
    centres[:, 0] = (triangles.i + 0.5 * triangles.j + 1.5 * third) * edge + anchor[0]
    return centres


def _corner(
    triangles: Triangles, corner: int, levels_above_finest: int
) -> tuple[np.ndarray, np.ndarray]:
    """Lattice coordinates of a corner in units of the finest lattice."""
    step = CORNERS[triangles.down.view(np.int8), corner]
    scale = UNITS << levels_above_finest
    return (triangles.i + step[:, 0]) * scale, (triangles.j + step[:, 1]) * scale


def _key(i: np.ndarray, j: np.ndarray) -> np.ndarray:
    """One int64 for lattice coordinates, ordered by row, then column."""
    return (j << KEY_BITS) + (i + (1 << (KEY_BITS - 1)))


def _packed(i: np.ndarray, j: np.ndarray, inside: np.ndarray) -> np.ndarray:
    return (_key(i, j) << 1) + ~inside


def _positions(keys: np.ndarray, anchor: np.ndarray, unit: float) -> np.ndarray:
    j = keys >> KEY_BITS
    i = (keys & ((1 << KEY_BITS) - 1)) - (1 << (KEY_BITS - 1))
    points = np.empty((len(keys), 2))
    points[:, 0] = (i + 0.5 * j) * unit + anchor[0]
    points[:, 1] = j * (ROW_HEIGHT * unit) + anchor[1]
    return points


def _contains(sorted_keys: np.ndarray, keys: np.ndarray) -> np.ndarray:
    place = np.minimum(np.searchsorted(sorted_keys, keys), len(sorted_keys) - 1)
    return sorted_keys[place] == keys
