"""Allowable spacing: the root satisfies Eq. 4, and it is the smallest one."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tidemesh.datatypes import TruncationSeries
from tidemesh.sizing import allowable_spacing, error_at_spacing, smallest_root


def error(second, fourth, delta):
    x = delta**2
    return np.sqrt(np.sum(np.abs(second * x + fourth * x**2) ** 2, axis=0))


def random_coefficients(seed, n_components=2, n=2000):
    """Random phases, sizes over 12 decades, many pairs nearly opposed."""
    rng = np.random.default_rng(seed)
    shape = (n_components, n)
    second = rng.normal(size=shape) + 1j * rng.normal(size=shape)
    second *= 10.0 ** rng.uniform(-12, 0, n)
    fourth = rng.normal(size=shape) + 1j * rng.normal(size=shape)
    fourth *= 10.0 ** rng.uniform(-12, 0, n)
    half = n // 2
    opposed = -second[:, :half] * 10.0 ** rng.uniform(-3, 3, half)
    fourth[:, :half] = opposed * (1.0 + 0.01j * rng.normal(size=half))
    return second, fourth


@pytest.mark.parametrize("n_components", [1, 2])
def test_root_satisfies_equation(n_components):
    second, fourth = random_coefficients(1, n_components)
    delta = smallest_root(second, fourth, 7.9e-6)
    np.testing.assert_allclose(error(second, fourth, delta), 7.9e-6, rtol=1e-10)


def test_root_is_the_smallest():
    second, fourth = random_coefficients(2, n=400)
    delta = smallest_root(second, fourth, 1e-3)
    part = np.linspace(0.0, 1.0, 2002)[1:-1, None, None]
    x = (part * delta) ** 2
    before = np.sqrt(np.sum(np.abs(second * x + fourth * x**2) ** 2, axis=1))
    assert (before < 1e-3 * (1.0 + 1e-10)).all()


@settings(max_examples=60, deadline=None)
@given(
    ratio=st.floats(1e-6, 1e6),
    angle=st.floats(0.0, 6.3),
    tolerance=st.floats(1e-80, 1e80),
    unit=st.floats(1e-30, 1e30),
)
def test_root_at_any_scale(ratio, angle, tolerance, unit):
    # Spacings in another unit and tolerances of any size: same error.
    second = np.array([[tolerance / unit**2]], dtype=complex)
    fourth = second * ratio * np.exp(1j * angle) / unit**2
    delta = smallest_root(second, fourth, tolerance)
    np.testing.assert_allclose(error(second, fourth, delta) / tolerance, 1, rtol=1e-10)


def test_second_order_alone():
    # error = a X: the limit is sqrt(T / a), and 4 x limit gives 2 x spacing.
    second, zero = np.array([[3e-11 + 4e-11j]]), np.zeros((1, 1))
    delta = smallest_root(second, zero, 8e-6)
    np.testing.assert_allclose(delta, np.sqrt(8e-6 / 5e-11), rtol=1e-14)
    np.testing.assert_allclose(
        smallest_root(second, zero, 4 * 8e-6), 2 * delta, rtol=1e-14
    )


def test_fourth_order_alone():
    fourth, zero = np.array([[2e-17j]]), np.zeros((1, 1))
    delta = smallest_root(zero, fourth, 8e-6)
    np.testing.assert_allclose(delta, (8e-6 / 2e-17) ** 0.25, rtol=1e-14)


def test_crest_exactly_at_the_tolerance():
    # X - X**2 / 4 touches 1 at X = 2 and comes back to -1 later.
    delta = smallest_root(np.array([[1.0]]), np.array([[-0.25]]), 1.0)
    np.testing.assert_allclose(delta**2, 2.0, rtol=1e-6)


def test_crest_below_the_tolerance():
    # X - X**2 = -1 at X = (1 + sqrt 5) / 2; its crest is only 1/4.
    delta = smallest_root(np.array([[1.0]]), np.array([[-1.0]]), 1.0)
    np.testing.assert_allclose(delta**2, (1.0 + 5.0**0.5) / 2.0, rtol=1e-14)


def test_nothing_to_solve_is_unlimited():
    zero = np.zeros((1, 3), dtype=complex)
    assert np.isinf(smallest_root(zero, zero, 1e-6)).all()


@pytest.mark.parametrize("tolerance", [0.0, -1.0, np.nan, np.inf])
def test_tolerance_must_be_positive(tolerance):
    with pytest.raises(ValueError, match="tolerance must be positive"):
        smallest_root(np.ones((1, 1)), np.ones((1, 1)), tolerance)


def series_of(n_c=2, n_components=2, n=50, seed=3):
    rng = np.random.default_rng(seed)
    shape = (n_c, n_components, n)
    second = 1e-11 * (rng.normal(size=shape) + 1j * rng.normal(size=shape))
    fourth = 1e-17 * (rng.normal(size=shape) + 1j * rng.normal(size=shape))
    return TruncationSeries(second, fourth, np.arange(n) % 5 > 0)


@pytest.mark.parametrize("components", ["vector", "largest"])
@pytest.mark.parametrize("constituents", ["largest", "root_sum_square"])
def test_norms(components, constituents):
    series = series_of()
    options = {"components": components, "constituents": constituents}
    spacing = allowable_spacing(series, 5e-6, **options)
    x = np.where(series.known, spacing, 0.0) ** 2
    size = np.abs(series.second * x + series.fourth * x**2)
    inner = np.linalg.norm if components == "vector" else np.max
    if constituents == "largest" or components == "vector":
        size = inner(size, axis=1)
        outer = np.max if constituents == "largest" else np.linalg.norm
        expected = outer(size, axis=0)
    else:
        expected = np.max(np.linalg.norm(size, axis=0), axis=0)
    known = series.known
    np.testing.assert_allclose(expected[known], 5e-6, rtol=1e-10)
    assert np.isnan(spacing[~known]).all()
    error = error_at_spacing(series, np.where(known, spacing, 1.0), **options)
    np.testing.assert_allclose(error[known], 5e-6, rtol=1e-10)


def test_maximum_caps():
    series = TruncationSeries(np.zeros((1, 1, 2)), np.zeros((1, 1, 2)), [True, False])
    spacing = allowable_spacing(series, 1e-6, maximum=5e4)
    np.testing.assert_array_equal(spacing, [5e4, np.nan])
