import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from triangulation_meshes import bay, circle, mesh, polygon

from tidemesh.datatypes import LAND, OCEAN, CoastalMesh, Domain, Ring
from tidemesh.errors import MeshError
from tidemesh.geometry.projection import Projection
from tidemesh.triangulation import quality, topology
from tidemesh.triangulation.domain import (
    boundary_strings,
    boundary_strings_from_mesh,
    domain_from_mesh,
    ring_points,
    ring_segments,
    triangulate,
)


@settings(max_examples=12, deadline=None)
@given(seed=st.integers(0, 10_000), islands=st.integers(0, 4), n=st.integers(0, 600))
def test_triangulation_is_a_partition_of_the_domain(seed, islands, n):
    domain, points, triangles = mesh(seed, islands, n)
    n_edges = len(topology.edges(triangles))
    assert len(points) - n_edges + len(triangles) == 1 - islands
    area = quality.area(points, triangles)
    assert (area > 0.0).all()
    assert area.sum() == pytest.approx(polygon(domain).area, rel=1e-12)
    kept = {tuple(edge) for edge in topology.boundary_edges(triangles).tolist()}
    assert kept == {tuple(edge) for edge in ring_segments(domain).tolist()}
    strings = boundary_strings(domain)
    assert topology.check_mesh(points, triangles, boundaries=strings) == []


def test_points_come_ring_after_ring_then_interior_as_given():
    domain = bay(islands=2)
    interior = np.array([[10.0, 20.0], [-5.0, 7.0], [100.0, -30.0]])
    points, _ = triangulate(domain, interior)
    assert np.array_equal(points[:84], ring_points(domain))
    assert np.array_equal(points[84:], interior)


def test_points_outside_are_refused_with_their_place():
    domain = bay()
    with pytest.raises(MeshError, match=r"1 of 74 points .* x 5000\.000 m, y 1\.000"):
        triangulate(domain, np.array([[0.0, 0.0], [5000.0, 1.0]]))


def test_a_point_on_a_segment_is_refused_with_the_segments_place():
    square = 1000.0 * np.array([[1.0, 0.0], [0.0, 1.0], [-1.0, 0.0], [0.0, -1.0]])
    domain = Domain((Ring(square, np.full(4, LAND)),), Projection())
    with pytest.raises(MeshError, match=r"1 boundary segments are split"):
        triangulate(domain, np.array([[500.0, 500.0], [0.0, 0.0]]))


def test_the_place_is_in_degrees_where_there_is_a_projection():
    domain = bay(projection=Projection.equirectangular(-79.0, 33.0))
    with pytest.raises(MeshError, match=r"longitude -78\.9.*, latitude 33\.0"):
        triangulate(domain, np.array([[5000.0, 1.0]]))


def test_mixed_ring_gives_runs_that_share_their_ends():
    strings = boundary_strings(bay(islands=1))
    assert [s.kind for s in strings] == ["open", "open"] + ["mainland"] * 2 + ["island"]
    first, second, west, east, island = [s.nodes for s in strings]
    assert np.array_equal(first, [*range(54, 60), *range(10)]) or np.array_equal(
        second, [*range(54, 60), *range(10)]
    )
    ends = {(int(s.nodes[0]), int(s.nodes[-1])) for s in strings[:2]}
    assert ends == {(54, 9), (30, 36)}
    assert {(int(west[0]), int(west[-1])), (int(east[0]), int(east[-1]))} == {
        (9, 30),
        (36, 54),
    }
    assert np.array_equal(island, np.arange(60, 72))
    assert strings[4].closed
    assert strings[4].ibtype == 1
    assert not any(s.closed for s in strings[:4])


@pytest.mark.parametrize(("kinds", "name"), [("ocean", "open"), ("land", "mainland")])
def test_a_ring_of_one_kind_is_one_closed_string(kinds, name):
    (string,) = boundary_strings(bay(islands=0, kinds=kinds))
    assert (string.kind, string.closed, string.ibtype) == (name, True, 0)
    assert np.array_equal(string.nodes, np.arange(60))


def as_segments(strings):
    """Directed segments with the kind of their string."""
    found = set()
    for string in strings:
        nodes = string.nodes.tolist()
        after = nodes[1:] + nodes[:1] if string.closed else nodes[1:]
        found |= {(string.kind, a, b) for a, b in zip(nodes, after)}
    return found


@pytest.mark.parametrize("kinds", ["mixed", "ocean", "land"])
def test_strings_from_the_mesh_equal_those_from_the_domain(kinds):
    domain, points, triangles = mesh(3, islands=3, kinds=kinds)
    wanted = boundary_strings(domain)
    opened = [s.nodes for s in wanted if s.kind == "open"]
    nodes = np.concatenate(opened) if opened else None
    have = boundary_strings_from_mesh(points, triangles, nodes)
    assert as_segments(have) == as_segments(wanted)
    assert [s.kind for s in have] == [s.kind for s in wanted]
    mask = np.isin(np.arange(len(points)), [] if nodes is None else nodes)
    same = boundary_strings_from_mesh(points, triangles, mask)
    assert as_segments(same) == as_segments(wanted)


def rings_of(domain):
    """Kind of every directed segment, by its end points."""
    return {
        (tuple(a), tuple(b)): int(kind)
        for ring in domain.rings
        for a, b, kind in zip(
            ring.points.tolist(),
            np.roll(ring.points, -1, axis=0).tolist(),
            ring.segment_kind,
        )
    }


def test_the_domain_of_a_mesh_is_the_one_it_was_made_from():
    domain, points, triangles = mesh(3, islands=2)
    made = CoastalMesh(
        points, triangles, np.ones(len(points)), boundary_strings(domain)
    )
    again = domain_from_mesh(made)
    assert len(again.rings) == len(domain.rings) == 3
    assert rings_of(again) == rings_of(domain)
    assert set(rings_of(domain).values()) == {LAND, OCEAN}


def test_a_mesh_of_two_parts_bounds_no_one_body_of_water():
    points = np.array([[0, 0], [1, 0], [0, 1], [5, 5], [6, 5], [5, 6]], dtype=float)
    parts = CoastalMesh(points, [[0, 1, 2], [3, 4, 5]], np.ones(6))
    with pytest.raises(MeshError, match="2 separate parts"):
        domain_from_mesh(parts)


def test_open_edges_tell_a_single_land_edge_between_two_open_strings():
    ring = circle((0.0, 0.0), 1000.0, 8)
    kind = np.array([OCEAN, OCEAN, LAND, OCEAN, OCEAN, LAND, LAND, LAND])
    domain = Domain((Ring(ring, kind),), Projection())
    points, triangles = triangulate(domain, np.zeros((1, 2)))
    wanted = boundary_strings(domain)
    edges = ring_segments(domain)[kind == OCEAN][:, ::-1]
    have = boundary_strings_from_mesh(points, triangles, open_edges=edges)
    assert as_segments(have) == as_segments(wanted)
    assert len([s for s in have if s.kind == "open"]) == 2
