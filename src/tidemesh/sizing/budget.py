"""Meet a node budget."""

from __future__ import annotations

import logging
import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from tidemesh.datatypes import SizeField
from tidemesh.errors import ConvergenceError, InputError
from tidemesh.triangulation import topology

_log = logging.getLogger(__name__)

# Counts that change by less than this over a sixteenfold level do not change any more.
_STANDSTILL = 0.005
_LONGEST_STEP = math.log(16.0)


@dataclass(frozen=True)
class BudgetLevel:
    """The level that was found for a rule."""

    value: float
    count: float
    """Nodes at this level."""
    slope: float
    """d log(count) / d log(level) near it, to start a next search with."""
    evaluations: int


def expected_nodes(sizes: SizeField) -> float:
    """Number of nodes of a mesh of these sizes.

    Notes
    -----
    Euler's relation for equilateral triangles of side s: with a boundary of B nodes
    and n holes the nodes are 2 / sqrt(3) * integral(dA / s**2) + B / 2 + 1 - n, where
    B = integral(dl / s) along the boundary. Both integrals are those of the linear
    spacing, without quadrature error.
    """
    area = 2.0 / math.sqrt(3.0) * float(_inverse_square_integral(sizes).sum())
    rings = topology.boundary_rings(sizes.triangles)
    first = np.concatenate(rings)
    last = np.concatenate([np.roll(ring, -1) for ring in rings])
    length = np.linalg.norm(sizes.points[last] - sizes.points[first], axis=1)
    per_length = _inverse_mean(sizes.spacing[first], sizes.spacing[last])
    return area + 0.5 * float(length @ per_length) + 2.0 - len(rings)


def find_level(
    count: Callable[[float], float],
    nodes: int,
    *,
    guess: float = 1.0,
    slope: float = -1.0,
    tolerance: float = 0.01,
    least: float | None = None,
    maximum_evaluations: int = 20,
) -> BudgetLevel:
    """Level of a rule at which the mesh has the wanted number of nodes.

    Parameters
    ----------
    count : function
        Nodes at a level; falls with the level, apart from noise.
    nodes : int
        The budget.
    guess, slope : float
        Where to start, and the expected d log(count) / d log(level), negative. A
        former search, for instance with `expected_nodes`, gives both.
    tolerance : float
        Relative; at least one node.
    least : float, optional
        Number of nodes that no level can go below, if known.
    maximum_evaluations : int
        Bound on the calls of `count`.

    Returns
    -------
    BudgetLevel

    Raises
    ------
    InputError
        If the budget is below what the boundary and the limits need, or above what
        the least spacing allows.
    ConvergenceError
        If the counts jump over the budget.
    """
    if least is not None and nodes < least / (1.0 + tolerance):
        raise _budget_too_low(nodes, least)
    # Nodes come one by one: of a small budget no count need be within the tolerance.
    tolerance = max(tolerance, 1.01 / nodes)
    tried: dict[float, float] = {}
    counts: dict[float, float] = {}
    x = math.log(guess)
    for _ in range(maximum_evaluations):
        counts[x] = count(math.exp(x))
        tried[x] = math.log(max(counts[x], 1.0) / nodes)
        best = min(tried, key=lambda place: abs(tried[place]))
        _log.debug("level %.6g: %g of %d nodes", math.exp(x), counts[x], nodes)
        if abs(counts[x] / nodes - 1.0) <= tolerance:
            break
        _check_standstill(tried, counts, x, nodes)
        x = _next_place(tried, slope)
        if x in tried:
            break
    if abs(counts[best] / nodes - 1.0) > tolerance:
        raise ConvergenceError(
            f"no level gives {nodes} nodes within {tolerance:.1%}: the nearest count "
            f"is {counts[best]:.0f}; ask for that number, or for a wider tolerance"
        )
    return BudgetLevel(
        math.exp(best), counts[best], _slope_near(tried, best, slope), len(tried)
    )


def _next_place(tried: dict[float, float], slope: float) -> float:
    """Secant steps towards the budget, kept inside the bracket once there is one."""
    above = [x for x in tried if tried[x] > 0.0]
    below = [x for x in tried if tried[x] <= 0.0]
    if not (above and below):
        edge = max(above) if above else min(below)
        step = -tried[edge] / _slope_near(tried, edge, slope)
        # Each further step on the same side is at least twice the former.
        reach = max(tried) - min(tried)
        step = math.copysign(max(abs(step), 2.0 * reach), step)
        return edge + min(max(step, -_LONGEST_STEP), _LONGEST_STEP)
    # Noise may have mixed the two sides: the innermost crossing counts.
    low, high = max(above), min(below)
    if low > high:
        low = max((x for x in above if x < high), default=low)
        low, high = min(low, high), max(low, high)
    best = min((low, high), key=lambda place: abs(tried[place]))
    secant = best - tried[best] * (high - low) / (tried[high] - tried[low])
    # An end that stays would stall the secant: after a few tries, halve instead.
    margin = 0.02 if len(tried) < 8 else 0.3
    room = margin * (high - low)
    return min(max(secant, low + room), high - room)


def _slope_near(tried: dict[float, float], place: float, slope: float) -> float:
    """Secant slope to the nearest other place, within a factor 4 of the expected."""
    others = [x for x in tried if x != place]
    if not others:
        return slope
    nearest = min(others, key=lambda x: abs(x - place))
    secant = (tried[nearest] - tried[place]) / (nearest - place)
    return min(max(secant, 4.0 * slope), 0.25 * slope)


def _check_standstill(
    tried: dict[float, float], counts: dict[float, float], x: float, nodes: int
) -> None:
    for other in tried:
        if abs(other - x) < 0.999 * _LONGEST_STEP:
            continue
        if abs(tried[other] - tried[x]) > _STANDSTILL or tried[x] * tried[other] < 0.0:
            continue
        if tried[x] > 0.0 and x > other:
            raise _budget_too_low(nodes, counts[x])
        if tried[x] < 0.0 and x < other:
            raise InputError(
                f"[sizing] nodes = {nodes} is above what the limits allow: the finest "
                f"mesh has {counts[x]:.0f} nodes; lower min_m, or the budget"
            )


def _budget_too_low(nodes: int, least: float) -> InputError:
    return InputError(
        f"[sizing] nodes = {nodes} is below what the boundary and the limits need: "
        f"at least {least:.0f} nodes; raise the budget or max_m, coarsen the "
        "boundary, or let fewer elements span the channels"
    )


def _inverse_square_integral(sizes: SizeField) -> np.ndarray:
    """Integral of 1 / s**2 over every triangle, s linear: (n_triangles,)."""
    corner = sizes.points[sizes.triangles]
    side, other = corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]
    twice_area = np.abs(side[:, 0] * other[:, 1] - side[:, 1] * other[:, 0])
    # Hermite-Genocchi: the integral is twice the area times the second divided
    # difference of -log, whose second derivative is 1 / s**2.
    low, middle, high = np.sort(sizes.spacing[sizes.triangles], axis=1).T
    spread = (high - low) / middle
    flat = spread < 0.02
    with np.errstate(invalid="ignore", divide="ignore"):
        divided = (_inverse_mean(low, middle) - _inverse_mean(middle, high)) / (
            high - low
        )
    # Where the sizes are nearly equal the difference cancels: expand about the mean.
    mean = (low + middle + high) / 3.0
    variance = ((low - mean) ** 2 + (middle - mean) ** 2 + (high - mean) ** 2) / mean**2
    series = 0.5 / mean**2 * (1.0 + 0.25 * variance)
    return twice_area * np.where(flat, series, divided)


def _inverse_mean(first: np.ndarray, last: np.ndarray) -> np.ndarray:
    """Mean of 1 / s between two ends, s linear: log(last / first) / (last - first)."""
    ratio = (last - first) / first
    small = np.abs(ratio) < 1e-9
    safe = np.where(small, 1.0, ratio)
    return np.where(small, 1.0 - 0.5 * ratio, np.log1p(safe) / safe) / first
