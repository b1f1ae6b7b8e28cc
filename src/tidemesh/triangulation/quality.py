"""Shape and size of triangles: q, angles, edges, valence, neighbouring areas."""

from __future__ import annotations

import numpy as np

from tidemesh.triangulation import topology


def area(points: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """Signed areas (m2), positive counter-clockwise: (n_triangles,)."""
    x, y = _corners(points, triangles)
    return 0.5 * ((x[1] - x[0]) * (y[2] - y[0]) - (x[2] - x[0]) * (y[1] - y[0]))


def edge_length(points: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """Lengths (m) of the edges from corner i to corner i + 1: (n_triangles, 3)."""
    return np.sqrt(_squared_edges(*_corners(points, triangles)).T)


def shape_quality(points: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """Quality q = 4 sqrt(3) area / (sum of squared edges): (n_triangles,).

    One for the equilateral triangle, zero for a flat one, negative if clockwise
    (docs/method.md, quality words).
    """
    x, y = _corners(points, triangles)
    twice_area = (x[1] - x[0]) * (y[2] - y[0]) - (x[2] - x[0]) * (y[1] - y[0])
    total = _squared_edges(x, y).sum(axis=0)
    with np.errstate(invalid="ignore", divide="ignore"):
        quality = 2.0 * np.sqrt(3.0) * twice_area / total
    return np.where(total > 0.0, quality, 0.0)


def angles(points: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """Inner angles (rad) at the corners: (n_triangles, 3)."""
    x, y = _corners(points, triangles)
    result = np.empty((len(triangles), 3))
    for corner in range(3):
        ahead, behind = (corner + 1) % 3, (corner + 2) % 3
        ax, ay = x[ahead] - x[corner], y[ahead] - y[corner]
        bx, by = x[behind] - x[corner], y[behind] - y[corner]
        # The arc tangent keeps its accuracy near 0 and 180 degrees, the cosine not.
        result[:, corner] = np.arctan2(np.abs(ax * by - ay * bx), ax * bx + ay * by)
    return result


def area_ratio(
    points: np.ndarray,
    triangles: np.ndarray,
    neighbours: np.ndarray | None = None,
) -> np.ndarray:
    """Larger over smaller area of the two triangles of every inner edge: (n_inner,)."""
    if neighbours is None:
        neighbours = topology.neighbours(triangles)
    size = np.abs(area(points, triangles))
    own = np.repeat(np.arange(len(triangles)), 3)
    other = neighbours.ravel()
    once = other > own
    first, second = size[own[once]], size[other[once]]
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.maximum(first, second) / np.minimum(first, second)


def valence_histogram(points: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """Number of inner nodes that have 0, 1, 2 ... neighbours: (largest + 1,) int64."""
    count = topology.valence(triangles, len(points))
    inner = count > 0
    inner[topology.boundary_edges(triangles).ravel()] = False
    return np.bincount(count[inner])


def quality_summary(points: np.ndarray, triangles: np.ndarray) -> dict[str, float]:
    """Figures of a mesh by name, as plain floats.

    Returns
    -------
    summary : dict
        ``nodes``, ``triangles``; ``quality_mean``, ``_minimum``, ``_percentile_1``,
        ``_percentile_5``, ``_median``, ``quality_below_0_6_fraction``;
        ``angle_minimum_deg``, ``angle_maximum_deg``, ``angle_30_120_fraction`` and
        ``angle_20_130_fraction`` (triangles with all angles inside the range);
        ``edge_minimum_m``, ``edge_median_m``, ``edge_maximum_m``; ``area_m2``;
        ``valence_minimum``, ``valence_maximum``, ``valence_4_8_fraction`` (inner
        nodes); ``area_ratio_within_2_fraction``, ``area_ratio_maximum`` (inner edges).
    """
    quality = shape_quality(points, triangles)
    degrees = np.degrees(angles(points, triangles))
    smallest, largest = degrees.min(axis=1), degrees.max(axis=1)
    length = edge_length(points, triangles)
    ratio = area_ratio(points, triangles)
    histogram = valence_histogram(points, triangles)
    inner = int(histogram.sum())
    present = np.flatnonzero(histogram)
    percentile = np.percentile(quality, [1.0, 5.0, 50.0])
    return {
        "nodes": float(len(points)),
        "triangles": float(len(triangles)),
        "quality_mean": float(quality.mean()),
        "quality_minimum": float(quality.min()),
        "quality_percentile_1": float(percentile[0]),
        "quality_percentile_5": float(percentile[1]),
        "quality_median": float(percentile[2]),
        "quality_below_0_6_fraction": float((quality < 0.6).mean()),
        "angle_minimum_deg": float(smallest.min()),
        "angle_maximum_deg": float(largest.max()),
        "angle_30_120_fraction": _fraction_inside(smallest, largest, 30.0, 120.0),
        "angle_20_130_fraction": _fraction_inside(smallest, largest, 20.0, 130.0),
        "edge_minimum_m": float(length.min()),
        "edge_median_m": float(np.median(length)),
        "edge_maximum_m": float(length.max()),
        "area_m2": float(area(points, triangles).sum()),
        "valence_minimum": float(present[0]) if inner else 0.0,
        "valence_maximum": float(present[-1]) if inner else 0.0,
        "valence_4_8_fraction": float(histogram[4:9].sum() / inner) if inner else 1.0,
        "area_ratio_within_2_fraction": float((ratio <= 2.0).mean())
        if len(ratio)
        else 1.0,
        "area_ratio_maximum": float(ratio.max()) if len(ratio) else 1.0,
    }


def _corners(points: np.ndarray, triangles: np.ndarray) -> tuple[list, list]:
    columns = [triangles[:, corner] for corner in range(3)]
    x = np.ascontiguousarray(points[:, 0])
    y = np.ascontiguousarray(points[:, 1])
    return [x[column] for column in columns], [y[column] for column in columns]


def _squared_edges(x: list, y: list) -> np.ndarray:
    return np.stack(
        [
            (x[(corner + 1) % 3] - x[corner]) ** 2
            + (y[(corner + 1) % 3] - y[corner]) ** 2
            for corner in range(3)
        ]
    )


def _fraction_inside(
    smallest: np.ndarray, largest: np.ndarray, low: float, high: float
) -> float:
    return float(((smallest >= low) & (largest <= high)).mean())
