"""A triangular mesh with depths and boundary strings: a fort.14 in memory."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from tidemesh.datatypes._arrays import FloatArray, IntArray, own_fields
from tidemesh.geometry.projection import Projection


@dataclass(frozen=True, eq=False)
class BoundaryString:
    """A run of boundary nodes, the water on its left.

    Open and mainland strings hold both end nodes (mainland strings share them with
    the neighbouring open strings). A string that is a whole ring does not repeat its
    first node.
    """

    kind: str
    """"open", "mainland" or "island"."""
    nodes: IntArray
    """(n,) node indices."""
    closed: bool = False
    """True for a whole ring: islands, and a mainland without open boundary."""
    ibtype: int = 0
    """ADCIRC's boundary type: 0, 10, 20 mainland; 1, 11, 21 island; 0 for open."""
    extra: FloatArray | None = None
    """(n, k) further columns of ADCIRC's boundary row (weirs), carried through."""

    def __post_init__(self) -> None:
        if self.kind not in ("open", "mainland", "island"):
            raise ValueError(
                f'kind must be "open", "mainland" or "island", got "{self.kind}"'
            )
        own_fields(self, nodes=(np.int64, (None,)))
        if self.extra is not None:
            own_fields(self, extra=(np.float64, (len(self.nodes), None)))


@dataclass(frozen=True, eq=False)
class CoastalMesh:
    """Points, triangles, depths and typed boundary strings."""

    points: FloatArray
    """(n_points, 2) m, x east, y north."""
    triangles: IntArray
    """(n_triangles, 3) point indices, counter-clockwise."""
    depth: FloatArray
    """(n_points,) m below mean sea level, positive down."""
    boundaries: tuple[BoundaryString, ...] = field(default=())
    projection: Projection = field(default_factory=Projection)

    def __post_init__(self) -> None:
        own_fields(self, points=(np.float64, (None, 2)))
        own_fields(
            self,
            triangles=(np.int64, (None, 3)),
            depth=(np.float64, (len(self.points),)),
        )
        object.__setattr__(self, "boundaries", tuple(self.boundaries))

    @property
    def open_nodes(self) -> IntArray:
        """(n_ocean,) nodes of all open strings, in string order, each once."""
        runs = [b.nodes for b in self.boundaries if b.kind == "open"]
        if not runs:
            return np.empty(0, dtype=np.int64)
        nodes, first = np.unique(np.concatenate(runs), return_index=True)
        return nodes[np.argsort(first)]
