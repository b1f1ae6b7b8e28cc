import numpy as np
import pytest
from triangulation_meshes import mesh

from tidemesh.triangulation import quality

SHAPES = np.array(
    [
        [[0.0, 0.0], [1.0, 0.0], [0.5, np.sqrt(0.75)]],
        [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]],
        [[0.0, 0.0], [1.0, 0.0], [2.0, 0.0]],
        [[0.0, 0.0], [0.0, 1.0], [1.0, 0.0]],
    ]
)
POINTS = SHAPES.reshape(-1, 2)
TRIANGLES = np.arange(12).reshape(-1, 3)


def test_known_triangles():
    # Equilateral; right-angled isosceles: 4 sqrt(3) (1/2) / (1 + 1 + 2); flat; turned.
    wanted = [1.0, np.sqrt(0.75), 0.0, -np.sqrt(0.75)]
    assert quality.shape_quality(POINTS, TRIANGLES) == pytest.approx(wanted)
    assert quality.area(POINTS, TRIANGLES) == pytest.approx(
        [np.sqrt(3.0) / 4.0, 0.5, 0.0, -0.5]
    )
    degrees = np.degrees(quality.angles(POINTS, TRIANGLES))
    assert degrees[:3] == pytest.approx(
        np.array([[60.0, 60.0, 60.0], [90.0, 45.0, 45.0], [0.0, 180.0, 0.0]])
    )
    assert quality.edge_length(POINTS, TRIANGLES)[1] == pytest.approx(
        [1.0, np.sqrt(2.0), 1.0]
    )


def test_a_triangle_of_one_point_has_quality_zero():
    assert quality.shape_quality(np.zeros((3, 2)), np.array([[0, 1, 2]])) == [0.0]


def test_quality_and_angles_do_not_know_place_turn_or_scale():
    _, points, triangles = mesh(7)
    turn = np.array([[0.6, -0.8], [0.8, 0.6]])
    moved = 3.5 * points @ turn.T + [1e4, -2e4]
    assert quality.shape_quality(moved, triangles) == pytest.approx(
        quality.shape_quality(points, triangles), abs=1e-9
    )
    assert quality.angles(points, triangles).sum(axis=1) == pytest.approx(np.pi)
    assert quality.shape_quality(points, triangles).max() <= 1.0


def hexagon():
    angle = np.pi / 3.0 * np.arange(6)
    rim = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    points = np.concatenate([[[0.0, 0.0]], rim])
    k = np.arange(6)
    return points, np.stack([np.zeros(6, int), k + 1, (k + 1) % 6 + 1], axis=1)


def test_summary_of_the_equilateral_patch():
    summary = quality.quality_summary(*hexagon())
    assert all(type(value) is float for value in summary.values())
    wanted = {
        "nodes": 7.0,
        "triangles": 6.0,
        "quality_mean": 1.0,
        "quality_minimum": 1.0,
        "angle_minimum_deg": 60.0,
        "angle_maximum_deg": 60.0,
        "angle_30_120_fraction": 1.0,
        "edge_minimum_m": 1.0,
        "edge_maximum_m": 1.0,
        "area_m2": 1.5 * np.sqrt(3.0),
        "valence_minimum": 6.0,
        "valence_maximum": 6.0,
        "valence_4_8_fraction": 1.0,
        "area_ratio_within_2_fraction": 1.0,
        "area_ratio_maximum": 1.0,
    }
    assert {name: summary[name] for name in wanted} == pytest.approx(wanted)


def test_valence_counts_inner_nodes_only():
    assert quality.valence_histogram(*hexagon()).tolist() == [0, 0, 0, 0, 0, 0, 1]


def test_summary_without_inner_nodes_or_edges():
    points = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])
    summary = quality.quality_summary(points, np.array([[0, 1, 2]]))
    assert summary["valence_maximum"] == 0.0
    assert summary["area_ratio_maximum"] == 1.0
