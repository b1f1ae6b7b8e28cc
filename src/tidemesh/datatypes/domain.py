"""The water body to be meshed: rings of typed segments."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from tidemesh.datatypes._arrays import FloatArray, own_fields
from tidemesh.geometry.projection import Projection

LAND = 0
OCEAN = 1


@dataclass(frozen=True, eq=False)
class Ring:
    """A closed boundary line with the water on its left.

    The first point is not repeated. ``segment_kind[i]`` is the kind of the segment
    from point i to point i + 1 (the last segment returns to point 0).
    """

    points: FloatArray
    """(n, 2) m, x east, y north."""
    segment_kind: np.ndarray
    """(n,) int8, `LAND` or `OCEAN`."""

    def __post_init__(self) -> None:
        own_fields(self, points=(np.float64, (None, 2)))
        own_fields(self, segment_kind=(np.int8, (len(self.points),)))


@dataclass(frozen=True)
class LedgerEntry:
    """One change made to the user's geography: what, where, how much and why."""

    action: str
    """For instance "narrow water removed", "island dropped"."""
    longitude_deg: float
    latitude_deg: float
    area_m2: float
    """Change of the water area: negative where water became land."""
    reason: str


@dataclass(frozen=True, eq=False)
class Domain:
    """A connected body of water.

    ``rings[0]`` is the outer ring (counter-clockwise), the others are islands
    (clockwise), so the water is always on the left.
    """

    rings: tuple[Ring, ...]
    projection: Projection
    ledger: tuple[LedgerEntry, ...] = field(default=())
