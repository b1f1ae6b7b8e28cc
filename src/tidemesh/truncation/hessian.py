"""Second derivatives of nodal values, and the sizing indicator made of them."""

from __future__ import annotations

from collections.abc import Callable
from typing import Literal

import numpy as np

from tidemesh.truncation.recovery import PolynomialFit


def recovered_hessian(
    points: np.ndarray,
    triangles: np.ndarray,
    values: np.ndarray,
    *,
    degree: int = 3,
    patch_points: int | None = None,
    progress: Callable[[float], None] | None = None,
) -> np.ndarray:
    """Second derivatives at every node by local polynomials, up to the boundary.

    Parameters
    ----------
    points : (n_points, 2) float array
        m.
    triangles : (n_triangles, 3) int array
    values : (k, n_points) float or complex array
    degree : int
        Of the polynomials; the Hessian is of order degree - 1 for smooth values.
    patch_points : int, optional
        As for `recovery.PolynomialFit`.
    progress : callable, optional
        Called with the fraction done.

    Returns
    -------
    hessian : (k, n_points, 3) array
        xx, xy, yy, in units of the values per m2; NaN at nodes without neighbours. In
        channels a single element wide the curvature across is zero.
    """
    values = np.atleast_2d(np.asarray(values))
    kind = np.complex128 if np.iscomplexobj(values) else np.float64
    hessian = np.empty((len(values), len(points), 3), dtype=kind)
    fit = PolynomialFit(points, triangles, degree, patch_points=patch_points)
    for nodes, found in fit.fit_in_chunks(values):
        for column, order in enumerate(((2, 0), (1, 1), (0, 2))):
            hessian[:, nodes, column] = found.derivative(*order)
        hessian[:, nodes][:, found.rank <= 2] = np.nan
        if progress is not None:
            progress(nodes.stop / len(points))
    return hessian


def hessian_magnitude(
    points: np.ndarray,
    triangles: np.ndarray,
    elevation: np.ndarray,
    *,
    depth: np.ndarray | None = None,
    norm: Literal["frobenius", "spectral"] = "frobenius",
) -> np.ndarray:
    """Curvature of complex amplitudes, whatever their phase.

    Parameters
    ----------
    points : (n_points, 2) float array
        m.
    triangles : (n_triangles, 3) int array
    elevation : (n_c, n_points) complex array
        m.
    depth : (n_points,) float array, optional
        m. If given, the curvature is weighted by sqrt(depth), as potential energy
        weighs against its flux.
    norm : {"frobenius", "spectral"}
        Root of the sum of squares, or the largest curvature in any direction.

    Returns
    -------
    magnitude : (n_c, n_points) array
        1/m, or m**(-1/2) with depths; NaN where unknown.
    """
    hessian = recovered_hessian(points, triangles, elevation)
    square = np.abs(hessian) ** 2
    xx, xy, yy = np.moveaxis(square, -1, 0)
    if norm == "frobenius":
        magnitude = np.sqrt(xx + 2.0 * xy + yy)
    elif norm == "spectral":
        # Largest eigenvalue of Re(conj(H) H), a real symmetric matrix.
        mixed = (hessian[..., 0].conj() * hessian[..., 1]).real
        mixed += (hessian[..., 1].conj() * hessian[..., 2]).real
        half_difference = 0.5 * (xx - yy)
        mean = 0.5 * (xx + yy) + xy
        magnitude = np.sqrt(mean + np.hypot(half_difference, mixed))
    else:
        raise ValueError(f'norm must be "frobenius" or "spectral", got "{norm}"')
    if depth is not None:
        magnitude = magnitude * np.sqrt(np.maximum(depth, 0.0))
    return magnitude
