import numpy as np
import pytest
from triangulation_meshes import mesh

from tidemesh.datatypes import BoundaryString
from tidemesh.errors import MeshError
from tidemesh.geometry.polygons import ring_area
from tidemesh.triangulation import topology
from tidemesh.triangulation.domain import boundary_strings

SQUARE = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
TWO = np.array([[0, 1, 2], [0, 2, 3]])


def names(problems):
    return [problem.name for problem in problems]


def test_two_triangles_by_hand():
    assert topology.edges(TWO).tolist() == [[0, 1], [0, 2], [0, 3], [1, 2], [2, 3]]
    assert topology.neighbours(TWO).tolist() == [[-1, -1, 1], [0, -1, -1]]
    assert topology.boundary_edges(TWO).tolist() == [[0, 1], [1, 2], [2, 3], [3, 0]]
    assert topology.boundary_edge_triangles(TWO).tolist() == [0, 0, 1, 1]
    assert [ring.tolist() for ring in topology.boundary_rings(TWO)] == [[0, 1, 2, 3]]
    assert topology.valence(TWO, 5).tolist() == [3, 2, 3, 2, 0]
    assert topology.connected_components(TWO)[0] == 1


def test_edge_table_gives_each_triangle_its_edges():
    _, _, triangles = mesh(1)
    edges, number = topology.edge_table(triangles)
    for corner in range(3):
        pair = np.sort(triangles[:, [corner, (corner + 1) % 3]], axis=1)
        assert np.array_equal(edges[number[:, corner]], pair)


def test_adjacency_agrees_with_plain_sets():
    _, points, triangles = mesh(2, islands=2, n=100)
    near = [set() for _ in points]
    around = [[] for _ in points]
    for number, triple in enumerate(triangles.tolist()):
        for node in triple:
            near[node] |= set(triple) - {node}
            around[node].append(number)
    start, nodes = topology.node_to_nodes(triangles, len(points))
    first, numbers = topology.node_to_triangles(triangles, len(points))
    for node in range(len(points)):
        assert nodes[start[node] : start[node + 1]].tolist() == sorted(near[node])
        assert numbers[first[node] : first[node + 1]].tolist() == around[node]
    assert np.array_equal(
        topology.valence(triangles, len(points)), [len(s) for s in near]
    )


def test_neighbours_share_the_edge_they_are_listed_for():
    _, _, triangles = mesh(5, islands=1)
    other = topology.neighbours(triangles)
    for corner in range(3):
        own, across = np.flatnonzero(other[:, corner] >= 0), other[:, corner]
        start = triangles[own, corner]
        end = triangles[own, (corner + 1) % 3]
        theirs = triangles[across[own]]
        assert (theirs == start[:, None]).any(axis=1).all()
        assert (theirs == end[:, None]).any(axis=1).all()


def test_rings_keep_the_water_on_their_left():
    _, points, triangles = mesh(4, islands=3)
    rings = topology.boundary_rings(triangles)
    assert [len(ring) for ring in rings] == [60, 12, 12, 12]
    areas = [ring_area(points[ring]) for ring in rings]
    assert areas[0] > 0.0
    assert max(areas[1:]) < 0.0


# Two squares that touch in node 2.
PINCHED = np.array([[0, 1, 2], [0, 2, 3], [2, 4, 5], [2, 5, 6]])
PINCHED_POINTS = np.concatenate([SQUARE, [[2.0, 1.0], [2.0, 2.0], [1.0, 2.0]]])


def test_a_walk_passes_a_pinched_node_without_leaving_its_triangles():
    rings = topology.boundary_rings(PINCHED)
    assert [ring.tolist() for ring in rings] == [[0, 1, 2, 3], [2, 4, 5, 6]]
    found = topology.check_mesh(PINCHED_POINTS, PINCHED)
    assert names(found) == [
        "triangle apart from the largest part",
        "pinched boundary node",
    ]
    assert found[1].indices.tolist() == [2]
    assert found[1].place == (1.0, 1.0)


def test_mixed_directions_do_not_close():
    with pytest.raises(MeshError, match="does not close at node"):
        topology.boundary_rings(np.array([[0, 1, 2], [1, 2, 3]]))


def test_a_valid_mesh_has_no_problems():
    domain, points, triangles = mesh(6, islands=4)
    depth = np.full(len(points), 3.0)
    strings = boundary_strings(domain)
    assert topology.check_mesh(points, triangles, depth, strings, minimum_depth=3) == []
    topology.require_valid(points, triangles, depth, strings, minimum_depth=3.0)


def test_inverted_flat_duplicate_and_crowded_triangles():
    assert "inverted triangle" in names(topology.check_mesh(SQUARE, TWO[:, ::-1]))
    line = np.array([[0.0, 0.0], [1.0, 0.0], [2.0, 0.0], [0.0, 1.0]])
    flat = np.array([[0, 1, 2], [0, 2, 3]])
    assert "flat triangle" in names(topology.check_mesh(line, flat))
    twice = np.array([[0, 1, 2], [0, 2, 3], [1, 2, 0]])
    assert "duplicate triangle" in names(topology.check_mesh(SQUARE, twice))
    _, inner, triangles = mesh(14)
    number = int(np.flatnonzero((topology.neighbours(triangles) >= 0).all(axis=1))[0])
    copied = np.concatenate([triangles, np.roll(triangles[number : number + 1], 1)])
    found = topology.check_mesh(inner, copied)
    assert names(found)[0] == "duplicate triangle"
    assert found[0].indices.tolist() == [len(triangles)]
    points = np.concatenate([SQUARE, [[0.2, 0.7]]])
    three = np.array([[0, 1, 2], [0, 2, 3], [0, 2, 4]])
    assert "edge of more than two triangles" in names(
        topology.check_mesh(points, three)
    )


def test_a_fold_without_shared_edges_is_an_overlap():
    # A fan of eight triangles that winds twice around nothing: an annulus strip whose
    # ends lie over one another.
    turn = np.linspace(0.0, 2.2 * 2.0 * np.pi, 40)
    inner = np.stack([np.cos(turn), np.sin(turn)], axis=1)
    points = np.concatenate([inner, 2.0 * inner])
    k = np.arange(39)
    strip = np.concatenate(
        [np.stack([k, k + 40, k + 41], 1), np.stack([k, k + 41, k + 1], 1)]
    )
    assert names(topology.check_mesh(points, strip)) == ["overlapping triangles"]
    part = strip[(strip % 40 < 15).all(axis=1)]
    kept, number = np.unique(part, return_inverse=True)
    assert topology.check_mesh(points[kept], number.reshape(-1, 3)) == []


def test_unused_coinciding_and_separate_nodes():
    points = np.concatenate([SQUARE, [[5.0, 5.0], [0.0, 0.0]]])
    found = topology.check_mesh(points, TWO)
    assert names(found) == ["unused node", "coinciding node"]
    assert found[0].indices.tolist() == [4, 5]
    apart = np.concatenate([SQUARE, SQUARE + 5.0])
    both = np.concatenate([TWO, TWO[:1] + 4])
    found = topology.check_mesh(apart[:7], both)
    assert names(found) == ["triangle apart from the largest part"]
    assert found[0].indices.tolist() == [2]


def test_not_finite_points_and_wrong_indices_come_alone():
    points = SQUARE.copy()
    points[1, 0] = np.nan
    assert names(topology.check_mesh(points, TWO)) == ["point not finite"]
    assert names(topology.check_mesh(SQUARE, TWO + 1)) == ["triangle names no node"]
    none = np.empty((0, 3), dtype=int)
    assert names(topology.check_mesh(SQUARE, none)) == ["no triangles"]


def test_depths():
    depth = np.array([1.0, np.nan, 0.5, 2.0])
    found = topology.check_mesh(SQUARE, TWO, depth, minimum_depth=1.0)
    assert names(found) == ["depth not finite", "depth below the minimum"]
    assert [problem.indices.tolist() for problem in found] == [[1], [2]]
    with pytest.raises(MeshError, match=r"depth not finite: 1, first at x 1\.0 m"):
        topology.require_valid(SQUARE, TWO, depth)


@pytest.mark.parametrize(
    ("strings", "wanted"),
    [
        ([("open", [0, 1, 2]), ("mainland", [2, 3, 0])], []),
        ([("open", [0, 1, 2])], ["boundary edge in no string"]),
        (
            [("open", [0, 1, 2]), ("mainland", [0, 3, 2])],
            ["string segment with the water on its right"],
        ),
        (
            [("open", [0, 1, 2]), ("mainland", [1, 2, 3, 0])],
            ["boundary edge in several strings"],
        ),
        (
            [("open", [0, 1, 2]), ("mainland", [2, 0, 3])],
            [
                "string segment with the water on its right",
                "string segment that is no boundary edge",
                "boundary edge in no string",
            ],
        ),
        (
            [("open", [0, 1]), ("mainland", [1, 2, 3, 0])],
            ["node of a string of fewer than 3 nodes"],
        ),
    ],
)
def test_strings(strings, wanted):
    boundaries = [BoundaryString(kind, nodes) for kind, nodes in strings]
    assert names(topology.check_mesh(SQUARE, TWO, boundaries=boundaries)) == wanted


def test_a_weir_covers_both_its_sides_and_its_ends():
    # A row of three squares with the middle one cut out as a slot.
    x, y = np.meshgrid(np.arange(4.0), np.arange(4.0))
    points = np.stack([x.ravel(), y.ravel()], axis=1)
    cells = [r * 4 + c for r in range(3) for c in range(3) if (r, c) != (1, 1)]
    triangles = np.array(
        [t for i in cells for t in ([i, i + 1, i + 5], [i, i + 5, i + 4])]
    )
    outer = [0, 1, 2, 3, 7, 11, 15, 14, 13, 12, 8, 4]
    shore = BoundaryString("mainland", outer, closed=True)
    # Front 5 -> 6 has the water below it, back 9 -> 10 the water above.
    weir = BoundaryString(
        "island",
        [6, 5],
        ibtype=24,
        extra=np.array([[10.0, 1, 1, 1], [9.0, 1, 1, 1]]),
    )
    found = topology.check_mesh(points, triangles, boundaries=[shore, weir])
    assert "boundary edge in no string" not in names(found)
    assert "string segment with the water on its right" not in names(found)
