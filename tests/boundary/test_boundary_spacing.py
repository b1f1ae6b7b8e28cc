import numpy as np
import pytest
from boundary_coasts import gaps, rough_line
from hypothesis import given, settings
from hypothesis import strategies as st

from tidemesh.boundary import enforce_spacing
from tidemesh.boundary.spacing import within_bounds


def rough_ring(seed, count=400, radius=10.0, roughness=0.02):
    rng = np.random.default_rng(seed)
    angle = np.linspace(0.0, 2.0 * np.pi, count, endpoint=False)
    walk = np.cumsum(rng.normal(size=count)) * roughness
    walk -= walk[-1] * np.arange(1, count + 1) / count
    r = radius * (1.0 + walk)
    return np.stack([r * np.cos(angle), r * np.sin(angle)], axis=1)


def steps(line):
    return np.hypot(*np.diff(line, axis=0).T)


@settings(max_examples=8, deadline=None)
@given(st.integers(0, 10_000), st.floats(0.3, 3.0))
def test_ring_gaps_lie_between_minimum_and_1_75_minima(seed, minimum):
    nodes = enforce_spacing(rough_ring(seed), True, minimum)
    assert gaps(nodes).min() >= minimum * (1 - 1e-9)
    assert gaps(nodes).max() <= 1.75 * minimum * (1 + 1e-9)


@settings(max_examples=8, deadline=None)
@given(st.integers(0, 10_000), st.integers(0, 399), st.booleans())
def test_ring_does_not_depend_on_start_or_direction(seed, shift, turned):
    ring = rough_ring(seed)
    other = np.roll(ring, shift, axis=0)
    other = other[::-1] if turned else other
    nodes, same = enforce_spacing(ring, True, 1.0), enforce_spacing(other, True, 1.0)
    if turned:
        same = np.roll(same[::-1], 1, axis=0)
    np.testing.assert_array_equal(nodes, same)


@settings(max_examples=8, deadline=None)
@given(st.integers(0, 10_000), st.booleans())
def test_twice_is_once(seed, closed):
    line = rough_ring(seed)
    once = enforce_spacing(line, closed, 1.0)
    np.testing.assert_array_equal(enforce_spacing(once, closed, 1.0), once)


@settings(max_examples=8, deadline=None)
@given(st.integers(0, 10_000), st.floats(0.005, 0.1))
def test_open_line_keeps_its_ends_and_its_reverse_gives_the_same(seed, minimum):
    line = rough_line(np.random.default_rng(seed), 8, 0.3)
    nodes = enforce_spacing(line, False, minimum)
    np.testing.assert_array_equal(nodes[[0, -1]], line[[0, -1]])
    assert within_bounds(nodes, False, lambda p: np.full(len(p), minimum), 1.75)
    back = enforce_spacing(line[::-1], False, minimum)
    np.testing.assert_array_equal(nodes, back[::-1])


@pytest.mark.parametrize(
    ("length", "wanted"),
    [(0.5, 1), (1.0, 1), (1.75, 1), (1.9, 1), (2.0, 2), (3.4, 2), (3.6, 3), (40.0, 32)],
)
def test_straight_line_is_divided_evenly(length, wanted):
    nodes = enforce_spacing(np.array([[0.0, 0.0], [length, 0.0]]), False, 1.0)
    assert abs(len(nodes) - 1 - wanted) <= length / 10
    if length >= 2.0:
        assert steps(nodes).min() >= 1 - 1e-9
        assert steps(nodes).max() <= 1.75 + 1e-9


def test_a_line_within_bounds_is_left_alone():
    rng = np.random.default_rng(3)
    line = np.cumsum(
        np.stack([rng.uniform(1.0, 1.7, 50), np.zeros(50)], axis=1), axis=0
    )
    np.testing.assert_array_equal(enforce_spacing(line, False, 1.0), line)


def test_result_stays_close_to_the_line():
    angle = np.linspace(0.0, 2.0 * np.pi, 2000, endpoint=False)
    circle = 10.0 * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    nodes = enforce_spacing(circle, True, 1.0)
    np.testing.assert_allclose(np.hypot(*nodes.T), 10.0)


def test_an_outstanding_cape_is_kept():
    x = np.linspace(0.0, 20.0, 201)
    cape = np.maximum(0.0, 3.0 - 3.0 * np.abs(x - 9.37))
    x[94] = 9.37
    line = np.stack([x, cape], axis=1)
    nodes = enforce_spacing(line, False, 1.0)
    assert nodes[:, 1].max() > 2.5


def test_minimum_may_change_along_the_line():
    line = np.stack([np.linspace(0.0, 100.0, 5001), np.zeros(5001)], axis=1)
    nodes = enforce_spacing(line, False, lambda p: np.where(p[:, 0] < 50.0, 1.0, 4.0))
    left = steps(nodes[nodes[:, 0] < 49.0])
    right = steps(nodes[nodes[:, 0] > 54.0])
    assert left.min() >= 1 - 1e-9
    assert left.max() <= 1.75 + 1e-9
    assert right.min() >= 4 - 1e-9
    assert right.max() <= 7 + 1e-9


def test_a_ring_too_small_comes_back_with_fewer_than_three_nodes_or_out_of_bounds():
    triangle = np.array([[0.0, 0.0], [0.1, 0.0], [0.0, 0.1]])
    nodes = enforce_spacing(triangle, True, 10.0)
    assert len(nodes) < 3
