"""The tidal wave equation on linear triangles.

With the velocity eliminated the linear tide of frequency w obeys

    i w e - div(K grad e) = 0,    K = g h / (q**2 + f**2) [[q, f], [-f, q]],

with q = i w + tau (docs/method.md, section 4). Galerkin's method with linear elements,
the element-mean depth and the consistent mass matrix is what ADCIRC's wave equation
becomes when its weight tau0 equals tau and f = 0.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import scipy.sparse as sparse

from tidemesh.constants import EARTH_ROTATION
from tidemesh.datatypes import CoastalMesh
from tidemesh.errors import EngineError, InputError, MeshError
from tidemesh.tides.frequency_domain.direct import Factorisation
from tidemesh.tides.frequency_domain.elements import MASS, Elements
from tidemesh.tides.frequency_domain.metric import elements_for
from tidemesh.tides.frequency_domain.ordering import nested_dissection
from tidemesh.tides.settings import TideSettings


class Symbols(NamedTuple):
    """What the time derivative becomes in the two equations.

    Both are i w in continuous time. A time-stepping scheme has others, and putting
    them here reproduces its answer.
    """

    continuity: complex
    momentum: complex

    @classmethod
    def exact(cls, frequency: float) -> Symbols:
        """Continuous time."""
        return cls(1j * frequency, 1j * frequency)


class WaveEquation:
    """The discrete tide of a mesh, ready to be solved at any frequency.

    Parameters
    ----------
    mesh : CoastalMesh
        Depths positive (metres).
    open_nodes : (n_ocean,) int array
        Nodes where the elevation is given; no flow through the rest of the boundary.
    settings : TideSettings
    friction : float, (n_points,) or (n_triangles,) array, optional
        tau (1/s), instead of the one value of the settings.
    coriolis : float or (n_points,) array, optional
        f (rad/s), instead of what the settings say.
    elements : Elements, optional
        Geometry of the triangles, instead of what ``settings.metric`` says.

    Raises
    ------
    EngineError
        If there are no open nodes, or they are not nodes of the mesh.
    MeshError
        If the mean depth of a triangle is not positive, or a node has no triangle.
    """

    def __init__(
        self,
        mesh: CoastalMesh,
        open_nodes: np.ndarray,
        settings: TideSettings | None = None,
        *,
        friction: float | np.ndarray | None = None,
        coriolis: float | np.ndarray | None = None,
        elements: Elements | None = None,
    ):
        settings = TideSettings() if settings is None else settings
        self.mesh = mesh
        self.settings = settings
        self.open_nodes = _checked_open_nodes(mesh, open_nodes)
        _check_mesh(mesh)
        if elements is None:
            elements = elements_for(mesh, settings.metric)
        self.elements = elements
        self.depth = elements.mean(mesh.depth)
        _check_depth(mesh, self.depth)
        friction = settings.friction if friction is None else friction
        self.friction, self._element_friction = _friction(elements, friction)
        if coriolis is None:
            coriolis = coriolis_parameter(mesh, settings)
        elif not np.any(coriolis):
            coriolis = None
        self.coriolis = (
            None
            if coriolis is None
            else np.broadcast_to(np.asarray(coriolis, float), len(mesh.points))
        )
        self._element_coriolis = (
            None if self.coriolis is None else elements.mean(self.coriolis)
        )
        self._place, self._n_free = self._number_unknowns()

    def factorise(self, symbols: Symbols) -> FactorisedWave:
        """Assemble and factorise at one frequency."""
        columns = self._assemble(symbols)
        n_free = self._n_free
        interior = columns[:, :n_free][:n_free]
        forcing = columns[:, n_free:][:n_free]
        del columns
        return FactorisedWave(self, interior, forcing)

    def matrix(self, symbols: Symbols) -> sparse.csr_array:
        """(n_points, n_points) matrix of all nodes in mesh order, open ones included.

        For inspection and tests; solving uses its own order.
        """
        matrix = self._assemble(symbols)
        return matrix[self._place][:, self._place].tocsr()

    def apply(self, symbols: Symbols, elevation: np.ndarray) -> np.ndarray:
        """Matrix times vector without the matrix: (n_points,) -> (n_points,).

        At nodes off the open boundary it is the residual; at open nodes it is the
        inflow (m3/s) through the share of the boundary that belongs to the node.
        """
        elements = self.elements
        symmetric, skew = self._conductivity(symbols)
        gx, gy = elements.gradient_of(elevation)
        flux = (symmetric * gx, symmetric * gy)
        if skew is not None:
            flux = (flux[0] + skew * gy, flux[1] - skew * gx)
        area = elements.area
        corner = elements.gradient[0] * (area * flux[0])
        corner = corner + elements.gradient[1] * (area * flux[1])
        on, off = MASS[self.settings.mass]
        mass = symbols.continuity * area
        values = elevation[elements.corners]
        corner += mass * (off * values.sum(axis=0) + (on - off) * values)
        return elements.scatter(corner)

    def nodal_q(self, symbols: Symbols) -> np.ndarray:
        """(n_points,) i w + tau at the nodes (1/s)."""
        return symbols.momentum + self.friction

    def element_q(self, symbols: Symbols) -> np.ndarray:
        """(n_triangles,) i w + tau of the triangles (1/s)."""
        return symbols.momentum + self._element_friction

    def _conductivity(self, symbols: Symbols) -> tuple[np.ndarray, np.ndarray | None]:
        """Symmetric and skew part of K of every triangle (m2/s)."""
        q = self.element_q(symbols)
        f = self._element_coriolis
        square = q * q if f is None else q * q + f * f
        if not np.all(square):
            raise EngineError(
                "the momentum equation has no answer where frequency and friction "
                "are both zero: give friction to a steady constituent"
            )
        factor = self.settings.gravity * self.depth / square
        return factor * q, None if f is None else factor * f

    def _assemble(self, symbols: Symbols) -> sparse.csc_array:
        """Matrix of all nodes in solution order.

        Every directed side of every triangle gives one entry above or below the
        diagonal, and its transposed one follows by (skew) symmetry, so a third of the
        usual nine entries a triangle is stored, and no entry twice.
        """
        elements, place = self.elements, self._place
        symmetric, skew = self._conductivity(symbols)
        symmetric = symmetric * elements.area
        on, off = MASS[self.settings.mass]
        mass = symbols.continuity * elements.area
        gx, gy = elements.gradient

        n, m = elements.n_points, len(elements.area)
        rows = np.empty(3 * m + n, dtype=np.int32)
        columns = np.empty_like(rows)
        values = np.empty(3 * m + n, dtype=np.complex128)
        for k in range(3):
            run, after = slice(k * m, (k + 1) * m), (k + 1) % 3
            rows[run] = place[elements.corners[k]]
            columns[run] = place[elements.corners[after]]
            values[run] = symmetric * (gx[k] * gx[after] + gy[k] * gy[after])
            values[run] += off * mass
        # The stiffness of a constant is zero: the diagonal follows from the rest.
        diagonal = elements.scatter(
            np.stack(
                [symmetric * (gx[k] ** 2 + gy[k] ** 2) + on * mass for k in range(3)]
            )
        )
        rows[3 * m :] = columns[3 * m :] = place
        values[3 * m :] = 0.5 * diagonal

        shape = (n, n)
        if skew is None:
            half = sparse.csc_array((values, (rows, columns)), shape=shape)
            del rows, columns, values
            return half + half.T.tocsc()
        turning = np.zeros_like(values)
        for k in range(3):
            after = (k + 1) % 3
            turning[k * m : (k + 1) * m] = (
                elements.area * skew * (gx[k] * gy[after] - gy[k] * gx[after])
            )
        forth = sparse.csc_array((values + turning, (rows, columns)), shape=shape)
        back = sparse.csc_array((values - turning, (columns, rows)), shape=shape)
        return forth + back

    def _number_unknowns(self) -> tuple[np.ndarray, int]:
        """Place of every node in solution order: free nodes first, open nodes last."""
        n = len(self.mesh.points)
        is_free = np.ones(n, dtype=bool)
        is_free[self.open_nodes] = False
        free = np.flatnonzero(is_free)
        place = np.empty(n, dtype=np.int32)
        place[free] = np.arange(len(free))
        place[self.open_nodes] = np.arange(len(free), n)

        corners = place[self.elements.corners]
        ends = np.stack([corners.ravel(), np.roll(corners, -1, axis=0).ravel()])
        ends = ends[:, (ends < len(free)).all(axis=0)]
        ones = np.ones(ends.shape[1], dtype=np.int8)
        sides = sparse.csr_array((ones, (ends[0], ends[1])), shape=(len(free),) * 2)
        once = sparse.triu(sides + sides.T.tocsr(), format="coo").coords
        order = nested_dissection(self.mesh.points[free], np.stack(once))
        place[free[order]] = np.arange(len(free))
        return place, len(free)


class FactorisedWave:
    """The tide equations of one frequency, factorised."""

    def __init__(
        self,
        equation: WaveEquation,
        interior: sparse.csc_array,
        forcing: sparse.csc_array,
    ):
        self.equation = equation
        self._forcing = forcing
        self._factorisation = Factorisation(interior)

    def elevation(self, open_elevation: np.ndarray) -> np.ndarray:
        """Elevation from its values at the open nodes.

        Parameters
        ----------
        open_elevation : (n_ocean,) complex array
            m, in the order of ``equation.open_nodes``.

        Returns
        -------
        elevation : (n_points,) complex array
            m.
        """
        rhs = -(self._forcing @ np.asarray(open_elevation, dtype=np.complex128))
        solved = self._factorisation.solve(rhs)
        return np.concatenate([solved, open_elevation])[self.equation._place]

    def respond(self, load: np.ndarray, *, transpose: bool = False) -> np.ndarray:
        """Elevation under a load, zero at the open nodes.

        Parameters
        ----------
        load : (n_points,) complex array
            Right-hand side (m3/s); what it holds at open nodes is left out.
        transpose : bool
            Solve the transposed equations: the adjoint of a goal functional.

        Returns
        -------
        elevation : (n_points,) complex array
            m.
        """
        equation = self.equation
        ordered = np.empty(len(load), dtype=np.complex128)
        ordered[equation._place] = load
        n_free = equation._n_free
        ordered[:n_free] = self._factorisation.solve(
            ordered[:n_free], transpose=transpose
        )
        ordered[n_free:] = 0.0
        return ordered[equation._place]


def coriolis_parameter(
    mesh: CoastalMesh, settings: TideSettings
) -> np.ndarray | float | None:
    """Coriolis parameter f = 2 Omega sin(latitude) (rad/s), or None.

    Raises
    ------
    InputError
        If each node's latitude is asked for on a mesh without a map projection.
    """
    if settings.coriolis == "none":
        return None
    if settings.coriolis == "constant":
        latitude_deg = settings.latitude_deg
    elif mesh.projection.crs:
        latitude_deg = mesh.projection.inverse(mesh.points)[:, 1]
    else:
        raise InputError(
            'coriolis = "latitude" needs a mesh with a map projection; this one lies '
            'on the bare plane: use coriolis = "constant" and latitude_deg'
        )
    return 2.0 * EARTH_ROTATION * np.sin(np.radians(latitude_deg))


def _friction(
    elements: Elements, friction: float | np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Friction at the nodes and of the triangles."""
    values = np.asarray(friction, dtype=np.float64)
    if not (np.isfinite(values).all() and (values >= 0.0).all()):
        raise InputError("the friction coefficient must be finite and not negative")
    n, m = elements.n_points, len(elements.area)
    if values.ndim == 0:
        return np.full(n, float(values)), np.full(m, float(values))
    if values.shape == (n,):
        return values, elements.mean(values)
    if values.shape == (m,):
        return elements.nodal_mean(values), values
    raise ValueError(
        f"friction must be a number, ({n},) or ({m},), got shape {values.shape}"
    )


def _checked_open_nodes(mesh: CoastalMesh, open_nodes: np.ndarray) -> np.ndarray:
    nodes = np.asarray(open_nodes, dtype=np.int64)
    if len(nodes) == 0:
        raise EngineError(
            "the mesh has no open (ocean) boundary, so nothing drives the tide"
        )
    if nodes.min() < 0 or nodes.max() >= len(mesh.points):
        raise EngineError(
            f"the forcing names node {int(nodes.max())}, the mesh has "
            f"{len(mesh.points)} nodes: it belongs to another mesh"
        )
    if len(np.unique(nodes)) < len(nodes):
        raise EngineError("the forcing gives an open boundary node twice")
    return nodes


def _check_mesh(mesh: CoastalMesh) -> None:
    used = np.zeros(len(mesh.points), dtype=bool)
    used[mesh.triangles] = True
    if not used.all():
        node = int(np.flatnonzero(~used)[0])
        raise MeshError(
            f"{int((~used).sum())} nodes belong to no triangle, the first is node "
            f"{node} at {_at(mesh, mesh.points[node])}"
        )


def _check_depth(mesh: CoastalMesh, depth: np.ndarray) -> None:
    good = depth > 0.0
    if not good.all():
        first = int(np.flatnonzero(~good)[0])
        centre = mesh.points[mesh.triangles[first]].mean(axis=0)
        raise MeshError(
            f"{int((~good).sum())} triangles have no water: a mean depth of "
            f"{depth[first]:g} m at {_at(mesh, centre)}; the linear tide needs "
            "positive depths: raise the minimum depth"
        )


def _at(mesh: CoastalMesh, point: np.ndarray) -> str:
    longitude, latitude = mesh.projection.inverse(point)
    return f"({longitude:.5f}, {latitude:.5f})"
