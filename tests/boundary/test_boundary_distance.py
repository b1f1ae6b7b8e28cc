"""Distance to land: to the segment, not to its ends, and not to the open sea."""

import numpy as np

from tidemesh.boundary import distance_to_land
from tidemesh.datatypes import LAND, OCEAN, Domain, Ring
from tidemesh.geometry.projection import Projection

SQUARE = np.array([[0.0, 0.0], [10.0, 0.0], [10.0, 10.0], [0.0, 10.0]])


def test_against_closed_form():
    ring = Ring(SQUARE, [OCEAN, LAND, OCEAN, OCEAN])
    points = np.array([[5.0, 5.0], [1.0, 9.0], [10.0, 3.0], [7.0, 14.0]])
    distance = distance_to_land(Domain((ring,), Projection()), points)
    np.testing.assert_allclose(distance, [5.0, 9.0, 0.0, 5.0])


def test_no_land():
    domain = Domain((Ring(SQUARE, [OCEAN] * 4),), Projection())
    assert np.isinf(distance_to_land(domain, SQUARE)).all()
