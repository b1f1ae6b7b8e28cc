"""Truncation error of the wave equation, in which the bathymetry acts."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from tidemesh.datatypes import CoastalMesh, TideSolution
from tidemesh.truncation.recovery import PolynomialFit


def wave_equation_error(
    mesh: CoastalMesh,
    tide: TideSolution,
    *,
    degree: int = 4,
    patch_points: int | None = None,
    progress: Callable[[float], None] | None = None,
) -> np.ndarray:
    """Coefficient S of the second-order error of the P1 tide, S (s / 2)**2.

    Parameters
    ----------
    mesh : CoastalMesh
        The mesh on which the tide was computed, with depths.
    tide : TideSolution
    degree : int
        Of the local polynomials, 3 or more: third derivatives of the depth enter.
    patch_points : int, optional
        As for `recovery.PolynomialFit`; more smooth rough bathymetry.
    progress : callable, optional
        Called with the fraction done.

    Returns
    -------
    error : (n_c, n_points) complex array
        1/(m s), NaN where unknown.

    Notes
    -----
    The equation is i w e - div(K grad e) = 0 with K = [[k, a], [-a, k]],
    k = g h q / (q^2 + f^2), a = g h f / (q^2 + f^2), q = i w + tau, discretised with
    the consistent mass matrix and element means of K on equilateral triangles. The
    equation itself is used to leave only second derivatives of e. With H the Hessian,
    J(a, b) = a_x b_y - a_y b_x and L = lap e::

        k L = i w e - grad k . grad e - J(a, e)
        S = i w L / 4 + grad k . grad L / 4 + (H_k : H_e - lap k L) / 3
            - grad(lap k) . grad e / 4 - J(a, L) / 4 - J(lap a, e) / 4
    """
    if degree < 3:
        raise ValueError(f"degree must be 3 or more, got {degree}")
    n_c, n_points = tide.elevation.shape
    if n_points != len(mesh.points):
        raise ValueError(
            f"the tide has {n_points} nodes, the mesh {len(mesh.points)} points"
        )
    q = 1j * tide.frequency[:, None] + tide.friction
    f = 0.0 if tide.coriolis is None else tide.coriolis
    conductance = tide.gravity * mesh.depth / (q**2 + f**2)
    fields = [tide.elevation, conductance * q]
    if tide.coriolis is not None:
        fields.append(conductance * f)

    error = np.empty((n_c, n_points), dtype=np.complex128)
    fit = PolynomialFit(mesh.points, mesh.triangles, degree, patch_points=patch_points)
    for nodes, found in fit.fit_in_chunks(np.concatenate(fields)):
        elevation, along, *across = (
            _Field(values[:, nodes], found.derivative, slice(i * n_c, (i + 1) * n_c))
            for i, values in enumerate(fields)
        )
        error[:, nodes] = _second_order(
            1j * tide.frequency[:, None], elevation, along, *across
        )
        error[:, nodes][:, ~found.known] = np.nan
        if progress is not None:
            progress(nodes.stop / n_points)
    return error


class _Field:
    """Values and recovered gradients of one of the fields."""

    def __init__(
        self,
        value: np.ndarray,
        derivative: Callable[[int, int], np.ndarray],
        rows: slice,
    ):
        # As given: a fit may pass through zero where the bed is rough.
        self.value = value
        self._derivative = derivative
        self._rows = rows

    def __getitem__(self, order: tuple[int, int]) -> np.ndarray:
        return self._derivative(*order)[self._rows]

    @property
    def gradient(self) -> np.ndarray:
        return np.stack([self[1, 0], self[0, 1]])

    @property
    def hessian(self) -> np.ndarray:
        mixed = self[1, 1]
        return np.stack([np.stack([self[2, 0], mixed]), np.stack([mixed, self[0, 2]])])

    @property
    def laplacian(self) -> np.ndarray:
        return self[2, 0] + self[0, 2]

    @property
    def gradient_of_laplacian(self) -> np.ndarray:
        return np.stack([self[3, 0] + self[1, 2], self[2, 1] + self[0, 3]])


def _second_order(
    i_w: np.ndarray, e: _Field, ks: _Field, ka: _Field | None = None
) -> np.ndarray:
    """S of `wave_equation_error`, with L and grad L from the equation itself."""
    slope, curvature = e.gradient, e.hessian
    steepness, bend = ks.gradient, ks.hessian
    laplacian = i_w * e.value - _dot(steepness, slope)
    gradient = i_w * slope - _times(bend, slope) - _times(curvature, steepness)
    if ka is not None:
        laplacian = laplacian - _cross(ka.gradient, slope)
        gradient = gradient - _times(ka.hessian, _turned(slope))
        gradient = gradient + _times(curvature, _turned(ka.gradient))
    laplacian = laplacian / ks.value
    gradient = (gradient - laplacian * steepness) / ks.value
    error = (
        0.25 * i_w * laplacian
        + 0.25 * _dot(steepness, gradient)
        + (_contract(bend, curvature) - ks.laplacian * laplacian) / 3.0
        - 0.25 * _dot(ks.gradient_of_laplacian, slope)
    )
    if ka is not None:
        error = error - 0.25 * _cross(ka.gradient, gradient)
        error = error - 0.25 * _cross(ka.gradient_of_laplacian, slope)
    return error


def _dot(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return a[0] * b[0] + a[1] * b[1]


def _cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return a[0] * b[1] - a[1] * b[0]


def _turned(a: np.ndarray) -> np.ndarray:
    return np.stack([a[1], -a[0]])


def _times(matrix: np.ndarray, vector: np.ndarray) -> np.ndarray:
    return np.stack([_dot(matrix[0], vector), _dot(matrix[1], vector)])


def _contract(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return _dot(a[0], b[0]) + _dot(a[1], b[1])
