"""Lengths, areas and directions on the globe, against what is known on a sphere."""

from __future__ import annotations

import numpy as np
import pytest
from globe import DEPTH, GLOBE, icosphere, mesh_of, tilted_degree_two

from tidemesh.constants import EARTH_RADIUS
from tidemesh.datatypes import BoundaryString, CoastalMesh, TideForcing
from tidemesh.errors import InputError, MeshError
from tidemesh.geometry.projection import Projection
from tidemesh.io.fort14 import read_fort14, write_fort14
from tidemesh.tides import Symbols, TideSettings, WaveEquation, solve
from tidemesh.tides.frequency_domain.elements import Elements
from tidemesh.tides.frequency_domain.metric import (
    adcirc_elements,
    elements_for,
    elements_geographic,
    elements_on_sphere,
)
from tidemesh.tides.frequency_domain.velocity import (
    lumped_gradient,
    projected_gradient,
    recovered_gradient,
)

FREQUENCY, FRICTION, GRAVITY = 1.405189e-4, 2.0e-5, 9.81


def rotation(axis, angle_deg):
    """Matrix of a rotation about an axis."""
    x, y, z = np.asarray(axis) / np.linalg.norm(axis)
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    angle = np.radians(angle_deg)
    return np.eye(3) + np.sin(angle) * cross + (1.0 - np.cos(angle)) * cross @ cross


def in_space(elements, vectors):
    """(n, 2) vectors along x and y of the map -> (n, 3)."""
    return np.einsum("icn,ni->nc", elements.axes, vectors)


def relative(value, expected):
    return np.linalg.norm(value - expected) / np.linalg.norm(expected)


def orders(errors):
    errors = np.array(errors)
    return np.log2(errors[:-1] / errors[1:])


def test_triangles_cover_the_globe_at_second_order():
    errors = []
    for level in (1, 2, 3, 4):
        area = elements_geographic(mesh_of(*icosphere(level))).area
        errors.append(1.0 - area.sum() / (4.0 * np.pi * EARTH_RADIUS**2))
    assert errors[-1] > 0.0  # flat triangles lie inside
    assert np.all(orders(errors) > 1.85)


def test_the_whole_ocean_follows_a_potential_of_degree_two():
    # e = p s/(i w + s), s = 6 g h/(q R**2), since lap p = -6 p/R**2.
    q = 1j * FREQUENCY + FRICTION
    s = 6.0 * GRAVITY * DEPTH / (q * EARTH_RADIUS**2)
    settings = TideSettings(friction=FRICTION, metric="geographic")
    errors = []
    for level in (2, 3, 4):
        points, triangles = icosphere(level)
        equation = WaveEquation(mesh_of(points, triangles), np.empty(0, int), settings)
        potential = tilted_degree_two(points)
        load = equation.apply(Symbols(0.0, 1j * FREQUENCY), potential)
        wave = equation.factorise(Symbols.exact(FREQUENCY))
        exact = potential * s / (1j * FREQUENCY + s)
        errors.append(relative(wave.respond(load), exact))
    assert errors[-1] < 5e-3
    assert np.all(orders(errors) > 1.9)


@pytest.mark.parametrize(
    ("gradient", "order"),
    [(lumped_gradient, 1.4), (projected_gradient, 1.4), (recovered_gradient, 1.8)],
)
def test_gradients_are_right_at_the_poles_and_the_date_line(gradient, order):
    # On the sphere a gradient is the part of that in space tangential to it.
    a, b = np.array([0.3, -0.5, 0.8]), np.array([0.9, 0.4, 0.1j])
    errors, polar = [], []
    for level in (2, 3, 4):
        points, triangles = icosphere(level)
        mesh = mesh_of(points, triangles)
        elements = elements_geographic(mesh)
        along, across = points @ a, points @ b
        nodal = EARTH_RADIUS * (along**3 + across**2)
        given = (mesh, elements) if gradient is recovered_gradient else (elements,)
        found = in_space(elements, gradient(*given, nodal).T)
        slope = 3.0 * along[:, None] ** 2 * a + 2.0 * across[:, None] * b
        exact = slope - points * (points * slope).sum(axis=1)[:, None]
        errors.append(relative(found, exact))
        polar.append(relative(found[[0, 11]], exact[[0, 11]]))
    assert np.all(orders(errors) > order)
    assert polar[-1] < 0.03


def cap(turn):
    """A basin of 25 degrees radius, half of its rim open, moved by a rotation."""
    points, triangles = icosphere(4)
    inside = (points[triangles][..., 2] > np.cos(np.radians(25.0))).all(axis=1)
    used, triangles = np.unique(triangles[inside], return_inverse=True)
    points, triangles = points[used], triangles.reshape(-1, 3)
    ends = np.concatenate([np.roll(triangles, -k, axis=1)[:, :2] for k in range(3)])
    sides, count = np.unique(np.sort(ends, axis=1), axis=0, return_counts=True)
    rim = np.unique(sides[count == 1])
    rim = rim[np.argsort(np.arctan2(points[rim, 1], points[rim, 0]))]
    half = len(rim) // 2
    boundaries = (
        BoundaryString("open", rim[: half + 1]),
        BoundaryString("mainland", np.append(rim[half:], rim[0])),
    )
    depth = 100.0 + 3000.0 * (points[:, 0] + 1.0)
    return mesh_of(points @ turn.T, triangles, GLOBE, boundaries, depth)


def test_a_basin_may_lie_anywhere_on_the_globe():
    settings = TideSettings(friction=FRICTION, metric="geographic")
    home = np.eye(3)  # round the north pole
    places = {
        "equator": rotation([0.0, 1.0, 0.0], 90.0),
        "date line": rotation([0.3, -1.0, 0.1], 75.0),
        "near the south pole": rotation([1.0, 0.2, 0.0], 170.0),
    }

    def tide(turn):
        mesh = cap(turn)
        phase = np.linspace(0.0, 1.0, len(mesh.open_nodes))
        forcing = TideForcing(
            ("M2",),
            np.array([FREQUENCY]),
            mesh.open_nodes,
            np.exp(-1j * phase)[None],
        )
        found = solve(mesh, forcing, settings, coriolis=8.0e-5)
        vectors = in_space(elements_geographic(mesh), found.velocity[0])
        return found.elevation[0], vectors @ turn  # back home

    elevation, velocity = tide(home)
    for turn in places.values():
        moved = tide(turn)
        assert relative(moved[0], elevation) < 1e-9
        assert relative(moved[1], velocity) < 1e-9


def square(size, centre, projection, n=12):
    """A square basin of a side (m) on a map, its western side open."""
    x, y = np.meshgrid(np.linspace(-0.5, 0.5, n + 1), np.linspace(-0.5, 0.5, n + 1))
    points = projection.forward(*centre) + size * np.stack([x.ravel(), y.ravel()], 1)
    node = np.arange(x.size).reshape(x.shape)
    a, b = node[:-1, :-1].ravel(), node[:-1, 1:].ravel()
    c, d = node[1:, 1:].ravel(), node[1:, :-1].ravel()
    triangles = np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)])
    around = np.concatenate([node[0], node[1:, -1], node[-1, -2::-1]])
    boundaries = (
        BoundaryString("open", node[::-1, 0]),
        BoundaryString("mainland", around),
    )
    depth = 20.0 + 5.0 * (x + y).ravel()
    return CoastalMesh(points, triangles, depth, boundaries, projection)


def tide_of(mesh, metric="plane", elements=None):
    forcing = TideForcing(
        ("M2",),
        np.array([FREQUENCY]),
        mesh.open_nodes,
        np.ones((1, len(mesh.open_nodes))),
    )
    # The depth grows with the square of the size, so that the wave stays alike.
    settings = TideSettings(friction=1e-4, metric=metric)
    return solve(mesh, forcing, settings, coriolis=1e-4, elements=elements)


@pytest.mark.parametrize("centre", [(-79.5, 33.0), (20.0, -70.0), (179.99, 89.0)])
def test_small_basins_are_plane(centre):
    errors = []
    for size in (400e3, 200e3, 100e3):
        mesh = square(size, centre, Projection.stereographic(*centre))
        plane, space = tide_of(mesh), tide_of(mesh, "geographic")
        errors.append(relative(space.elevation, plane.elevation))
        assert relative(space.velocity, plane.velocity) < 0.05
    assert errors[-1] < 2e-4
    assert np.all(orders(errors) > 1.7)


def test_the_scale_of_a_map_and_places_in_space_agree_at_second_order():
    projection = Projection.stereographic(-60.0, 20.0)
    errors = []
    for n in (10, 20, 40):
        mesh = square(1500e3, (-50.0, 30.0), projection, n)
        space = tide_of(mesh, "geographic").elevation
        errors.append(relative(tide_of(mesh, "sphere").elevation, space))
    assert errors[-1] < 1e-3
    assert np.all(orders(errors) > 1.5)


def test_adcircs_metric_does_not_depend_on_the_map_of_the_mesh():
    here = square(300e3, (-79.0, 33.0), Projection.stereographic(-85.0, 30.0))
    place = here.projection.inverse(here.points)
    middle = np.round(0.5 * (place.min(axis=0) + place.max(axis=0)), 6)
    own = Projection.equirectangular(*middle)
    there = CoastalMesh(
        own.forward(*place.T), here.triangles, here.depth, here.boundaries, own
    )
    ours, theirs = tide_of(here, "adcirc"), tide_of(there, "adcirc")
    direct = tide_of(there, elements=adcirc_elements(there, middle[1]))
    assert relative(theirs.elevation, direct.elevation) < 1e-12
    assert relative(ours.elevation, theirs.elevation) < 1e-10
    east_north = here.projection.east_north(here.points, ours.velocity)
    assert relative(east_north, theirs.velocity) < 1e-9
    # It is not the metric of the sphere: curvature is left out of the divergence.
    true = tide_of(there, "sphere")
    assert 1e-5 < relative(theirs.elevation, true.elevation) < 1e-1


def test_adcircs_corrected_map_is_that_of_the_sphere():
    projection = Projection("+proj=merc +lat_ts=33 +lon_0=-79 +R=6378206.4 +units=m")
    mesh = square(300e3, (-79.0, 33.0), projection)
    ours, sphere = tide_of(mesh, "adcirc"), tide_of(mesh, "sphere")
    np.testing.assert_allclose(ours.elevation, sphere.elevation, rtol=1e-12)
    assert 0.0 < relative(ours.velocity, sphere.velocity) < 1e-2


def test_orientation_is_judged_on_the_globe():
    points, triangles = icosphere(1)
    mesh = mesh_of(points, triangles)
    with pytest.raises(MeshError, match="not counter-clockwise"):
        Elements.of(mesh)
    elements = elements_geographic(mesh)
    np.testing.assert_array_equal(elements.corners.T, triangles)
    local = int(np.argmax(points[triangles][..., 0].min(axis=1)))  # about (0, 0)
    wrong = triangles.copy()
    wrong[local] = wrong[local, ::-1]
    with pytest.raises(MeshError, match=rf"triangle {local} .* on the globe"):
        elements_geographic(mesh_of(points, wrong))


def test_a_globe_may_come_from_a_file(tmp_path):
    # The reader puts all triangles counter-clockwise on its map, the torn ones too.
    mesh = mesh_of(*icosphere(2))
    write_fort14(tmp_path / "globe.14", mesh)
    read = read_fort14(tmp_path / "globe.14")
    turned = (read.triangles != mesh.triangles).any(axis=1)
    assert 0 < turned.sum() < len(turned) / 2
    np.testing.assert_allclose(
        elements_geographic(read).area, elements_geographic(mesh).area, rtol=1e-6
    )


@pytest.mark.parametrize("metric", ["sphere", "geographic", "adcirc"])
def test_places_are_needed(metric):
    mesh = square(1e4, (0.0, 0.0), Projection())
    with pytest.raises(InputError, match="bare plane"):
        elements_for(mesh, metric)
    assert elements_for(mesh, "plane").scale is None


def test_unknown_metrics_are_named():
    mesh = square(1e4, (-79.0, 33.0), Projection.stereographic(-79.0, 33.0))
    with pytest.raises(ValueError, match='"flat"'):
        elements_for(mesh, "flat")
    for call in (elements_on_sphere, elements_geographic):
        with pytest.raises(InputError, match="map projection"):
            call(square(1e4, (0.0, 0.0), Projection()))
