"""Nodal velocities from the elevation.

u = -g (q e_x + f e_y)/(q**2 + f**2), v = -g (q e_y - f e_x)/(q**2 + f**2), with the
gradient of a piecewise linear elevation brought to the nodes in one of three ways.
"""

from __future__ import annotations

import numpy as np
import scipy.sparse as sparse

from tidemesh.datatypes import CoastalMesh
from tidemesh.errors import ConvergenceError
from tidemesh.tides.frequency_domain.elements import MASS, Elements
from tidemesh.tides.frequency_domain.wave_equation import Symbols, WaveEquation

SLIP = (0, 1)
NO_SLIP = (10, 11)
"""ADCIRC's boundary types whose nodes it lets slip along the shore, or holds."""

_FIT_CHUNK = 20_000
_FIT_CONDITION = 1.0e8


def nodal_velocity(
    equation: WaveEquation,
    elevation: np.ndarray,
    symbols: Symbols,
    potential: np.ndarray | None = None,
) -> np.ndarray:
    """Velocity at the nodes.

    Parameters
    ----------
    equation : WaveEquation
        Its settings choose the projection and the rule at land nodes.
    elevation : (n_points,) complex array
        m.
    symbols : Symbols
    potential : (n_points,) complex array, optional
        Equilibrium tide (m), taken from the elevation.

    Returns
    -------
    velocity : (n_points, 2) complex array
        m/s, x and y component.
    """
    driving = elevation if potential is None else elevation - potential
    gradient = nodal_gradient(equation, driving)
    return np.ascontiguousarray(turn(nodal_response(equation, symbols), gradient).T)


def nodal_gradient(equation: WaveEquation, nodal: np.ndarray) -> np.ndarray:
    """(2, n_points) gradient, by the projection that the settings choose."""
    elements = equation.elements
    if equation.settings.velocity == "lumped":
        return lumped_gradient(elements, nodal)
    if equation.settings.velocity == "consistent":
        return projected_gradient(elements, nodal)
    return recovered_gradient(equation.mesh, elements, nodal)


def nodal_response(
    equation: WaveEquation, symbols: Symbols, tensor: np.ndarray | None = None
) -> np.ndarray:
    """(2, 2, n_points) velocity at the nodes per unit of elevation gradient (m/s).

    First index the component of the velocity, second that of the gradient; the rule at
    land nodes is in.

    Parameters
    ----------
    equation : WaveEquation
    symbols : Symbols
    tensor : (3, n_points) array, optional
        Friction as a symmetric tensor (xx, xy, yy; 1/s), in place of the equation's.
    """
    g, f = equation.settings.gravity, equation.coriolis
    if tensor is None:
        xx = yy = equation.nodal_q(symbols)
        xy = np.zeros(len(xx))
    else:
        xx, xy, yy = symbols.momentum * np.array([[1.0], [0.0], [1.0]]) + tensor
    f = np.zeros(len(xx)) if f is None else f
    factor = -g / (xx * yy - xy * xy + f * f)
    response = factor * np.array([[yy, f - xy], [-f - xy, xx]])
    if equation.settings.land_rule == "adcirc":
        _along_land(equation, response, (xx, xy, yy))
    return response


def turn(matrix: np.ndarray, vectors: np.ndarray) -> np.ndarray:
    """(2, 2, n) matrices times (2, n) vectors."""
    x, y = vectors
    return np.stack([row[0] * x + row[1] * y for row in matrix])


def lumped_gradient(elements: Elements, nodal: np.ndarray) -> np.ndarray:
    """(2, n_points) mean of the gradients around a node, weighted by area."""
    return elements.nodal_vector(elements.gradient_of(nodal))


def projected_gradient(
    elements: Elements, nodal: np.ndarray, *, tolerance: float = 1.0e-12
) -> np.ndarray:
    """(2, n_points) least-squares projection: the consistent mass matrix is solved.

    Conjugate gradients with the diagonal as preconditioner; the mass matrix of linear
    triangles then has a condition number of at most 4, whatever the mesh.

    Raises
    ------
    ConvergenceError
        If the tolerance is not reached in 100 iterations.
    """
    on, off = MASS["consistent"]
    area = elements.area
    a, b, c = elements.corners
    diagonal = elements.scatter(np.broadcast_to(on * area, elements.corners.shape))
    sides = np.concatenate([a, b, c]), np.concatenate([b, c, a])
    half = sparse.csr_array((np.tile(off * area, 3), sides), (elements.n_points,) * 2)
    mass = (half + half.T + sparse.diags_array(diagonal)).tocsr()

    gradient = elements.to_corners(elements.gradient_of(nodal))
    load = np.stack([elements.scatter(area / 3.0 * part) for part in gradient])
    if elements.axes is not None:
        # The mass matrix couples nodes: all need the same axes.
        load = np.einsum("ick,ik->ck", elements.axes, load)
    rhs = np.concatenate([load.real, load.imag]).T
    inverse = 1.0 / diagonal[:, None]
    solution = inverse * rhs
    residual = rhs - mass @ solution
    search = inverse * residual
    rho = (residual * search).sum(axis=0)
    goal = tolerance**2 * (rhs * inverse * rhs).sum(axis=0)
    for _ in range(100):
        if (rho <= goal).all():
            found = (solution[:, : len(load)] + 1j * solution[:, len(load) :]).T
            if elements.axes is None:
                return found
            return np.einsum("ick,ck->ik", elements.axes, found)
        image = mass @ search
        curvature = (search * image).sum(axis=0)
        step = np.divide(rho, curvature, out=np.zeros_like(rho), where=curvature > 0.0)
        solution += step * search
        residual -= step * image
        scaled = inverse * residual
        previous, rho = rho, (residual * scaled).sum(axis=0)
        turn = np.divide(rho, previous, out=np.zeros_like(rho), where=previous > 0.0)
        search = scaled + turn * search
    raise ConvergenceError("the projection of the velocities did not converge")


def recovered_gradient(
    mesh: CoastalMesh, elements: Elements, nodal: np.ndarray
) -> np.ndarray:
    """(2, n_points) gradient at each node of a quadratic fitted to two rings of nodes.

    A fit of degree two to the nodal values recovers the gradient to second order, up
    to the boundary (Zhang & Naga 2005, polynomial-preserving recovery). Where the
    rings do not determine a quadratic (channels one triangle wide), the mean of the
    element gradients stands in.
    """
    gradient = lumped_gradient(elements, nodal)
    n = elements.n_points
    tails = elements.corners.ravel()
    heads = np.roll(elements.corners, -1, axis=0).ravel()
    ones = np.ones(len(tails), dtype=np.float32)
    near = sparse.csr_array((ones, (tails, heads)), shape=(n, n))
    near = (near + near.T + sparse.eye_array(n, dtype=np.float32)).tocsr()
    for first in range(0, n, _FIT_CHUNK):
        rings = (near[first : first + _FIT_CHUNK] @ near).tocsr()
        rows = slice(first, first + rings.shape[0])
        fitted, good = _fit_quadratic(elements, nodal, rings, first)
        gradient[:, rows] = np.where(good, fitted, gradient[:, rows])
    return gradient


def _fit_quadratic(
    elements: Elements, nodal: np.ndarray, rings: sparse.csr_array, first: int
) -> tuple[np.ndarray, np.ndarray]:
    """Gradients (2, k) of quadratic fits about k nodes, and where they are sound."""
    starts, others = rings.indptr[:-1], rings.indices
    count = np.diff(rings.indptr)
    own = np.repeat(np.arange(first, first + len(count)), count)
    offset = elements.chord(own, others).T
    reach = np.sqrt(np.maximum.reduceat((offset**2).sum(axis=1), starts))
    x, y = (offset / np.repeat(reach, count)[:, None]).T
    # The value at the node itself is part of the fit, not forced.
    terms = np.stack([np.ones_like(x), x, y, x * x, x * y, y * y])
    normal = np.empty((len(count), 6, 6))
    load = np.empty((len(count), 6), dtype=np.complex128)
    for i in range(6):
        load[:, i] = np.add.reduceat(terms[i] * nodal[others], starts)
        for j in range(i + 1):
            normal[:, i, j] = np.add.reduceat(terms[i] * terms[j], starts)
            normal[:, j, i] = normal[:, i, j]
    good = (count >= 6) & (np.linalg.cond(normal) < _FIT_CONDITION)
    normal[~good] = np.eye(6)
    fit = np.linalg.solve(normal, load[..., None])[..., 0]
    return (fit[:, 1:3] / reach[:, None]).T, good


def shore_direction(
    mesh: CoastalMesh, elements: Elements, minimum_inner_angle_deg: float
) -> tuple[np.ndarray, np.ndarray]:
    """Nodes whose velocity is bound to the shore, as ADCIRC does it.

    The direction of the shore at a node joins its two neighbours on the boundary
    string, itself standing in for the missing one at an end.

    Parameters
    ----------
    mesh : CoastalMesh
    elements : Elements
        Measures the way between nodes.
    minimum_inner_angle_deg : float
        Land corners sharper than this let nothing flow (ANGINN).

    Returns
    -------
    bound : (n_points,) bool array
    direction : (2, n_points) array
        Unit vectors along the axes of the nodes; zero where nothing flows (no slip,
        sharp corners), and off the shore.
    """
    n = elements.n_points
    bound, direction = np.zeros(n, dtype=bool), np.zeros((2, n))
    least = np.cos(np.radians(minimum_inner_angle_deg))
    for string in mesh.boundaries:
        nodes = string.nodes
        if string.kind == "open" or len(nodes) < 2:
            continue
        if string.ibtype not in SLIP + NO_SLIP:
            continue
        bound[nodes] = True
        if string.ibtype in NO_SLIP:
            direction[:, nodes] = 0.0
            continue
        before, after = np.roll(nodes, 1), np.roll(nodes, -1)
        if not string.closed:
            before[0], after[-1] = nodes[0], nodes[-1]
        back, ahead = elements.chord(nodes, before), elements.chord(nodes, after)
        along = ahead - back
        tangent = along / np.hypot(*along)
        convex = ahead[0] * back[1] - ahead[1] * back[0] > 0.0
        sharp = (ahead * back).sum(axis=0) > least * np.hypot(*ahead) * np.hypot(*back)
        tangent[:, convex & sharp] = 0.0
        direction[:, nodes] = tangent
    return bound, direction


def _along_land(
    equation: WaveEquation, response: np.ndarray, q: tuple[np.ndarray, ...]
) -> None:
    """Apply ADCIRC's rule at land nodes to the response, in place.

    The momentum equation along the shore is kept, the velocity across it set to zero;
    so the rotation drops out and -g over t.q.t is what is left along the shore, with
    the tensor `q` = i w + tau (xx, xy, yy) and the direction t of the shore.
    """
    settings = equation.settings
    bound, direction = shore_direction(
        equation.mesh, equation.elements, settings.minimum_inner_angle_deg
    )
    response[:, :, bound] = 0.0
    nodes = np.flatnonzero(direction.any(axis=0))
    (x, y), (xx, xy, yy) = direction[:, nodes], (part[nodes] for part in q)
    along = -settings.gravity / (x * x * xx + 2 * x * y * xy + y * y * yy)
    tangent = direction[:, nodes]
    response[:, :, nodes] = tangent[:, None] * tangent * along
