"""A small mesh with every kind of boundary string."""

import numpy as np

from tidemesh.datatypes import BoundaryString, CoastalMesh
from tidemesh.geometry.projection import Projection


def small_mesh(projection=None):
    """Five by five nodes, 10 km apart, with one square left out as an island."""
    n = 5
    x, y = np.meshgrid(np.arange(n), np.arange(n))
    points = 1e4 * np.stack([x.ravel(), y.ravel()], axis=1) + 0.1234567890123
    cells = [r * n + c for r in range(4) for c in range(4) if (r, c) != (1, 2)]
    triangles = np.array(
        [t for i in cells for t in ([i, i + 1, i + 6], [i, i + 6, i + 5])]
    )
    depth = 5.0 + 0.001 * points[:, 0] + np.pi
    boundaries = (
        BoundaryString("open", [0, 1, 2, 3, 4]),
        BoundaryString("mainland", [4, 9, 14, 19, 24], ibtype=20),
        BoundaryString("open", [24, 23, 22, 21]),
        BoundaryString("mainland", [21, 20, 15, 10, 5, 0]),
        BoundaryString("island", [7, 12, 13, 8], closed=True, ibtype=21),
    )
    return CoastalMesh(points, triangles, depth, boundaries, projection or Projection())


def assert_same_strings(have, wanted):
    assert len(have) == len(wanted)
    for a, b in zip(have, wanted):
        assert (a.kind, a.closed, a.ibtype) == (b.kind, b.closed, b.ibtype)
        assert np.array_equal(a.nodes, b.nodes)
        assert (a.extra is None) == (b.extra is None)
        if a.extra is not None:
            assert np.array_equal(a.extra, b.extra)
