import numpy as np
import pytest
from improve_coasts import rough_mesh, rough_nodes, spacing, wavy_bay

from tidemesh.datatypes import Domain, Ring
from tidemesh.geometry.projection import Projection
from tidemesh.improve import ImproveSettings, clean, improve_mesh
from tidemesh.improve.polish import flip_poor, raise_worst
from tidemesh.triangulation import quality, topology
from tidemesh.triangulation.domain import ring_points, ring_segments, triangulate


def assert_valid(domain, points, triangles):
    assert topology.check_mesh(points, triangles) == []
    np.testing.assert_array_equal(
        points[: len(ring_points(domain))], ring_points(domain)
    )
    edges = topology.boundary_edges(triangles)
    assert set(map(tuple, edges)) == set(map(tuple, ring_segments(domain)))
    holes = len(domain.rings) - 1
    n_edges = len(topology.edges(triangles))
    assert len(points) - n_edges + len(triangles) == 1 - holes


@pytest.mark.parametrize("seed", range(3))
def test_random_nodes_become_a_good_mesh(seed):
    domain = wavy_bay()
    nodes = rough_nodes(domain, seed)
    points, triangles, report = improve_mesh(domain, nodes, spacing)
    assert_valid(domain, points, triangles)
    summary = quality.quality_summary(points, triangles)
    assert summary["quality_mean"] > 0.95
    assert summary["quality_minimum"] > 0.5
    assert summary["valence_4_8_fraction"] > 0.998
    assert summary["area_ratio_within_2_fraction"] > 0.99
    assert report["removed"] == report["inserted"] > 0


@pytest.mark.parametrize("share", [0.97, 1.03])
def test_the_number_of_nodes_can_be_asked_for(share):
    domain = wavy_bay()
    nodes = rough_nodes(domain)
    wanted = round(share * (len(nodes) + len(ring_points(domain))))
    points, triangles, _ = improve_mesh(domain, nodes, spacing, nodes=wanted)
    assert len(points) == wanted
    assert_valid(domain, points, triangles)


def test_published_smoothing_changes_no_counts():
    domain = wavy_bay()
    nodes = rough_nodes(domain)
    settings = ImproveSettings(method="laplacian", clean=False)
    points, triangles, report = improve_mesh(domain, nodes, spacing, settings)
    assert len(points) == len(nodes) + len(ring_points(domain))
    assert report["removed"] == report["inserted"] == 0
    assert_valid(domain, points, triangles)


def test_no_interior_nodes_at_all():
    angle = np.arange(5) * 2.0 * np.pi / 5.0
    ring = Ring(np.stack([np.cos(angle), np.sin(angle)], axis=1), np.zeros(5))
    domain = Domain((ring,), Projection())
    points, triangles, _ = improve_mesh(
        domain, np.empty((0, 2)), lambda p: np.full(len(p), 2.0)
    )
    assert len(points) == 5
    assert len(triangles) == 3


def test_progress_runs_to_one():
    domain = wavy_bay()
    seen: list[float] = []
    improve_mesh(domain, rough_nodes(domain), spacing, progress=seen.append)
    assert seen == sorted(seen)
    assert seen[-1] == 1.0


def test_two_runs_give_the_same_bytes():
    domain = wavy_bay()
    nodes = rough_nodes(domain)
    one = improve_mesh(domain, nodes, spacing)
    two = improve_mesh(domain, nodes, spacing)
    assert one[0].tobytes() == two[0].tobytes()
    assert one[1].tobytes() == two[1].tobytes()


@pytest.mark.parametrize("seed", range(3))
def test_cleaning_keeps_area_and_boundary(seed):
    domain, points, triangles, fixed = rough_mesh(seed)
    cleaned = clean(points, triangles, fixed, size=spacing(points))
    assert_valid(domain, cleaned.points, cleaned.triangles)
    assert quality.area(cleaned.points, cleaned.triangles).sum() == pytest.approx(
        quality.area(points, triangles).sum(), rel=1e-12
    )
    old = cleaned.source >= 0
    np.testing.assert_array_equal(cleaned.points[old], points[cleaned.source[old]])
    assert cleaned.report["inserted"] == (~old).sum()
    assert cleaned.report["removed"] == len(points) - old.sum()


def square_with(nodes, size):
    ring = Ring([[0, 0], [1, 0], [2, 0], [2, 2], [1, 2], [0, 2]], np.zeros(6))
    domain = Domain((ring,), Projection())
    points, triangles = triangulate(domain, np.array(nodes))
    return points, triangles, np.arange(len(points)) < 6, np.full(len(points), size)


def test_one_of_two_close_nodes_is_removed():
    points, triangles, fixed, size = square_with([[0.9, 1.0], [1.1, 1.0]], 1.0)
    settings = ImproveSettings(lowest_valence=0, longest_side=9.0)
    cleaned = clean(points, triangles, fixed, settings, size=size, wanted=7)
    assert cleaned.report == {"removed": 1.0, "inserted": 0.0}


def test_a_long_side_is_divided_at_its_middle():
    points, triangles, fixed, size = square_with([[1.0, 1.0]], 0.6)
    settings = ImproveSettings(lowest_valence=0, shortest_side=0.1, longest_side=2.0)
    cleaned = clean(points, triangles, fixed, settings, size=size, wanted=20)
    assert cleaned.report["inserted"] > 0
    new = cleaned.points[cleaned.source < 0]
    edges = topology.edges(triangles)
    middles = points[edges].mean(axis=1)
    assert all((np.abs(middles - place).sum(axis=1) < 1e-12).any() for place in new)


@pytest.mark.parametrize("seed", range(3))
def test_search_only_improves(seed):
    _, points, triangles, fixed = rough_mesh(seed)
    before = quality.shape_quality(points, triangles)
    better, moved = raise_worst(points, triangles, fixed, 0.6)
    after = quality.shape_quality(better, triangles)
    assert moved > 0
    assert after.min() >= before.min()
    assert (after < 0.6).sum() < (before < 0.6).sum()
    np.testing.assert_array_equal(better[fixed], points[fixed])


def test_shape_flips_choose_the_better_diagonal():
    # A flat rhombus: the long diagonal makes two slivers.
    points = np.array([[-3.0, 0.0], [0.0, -0.8], [3.0, 0.0], [0.0, 0.8]])
    flipped, flips = flip_poor(points, np.array([[0, 1, 2], [0, 2, 3]]), 0.6)
    assert flips == 1
    assert sorted(map(sorted, flipped.tolist())) == [[0, 1, 3], [1, 2, 3]]
    assert quality.area(points, flipped).min() > 0.0
    again, flips = flip_poor(points, flipped, 0.6)
    assert flips == 0
    np.testing.assert_array_equal(again, flipped)


def test_a_wide_corner_does_not_hang_on_one_triangle():
    line = np.linspace(0.0, 1000.0, 11)[:-1]
    sides = [
        np.stack([line, 0 * line], axis=1),
        np.stack([0 * line + 1000.0, line], axis=1),
        np.stack([1000.0 - line, 0 * line + 1000.0], axis=1),
        np.stack([0 * line, 1000.0 - line], axis=1),
    ]
    ring = Ring(np.concatenate(sides), np.zeros(40))
    domain = Domain((ring,), Projection())
    x, y = np.meshgrid(np.arange(150.0, 900.0, 100.0), np.arange(150.0, 900.0, 87.0))
    nodes = np.stack([x.ravel() + 20.0 * (np.arange(x.size) % 2), y.ravel()], axis=1)
    points, triangles, _ = improve_mesh(domain, nodes, lambda p: np.full(len(p), 100.0))
    count = np.bincount(triangles.ravel(), minlength=len(points))
    assert count[[0, 10, 20, 30]].min() >= 2
