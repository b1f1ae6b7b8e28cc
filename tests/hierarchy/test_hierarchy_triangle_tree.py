import numpy as np
import pytest
from scipy.spatial import cKDTree

from tidemesh.errors import InputError
from tidemesh.hierarchy import triangle_tree
from tidemesh.hierarchy.triangle_tree import lattice_nodes, select_triangles

BOX = (0.0, 0.0, 100.0, 80.0)


def constant(size):
    return lambda points: np.full(len(points), size)


def inner_distances(points, margin=20.0, number=6):
    """Distances to the nearest neighbours of the nodes away from the edge."""
    inner = (
        (points[:, 0] > margin)
        & (points[:, 0] < 100.0 - margin)
        & (points[:, 1] > margin)
        & (points[:, 1] < 80.0 - margin)
    )
    return cKDTree(points).query(points[inner], k=number + 1)[0][:, 1:]


@pytest.mark.parametrize("rule", ["strict", "graded", "balanced"])
def test_constant_target_gives_one_level_and_a_hexagonal_lattice(rule):
    selection = select_triangles(BOX, 3.0, constant(3.0), rule=rule)
    assert sum(len(triangles) > 0 for triangles in selection.levels) == 1
    distances = inner_distances(lattice_nodes(selection, rule=rule)[0])
    np.testing.assert_allclose(distances, 3.0, rtol=1e-12)


def test_triangles_cover_the_box_and_do_not_overlap():
    selection = select_triangles(
        BOX, 3.0, lambda p: 0.5 + 0.05 * np.maximum(p[:, 0], 0.0)
    )
    points = np.random.default_rng(1).uniform([0, 0], [100, 80], (500, 2))
    hits = np.zeros(len(points), dtype=int)
    for level, triangles in enumerate(selection.levels):
        edge = selection.root_edge / 2**level
        j = points[:, 1] / (0.5 * np.sqrt(3.0) * edge)
        i = points[:, 0] / edge - 0.5 * j
        cell = np.floor(np.stack([i, j], axis=1)).astype(int)
        down = (i - cell[:, 0]) + (j - cell[:, 1]) > 1.0
        here = set(zip(triangles.i, triangles.j, triangles.down))
        hits += [(a, b, c) in here for (a, b), c in zip(cell, down)]
    assert (hits == 1).all()


def test_strict_edges_lie_between_half_the_target_and_the_target():
    selection = select_triangles(
        BOX, 3.0, lambda p: 1.0 + 0.1 * np.maximum(p[:, 0], 0.0), rule="strict"
    )
    for level, target in enumerate(selection.targets):
        edge = selection.root_edge / 2**level
        assert (edge <= target * 1.00001).all()


def test_graded_edges_lie_below_twice_the_target():
    selection = select_triangles(
        BOX, 3.0, lambda p: 1.0 + 0.1 * np.maximum(p[:, 0], 0.0), rule="graded"
    )
    assert len(selection.levels) > 3
    for level, target in enumerate(selection.targets):
        edge = selection.root_edge / 2**level
        assert (edge < 2.0 * target).all()
        # A parent is at least twice the target at its own centre, a fifth of its
        # edge or so from its children's.
        assert (2.0 * edge > 2.0 * (target - 0.1 * 2.0 * edge)).all()


@pytest.mark.parametrize(
    ("ratio", "nodes_per_triangle"),
    [(1.0, 0.0), (1.32, 0.0), (1.35, 0.5), (1.65, 0.5), (1.68, 1.0), (1.99, 1.0)],
)
def test_graded_rule_adds_mid_side_and_centre_nodes(ratio, nodes_per_triangle):
    # Mid-side nodes are shared by two triangles, centre nodes are not.
    target = 3.0 / ratio
    selection = select_triangles(BOX, 3.0, constant(target), rule="graded")
    corners, _ = lattice_nodes(selection, rule="strict")
    nodes, _ = lattice_nodes(selection, rule="graded")
    rows = len(np.unique(selection.levels[-1].j))
    expected = nodes_per_triangle * len(selection)
    border = rows * 2 + len(selection) / rows
    assert abs(len(nodes) - len(corners) - expected) <= border


def test_mid_side_nodes_lie_at_the_middle_of_horizontal_sides():
    selection = select_triangles(BOX, 3.0, constant(2.0), rule="graded")
    corners, _ = lattice_nodes(selection, rule="strict")
    nodes, _ = lattice_nodes(selection, rule="graded")
    distance, _ = cKDTree(corners).query(nodes)
    extra = nodes[distance > 1e-6]
    np.testing.assert_allclose(distance[distance > 1e-6], 1.5)
    two, place = cKDTree(corners).query(extra, k=2)
    np.testing.assert_allclose(two, 1.5)
    np.testing.assert_allclose(np.ptp(corners[place][:, :, 1], axis=1), 0.0, atol=1e-9)


def test_balanced_rule_stays_equilateral_between_the_levels():
    selection = select_triangles(BOX, 3.0, constant(2.0), rule="balanced")
    distances = inner_distances(lattice_nodes(selection, rule="balanced")[0])
    np.testing.assert_allclose(distances, 3.0 / np.sqrt(3.0), rtol=1e-12)


@pytest.mark.parametrize("rule", ["strict", "graded", "balanced"])
def test_smaller_target_gives_no_fewer_nodes(rule):
    def field(points):
        return 1.0 + 0.04 * np.hypot(points[:, 0] - 50.0, points[:, 1] - 40.0)

    counts = [
        len(
            lattice_nodes(
                select_triangles(BOX, 2.0, lambda p, s=s: s * field(p), rule=rule),
                rule=rule,
            )[0]
        )
        for s in (1.5, 1.2, 1.0, 0.9, 0.7, 0.5, 0.3)
    ]
    assert counts == sorted(counts)


def test_nodes_are_unique_and_never_very_close():
    selection = select_triangles(
        BOX, 2.0, lambda p: 0.3 + 0.04 * np.maximum(p[:, 0], 0.0)
    )
    nodes, _ = lattice_nodes(selection, rule="balanced")
    assert len(np.unique(nodes, axis=0)) == len(nodes)
    nearest = cKDTree(nodes).query(nodes, k=2)[0][:, 1]
    assert (nearest > 0.45 * (0.3 + 0.04 * np.maximum(nodes[:, 0], 0.0))).all()


def test_minimum_edge_stops_the_walk():
    selection = select_triangles(BOX, 4.0, constant(1e-3), minimum_edge=1.0)
    edge = selection.root_edge / 2 ** (len(selection.levels) - 1)
    assert edge == 1.0


def test_sizes_beyond_the_depth_of_the_hierarchy_are_an_input_error():
    def spike(points):
        far = np.hypot(points[:, 0] - 33.3, points[:, 1] - 44.4)
        return np.maximum(1e-9, 0.3 * far)

    with pytest.raises(InputError, match="raise the smallest size"):
        select_triangles(BOX, 3.0, spike)


def test_more_triangles_than_memory_are_an_input_error(monkeypatch):
    monkeypatch.setattr(triangle_tree, "MOST_TRIANGLES", 100_000)
    with pytest.raises(InputError, match="need more than 50,000 nodes"):
        select_triangles((0.0, 0.0, 1e5, 1e5), 1000.0, constant(1.0))
