"""Allowable spacing from the truncation error series (paper, Eq. 4 and section 3.4)."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from tidemesh.datatypes import TruncationSeries

# Safeguarded Newton halves its bracket at worst; the bracket is [0.6, 5].
_MAXIMUM_ITERATIONS = 80


def error_at_spacing(
    series: TruncationSeries,
    spacing: ArrayLike,
    *,
    components: str = "vector",
    constituents: str = "largest",
) -> np.ndarray:
    """Size of the truncation error for a given spacing.

    Parameters
    ----------
    series : TruncationSeries
        Coefficients, with Delta the node spacing.
    spacing : float or (n_points,) array
        m.
    components : {"vector", "largest"}
        Root of the sum of squares over the components, or the largest of them.
    constituents : {"largest", "root_sum_square"}
        The same choice over the constituents. An error grows with the amplitude of
        its constituent, so no further weights are needed.

    Returns
    -------
    (n_points,) array
        m/s2, NaN where the estimator is undefined.
    """
    squared = np.square(np.broadcast_to(spacing, series.known.shape))
    errors = [
        np.sqrt(np.sum(np.abs(second * squared + fourth * squared**2) ** 2, axis=0))
        for second, fourth in _groups(series, components, constituents)
    ]
    return np.where(series.known, np.max(errors, axis=0), np.nan)


def allowable_spacing(
    series: TruncationSeries,
    tolerance: float,
    *,
    components: str = "vector",
    constituents: str = "largest",
    maximum: float = np.inf,
) -> np.ndarray:
    """Spacing at which the truncation error reaches the tolerance.

    Parameters
    ----------
    series : TruncationSeries
        Coefficients, with Delta the node spacing.
    tolerance : float
        m/s2, positive.
    components, constituents : str
        As for `error_at_spacing`: "largest" keeps every member below the tolerance
        (the pointwise minimum of their spacings).
    maximum : float
        m, also taken where both coefficients vanish.

    Returns
    -------
    (n_points,) array
        m, NaN where the estimator is undefined.
    """
    spacings = [
        smallest_root(second, fourth, tolerance)
        for second, fourth in _groups(series, components, constituents)
    ]
    spacing = np.minimum(np.min(spacings, axis=0), maximum)
    return np.where(series.known, spacing, np.nan)


def smallest_root(second: ArrayLike, fourth: ArrayLike, tolerance: float) -> np.ndarray:
    """Smallest Delta > 0 with |second Delta**2 + fourth Delta**4| = tolerance.

    Parameters
    ----------
    second, fourth : (n_components, n) complex arrays
        The root sum of squares is taken over the components.
    tolerance : float
        Positive.

    Returns
    -------
    (n,) array
        Infinite where both coefficients vanish.

    Raises
    ------
    ValueError
        If the tolerance is not positive and finite.

    Notes
    -----
    With X = Delta**2 this is A X**4 + 2 B X**3 + C X**2 = T**2, A = |fourth|**2,
    B = Re(conj(second) fourth), C = |second|**2 (docs/method.md, section 2): the
    paper's "minimum real root of a complex quadratic" read so that a root exists.
    Scaled by the smaller of the roots of the two terms alone, X = scale * y, the
    polynomial is a y**4 + 2 b y**3 + c y**2 = 1 with max(a, c) = 1 and
    b**2 <= a c, and its smallest root lies between 0.618 and 4.83.
    """
    if not (np.isfinite(tolerance) and tolerance > 0.0):
        raise ValueError(f"tolerance must be positive and finite, got {tolerance}")
    second, fourth = np.atleast_2d(second), np.atleast_2d(fourth)
    size2, size4, cosine = _sizes_and_cosine(second, fourth)
    with np.errstate(divide="ignore"):
        scale = np.minimum(tolerance / size2, np.sqrt(tolerance) / np.sqrt(size4))
    solvable = np.isfinite(scale)
    root = np.full(len(scale), np.inf)
    x = scale[solvable]
    a = (np.sqrt(size4[solvable]) / np.sqrt(tolerance) * x) ** 4
    c = (size2[solvable] / tolerance * x) ** 2
    b = cosine[solvable] * np.sqrt(a * c)
    root[solvable] = np.sqrt(x * _smallest_scaled_root(a, b, c))
    return root


def _smallest_scaled_root(a: np.ndarray, b: np.ndarray, c: np.ndarray) -> np.ndarray:
    """Smallest positive root of a y**4 + 2 b y**3 + c y**2 = 1."""

    def value(y):
        # Of the coefficients as they stand: part of them once some roots are found.
        return ((a * y + 2.0 * b) * y + c) * y * y - 1.0

    # 1. Where the coefficients oppose each other the polynomial may rise to a crest,
    #    fall, and rise again. The root is before the crest if the crest is above 1,
    #    else after the trough; on either stretch the polynomial only rises.
    discriminant = 9.0 * b * b - 8.0 * a * c
    turns = (b < 0.0) & (discriminant > 0.0)
    spread = np.sqrt(np.where(turns, discriminant, 0.0))
    with np.errstate(divide="ignore", invalid="ignore"):
        crest = np.where(turns, 2.0 * c / (spread - 3.0 * b), np.inf)
        trough = np.where(turns, (spread - 3.0 * b) / (4.0 * a), 0.0)
    # Far beyond its crest a root cannot be: such crests are above 1.
    before = value(np.minimum(crest, 5.0)) >= 0.0
    low = np.where(before, 0.6, np.maximum(trough, 0.6))
    high = np.where(before, np.minimum(crest, 5.0), 5.0)

    # 2. Newton's method, halving the bracket wherever it would leave it. Few
    #    roots, those near a crest, need many steps: only those are carried on.
    root = 0.5 * (low + high)
    todo = np.arange(len(root))
    y = root.copy()
    for _ in range(_MAXIMUM_ITERATIONS):
        residual = value(y)
        high = np.where(residual > 0.0, y, high)
        low = np.where(residual > 0.0, low, y)
        slope = 2.0 * y * ((2.0 * a * y + 3.0 * b) * y + c)
        with np.errstate(divide="ignore", invalid="ignore"):
            newton = y - residual / slope
        inside = (newton >= low) & (newton <= high)
        following = np.where(inside, newton, 0.5 * (low + high))
        root[todo] = following
        going = np.abs(following - y) > 3e-16 * y
        if not going.any():
            break
        todo, y, low, high = (v[going] for v in (todo, following, low, high))
        a, b, c = (coefficient[going] for coefficient in (a, b, c))
    return root


def _sizes_and_cosine(
    second: np.ndarray, fourth: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Norms over the components and the cosine between the two, free of overflow."""
    largest2 = np.abs(second).max(axis=0)
    largest4 = np.abs(fourth).max(axis=0)
    unit2 = second / np.where(largest2 > 0.0, largest2, 1.0)
    unit4 = fourth / np.where(largest4 > 0.0, largest4, 1.0)
    norm2 = np.sqrt(np.sum(np.abs(unit2) ** 2, axis=0))
    norm4 = np.sqrt(np.sum(np.abs(unit4) ** 2, axis=0))
    dot = np.sum((np.conj(unit2) * unit4).real, axis=0)
    product = norm2 * norm4
    cosine = dot / np.where(product > 0.0, product, 1.0)
    return largest2 * norm2, largest4 * norm4, np.clip(cosine, -1.0, 1.0)


def _groups(series: TruncationSeries, components: str, constituents: str):
    """Pairs of (n_members, n_points) arrays: squares are added within a pair."""
    n_points = len(series.known)
    together = {"vector": True, "largest": False}[components]
    joined = {"root_sum_square": True, "largest": False}[constituents]

    def group(coefficients):
        if joined and together:
            return coefficients.reshape(1, -1, n_points)
        if joined:
            return coefficients.transpose(1, 0, 2)
        return coefficients if together else coefficients.reshape(-1, 1, n_points)

    return zip(group(series.second), group(series.fourth))
