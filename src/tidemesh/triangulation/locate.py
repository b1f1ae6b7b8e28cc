"""Find triangles at points, and interpolate between their nodes."""

from __future__ import annotations

from collections.abc import Callable
from typing import Literal

import numpy as np

from tidemesh.datatypes import SizeField
from tidemesh.triangulation import _kernels, topology

Outside = Literal["nearest", "nan"]

TOLERANCE = 1e-9
"""Barycentric coordinates down to this much below zero still count as inside."""

TRIANGLES_PER_CELL = 2.0
CROWDED = 32
"""A cell with more triangles is divided into a grid of its own."""

FINEST_DIVISION = 32
LEVELS = 5
MARGIN = 1e-6
"""In cells: wider than any rounding, so that no point falls between two lists."""

BLOCK = 200_000
"""Triangles taken at a time, for the memory."""

LEAF = 4
"""Boundary segments in a leaf of the tree."""


class Locator:
    """Point location in a triangular mesh.

    The triangles are listed by the cells of a square grid; crowded cells carry a finer
    grid of their own, so graded meshes cost neither memory nor time. Holes and
    non-convex outlines need no care.

    Parameters
    ----------
    points : (n_points, 2) float array
        m.
    triangles : (n_triangles, 3) int array
        In either direction.

    Raises
    ------
    ValueError
        If there are no triangles, or a point is not finite.
    """

    def __init__(self, points: np.ndarray, triangles: np.ndarray):
        points = np.array(points, dtype=np.float64)
        if len(triangles) == 0:
            raise ValueError("a mesh without triangles cannot be searched")
        if not np.isfinite(points).all():
            raise ValueError("the points of a mesh must be finite")
        self._points = points
        self._x = np.array(points[:, 0])
        self._y = np.array(points[:, 1])
        self._triangles = np.array(triangles, dtype=np.uint32, order="C")
        self._boundary: _Boundary | None = None
        self._build()

    def find(self, xy: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Triangles that hold points.

        Parameters
        ----------
        xy : (n, 2) float array
            m.

        Returns
        -------
        triangle : (n,) int64 array
            -1 outside the mesh. Any of the triangles for a point on an edge.
        barycentric : (n, 3) float array
            Weights of the three corners, not negative; NaN outside.
        """
        query = _queries(xy)
        triangle = np.empty(len(query), dtype=np.int64)
        barycentric = np.full((len(query), 3), np.nan)
        _kernels.find(
            self._x,
            self._y,
            self._triangles,
            *self._grids,
            self._child,
            self._start,
            self._entries,
            query,
            TOLERANCE,
            triangle,
            barycentric,
        )
        np.clip(barycentric, 0.0, 1.0, out=barycentric)
        return triangle, barycentric

    def nearest(self, xy: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Triangles that hold points or, outside, the nearest place on the boundary.

        Returns
        -------
        triangle : (n,) int64 array
            -1 for points that are not finite.
        barycentric : (n, 3) float array
        distance : (n,) float array
            From the point to that place (m), zero inside.
        """
        query = _queries(xy)
        triangle, barycentric = self.find(query)
        distance = np.zeros(len(query))
        outside = np.flatnonzero(triangle < 0)
        if len(outside):
            if self._boundary is None:
                self._boundary = _Boundary(self._points, self._triangles)
            found = self._boundary.nearest(query[outside])
            triangle[outside], barycentric[outside], distance[outside] = found
        return triangle, barycentric, distance

    def interpolate(
        self, values: np.ndarray, xy: np.ndarray, outside: Outside = "nearest"
    ) -> np.ndarray:
        """Nodal values, linear on the triangles, at points.

        Parameters
        ----------
        values : (..., n_points) real or complex array
        xy : (n, 2) float array
            m.
        outside : {"nearest", "nan"}
            Value at points outside: that of the nearest place on the boundary, or NaN.

        Returns
        -------
        interpolated : (..., n) array
            NaN at points that are not finite.
        """
        values = np.asarray(values)
        if values.shape[-1:] != (len(self._points),):
            raise ValueError(
                f"values must have shape (..., {len(self._points)}), got {values.shape}"
            )
        if outside == "nearest":
            triangle, weight, _ = self.nearest(xy)
        elif outside == "nan":
            triangle, weight = self.find(xy)
        else:
            raise ValueError(f'outside must be "nearest" or "nan", got "{outside}"')
        # Row -1 stands in for points outside; their weights are NaN.
        node = self._triangles[triangle]
        return sum(values[..., node[:, k]] * weight[:, k] for k in range(3))

    def _build(self) -> None:
        corners = self._triangles
        left, right = self._x[corners].min(), self._x[corners].max()
        low, high = self._y[corners].min(), self._y[corners].max()
        width, height = right - left, high - low
        cells = max(len(corners) / TRIANGLES_PER_CELL, 1.0)
        # The second term bounds the cells of a mesh that is a mere line in its box.
        side = max(np.sqrt(width * height / cells), max(width, height) / cells)
        grids = _Grids(
            origin=np.array([[left - 0.5 * side, low - 0.5 * side]]),
            step=np.array([side]),
            shape=np.array([[int(width / side) + 2, int(height / side) + 2]]),
        )
        members = np.arange(len(corners), dtype=np.uint32)
        owner = np.zeros(len(corners), dtype=np.int64)

        levels, children, counts, lists = [], [], [], []
        n_cells, n_grids = 0, 1
        for level in range(LEVELS):
            number, listed = self._bin(grids, members, owner)
            child = np.full(len(number), -1, dtype=np.int32)
            levels.append(
                (grids.origin, grids.step, grids.shape, n_cells + grids.first)
            )
            children.append(child)
            counts.append(number)
            lists.append(listed)
            n_cells += len(number)
            crowded = np.flatnonzero(number > CROWDED)
            if level == LEVELS - 1 or len(crowded) == 0:
                break
            child[crowded] = n_grids + np.arange(len(crowded))
            n_grids += len(crowded)
            members = listed[np.repeat(number > CROWDED, number)]
            owner = np.repeat(np.arange(len(crowded)), number[crowded])
            grids = grids.divided(crowded, number[crowded])

        self._grids = tuple(np.concatenate(part) for part in zip(*levels))
        self._child = np.concatenate(children)
        self._start = np.concatenate([[0], np.cumsum(np.concatenate(counts))])
        self._entries = np.concatenate(lists)

    def _bin(
        self, grids: _Grids, members: np.ndarray, owner: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Triangles per cell: their number (n_cells,), and all the lists joined."""
        parts = []
        for begin in range(0, len(members), BLOCK):
            block = members[begin : begin + BLOCK]
            corner = self._triangles[block]
            item, cell = grids.overlaps(
                self._x[corner], self._y[corner], owner[begin : begin + BLOCK]
            )
            # One number for both sorts several times faster than an argsort.
            parts.append((cell << 32) | block[item])
        pairs = np.concatenate(parts)
        pairs.sort()
        number = np.bincount(pairs >> 32, minlength=grids.n_cells)
        return number, pairs.astype(np.uint32)


class _Grids:
    """Grids of square cells, each numbered row by row after the one before.

    Parameters
    ----------
    origin : (n, 2) m, lower left corners
    step : (n,) m
    shape : (n, 2) columns and rows
    """

    def __init__(self, origin: np.ndarray, step: np.ndarray, shape: np.ndarray):
        self.origin, self.step, self.shape = origin, step, shape
        inside = shape.prod(axis=1)
        self.first = np.cumsum(inside) - inside
        self.n_cells = int(inside.sum())

    def divided(self, cells: np.ndarray, number: np.ndarray) -> _Grids:
        """A grid in each of some cells, fit for the number of triangles in it."""
        grid = np.searchsorted(self.first, cells, side="right") - 1
        row, column = np.divmod(cells - self.first[grid], self.shape[grid, 0])
        place = np.stack([column, row], axis=1)
        parts = np.ceil(np.sqrt(number / TRIANGLES_PER_CELL)).astype(np.int64)
        parts = np.minimum(parts, FINEST_DIVISION)
        return _Grids(
            origin=self.origin[grid] + place * self.step[grid, None],
            step=self.step[grid] / parts,
            shape=np.stack([parts, parts], axis=1),
        )

    def overlaps(
        self, x: np.ndarray, y: np.ndarray, grid: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Cells that triangles meet: corners (m, 3) -> rows, cells (n_pairs,)."""
        u = (x - self.origin[grid, :1]) / self.step[grid, None]
        v = (y - self.origin[grid, 1:]) / self.step[grid, None]
        columns, rows = self.shape[grid].T
        left = np.maximum(np.floor(u.min(axis=1) - MARGIN), 0.0).astype(np.int64)
        right = np.floor(u.max(axis=1) + MARGIN).astype(np.int64)
        low = np.maximum(np.floor(v.min(axis=1) - MARGIN), 0.0).astype(np.int64)
        high = np.floor(v.max(axis=1) + MARGIN).astype(np.int64)
        wide = np.minimum(right, columns - 1) - left + 1
        count = wide * (np.minimum(high, rows - 1) - low + 1)

        item = np.repeat(np.arange(len(x)), count)
        inner = np.arange(len(item)) - np.repeat(np.cumsum(count) - count, count)
        row, column = np.divmod(inner, wide[item])
        row += low[item]
        column += left[item]

        # A triangle that is wider and higher than a cell may still miss it: one of its
        # sides then has the whole cell on its outer side.
        ahead_u, ahead_v = np.roll(u, -1, axis=1) - u, np.roll(v, -1, axis=1) - v
        turn = ahead_u[:, 0] * ahead_v[:, 1] - ahead_u[:, 1] * ahead_v[:, 0]
        normal_u = np.where(turn < 0.0, 1.0, -1.0)[:, None] * ahead_v
        normal_v = np.where(turn < 0.0, -1.0, 1.0)[:, None] * ahead_u
        reach = np.maximum(normal_u, 0.0) + np.maximum(normal_v, 0.0)
        reach += MARGIN * (np.abs(normal_u) + np.abs(normal_v))
        reach -= normal_u * u + normal_v * v
        meets = np.ones(len(item), dtype=bool)
        for side in range(3):
            meets &= (
                normal_u[item, side] * column
                + normal_v[item, side] * row
                + reach[item, side]
            ) >= 0.0
        cell = self.first[grid[item]] + row * columns[item] + column
        return item[meets], cell[meets]


class _Boundary:
    """Nearest place on the boundary of a mesh."""

    def __init__(self, points: np.ndarray, triangles: np.ndarray):
        triangles = triangles.astype(np.int64)
        edges = topology.boundary_edges(triangles)
        owner = topology.boundary_edge_triangles(triangles)
        # Ring by ring, so that consecutive segments lie near one another and a tree
        # over their numbers is a good tree over their places.
        order = _ring_order(edges)
        self._edges, self._owner = edges[order], owner[order]
        self._corners = triangles
        start, end = points[self._edges[:, 0]], points[self._edges[:, 1]]
        self._start, self._end = start, end
        self._ends = np.concatenate([start, end], axis=1)
        self._boxes = _box_tree(np.minimum(start, end), np.maximum(start, end))

    def nearest(self, query: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Triangle, barycentric coordinates and distance of the nearest place."""
        segment = np.empty(len(query), dtype=np.int64)
        fraction = np.full(len(query), np.nan)
        _kernels.nearest_segment(
            self._ends, self._boxes, LEAF, query, segment, fraction
        )
        known = segment >= 0
        triangle = np.where(known, self._owner[segment], -1)
        corner = self._corners[triangle]
        edge = self._edges[segment]
        weight = np.where(corner == edge[:, :1], 1.0 - fraction[:, None], 0.0)
        weight += np.where(corner == edge[:, 1:], fraction[:, None], 0.0)
        weight[~known] = np.nan
        along = fraction[:, None] * (self._end[segment] - self._start[segment])
        distance = np.linalg.norm(self._start[segment] + along - query, axis=1)
        return triangle, weight, distance


def as_function(
    size_field: SizeField, outside: Outside = "nearest"
) -> Callable[[np.ndarray], np.ndarray]:
    """Spacing as a function of place.

    Parameters
    ----------
    size_field : SizeField
    outside : {"nearest", "nan"}
        See `Locator.interpolate`.

    Returns
    -------
    spacing : function
        Points (n, 2) m -> spacing (n,) m, linear on the field's triangles.
    """
    locator = Locator(size_field.points, size_field.triangles)

    def spacing(points: np.ndarray) -> np.ndarray:
        return locator.interpolate(size_field.spacing, points, outside)

    return spacing


def _queries(xy: np.ndarray) -> np.ndarray:
    query = np.asarray(xy, dtype=np.float64)
    if query.ndim != 2 or query.shape[1] != 2:
        raise ValueError(f"points must have shape (n, 2), got {query.shape}")
    # The kernels are compiled for arrays that may be written to.
    return np.require(query, requirements=["C", "W"])


def _ring_order(edges: np.ndarray) -> np.ndarray:
    """Rows of directed edges, one ring after another; any order if rings branch."""
    size = int(edges.max()) + 1
    leaving = np.zeros(size, dtype=np.int64)
    leaving[edges[:, 0]] = np.arange(len(edges))
    following = leaving[edges[:, 1]].tolist()
    visited = [False] * len(edges)
    order = []
    for start in range(len(edges)):
        row = start
        while not visited[row]:
            visited[row] = True
            order.append(row)
            row = following[row]
    return np.array(order)


def _box_tree(low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """Bounding boxes of runs of segments in heap order: (2 n_leaves, 4)."""
    begin = np.arange(0, len(low), LEAF)
    leaves = 1 << int(np.ceil(np.log2(len(begin)))) if len(begin) > 1 else 1
    boxes = np.empty((2 * leaves, 4))
    boxes[:, :2], boxes[:, 2:] = np.inf, -np.inf
    boxes[leaves : leaves + len(begin), :2] = np.minimum.reduceat(low, begin)
    boxes[leaves : leaves + len(begin), 2:] = np.maximum.reduceat(high, begin)
    while leaves > 1:
        half = leaves // 2
        below = boxes[leaves : 2 * leaves].reshape(half, 2, 4)
        boxes[half:leaves, :2] = below[:, :, :2].min(axis=1)
        boxes[half:leaves, 2:] = below[:, :, 2:].max(axis=1)
        leaves = half
    return boxes
