"""From elevation to nodal velocities."""

import numpy as np
import pytest
from annulus import annulus_forcing, annulus_mesh
from numpy.testing import assert_allclose

from tidemesh.datatypes import BoundaryString, CoastalMesh
from tidemesh.tides import Symbols, TideSettings, WaveEquation, solve
from tidemesh.tides.frequency_domain.elements import Elements
from tidemesh.tides.frequency_domain.velocity import (
    lumped_gradient,
    nodal_response,
    nodal_velocity,
    projected_gradient,
    recovered_gradient,
    shore_direction,
)


@pytest.fixture(scope="module")
def mesh():
    return annulus_mesh(10, 14, 0)


def test_every_gradient_is_exact_on_a_plane(mesh):
    elements = Elements.of(mesh)
    field = mesh.points @ np.array([2e-6 + 1e-6j, -3e-6]) + 0.2
    for gradient in (
        lumped_gradient(elements, field),
        projected_gradient(elements, field),
        recovered_gradient(mesh, elements, field),
    ):
        assert_allclose(gradient[0], 2e-6 + 1e-6j, rtol=1e-8)
        assert_allclose(gradient[1], -3e-6, rtol=1e-8)


def test_recovered_gradient_is_exact_on_a_quadratic(mesh):
    x, y = mesh.points.T / 1e5
    field = 1.0 + x - 2.0 * y + 3j * x * x - x * y + 0.5 * y * y
    gx, gy = recovered_gradient(mesh, Elements.of(mesh), field) * 1e5
    assert_allclose(gx, 1.0 + 6j * x - y, atol=1e-8)
    assert_allclose(gy, -2.0 - x + y, atol=1e-8)


def test_recovered_gradient_where_no_quadratic_fits():
    # A channel one triangle wide: the mean of the element gradients stands in.
    x = np.repeat(np.arange(4.0), 2)
    points = np.column_stack([x, np.tile([0.0, 1.0], 4)])
    k = 2 * np.arange(3)[:, None]
    triangles = np.concatenate([k + np.array([0, 2, 1]), k + np.array([1, 2, 3])])
    strip = CoastalMesh(points, triangles, np.ones(8))
    field = points @ [2.0, 3.0] + 0j
    gradient = recovered_gradient(strip, Elements.of(strip), field)
    assert_allclose(gradient, np.broadcast_to([[2.0], [3.0]], (2, 8)))


def test_momentum_equation_holds_at_the_nodes(mesh):
    f, tau = 1.1e-4, 5e-4
    settings = TideSettings(land_rule="none", friction=tau)
    tide = solve(mesh, annulus_forcing(mesh), settings, coriolis=f)
    gx, gy = lumped_gradient(Elements.of(mesh), tide.elevation[0])
    u, v = tide.velocity[0].T
    q = 1j * tide.frequency[0] + tau
    assert_allclose(q * u - f * v, -9.81 * gx, atol=1e-12)
    assert_allclose(q * v + f * u, -9.81 * gy, atol=1e-12)


def boundary_of(mesh, ibtype):
    land = next(s for s in mesh.boundaries if s.kind == "mainland")
    others = tuple(s for s in mesh.boundaries if s.kind != "mainland")
    string = BoundaryString("mainland", land.nodes, ibtype=ibtype)
    return (
        CoastalMesh(mesh.points, mesh.triangles, mesh.depth, (*others, string)),
        land.nodes,
    )


def velocity_with(mesh, ibtype, **settings):
    typed, land = boundary_of(mesh, ibtype)
    equation = WaveEquation(
        typed, typed.open_nodes, TideSettings(**settings), coriolis=1e-4
    )
    x, y = mesh.points.T
    field = np.exp(1j * (x + 2.0 * y) / 1e5)
    return nodal_velocity(equation, field, Symbols.exact(1.4e-4)), land


def test_land_rule_follows_the_boundary_type(mesh):
    free, land = velocity_with(mesh, 20)
    off = np.setdiff1d(np.arange(len(mesh.points)), land)
    slip, _ = velocity_with(mesh, 0)
    held, _ = velocity_with(mesh, 10)
    none, _ = velocity_with(mesh, 0, land_rule="none")
    assert_allclose(none, free)
    assert_allclose(slip[off], free[off])
    assert (held[land] == 0.0).all()
    along = mesh.points[np.roll(land, -1)] - mesh.points[np.roll(land, 1)]
    along[[0, -1]] = (
        mesh.points[land[1]] - mesh.points[land[0]],
        mesh.points[land[-1]] - mesh.points[land[-2]],
    )
    across = slip[land, 0] * along[:, 1] - slip[land, 1] * along[:, 0]
    assert np.abs(across).max() < 1e-9 * np.abs(slip[land]).max() * 1e4
    assert np.abs(slip[land]).max() > 0.01


def test_sharp_corners_have_no_velocity(mesh):
    land = next(s for s in mesh.boundaries if s.kind == "mainland").nodes
    radius = np.hypot(*mesh.points.T)
    corners = land[1:-1][
        (np.abs(radius[land[1:-1]] - radius.min()) < 1.0)
        & ((mesh.points[land[1:-1]] < 1.0).any(axis=1))
    ]
    assert len(corners) == 2
    wide, _ = velocity_with(mesh, 0, minimum_inner_angle_deg=110.0)
    narrow, _ = velocity_with(mesh, 0, minimum_inner_angle_deg=70.0)
    assert (wide[corners] == 0.0).all()
    assert (np.abs(narrow[corners]).max(axis=1) > 0.0).all()
    rest = np.setdiff1d(np.arange(len(mesh.points)), corners)
    assert_allclose(wide[rest], narrow[rest])


def test_response_to_friction_that_differs_with_the_direction(mesh):
    symbols = Symbols.exact(1.4e-4)
    equation = WaveEquation(mesh, mesh.open_nodes, friction=5e-4, coriolis=1e-4)
    n = len(mesh.points)
    same = np.stack([np.full(n, 5e-4), np.zeros(n), np.full(n, 5e-4)])
    assert_allclose(
        nodal_response(equation, symbols, same), nodal_response(equation, symbols)
    )
    # The momentum equations off the shore, and along it.
    xx, xy, yy = 3e-4, 1e-4, 7e-4
    tensor = np.outer([xx, xy, yy], np.ones(n))
    response = nodal_response(equation, symbols, tensor)
    land = next(s for s in mesh.boundaries if s.kind == "mainland").nodes
    free = np.setdiff1d(np.arange(n), land)
    system = 1.4e-4j * np.eye(2) + [[xx, xy - 1e-4], [xy + 1e-4, yy]]
    for node in free[:5]:
        assert_allclose(system @ response[:, :, node], -9.81 * np.eye(2), atol=1e-9)
    node = land[3]
    along = mesh.points[land[4]] - mesh.points[land[2]]
    along /= np.hypot(*along)
    drag = 1.4e-4j + along @ [[xx, xy], [xy, yy]] @ along
    assert_allclose(
        response[:, :, node], -9.81 / drag * np.outer(along, along), atol=1e-9
    )


def test_the_shore_of_an_annulus_runs_round_its_centre():
    mesh = annulus_mesh(10, 14, 0)
    turned = [BoundaryString("open", mesh.open_nodes)]
    inner = np.flatnonzero(
        np.isclose(np.hypot(*mesh.points.T), np.hypot(*mesh.points.T).min())
    )
    inner = inner[np.argsort(np.arctan2(*mesh.points[inner].T))]
    held = np.setdiff1d(np.arange(len(mesh.points)), np.append(inner, mesh.open_nodes))
    turned.append(BoundaryString("mainland", inner))
    turned.append(BoundaryString("mainland", held[:3], ibtype=10))
    turned.append(BoundaryString("mainland", held[3:6], ibtype=20))
    shore = CoastalMesh(mesh.points, mesh.triangles, mesh.depth, tuple(turned))
    bound, direction = shore_direction(shore, Elements.of(shore), 90.0)
    assert bound[inner].all()
    assert bound[held[:3]].all()
    assert bound.sum() == len(inner) + 3
    assert not direction[:, held].any()
    inside = inner[1:-1]
    assert_allclose(np.hypot(*direction[:, inside]), 1.0)
    radial = (direction[:, inside] * mesh.points[inside].T).sum(axis=0)
    assert_allclose(radial, 0.0, atol=1e-9 * np.abs(mesh.points).max())
