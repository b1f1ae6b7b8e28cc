"""ADCIRC's harmonic constants."""

import gzip

import numpy as np
import pytest
from numpy.testing import assert_allclose

from tidemesh.datatypes import TideSolution
from tidemesh.errors import FormatError, InputError
from tidemesh.io.fort53 import read_fort53, read_fort54, write_fort53, write_fort54

ELEVATION = """\
           2
     0.0000000000E+00  1.0000000   0.00000000  STEADY
     0.1405257000E-03  1.1000000  90.00000000  M2
           2
           1
  -1.00000000E-001      0.0000
   2.00000000E+000     90.0000
           2
   3.00000000-101      0.0000
  -9.99990000E+004 -99999.0000
"""

VELOCITY = """\
 1
 1.4E-4 1.0 0.0 M2
 2
 1
 1.0 0.0 2.0 180.0
 2
 0.5 270.0 0.0 0.0   trailing text
"""


@pytest.fixture
def tide():
    rng = np.random.default_rng(1)
    shape = (2, 50)
    elevation = rng.normal(size=shape) + 1j * rng.normal(size=shape)
    velocity = rng.normal(size=(*shape, 2)) + 1j * rng.normal(size=(*shape, 2))
    elevation[0, 0] = 1.0 * np.exp(1e-9j)  # a phase that rounds to 360
    return TideSolution(
        names=("M2", "K1"),
        frequency=np.array([1.405189e-4, 7.292116e-5]),
        elevation=elevation,
        velocity=velocity,
        friction=np.zeros(50),
    )


def test_reads_elevation(tmp_path):
    path = tmp_path / "fort.53"
    path.write_text(ELEVATION)
    constants = read_fort53(path)
    assert constants.names == ("STEADY", "M2")
    assert_allclose(constants.frequency, [0.0, 1.405257e-4])
    assert_allclose(constants.nodal_factor, [1.0, 1.1])
    assert_allclose(constants.equilibrium_argument, [0.0, np.pi / 2])
    assert_allclose(constants.values[:, 0], [-0.1, -2j], atol=1e-15)
    assert constants.values[0, 1] == 3e-101
    assert np.isnan(constants.values[1, 1])


def test_reads_velocity(tmp_path):
    path = tmp_path / "fort.54.gz"
    path.write_bytes(gzip.compress(VELOCITY.encode()))
    constants = read_fort54(path)
    assert constants.values.shape == (1, 2, 2)
    assert_allclose(constants.values[0], [[1.0, -2.0], [0.5j, 0.0]], atol=1e-15)


@pytest.mark.parametrize("suffix", ["", ".gz"])
def test_written_is_read_and_the_same_bytes_twice(tmp_path, tide, suffix):
    for name, write, read, values in (
        ("fort.53", write_fort53, read_fort53, tide.elevation),
        ("fort.54", write_fort54, read_fort54, tide.velocity),
    ):
        path = tmp_path / (name + suffix)
        write(path, tide)
        first = path.read_bytes()
        write(path, tide)
        assert path.read_bytes() == first
        constants = read(path)
        assert constants.names == tide.names
        assert_allclose(constants.frequency, tide.frequency)
        # Four decimals of a degree.
        assert_allclose(constants.values, values, atol=1e-5 * np.abs(values).max())
    assert "360.0000" not in gzip.decompress(first).decode() if suffix else True


@pytest.mark.parametrize(
    ("old", "new", "line", "message"),
    [
        ("           2\n     0.0", "many\n     0.0", 1, "number of constituents"),
        ("1.1000000  90.00000000  M2", "one", 3, "expected frequency, nodal factor"),
        ("M2\n           2\n", "M2\n    -2\n", 4, "number of nodes"),
        ("     90.0000", "      east", 7, r'expected 2 number\(s\), got "2.0'),
        ("           2\n   3.0", "           3\n   3.0", 8, "expected node 2, got 3"),
        ("  -9.99990000E+004 -99999.0000\n", "", 9, "ends early"),
    ],
)
def test_what_cannot_be_read_is_named_with_its_line(tmp_path, old, new, line, message):
    assert old in ELEVATION
    path = tmp_path / "fort.53"
    path.write_text(ELEVATION.replace(old, new, 1))
    with pytest.raises(FormatError, match=message) as caught:
        read_fort53(path)
    assert caught.value.line == line


def test_missing_empty_and_broken_files(tmp_path):
    with pytest.raises(InputError, match="no such file"):
        read_fort53(tmp_path / "fort.53")
    empty = tmp_path / "empty"
    empty.write_text("")
    with pytest.raises(FormatError, match="ends in its header"):
        read_fort53(empty)
    broken = tmp_path / "fort.53.gz"
    broken.write_bytes(gzip.compress(ELEVATION.encode())[:60])
    with pytest.raises(FormatError, match="compressed file is damaged"):
        read_fort53(broken)
