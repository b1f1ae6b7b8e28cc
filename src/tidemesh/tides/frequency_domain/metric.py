"""True lengths and areas on a map."""

from __future__ import annotations

import numpy as np
import pyproj

from tidemesh.datatypes import CoastalMesh
from tidemesh.errors import InputError
from tidemesh.tides.frequency_domain.elements import Elements


def elements_for(mesh: CoastalMesh, metric: str) -> Elements:
    """Elements of a mesh by the name of the metric (`TideSettings.metric`)."""
    if metric == "sphere":
        return elements_on_sphere(mesh)
    if metric == "plane":
        return Elements.of(mesh)
    raise NotImplementedError(metric)


def elements_on_sphere(mesh: CoastalMesh) -> Elements:
    """Elements with derivatives and areas corrected by the scale of the map.

    The map must be conformal (stereographic, Mercator, UTM ...) or have its x axis
    along the parallels (equirectangular). The scale is taken at the nodes and averaged
    over the triangles.

    Raises
    ------
    InputError
        If the mesh has no map projection.
    """
    if not mesh.projection.crs:
        raise InputError(
            'metric = "sphere" needs a mesh with a map projection; this one lies on '
            'the bare plane: use metric = "plane"'
        )
    longitude, latitude = mesh.projection.inverse(mesh.points).T
    factors = pyproj.Proj(mesh.projection.crs).get_factors(longitude, latitude)
    return Elements.of(
        mesh,
        scale=np.stack([factors.parallel_scale, factors.meridional_scale]),
        area_scale=np.asarray(factors.areal_scale),
    )


def adcirc_elements(mesh: CoastalMesh, reference_latitude_deg: float) -> Elements:
    """Elements of ADCIRC's spherical runs (ICS = 2).

    The mesh is on ADCIRC's own map, `Projection.equirectangular`; x derivatives are
    multiplied by the element mean of cos(latitude0)/cos(latitude), areas are those of
    the mapped plane.
    """
    latitude = np.radians(mesh.projection.inverse(mesh.points)[:, 1])
    along_x = np.cos(np.radians(reference_latitude_deg)) / np.cos(latitude)
    return Elements.of(mesh, scale=np.stack([along_x, np.ones_like(along_x)]))
