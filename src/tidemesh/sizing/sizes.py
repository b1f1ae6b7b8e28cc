"""From a rule to a size field, and the level that the settings ask for."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import brentq

from tidemesh.datatypes import CoastalMesh, SizeField, TruncationSeries
from tidemesh.errors import ConvergenceError, InputError
from tidemesh.sizing.budget import BudgetLevel, expected_nodes, find_level
from tidemesh.sizing.extrapolate import harmonic_extension, smooth_logarithm
from tidemesh.sizing.gradation import limit_gradation
from tidemesh.sizing.limits import clip, spacing_limits
from tidemesh.sizing.radii import error_at_spacing
from tidemesh.sizing.rules import SizeRule
from tidemesh.sizing.settings import SizingSettings
from tidemesh.triangulation import quality, topology

# Coordinates are float64: spacings below this part of the extent would make
# neighbouring nodes indistinguishable.
_FINEST = 1e-9

_MAXIMUM_DOUBLINGS = 6


def allowable_sizes(
    mesh: CoastalMesh, rule: SizeRule, level: float, settings: SizingSettings
) -> SizeField:
    """Allowed spacing on the base mesh (paper, section 3.4).

    Parameters
    ----------
    mesh : CoastalMesh
        Base mesh.
    rule : SizeRule
        Level -> spacing (n_points,), NaN where undefined.
    level : float
        For Eq. 4 the tolerance, m/s2.
    settings : SizingSettings

    Returns
    -------
    SizeField

    Raises
    ------
    InputError
        If the rule is undefined everywhere, or a size is below float resolution.
    """
    return size_builder(mesh, rule, settings)(level)


def size_builder(
    mesh: CoastalMesh, rule: SizeRule, settings: SizingSettings
) -> Callable[[float], SizeField]:
    """`allowable_sizes` as a function of the level alone.

    What does not depend on the level is done once, for searches over many levels.
    """
    edges = topology.edges(mesh.triangles)
    lengths = np.linalg.norm(
        mesh.points[edges[:, 0]] - mesh.points[edges[:, 1]], axis=1
    )
    least, greatest = spacing_limits(mesh, settings)
    extent = float(np.ptp(mesh.points, axis=0).max())
    extend = None

    def sizes(level: float) -> SizeField:
        nonlocal extend
        # 1. The rule; nowhere does a spacing beyond the extent of the domain matter.
        spacing = np.minimum(rule(level), extent)
        # 2. Noise.
        spacing = smooth_logarithm(spacing, edges, settings.smoothing_sweeps)
        # 3. Extrapolation, only where the rule is undefined.
        if extend is None:
            extend = harmonic_extension(mesh.points, edges, np.isfinite(spacing))
        spacing = extend(spacing)
        # 4. Limits.
        spacing = clip(spacing, least, greatest)
        # 5. Gradation.
        spacing = limit_gradation(spacing, edges, lengths, settings.gradation)
        _check_resolution(mesh, spacing, extent)
        return SizeField(mesh.points, mesh.triangles, spacing)

    return sizes


def choose_level(
    mesh: CoastalMesh,
    rule: SizeRule,
    sizes: Callable[[float], SizeField],
    settings: SizingSettings,
    *,
    count: Callable[[float], float] | None = None,
    base_spacing: ArrayLike | None = None,
    series: TruncationSeries | None = None,
    least: float | None = None,
) -> BudgetLevel:
    """Level of the rule by the tolerance that the settings name.

    Parameters
    ----------
    mesh : CoastalMesh
        Base mesh.
    rule : SizeRule
    sizes : function
        Level -> SizeField, from `size_builder`.
    settings : SizingSettings
    count : function, optional
        Nodes of the finished mesh at a level, for a node budget. Without it the
        expected number is used.
    base_spacing : float or (n_points,) array, optional
        Spacing of the base grid (m), for "peak" and "percentile".
    series : TruncationSeries, optional
        With it, "peak" and "percentile" are those of the truncation error at the base
        spacing (paper, section 3.4).
    least : float, optional
        Number of nodes that no level can go below.

    Returns
    -------
    BudgetLevel
    """

    def expected(level: float) -> float:
        return expected_nodes(sizes(level))

    if settings.tolerance != "nodes":
        level = _given_level(rule, settings, base_spacing, series)
        return BudgetLevel(level, expected(level), -1.0, 1)

    water = float(quality.area(mesh.points, mesh.triangles).sum())
    mean_spacing = math.sqrt(2.0 / math.sqrt(3.0) * water / settings.nodes)
    guess = level_at_spacing(rule, mean_spacing, percentile=50.0, tolerance=0.05)
    if count is None:
        return find_level(expected, settings.nodes, guess=guess)
    slope = -1.0
    try:
        model = find_level(expected, settings.nodes, guess=guess, tolerance=0.003)
        guess, slope = model.value, model.slope
    except (InputError, ConvergenceError):
        # The estimate treats the boundary as free; the finished mesh has the last word.
        pass
    return find_level(count, settings.nodes, guess=guess, slope=slope, least=least)


def level_at_spacing(
    rule: SizeRule,
    spacing: ArrayLike,
    *,
    percentile: float = 100.0,
    tolerance: float = 1e-14,
) -> float:
    """Level at which a rule asks for a given spacing.

    Parameters
    ----------
    rule : SizeRule
    spacing : float or (n_points,) array
        m.
    percentile : float
        100: no node wants less than the spacing, and one wants just that. p: the
        share 100 - p of the defined nodes wants less.
    tolerance : float
        Of the logarithm of the level.

    Returns
    -------
    float
    """
    first = rule(1.0)
    known = ~np.isnan(first)
    if not known.any():
        raise InputError("the sizing rule is undefined at every node of the base mesh")
    wanted = np.broadcast_to(spacing, known.shape)[known]

    def excess(decade: float) -> float:
        ratio = np.percentile(
            rule(10.0**decade)[known] / wanted,
            100.0 - percentile,
            method="inverted_cdf",
        )
        return math.log10(min(ratio, 1e300))

    # Most spacings grow like a power between 1/4 and 1 of the level.
    inner, outer = 0.0, -excess(0.0)
    for _ in range(_MAXIMUM_DOUBLINGS):
        if excess(outer) * excess(inner) <= 0.0:
            return 10.0 ** brentq(excess, inner, outer, xtol=tolerance, rtol=1e-14)
        inner, outer = outer, 2.0 * outer
    raise InputError("the sizing rule does not depend on its level")


def error_level(error: np.ndarray, percentile: float = 100.0) -> float:
    """Peak (or a percentile) of the truncation error of the base grid (m/s2).

    Parameters
    ----------
    error : (n_points,) array
        NaN where undefined.
    percentile : float
        100 is the largest error.
    """
    known = error[np.isfinite(error)]
    level = float(np.percentile(known, percentile)) if known.size else 0.0
    if not level > 0.0:
        raise InputError("the truncation error vanishes or is undefined everywhere")
    return level


def _given_level(
    rule: SizeRule,
    settings: SizingSettings,
    base_spacing: ArrayLike | None,
    series: TruncationSeries | None,
) -> float:
    if settings.tolerance == "absolute":
        return settings.level
    if base_spacing is None:
        raise ValueError(f'tolerance "{settings.tolerance}" needs the base spacing')
    percentile = 100.0 if settings.tolerance == "peak" else settings.percentile
    if series is None or settings.rule != "truncation_error":
        return level_at_spacing(rule, base_spacing, percentile=percentile)
    error = error_at_spacing(
        series,
        base_spacing,
        components=settings.components,
        constituents=settings.constituents,
    )
    return error_level(error, percentile)


def _check_resolution(mesh: CoastalMesh, spacing: np.ndarray, extent: float) -> None:
    finest = int(np.argmin(spacing))
    if spacing[finest] < _FINEST * extent:
        longitude, latitude = mesh.projection.inverse(mesh.points[finest][None])[0]
        raise InputError(
            f"a spacing of {spacing[finest]:.3g} m at {longitude:.5f}, {latitude:.5f} "
            f"cannot be told from zero in a domain of {extent:.3g} m: raise [sizing] "
            "min_m, or the level of the rule"
        )
