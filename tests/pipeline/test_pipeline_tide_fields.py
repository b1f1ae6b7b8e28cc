import numpy as np

from tidemesh.datatypes import CoastalMesh, TideSolution
from tidemesh.geometry.projection import Projection
from tidemesh.pipeline.stages import tide_fields


def test_velocities_in_files_point_east_and_north():
    """A current along the meridians, on a map where these are turned by a degree."""
    projection = Projection.stereographic(-79.75, 33.0)
    longitude, latitude = np.array([-77.8, -77.6, -77.7]), np.array([33.0, 33.0, 33.2])
    points = projection.forward(longitude, latitude)
    meridian = projection.forward(longitude, latitude + 1e-4) - points
    meridian /= np.hypot(*meridian.T)[:, None]
    assert np.abs(meridian[:, 0]).min() > 0.015
    tide = TideSolution(
        names=("M2",),
        frequency=np.array([1.405e-4]),
        elevation=np.ones((1, 3)),
        velocity=0.5j * meridian[None],
        friction=np.zeros(3),
    )
    mesh = CoastalMesh(points, [[0, 1, 2]], np.ones(3), projection=projection)
    fields = {field.name: field for field in tide_fields(mesh, tide)}
    np.testing.assert_allclose(fields["u_M2"].values, 0.0, atol=1e-6)
    np.testing.assert_allclose(fields["v_M2"].values, 0.5j, atol=1e-6)
