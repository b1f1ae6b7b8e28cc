"""Sparse direct solution: factors once, many right-hand sides."""

from __future__ import annotations

import logging
from functools import cache

import numpy as np
import scipy.sparse as sparse
from scipy.sparse.linalg import splu
from threadpoolctl import ThreadpoolController

from tidemesh.errors import EngineError
from tidemesh.tides.frequency_domain import pardiso

logger = logging.getLogger(__name__)

RESIDUAL_LIMIT = 1.0e-10
"""Relative residual above which the factors are formed again with pivoting."""

REFINE_ABOVE = 1.0e-12
"""Relative residual above which a step of iterative refinement is tried."""

SOLVERS = ("superlu", "pardiso")


def available_solvers() -> tuple[str, ...]:
    """Names of the sparse solvers that are installed, the one always there first."""
    return SOLVERS if pardiso.find_library() is not None else SOLVERS[:1]


class Factorisation:
    """Factors of a sparse matrix with symmetric pattern.

    Parameters
    ----------
    matrix : (n, n) csc array
        Unknowns in a fill-reducing order, which is kept.
    solver : {"superlu", "pardiso"}
        scipy's SuperLU, or PARDISO of Intel MKL where that is installed: half the work
        and two thirds of the memory if the matrix equals its transpose.
    threads : int
        Threads of PARDISO.

    Raises
    ------
    EngineError
        If the solver is not installed, or the matrix is singular.

    Notes
    -----
    Diagonal pivots are taken first: they are safe for these matrices and keep the
    order. Every solution is checked by its residual and refined where that helps; the
    factors are formed again with pivoting if it stays too large.

    SuperLU's linear algebra library is held to one thread: its threads cost ten times
    the work on the small dense blocks that occur here. The limit is one of the whole
    process: who solves in several threads at once must hold it around all of them.
    """

    def __init__(
        self, matrix: sparse.csc_array, solver: str = "superlu", *, threads: int = 1
    ):
        if solver not in SOLVERS:
            raise EngineError(
                f'there is no sparse solver "{solver}"; known are ' + ", ".join(SOLVERS)
            )
        matrix.sum_duplicates()
        self.matrix = matrix
        self.solver = solver
        self.symmetric = _is_symmetric(matrix)
        self._threads = threads
        self._pivoting = False
        self._factors = self._factorise()

    def solve(self, rhs: np.ndarray, *, transpose: bool = False) -> np.ndarray:
        """Solve A x = b, or its transpose.

        Parameters
        ----------
        rhs : (n,) or (n, k) complex array
            Many columns at once cost a third to a half of one after another.
        transpose : bool
            Solve with the transposed (not conjugated) matrix, for adjoints.

        Raises
        ------
        EngineError
            If the matrix is singular.
        """
        rhs = np.asarray(rhs, dtype=np.complex128)
        # Rows of a symmetric matrix are its columns; SuperLU is slower transposed.
        transpose = transpose and not self.symmetric
        solution, residual = self._attempt(rhs, transpose)
        if not residual <= RESIDUAL_LIMIT and not self._pivoting:
            logger.warning("residual %.1e: factors formed again, pivoting", residual)
            self._pivoting = True
            self._factors = self._factorise()
            solution, residual = self._attempt(rhs, transpose)
        if not residual <= RESIDUAL_LIMIT:
            raise EngineError(
                "the tide equations are singular or nearly so: the relative residual "
                f"is {residual:.1e}; friction keeps them regular"
            )
        return solution

    def _factorise(self) -> _SuperLU | pardiso.Pardiso:
        if self.solver == "pardiso":
            return pardiso.Pardiso(
                self.matrix,
                symmetric=self.symmetric,
                pivoting=self._pivoting,
                threads=self._threads,
            )
        return _SuperLU(self.matrix, pivoting=self._pivoting)

    def _attempt(self, rhs: np.ndarray, transpose: bool) -> tuple[np.ndarray, float]:
        """A solution, refined once if that helps, and its relative residual."""
        solution = self._factors.solve(rhs, transpose=transpose)
        rest, residual = self._residual(rhs, solution, transpose)
        if residual > REFINE_ABOVE and np.isfinite(residual):
            better = solution + self._factors.solve(rest, transpose=transpose)
            _, improved = self._residual(rhs, better, transpose)
            if improved < residual:
                return better, improved
        return solution, residual

    def _residual(
        self, rhs: np.ndarray, solution: np.ndarray, transpose: bool
    ) -> tuple[np.ndarray, float]:
        """Return b - A x, and the largest relative residual of any column."""
        matrix = self.matrix.T if transpose else self.matrix
        rest = rhs - matrix @ solution
        error, size = np.linalg.norm(rest, axis=0), np.linalg.norm(rhs, axis=0)
        # A column of zeros has the solution zero; anything else is wrong.
        relative = error / np.where(size > 0.0, size, 1.0)
        return rest, float(np.max(relative, initial=0.0))


class _SuperLU:
    """SuperLU's factors, the interface that `Factorisation` expects of a solver."""

    def __init__(self, matrix: sparse.csc_array, *, pivoting: bool):
        options = {} if pivoting else {"SymmetricMode": True}
        try:
            with _libraries().limit(limits=1, user_api="blas"):
                self._factors = splu(
                    matrix,
                    permc_spec="COLAMD" if pivoting else "NATURAL",
                    diag_pivot_thresh=1.0 if pivoting else 0.001,
                    options=options,
                )
        except RuntimeError as error:
            raise EngineError(
                f"the tide equations cannot be solved: {error}; look for nodes "
                "without triangles, or use friction"
            ) from error

    def solve(self, rhs: np.ndarray, *, transpose: bool) -> np.ndarray:
        with _libraries().limit(limits=1, user_api="blas"):
            return self._factors.solve(rhs, "T" if transpose else "N")


@cache
def _libraries() -> ThreadpoolController:
    """The linear algebra libraries of the process: looking for them takes 3 ms."""
    return ThreadpoolController()


def _is_symmetric(matrix: sparse.csc_array) -> bool:
    """Whether a matrix with sorted indices equals its transpose exactly."""
    other = matrix.T.tocsc()
    return (
        np.array_equal(matrix.indptr, other.indptr)
        and np.array_equal(matrix.indices, other.indices)
        and np.array_equal(matrix.data, other.data)
    )
