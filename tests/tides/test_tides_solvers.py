"""Sparse solvers: one answer whichever is used."""

import subprocess
import sys

import numpy as np
import pytest
import scipy.sparse as sparse

from tidemesh.errors import EngineError
from tidemesh.tides.frequency_domain import pardiso
from tidemesh.tides.frequency_domain.direct import Factorisation, available_solvers

SOLVERS = [
    "superlu",
    pytest.param(
        "pardiso",
        marks=pytest.mark.skipif(
            "pardiso" not in available_solvers(), reason="Intel MKL is not installed"
        ),
    ),
]


def matrix_of(n, *, skew=0.0, seed=0):
    """A damped wave operator on an n by n lattice; skew turns it, as rotation does."""
    rng = np.random.default_rng(seed)
    step = sparse.diags_array([-np.ones(n - 1), np.ones(n)], offsets=[-1, 0])
    one_way = sparse.kron(sparse.eye_array(n), step) + sparse.kron(
        step, sparse.eye_array(n)
    )
    weight = sparse.diags_array(rng.uniform(0.5, 2.0, n * n))
    stiffness = one_way.T @ weight @ one_way
    turn = sparse.triu(stiffness, 1).tocsr()
    turn.data *= rng.choice([-1.0, 1.0], turn.nnz)
    matrix = stiffness * (1.0 + 0.3j) - 0.4 * sparse.eye_array(n * n)
    return (matrix + skew * (turn - turn.T)).tocsc().astype(complex)


def loads(n, columns, seed=1):
    rng = np.random.default_rng(seed)
    return rng.standard_normal((n, columns)) + 1j * rng.standard_normal((n, columns))


@pytest.mark.parametrize("solver", SOLVERS)
@pytest.mark.parametrize("skew", [0.0, 0.2j, 0.3])
@pytest.mark.parametrize("transpose", [False, True])
def test_solves_as_a_dense_solver_does(solver, skew, transpose):
    matrix = matrix_of(12, skew=skew)
    factors = Factorisation(matrix, solver)
    assert factors.symmetric == (skew == 0.0)
    dense = matrix.toarray().T if transpose else matrix.toarray()
    rhs = loads(144, 5)
    expected = np.linalg.solve(dense, rhs)
    found = factors.solve(rhs, transpose=transpose)
    assert np.abs(found - expected).max() < 1e-11 * np.abs(expected).max()
    # One column, or a transposed view of the loads, gives the same as the block.
    one = factors.solve(rhs[:, 3], transpose=transpose)
    assert one.shape == (144,)
    assert np.abs(one - expected[:, 3]).max() < 1e-11 * np.abs(expected).max()
    view = factors.solve(np.ascontiguousarray(rhs.T).T, transpose=transpose)
    assert np.abs(view - expected).max() < 1e-11 * np.abs(expected).max()


@pytest.mark.parametrize("solver", SOLVERS[1:])
@pytest.mark.parametrize("skew", [0.0, 0.1])
def test_agrees_with_superlu(solver, skew):
    matrix = matrix_of(60, skew=skew)
    rhs = loads(3600, 3)
    for transpose in (False, True):
        ours = Factorisation(matrix).solve(rhs, transpose=transpose)
        other = Factorisation(matrix, solver).solve(rhs, transpose=transpose)
        assert np.linalg.norm(other - ours) < 1e-9 * np.linalg.norm(ours)


@pytest.mark.parametrize("solver", SOLVERS)
def test_answer_does_not_depend_on_the_threads(solver):
    matrix, rhs = matrix_of(10), loads(100, 2)
    one = Factorisation(matrix, solver, threads=1).solve(rhs)
    two = Factorisation(matrix, solver, threads=2).solve(rhs)
    assert np.linalg.norm(two - one) < 1e-13 * np.linalg.norm(one)


@pytest.mark.parametrize("solver", SOLVERS)
def test_loads_and_matrix_stay_as_they_were(solver):
    matrix = matrix_of(8)
    rhs = np.asfortranarray(loads(64, 2))
    before = matrix.toarray(), rhs.copy()
    Factorisation(matrix, solver).solve(rhs)
    assert (matrix.toarray() == before[0]).all()
    assert (rhs == before[1]).all()


@pytest.mark.parametrize("solver", SOLVERS)
def test_real_and_zero_loads(solver):
    factors = Factorisation(matrix_of(5), solver)
    real = np.arange(25.0)
    assert np.allclose(factors.matrix @ factors.solve(real), real, rtol=0, atol=1e-12)
    assert (factors.solve(np.zeros((25, 2))) == 0.0).all()


@pytest.mark.parametrize("solver", SOLVERS)
def test_duplicate_unsorted_entries_are_summed(solver):
    entries = [2.0, 1.0, 1.0, 1.0, 4.0, 1.0]
    rows, starts = [1, 0, 1, 0, 1, 0], [0, 3, 6]
    matrix = sparse.csc_array((np.array(entries, complex), rows, starts), shape=(2, 2))
    # [[1, 2], [3, 4]]
    found = Factorisation(matrix, solver).solve(np.array([5.0, 11.0]))
    assert np.allclose(found, [1.0, 2.0], rtol=0, atol=1e-14)


@pytest.mark.parametrize("solver", SOLVERS)
def test_tiny_pivots_are_met_by_pivoting(solver):
    # Without pivoting the rounding error is 1 / 1e-18 times the entries.
    block = np.array([[1e-18, 1.0], [1.0, 1.0]])
    matrix = sparse.csc_array(np.kron(np.eye(3), block).astype(complex))
    rhs = np.tile([1.0, 2.0], 3)
    found = Factorisation(matrix, solver).solve(rhs)
    assert np.allclose(found, 1.0, rtol=0, atol=1e-12)


@pytest.mark.parametrize("solver", SOLVERS)
def test_singular_matrix_is_reported(solver):
    chain = sparse.diags_array([-np.ones(8), np.ones(8)], offsets=[0, 1], shape=(8, 9))
    matrix = (chain.T @ chain).tocsc().astype(complex)
    with pytest.raises(EngineError, match=r"singular|cannot be solved|cannot solve"):
        Factorisation(matrix, solver).solve(np.arange(9.0))


class Inexact:
    """A solver whose answer is wrong by a given fraction."""

    def __init__(self, matrix, error):
        self.dense, self.error, self.calls = matrix.toarray(), error, 0

    def solve(self, rhs, *, transpose):
        self.calls += 1
        dense = self.dense.T if transpose else self.dense
        return np.linalg.solve(dense, rhs) * (1.0 + self.error)


@pytest.mark.parametrize("transpose", [False, True])
def test_refinement_squares_the_error(transpose):
    matrix = matrix_of(6, skew=0.2)
    factors = Factorisation(matrix)
    factors._factors = inexact = Inexact(matrix, 1e-6)
    rhs = loads(36, 2)
    found = factors.solve(rhs, transpose=transpose)
    dense = matrix.toarray().T if transpose else matrix.toarray()
    expected = np.linalg.solve(dense, rhs)
    assert np.linalg.norm(found - expected) < 2e-12 * np.linalg.norm(expected)
    assert inexact.calls == 2


def test_factors_are_formed_again_when_the_residual_stays_large(caplog):
    matrix = matrix_of(6)
    factors = Factorisation(matrix)
    factors._factors = Inexact(matrix, 3.0)
    rhs = np.ones(36, dtype=complex)
    found = factors.solve(rhs)
    assert np.linalg.norm(matrix @ found - rhs) < 1e-12
    assert "pivoting" in caplog.text


def test_one_bad_column_is_not_hidden_by_the_others():
    matrix = matrix_of(6)
    factors = Factorisation(matrix)
    rhs = loads(36, 2) * [1e12, 1e-6]
    exact = np.linalg.solve(matrix.toarray(), rhs)
    wrong = exact * [1.0, 2.0]
    _, residual = factors._residual(rhs, wrong, transpose=False)
    assert residual == pytest.approx(1.0, rel=1e-6)


def test_unknown_solver_is_refused():
    with pytest.raises(EngineError, match=r'"umfpack"; known are superlu, pardiso'):
        Factorisation(matrix_of(3), "umfpack")


def test_absent_library_says_what_to_install(monkeypatch):
    monkeypatch.setattr(pardiso, "find_library", lambda: None)
    monkeypatch.setattr(pardiso, "load_library", pardiso.load_library.__wrapped__)
    assert available_solvers() == ("superlu",)
    with pytest.raises(EngineError, match=r"pip install mkl"):
        Factorisation(matrix_of(3), "pardiso")


def test_library_that_cannot_be_loaded_is_reported(monkeypatch, tmp_path):
    broken = tmp_path / "libmkl_rt.so.2"
    broken.write_bytes(b"not a library")
    monkeypatch.setattr(pardiso, "find_library", lambda: str(broken))
    monkeypatch.setattr(pardiso, "load_library", pardiso.load_library.__wrapped__)
    with pytest.raises(EngineError, match=r"cannot be used: .*libmkl_rt"):
        Factorisation(matrix_of(3), "pardiso")


@pytest.mark.skipif(
    "pardiso" not in available_solvers(), reason="Intel MKL is not installed"
)
def test_memory_is_given_back():
    code = """
import numpy as np, psutil, scipy.sparse as sparse
from tidemesh.tides.frequency_domain.pardiso import Pardiso
n = 500
matrix = sparse.csc_array(np.ones((n, n)) + n * np.eye(n), dtype=complex)
def memory():
    return psutil.Process().memory_info().rss / 1e6
Pardiso(matrix, symmetric=True)
first = memory()
for _ in range(40):
    Pardiso(matrix, symmetric=True)
print(memory() - first)
"""
    result = subprocess.run([sys.executable, "-c", code], capture_output=True)
    # One set of factors holds 2 MB.
    assert float(result.stdout) < 20.0, result.stderr


def test_library_is_not_loaded_when_unused():
    code = (
        "import sys, tidemesh.tides.frequency_domain.pardiso as p;"
        "assert p.load_library.cache_info().currsize == 0;"
        "assert p.find_library.cache_info().currsize == 0"
    )
    subprocess.run([sys.executable, "-c", code], check=True)
