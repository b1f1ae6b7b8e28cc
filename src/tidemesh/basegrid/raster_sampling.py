"""Values of a raster at points: bilinear, or means over boxes, water cells only.

Both take the raster as bilinear between cell centres. Cells without a weight (land,
unknown) are left out of numerator and denominator alike.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, eq=False)
class WeightedRaster:
    """Cell values and their weights, zero for cells that do not count."""

    x: np.ndarray
    """(nx,) cell centres, ascending."""
    y: np.ndarray
    """(ny,) cell centres, ascending."""
    values: np.ndarray
    """(ny, nx), finite, zero where the weight is."""
    weights: np.ndarray
    """(ny, nx), 0 or 1."""

    def covers(self, points: np.ndarray) -> np.ndarray:
        """Whether points (n, 2) lie in a cell, half a cell beyond the outer centres."""
        covered = np.ones(len(points), dtype=bool)
        for axis, position in zip((self.x, self.y), points.T):
            low = axis[0] - 0.5 * (axis[1] - axis[0])
            high = axis[-1] + 0.5 * (axis[-1] - axis[-2])
            covered &= (position >= low) & (position <= high)
        return covered

    def bilinear(self, points: np.ndarray) -> np.ndarray:
        """Values at points (n, 2); NaN outside and where no cell around counts."""
        i, s = _cell(self.x, points[:, 0])
        j, t = _cell(self.y, points[:, 1])
        total, weight = np.zeros(len(points)), np.zeros(len(points))
        for row, along_y in ((j, 1.0 - t), (j + 1, t)):
            for column, along_x in ((i, 1.0 - s), (i + 1, s)):
                share = along_y * along_x
                total += share * self.values[row, column]
                weight += share * self.weights[row, column]
        return _ratio(total, weight, self.covers(points) & (weight > 1e-9))

    def box_mean(self, points: np.ndarray, half_width: np.ndarray) -> np.ndarray:
        """Means of the bilinear surface over boxes, exact by summed areas.

        Parameters
        ----------
        points : (n, 2) float array
            Centres, covered by the raster.
        half_width : (n, 2) float array
            Half the sides along x and y. Boxes are cut at the outer cell centres.

        Returns
        -------
        means : (n,) float array
            NaN where nothing in the box counts.
        """
        ends = []
        area = np.ones(len(points))
        for axis, centre, half in zip((self.x, self.y), points.T, half_width.T):
            low = np.clip(centre - half, axis[0], axis[-1])
            high = np.clip(centre + half, axis[0], axis[-1])
            area *= high - low
            ends.append(((_shares(axis, low), -1.0), (_shares(axis, high), 1.0)))
        along_x, along_y = ends
        sums = []
        for cells in (self.values, self.weights):
            table = _summed_areas(cells, self.x, self.y)
            total = np.zeros(len(points))
            for (row, row_shares), row_sign in along_y:
                for (column, column_shares), column_sign in along_x:
                    sign = row_sign * column_sign
                    for p, row_share in enumerate(row_shares):
                        for q, column_share in enumerate(column_shares):
                            part = table[row + p, column + q]
                            total += sign * row_share * column_share * part
            sums.append(total)
        # Differences of large sums leave rounding where there is nothing.
        return _ratio(*sums, sums[1] > 1e-6 * area)


def _ratio(total: np.ndarray, weight: np.ndarray, known: np.ndarray) -> np.ndarray:
    result = np.full(len(total), np.nan)
    return np.divide(total, weight, out=result, where=known)


def _cell(axis: np.ndarray, position: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Index of the centre before each position, and how far on to the next (0..1)."""
    index = np.clip(np.searchsorted(axis, position, "right") - 1, 0, len(axis) - 2)
    along = (position - axis[index]) / (axis[index + 1] - axis[index])
    return index, np.clip(along, 0.0, 1.0)


def _node_weights(axis: np.ndarray) -> np.ndarray:
    """Integral of each centre's hat function."""
    step = np.diff(axis)
    return 0.5 * (np.append(0.0, step) + np.append(step, 0.0))


def _summed_areas(cells: np.ndarray, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Integrals up to and without each cell: (ny + 1, nx + 1)."""
    table = np.zeros((len(y) + 1, len(x) + 1))
    weighted = cells * _node_weights(y)[:, None]
    weighted *= _node_weights(x)
    np.cumsum(weighted, axis=0, out=weighted)
    np.cumsum(weighted, axis=1, out=table[1:, 1:])
    return table


def _shares(axis: np.ndarray, position: np.ndarray):
    """Integral from the axis' start to a position, as shares of three running sums.

    With t the way from centre i to the next, the hat of centre i has been passed up to
    its first half plus step (t - t²/2), the next one up to step t²/2.
    """
    index, t = _cell(axis, position)
    weight = _node_weights(axis)
    step = axis[index + 1] - axis[index]
    half_before = weight[index] - 0.5 * step
    first = (half_before + step * (t - 0.5 * t * t)) / weight[index]
    second = step * 0.5 * t * t / weight[index + 1]
    return index, (1.0 - first, first - second, second)
