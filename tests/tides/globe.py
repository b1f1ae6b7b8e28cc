"""Meshes of the whole globe, or of parts of it."""

from __future__ import annotations

import numpy as np

from tidemesh.datatypes import CoastalMesh
from tidemesh.geometry.projection import Projection

DEPTH = 4000.0
GLOBE = Projection.equirectangular(0.0, 0.0)


def icosphere(level):
    """Unit vectors and triangles; one node at each pole, sides across the date line."""
    longitude = np.radians(np.concatenate([[0], np.arange(10) * 36.0, [0]]))
    latitude = np.full(12, np.arctan(0.5))
    latitude[[0, -1]] = 0.5 * np.pi, -0.5 * np.pi
    latitude[2:-1:2] *= -1.0
    points = unit_vectors(longitude, latitude)
    # A fan about each pole, and a belt of ten.
    belt = 1 + np.arange(10)[:, None] + np.arange(3)
    belt[belt > 10] -= 10
    fans = np.column_stack([np.tile([0, 11], 5), belt[:, [0, 2]]])
    triangles = np.concatenate([belt, fans])
    clockwise = np.linalg.det(points[triangles]) < 0.0
    triangles[clockwise] = triangles[clockwise, ::-1]
    for _ in range(level):
        ends = np.concatenate([np.roll(triangles, -k, axis=1)[:, :2] for k in range(3)])
        sides, number = np.unique(np.sort(ends, axis=1), axis=0, return_inverse=True)
        middle = points[sides].sum(axis=1)
        middle /= np.linalg.norm(middle, axis=1)[:, None]
        p, q, r = number.reshape(3, -1) + len(points)
        a, b, c = triangles.T
        points = np.concatenate([points, middle])
        triangles = np.concatenate(
            [np.stack(t, 1) for t in ((a, p, r), (p, b, q), (r, q, c), (p, q, r))]
        )
    return points, triangles


def unit_vectors(longitude, latitude):
    cosine = np.cos(latitude)
    return np.stack(
        [cosine * np.cos(longitude), cosine * np.sin(longitude), np.sin(latitude)], 1
    )


def mesh_of(points, triangles, projection=GLOBE, boundaries=(), depth=DEPTH):
    """Mesh of unit vectors on a map."""
    longitude = np.degrees(np.arctan2(points[:, 1], points[:, 0]))
    latitude = np.degrees(np.arcsin(np.clip(points[:, 2], -1.0, 1.0)))
    depth = np.broadcast_to(np.asarray(depth, dtype=float), len(points))
    plane = projection.forward(longitude, latitude)
    return CoastalMesh(plane, triangles, depth, boundaries, projection)


def tilted_degree_two(points):
    """A spherical harmonic of degree two with no symmetry about the axis."""
    a, b = np.array([0.6, 0.0, 0.8]), np.array([0.0, 1.0, 0.0])
    return (points @ a + 1j * (points @ b)) ** 2
