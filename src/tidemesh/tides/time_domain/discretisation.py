"""A mesh as the time step wants it: renumbered, with operators and boundary rules."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.sparse as sparse
from scipy.sparse.csgraph import reverse_cuthill_mckee

from tidemesh.datatypes import CoastalMesh
from tidemesh.errors import InputError, MeshError
from tidemesh.tides.frequency_domain.elements import Elements
from tidemesh.tides.frequency_domain.metric import elements_for
from tidemesh.tides.frequency_domain.velocity import shore_direction
from tidemesh.tides.frequency_domain.wave_equation import coriolis_parameter
from tidemesh.tides.settings import TideSettings
from tidemesh.tides.time_domain import _kernels as kernels

NONLINEAR_TAU0 = 0.009
"""Weight of the wave equation (1/s) of nonlinear runs (paper, section 4)."""


_NONE = np.empty(0, dtype=np.int64)


@dataclass(frozen=True, eq=False)
class Discretisation:
    """Linear triangles with lumped mass, in an order that keeps neighbours close.

    Attributes
    ----------
    mesh : CoastalMesh
    elements : Elements
        Of the mesh, in its own numbers.
    order : (n_points,) int array
        Node of the mesh at each place; everything below is in this order.
    corners : (n_triangles, 3) uint32 array
    geometry : (8, n_triangles) array
        See `_kernels.triangles_pass`.
    incidence, members : (n_points + 1,), (3 n_triangles, 2) uint32 arrays
        Triangles of a node and which of their corners it is.
    starts, others : (n_points + 1,), (n_pairs,) uint32 arrays
        Node and its neighbours.
    gradient : (n_pairs, 2) array
        Mean gradient at a node (1/m).
    mass : (n_points,) array
        A third of the areas of the triangles of a node (m2).
    around : (n_points,) array
        Weight of the means at a node (m2).
    """

    mesh: CoastalMesh
    elements: Elements
    order: np.ndarray
    corners: np.ndarray
    geometry: np.ndarray
    incidence: np.ndarray
    members: np.ndarray
    starts: np.ndarray
    others: np.ndarray
    gradient: np.ndarray
    mass: np.ndarray
    around: np.ndarray

    @classmethod
    def of(
        cls,
        mesh: CoastalMesh,
        settings: TideSettings,
        *,
        still: np.ndarray | None = None,
    ) -> Discretisation:
        """Discretise a mesh.

        Parameters
        ----------
        mesh : CoastalMesh
        settings : TideSettings
        still : (n,) int array, optional
            Nodes in whose triangles nothing is advected.

        Raises
        ------
        MeshError
            If a triangle is inverted, a node has none, or a depth is not positive.
        InputError
            If the metric has no common axes.
        """
        _check(mesh)
        elements = elements_for(mesh, settings.metric)
        if elements.turn is not None:
            raise InputError(
                f'metric = "{settings.metric}" turns the axes from place to place on '
                'this mesh; a simulation in time takes "plane" or "sphere"'
            )
        order, place = _numbering(mesh)
        corners = place[mesh.triangles]
        by_node = np.argsort(corners.min(axis=1), kind="stable")
        corners = corners[by_node]
        gradient = elements.gradient[:, :, by_node]
        area, weight = elements.area[by_node], elements.weight[by_node]
        depth = settings.gravity * elements.mean(mesh.depth)[by_node]

        n = len(order)
        is_still = np.zeros(n, dtype=bool)
        is_still[place[_NONE if still is None else still]] = True
        advected = np.where(is_still[corners].any(axis=1), 0.0, 1.0)
        nodes = corners.ravel()
        gathered = np.argsort(nodes, kind="stable")
        incidence = np.concatenate([[0], np.cumsum(np.bincount(nodes, minlength=n))])
        around = np.bincount(nodes, np.repeat(weight, 3), n)

        rows = np.repeat(corners.T, 3, axis=0).ravel()
        columns = np.tile(corners.T, (3, 1)).ravel()
        parts = [
            sparse.csr_array(
                (np.tile((weight * part).ravel(), 3) / around[rows], (rows, columns)),
                shape=(n, n),
            )
            for part in gradient
        ]
        return cls(
            mesh=mesh,
            elements=elements,
            order=order,
            corners=corners.astype(np.uint32),
            geometry=np.stack(
                [*gradient[0, 1:], *gradient[1, 1:], area, depth, weight, advected]
            ),
            incidence=incidence.astype(np.uint32),
            members=np.stack(np.divmod(gathered, 3), axis=1).astype(np.uint32),
            starts=parts[0].indptr.astype(np.uint32),
            others=parts[0].indices.astype(np.uint32),
            gradient=np.stack([part.data for part in parts], axis=1),
            mass=np.bincount(nodes, np.repeat(area, 3), n) / 3.0,
            around=around,
        )

    @cached_property
    def place(self) -> np.ndarray:
        """(n_points,) place of every node of the mesh."""
        place = np.empty_like(self.order)
        place[self.order] = np.arange(len(self.order))
        return place

    def shore(self, settings: TideSettings) -> tuple[np.ndarray, np.ndarray]:
        """Nodes whose velocity is bound to the shore, as ADCIRC does it.

        Returns
        -------
        bound : (n_points,) bool array
        direction : (2, n_points) array
            Along the shore; zero where nothing flows (no slip, sharp corners).
        """
        bound = np.zeros(len(self.order), dtype=bool)
        direction = np.zeros((2, len(self.order)))
        if settings.land_rule == "none":
            return bound, direction
        bound[self.place], direction[:, self.place] = shore_direction(
            self.mesh, self.elements, settings.minimum_inner_angle_deg
        )
        return bound, direction

    def constants(
        self,
        settings: TideSettings,
        step: float,
        minimum_column: float,
        *,
        friction: np.ndarray | None = None,
        drag: np.ndarray | None = None,
    ) -> np.ndarray:
        """(CONSTANTS, n_points) rows of `_kernels`."""
        tau0 = weight_of_wave_equation(settings)
        rows = np.zeros((kernels.CONSTANTS, len(self.order)))
        rows[kernels.DEPTH] = self.mesh.depth[self.order]
        rows[kernels.INVERSE] = step / (self.mass * (1.0 / step + 0.5 * tau0))
        rows[kernels.AROUND] = -step / self.around
        law = settings.friction_law
        if law == "linear":
            given = settings.friction if friction is None else friction
            rows[kernels.FRICTION] = self._in_order(given, "friction")
        elif law == "quadratic":
            given = settings.drag_coefficient if drag is None else drag
            rows[kernels.DRAG] = self._in_order(given, "drag")
        else:
            given = settings.manning_n if drag is None else drag
            roughness = settings.gravity * self._in_order(given, "drag") ** 2
            rows[kernels.ROUGHNESS] = roughness
            rows[kernels.DRAG] = roughness / np.cbrt(rows[kernels.DEPTH])
        coriolis = self.coriolis(settings)
        if coriolis is not None:
            rows[kernels.CORIOLIS] = coriolis[self.order]
        lowest = minimum_column - rows[kernels.DEPTH]
        rows[kernels.LOWEST] = lowest if settings.finite_amplitude else -np.inf
        bound, (x, y) = self.shore(settings)
        rows[kernels.SPIN] = np.where(bound, 0.0, rows[kernels.CORIOLIS])
        rows[kernels.ALONG_XX] = np.where(bound, x * x, 1.0)
        rows[kernels.ALONG_XY] = np.where(bound, x * y, 0.0)
        rows[kernels.ALONG_YY] = np.where(bound, y * y, 1.0)
        return rows

    def coriolis(self, settings: TideSettings) -> np.ndarray | None:
        """(n_points,) f at the nodes of the mesh (1/s), or None."""
        f = coriolis_parameter(self.mesh, settings)
        if f is None:
            return None
        return np.array(np.broadcast_to(np.asarray(f, float), len(self.order)))

    def _in_order(self, values: float | np.ndarray, name: str) -> np.ndarray:
        nodal = np.broadcast_to(np.asarray(values, dtype=float), len(self.order))
        good = np.isfinite(nodal) & (nodal >= 0.0)
        if not good.all():
            node = int(np.flatnonzero(~good)[0])
            raise InputError(
                f"the {name} coefficient must be finite and not negative; at node "
                f"{node}, {at(self.mesh, node)}, it is {nodal[node]}"
            )
        return nodal[self.order]


def weight_of_wave_equation(settings: TideSettings) -> float:
    """tau0 (1/s): as set, or the linear friction, or the paper's for other laws."""
    if settings.tau0 is not None:
        return settings.tau0
    return settings.friction if settings.friction_law == "linear" else NONLINEAR_TAU0


def at(mesh: CoastalMesh, node: int) -> str:
    """A node's place for messages."""
    longitude, latitude = mesh.projection.inverse(mesh.points[node])
    return f"({longitude:.5f}, {latitude:.5f})"


def _numbering(mesh: CoastalMesh) -> tuple[np.ndarray, np.ndarray]:
    """Order of the nodes (reverse Cuthill-McKee) and place of every node in it."""
    n = len(mesh.points)
    tails, heads = mesh.triangles.ravel(), np.roll(mesh.triangles, -1, 1).ravel()
    sides = sparse.csr_array(
        (np.ones(len(tails), dtype=np.int8), (tails, heads)), shape=(n, n)
    )
    order = reverse_cuthill_mckee((sides + sides.T).tocsr(), symmetric_mode=True)
    order = order.astype(np.int64)
    place = np.empty(n, dtype=np.int64)
    place[order] = np.arange(n)
    return order, place


def _check(mesh: CoastalMesh) -> None:
    used = np.zeros(len(mesh.points), dtype=bool)
    used[mesh.triangles] = True
    if not used.all():
        node = int(np.flatnonzero(~used)[0])
        raise MeshError(
            f"{int((~used).sum())} nodes belong to no triangle, the first is node "
            f"{node} at {at(mesh, node)}"
        )
    good = mesh.depth > 0.0
    if not good.all():
        node = int(np.flatnonzero(~good)[0])
        raise MeshError(
            f"{int((~good).sum())} nodes have no water: a depth of "
            f"{mesh.depth[node]:g} m at node {node}, {at(mesh, node)}; a simulation "
            "without wetting and drying needs positive depths: raise the minimum depth"
        )
