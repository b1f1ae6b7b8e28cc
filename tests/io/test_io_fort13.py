"""ADCIRC's nodal attributes."""

import gzip
import logging

import numpy as np
import pytest
from io_meshes import small_mesh
from numpy.testing import assert_array_equal

from tidemesh.errors import FormatError, InputError
from tidemesh.io.fort13 import NodalAttributes, read_fort13, write_fort13

ATTRIBUTES = """\
a bay
25
2
mannings_n_at_sea_floor
 time/(length**1/3)
 1
 0.022
wave_refraction  a word behind
none
2
0.0 1.0
wave_refraction
 3
3 1.0D-1 2.0
 1,5 6
25 -1 -2 behind
mannings_n_at_sea_floor
1
7 0.03
"""
"""The values in another order than the head, as some files have it."""


@pytest.fixture
def path(tmp_path):
    return tmp_path / "fort.13"


def test_reads_defaults_and_the_nodes_listed(path):
    path.write_text(ATTRIBUTES)
    attributes = read_fort13(path, small_mesh())
    assert attributes.title == "a bay"
    assert attributes.names == ("mannings_n_at_sea_floor", "wave_refraction")
    assert attributes.units == ("time/(length**1/3)", "none")
    manning = np.full((25, 1), 0.022)
    manning[6] = 0.03
    assert_array_equal(attributes.of("mannings_n_at_sea_floor"), manning)
    other = np.tile([0.0, 1.0], (25, 1))
    other[[2, 0, 24]] = [0.1, 2.0], [5.0, 6.0], [-1.0, -2.0]
    assert_array_equal(attributes.of("wave_refraction"), other)
    with pytest.raises(InputError, match='no nodal attribute "tau0"; there are: mann'):
        attributes.of("tau0")


@pytest.mark.parametrize("name", ["fort.13", "fort.13.gz"])
def test_written_is_read_and_the_same_bytes_twice(tmp_path, name):
    rng = np.random.default_rng(2)
    values = (rng.normal(size=(40, 1)), rng.integers(0, 2, (40, 3)) / 3.0)
    attributes = NodalAttributes(
        "random", ("one", "three"), ("m", ""), ([0.5], [0, 0, 0]), values
    )
    path = tmp_path / name
    write_fort13(path, attributes)
    first = path.read_bytes()
    read = read_fort13(path)
    assert read.names == attributes.names
    for pair in zip(
        read.values + read.defaults, attributes.values + attributes.defaults
    ):
        assert_array_equal(*pair)
    write_fort13(path, read)
    assert path.read_bytes() == first
    text = gzip.decompress(first) if name.endswith("gz") else first
    # Nodes at the default are not listed.
    listed = int(text.decode().split("\nthree\n")[-1].split()[0])
    assert listed == np.count_nonzero(values[1].any(axis=1)) < 40


@pytest.mark.parametrize(
    ("old", "new", "line", "message"),
    [
        ("a bay\n25", "a bay\n24", 2, "24 nodes, the mesh has 25.*not belong"),
        ("a bay\n25", "a bay\nmany", 2, "a whole number .the number of nodes"),
        ("a bay\n25", "a bay\n999999999", 2, "at most 200000000 nodes"),
        ("wave_refraction  a", "mannings_n_at_sea_floor  a", 8, "was given before"),
        ("2\n0.0 1.0", "2\n0.0", 11, "2 values on one line .the default of wave"),
        ("2\n0.0 1.0", "0\n0.0", 10, "1 to 1000, got 0"),
        ("wave_refraction\n", "wind\n", 12, "values of one of mann.*, wave.*wind"),
        ("\n 3\n", "\n 30\n", 13, "at most 25 nodes of wave_refraction, got 30"),
        ("\n 3\n", "\n 4\n", 17, "3 values .*of wave.* got .mann"),
        ("\n 3\n", "\n 2\n", 16, 'one of mann.*, got "25"'),
        (" 1,5 6", " 26 5 6", 15, "a node number from 1 to 25, got 26"),
        (" 1,5 6", " 3 5 6", 14, "node 3 has two different values"),
        (" 1,5 6", " 1,5", 15, 'expected 3 values.*, got "1,5"'),
        ("7 0.03\n", "", 18, "the file ends here; expected node and value"),
        ("7 0.03\n", "7 0.03\n8 0.04\n", 20, 'the end of the file, got "8 0.04"'),
    ],
)
def test_what_cannot_be_read_is_named_with_its_line(path, old, new, line, message):
    assert old in ATTRIBUTES
    path.write_text(ATTRIBUTES.replace(old, new, 1))
    with pytest.raises(FormatError, match=message) as caught:
        read_fort13(path, small_mesh())
    assert caught.value.line == line


def test_every_cut_is_noticed(path, caplog):
    last = ATTRIBUTES.rindex("0.03")
    for cut in range(0, last + 1, 3):
        path.write_text(ATTRIBUTES[:cut])
        with pytest.raises(FormatError) as caught:
            read_fort13(path)
        assert caught.value.line is not None
    # In the last number of all nobody can tell, but it is said.
    path.write_text(ATTRIBUTES[: last + 3])
    with caplog.at_level(logging.WARNING):
        read_fort13(path)
    assert "its last number may be cut off" in caplog.text


def test_garbled_files_are_refused_or_read_but_nothing_else(path):
    rng = np.random.default_rng(7)
    content = ATTRIBUTES.encode()
    refused = []
    for _ in range(200):
        damaged = bytearray(content)
        for place in rng.integers(0, len(damaged), rng.integers(1, 4)):
            damaged[place] = rng.integers(0, 256)
        path.write_bytes(bytes(damaged))
        try:
            attributes = read_fort13(path)
        except FormatError as error:
            refused.append(error.line)
            continue
        assert np.isfinite(attributes.values[0]).all()
    assert len(refused) > 50
    assert None not in refused


def test_fields_must_fit_together():
    with pytest.raises(ValueError, match="as many"):
        NodalAttributes("", ("a",), (), (), ())
    with pytest.raises(ValueError, match="one name"):
        NodalAttributes("", ("a", "a"), ("", ""), ([0], [0]), (np.zeros((3, 1)),) * 2)
    with pytest.raises(ValueError, match="a must have shape"):
        NodalAttributes("", ("a",), ("",), ([0, 0],), (np.zeros((3, 1)),))
