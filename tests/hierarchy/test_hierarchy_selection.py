import numpy as np
import pytest
import shapely
from hierarchy_coasts import polygon_of, ragged_bay, rectangle
from scipy.spatial import cKDTree

from tidemesh.datatypes import LAND
from tidemesh.errors import InputError
from tidemesh.hierarchy import HierarchySettings, count_points, select_points


def constant(size):
    return lambda points: np.full(len(points), size)


def off_shore(points):
    return 600.0 + 0.12 * np.maximum(points[:, 0], 0.0)


def test_constant_target_gives_the_hexagonal_lattice_of_that_spacing():
    selection = select_points(rectangle(2000.0, 1500.0), constant(100.0))
    interior = selection.interior
    inner = (interior > 250.0).all(axis=1) & (interior < [1750.0, 1250.0]).all(axis=1)
    near = cKDTree(interior).query(interior[inner], k=7)[0][:, 1:]
    np.testing.assert_allclose(near, 100.0)
    expected = 2.0 / np.sqrt(3.0) * 2000.0 * 1500.0 / 100.0**2
    assert selection.n_points == pytest.approx(expected, rel=0.08)


@pytest.mark.parametrize("seed", range(3))
def test_interior_nodes_lie_in_the_water_and_clear_of_its_boundary(seed):
    selection = select_points(ragged_bay(seed), off_shore)
    water = polygon_of(selection.domain)
    shapely.prepare(water)
    assert shapely.contains_xy(water, *selection.interior.T).all()
    distance = shapely.distance(shapely.points(selection.interior), water.boundary)
    assert (distance >= 0.5999 * selection.spacing(selection.interior)).all()
    # And no gap is left between the boundary and the first nodes.
    nodes = np.concatenate(
        [selection.interior, *(ring.points for ring in selection.domain.rings)]
    )
    probe = shapely.get_coordinates(
        shapely.points(np.random.default_rng(0).uniform(0.0, 50_000.0, (4000, 2)))
    )
    probe = probe[shapely.contains_xy(water, *probe.T)]
    gap, _ = cKDTree(nodes).query(probe)
    assert (gap / selection.spacing(probe)).max() < 1.3


def test_same_input_same_nodes():
    one = select_points(ragged_bay(2), off_shore)
    two = select_points(ragged_bay(2), off_shore)
    assert one.interior.tobytes() == two.interior.tobytes()


@pytest.mark.parametrize("rule", ["strict", "graded", "balanced"])
def test_smaller_sizes_give_no_fewer_nodes(rule):
    domain = ragged_bay(0)
    settings = HierarchySettings(rule=rule)
    counts = [
        count_points(domain, lambda p, s=s: s * off_shore(p), settings)
        for s in (2.0, 1.6, 1.3, 1.0, 0.8, 0.6)
    ]
    assert counts == sorted(counts)


def test_count_changes_smoothly_with_the_scale():
    # What a node budget of 1 % needs: scaled sizes scale the lattice.
    domain = ragged_bay(5)

    def size(points):
        return 150.0 + 0.025 * np.hypot(points[:, 0], points[:, 1] - 20_000.0)

    scales = np.linspace(1.0, 0.9, 6)
    counts = np.array(
        [count_points(domain, lambda p, s=s: s * size(p)) for s in scales]
    )
    assert counts[0] > 3000
    assert (np.diff(counts) > 0).all()
    # The boundary's share grows more slowly than the square.
    smooth = counts * scales**1.95
    assert np.ptp(smooth) / smooth.mean() < 0.04


def test_near_shore_nodes_are_kept():
    domain = ragged_bay(4)
    base = select_points(domain, constant(700.0)).interior
    settings = HierarchySettings(
        near_shore="keep", minimum_size_m=300.0, strip_width_m=3000.0, rule="graded"
    )
    selection = select_points(
        domain,
        lambda p: 700.0 + 0.3 * np.maximum(p[:, 0], 0.0),
        settings,
        near_shore_points=base,
    )
    land = shapely.multilinestrings(
        [
            shapely.LineString([a, b])
            for ring in domain.rings
            for a, b, kind in zip(
                ring.points, np.roll(ring.points, -1, axis=0), ring.segment_kind
            )
            if kind == LAND
        ]
    )
    strip = base[shapely.distance(shapely.points(base), land) <= 3000.0]
    assert selection.report["strip_points"] == len(strip)
    np.testing.assert_array_equal(selection.interior[-len(strip) :], strip)
    offshore = selection.interior[: -len(strip)]
    assert shapely.distance(shapely.points(offshore), land).min() > 3000.0
    gap, _ = cKDTree(strip).query(offshore)
    assert (gap >= 0.65 * selection.spacing(offshore)).all()


@pytest.mark.parametrize("value", [np.nan, np.inf, 0.0, -5.0])
def test_useless_sizes_are_an_input_error(value):
    def spacing(points):
        return np.where(points[:, 0] > 500.0, value, 100.0)

    with pytest.raises(InputError, match="expected a positive finite spacing"):
        select_points(rectangle(1000.0, 1000.0), spacing)
