"""Sizing rules: from what is known of the coast and its tide to a node spacing.

A rule is a function of one number, its level: ``rule(level)`` is the spacing
(n_points,) in metres, NaN where the rule is undefined. The spacing grows strictly with
the level, so that one search meets a node budget with any rule.

To add a rule, write one function of `RuleInputs` and the settings, and enter it
in `RULES`.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from tidemesh.constants import GRAVITY
from tidemesh.datatypes import CoastalMesh, TruncationSeries
from tidemesh.errors import InputError
from tidemesh.sizing.radii import allowable_spacing

if TYPE_CHECKING:
    from tidemesh.sizing.settings import SizingSettings

SizeRule = Callable[[float], np.ndarray]


@dataclass(frozen=True, eq=False)
class RuleInputs:
    """What the rules may look at; the optional members only where a rule needs them."""

    mesh: CoastalMesh
    """Base mesh: depths, and the nodes at which spacings are wanted."""
    frequency: np.ndarray
    """(n_c,) rad/s."""
    series: TruncationSeries | None = None
    """For "truncation_error"."""
    curvature: np.ndarray | None = None
    """(n_c, n_points) size of the second derivatives of the elevation amplitudes (1/m),
    NaN where unknown; for "hessian" and "energy_hessian"."""


def build_rule(inputs: RuleInputs, settings: SizingSettings) -> SizeRule:
    """Make the rule that the settings name."""
    return RULES[settings.rule](inputs, settings)


def truncation_error(inputs: RuleInputs, settings: SizingSettings) -> SizeRule:
    """Spacing at which the truncation error (paper, Eq. 4) is the level, in m/s2."""
    if inputs.series is None:
        raise ValueError('rule "truncation_error" needs the truncation error series')

    def rule(level: float) -> np.ndarray:
        return allowable_spacing(
            inputs.series,
            level,
            components=settings.components,
            constituents=settings.constituents,
        )

    return rule


def hessian(inputs: RuleInputs, settings: SizingSettings) -> SizeRule:
    """Spacing by the curvature of the tidal elevation, |H|**(-exponent).

    With the exponent 1/3 the error of linear interpolation has the least mean square,
    with 1/2 that of its gradient (docs/method.md, "Why Eq. 4 is not the default").
    """
    return power_rule(
        _all_constituents(inputs.curvature),
        exponent=settings.exponent,
        floor=settings.floor,
    )


def energy_hessian(inputs: RuleInputs, settings: SizingSettings) -> SizeRule:
    """As `hessian`, the curvature weighted by sqrt(depth)."""
    weight = np.sqrt(np.maximum(inputs.mesh.depth, 0.0))
    return power_rule(
        weight * _all_constituents(inputs.curvature),
        exponent=settings.exponent,
        floor=settings.floor,
    )


def wavelength(inputs: RuleInputs, settings: SizingSettings) -> SizeRule:
    """Spacing as a part of the shortest wave length: level * sqrt(g h) * period."""
    return _proportional(wave_length(inputs.mesh.depth, inputs.frequency))


def wavelength_slope(inputs: RuleInputs, settings: SizingSettings) -> SizeRule:
    """As `wavelength`, and finer on steep beds by 2 pi h / |grad h|."""
    mesh = inputs.mesh
    slope = np.hypot(*nodal_gradient(mesh.points, mesh.triangles, mesh.depth).T)
    with np.errstate(divide="ignore"):
        topographic = 2.0 * math.pi * np.maximum(mesh.depth, 0.0) / slope
    waves = wave_length(mesh.depth, inputs.frequency)
    return _proportional(np.fmin(waves, settings.slope_weight * topographic))


def uniform(inputs: RuleInputs, settings: SizingSettings) -> SizeRule:
    """The same spacing everywhere: the level, in m."""
    return _proportional(np.ones(len(inputs.mesh.points)))


RULES: dict[str, Callable[[RuleInputs, SizingSettings], SizeRule]] = {
    "truncation_error": truncation_error,
    "hessian": hessian,
    "energy_hessian": energy_hessian,
    "wavelength": wavelength,
    "wavelength_slope": wavelength_slope,
    "uniform": uniform,
}


def power_rule(
    magnitude: ArrayLike, *, exponent: float = 1.0 / 3.0, floor: float = 1e-4
) -> SizeRule:
    """Spacing = level * (magnitude / its median)**(-exponent).

    Parameters
    ----------
    magnitude : (n_points,) array
        Any error indicator, not negative, NaN where unknown.
    exponent : float
        1/2 spreads the largest error, 1/3 the mean square, 1/4 the mean.
    floor : float
        Least magnitude, as a part of its 99th percentile: quiet bays would
        otherwise get no nodes at all.

    Returns
    -------
    SizeRule
        Its level is the spacing (m) where the magnitude is at its median.

    Raises
    ------
    InputError
        If the magnitude vanishes everywhere.
    """
    magnitude = np.asarray(magnitude, dtype=np.float64)
    known = np.isfinite(magnitude)
    high = np.percentile(magnitude[known], 99.0) if known.any() else 0.0
    if not high > 0.0:
        raise InputError(
            "the error indicator vanishes everywhere, so it cannot set sizes: "
            "check the tide, or use another [sizing] rule"
        )
    floored = np.where(known, np.maximum(magnitude, floor * high), np.nan)
    return _proportional((floored / np.nanmedian(floored)) ** -exponent)


def wave_length(depth: np.ndarray, frequency: np.ndarray) -> np.ndarray:
    """Length (m) of the shortest long wave over each depth: sqrt(g h) * period."""
    return np.sqrt(GRAVITY * np.maximum(depth, 0.0)) * (2.0 * math.pi / max(frequency))


def nodal_gradient(
    points: np.ndarray, triangles: np.ndarray, values: np.ndarray
) -> np.ndarray:
    """Gradient at the nodes, area-weighted over their triangles: (n_points, 2)."""
    corner = points[triangles]
    # The edge opposite corner i, turned by 90 degrees, is 2 * area * grad(phi_i).
    opposite = np.roll(corner, 1, axis=1) - np.roll(corner, -1, axis=1)
    turned = np.stack([-opposite[..., 1], opposite[..., 0]], axis=-1)
    twice_area_gradient = np.einsum("tc,tcd->td", values[triangles], turned)
    side, other = corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]
    twice_area = side[:, 0] * other[:, 1] - side[:, 1] * other[:, 0]
    n_points, node = len(points), triangles.ravel()
    area = np.bincount(node, np.repeat(twice_area, 3), n_points)
    total = [
        np.bincount(node, np.repeat(component, 3), n_points)
        for component in twice_area_gradient.T
    ]
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.stack(total, axis=-1) / area[:, None]


def _all_constituents(curvature: np.ndarray | None) -> np.ndarray:
    if curvature is None:
        raise ValueError("the Hessian rules need the curvature of the elevation")
    return np.linalg.norm(np.atleast_2d(curvature), axis=0)


def _proportional(pattern: np.ndarray) -> SizeRule:
    # A dry or level node says nothing: undefined, to be filled from its neighbours.
    pattern = np.where(pattern > 0.0, pattern, np.nan)
    return lambda level: level * pattern
