"""Sparse direct solution: factors once, many right-hand sides."""

from __future__ import annotations

import logging

import numpy as np
import scipy.sparse as sparse
from scipy.sparse.linalg import SuperLU, splu
from threadpoolctl import threadpool_limits

from tidemesh.errors import EngineError

logger = logging.getLogger(__name__)

RESIDUAL_LIMIT = 1.0e-10
"""Relative residual above which the factors are formed again with pivoting."""


class Factorisation:
    """LU factors of a sparse matrix with symmetric pattern.

    Parameters
    ----------
    matrix : (n, n) csc array
        Unknowns in a fill-reducing order.

    Notes
    -----
    Diagonal pivots are taken first: they are safe for these matrices and keep the
    order. Every solution is checked by its residual, and the factors are formed
    again with full partial pivoting if it is too large.

    The linear algebra library is held to one thread: its threads cost ten times the
    work on the small dense blocks that occur here.
    """

    def __init__(self, matrix: sparse.csc_array):
        self.matrix = matrix
        self._factors = self._factorise(pivoting=False)
        self._pivoting = False

    def solve(self, rhs: np.ndarray, *, transpose: bool = False) -> np.ndarray:
        """Solve A x = b, or its transpose.

        Parameters
        ----------
        rhs : (n,) or (n, k) complex array
        transpose : bool
            Solve with the transposed (not conjugated) matrix, for adjoints.

        Raises
        ------
        EngineError
            If the matrix is singular.
        """
        solution, residual = self._attempt(rhs, transpose)
        if not residual <= RESIDUAL_LIMIT and not self._pivoting:
            logger.warning("residual %.1e: factors formed again, pivoting", residual)
            self._factors = self._factorise(pivoting=True)
            self._pivoting = True
            solution, residual = self._attempt(rhs, transpose)
        if not residual <= RESIDUAL_LIMIT:
            raise EngineError(
                "the tide equations are singular or nearly so: the relative residual "
                f"is {residual:.1e}; friction keeps them regular"
            )
        return solution

    def _factorise(self, *, pivoting: bool) -> SuperLU:
        options = {} if pivoting else {"SymmetricMode": True}
        try:
            with threadpool_limits(1, "blas"):
                return splu(
                    self.matrix,
                    permc_spec="COLAMD" if pivoting else "NATURAL",
                    diag_pivot_thresh=1.0 if pivoting else 0.001,
                    options=options,
                )
        except RuntimeError as error:
            raise EngineError(
                f"the tide equations cannot be solved: {error}; look for nodes "
                "without triangles, or use friction"
            ) from error

    def _attempt(self, rhs: np.ndarray, transpose: bool) -> tuple[np.ndarray, float]:
        with threadpool_limits(1, "blas"):
            solution = self._factors.solve(rhs, "T" if transpose else "N")
        matrix = self.matrix.T if transpose else self.matrix
        size = np.linalg.norm(rhs)
        error = np.linalg.norm(matrix @ solution - rhs)
        return solution, float(error / size) if size > 0.0 else 0.0
