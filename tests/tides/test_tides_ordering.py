"""Elimination orders."""

from itertools import combinations

import numpy as np
import pytest
import scipy.sparse as sparse
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.sparse.linalg import splu
from scipy.spatial import Delaunay

from tidemesh.tides.frequency_domain.ordering import (
    _minimum_cover,
    nested_dissection,
)


def mesh_sides(points):
    triangles = Delaunay(points).simplices
    ends = np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]]])
    ends = np.concatenate([ends, triangles[:, [2, 0]]])
    return np.unique(np.sort(ends, axis=1), axis=0).T


def factor_size(order, sides):
    n = len(order)
    half = sparse.coo_array((-np.ones(sides.shape[1]), tuple(sides)), shape=(n, n))
    matrix = (half + half.T + 8.0 * sparse.eye_array(n)).tocsr()
    permuted = matrix[order][:, order].tocsc()
    options = {"SymmetricMode": True}
    return splu(permuted, permc_spec="NATURAL", options=options).nnz, matrix, options


def test_orders_every_node_once_and_the_same_way_twice():
    points = np.random.default_rng(2).random((500, 2))
    sides = mesh_sides(points)
    order = nested_dissection(points, sides)
    assert (np.sort(order) == np.arange(500)).all()
    assert (nested_dissection(points, sides) == order).all()


def test_fills_less_than_minimum_degree():
    x, y = np.meshgrid(np.arange(110.0), np.arange(110.0))
    points = np.column_stack([x.ravel() + 0.5 * (y.ravel() % 2), y.ravel()])
    sides = mesh_sides(points)
    ours, matrix, options = factor_size(nested_dissection(points, sides), sides)
    degree = splu(matrix.tocsc(), permc_spec="MMD_AT_PLUS_A", options=options).nnz
    assert ours < 1.02 * degree


@pytest.mark.parametrize("n", [0, 1, 2, 7])
def test_tiny_and_unconnected_graphs(n):
    points = np.arange(2.0 * n).reshape(n, 2)
    order = nested_dissection(points, np.empty((2, 0), dtype=int))
    assert (np.sort(order) == np.arange(n)).all()


def test_nodes_in_one_place_are_ordered_too():
    sides = np.array([np.arange(19), np.arange(1, 20)])
    order = nested_dissection(np.zeros((20, 2)), sides)
    assert (np.sort(order) == np.arange(20)).all()


@settings(deadline=None, max_examples=60)
@given(st.lists(st.tuples(st.integers(0, 5), st.integers(6, 10)), max_size=14))
def test_cover_is_the_smallest(edges):
    left, right = np.array(edges, dtype=int).reshape(-1, 2).T
    cover = set(_minimum_cover(left, right).tolist())
    assert all(a in cover or b in cover for a, b in edges)
    for size in range(len(cover)):
        for other in combinations(range(11), size):
            assert not all(a in other or b in other for a, b in edges)
