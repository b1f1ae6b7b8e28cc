"""Base points: counts from closed forms, clearance, determinism."""

import math

import numpy as np
import pytest
from basegrid_shapes import circle, disc, far_from
from scipy.spatial import cKDTree

from tidemesh.basegrid import BaseGridSettings, PolarCentre, build_base_points
from tidemesh.basegrid.clearance import NearBoundary
from tidemesh.basegrid.polar import arc_points
from tidemesh.datatypes import Domain
from tidemesh.errors import InputError
from tidemesh.geometry.projection import Projection
from tidemesh.triangulation.domain import triangulate

PAPER_CENTRE = PolarCentre(
    center_deg=(-79.38335, 33.02820), step_deg=1.59031 / 199, arcs=198
)
WACCAMAW_CENTRE = PolarCentre(
    center_deg=(-79.253024, 33.352297),
    step_deg=0.1931736 / 74,
    arcs=73,
    from_deg=45.0,
    to_deg=135.0,
)


@pytest.mark.parametrize("spacing", [1000.0, 400.0])
def test_lattice_of_a_disc_has_two_over_root_three_points_per_square(spacing):
    radius = 20_000.0
    domain = disc(radius, spacing)
    points = build_base_points(
        domain, BaseGridSettings(spacing_m=spacing, transition=False)
    )
    # The strip nearer than 0.6 spacings to the circle stays empty.
    area = math.pi * (radius - 0.6 * spacing) ** 2
    expected = 2.0 / math.sqrt(3.0) * area / spacing**2
    # Gauss's circle problem: the error is well below one row along the circle.
    assert abs(len(points) - expected) < 0.5 * math.tau * radius / spacing / 3.0
    gap, _ = cKDTree(points).query(points, k=2)
    assert np.allclose(gap[:, 1], spacing)


def test_points_keep_clear_of_shore_and_islands():
    domain = disc(8_000.0, 500.0, island_radius=1_500.0)
    points = build_base_points(domain, BaseGridSettings(spacing_m=500.0))
    distance = far_from(points, domain)
    assert distance.min() >= 0.6 * 500.0 * (1.0 - 1e-9)
    assert np.hypot(*points.T).max() < 8_000.0
    assert np.hypot(*(points - [3_200.0, 800.0]).T).min() > 1_500.0


def test_transition_grades_to_a_finer_boundary():
    domain = disc(10_000.0, 125.0)
    coarse = BaseGridSettings(spacing_m=1000.0, transition=False)
    graded = BaseGridSettings(spacing_m=1000.0)
    worst, mean = [], []
    for settings in (coarse, graded):
        points, triangles = triangulate(domain, build_base_points(domain, settings))
        corners = points[triangles]
        edges = corners - np.roll(corners, 1, axis=1)
        twice_area = np.abs(
            edges[:, 0, 0] * edges[:, 1, 1] - edges[:, 0, 1] * edges[:, 1, 0]
        )
        quality = 2.0 * math.sqrt(3.0) * twice_area / (edges**2).sum(axis=(1, 2))
        worst.append(quality.min())
        mean.append(quality.mean())
    assert worst[1] > 0.45 > worst[0]
    assert mean[1] > 0.9


def test_finer_lattices_contain_the_coarser_ones():
    domain = disc(10_000.0, 125.0)
    all_points = build_base_points(domain, BaseGridSettings(spacing_m=1000.0))
    # No two points of nested lattices come closer than the finest spacing, an eighth.
    gap, _ = cKDTree(all_points).query(all_points, k=2)
    assert gap[:, 1].min() >= 125.0 * (1.0 - 1e-9)
    row_height = 125.0 * math.sqrt(3.0) / 2.0
    rows = all_points[:, 1] / row_height
    assert np.allclose(rows, np.round(rows), atol=1e-6)


def test_same_points_every_time_and_for_every_neighbour():
    settings = BaseGridSettings(spacing_m=700.0, transition=False)
    first = build_base_points(disc(9_000.0, 700.0), settings)
    again = build_base_points(disc(9_000.0, 700.0), settings)
    assert np.array_equal(first, again)
    larger = build_base_points(disc(15_000.0, 700.0), settings)
    gap, _ = cKDTree(larger).query(first)
    assert gap.max() < 1e-6


def test_distance_to_boundary_is_exact():
    rng = np.random.default_rng(4)
    domain = disc(5_000.0, 900.0, island_radius=700.0)
    points = rng.uniform(-7_000.0, 7_000.0, (500, 2))
    exact = far_from(points, domain)
    distance, spacing = NearBoundary(domain, 50.0).query(points, 1_500.0)
    near = exact <= 1_500.0
    assert np.allclose(distance[near], exact[near])
    assert np.isinf(distance[exact > 1_600.0]).all()
    assert np.all(np.abs(spacing[near] - 890.0) < 80.0)


def test_arcs_of_the_paper():
    # Arc k has floor(2 pi k) points 1/k apart.
    points, spacing = arc_points(PAPER_CENTRE, Projection())
    assert len(points) == sum(math.floor(math.tau * k) for k in range(1, 199))
    offset = points - PAPER_CENTRE.center_deg
    radius = np.hypot(*offset.T)
    assert radius.min() == pytest.approx(1.59031 / 199)
    assert radius.max() == pytest.approx(1.59031 * 198 / 199)
    # The first point of every arc lies at 135 degrees.
    assert offset[0] == pytest.approx(1.59031 / 199 * np.array([-1, 1]) / math.sqrt(2))
    outer = offset[-math.floor(math.tau * 198) :]
    step = np.hypot(*(outer[1:] - outer[:-1]).T)
    assert np.allclose(step, 1.59031 / 199, rtol=2e-5)
    assert np.allclose(spacing, 1.59031 / 199)


def test_spacing_of_the_paper_in_metres():
    projection = Projection.equirectangular(-79.38335, 33.02820)
    points, spacing = arc_points(PAPER_CENTRE, projection)
    # 889 m north to south, 745 m east to west.
    assert np.ptp(points[:, 1]) / (2 * 198) == pytest.approx(889.0, abs=1.0)
    assert np.ptp(points[:, 0]) / (2 * 198) == pytest.approx(745.0, abs=1.0)
    assert spacing.mean() == pytest.approx(math.sqrt(889.0 * 745.0), rel=0.01)


def test_second_centre_takes_over_its_sector():
    projection = Projection.stereographic(-79.38335, 33.02820)
    ring = circle(60_000.0, 400)
    domain = Domain((ring,), projection)
    settings = BaseGridSettings(kind="polar", centres=(PAPER_CENTRE, WACCAMAW_CENTRE))
    points = build_base_points(domain, settings)
    offset = projection.inverse(points) - WACCAMAW_CENTRE.center_deg
    angle = np.degrees(np.arctan2(offset[:, 1], offset[:, 0])) % 360.0
    radius = np.hypot(*offset.T)
    inside = (angle > 46) & (angle < 134) & (radius > 0.01) & (radius < 0.18)
    gap, _ = cKDTree(points).query(points, k=2)
    finer = 290.0
    assert np.median(gap[inside, 1]) == pytest.approx(
        finer * math.sqrt(745.0 / 889.0), rel=0.1
    )
    # Where the families meet, no point of the first comes close to the second.
    assert gap[:, 1].min() > 0.5 * finer * 745.0 / 889.0


def test_arcs_in_metres_and_region_polygon():
    domain = disc(10_000.0, 500.0)
    ring = PolarCentre(
        center_deg=(0.0, 0.0),
        step_m=500.0,
        arcs=19,
        region_deg=((-9e1, -9e1), (9e1, -9e1), (9e1, 9e1), (-9e1, 9e1)),
    )
    settings = BaseGridSettings(kind="polar", centres=(ring,))
    assert len(build_base_points(domain, settings)) == 0
    whole = PolarCentre(center_deg=(0.0, 0.0), step_m=500.0, arcs=19)
    settings = BaseGridSettings(kind="polar", centres=(whole,))
    points = build_base_points(domain, settings)
    assert len(points) == sum(math.floor(math.tau * k) for k in range(1, 20))


@pytest.mark.parametrize("turn", [0.0, -360.0])
def test_families_across_the_date_line_may_count_east_or_west(turn):
    domain = disc(20e3, 1e3, projection=Projection.stereographic(180.5, 52.0))
    families = [
        [
            PolarCentre(center_deg=(180.5 + by, 52.0), step_deg=0.01, arcs=50),
            PolarCentre(
                center_deg=(180.5 + by, 52.0),
                step_deg=0.005,
                arcs=20,
                region_deg=[(180.4 + by, 52), (180.6 + by, 52), (180.5 + by, 52.1)],
            ),
            PolarCentre(center_deg=(180.4 + by, 51.9), step_deg=0.005, arcs=8),
        ]
        for by in (0.0, turn)
    ]
    one, other = (
        build_base_points(domain, BaseGridSettings(kind="polar", centres=tuple(f)))
        for f in families
    )
    assert len(one) > 1000
    np.testing.assert_allclose(other, one, atol=1e-3)


@pytest.mark.parametrize(
    "wrong",
    [
        lambda: BaseGridSettings(kind="polar"),
        lambda: BaseGridSettings(centres=(PAPER_CENTRE,)),
        lambda: PolarCentre(center_deg=(0, 0), arcs=3),
        lambda: PolarCentre(center_deg=(0, 0), arcs=3, step_m=1.0, step_deg=1.0),
        lambda: PolarCentre(center_deg=(0, 0), arcs=3, step_m=1.0, to_deg=0.0),
    ],
)
def test_settings_that_contradict_themselves(wrong):
    with pytest.raises(ValueError):
        wrong()


def test_a_lattice_too_fine_is_refused_before_it_is_made():
    with pytest.raises(InputError, match=r"base_grid.spacing_m = 0.1 m gives 3\d\d,"):
        build_base_points(disc(1e3, 50.0), BaseGridSettings(spacing_m=0.1))
