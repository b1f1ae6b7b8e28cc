"""Intel MKL's sparse solver PARDISO, where the library is installed.

The package ``mkl`` brings one library for all processors of the x86-64 family. It is
loaded when the first matrix is factorised with it, never before.
"""

from __future__ import annotations

import ctypes
import ctypes.util
import importlib.metadata
import re
import sys
import weakref
from functools import cache
from pathlib import Path

import numpy as np
import scipy.sparse as sparse

from tidemesh.errors import EngineError

_FILE = re.compile(r"(lib)?mkl_rt(\.\d+)?\.(so|dll|dylib)(\.\d+)?")

COMPLEX_SYMMETRIC = 6
COMPLEX_UNSYMMETRIC = 13

_FACTORISE, _SOLVE, _RELEASE = 12, 33, -1

_MESSAGES = {
    -2: "not enough memory",
    -3: "the elimination order is not a permutation",
    -4: "a pivot is zero",
    -8: "the factors are too large for its integers",
}


@cache
def find_library() -> str | None:
    """Name of MKL's runtime library to load, or None where it is not installed."""
    try:
        files = importlib.metadata.files("mkl") or ()
    except importlib.metadata.PackageNotFoundError:
        files = ()
    installed = [f.locate() for f in files if _FILE.fullmatch(f.name)]
    # conda's package has no list of files; it puts them where the interpreter looks.
    for folder in (Path(sys.prefix, "lib"), Path(sys.prefix, "Library", "bin")):
        if folder.is_dir():
            installed += [f for f in folder.iterdir() if _FILE.fullmatch(f.name)]
    for path in sorted(installed, key=str):
        if Path(path).exists():
            return str(Path(path).resolve())
    return ctypes.util.find_library("mkl_rt")


@cache
def load_library() -> ctypes.CDLL:
    """MKL's runtime library.

    Raises
    ------
    EngineError
        If it is not installed, or cannot be loaded.
    """
    name = find_library()
    if name is None:
        raise EngineError(
            'solver = "pardiso" needs Intel MKL, which is not installed: '
            "pip install mkl (processors of the x86-64 family), or use "
            'solver = "superlu"'
        )
    try:
        library = ctypes.CDLL(name)
        # Of the two interfaces the one whose integers are 64 bits wide whatever the
        # environment says; factors of large meshes have more than 2**31 entries.
        library.pardiso_64.restype = None
        library.MKL_Set_Num_Threads_Local.restype = ctypes.c_int
    except (OSError, AttributeError) as error:
        raise EngineError(
            f"Intel MKL is installed but cannot be used: {error}; install it anew "
            '(pip install --force-reinstall mkl), or use solver = "superlu"'
        ) from error
    return library


class Pardiso:
    """Factors of a complex sparse matrix with symmetric pattern.

    Parameters
    ----------
    matrix : (n, n) csc array, complex
        Unknowns in a fill-reducing order, which is kept; indices sorted, the diagonal
        stored.
    symmetric : bool
        The matrix equals its transpose: half the work and memory.
    pivoting : bool
        Scale and permute large entries onto the diagonal first.
    threads : int
        Threads of the library.

    Raises
    ------
    EngineError
        If the library is absent, memory runs out, or the matrix is singular.
    """

    def __init__(
        self,
        matrix: sparse.csc_array,
        *,
        symmetric: bool,
        pivoting: bool = False,
        threads: int = 1,
    ):
        library = load_library()
        n = matrix.shape[0]
        self._symmetric = symmetric and not pivoting
        if self._symmetric:
            # Below the diagonal by columns is above it by rows.
            columns = np.repeat(np.arange(n), np.diff(matrix.indptr))
            kept = matrix.indices >= columns
            starts = np.concatenate([[0], np.cumsum(np.bincount(columns[kept]))])
            indices, values = matrix.indices[kept], matrix.data[kept]
        else:
            # Columns read as rows: the factors are those of the transpose.
            starts, indices, values = matrix.indptr, matrix.indices, matrix.data
        kind = COMPLEX_SYMMETRIC if self._symmetric else COMPLEX_UNSYMMETRIC
        options = np.zeros(64, dtype=np.int64)
        options[0] = 1  # nothing by default
        options[4] = 1  # our elimination order
        options[9] = 8 if self._symmetric else 13  # pivots below 10**-this are raised
        options[10] = options[12] = int(pivoting)
        options[20] = 1  # pivots of one and two rows
        options[34] = 1  # indices count from zero
        self._options = options
        self._call = _Call(
            library,
            threads,
            kind,
            np.ascontiguousarray(values, dtype=np.complex128),
            np.ascontiguousarray(starts, dtype=np.int64),
            np.ascontiguousarray(indices, dtype=np.int64),
        )
        release = weakref.finalize(self, self._call, _RELEASE, options)
        release.atexit = False
        self._call(_FACTORISE, options)

    def solve(self, rhs: np.ndarray, *, transpose: bool) -> np.ndarray:
        """Solve A x = b, or its transpose, for (n,) or (n, k) complex b."""
        rhs = np.asarray(rhs, dtype=np.complex128, order="F")
        solution = np.empty_like(rhs, order="F")
        self._options[11] = 0 if transpose or self._symmetric else 2
        self._call(_SOLVE, self._options, rhs, solution)
        return solution


class _Call:
    """One matrix in the hands of the library; does not refer to its owner."""

    def __init__(self, library, threads, kind, values, starts, indices):
        self._library, self._threads, self._kind = library, threads, kind
        self._matrix = values, starts, indices
        self._order = np.arange(len(starts) - 1, dtype=np.int64)
        self._handle = np.zeros(64, dtype=np.int64)

    def __call__(self, phase, options, rhs=None, solution=None) -> None:
        if rhs is None:
            rhs = solution = np.empty(0, dtype=np.complex128)
        columns = rhs.shape[1] if rhs.ndim == 2 else 1
        one, kind, step, size, many, silent, error = (
            ctypes.c_int64(value)
            for value in (1, self._kind, phase, len(self._order), columns, 0, 0)
        )
        arrays = (*self._matrix, self._order)
        previous = self._library.MKL_Set_Num_Threads_Local(self._threads)
        try:
            self._library.pardiso_64(
                _pointer(self._handle),
                *(ctypes.byref(number) for number in (one, one, kind, step, size)),
                *(_pointer(array) for array in arrays),
                ctypes.byref(many),
                _pointer(options),
                ctypes.byref(silent),
                _pointer(rhs),
                _pointer(solution),
                ctypes.byref(error),
            )
        finally:
            self._library.MKL_Set_Num_Threads_Local(previous)
        if error.value and phase != _RELEASE:
            reason = _MESSAGES.get(error.value, f"error {error.value}")
            raise EngineError(f"PARDISO cannot solve the tide equations: {reason}")


def _pointer(array: np.ndarray) -> ctypes.c_void_p:
    return ctypes.c_void_p(array.ctypes.data)
