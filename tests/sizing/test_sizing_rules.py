"""Rules: closed forms on simple seas; the spacing grows with the level."""

import math
import typing

import numpy as np
import pytest
from scipy.spatial import Delaunay

from tidemesh.constants import GRAVITY, frequency
from tidemesh.datatypes import CoastalMesh, TruncationSeries
from tidemesh.errors import InputError
from tidemesh.sizing import RULES, RuleInputs, SizingSettings, build_rule, power_rule
from tidemesh.sizing.rules import nodal_gradient
from tidemesh.sizing.settings import RuleName

M2 = frequency("M2")


@pytest.fixture(scope="module")
def inputs():
    rng = np.random.default_rng(7)
    points = rng.random((300, 2)) * 5e4
    triangles = Delaunay(points).simplices
    depth = 10.0 + 1e-3 * points[:, 0]
    shape = (1, 2, len(points))
    series = TruncationSeries(
        1e-11 * rng.normal(size=shape), 1e-17 * rng.normal(size=shape), depth > 0
    )
    curvature = rng.uniform(1.0, 9.0, size=(2, len(points)))
    return RuleInputs(
        mesh=CoastalMesh(points, triangles, depth),
        frequency=np.array([M2, 0.5 * M2]),
        series=series,
        curvature=curvature,
    )


@pytest.mark.parametrize("name", RULES)
def test_spacing_grows_with_level(inputs, name):
    rule = build_rule(inputs, SizingSettings(rule=name))
    spacings = [rule(level) for level in (1e-6, 1e-5, 1e-3)]
    assert (np.diff(spacings, axis=0) > 0.0).all()
    assert spacings[0].shape == (300,)


def test_every_rule_can_be_named():
    assert set(typing.get_args(RuleName)) == set(RULES)


def test_wavelength_of_the_shortest_constituent(inputs):
    rule = build_rule(inputs, SizingSettings(rule="wavelength"))
    period = 2.0 * math.pi / M2
    expected = 0.01 * np.sqrt(GRAVITY * inputs.mesh.depth) * period
    np.testing.assert_allclose(rule(0.01), expected, rtol=1e-14)


def test_slope_takes_over_on_a_steep_bed(inputs):
    settings = SizingSettings(rule="wavelength_slope", slope_weight=2.0)
    spacing = build_rule(inputs, settings)(1.0)
    waves = build_rule(inputs, SizingSettings(rule="wavelength"))(1.0)
    topographic = 2.0 * 2.0 * math.pi * inputs.mesh.depth / 1e-3
    np.testing.assert_allclose(spacing, np.minimum(waves, topographic), rtol=1e-9)
    assert (spacing < waves).sum() > 0


def test_gradient_of_a_plane_is_exact(inputs):
    points = inputs.mesh.points
    values = 3.0 - 2e-4 * points[:, 0] + 5e-4 * points[:, 1]
    gradient = nodal_gradient(points, inputs.mesh.triangles, values)
    np.testing.assert_allclose(gradient, np.tile([-2e-4, 5e-4], (300, 1)), rtol=1e-9)


def test_power_rule():
    magnitude = np.array([1.0, 8.0, 64.0, np.nan])
    spacing = power_rule(magnitude, exponent=1 / 3)(500.0)
    np.testing.assert_allclose(spacing[:3], [1000.0, 500.0, 250.0], rtol=1e-14)
    assert np.isnan(spacing[3])


def test_power_rule_floors_quiet_bays():
    magnitude = np.array([0.0, 1e-12, 1.0, 1.0, 1.0])
    spacing = power_rule(magnitude, exponent=0.5, floor=1e-4)(1.0)
    np.testing.assert_allclose(spacing, [100.0, 100.0, 1.0, 1.0, 1.0], rtol=1e-12)


def test_power_rule_without_any_signal():
    with pytest.raises(InputError, match="vanishes everywhere"):
        power_rule(np.zeros(5))


def test_constituents_add_by_squares(inputs):
    settings = SizingSettings(rule="hessian", exponent=0.5)
    both = build_rule(inputs, settings)(100.0)
    magnitude = np.hypot(*inputs.curvature)
    np.testing.assert_allclose(both, power_rule(magnitude, exponent=0.5)(100.0))


def test_energy_weighs_with_the_root_of_depth(inputs):
    settings = SizingSettings(rule="energy_hessian", exponent=1.0)
    plain = build_rule(inputs, SizingSettings(rule="hessian", exponent=1.0))(1.0)
    weighted = build_rule(inputs, settings)(1.0)
    ratio = plain / weighted / np.sqrt(inputs.mesh.depth)
    np.testing.assert_allclose(ratio, ratio[0], rtol=1e-12)


def test_dry_nodes_are_undefined(inputs):
    mesh = inputs.mesh
    depth = mesh.depth.copy()
    depth[3] = -1.0
    dry = RuleInputs(
        mesh=CoastalMesh(mesh.points, mesh.triangles, depth), frequency=inputs.frequency
    )
    spacing = build_rule(dry, SizingSettings(rule="wavelength"))(0.01)
    assert np.flatnonzero(np.isnan(spacing)).tolist() == [3]


def test_missing_input_is_named(inputs):
    bare = RuleInputs(mesh=inputs.mesh, frequency=inputs.frequency)
    with pytest.raises(ValueError, match="truncation error series"):
        build_rule(bare, SizingSettings(rule="truncation_error"))
    with pytest.raises(ValueError, match="need the curvature"):
        build_rule(bare, SizingSettings(rule="hessian"))
