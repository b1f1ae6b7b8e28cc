import math

import numpy as np
import pytest
import shapely

from tidemesh.geometry import polygons

SQUARE = np.array([[0.0, 0.0], [2.0, 0.0], [2.0, 2.0], [0.0, 2.0]])


@pytest.mark.parametrize("shift", range(4))
def test_ring_area_is_unchanged_by_rotation_and_changes_sign_by_reversal(shift):
    ring = np.roll(SQUARE, shift, axis=0) + 1e6
    assert polygons.ring_area(ring) == 4.0
    assert polygons.ring_area(ring[::-1]) == -4.0


def test_ring_area_of_a_regular_polygon():
    angle = np.linspace(0.0, 2.0 * np.pi, 12, endpoint=False)
    ring = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    assert polygons.ring_area(ring) == pytest.approx(6.0 * math.sin(math.pi / 6.0))


@pytest.mark.parametrize("turned", [False, True])
def test_rings_have_the_inside_on_their_left(turned):
    hole = 0.5 * SQUARE + 0.5
    step = -1 if turned else 1
    polygon = shapely.Polygon(SQUARE[::step], [hole[::step]])
    outer, inner = polygons.polygon_rings(polygon)
    assert polygons.ring_area(outer) == 4.0
    assert polygons.ring_area(inner) == -1.0
    assert polygons.from_rings([outer, inner]).equals(polygon)


def test_holes_and_their_removal():
    small, large = shapely.box(0.1, 0.1, 0.2, 0.2), shapely.box(0.5, 0.5, 1.5, 1.5)
    polygon = shapely.Polygon(SQUARE) - small - large
    area = shapely.area(polygons.holes(polygon))
    assert sorted(area) == pytest.approx([0.01, 1.0])
    assert polygons.without_holes(polygon, area < 0.5).area == pytest.approx(3.0)


def test_polygon_parts_leaves_lines_and_points_out():
    mixed = shapely.GeometryCollection(
        [
            shapely.Point(0, 0),
            shapely.LineString([(0, 0), (1, 1)]),
            shapely.MultiPolygon([shapely.box(0, 0, 1, 1), shapely.box(2, 2, 3, 3)]),
            shapely.GeometryCollection([shapely.box(5, 5, 6, 6)]),
        ]
    )
    assert len(polygons.polygon_parts(mixed)) == 3
    assert polygons.polygonal(mixed).area == pytest.approx(3.0)
    assert polygons.polygon_parts(None) == []
    assert polygons.polygonal(shapely.Point(0, 0)).is_empty


def test_divide_path_keeps_ends_and_steps_evenly():
    path = np.array([[0.0, 0.0], [3.0, 0.0], [3.0, 4.0]])
    nodes = polygons.divide_path(path, 1.05)
    assert len(nodes) == 8
    np.testing.assert_allclose(np.diff(polygons.path_length(nodes)), 1.0)
    np.testing.assert_array_equal(nodes[[0, -1]], path[[0, -1]])


def test_divide_path_measured_elsewhere():
    path = np.array([[0.0, 0.0], [1.0, 0.0], [2.0, 0.0]])
    stretched = np.array([[0.0, 0.0], [1.0, 0.0], [4.0, 0.0]])
    nodes = polygons.divide_path(path, 1.0, stretched)
    np.testing.assert_allclose(nodes[:, 0], [0.0, 1.0, 4.0 / 3.0, 5.0 / 3.0, 2.0])
