"""Whatever is stored comes back, bit for bit, and the file depends on it alone."""

import numpy as np
import pytest

from tidemesh.datatypes import CoastalMesh, Domain, LedgerEntry, Ring
from tidemesh.geometry.projection import Projection
from tidemesh.pipeline import store


@pytest.fixture
def value():
    ring = Ring(np.array([[0.1, 0.2], [1.0, 0.0], [0.0, 1 / 3]]), np.array([0, 1, 0]))
    entry = LedgerEntry("island dropped", -79.5, 33.25, 1.5e6, "below 4 km2")
    domain = Domain((ring,), Projection.stereographic(-79.0, 33.0), (entry,))
    mesh = CoastalMesh(ring.points, [[0, 1, 2]], [1.0, 2.0, np.nan])
    numbers = np.array([1 + 2j, np.inf])
    return {"domain": domain, "mesh": mesh, "list": [1, "two", None, numbers]}


def test_round_trip(tmp_path, value):
    store.save(tmp_path / "a.npz", value)
    back = store.load(tmp_path / "a.npz")
    assert back["domain"].projection == value["domain"].projection
    assert back["domain"].ledger == value["domain"].ledger
    ring, ring_back = value["domain"].rings[0], back["domain"].rings[0]
    np.testing.assert_array_equal(ring_back.points, ring.points)
    np.testing.assert_array_equal(ring_back.segment_kind, ring.segment_kind)
    np.testing.assert_array_equal(back["mesh"].depth, value["mesh"].depth)
    assert back["list"][:3] == [1, "two", None]
    np.testing.assert_array_equal(back["list"][3], value["list"][3])


def test_same_value_same_bytes(tmp_path, value):
    store.save(tmp_path / "a.npz", value)
    store.save(tmp_path / "b.npz", value)
    assert (tmp_path / "a.npz").read_bytes() == (tmp_path / "b.npz").read_bytes()


def test_unknown_type_is_refused_and_leaves_nothing(tmp_path):
    with pytest.raises(TypeError, match="cannot store a object"):
        store.save(tmp_path / "a.npz", object())
    assert list(tmp_path.iterdir()) == []
