"""Meshes for the tests of this room."""

import numpy as np

from tidemesh.datatypes import CoastalMesh, TideSolution
from tidemesh.triangulation.delaunay import constrained_delaunay


def equilateral_mesh(columns, rows, spacing, origin=(0.0, 0.0)):
    """Equilateral triangles in rows along x: points, triangles."""
    i, j = np.meshgrid(np.arange(columns), np.arange(rows))
    x = spacing * (i + 0.5 * (j % 2))
    y = spacing * np.sqrt(0.75) * j
    points = np.stack([x.ravel(), y.ravel()], axis=1) + np.asarray(origin)
    last = columns - 1
    ring = [(c, 0) for c in range(last)]
    ring += [(last, r) for r in range(rows - 1)]
    ring += [(c, rows - 1) for c in range(last, 0, -1)]
    ring += [(0, r) for r in range(rows - 1, 0, -1)]
    return points, constrained_delaunay(
        points, closed([r * columns + c for c, r in ring])
    )


def graded_mesh(n, length=1.0, stretch=3.0, jitter=0.2, seed=4):
    """A square with a hole, spacing growing in x by `stretch`, interior jittered."""
    random = np.random.default_rng(seed)
    t = np.linspace(0.0, 1.0, n)
    grown = (np.exp(np.log(stretch) * t) - 1.0) / (stretch - 1.0)
    i, j = np.meshgrid(np.arange(n), np.arange(n))
    inner = ((i > 0) & (i < n - 1) & (j > 0) & (j < n - 1)).ravel()
    step = np.diff(grown, append=1.0 + grown[-1] - grown[-2])
    x = grown[i].ravel()
    y = t[j].ravel()
    shift = random.uniform(-jitter, jitter, (n * n, 2))
    x = x + np.where(inner, shift[:, 0] * step[i].ravel(), 0.0)
    y = y + np.where(inner, shift[:, 1] / n, 0.0)
    ring = [(c, 0) for c in range(n - 1)] + [(n - 1, r) for r in range(n - 1)]
    ring += [(c, n - 1) for c in range(n - 1, 0, -1)]
    ring += [(0, r) for r in range(n - 1, 0, -1)]
    hole = np.hypot(x - 0.5, y - 0.5) < 0.12
    kept = np.flatnonzero(~hole)
    number = np.full(n * n, -1)
    number[kept] = np.arange(len(kept))
    segments = closed(number[[r * n + c for c, r in ring]])
    angle = np.linspace(0.0, 2.0 * np.pi, max(8, int(0.8 * n)), endpoint=False)
    island = 0.5 + 0.14 * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    # The island takes over the points that would crowd its shore.
    points = np.stack([x[kept], y[kept]], axis=1)
    far = np.hypot(*(points - 0.5).T) > 0.14 + 0.4 / n
    number = np.cumsum(far) - 1
    points = points[far]
    segments = number[segments]
    shore = len(points) + np.arange(len(island))
    points = length * np.concatenate([points, island])
    return points, constrained_delaunay(
        points, np.concatenate([segments, closed(shore)])
    )


def channel_mesh(n, elements, *, bend=0.0, spacing=1.0):
    """A channel a few elements wide, perhaps bent to an arc: points, triangles."""
    along, across = np.meshgrid(np.arange(n), np.arange(elements + 1))
    x = spacing * (along + 0.5 * (across % 2)).ravel()
    y = spacing * np.sqrt(0.75) * across.ravel()
    points = np.stack([x, y], axis=1)
    if bend:
        angle, radius = x * bend, 1.0 / bend + y
        points = np.stack([radius * np.sin(angle), -radius * np.cos(angle)], axis=1)
    index = np.arange((elements + 1) * n).reshape(elements + 1, n)
    ring = [*index[0], *index[1:-1, -1], *index[-1, ::-1], *index[-2:0:-1, 0]]
    return points, constrained_delaunay(points, closed(ring))


def closed(ring):
    """Segments of a ring of point indices."""
    return np.stack([ring, np.roll(ring, -1)], axis=1)


def polynomial(coefficients, points, a=0, b=0):
    """Derivative of sum c[i, j] x^i y^j, the answer known by hand."""
    for _ in range(a):
        coefficients = np.polynomial.polynomial.polyder(coefficients, axis=0)
    for _ in range(b):
        coefficients = np.polynomial.polynomial.polyder(coefficients, axis=1)
    return np.polynomial.polynomial.polyval2d(*points.T, coefficients)


def random_polynomials(degree, number, seed=0, *, complex_valued=False):
    """Coefficients (degree + 1, degree + 1, number) of total degree `degree`."""
    random = np.random.default_rng(seed)
    shape = (degree + 1, degree + 1, number)
    values = random.normal(size=shape)
    if complex_valued:
        values = values + 1j * random.normal(size=shape)
    i, j = np.indices(shape[:2])
    return np.where((i + j <= degree)[:, :, None], values, 0.0)


def tidal_mesh(points, triangles):
    """The mesh as a datatype."""
    return CoastalMesh(points=points, triangles=triangles, depth=np.ones(len(points)))


def tide(elevation, u, v, *, frequency=1.405e-4, friction=4e-4, coriolis=None):
    """A tide of one constituent from nodal values (n_points,)."""
    n = len(elevation)
    return TideSolution(
        names=("M2",),
        frequency=np.array([frequency]),
        elevation=np.asarray(elevation)[None],
        velocity=np.stack([u, v], axis=1)[None],
        friction=np.broadcast_to(friction, n),
        coriolis=None if coriolis is None else np.broadcast_to(coriolis, n),
    )
