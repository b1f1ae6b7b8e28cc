import math

import numpy as np
import pytest
import shapely
from boundary_coasts import (
    WIDTH,
    case,
    count,
    fractal_land,
    gaps,
    half_plane,
    outline,
    total,
)

from tidemesh.boundary import build_domain
from tidemesh.datatypes import LAND, OCEAN
from tidemesh.geometry.polygons import ring_area

RADIUS = 30_000.0


def with_inlet(width, *, length=8000.0, basin=0.0):
    """The half plane with a channel to the north, and a square basin at its end."""
    channel = shapely.box(-width / 2, -1.0, width / 2, length)
    half = basin / 2
    pond = shapely.box(-half, length, half, length + basin)
    return half_plane() - channel - pond


def disc_segments(domain):
    ring = domain.rings[0]
    return ring.points[ring.segment_kind == OCEAN]


# ---- the half disc: everything known ----------------------------------------------


def test_half_disc():
    domain = build_domain(half_plane(), case())
    (ring,) = domain.rings
    is_open = ring.segment_kind == OCEAN
    pieces = round(math.pi * RADIUS / 2000.0)
    assert is_open.sum() == pieces
    # Ocean nodes lie evenly on the circle, from land to land.
    chord = 2.0 * RADIUS * math.sin(0.5 * math.pi / pieces)
    np.testing.assert_allclose(gaps(ring.points)[is_open], chord, rtol=1e-6)
    np.testing.assert_allclose(np.hypot(*ring.points[is_open].T), RADIUS, rtol=1e-6)
    ends = ring.points[[0, pieces]]
    np.testing.assert_allclose(ends, [[-RADIUS, 0.0], [RADIUS, 0.0]], atol=0.1)
    area = 0.5 * pieces * RADIUS**2 * math.sin(math.pi / pieces)
    assert ring_area(ring.points) == pytest.approx(area, rel=1e-6)
    land = gaps(ring.points)[~is_open]
    assert land.min() >= 1000.0 * (1 - 1e-9)
    assert land.max() <= 1750.0 * (1 + 1e-9)
    assert total(domain, "shoreline resampled") == pytest.approx(0.0, abs=1.0)


def test_coarse_land_does_not_coarsen_the_arc():
    domain = build_domain(half_plane(), case(min_spacing_m=6000.0))
    ring = domain.rings[0]
    is_open = ring.segment_kind == OCEAN
    assert is_open.sum() == round(math.pi * RADIUS / 2000.0)
    np.testing.assert_allclose(np.hypot(*ring.points[is_open].T), RADIUS, rtol=1e-4)


def test_land_order_direction_and_start_do_not_matter():
    islands = [
        shapely.Point(x, -8000.0).buffer(1500.0) for x in (-15_000.0, 0.0, 12_000.0)
    ]
    first = build_domain(shapely.MultiPolygon([half_plane(), *islands]), case())
    turned = [
        shapely.Polygon(np.roll(shapely.get_coordinates(p)[:-1], 3, axis=0)[::-1])
        for p in [*islands[::-1], half_plane()]
    ]
    second = build_domain(shapely.MultiPolygon(turned), case())
    assert len(first.rings) == len(second.rings) == 4
    for a, b in zip(first.rings, second.rings):
        np.testing.assert_array_equal(a.points, b.points)
        np.testing.assert_array_equal(a.segment_kind, b.segment_kind)
    assert first.ledger == second.ledger


def test_polygon_ocean_keeps_its_corners():
    corners = [[-20_000, 10_000], [-20_000, -9000], [22_000, -9000], [22_000, 10_000]]
    domain = build_domain(
        half_plane(), case(ocean={"kind": "polygon", "polygon_deg": corners})
    )
    points = {tuple(np.round(p, 1)) for p in domain.rings[0].points}
    wanted = {(-20_000.0, -9000.0), (22_000.0, -9000.0)}
    assert wanted | {(-20_000.0, 0.0), (22_000.0, 0.0)} <= points
    assert outline(domain).area == pytest.approx(42_000.0 * 9000.0, rel=1e-9)


def test_box_edges_as_ocean():
    ocean = {"kind": "box", "edges": ["south", "east", "west"], "spacing_m": 4000.0}
    domain = build_domain(half_plane(), case(ocean=ocean))
    assert outline(domain).area == pytest.approx(2.0 * WIDTH**2, rel=1e-9)
    ring = domain.rings[0]
    assert (ring.segment_kind == OCEAN).sum() == 2 * 10 + 20
    assert gaps(ring.points)[ring.segment_kind == OCEAN] == pytest.approx(4000.0)


def test_degree_space_measures_spacing_in_degrees():
    land = shapely.box(-81.0, 33.0, -78.0, 34.0)
    settings = case(
        box_deg=[-81.0, 32.0, -78.0, 34.0],
        projection="stereographic",
        min_spacing_m=None,
        min_spacing_deg=0.01,
        ocean={
            "kind": "arc",
            "center_deg": [-79.5, 33.0],
            "radius_deg": 0.8,
            "spacing_deg": 0.02,
        },
    )
    domain = build_domain(land, settings)
    ring = domain.rings[0]
    places = domain.projection.inverse(ring.points)
    land_gaps = gaps(places)[ring.segment_kind == LAND]
    assert land_gaps.min() >= 0.01 * (1 - 1e-6)
    assert land_gaps.max() <= 0.0175 * (1 + 1e-6)
    sea = places[ring.segment_kind == OCEAN]
    np.testing.assert_allclose(np.hypot(*(sea - [-79.5, 33.0]).T), 0.8, rtol=1e-6)
    assert (ring.segment_kind == OCEAN).sum() == round(math.pi * 0.8 / 0.02)


# ---- narrow water, islands, ledger ------------------------------------------------


def test_narrow_channel_is_removed_and_its_basin_with_it():
    land = with_inlet(600.0, basin=4000.0)
    domain = build_domain(land, case())
    assert count(domain, "narrow water removed") == 1
    area = -total(domain, "narrow water removed")
    assert area == pytest.approx(600.0 * 8000.0, rel=0.1)
    # Corners of the basin apart, which a disc of the width cannot reach either.
    assert -total(domain, "water cut off") == pytest.approx(4000.0**2, rel=0.02)
    assert domain.rings[0].points[:, 1].max() < 300.0
    entry = next(e for e in domain.ledger if e.action == "narrow water removed")
    assert abs(entry.longitude_deg) <= 300.0
    assert 0.0 < entry.latitude_deg < 8000.0


def test_channel_a_little_wider_stays():
    domain = build_domain(with_inlet(1100.0, basin=4000.0), case())
    assert count(domain, "narrow water removed") == 0
    assert domain.rings[0].points[:, 1].max() > 11_000.0
    wanted = 0.5 * math.pi * RADIUS**2 + 1100.0 * 8000.0 + 4000.0**2
    assert outline(domain).area == pytest.approx(wanted, rel=0.005)


def test_narrow_water_may_be_kept_or_have_a_width_of_its_own():
    land = with_inlet(600.0, basin=4000.0)
    kept = build_domain(land, case(narrow_water_width_m=500.0))
    assert kept.rings[0].points[:, 1].max() > 11_000.0
    kept = build_domain(land, case(narrow_water="keep"))
    assert count(kept, "narrow water removed") == 0
    removed = build_domain(
        with_inlet(1100.0, basin=4000.0), case(narrow_water_width_m=1500.0)
    )
    assert removed.rings[0].points[:, 1].max() < 500.0


def test_corners_are_no_narrow_water():
    bay = shapely.box(-6000.0, -1.0, 6000.0, 9000.0)
    domain = build_domain(half_plane() - bay, case())
    assert count(domain, "narrow water removed") == 0
    points = domain.rings[0].points
    for corner in [(-6000.0, 9000.0), (6000.0, 9000.0)]:
        assert np.hypot(*(points - corner).T).min() < 1.0


def test_an_island_behind_narrow_water_joins_the_mainland():
    island = shapely.box(-5000.0, -4500.0, 5000.0, -500.0)
    domain = build_domain(shapely.union_all([half_plane(), island]), case())
    assert len(domain.rings) == 1
    area = -total(domain, "narrow water removed")
    assert area == pytest.approx(500.0 * 10_000.0, rel=0.1)


def test_islands_are_kept_or_dropped_by_area():
    small, large = shapely.box(0, -6000, 2000, -4000), shapely.box(5e3, -9e3, 8e3, -6e3)
    land = shapely.union_all([half_plane(), small, large])
    domain = build_domain(land, case(min_island_area_km2=5.0))
    assert len(domain.rings) == 2
    assert count(domain, "island dropped") == 1
    assert total(domain, "island dropped") == pytest.approx(4e6)
    assert len(build_domain(land, case(min_island_area_km2=3.9)).rings) == 3
    assert len(build_domain(land, case(min_island_area_km2=9.1)).rings) == 1


def test_a_dropped_island_does_not_block_its_channel():
    river = with_inlet(2000.0, basin=4000.0)
    blocked = shapely.union_all([river, shapely.box(-500.0, 3000.0, 500.0, 4500.0)])
    domain = build_domain(blocked, case(min_island_area_km2=2.0))
    assert domain.rings[0].points[:, 1].max() > 11_000.0
    assert build_domain(blocked, case()).rings[0].points[:, 1].max() < 5000.0


def test_islands_too_small_to_draw_go_in_any_case():
    islet = shapely.Point(0.0, -5000.0).buffer(250.0)
    domain = build_domain(shapely.union_all([half_plane(), islet]), case())
    assert len(domain.rings) == 1
    assert total(domain, "island dropped") == pytest.approx(islet.area, rel=1e-6)


@pytest.mark.parametrize("seed", range(2))
def test_ledger_adds_up_to_the_change_of_water(seed):
    land = fractal_land(seed)
    settings = case(min_spacing_m=700.0, min_island_area_km2=3.0)
    domain = build_domain(land, settings)
    angle = np.linspace(0.0, 2.0 * np.pi, 7200, endpoint=False)
    disc = shapely.Polygon(RADIUS * np.stack([np.cos(angle), np.sin(angle)], axis=1))
    water = shapely.get_parts(shapely.difference(disc, land))
    # Ponds that no water, however narrow, joins to the sea are not the domain's.
    kept = outline(domain).buffer(0.0)
    change = sum(entry.area_m2 for entry in domain.ledger)
    reached = sum(part.area for part in water if part.distance(disc.exterior) < 1.0)
    behind = shapely.get_parts(
        shapely.difference(shapely.box(-WIDTH, -WIDTH, WIDTH, WIDTH) - disc, land)
    )
    bays = sum(p.area for p in behind if p.bounds[1] > -1e4 and p.intersects(kept))
    chords = disc.area - math.pi * RADIUS**2
    slack = abs(chords) + 0.5 * math.pi * RADIUS**2 * 0.005 + bays
    assert kept.area - change == pytest.approx(reached, abs=slack)


# ---- shapes of the open boundary --------------------------------------------------


def test_island_across_the_arc_parts_the_open_boundary():
    island = shapely.Point(0.0, -RADIUS).buffer(5000.0)
    domain = build_domain(shapely.union_all([half_plane(), island]), case())
    (ring,) = domain.rings
    starts = (ring.segment_kind == OCEAN) & (np.roll(ring.segment_kind, 1) == LAND)
    assert starts.sum() == 2
    assert shapely.Point(0.0, -RADIUS + 3000.0).distance(outline(domain)) > 1000.0


def test_open_sea_all_around():
    island = shapely.Point(2000.0, -1000.0).buffer(6000.0)
    domain = build_domain(island, case())
    outer, inner = domain.rings
    assert (outer.segment_kind == OCEAN).all()
    assert (inner.segment_kind == LAND).all()
    assert ring_area(outer.points) > 0.0 > ring_area(inner.points)


def test_a_bay_behind_the_arc_is_not_cut_off():
    # The circle crosses the bay's head, which has no other way out: as at Port Royal.
    bay = shapely.box(-27_000.0, -1.0, -24_000.0, 25_000.0)
    domain = build_domain(half_plane() - bay, case())
    (ring,) = domain.rings
    starts = (ring.segment_kind == OCEAN) & (np.roll(ring.segment_kind, 1) == LAND)
    assert starts.sum() == 1
    assert ring.points[:, 1].max() == pytest.approx(25_000.0, abs=1.0)


def test_river_leaving_the_box_is_closed_there_and_listed():
    river = shapely.box(-1500.0, -1.0, 1500.0, WIDTH)
    ocean = {"kind": "box", "edges": ["south", "east", "west"]}
    domain = build_domain(half_plane() - river, case(ocean=ocean))
    assert count(domain, "closed at the box") == 1
    ring = domain.rings[0]
    top = ring.points[:, 1] > WIDTH - 1.0
    assert (ring.segment_kind[top & np.roll(top, -1)] == LAND).all()


def test_inside_deg_chooses_the_water():
    wall = shapely.box(-500.0, -WIDTH, 500.0, 1.0)
    land = shapely.union_all([half_plane(), wall])
    domain = build_domain(land, case(inside_deg=[10_000.0, -5000.0]))
    assert domain.rings[0].points[:, 0].min() >= 500.0 - 1.0
    assert count(domain, "separate water left out") == 1


# ---- regions -----------------------------------------------------------------------


def test_region_has_its_own_spacing_and_finer_shoreline():
    region = [[-5000.0, -3000.0], [5000.0, -3000.0], [5000.0, 20e3], [-5000.0, 20e3]]
    finer = with_inlet(600.0, basin=4000.0)
    settings = case(
        regions=[
            {
                "name": "reach",
                "polygon_deg": region,
                "min_spacing_m": 250.0,
                "shoreline": "finer",
            }
        ]
    )
    coarse = build_domain(half_plane(), settings)
    assert coarse.rings[0].points[:, 1].max() < 1.0
    domain = build_domain(half_plane(), settings, [finer])
    ring = domain.rings[0]
    assert ring.points[:, 1].max() > 11_000.0
    land = ring.segment_kind == LAND
    middle = 0.5 * (ring.points + np.roll(ring.points, -1, axis=0))
    inside = shapely.contains_xy(shapely.Polygon(region).buffer(-1800.0), *middle.T)
    outside = ~shapely.contains_xy(shapely.Polygon(region).buffer(1800.0), *middle.T)
    assert gaps(ring.points)[land & inside].max() <= 1.75 * 250.0 * (1 + 1e-9)
    assert gaps(ring.points)[land & inside].min() >= 250.0 * (1 - 1e-9)
    assert gaps(ring.points)[land & outside].min() >= 1000.0 * (1 - 1e-9)


# ---- validity on rough coasts ------------------------------------------------------


@pytest.mark.parametrize("seed", [10, 15, 169])
@pytest.mark.parametrize("spacing", [400.0, 1500.0])
def test_rough_coasts_give_valid_domains(seed, spacing):
    settings = case(min_spacing_m=spacing)
    domain = build_domain(fractal_land(seed), settings)
    body = outline(domain)
    assert body.is_valid
    # Thinner water would fall apart when two tenths of the spacing are taken off.
    assert body.buffer(-0.2 * spacing).geom_type == "Polygon"
    rings = [shapely.LinearRing(ring.points) for ring in domain.rings]
    tree = shapely.STRtree(rings)
    a, b = tree.query(rings, predicate="intersects")
    assert (a == b).all()
    for number, ring in enumerate(domain.rings):
        assert (ring_area(ring.points) > 0.0) == (number == 0)
        length = gaps(ring.points)[ring.segment_kind == LAND]
        whole = number > 0 or len(length) > 10
        if whole:
            assert np.median(length) >= spacing
            assert length.max() <= 2.0 * spacing * (1 + 1e-9)
    again = build_domain(fractal_land(seed), settings)
    assert all(
        np.array_equal(p.points, q.points) for p, q in zip(domain.rings, again.rings)
    )


# ---- bad input ---------------------------------------------------------------------


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        (
            {"ocean": {"kind": "arc", "center_deg": [0, 2e4], "radius_deg": 1e4}},
            "never touches the sea",
        ),
        (
            {"ocean": {"kind": "arc", "center_deg": [9e5, 0], "radius_deg": 1e4}},
            "outside the box",
        ),
        (
            {"ocean": {"kind": "arc", "center_deg": [2e4, 0], "radius_deg": 3e4}},
            r"leaves the box at 40000\.0+ E, -22360\.\d+ N without meeting land",
        ),
        ({"ocean": {"kind": "box", "edges": ["south"]}}, "without meeting land"),
        ({"min_spacing_m": 1e-9}, "resolve"),
        ({"min_spacing_m": 1e5}, "does not suit a box"),
        ({"min_spacing_m": 0.05}, "nodes at the given minimum spacing"),
        ({"inside_deg": [0.0, 5000.0]}, "inside_deg"),
        ({"projection": "EPSG:4326"}, "projection"),
        ({"projection": "nowhere:1"}, "not known"),
        (
            {
                "ocean": {
                    "kind": "polygon",
                    "polygon_deg": [[0, 0], [1e4, 1e4], [1e4, 0], [0, 1e4]],
                }
            },
            "crosses itself",
        ),
    ],
)
def test_bad_settings_are_explained(changes, message):
    from tidemesh.errors import InputError

    with pytest.raises(InputError, match=message):
        build_domain(half_plane(), case(**changes))


def test_domain_in_two_parts_is_refused_with_both_places():
    from tidemesh.errors import InputError

    wall = shapely.box(-500.0, -WIDTH, 500.0, 1.0)
    land = shapely.union_all([half_plane(), wall])
    with pytest.raises(InputError, match=r"in two: .* km2 at .* and .* km2 at"):
        build_domain(land, case())


def test_all_land_is_refused():
    from tidemesh.errors import InputError

    with pytest.raises(InputError, match="never touches the sea"):
        build_domain(shapely.box(-WIDTH, -WIDTH, WIDTH, WIDTH), case())
