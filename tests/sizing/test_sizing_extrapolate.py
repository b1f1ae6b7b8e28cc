"""Extrapolation fills only what is undefined, and smoothly."""

import numpy as np
import pytest
from scipy.spatial import Delaunay

from tidemesh.errors import InputError
from tidemesh.sizing import harmonic_extension, smooth_logarithm
from tidemesh.triangulation.topology import edges as mesh_edges


@pytest.fixture
def cloud():
    rng = np.random.default_rng(5)
    points = rng.random((800, 2))
    return points, mesh_edges(Delaunay(points).simplices)


def test_constants_are_exact(cloud):
    points, edges = cloud
    known = points[:, 0] < 0.3
    filled = harmonic_extension(points, edges, known)(np.where(known, 7.0, np.nan))
    np.testing.assert_allclose(filled, 7.0, rtol=1e-12)


def test_defined_nodes_are_untouched_and_bounds_kept(cloud):
    points, edges = cloud
    rng = np.random.default_rng(6)
    known = rng.random(len(points)) < 0.4
    values = np.where(known, np.exp(rng.normal(size=len(points))), np.nan)
    filled = harmonic_extension(points, edges, known)(values)
    np.testing.assert_array_equal(filled[known], values[known])
    assert filled.min() == values[known].min()
    assert filled.max() == values[known].max()


def test_geometric_growth_along_a_line():
    # The logarithm of the filled spacing is linear along a line.
    points = np.stack([np.array([0.0, 1.0, 4.0, 6.0, 10.0]), np.zeros(5)], axis=1)
    edges = np.array([[0, 1], [1, 2], [2, 3], [3, 4]])
    known = np.array([True, False, False, False, True])
    values = np.array([10.0, np.nan, np.nan, np.nan, 1000.0])
    filled = harmonic_extension(points, edges, known)(values)
    np.testing.assert_allclose(filled, 10.0 * 100.0 ** (points[:, 0] / 10.0))


def test_part_without_known_nodes_takes_the_nearest():
    points = np.array([[0.0, 0.0], [1.0, 0.0], [5.0, 0.0], [6.0, 0.0]])
    edges = np.array([[0, 1], [2, 3]])
    known = np.array([True, True, False, False])
    filled = harmonic_extension(points, edges, known)(
        np.array([2.0, 3.0, np.nan, np.nan])
    )
    np.testing.assert_array_equal(filled, [2.0, 3.0, 3.0, 3.0])


def test_all_known_is_a_copy(cloud):
    points, edges = cloud
    values = np.arange(1.0, len(points) + 1.0)
    known = np.ones(len(points), dtype=bool)
    filled = harmonic_extension(points, edges, known)(values)
    np.testing.assert_array_equal(filled, values)
    assert filled is not values


def test_nothing_known_is_an_error(cloud):
    points, edges = cloud
    with pytest.raises(InputError, match="undefined at every node"):
        harmonic_extension(points, edges, np.zeros(len(points), dtype=bool))


def test_smoothing_keeps_constants_and_damps_a_spike(cloud):
    points, edges = cloud
    values = np.full(len(points), 3.0)
    values[:40] = np.nan
    np.testing.assert_allclose(smooth_logarithm(values, edges, 3), values)
    values[100] = 3e-4
    smooth = smooth_logarithm(values, edges, 2)
    np.testing.assert_array_equal(np.isnan(smooth), np.isnan(values))
    assert 0.1 < np.nanmin(smooth) < 3.0
    np.testing.assert_array_equal(smooth_logarithm(values, edges, 0), values)


def test_smoothing_is_the_geometric_mean():
    edges = np.array([[0, 1], [1, 2]])
    smooth = smooth_logarithm(np.array([1.0, 10.0, 1000.0]), edges, 1)
    np.testing.assert_allclose(smooth, [10**0.5, 10 ** (4 / 3), 100.0])
