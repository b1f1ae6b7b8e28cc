import numpy as np
import pytest
from improve_coasts import hexagonal_patch, rough_mesh, spacing

from tidemesh.improve import ImproveSettings, _kernels, smooth
from tidemesh.triangulation import quality, topology
from tidemesh.triangulation.domain import ring_segments

METHODS = ["springs", "laplacian"]


@pytest.mark.parametrize("method", METHODS)
def test_equilateral_patch_is_unmoved(method):
    points, triangles, fixed = hexagonal_patch()
    result = smooth(points, triangles, fixed, ImproveSettings(method=method))
    np.testing.assert_allclose(result.points, points, atol=1e-12)
    np.testing.assert_array_equal(result.triangles, triangles)
    assert result.report["flips"] == 0


@pytest.mark.parametrize("method", METHODS)
def test_disturbed_patch_comes_back(method):
    points, triangles, fixed = hexagonal_patch()
    moved = points.copy()
    noise = np.random.default_rng(4).uniform(-0.15, 0.15, points.shape)
    moved[~fixed] += noise[~fixed]
    settings = ImproveSettings(method=method, sweeps=200)
    result = smooth(moved, triangles, fixed, settings)
    # Nodes rest once they move by less than 0.5 % of their sides.
    assert np.abs(result.points - points).max() < 0.05
    assert quality.shape_quality(result.points, result.triangles).min() > 0.99


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("seed", range(3))
def test_boundary_and_area_are_kept_and_nothing_turns_over(method, seed):
    domain, points, triangles, fixed = rough_mesh(seed)
    settings = ImproveSettings(method=method)
    result = smooth(points, triangles, fixed, settings, size=spacing(points))
    np.testing.assert_array_equal(result.points[fixed], points[fixed])
    area = quality.area(result.points, result.triangles)
    assert area.min() > 0.0
    assert area.sum() == pytest.approx(quality.area(points, triangles).sum(), rel=1e-12)
    edges = topology.boundary_edges(result.triangles)
    assert set(map(tuple, edges)) == set(map(tuple, ring_segments(domain)))


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("seed", range(3))
def test_worst_quality_does_not_fall(method, seed):
    _, points, triangles, fixed = rough_mesh(seed)
    settings = ImproveSettings(method=method)
    result = smooth(points, triangles, fixed, settings, size=spacing(points))
    before = quality.shape_quality(points, triangles)
    after = quality.shape_quality(result.points, result.triangles)
    assert after.min() >= before.min()
    assert after.mean() > before.mean() + 0.05


def test_moves_that_would_turn_a_triangle_over_are_refused():
    # The mean of the corners of a notched shape lies outside it.
    points = np.array([[-10, 0], [0, 8.0], [10, 0], [0, 10], [0, 9.0]])
    triangles = np.array([[4, 1, 2], [4, 2, 3], [4, 3, 0], [4, 0, 1]])
    fixed = np.array([True, True, True, True, False])
    assert points[:4].mean(axis=0)[1] < points[1, 1]
    result = smooth(points, triangles, fixed, ImproveSettings(method="laplacian"))
    assert result.report["refused_moves"] > 0
    assert quality.area(result.points, result.triangles).min() > 0.0


def test_the_result_is_delaunay():
    _, points, triangles, fixed = rough_mesh()
    result = smooth(points, triangles, fixed, size=spacing(points))
    p, t = result.points, result.triangles
    neighbours = _kernels.find_neighbours(t, len(p))
    angles = quality.angles(p, t)
    inner = np.argwhere(neighbours >= 0)
    for triangle, corner in inner[::7]:
        other = neighbours[triangle, corner]
        across = np.flatnonzero(neighbours[other] == triangle)[0]
        assert angles[triangle, corner] + angles[other, across] < np.pi + 1e-8


def test_springs_keep_graded_sizes_better_than_the_mean_of_neighbours():
    _, points, triangles, fixed = rough_mesh()

    def spread(method):
        settings = ImproveSettings(method=method, sweeps=30)
        result = smooth(points, triangles, fixed, settings, size=spacing(points))
        edges = topology.edges(result.triangles)
        a, b = result.points[edges[:, 0]], result.points[edges[:, 1]]
        ratio = np.hypot(*(a - b).T) / spacing(0.5 * (a + b))
        return np.std(np.log(ratio))

    assert spread("springs") < spread("laplacian")


def test_input_is_untouched_and_the_result_repeats():
    _, points, triangles, fixed = rough_mesh()
    copies = points.copy(), triangles.copy()
    one = smooth(points, triangles, fixed, size=spacing(points))
    np.testing.assert_array_equal(points, copies[0])
    np.testing.assert_array_equal(triangles, copies[1])
    two = smooth(points, triangles, fixed, size=spacing(points))
    assert one.points.tobytes() == two.points.tobytes()
    assert one.triangles.tobytes() == two.triangles.tobytes()


def test_neighbours_agree_with_the_topology_room():
    _, points, triangles, _ = rough_mesh()
    ours = _kernels.find_neighbours(triangles, len(points))
    # That room numbers sides from corner i to corner i + 1.
    theirs = topology.neighbours(triangles)
    np.testing.assert_array_equal(ours[:, [2, 0, 1]], theirs)
