"""Allowed node spacing on a background mesh."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tidemesh.datatypes._arrays import FloatArray, IntArray, own_fields


@dataclass(frozen=True, eq=False)
class SizeField:
    """Node spacing, linear on the triangles of a background mesh."""

    points: FloatArray
    """(n_points, 2) m."""
    triangles: IntArray
    """(n_triangles, 3)."""
    spacing: FloatArray
    """(n_points,) m, allowed edge length, positive and finite."""

    def __post_init__(self) -> None:
        own_fields(self, points=(np.float64, (None, 2)))
        own_fields(
            self,
            triangles=(np.int64, (None, 3)),
            spacing=(np.float64, (len(self.points),)),
        )
