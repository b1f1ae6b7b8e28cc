"""True lengths, areas and directions: on a map, on ADCIRC's, on the globe."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pyproj

from tidemesh.datatypes import CoastalMesh
from tidemesh.errors import InputError, MeshError
from tidemesh.geometry.projection import Projection
from tidemesh.tides.frequency_domain.elements import Elements

_CYLINDRICAL = ("Mercator", "Lambert Cylindrical", "Miller", "Gall")
"""Beginnings of the names of the maps of ADCIRC's ICS = 20 and 22 to 24."""


def elements_for(mesh: CoastalMesh, metric: str) -> Elements:
    """Elements of a mesh by the name of the metric (`TideSettings.metric`).

    ``"adcirc"`` is ADCIRC's ICS = 2 about the reference latitude of the mesh's own
    equirectangular map; on another cylindrical map (Mercator ...) ICS = 20 to 24; on
    any other map, and on an equirectangular one of another sphere, ICS = 2 about the
    middle of the mesh.

    Raises
    ------
    InputError
        If the metric needs a map projection and the mesh lies on the bare plane.
    MeshError
        If a triangle is not counter-clockwise.
    """
    if metric == "plane":
        return Elements.of(mesh)
    if metric == "sphere":
        return elements_on_sphere(mesh)
    if metric == "geographic":
        return elements_geographic(mesh)
    if metric != "adcirc":
        raise ValueError(
            'metric must be "plane", "sphere", "geographic" or "adcirc", got '
            f'"{metric}"'
        )
    _check_map(mesh, metric)
    operation = pyproj.CRS.from_user_input(mesh.projection.crs).coordinate_operation
    if operation.method_name.startswith(_CYLINDRICAL):
        return _adcirc_corrected_elements(mesh)
    if operation.method_name.startswith("Equidistant Cylindrical"):
        for parameter in operation.params:
            if parameter.name == "Latitude of 1st standard parallel":
                return adcirc_elements(mesh, parameter.value)
    return _adcirc_elements_of_other_map(mesh)


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
    _check_map(mesh, "sphere")
    longitude, latitude = mesh.projection.inverse(mesh.points).T
    factors = pyproj.Proj(mesh.projection.crs).get_factors(longitude, latitude)
    return Elements.of(
        mesh,
        scale=np.stack([factors.parallel_scale, factors.meridional_scale]),
        area_scale=np.asarray(factors.areal_scale),
    )


def elements_geographic(mesh: CoastalMesh) -> Elements:
    """Elements measured in space, between the places of the corners on the globe.

    Longitudes and latitudes of the nodes are put on the ellipsoid (or sphere) of the
    mesh's map; triangles are the flat ones between them. So neither the date line nor
    a pole is a special place, and a mesh may cover the globe. Vectors at the nodes are
    along the x and y axis of the map (east and north on a cylindrical map); they are
    carried to the plane of a triangle by the smallest rotation of one plane into the
    other.

    Triangles that the map tears apart (across its edge, round a pole) may be in either
    order: programs that put them counter-clockwise on the map turn them over.

    Raises
    ------
    InputError
        If the mesh has no map projection.
    MeshError
        If a triangle is clockwise on the globe and on the map.
    """
    _check_map(mesh, "geographic")
    position, axes, up = _on_ellipsoid(mesh)
    corners = np.ascontiguousarray(mesh.triangles.T)
    torn = ~_upward(position, up, corners) & (_turn_on_map(mesh) > 0.0)
    corners[1:, torn] = corners[:0:-1, torn]
    good = _upward(position, up, corners)
    if not good.all():
        bad = int(np.flatnonzero(~good)[0])
        longitude, latitude = mesh.projection.inverse(
            mesh.points[mesh.triangles[bad, 0]]
        )
        raise MeshError(
            f"triangle {bad} (nodes {mesh.triangles[bad].tolist()}) at "
            f"({longitude:.5f}, {latitude:.5f}) is not counter-clockwise on the globe"
        )
    side, normal = _sides_and_normal(position, corners)
    doubled = np.sqrt((normal**2).sum(axis=0))
    normal /= doubled

    x_axis = _carried(axes[0][:, corners[0]], up[:, corners[0]], normal)
    y_axis = np.cross(normal, x_axis, axis=0)
    # The gradient of a basis function points across the side opposite to its corner.
    across = np.cross(normal[:, None, :], side, axis=0) / doubled
    gradient = np.stack(
        [(axis[:, None] * across).sum(axis=0) for axis in (x_axis, y_axis)]
    )
    turn = np.empty_like(gradient)
    for k in range(3):
        carried = _carried(axes[0][:, corners[k]], up[:, corners[k]], normal)
        turn[0, k] = (carried * x_axis).sum(axis=0)
        turn[1, k] = (carried * y_axis).sum(axis=0)
    return Elements(
        corners=corners,
        area=0.5 * doubled,
        gradient=gradient,
        scale=None,
        n_points=len(mesh.points),
        position=position,
        axes=axes,
        turn=turn,
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


def _check_map(mesh: CoastalMesh, metric: str) -> None:
    if not mesh.projection.crs:
        raise InputError(
            f'metric = "{metric}" needs a mesh with a map projection; this one lies on '
            'the bare plane: use metric = "plane"'
        )


def _adcirc_corrected_elements(mesh: CoastalMesh) -> Elements:
    """Elements of ADCIRC's runs on another cylindrical map (ICS = 20, 22, 23, 24).

    These solve the full spherical equations. ADCIRC's own are the direction of the
    shore, in which only the scale along x counts, and means by the area on the map.
    """
    elements = elements_on_sphere(mesh)
    along_x = elements.scale[0]
    return replace(
        elements,
        scale=np.stack([along_x, np.ones_like(along_x)]),
        share=Elements.of(mesh).area,
    )


def _adcirc_elements_of_other_map(mesh: CoastalMesh) -> Elements:
    """Elements of ADCIRC's run (ICS = 2) on the longitudes and latitudes of a mesh.

    ADCIRC's map is put about the middle of the mesh; vectors at the nodes stay along
    the axes of the mesh's own map.
    """
    place = mesh.projection.inverse(mesh.points)
    # Rounded as in the projection's name and in a control file.
    longitude, latitude = np.round(0.5 * (place.min(axis=0) + place.max(axis=0)), 6)
    projection = Projection.equirectangular(longitude, latitude)
    mapped = replace(mesh, points=projection.forward(*place.T), projection=projection)
    elements = adcirc_elements(mapped, latitude)
    # East and north at a node along the axes of the mesh's map.
    east = mesh.projection.from_east_north(
        mesh.points, np.broadcast_to([1.0, 0.0], place.shape)
    )
    cosine, sine = east[:, 0], -east[:, 1]
    axes = np.array([[cosine, sine], [-sine, cosine]])
    turn = np.stack([cosine, sine])[:, elements.corners]
    return replace(elements, axes=axes, turn=turn)


def _on_ellipsoid(
    mesh: CoastalMesh,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Nodes in space: position, axes of the map and upward normal.

    Returns
    -------
    position : (3, n_points) array
        m from the centre of the earth.
    axes : (2, 3, n_points) array
        Directions of x and y of the map.
    up : (3, n_points) array
    """
    longitude, latitude = np.radians(mesh.projection.inverse(mesh.points).T)
    ellipsoid = pyproj.CRS.from_user_input(mesh.projection.crs).ellipsoid
    a, b = ellipsoid.semi_major_metre, ellipsoid.semi_minor_metre
    cos_lon, sin_lon = np.cos(longitude), np.sin(longitude)
    cos_lat, sin_lat = np.cos(latitude), np.sin(latitude)
    up = np.stack([cos_lat * cos_lon, cos_lat * sin_lon, sin_lat])
    east = np.stack([-sin_lon, cos_lon, np.zeros_like(longitude)])
    north = np.stack([-sin_lat * cos_lon, -sin_lat * sin_lon, cos_lat])
    # Radius of curvature across the meridian.
    across = a * a / np.sqrt((a * cos_lat) ** 2 + (b * sin_lat) ** 2)
    position = across * up
    position[2] *= (b / a) ** 2
    (xx, xy), (yx, yy) = (
        mesh.projection.east_north(
            mesh.points, np.broadcast_to(unit, mesh.points.shape)
        ).T
        for unit in np.eye(2)
    )
    return position, np.stack([xx * east + xy * north, yx * east + yy * north]), up


def _sides_and_normal(
    position: np.ndarray, corners: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Sides opposite to the corners (3, 3, m), and twice the area vectors (3, m)."""
    place = position[:, corners]
    side = np.roll(place, 1, axis=1) - np.roll(place, -1, axis=1)
    return side, np.cross(side[:, 0], side[:, 1], axis=0)


def _upward(position: np.ndarray, up: np.ndarray, corners: np.ndarray) -> np.ndarray:
    """(n_triangles,) whether the triangles are counter-clockwise from above."""
    normal = _sides_and_normal(position, corners)[1]
    return (normal * up[:, corners].sum(axis=1)).sum(axis=0) > 0.0


def _turn_on_map(mesh: CoastalMesh) -> np.ndarray:
    """(n_triangles,) positive where the triangles are counter-clockwise on the map."""
    a, b, c = (mesh.points[mesh.triangles[:, k]].T for k in range(3))
    (x, y), (u, v) = b - a, c - a
    return x * v - y * u


def _carried(vectors: np.ndarray, start: np.ndarray, end: np.ndarray) -> np.ndarray:
    """(3, n) vectors turned as the normals `start` are turned into `end`."""
    lean = (vectors * end).sum(axis=0) / (1.0 + (start * end).sum(axis=0))
    return vectors - lean * (start + end)
