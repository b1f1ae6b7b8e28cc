"""Gradation: the largest admissible spacing, found by brute force."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial import Delaunay

from tidemesh.sizing import limit_gradation
from tidemesh.triangulation.topology import edges as mesh_edges


def brute_force(spacing, edges, lengths, limit):
    """Relax every edge both ways until nothing changes."""
    result = spacing.copy()
    while True:
        before = result.copy()
        for (i, j), length in zip(edges, lengths):
            result[i] = min(result[i], result[j] + limit * length)
            result[j] = min(result[j], result[i] + limit * length)
        if (result == before).all():
            return result


@st.composite
def graphs(draw):
    n = draw(st.integers(2, 25))
    seed = draw(st.integers(0, 10**6))
    rng = np.random.default_rng(seed)
    edges = rng.integers(0, n, size=(draw(st.integers(1, 60)), 2))
    edges = edges[edges[:, 0] != edges[:, 1]]
    edges = np.unique(np.sort(edges, axis=1), axis=0)
    lengths = rng.uniform(0.1, 5.0, len(edges))
    spacing = np.exp(rng.normal(scale=2.0, size=n))
    return spacing, edges, lengths, draw(st.sampled_from([0.05, 0.25, 1.0, 4.0]))


@settings(max_examples=80, deadline=None)
@given(graphs())
def test_against_brute_force(graph):
    spacing, edges, lengths, limit = graph
    result = limit_gradation(spacing, edges, lengths, limit)
    np.testing.assert_allclose(
        result, brute_force(spacing, edges, lengths, limit), rtol=1e-13
    )
    assert (result <= spacing).all()
    np.testing.assert_array_equal(
        limit_gradation(result, edges, lengths, limit), result
    )


@settings(max_examples=20, deadline=None)
@given(graphs(), st.integers(0, 1000))
def test_order_of_edges_and_nodes_is_irrelevant(graph, seed):
    spacing, edges, lengths, limit = graph
    rng = np.random.default_rng(seed)
    new_name = rng.permutation(len(spacing))
    shuffle = rng.permutation(len(edges))
    renamed = np.empty_like(spacing)
    renamed[new_name] = spacing
    result = limit_gradation(
        renamed, new_name[edges][shuffle][:, ::-1], lengths[shuffle], limit
    )
    np.testing.assert_array_equal(
        result[new_name], limit_gradation(spacing, edges, lengths, limit)
    )


def test_cone_around_a_point():
    # One small node: elsewhere spacing = small + limit * distance along edges.
    points = np.stack([np.linspace(0.0, 10.0, 11), np.zeros(11)], axis=1)
    edges = np.stack([np.arange(10), np.arange(1, 11)], axis=1)
    spacing = np.full(11, 100.0)
    spacing[4] = 0.5
    result = limit_gradation(spacing, edges, np.ones(10), 0.25)
    np.testing.assert_allclose(result, 0.5 + 0.25 * np.abs(points[:, 0] - 4.0))


def test_no_limit_changes_nothing():
    spacing = np.array([1.0, 1e6, 3.0])
    result = limit_gradation(spacing, [[0, 1], [1, 2]], np.ones(2), np.inf)
    np.testing.assert_array_equal(result, spacing)
    assert result is not spacing


def test_on_a_mesh_of_ten_thousand_nodes():
    rng = np.random.default_rng(4)
    points = rng.random((10_000, 2)) * 1e5
    edges = mesh_edges(Delaunay(points).simplices)
    lengths = np.linalg.norm(points[edges[:, 0]] - points[edges[:, 1]], axis=1)
    spacing = np.exp(rng.normal(8.0, 2.0, len(points)))
    result = limit_gradation(spacing, edges, lengths, 0.2)
    growth = np.abs(result[edges[:, 0]] - result[edges[:, 1]])
    assert (growth <= 0.2 * lengths * (1.0 + 1e-12)).all()
    # Somewhere it binds, and where it does not the spacing is the given one.
    lower = np.minimum.reduceat(
        *_by_node(edges, lengths, result, 0.2),
    )
    np.testing.assert_array_equal(result, np.minimum(spacing, lower))


def _by_node(edges, lengths, result, limit):
    """Allowed by each neighbour, sorted by node, with the starts of the runs."""
    node = edges.T.ravel()
    other = edges[:, ::-1].T.ravel()
    allowed = result[other] + limit * np.tile(lengths, 2)
    order = np.argsort(node, kind="stable")
    starts = np.searchsorted(node[order], np.arange(node.max() + 1))
    return allowed[order], starts
