"""What a tide engine is to the rest of the program."""

from __future__ import annotations

from typing import Protocol

from tidemesh.datatypes import CoastalMesh, TideForcing, TideSolution


class TideEngine(Protocol):
    """Anything that turns a mesh and its ocean boundary values into a tide."""

    def solve(self, mesh: CoastalMesh, forcing: TideForcing) -> TideSolution:
        """Complex amplitudes of every constituent on the nodes of the mesh."""
        ...
