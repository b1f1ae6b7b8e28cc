"""Linear triangles: areas, gradients of the basis functions, integrals."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from tidemesh.datatypes import CoastalMesh
from tidemesh.errors import MeshError

MASS = {
    "consistent": (1.0 / 6.0, 1.0 / 12.0),
    "half_lumped": (1.0 / 4.0, 1.0 / 24.0),
    "lumped": (1.0 / 3.0, 0.0),
}
"""Diagonal and off-diagonal entry of the mass matrix of a triangle of area 1."""


@dataclass(frozen=True, eq=False)
class Elements:
    """Geometry of all triangles.

    Attributes
    ----------
    corners : (3, n_triangles) int array
        Nodes of the triangles, one row a corner.
    area : (n_triangles,) float array
        m2.
    gradient : (2, 3, n_triangles) float array
        x and y derivative of the three basis functions (1/m).
    scale : (2, n_points) float array or None
        Length on the map over true length, along x and y; None where the map is
        trusted.
    n_points : int
    position : (2 or 3, n_points) float array
        Nodes on the map, or in space (m).
    axes : (2, 2 or 3, n_points) float array or None
        Directions of x and y at every node, where they are not those of `position`.
    turn : (2, 3, n_triangles) float array or None
        Where the axes differ from place to place: cosine and sine of the angle from
        the x axis of a triangle to that of each corner; None for common axes.
    share : (n_triangles,) float array or None
        Weight of the triangles in the means at nodes; None for their areas.
    """

    corners: np.ndarray
    area: np.ndarray
    gradient: np.ndarray
    scale: np.ndarray | None
    n_points: int
    position: np.ndarray
    axes: np.ndarray | None = None
    turn: np.ndarray | None = None
    share: np.ndarray | None = None

    @classmethod
    def of(
        cls,
        mesh: CoastalMesh,
        *,
        scale: np.ndarray | None = None,
        area_scale: np.ndarray | None = None,
    ) -> Elements:
        """Elements of a mesh.

        Parameters
        ----------
        mesh : CoastalMesh
        scale : (2, n_points) float array, optional
            Length on the map over true length, along x and y.
        area_scale : (n_points,) float array, optional
            Area on the map over true area.

        Raises
        ------
        MeshError
            If a triangle is not counter-clockwise.
        """
        corners = np.ascontiguousarray(mesh.triangles.T)
        x, y = mesh.points.T
        gradient = np.empty((2, *corners.shape))
        for k in range(3):
            after, before = corners[(k + 1) % 3], corners[(k + 2) % 3]
            np.subtract(y[after], y[before], out=gradient[0, k])
            np.subtract(x[before], x[after], out=gradient[1, k])
        doubled = gradient[0, 1] * gradient[1, 2] - gradient[0, 2] * gradient[1, 1]
        if not (doubled > 0.0).all():
            bad = int(np.flatnonzero(~(doubled > 0.0))[0])
            raise MeshError(
                f"triangle {bad} (nodes {mesh.triangles[bad].tolist()}) is not "
                f"counter-clockwise: its area is {0.5 * doubled[bad]:g} m2"
            )
        gradient /= doubled
        area = 0.5 * doubled
        if scale is not None:
            for component in range(2):
                gradient[component] *= scale[component][mesh.triangles].mean(axis=1)
        if area_scale is not None:
            area /= area_scale[mesh.triangles].mean(axis=1)
        position = np.ascontiguousarray(mesh.points.T)
        return cls(corners, area, gradient, scale, len(mesh.points), position)

    def mean(self, nodal: np.ndarray) -> np.ndarray:
        """(n_points,) -> (n_triangles,) mean of the three corners."""
        a, b, c = self.corners
        return (nodal[a] + nodal[b] + nodal[c]) / 3.0

    def gradient_of(self, nodal: np.ndarray) -> np.ndarray:
        """(n_points,) -> (2, n_triangles) gradient of a piecewise linear field.

        Along the axes of the triangles.
        """
        values = nodal[self.corners]
        return (self.gradient * values).sum(axis=1)

    def scatter(self, corner_values: np.ndarray) -> np.ndarray:
        """(3, n_triangles) -> (n_points,) sum of what the corners hold."""
        nodes = self.corners.ravel()
        values = np.ravel(corner_values)
        real = np.bincount(nodes, values.real, self.n_points)
        if not np.iscomplexobj(values):
            return real
        return real + 1j * np.bincount(nodes, values.imag, self.n_points)

    def nodal_mean(self, element_values: np.ndarray) -> np.ndarray:
        """(n_triangles,) -> (n_points,) mean over the triangles of a node, by area."""
        weighted = np.broadcast_to(self.weight * element_values, self.corners.shape)
        return self.scatter(weighted) / self.around

    @property
    def weight(self) -> np.ndarray:
        """(n_triangles,) weight of the triangles in the means at nodes."""
        return self.area if self.share is None else self.share

    @cached_property
    def around(self) -> np.ndarray:
        """(n_points,) sum of the weights of the triangles of a node."""
        return self.scatter(np.broadcast_to(self.weight, self.corners.shape))

    def to_corners(self, vectors: np.ndarray) -> np.ndarray:
        """(2, n_triangles) -> (2, 3, n_triangles) vectors, along the nodes' axes."""
        x, y = vectors[:, None, :]
        if self.turn is None:
            return np.broadcast_to(vectors[:, None, :], (2, *self.corners.shape))
        cosine, sine = self.turn
        return np.stack([cosine * x + sine * y, cosine * y - sine * x])

    def from_corners(self, nodal: np.ndarray) -> np.ndarray:
        """(2, n_points) -> (2, 3, n_triangles) vectors, along the triangles' axes."""
        vectors = nodal[:, self.corners]
        if self.turn is None:
            return vectors
        (x, y), (cosine, sine) = vectors, self.turn
        return np.stack([cosine * x - sine * y, cosine * y + sine * x])

    def nodal_vector(self, vectors: np.ndarray) -> np.ndarray:
        """(2, n_triangles) -> (2, n_points) mean vector around a node, by area."""
        turned = self.weight * self.to_corners(vectors)
        return np.stack([self.scatter(part) for part in turned]) / self.around

    def mean_vector(self, nodal: np.ndarray) -> np.ndarray:
        """(2, n_points) -> (2, n_triangles) mean of the vectors at the corners."""
        if self.turn is None:
            return np.stack([self.mean(part) for part in nodal])
        return self.from_corners(nodal).mean(axis=1)

    def chord(self, at: np.ndarray, to: np.ndarray) -> np.ndarray:
        """(2, k) way (m) from nodes ``at`` to nodes ``to``, along the axes of ``at``.

        True lengths, for nodes near each other.
        """
        way = self.position[:, to] - self.position[:, at]
        if self.scale is not None:
            way = way / self.scale[:, at]
        if self.axes is None:
            return way
        return np.einsum("ick,ck->ik", self.axes[:, :, at], way)
