"""Derivatives of nodal values by local polynomials, up to the boundary.

A polynomial is fitted by weighted least squares to the values on a patch around every
node. Patches grow ring by ring along the edges of the mesh, so they never reach
across a spit of land.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from math import ceil, factorial, sqrt

import numpy as np

from tidemesh.triangulation.topology import node_to_nodes
from tidemesh.truncation import _kernels

LEAST_SINE = 0.01
"""A monomial counts as not resolved by a patch where the sine of the angle between it
and the span of the monomials before it is smaller than this."""

EXTRA_RINGS = 2
"""Rings by which a patch may grow when it does not resolve every monomial."""

CHUNK = 8192
"""Nodes fitted at a time: bounds the memory to some 30 MB."""


@dataclass(frozen=True, eq=False)
class LocalPolynomials:
    """Polynomials in (x - x_node, y - y_node) about some nodes."""

    degree: int
    coefficients: np.ndarray
    """(n, n_terms, k) real or complex, of the monomials in the order of `index`, in
    units of the values per metre**(a + b)."""
    complete: np.ndarray
    """(n,) int8, degree up to which the patch resolves every monomial, -1 for none."""
    rank: np.ndarray
    """(n,) int16, number of monomials resolved; the coefficients of the others are
    zero. In a channel a few elements wide those are the higher powers across it."""

    @property
    def known(self) -> np.ndarray:
        """(n,) bool, True where a line through the patch would be resolved.

        That is where the patch resolves as many monomials as one variable has.
        """
        return self.rank > self.degree

    def derivative(self, a: int, b: int) -> np.ndarray:
        """Derivative a times in x and b times in y at the nodes: (k, n)."""
        scale = factorial(a) * factorial(b)
        return scale * self.coefficients[:, index(a, b), :].T

    def values_at(self, rows: np.ndarray, offset: np.ndarray) -> np.ndarray:
        """Values of polynomials ``rows`` (n,) at offsets (n, 2) m: (k, n)."""
        real = self.coefficients.view(np.float64)
        values = np.empty((len(rows), real.shape[2]))
        parent, by_x = _monomials(self.degree)
        _kernels.evaluate(real, rows, offset, parent, by_x, values)
        return values.view(self.coefficients.dtype).T


def index(a: int, b: int) -> int:
    """Position of the monomial x**a y**b among the coefficients.

    Examples
    --------
    >>> [index(*ab) for ab in ((0, 0), (1, 0), (0, 1), (2, 0), (1, 1), (0, 2))]
    [0, 1, 2, 3, 4, 5]
    """
    return term_count(a + b - 1) + b


def term_count(degree: int) -> int:
    """Number of monomials of two variables up to a degree."""
    return (degree + 1) * (degree + 2) // 2


class PolynomialFit:
    """Local least-squares fits on one mesh.

    Parameters
    ----------
    points : (n_points, 2) float array
        Metres.
    triangles : (n_triangles, 3) int array
    degree : int
        Degree of the polynomials, 1 to 8.
    patch_points : int, optional
        Least number of points of a patch, which takes whole rings of neighbours; by
        default 1.6 times the number of monomials (three rings on an equilateral
        lattice for degrees 4 and 5).
    """

    def __init__(
        self,
        points: np.ndarray,
        triangles: np.ndarray,
        degree: int,
        *,
        patch_points: int | None = None,
    ):
        if not 1 <= degree <= 8:
            raise ValueError(f"degree must be between 1 and 8, got {degree}")
        terms = term_count(degree)
        if patch_points is None:
            patch_points = (8 * terms) // 5
        if patch_points < terms:
            raise ValueError(
                f"a patch for degree {degree} needs at least {terms} points, "
                f"got patch_points = {patch_points}"
            )
        self.degree = degree
        self.patch_points = patch_points
        # Own copies: a read-only array would make the kernels compile a second time.
        self.points = np.array(points, dtype=np.float64, order="C")
        self._indptr, self._indices = node_to_nodes(
            np.asarray(triangles, dtype=np.int64), len(self.points)
        )
        self._mark = np.full(len(self.points), -1, dtype=np.int64)
        # r rings of an equilateral lattice hold 3 r (r + 1) + 1 points; in a corner
        # twice as many rings are needed to reach as far.
        rings = ceil(sqrt((patch_points - 1) / 3.0 + 0.25) - 0.5)
        self._most_rings = 2 * rings

    def fit(
        self, values: np.ndarray, nodes: np.ndarray | None = None
    ) -> LocalPolynomials:
        """Polynomials about the given nodes (all by default).

        Parameters
        ----------
        values : (k, n_points) float or complex array
            Finite.
        nodes : (n,) int array, optional

        Returns
        -------
        LocalPolynomials
            Of n nodes and k fields.
        """
        values = np.atleast_2d(np.asarray(values))
        if nodes is None:
            nodes = np.arange(len(self.points))
        shape = (len(nodes), term_count(self.degree), len(values))
        kind = np.complex128 if np.iscomplexobj(values) else np.float64
        whole = LocalPolynomials(
            self.degree,
            np.empty(shape, dtype=kind),
            np.empty(len(nodes), dtype=np.int8),
            np.empty(len(nodes), dtype=np.int16),
        )
        for some, part in self.fit_in_chunks(values, nodes):
            whole.coefficients[some] = part.coefficients
            whole.complete[some] = part.complete
            whole.rank[some] = part.rank
        return whole

    def fit_in_chunks(
        self, values: np.ndarray, nodes: np.ndarray | None = None
    ) -> Iterator[tuple[slice, LocalPolynomials]]:
        """The same, some nodes at a time: slices of ``nodes`` and their polynomials."""
        values = np.atleast_2d(np.asarray(values))
        if values.shape[1] != len(self.points):
            raise ValueError(
                f"values must have shape (k, {len(self.points)}), got {values.shape}"
            )
        if not np.isfinite(values).all():
            raise ValueError("values must be finite")
        if nodes is None:
            nodes = np.arange(len(self.points))
        kind = np.complex128 if np.iscomplexobj(values) else np.float64
        # Real and imaginary parts are fitted side by side.
        columns = np.array(values.T, dtype=kind, order="C").view(np.float64)
        size = max(256, CHUNK * 6 // max(6, columns.shape[1]))
        for start in range(0, max(len(nodes), 1), size):
            part = slice(start, min(start + size, len(nodes)))
            solution, kept = self._fit_nodes(
                np.array(nodes[part], dtype=np.int64), columns
            )
            yield part, self._polynomials(solution.view(kind), kept)

    def _polynomials(
        self, coefficients: np.ndarray, kept: np.ndarray
    ) -> LocalPolynomials:
        whole = [
            kept[:, index(d, 0) : index(d + 1, 0)].all(axis=1)
            for d in range(self.degree + 1)
        ]
        complete = np.cumprod(whole, axis=0).sum(axis=0) - 1
        return LocalPolynomials(
            self.degree,
            coefficients,
            complete.astype(np.int8),
            kept.sum(axis=1).astype(np.int16),
        )

    def _fit_nodes(
        self, nodes: np.ndarray, columns: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Coefficients (n, n_terms, sides) about the nodes, and which are resolved."""
        target = np.full(len(nodes), self.patch_points)
        patches, counts = self._gather(nodes, target)
        solution, kept = self._solve(patches, counts, columns, turn=False)
        for _ in range(EXTRA_RINGS):
            poor = np.flatnonzero(~kept.all(axis=1))
            if len(poor) == 0:
                return solution, kept
            patches, counts = self._gather(nodes[poor], counts[poor] + 1)
            solution[poor], kept[poor] = self._solve(
                patches, counts, columns, turn=False
            )
            more = np.empty(len(nodes), dtype=np.int64)
            more[poor] = counts
            counts = more
        poor = np.flatnonzero(~kept.all(axis=1))
        if len(poor):
            # Turned to the patch's long axis, so that in a channel the powers along
            # it are those that stay.
            patches, counts = self._gather(nodes[poor], counts[poor])
            solution[poor], kept[poor] = self._solve(
                patches, counts, columns, turn=True
            )
        return solution, kept

    def _gather(
        self, nodes: np.ndarray, target: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        patches = np.empty((len(nodes), 3 * self.patch_points), dtype=np.int64)
        counts = np.empty(len(nodes), dtype=np.int64)
        self._mark.fill(-1)
        _kernels.gather_rings(
            nodes,
            self._indptr,
            self._indices,
            target,
            self._most_rings,
            self._mark,
            patches,
            counts,
        )
        return patches, counts

    def _solve(
        self,
        patches: np.ndarray,
        counts: np.ndarray,
        columns: np.ndarray,
        *,
        turn: bool,
    ) -> tuple[np.ndarray, np.ndarray]:
        parent, by_x = _monomials(self.degree)
        frame = np.empty((len(patches), 5))
        kept = np.empty((len(patches), len(parent)), dtype=np.bool_)
        solution = np.empty((len(patches), len(parent), columns.shape[1]))
        _kernels.fit_patches(
            self.points,
            columns,
            patches,
            counts,
            parent,
            by_x,
            turn,
            LEAST_SINE,
            frame,
            kept,
            solution,
        )
        centre_x, centre_y, radius, cosine, sine = frame.T
        aside = np.flatnonzero((centre_x != 0.0) | (centre_y != 0.0))
        if len(aside):
            x, y = -centre_x / radius, -centre_y / radius
            solution[aside] = _shifted(
                solution[aside],
                self.degree,
                (cosine * x + sine * y)[aside],
                (cosine * y - sine * x)[aside],
            )
        if turn:
            _rotate(solution, self.degree, cosine, sine)
        power = np.repeat(np.arange(self.degree + 1), np.arange(1, self.degree + 2))
        solution /= (radius[:, None] ** power)[:, :, None]
        return solution, kept


def fit_polynomials(
    points: np.ndarray,
    triangles: np.ndarray,
    values: np.ndarray,
    *,
    degree: int = 5,
    patch_points: int | None = None,
) -> LocalPolynomials:
    """Local polynomials about every node of a mesh; see `PolynomialFit`.

    Examples
    --------
    >>> x, y = (axis.ravel() for axis in np.mgrid[0:4, 0:4] * 100.0)
    >>> corner = (np.arange(3)[:, None] * 4 + np.arange(3)).ravel()
    >>> lower = np.stack([corner, corner + 4, corner + 5], axis=1)
    >>> upper = np.stack([corner, corner + 5, corner + 1], axis=1)
    >>> points, triangles = np.stack([x, y], axis=1), np.vstack([lower, upper])
    >>> fit = fit_polynomials(points, triangles, x * y, degree=2)
    >>> bool(np.allclose(fit.derivative(1, 1), 1.0))
    True
    """
    fit = PolynomialFit(points, triangles, degree, patch_points=patch_points)
    return fit.fit(values)


def _monomials(degree: int) -> tuple[np.ndarray, np.ndarray]:
    """Of every monomial: which one it is a multiple of, and whether by x."""
    parent, by_x = [0], [True]
    for d in range(1, degree + 1):
        parent += [index(d - 1, 0)] + [index(d - 1 - b, b) for b in range(d)]
        by_x += [True] + [False] * d
    return np.array(parent), np.array(by_x)


def _shifted(
    solution: np.ndarray, degree: int, x: np.ndarray, y: np.ndarray
) -> np.ndarray:
    """Polynomials expanded about (x, y) instead of the origin (Horner)."""
    for step, along_x in ((x[:, None], True), (y[:, None], False)):
        for other in range(degree):
            last = degree - other
            for i in range(last):
                for p in range(last - 1, i - 1, -1):
                    low = index(p, other) if along_x else index(other, p)
                    high = index(p + 1, other) if along_x else index(other, p + 1)
                    solution[:, low] += step * solution[:, high]
    return solution


def _rotate(
    solution: np.ndarray, degree: int, cosine: np.ndarray, sine: np.ndarray
) -> None:
    """Rewrite polynomials in (c x + s y, c y - s x) as ones in x and y, in place."""
    for d in range(1, degree + 1):
        # Row b: (c + s t)^(d - b) (c t - s)^b in powers of t = y / x.
        product = np.zeros((len(solution), d + 1, d + 1))
        product[:, :, 0] = 1.0
        for b in range(d + 1):
            for factor in range(d):
                low, high = (cosine, sine) if factor < d - b else (-sine, cosine)
                raised = high[:, None] * product[:, b, :-1]
                product[:, b] *= low[:, None]
                product[:, b, 1:] += raised
        block = slice(index(d, 0), index(d + 1, 0))
        solution[:, block] = np.einsum("nbj,nbs->njs", product, solution[:, block])
