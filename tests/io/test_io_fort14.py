import gzip
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from io_meshes import assert_same_strings, small_mesh

from tidemesh.constants import EARTH_RADIUS
from tidemesh.datatypes import BoundaryString, CoastalMesh
from tidemesh.errors import FormatError, InputError
from tidemesh.geometry.projection import Projection
from tidemesh.io.fort14 import read_fort14, write_fort14

REFERENCE = Path(__file__).parents[3] / "shared" / "reference" / "adcirc"

HAND_WRITTEN = """\
 A lake with an island, as people write it
 8   8    ! elements, nodes
 10  -75.0   35.0  1.5D+01   trailing text
 20, -74.9,  35.0, 2.0
 30  -74.9   35.1  3
 40  -75.0   35.1  4.
 11  -74.97  35.03 5.0

 12  -74.93  35.03 6.0
 13  -74.93  35.07 7.0
 14  -74.97  35.07 8.0
 1 3 10 20 12
 2 3 10 12 11
 3 3 12 20 30     = an element
 4 3 12 30 13
 5 3 13 30 40
 6 3 13 40 14
 7 3 14 40 10
 8 3 14 10 11
 0 = Number of open boundaries
 0 = Total number of open boundary nodes
 2 = Number of land boundaries
 9 = Total number of land boundary nodes
 5 0 = Number of nodes for land boundary 1
 10
 20
 30
 40
 10
 4 1 = Number of nodes for land boundary 2
 11
 14
 13   the corner
 12
"""


def written(tmp_path, text, name="fort.14"):
    path = tmp_path / name
    path.write_text(text)
    return path


def test_metres_come_back_exactly_and_the_mesh_is_untouched(tmp_path):
    mesh = small_mesh()
    before = mesh.points.copy(), mesh.triangles.copy(), mesh.depth.copy()
    write_fort14(tmp_path / "mesh.14", mesh, title="a\ntitle")
    read = read_fort14(tmp_path / "mesh.14")
    assert read.projection == Projection()
    assert read.points == pytest.approx(mesh.points, abs=1e-10)
    assert np.array_equal(read.triangles, mesh.triangles)
    assert read.depth == pytest.approx(mesh.depth, abs=1e-10)
    order = [0, 2, 1, 3, 4]
    assert_same_strings(read.boundaries, [mesh.boundaries[i] for i in order])
    for array, old in zip((mesh.points, mesh.triangles, mesh.depth), before):
        assert np.array_equal(array, old)
    lines = (tmp_path / "mesh.14").read_text().splitlines()
    assert lines[:3] == [
        "a title",
        "30 25",
        "1 0.1234567890 0.1234567890 " + lines[2].split()[3],
    ]


def test_a_projected_mesh_is_written_in_degrees(tmp_path):
    projection = Projection.stereographic(-79.0, 33.0)
    mesh = small_mesh(projection)
    write_fort14(tmp_path / "mesh.14", mesh)
    table = np.loadtxt(tmp_path / "mesh.14", skiprows=2, max_rows=25)
    assert table[:, 1:3] == pytest.approx(projection.inverse(mesh.points), abs=6e-11)
    read = read_fort14(tmp_path / "mesh.14", projection=projection)
    assert read.projection == projection
    assert read.points == pytest.approx(mesh.points, abs=2e-5)


def test_a_second_trip_changes_no_byte(tmp_path):
    first, second = tmp_path / "a.14.gz", tmp_path / "b.14.gz"
    write_fort14(first, small_mesh(Projection.equirectangular(-79.0, 33.0)))
    projection = Projection.equirectangular(-79.0, 33.0)
    write_fort14(second, read_fort14(first, projection=projection))
    assert gzip.decompress(first.read_bytes()) == gzip.decompress(second.read_bytes())
    write_fort14(tmp_path / "c.14.gz", read_fort14(first, projection=projection))
    assert (tmp_path / "c.14.gz").read_bytes() == second.read_bytes()


def test_a_hand_written_file(tmp_path):
    mesh = read_fort14(written(tmp_path, HAND_WRITTEN))
    # Sorted by number: 10, 11, 12, 13, 14, 20, 30, 40.
    assert mesh.depth.tolist() == [15.0, 5.0, 6.0, 7.0, 8.0, 2.0, 3.0, 4.0]
    assert mesh.triangles[0].tolist() == [0, 5, 2]
    shore, island = mesh.boundaries
    assert (shore.kind, shore.closed, island.kind) == ("mainland", True, "island")
    assert shore.nodes.tolist() == [0, 5, 6, 7]
    assert island.nodes.tolist() == [1, 4, 3, 2]
    # The default is ADCIRC's map about the middle.
    x = EARTH_RADIUS * np.radians(0.05) * np.cos(np.radians(35.05))
    assert mesh.points[5] == pytest.approx([x, -EARTH_RADIUS * np.radians(0.05)])


def test_closed_strings_are_recognised_without_the_repeated_node(tmp_path):
    text = HAND_WRITTEN.replace(" 40\n 10\n", " 40\n").replace(" 5 0 =", " 4 0 =")
    shore = read_fort14(written(tmp_path, text)).boundaries[0]
    assert shore.closed
    assert shore.nodes.tolist() == [0, 5, 6, 7]


def test_closed_open_and_mainland_rings_make_the_trip(tmp_path):
    mesh = small_mesh()
    ring = [0, 1, 2, 3, 4, 9, 14, 19, 24, 23, 22, 21, 20, 15, 10, 5]
    for kind in ("open", "mainland"):
        strings = (BoundaryString(kind, ring, closed=True), mesh.boundaries[-1])
        write_fort14(tmp_path / "mesh.14", replace(mesh, boundaries=strings))
        assert_same_strings(read_fort14(tmp_path / "mesh.14").boundaries, strings)
    # The announced number of land nodes counts the repeated one.
    assert "\n21 ! their nodes\n" in (tmp_path / "mesh.14").read_text()


def test_two_strings_with_a_single_edge_between_them_stay_open(tmp_path):
    mesh = small_mesh()
    ring = [0, 1, 2, 3, 4, 9, 14, 19, 24, 23, 22, 21, 20, 15, 10, 5]
    strings = (BoundaryString("open", ring), BoundaryString("mainland", [5, 0]))
    write_fort14(tmp_path / "mesh.14", replace(mesh, boundaries=strings))
    assert_same_strings(read_fort14(tmp_path / "mesh.14").boundaries, strings)


def test_rows_of_weirs_are_carried(tmp_path):
    mesh = small_mesh()
    wide = BoundaryString(
        "mainland",
        [4, 9, 14],
        ibtype=23,
        extra=np.array([[1.5, 1.0], [1.625, 1.0], [1.75, 0.9]]),
    )
    weir = BoundaryString(
        "island",
        [7, 8],
        ibtype=24,
        extra=np.array([[12.0, 2.5, 1.0, 1.0], [13.0, 2.75, 1.0, 0.5]]),
    )
    pipes = replace(weir, ibtype=5, extra=np.tile(np.arange(7.0), (2, 1)))
    strings = (wide, weir, pipes)
    write_fort14(tmp_path / "mesh.14", replace(mesh, boundaries=strings))
    text = (tmp_path / "mesh.14").read_text()
    assert "\n8 13 2.5 1 1\n9 14 2.75 1 0.5\n" in text
    assert "\n11 ! their nodes\n" in text
    assert_same_strings(read_fort14(tmp_path / "mesh.14").boundaries, strings)


@pytest.mark.parametrize(
    ("longitudes", "middle"),
    [
        ([280.0, 281.0, 281.0, 280.0], -79.5),
        ([179.0, -179.0, -179.0, 179.0], 180.0),
        ([179.0, 181.0, 181.0, 179.0], 180.0),
    ],
)
def test_longitudes_of_either_habit(tmp_path, longitudes, middle):
    nodes = "".join(
        f"{i} {lon} {lat} 1\n"
        for i, (lon, lat) in enumerate(zip(longitudes, [10, 10, 11, 11]), start=1)
    )
    path = written(tmp_path, f"t\n2 4\n{nodes}1 3 1 2 3\n2 3 1 3 4\n")
    mesh = read_fort14(path)
    assert f"+lon_0={middle:.6f}" in mesh.projection.crs
    assert np.ptp(mesh.points[:, 0]) < 3e5
    assert mesh.triangles.tolist() == [[0, 1, 2], [0, 2, 3]]


def test_coordinates_may_be_said(tmp_path):
    text = "t\n1 3\n1 0 0 1\n2 0 50 1\n3 60 0 1\n1 3 1 2 3\n"
    path = written(tmp_path, text)
    mesh = read_fort14(path, coordinates="metres")
    assert mesh.points.tolist() == [[0.0, 0.0], [0.0, 50.0], [60.0, 0.0]]
    # A clockwise element is turned.
    assert mesh.triangles.tolist() == [[0, 2, 1]]
    assert mesh.boundaries == ()
    assert np.ptp(read_fort14(path).points) > 1e6
    far = written(tmp_path, text.replace("60", "900"))
    with pytest.raises(FormatError, match=r"x 0\.\.900 .* are not degrees"):
        read_fort14(far, coordinates="degrees")
    with pytest.raises(ValueError, match="coordinates must be"):
        read_fort14(path, coordinates="feet")


@pytest.mark.parametrize(
    ("old", "new", "line", "message"),
    [
        (" 8   8    !", " nine 8", 2, "numbers of elements and nodes"),
        (" 8   8    !", " 0 8", 2, "at least 1 element"),
        (" 40  -75.0   35.1  4.", " 40  -75.0   35.1", 6, "a node: number, x, y"),
        (" 40  -75.0   35.1  4.", " 40  -75.0   3x.1 4", 6, "a node: number, x, y"),
        (" 40  -75.0   35.1  4.", " 40  -75.0   nan 4", 6, "not finite"),
        (" 40  -75.0   35.1  4.", " 30  -75.0   35.1 4", 6, "was given before"),
        (" 40  -75.0   35.1  4.", " 40.5 -75.0  35.1 4", 6, "must be whole"),
        (" 4 3 12 30 13", " 4 3 12 30 99", 15, "no node of that number"),
        (" 4 3 12 30 13", " 4 4 12 30 13", 15, "element of 3 nodes"),
        (" 4 3 12 30 13", " 4 3 12 30 30", 15, "one node twice"),
        (" 4 3 12 30 13", " 4 3 12 30", 15, "an element: number, 3"),
        (" 5 0 = Number", " 5 = Number", 24, "number of nodes and the type"),
        (" 5 0 = Number", " 0 0 = Number", 24, "at least 1 node"),
        (" 13   the corner", " 99", 33, "no node of that number"),
        (" 13   the corner\n 12\n", " 13\n", 33, "the file ends here"),
    ],
)
def test_garbled_files_name_the_line(tmp_path, old, new, line, message):
    assert old in HAND_WRITTEN
    path = written(tmp_path, HAND_WRITTEN.replace(old, new))
    with pytest.raises(FormatError, match=message) as caught:
        read_fort14(path)
    assert caught.value.line == line
    assert f"fort.14: line {line}: " in str(caught.value)


def test_files_that_cannot_be_read(tmp_path):
    with pytest.raises(InputError, match=r"none\.14: cannot be read"):
        read_fort14(tmp_path / "none.14")
    with pytest.raises(FormatError, match="the file is empty"):
        read_fort14(written(tmp_path, ""))
    with pytest.raises(FormatError, match="line 1: the file ends here"):
        read_fort14(written(tmp_path, "only a title"))
    packed = gzip.compress(HAND_WRITTEN.encode())[:-20]
    (tmp_path / "cut.gz").write_bytes(packed)
    with pytest.raises(FormatError, match="compressed file is damaged"):
        read_fort14(tmp_path / "cut.gz")


def test_plain_and_careful_reading_agree_to_the_last_bit(tmp_path):
    rng = np.random.default_rng(3)
    points = rng.uniform(-1e6, 1e6, (2000, 2))
    k = np.arange(1998)
    mesh = CoastalMesh(points, np.stack([k, k + 1, k + 2], 1), rng.normal(size=2000))
    write_fort14(tmp_path / "a.14", mesh)
    text = (tmp_path / "a.14").read_text()
    plain = read_fort14(tmp_path / "a.14")
    careful = read_fort14(written(tmp_path, text.replace("\n", " text\n")))
    assert np.array_equal(plain.points, careful.points)
    assert np.array_equal(plain.depth, careful.depth)
    assert np.array_equal(plain.triangles, careful.triangles)
    windows = written(tmp_path, text)
    windows.write_bytes(text.replace("\n", "\r\n").encode())
    assert np.array_equal(read_fort14(windows).points, plain.points)


@pytest.mark.parametrize(
    ("case", "nodes", "projected", "lengths"),
    [
        ("qa_ts_lin", 63, False, [9, 21]),
        ("qa_r8_lin", 3185, False, [65, 161]),
        ("sh_lin", 3070, True, [75, 285]),
        ("sh_lin_cart", 3070, False, [75, 285]),
    ],
)
def test_meshes_that_adcirc_has_run(tmp_path, case, nodes, projected, lengths):
    path = REFERENCE / case / "fort.14.gz"
    if not path.is_file():
        pytest.skip("the ADCIRC reference cases are not beside the repository")
    mesh = read_fort14(path)
    assert len(mesh.points) == nodes
    assert (mesh.projection.crs != "") == projected
    assert [s.kind for s in mesh.boundaries] == ["open", "mainland"]
    assert [len(s.nodes) for s in mesh.boundaries] == lengths
    write_fort14(tmp_path / "mesh.14", mesh)
    again = read_fort14(tmp_path / "mesh.14")
    assert again.points == pytest.approx(mesh.points, abs=1e-4)
    assert np.array_equal(again.triangles, mesh.triangles)
    assert_same_strings(again.boundaries, mesh.boundaries)
