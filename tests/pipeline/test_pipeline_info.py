"""Figures of `tidemesh info` against the sphere, far from the middle of the map."""

import numpy as np
import pytest

from tidemesh.datatypes import CoastalMesh
from tidemesh.geometry.projection import Projection
from tidemesh.io.fort14 import write_fort14
from tidemesh.pipeline.info import describe_mesh


def test_area_and_extent_across_the_date_line(tmp_path):
    longitude, latitude = np.meshgrid(
        np.linspace(175, 187, 49), np.linspace(50, 58, 33)
    )
    number = np.arange(longitude.size).reshape(longitude.shape)
    a, b = number[:-1, :-1].ravel(), number[:-1, 1:].ravel()
    c, d = number[1:, 1:].ravel(), number[1:, :-1].ravel()
    triangles = np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)])
    projection = Projection.stereographic(181.0, 54.0)
    points = projection.forward(longitude.ravel(), latitude.ravel())
    mesh = CoastalMesh(points, triangles, np.full(len(points), 10.0), (), projection)
    write_fort14(tmp_path / "mesh.14", mesh)
    described = describe_mesh(tmp_path / "mesh.14")
    np.testing.assert_allclose(described["extent"], [175, 50, 187, 58], atol=1e-6)
    radius = 6385.0  # of curvature, mean of the ellipsoid at 54 degrees north (km)
    bands = np.sin(np.radians(58)) - np.sin(np.radians(50))
    area = radius**2 * np.radians(12.0) * bands
    assert described["area_km2"] == pytest.approx(area, rel=0.004)


def test_equilateral_far_from_the_middle(tmp_path):
    """ADCIRC's own map would stretch these triangles by up to 8 %, north and south."""
    row, column = np.meshgrid(np.arange(-20, 21), np.arange(-5, 6), indexing="ij")
    points = 20e3 * np.stack([column + 0.5 * (row % 2), 0.75**0.5 * row], axis=-1)
    number = np.arange(row.size).reshape(row.shape)
    a, b = number[:-1:2, :-1].ravel(), number[:-1:2, 1:].ravel()
    triangles = np.stack([a, b, number[1::2, :-1].ravel()], axis=1)
    projection = Projection.stereographic(10.0, 54.0)
    depth = np.full(row.size, 10.0)
    mesh = CoastalMesh(points.reshape(-1, 2), triangles, depth, (), projection)
    write_fort14(tmp_path / "mesh.14", mesh)
    described = describe_mesh(tmp_path / "mesh.14")
    assert described["quality"]["quality_minimum"] == pytest.approx(1.0, abs=1e-6)
