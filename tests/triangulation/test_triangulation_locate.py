import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial import Delaunay
from triangulation_meshes import mesh, polygon

from tidemesh.datatypes import SizeField
from tidemesh.triangulation import topology
from tidemesh.triangulation.locate import Locator, as_function


def brute_force(points, triangles, query):
    """Smallest barycentric coordinate of every query in every triangle."""

    def cross(u, v):
        return u[..., 0] * v[..., 1] - u[..., 1] * v[..., 0]

    a, b, c = points[triangles].transpose(1, 0, 2)
    least = np.full((len(query), len(triangles)), np.inf)
    for u, v in [(b, c), (c, a), (a, b)]:
        part = cross(v - u, query[:, None] - u) / cross(b - a, c - a)
        least = np.minimum(least, part)
    return least


@settings(max_examples=10, deadline=None)
@given(seed=st.integers(0, 10_000), islands=st.integers(0, 4))
def test_find_agrees_with_brute_force(seed, islands):
    _, points, triangles = mesh(seed, islands, n=150)
    query = np.random.default_rng(seed).uniform(-1300.0, 1300.0, (800, 2))
    least = brute_force(points, triangles, query)
    triangle, weight = Locator(points, triangles).find(query)
    inside = least.max(axis=1) >= 0.0
    assert np.array_equal(triangle >= 0, inside)
    assert np.array_equal(triangle[inside], least.argmax(axis=1)[inside])
    place = np.einsum("ij,ijk->ik", weight[inside], points[triangles[triangle[inside]]])
    assert place == pytest.approx(query[inside], abs=1e-9)
    assert np.isnan(weight[~inside]).all()


def test_nodes_and_points_on_edges_are_inside():
    _, points, triangles = mesh(8, islands=3)
    points = points + np.array([4.5e6, -7.1e5])
    locator = Locator(points, triangles)
    triangle, weight = locator.find(points)
    own = np.arange(len(points))
    assert (triangle >= 0).all()
    assert weight.max(axis=1) == pytest.approx(1.0)
    assert np.array_equal(triangles[triangle, weight.argmax(axis=1)], own)
    edges = topology.edges(triangles)
    for part in (0.5, 0.1, 1.0 / 3.0):
        on_edge = (1.0 - part) * points[edges[:, 0]] + part * points[edges[:, 1]]
        triangle, weight = locator.find(on_edge)
        assert (triangle >= 0).all()
        assert weight.min() >= 0.0
        corners = triangles[triangle]
        assert (corners[:, :, None] == edges[:, None, :]).any(axis=1).all()


def graded(n, seed=0):
    """Spacing in proportion to the radius, 1 m to 1e5 m."""
    rng = np.random.default_rng(seed)
    radius = 10.0 ** rng.uniform(0.0, 5.0, n)
    angle = rng.uniform(0.0, 2.0 * np.pi, n)
    points = np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=1)
    return points, Delaunay(points).simplices.astype(np.int64)


def test_strongly_graded_mesh():
    points, triangles = graded(20_000)
    locator = Locator(points, triangles)
    rng = np.random.default_rng(1)
    wanted = rng.integers(0, len(triangles), 20_000)
    weight = rng.dirichlet(np.ones(3) * 3.0, 20_000)
    query = np.einsum("ij,ijk->ik", weight, points[triangles[wanted]])
    found, _ = locator.find(query)
    assert np.array_equal(found, wanted)
    # The lists stay in proportion to the mesh.
    assert len(locator._entries) < 12 * len(triangles)
    assert len(locator._start) < 4 * len(triangles)
    assert np.diff(locator._start)[locator._child < 0].max() <= 64


def test_a_sliver_of_a_domain_and_a_single_triangle():
    x = np.arange(2000.0) * 100.0
    points = np.concatenate([np.stack([x, 0 * x], 1), np.stack([x, 0 * x + 1.0], 1)])
    k = np.arange(1999)
    triangles = np.concatenate(
        [np.stack([k, k + 1, k + 2001], 1), np.stack([k, k + 2001, k + 2000], 1)]
    )
    triangle, _ = Locator(points, triangles).find(points[triangles].mean(axis=1))
    assert np.array_equal(triangle, np.arange(len(triangles)))
    one = Locator(np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]]), np.array([[0, 2, 1]]))
    triangle, weight = one.find(np.array([[0.25, 0.25], [0.75, 0.75], [0.0, 0.0]]))
    assert triangle.tolist() == [0, -1, 0]
    assert weight[0] == pytest.approx([0.5, 0.25, 0.25])


def test_linear_functions_are_reproduced():
    _, points, triangles = mesh(9, islands=2)
    inside = points[triangles].mean(axis=1)
    locator = Locator(points, triangles)

    def linear(xy):
        return 3.0 + 0.5 * xy[:, 0] - 0.25 * xy[:, 1]

    real = locator.interpolate(linear(points), inside)
    assert real.dtype == np.float64
    assert real == pytest.approx(linear(inside), rel=1e-12, abs=1e-9)
    both = np.stack([linear(points), (1.0 - 2.0j) * linear(points)])
    values = locator.interpolate(both, inside)
    assert values.shape == (2, len(inside))
    assert values[1] == pytest.approx((1.0 - 2.0j) * linear(inside), abs=1e-8)


def test_outside_means_the_nearest_place_on_the_boundary():
    domain, points, triangles = mesh(10, islands=4)
    query = np.random.default_rng(2).uniform(-4000.0, 4000.0, (2000, 2))
    locator = Locator(points, triangles)
    triangle, weight, distance = locator.nearest(query)
    assert (triangle >= 0).all()
    area = polygon(domain)
    assert distance == pytest.approx(
        shapely.distance(area, shapely.points(query)), abs=1e-8
    )
    place = np.einsum("ij,ijk->ik", weight, points[triangles[triangle]])
    moved = np.linalg.norm(place - query, axis=1)
    assert moved == pytest.approx(distance, abs=1e-8)
    field = points[:, 0]
    assert locator.interpolate(field, query) == pytest.approx(place[:, 0], abs=1e-8)
    outside = distance > 0.0
    nan = locator.interpolate(field, query, outside="nan")
    assert np.array_equal(np.isnan(nan), outside)


def test_points_that_are_not_finite_come_out_as_nan():
    _, points, triangles = mesh(11)
    query = np.array([[np.nan, 0.0], [np.inf, 0.0], [0.0, 0.0]])
    locator = Locator(points, triangles)
    assert locator.find(query)[0][:2].tolist() == [-1, -1]
    value = locator.interpolate(points[:, 0] * 1j, query)
    assert np.isnan(value[0])
    assert value[2] == pytest.approx(0.0, abs=1e-9)


def test_size_field_as_function_reads_locked_and_strided_arrays():
    _, points, triangles = mesh(12)
    spacing = as_function(SizeField(points, triangles, 100.0 + 0.01 * points[:, 1]))
    query = np.zeros((6, 2))[::2]
    query.flags.writeable = False
    assert spacing(query) == pytest.approx([100.0] * 3)
    assert spacing(np.empty((0, 2))).shape == (0,)


def test_wrong_arguments():
    _, points, triangles = mesh(13)
    locator = Locator(points, triangles)
    with pytest.raises(ValueError, match=r"points must have shape \(n, 2\)"):
        locator.find(np.zeros(2))
    with pytest.raises(ValueError, match="values must have shape"):
        locator.interpolate(np.zeros(3), points)
    with pytest.raises(ValueError, match='outside must be "nearest" or "nan"'):
        locator.interpolate(points[:, 0], points, outside="zero")
    with pytest.raises(ValueError, match="without triangles"):
        Locator(points, np.empty((0, 3), dtype=int))
