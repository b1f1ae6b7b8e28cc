"""Settings of the mesh improvement."""

from __future__ import annotations

from typing import Annotated, Literal

import msgspec

Count = Annotated[int, msgspec.Meta(ge=0)]
Ratio = Annotated[float, msgspec.Meta(gt=0)]
Quality = Annotated[float, msgspec.Meta(ge=0, le=1)]


class ImproveSettings(
    msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True
):
    """How a mesh is smoothed and cleaned; the boundary never changes."""

    method: Literal["springs", "laplacian"] = "springs"
    """"springs": sides tend to their target lengths, which keeps graded sizes.
    "laplacian": each node to the mean of its neighbours, as published."""
    sweeps: Count = 5
    """Moves of every node in a round, each followed by a Delaunay re-triangulation."""
    rounds: Annotated[int, msgspec.Meta(ge=1)] = 6
    """Rounds of smoothing; between two rounds nodes are removed and inserted."""
    clean: bool = True
    """Remove and insert nodes, and repair corners; False as published."""
    shortest_side: Ratio = 0.8
    """Sides shorter than this times their target lose an end. Of such removals and of
    insertions, the same number is made, the most needed first: the count of nodes
    stays."""
    longest_side: Ratio = 1.3
    """Sides longer than this times their target get a node at their middle."""
    lowest_valence: Count = 4
    """Interior nodes with so few neighbours are removed."""
    quality_floor: Quality = 0.3
    """A move that leaves a triangle below this must not make it worse."""
    poor_quality: Quality = 0.6
    """Nodes of triangles below this are placed by search at the end."""
