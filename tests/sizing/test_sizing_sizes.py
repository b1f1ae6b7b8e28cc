"""The whole of section 3.4 on small meshes."""

import msgspec
import numpy as np
import pytest
from scipy.spatial import Delaunay

from tidemesh.datatypes import BoundaryString, CoastalMesh, TruncationSeries
from tidemesh.errors import InputError
from tidemesh.geometry.projection import Projection
from tidemesh.sizing import (
    RuleInputs,
    SizeRegion,
    SizingSettings,
    allowable_sizes,
    boundary_spacing,
    build_rule,
    choose_level,
    expected_nodes,
    feature_width,
    level_at_spacing,
    power_rule,
    size_builder,
)
from tidemesh.triangulation.delaunay import constrained_delaunay
from tidemesh.triangulation.topology import edges as mesh_edges


def grid_mesh(nx=41, ny=21, step=1000.0):
    x, y = np.meshgrid(np.arange(nx) * step, np.arange(ny) * step)
    points = np.stack([x.ravel(), y.ravel()], axis=1)
    # A slight shear makes the triangulation unique.
    triangles = Delaunay(points + 0.01 * points[:, ::-1]).simplices
    return CoastalMesh(points, triangles, 5.0 + 1e-3 * points[:, 0])


PLAIN = {
    "smoothing_sweeps": 0,
    "gradation": np.inf,
    "channel_elements": 0.0,
}


def series_on(mesh, peak_node=300):
    x = mesh.points[:, 0]
    second = 1e-13 * np.exp(-x / 1e4) + 0j
    second[peak_node] = 1e-12
    known = (x > 2500.0) & (x < 38_000.0)
    return TruncationSeries(second[None, None], 0j * second[None, None], known)


def test_peak_returns_the_base_spacing_at_the_peak_node():
    mesh = grid_mesh()
    settings = SizingSettings(rule="truncation_error", tolerance="peak", **PLAIN)
    series = series_on(mesh)
    rule = build_rule(RuleInputs(mesh, np.array([1.4e-4]), series=series), settings)
    sizes = size_builder(mesh, rule, settings)
    level = choose_level(
        mesh, rule, sizes, settings, base_spacing=900.0, series=series
    ).value
    assert level == pytest.approx(1e-12 * 900.0**2, rel=1e-12)
    spacing = sizes(level).spacing
    assert spacing.min() == pytest.approx(900.0, rel=1e-12)
    assert np.argmin(spacing) == 300
    # Undefined nodes are filled, and the defined ones are those of the rule.
    known = series.known
    np.testing.assert_allclose(spacing[known], rule(level)[known], rtol=1e-14)
    assert np.isfinite(spacing).all()


def test_percentile_lets_a_share_be_finer_than_the_base_grid():
    mesh = grid_mesh()
    series = series_on(mesh)
    options = {"rule": "truncation_error", "tolerance": "percentile", **PLAIN}
    settings = SizingSettings(percentile=90.0, **options)
    rule = build_rule(RuleInputs(mesh, np.array([1.4e-4]), series=series), settings)
    sizes = size_builder(mesh, rule, settings)
    found = choose_level(mesh, rule, sizes, settings, base_spacing=900.0, series=series)
    finer = (rule(found.value)[series.known] < 900.0).mean()
    assert finer == pytest.approx(0.1, abs=0.03)


def test_level_at_spacing_for_any_rule():
    magnitude = np.linspace(1.0, 5.0, 500)
    rule = power_rule(magnitude, exponent=0.5)
    level = level_at_spacing(rule, 900.0)
    assert rule(level).min() == pytest.approx(900.0, rel=1e-12)
    level = level_at_spacing(rule, 900.0, percentile=50.0)
    assert (rule(level) < 900.0).mean() == pytest.approx(0.5, abs=0.01)


def test_absolute_level():
    mesh = grid_mesh()
    settings = SizingSettings(rule="uniform", tolerance="absolute", level=750.0)
    rule = build_rule(RuleInputs(mesh, np.array([1.4e-4])), settings)
    sizes = size_builder(mesh, rule, settings)
    level = choose_level(mesh, rule, sizes, settings).value
    np.testing.assert_allclose(sizes(level).spacing, 750.0)


@pytest.mark.parametrize("name", ["uniform", "wavelength", "hessian"])
def test_budget_with_a_biased_noisy_count(name):
    mesh = grid_mesh()
    settings = SizingSettings(rule=name, nodes=3000)
    x, y = mesh.points.T
    curvature = 1.0 / (1e3 + np.hypot(x - 1e4, y - 1e4))
    inputs = RuleInputs(mesh, np.array([1.4e-4]), curvature=curvature[None])
    rule = build_rule(inputs, settings)
    sizes = size_builder(mesh, rule, settings)
    calls = []

    def count(level):
        calls.append(level)
        noise = 1.0 + 0.003 * np.sin(1e5 * level)
        return int(1.12 * expected_nodes(sizes(level)) * noise)

    found = choose_level(mesh, rule, sizes, settings, count=count)
    assert abs(found.count / 3000 - 1.0) <= 0.01
    assert len(calls) == found.evaluations <= 4
    without_count = choose_level(mesh, rule, sizes, settings)
    assert abs(expected_nodes(sizes(without_count.value)) / 3000 - 1.0) <= 0.01


def test_budget_below_what_the_limits_need():
    mesh = grid_mesh()
    settings = SizingSettings(rule="uniform", nodes=100, max_m=500.0)
    rule = build_rule(RuleInputs(mesh, np.array([1.4e-4])), settings)
    sizes = size_builder(mesh, rule, settings)
    with pytest.raises(InputError, match="nodes = 100 is below"):
        choose_level(
            mesh, rule, sizes, settings, count=lambda s: expected_nodes(sizes(s))
        )


def test_clipping_and_gradation():
    mesh = grid_mesh()
    settings = SizingSettings(min_m=400.0, max_m=5000.0, gradation=0.2)
    magnitude = 1.0 / (1.0 + np.hypot(*(mesh.points - 1e4).T)) ** 3
    spacing = allowable_sizes(mesh, power_rule(magnitude), 3000.0, settings).spacing
    assert spacing.min() == 400.0
    assert spacing.max() <= 5000.0
    edge = mesh_edges(mesh.triangles)
    length = np.linalg.norm(mesh.points[edge[:, 0]] - mesh.points[edge[:, 1]], axis=1)
    growth = np.abs(spacing[edge[:, 0]] - spacing[edge[:, 1]]) / length
    assert growth.max() <= 0.2 * (1 + 1e-12)


def test_regions_have_their_own_limits():
    mesh = grid_mesh()
    corners = [(0.0, 0.0), (9500.0, 0.0), (9500.0, 9500.0), (0.0, 9500.0)]
    settings = SizingSettings(
        min_m=800.0,
        regions=[SizeRegion(polygon_deg=corners, max_m=300.0)],
        **PLAIN,
    )
    rule = power_rule(np.ones(len(mesh.points)))
    spacing = allowable_sizes(mesh, rule, 1000.0, settings).spacing
    inside = (mesh.points < 9500.0).all(axis=1) & (mesh.points > 0.0).all(axis=1)
    np.testing.assert_array_equal(spacing[inside], 300.0)
    outside = (mesh.points > 9500.0).any(axis=1)
    np.testing.assert_allclose(spacing[outside], 1000.0)


def test_regions_are_in_degrees():
    projection = Projection.stereographic(-80.0, 33.0)
    mesh = grid_mesh()
    mesh = CoastalMesh(mesh.points, mesh.triangles, mesh.depth, projection=projection)
    corners = projection.inverse(
        np.array([[-1e3, -1e3], [9.5e3, -1e3], [9.5e3, 5e4], [-1e3, 5e4]])
    )
    region = SizeRegion(polygon_deg=[tuple(c) for c in corners], max_m=300.0)
    settings = SizingSettings(regions=[region], **PLAIN)
    rule = power_rule(np.ones(len(mesh.points)))
    spacing = allowable_sizes(mesh, rule, 1000.0, settings).spacing
    np.testing.assert_array_equal(spacing < 500.0, mesh.points[:, 0] < 9.5e3)


def test_courant_floor():
    mesh = grid_mesh()
    settings = SizingSettings(time_step_s=60.0, courant=0.5, **PLAIN)
    rule = power_rule(np.ones(len(mesh.points)))
    spacing = allowable_sizes(mesh, rule, 10.0, settings).spacing
    number = np.sqrt(9.81 * mesh.depth) * 60.0 / spacing
    assert number.max() == pytest.approx(0.5)


def channel_mesh(width=800.0, length=20_000.0):
    """A wide sea in the south, and a channel of the given width to the north."""
    step = 400.0
    half = 0.5 * width

    def side(start, end):
        n = max(1, round(float(np.hypot(*np.subtract(end, start))) / step))
        return np.linspace(start, end, n, endpoint=False)

    corners = [
        (-3e4, -3e4),
        (3e4, -3e4),
        (3e4, 0.0),
        (half, 0.0),
        (half, length),
        (-half, length),
        (-half, 0.0),
        (-3e4, 0.0),
    ]
    parts = [
        side(a, b) for a, b in zip(corners, corners[1:] + corners[:1], strict=True)
    ]
    ring = np.concatenate(parts)
    index = np.arange(len(ring))
    triangles = constrained_delaunay(
        ring, np.stack([index, np.roll(index, -1)], axis=1)
    )
    sea = np.flatnonzero(ring[:, 1] < -1e-6)
    order = sea[np.argsort(np.arctan2(ring[sea, 1], ring[sea, 0]))]
    return CoastalMesh(
        ring, triangles, np.full(len(ring), 5.0), (BoundaryString("open", order),)
    )


def test_width_of_a_channel():
    mesh = channel_mesh(width=800.0)
    width = feature_width(mesh)
    x, y = mesh.points.T
    inside = (y > 1000.0) & (y < 19_000.0)
    np.testing.assert_allclose(width[inside], 800.0, rtol=1e-9)
    assert np.isinf(width[(y < 1.0) & (np.abs(x) > 5000.0)]).all()
    settings = SizingSettings(channel_elements=2.0, gradation=0.3)
    rule = power_rule(np.ones(len(mesh.points)))
    spacing = allowable_sizes(mesh, rule, 3000.0, settings).spacing
    np.testing.assert_allclose(spacing[inside], 400.0)


def test_boundary_spacing_is_kept_where_asked():
    mesh = grid_mesh()
    edge_spacing = boundary_spacing(mesh)
    x, y = mesh.points.T
    on_boundary = (x == 0) | (x == 40_000) | (y == 0) | (y == 20_000)
    np.testing.assert_allclose(edge_spacing[on_boundary], 1000.0)
    assert np.isinf(edge_spacing[~on_boundary]).all()
    settings = SizingSettings(follow_boundary=True, **PLAIN)
    rule = power_rule(np.ones(len(mesh.points)))
    spacing = allowable_sizes(mesh, rule, 3000.0, settings).spacing
    np.testing.assert_allclose(spacing, np.where(on_boundary, 1000.0, 3000.0))


def test_size_below_float_resolution():
    mesh = grid_mesh()
    rule = power_rule(np.ones(len(mesh.points)))
    with pytest.raises(InputError, match="cannot be told from zero"):
        allowable_sizes(mesh, rule, 1e-9, SizingSettings())


def test_same_bytes_twice():
    mesh = grid_mesh()
    magnitude = 1.0 + np.sin(mesh.points[:, 0] / 3e3) ** 2
    magnitude[::7] = np.nan
    first, second = (
        allowable_sizes(mesh, power_rule(magnitude), 900.0, SizingSettings())
        for _ in range(2)
    )
    assert first.spacing.tobytes() == second.spacing.tobytes()


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ('{"rule": "magic"}', "Invalid enum value"),
        ('{"nodes": 2}', ">= 4"),
        ('{"tolerance": "absolute"}', "needs a level"),
        ('{"min_m": 10.0, "max_m": 5.0}', "min_m = 10 is above max_m = 5"),
        ('{"colour": 1}', "unknown field"),
    ],
)
def test_bad_settings(text, message):
    with pytest.raises(msgspec.ValidationError, match=message):
        msgspec.json.decode(text, type=SizingSettings)
