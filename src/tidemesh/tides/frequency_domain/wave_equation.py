"""The tidal wave equation on linear triangles.

With the velocity eliminated the linear tide of frequency w obeys

    i w e - div(K grad e) = 0,    K = g h / (q**2 + f**2) [[q, f], [-f, q]],

with q = i w + tau (docs/method.md, section 4). Galerkin's method with linear elements,
the element-mean depth and the consistent mass matrix is what ADCIRC's wave equation
becomes when its weight tau0 equals tau and f = 0.
"""

from __future__ import annotations

import copy
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
        Empty for a lake or a globe that forces inside drive.
    settings : TideSettings
    friction : float, (n_points,), (n_triangles,) or (3, n_triangles) array, optional
        tau (1/s), instead of the one value of the settings; three rows are the xx, xy
        and yy components of a symmetric tensor.
    coriolis : float or (n_points,) array, optional
        f (rad/s), instead of what the settings say.
    elements : Elements, optional
        Geometry of the triangles, instead of what ``settings.metric`` says.

    Raises
    ------
    EngineError
        If open nodes are not nodes of the mesh, or one comes twice.
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

    def with_friction(self, friction: float | np.ndarray) -> WaveEquation:
        """The same equation with other friction; the rest is shared."""
        other = copy.copy(self)
        other.friction, other._element_friction = _friction(self.elements, friction)
        return other

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
        flow = self.flow(symbols, self.elements.gradient_of(elevation))
        return self.continuity(symbols, elevation, self.depth * flow)

    def continuity(
        self, symbols: Symbols, elevation: np.ndarray, transport: np.ndarray
    ) -> np.ndarray:
        """Left side of the continuity equation, as in `apply` (m3/s).

        Parameters
        ----------
        symbols : Symbols
        elevation : (n_points,) complex array
            m.
        transport : (2, n_triangles) complex array
            m2/s.
        """
        elements = self.elements
        on, off = MASS[self.settings.mass]
        mass = symbols.continuity * elements.area
        values = elevation[elements.corners]
        rising = mass * (off * values.sum(axis=0) + (on - off) * values)
        return elements.scatter(rising) - self.divergence(transport)

    def flow(self, symbols: Symbols, slope: np.ndarray) -> np.ndarray:
        """Velocity of every triangle under a slope of the water.

        Parameters
        ----------
        symbols : Symbols
        slope : (2, n_triangles) array
            Gradient of the elevation, less that of the equilibrium tide, less any
            other acceleration over gravity.

        Returns
        -------
        velocity : (2, n_triangles) complex array
            m/s.
        """
        xx, xy, yy, skew = self._response(symbols)
        x, y = -self.settings.gravity * slope
        u, v = xx * x, yy * y
        if xy is not None:
            u, v = u + xy * y, v + xy * x
        if skew is not None:
            u, v = u + skew * y, v - skew * x
        return np.stack([u, v])

    def divergence(self, flux: np.ndarray) -> np.ndarray:
        """(2, n_triangles) flux, m2/s -> (n_points,) its integral with grad(phi)."""
        elements = self.elements
        (gx, gy), (x, y) = elements.gradient, elements.area * flux
        return elements.scatter(gx * x + gy * y)

    def resistance(self, velocity: np.ndarray) -> np.ndarray:
        """Linear friction tau u of the triangles: (2, n_triangles), m/s2."""
        if self._element_friction.ndim == 1:
            return self._element_friction * velocity
        xx, xy, yy = self._element_friction
        u, v = velocity
        return np.stack([xx * u + xy * v, xy * u + yy * v])

    def nodal_q(self, symbols: Symbols) -> np.ndarray:
        """(n_points,) i w + tau at the nodes (1/s)."""
        return symbols.momentum + self.friction

    def element_q(self, symbols: Symbols) -> np.ndarray:
        """(n_triangles,) i w + tau of the triangles (1/s), where it is no tensor."""
        return symbols.momentum + self._element_friction

    def _response(self, symbols: Symbols) -> tuple[np.ndarray | None, ...]:
        """Velocity per acceleration (s): xx, xy, yy and the skew part; None for zero.

        The inverse of [[i w + tau_xx, tau_xy - f], [tau_xy + f, i w + tau_yy]].
        """
        tensor = self._element_friction.ndim == 2
        if tensor:
            xx, xy, yy = self._element_friction
            xx, yy = symbols.momentum + xx, symbols.momentum + yy
            square = xx * yy - xy * xy
        else:
            xx = yy = self.element_q(symbols)
            square = xx * xx
        f = self._element_coriolis
        if f is not None:
            square = square + f * f
        if not np.all(square):
            raise EngineError(
                "the momentum equation has no answer where frequency and friction "
                "are both zero: give friction to a steady constituent"
            )
        factor = 1.0 / square
        same = factor * yy
        return (
            same,
            -factor * xy if tensor else None,
            factor * xx if tensor else same,
            None if f is None else factor * f,
        )

    def _assemble(self, symbols: Symbols) -> sparse.csc_array:
        """Matrix of all nodes in solution order.

        Every directed side of every triangle gives one entry above or below the
        diagonal, and its transposed one follows by (skew) symmetry, so a third of the
        usual nine entries a triangle is stored, and no entry twice.
        """
        elements, place = self.elements, self._place
        xx, xy, yy, skew = self._response(symbols)
        weight = self.settings.gravity * self.depth * elements.area
        symmetric = weight * xx
        other = symmetric if yy is xx else weight * yy
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
            values[run] = symmetric * (gx[k] * gx[after]) + other * (gy[k] * gy[after])
            if xy is not None:
                cross = gx[k] * gy[after] + gy[k] * gx[after]
                values[run] += weight * xy * cross
            values[run] += off * mass
        # The stiffness of a constant is zero: the diagonal follows from the rest.
        corner = symmetric * gx**2 + other * gy**2 + on * mass
        if xy is not None:
            corner += 2.0 * weight * xy * gx * gy
        diagonal = elements.scatter(corner)
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
                weight * skew * (gx[k] * gy[after] - gy[k] * gx[after])
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
        self._factorisation = Factorisation(interior, equation.settings.solver)

    def elevation(
        self, open_elevation: np.ndarray, load: np.ndarray | None = None
    ) -> np.ndarray:
        """Elevation from its values at the open nodes.

        Parameters
        ----------
        open_elevation : (n_ocean,) complex array
            m, in the order of ``equation.open_nodes``.
        load : (n_points,) complex array, optional
            Right-hand side (m3/s); what it holds at open nodes is left out.

        Returns
        -------
        elevation : (n_points,) complex array
            m.
        """
        rhs = -(self._forcing @ np.asarray(open_elevation, dtype=np.complex128))
        place = self.equation._place
        if load is not None:
            ordered = np.empty(len(load), dtype=np.complex128)
            ordered[place] = load
            rhs += ordered[: len(rhs)]
        solved = self._factorisation.solve(rhs)
        return np.concatenate([solved, open_elevation])[place]

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

    def effect_of_open_nodes(self, place: sparse.sparray) -> np.ndarray:
        """Effect of the open nodes on places inside, by the adjoint of each place.

        Parameters
        ----------
        place : (n_g, n_points) sparse array
            Weights of the nodes at each place.

        Returns
        -------
        effect : (n_g, n_ocean) complex array
            Elevation at the places, by one metre at one open node and none at the
            others.
        """
        equation = self.equation
        ordered = sparse.csr_array(place)[:, np.argsort(equation._place)]
        inside = ordered[:, : equation._n_free]
        adjoint = self._factorisation.solve(inside.toarray().T, transpose=True)
        edge = ordered[:, equation._n_free :].toarray()
        return edge - (self._forcing.T @ adjoint).T


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
    n, m = elements.n_points, len(elements.area)
    sign = values[::2] if values.shape == (3, m) else values
    if not (np.isfinite(values).all() and (sign >= 0.0).all()):
        raise InputError("the friction coefficient must be finite and not negative")
    if values.ndim == 0:
        return np.full(n, float(values)), np.full(m, float(values))
    if values.shape == (n,):
        return values, elements.mean(values)
    if values.shape == (m,):
        return elements.nodal_mean(values), values
    if values.shape == (3, m):
        return elements.nodal_mean(0.5 * (values[0] + values[2])), values
    raise ValueError(
        f"friction must be a number, ({n},), ({m},) or (3, {m}), got shape "
        f"{values.shape}"
    )


def _checked_open_nodes(mesh: CoastalMesh, open_nodes: np.ndarray) -> np.ndarray:
    nodes = np.asarray(open_nodes, dtype=np.int64)
    if len(nodes) == 0:
        return nodes
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
