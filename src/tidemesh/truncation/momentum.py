"""Truncation error of the momentum equations as a series in the spacing (Eq. 4)."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Literal, Protocol

import numpy as np
from numpy.typing import ArrayLike

from tidemesh.datatypes import CoastalMesh, TideSolution, TruncationSeries
from tidemesh.triangulation.topology import boundary_nodes, edges
from tidemesh.truncation.molecules import lattice_values
from tidemesh.truncation.recovery import PolynomialFit
from tidemesh.truncation.settings import TruncationSettings

# Coefficients of g * d^(a+b) e / dx^a dy^b in the fourth-order terms; docs/method.md.
ELEVATION_FOURTH_X = {(5, 0): 11.0 / 120.0, (3, 2): 1.0 / 12.0, (1, 4): 1.0 / 8.0}
ELEVATION_FOURTH_Y = {(4, 1): 1.0 / 24.0, (2, 3): 1.0 / 4.0, (0, 5): 3.0 / 40.0}


class Derivatives(Protocol):
    """Derivatives of k fields at n nodes, however they were found."""

    known: np.ndarray

    def derivative(self, a: int, b: int) -> np.ndarray:
        """Derivative a times in x and b times in y: (k, n)."""


def momentum_series(
    mesh: CoastalMesh,
    tide: TideSolution,
    settings: TruncationSettings | None = None,
    *,
    progress: Callable[[float], None] | None = None,
) -> TruncationSeries:
    """Localised truncation error of the linear momentum equations.

    Parameters
    ----------
    mesh : CoastalMesh
        The mesh on which the tide was computed.
    tide : TideSolution
    settings : TruncationSettings, optional
    progress : callable, optional
        Called with the fraction done.

    Returns
    -------
    TruncationSeries
        Coefficients of s**2 and s**4 with **s the node spacing** in either convention:
        with ``delta = "spacing"`` those of Eq. 4 as they stand, with ``"half_edge"``
        (Delta = s / 2) a quarter and a sixteenth of them.

    Notes
    -----
    With R_x = q u - f v + g e_x, R_y = q v + f u + g e_y and q = i w + tau, the error
    of the consistent P1 Galerkin equations on equilateral triangles is, with D half an
    edge (docs/method.md)::

        tau_x = D^2 / 2 lap R_x + D^4 [ 1/8 lap^2 (q u - f v)
                + g (11/120 e_5x + 1/12 e_3x2y + 1/8 e_x4y) ]
        tau_y = D^2 / 2 lap R_y + D^4 [ 1/8 lap^2 (q v + f u)
                + g (1/24 e_4xy + 1/4 e_2x3y + 3/40 e_5y) ]

    and tau_x + tau_y is Eq. 4 where tau is constant and f zero. The factors q and f are
    taken at the nodes, as the equations' products are.
    """
    settings = TruncationSettings() if settings is None else settings
    n_c, n_points = tide.elevation.shape
    if n_points != len(mesh.points):
        raise ValueError(
            f"the tide has {n_points} nodes, the mesh {len(mesh.points)} points"
        )
    fields = np.concatenate([*_momentum(tide), tide.elevation])
    second = np.empty((n_c, 2, n_points), dtype=np.complex128)
    fourth = np.empty_like(second)
    known = np.empty(n_points, dtype=bool)
    for nodes, found in _derivatives(mesh, fields, settings):
        second[:, :, nodes], fourth[:, :, nodes] = _components(found, n_c, tide.gravity)
        known[nodes] = found.known
        if progress is not None:
            progress(nodes.stop / n_points)

    known &= ~_near_boundary(mesh.triangles, n_points, settings.skip_rings)

    if settings.components == "sum":
        second = second.sum(axis=1, keepdims=True)
        fourth = fourth.sum(axis=1, keepdims=True)
    if settings.delta == "half_edge":
        second /= 4.0
        fourth /= 16.0
    second[..., ~known] = 0.0
    fourth[..., ~known] = 0.0
    return TruncationSeries(second=second, fourth=fourth, known=known)


def error_at(
    series: TruncationSeries,
    spacing: ArrayLike,
    norm: Literal["vector", "largest"] = "vector",
) -> np.ndarray:
    """Magnitude of the truncation error at a node spacing.

    Parameters
    ----------
    series : TruncationSeries
    spacing : float or (n_points,) array
        m.
    norm : {"vector", "largest"}
        Over the components: root of the sum of squares, or the largest.

    Returns
    -------
    error : (n_c, n_points) array
        m/s2, NaN where the series is not known.
    """
    squared = np.broadcast_to(spacing, series.known.shape) ** 2
    error = np.abs(series.second * squared + series.fourth * squared**2)
    if norm == "vector":
        magnitude = np.sqrt((error**2).sum(axis=1))
    elif norm == "largest":
        magnitude = error.max(axis=1)
    else:
        raise ValueError(f'norm must be "vector" or "largest", got "{norm}"')
    magnitude[:, ~series.known] = np.nan
    return magnitude


def _near_boundary(triangles: np.ndarray, n_points: int, rings: int) -> np.ndarray:
    """Nodes (n_points,) of the first rings along the boundary."""
    near = np.zeros(n_points, dtype=bool)
    if rings > 0:
        near[boundary_nodes(triangles)] = True
    for _ in range(1, rings):
        near[triangles[near[triangles].any(axis=1)]] = True
    return near


def _momentum(tide: TideSolution) -> tuple[np.ndarray, np.ndarray]:
    """Inertia, friction and rotation: q u - f v and q v + f u, (n_c, n_points)."""
    u, v = tide.velocity[..., 0], tide.velocity[..., 1]
    q = 1j * tide.frequency[:, None] + tide.friction
    if tide.coriolis is None:
        return q * u, q * v
    return q * u - tide.coriolis * v, q * v + tide.coriolis * u


def _derivatives(
    mesh: CoastalMesh, fields: np.ndarray, settings: TruncationSettings
) -> Iterator[tuple[slice, Derivatives]]:
    fit = PolynomialFit(
        mesh.points,
        mesh.triangles,
        settings.degree,
        patch_points=settings.patch_points,
    )
    if settings.derivatives == "least_squares":
        return fit.fit_in_chunks(fields)
    spacing = settings.lattice_spacing_m
    if spacing is None:
        start, end = edges(mesh.triangles).T
        spacing = float(np.median(np.hypot(*(mesh.points[start] - mesh.points[end]).T)))
    return lattice_values(fit, mesh.triangles, fields, spacing)


def _components(
    found: Derivatives, n_c: int, gravity: float
) -> tuple[np.ndarray, np.ndarray]:
    """Coefficients of D^2 and D^4, x and y: two (n_c, 2, n)."""

    def inertia(a: int, b: int) -> np.ndarray:
        # (n_c, 2, n): q u - f v and q v + f u.
        return np.stack(np.split(found.derivative(a, b)[: 2 * n_c], 2), axis=1)

    def elevation(a: int, b: int) -> np.ndarray:
        return found.derivative(a, b)[2 * n_c :]

    gradient = np.stack(
        [elevation(3, 0) + elevation(1, 2), elevation(2, 1) + elevation(0, 3)], axis=1
    )
    second = 0.5 * (inertia(2, 0) + inertia(0, 2) + gravity * gradient)
    remainder = np.stack(
        [
            sum(factor * elevation(*order) for order, factor in table.items())
            for table in (ELEVATION_FOURTH_X, ELEVATION_FOURTH_Y)
        ],
        axis=1,
    )
    biharmonic = inertia(4, 0) + 2.0 * inertia(2, 2) + inertia(0, 4)
    fourth = biharmonic / 8.0 + gravity * remainder
    return second, fourth
