import numpy as np
import pytest
import shapely
from hierarchy_coasts import domain_of, polygon_of, ragged_bay, rectangle

from tidemesh.datatypes import LAND, OCEAN, Domain, Ring
from tidemesh.errors import InputError, MeshError
from tidemesh.hierarchy import HierarchySettings
from tidemesh.hierarchy.grading import BoundaryLimitedSpacing, graded_lengths
from tidemesh.hierarchy.shoreline import resample_rings

DEFAULT = HierarchySettings()


def constant(size):
    return lambda points: np.full(len(points), size)


def lengths(ring):
    step = np.roll(ring.points, -1, axis=0) - ring.points
    return np.hypot(step[:, 0], step[:, 1])


def test_rectangle_keeps_its_corners_and_gets_equal_segments():
    new = resample_rings(rectangle(1000.0, 600.0), constant(100.0), DEFAULT)
    ring = new.domain.rings[0]
    np.testing.assert_allclose(lengths(ring), 100.0)
    assert len(ring.points) == 32
    assert new.report["shore_area_moved_m2"] == pytest.approx(0.0, abs=1e-6)
    assert polygon_of(new.domain).area == pytest.approx(600_000.0)


def test_segments_follow_a_graded_size():
    def spacing(points):
        return 20.0 + 0.1 * points[:, 0]

    new = resample_rings(rectangle(2000.0, 2000.0), spacing, DEFAULT)
    ring = new.domain.rings[0]
    middle = 0.5 * (ring.points + np.roll(ring.points, -1, axis=0))
    ratio = lengths(ring) / spacing(middle)
    assert ratio.min() > 0.85
    assert ratio.max() < 1.15


def test_circle_is_divided_evenly():
    circle = domain_of(shapely.Point(0.0, 0.0).buffer(1000.0, quad_segs=400))
    ring = resample_rings(circle, constant(100.0), DEFAULT).domain.rings[0]
    assert len(ring.points) == 63
    np.testing.assert_allclose(lengths(ring), 99.7, rtol=2e-3)


@pytest.mark.parametrize("size", [100.0, 300.0, 800.0])
def test_area_of_a_round_bay_with_a_round_island_is_conserved(size):
    # Chords of 800 m cut a tenth off a disc of radius 1000 m.
    bay, island = (
        shapely.Point(0.0, 0.0).buffer(radius, quad_segs=400)
        for radius in (1000.0, 400.0)
    )
    water = domain_of(bay.difference(island))
    new = resample_rings(water, constant(size), DEFAULT)
    for ring, radius in zip(new.domain.rings, (1000.0, 400.0)):
        area = shapely.Polygon(ring.points).area
        assert area == pytest.approx(np.pi * radius**2, rel=2e-3)
    change = polygon_of(new.domain).area - polygon_of(water).area
    assert new.report["water_area_change_m2"] == pytest.approx(change, abs=1e-3)


def test_a_ragged_coast_loses_four_times_less_area_than_on_chords():
    lost = {}
    for conserved in (True, False):
        settings = HierarchySettings(conserve_area=conserved)
        lost[conserved] = sum(
            abs(polygon_of(new.domain).area - polygon_of(ragged_bay(seed)).area)
            for seed in range(6)
            for new in [resample_rings(ragged_bay(seed), constant(2500.0), settings)]
        )
    assert lost[True] < 0.25 * lost[False]


@pytest.mark.parametrize("line_rule", ["equidistributed", "tree"])
def test_points_between_land_and_ocean_are_kept(line_rule):
    points = np.array([[0, 0], [730, 0], [1000, 0], [1000, 810], [410, 810], [0, 810]])
    kind = np.array([LAND, OCEAN, OCEAN, OCEAN, LAND, LAND])
    domain = Domain(
        (Ring(points, kind),), domain_of(shapely.box(0, 0, 1, 1)).projection
    )
    settings = HierarchySettings(line_rule=line_rule)
    ring = resample_rings(domain, constant(90.0), settings).domain.rings[0]
    changes = ring.points[ring.segment_kind != np.roll(ring.segment_kind, 1)]
    assert sorted(map(tuple, changes)) == [(410.0, 810.0), (730.0, 0.0)]


@pytest.mark.parametrize("line_rule", ["equidistributed", "tree"])
@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("size", [400.0, 2500.0, 12000.0])
@pytest.mark.parametrize("conserve_area", [True, False])
def test_topology_of_a_ragged_coast_is_kept(seed, size, line_rule, conserve_area):
    domain = ragged_bay(seed)
    settings = HierarchySettings(line_rule=line_rule, conserve_area=conserve_area)
    new = resample_rings(domain, constant(size), settings).domain
    water = polygon_of(new)
    assert shapely.is_valid_reason(water) == "Valid Geometry"
    assert len(new.rings) == len(domain.rings)
    shore = polygon_of(domain).boundary
    for old, ring in zip(domain.rings, new.rings):
        assert len(ring.points) >= (4 if line_rule == "equidistributed" else 3)
        aside = shapely.distance(shapely.points(ring.points), shore)
        step = lengths(ring)
        reach = 0.4 * np.minimum(step, np.roll(step, 1)) if conserve_area else 1e-6
        assert (aside <= reach).all()
        assert (
            shapely.LinearRing(ring.points).is_ccw
            == shapely.LinearRing(old.points).is_ccw
        )
    # Every island is still surrounded by the same water.
    outer = shapely.Polygon(new.rings[0].points)
    for ring in new.rings[1:]:
        assert outer.contains(shapely.Polygon(ring.points))


def test_no_segment_crosses_a_channel_that_it_is_long_against():
    # A channel 60 m wide and 4 km long off a basin.
    water = shapely.box(0, 0, 3000, 3000).union(shapely.box(2990, 1500, 7000, 1560))
    new = resample_rings(domain_of(water), constant(400.0), DEFAULT)
    ring = new.domain.rings[0]
    middle = 0.5 * (ring.points + np.roll(ring.points, -1, axis=0))
    channel = (middle[:, 0] > 3200.0) & (middle[:, 0] < 6700.0)
    assert lengths(ring)[channel].max() < 1.2 * 2.0 * 60.0
    assert polygon_of(new.domain).area == pytest.approx(water.area, rel=1e-3)
    # The size grows from the mouth no faster than the gradation.
    size = new.spacing(np.array([[5000.0, 1530.0], [2900.0, 1530.0], [200.0, 200.0]]))
    assert size[0] < 150.0
    assert size[1] < 250.0
    assert size[2] > 350.0


def test_island_behind_a_spit_is_not_cut_off():
    # A cove whose mouth is narrower than a segment, and an island in it.
    cove = shapely.box(400, 0, 600, 300).buffer(60)
    water = shapely.box(-2000, -4000, 3000, 0).union(cove)
    water = water.difference(shapely.box(470, 100, 530, 180))
    new = resample_rings(domain_of(water), constant(1500.0), DEFAULT).domain
    assert len(new.rings) == 2
    outer, island = (shapely.Polygon(ring.points) for ring in new.rings)
    assert outer.contains(island)
    assert polygon_of(new).is_valid


def test_the_result_does_not_depend_on_where_a_ring_begins_or_on_their_order():
    domain = ragged_bay(3)
    shuffled = Domain(
        (
            Ring(
                np.roll(domain.rings[0].points, 17, axis=0),
                np.roll(domain.rings[0].segment_kind, 17),
            ),
            *(
                Ring(np.roll(ring.points, 5, axis=0), ring.segment_kind)
                for ring in domain.rings[:0:-1]
            ),
        ),
        domain.projection,
    )
    one = resample_rings(domain, constant(1500.0), DEFAULT).domain.rings
    two = resample_rings(shuffled, constant(1500.0), DEFAULT).domain.rings
    for ring, other in zip(one, [two[0], *two[:0:-1]]):
        np.testing.assert_allclose(ring.points, other.points, rtol=0, atol=1e-6)
        np.testing.assert_array_equal(ring.segment_kind, other.segment_kind)


def test_kept_shore_stays_and_the_ocean_is_divided():
    domain = ragged_bay(1)
    settings = HierarchySettings(near_shore="keep", minimum_size_m=300.0)
    new = resample_rings(domain, constant(2000.0), settings).domain
    for old, ring in zip(domain.rings, new.rings):
        land = old.points[
            (old.segment_kind == LAND) | (np.roll(old.segment_kind, 1) == LAND)
        ]
        kept = set(map(tuple, ring.points))
        assert all(tuple(point) in kept for point in land)
    ring = new.rings[0]
    ocean = lengths(ring)[ring.segment_kind == OCEAN]
    assert ocean.max() < 2700.0
    assert ocean.min() > 1300.0


def test_crossing_input_is_an_error():
    points = np.array([[0, 0], [1000, 0], [1000, 1000], [400, -100], [0, 1000]])
    domain = Domain(
        (Ring(points, np.zeros(5)),), domain_of(shapely.box(0, 0, 1, 1)).projection
    )
    with pytest.raises(MeshError, match="crosses itself near"):
        resample_rings(domain, constant(100.0), DEFAULT)


def test_more_boundary_points_than_memory_are_an_input_error():
    with pytest.raises(InputError, match="need more than 5,000,000 boundary points"):
        resample_rings(rectangle(1e5, 1e5), constant(1e-9), DEFAULT)


def test_graded_lengths_are_lipschitz_and_never_larger():
    generator = np.random.default_rng(2)
    points = generator.uniform(0.0, 1000.0, (300, 2))
    length = 10.0 ** generator.uniform(0.0, 2.5, 300)
    graded = graded_lengths(points, length, 0.25)
    assert (graded <= length).all()
    step = np.hypot(*(points[:, None] - points[None]).transpose(2, 0, 1))
    exact = (length[None] + 0.25 * step).min(axis=1)
    assert (graded >= exact - 1e-9).all()
    # The nearest eight of an octave stand for the octave.
    assert (graded <= 2.0 * exact).all()


def test_boundary_limited_spacing_grows_off_a_fine_shore():
    shore = np.stack([np.arange(0.0, 1000.0, 10.0), np.zeros(100)], axis=1)
    limited = BoundaryLimitedSpacing(constant(100.0), shore, np.full(100, 10.0), 0.2)
    points = np.array([[500.0, 0.0], [500.0, 100.0], [500.0, 1000.0]])
    np.testing.assert_allclose(limited(points), [10.0, 30.0, 100.0])
    coarse = BoundaryLimitedSpacing(constant(8.0), shore, np.full(100, 10.0), 0.2)
    np.testing.assert_array_equal(coarse(points), 8.0)
