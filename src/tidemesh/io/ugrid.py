"""Meshes and fields as NetCDF after the UGRID-1.0 and CF-1.11 conventions."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

import netCDF4
import numpy as np
import pyproj

from tidemesh import __version__
from tidemesh.datatypes import BoundaryString, CoastalMesh
from tidemesh.errors import FormatError, InputError
from tidemesh.geometry.projection import Projection
from tidemesh.io.files import atomic

MESH = "mesh2d"
LONGITUDE, LATITUDE = "mesh2d_node_lon", "mesh2d_node_lat"
X, Y = "mesh2d_node_x", "mesh2d_node_y"
FACE_NODES = "mesh2d_face_nodes"
STRING_KINDS = ("open", "mainland", "island")
_OWN_ATTRIBUTES = {
    "_FillValue",
    "mesh",
    "location",
    "grid_mapping",
    "coordinates",
    "standard_name",
    "long_name",
    "units",
    "flag_values",
    "flag_meanings",
    "phase_variable",
    "amplitude_variable",
}


@dataclass(frozen=True, eq=False)
class Field:
    """Values on the nodes or the triangles of a mesh."""

    name: str
    """Variable name."""
    values: np.ndarray
    """(n_points,) or (n_triangles,); real, integer, bool or complex."""
    units: str
    """As UDUNITS writes them: "m", "m s-1", "1"."""
    long_name: str
    standard_name: str = ""
    """From the CF table, or empty."""
    location: Literal["", "node", "face"] = ""
    """Empty: by the length of the values, nodes first."""
    attributes: Mapping[str, float | str] = field(default_factory=dict)
    """Further attributes of the variable (of the amplitude of a complex one)."""


def write_ugrid(
    path: str | Path,
    mesh: CoastalMesh,
    fields: Sequence[Field] = (),
    *,
    title: str = "",
) -> None:
    """Write a mesh and fields on it; the same input gives the same bytes.

    Node coordinates are longitude and latitude, with the projected x and y beside them,
    or x and y alone for a mesh without projection. A complex field becomes two
    variables, ``name_amplitude`` and ``name_phase``, the phase a lag in degrees,
    0..360: value = amplitude * exp(-i * phase).

    Parameters
    ----------
    path : path
    mesh : CoastalMesh
        Its depth is written as ``depth``, positive down; its boundary strings as lists
        of nodes and as the node variable ``boundary_kind``.
    fields : sequence of Field
    title : str
        Global attribute.

    Raises
    ------
    ValueError
        If a field has the wrong length, or two have the same name.
    InputError
        If the file cannot be written.
    """
    locations = [_location(field, mesh) for field in fields]
    with atomic(path) as temporary:
        try:
            with netCDF4.Dataset(temporary, "w", format="NETCDF4") as file:
                file.setncatts(
                    {
                        "Conventions": "CF-1.11 UGRID-1.0",
                        "title": title or "Triangular mesh",
                        "source": f"tidemesh {__version__}",
                    }
                )
                file.createDimension("node", len(mesh.points))
                file.createDimension("face", len(mesh.triangles))
                file.createDimension("corner", 3)
                _write_mesh(file, mesh)
                _write_strings(file, mesh)
                for field, location in zip(fields, locations):
                    _write_field(file, mesh, field, location)
        except RuntimeError as error:
            # What the NetCDF library says when the disc is full.
            raise InputError(
                f"{path}: cannot be written ({error}); check the space left"
            ) from error


def read_ugrid(path: str | Path) -> tuple[CoastalMesh, dict[str, Field]]:
    """Read a triangular mesh and its fields.

    Reads what `write_ugrid` writes without loss, and triangular UGRID files of other
    makers that have a depth ("depth", or CF's sea_floor_depth_below_geoid); longitudes
    and latitudes without projected coordinates are mapped by ADCIRC's equirectangular
    map about the middle of the mesh.

    Returns
    -------
    mesh : CoastalMesh
    fields : dict
        By name, without the depth.

    Raises
    ------
    FormatError
        If the file is not NetCDF, or holds no triangular mesh or no depth.
    InputError
        If the file cannot be read.
    """
    path = Path(path)
    if not path.is_file():
        raise InputError(f"{path}: there is no such file; check the name")
    try:
        file = netCDF4.Dataset(path)
    except OSError as error:
        raise FormatError(f"not a NetCDF file ({error})", path) from error
    with file:
        file.set_auto_mask(False)
        name = _mesh_name(file, path)
        points, projection = _read_points(file, name, path)
        triangles = _read_triangles(file, name, path, len(points))
        depth_name = _depth_name(file, path)
        depth = _values(file[depth_name])
        if depth.shape != (len(points),):
            raise FormatError(
                f'"{depth_name}" has shape {depth.shape}; expected one depth for each '
                f"of the {len(points)} nodes",
                path,
            )
        fields = _read_fields(file, name, skip=depth_name)
        strings = _read_strings(file)
        mesh = CoastalMesh(points, triangles, depth, strings, projection)
    return mesh, fields


def _location(field: Field, mesh: CoastalMesh) -> str:
    sizes = {"node": len(mesh.points), "face": len(mesh.triangles)}
    shape = np.shape(field.values)
    for location, size in sizes.items():
        if shape == (size,) and field.location in ("", location):
            return location
    raise ValueError(
        f'field "{field.name}" must have {sizes["node"]} values (nodes) or '
        f"{sizes['face']} (triangles), got shape {shape}"
    )


def _variable(
    file: netCDF4.Dataset,
    name: str,
    values: np.ndarray,
    dimensions: tuple[str, ...],
    **attributes: object,
) -> None:
    values = np.asarray(values)
    if values.dtype == bool:
        # Not int8: QGIS (MDAL) refuses a file with byte-sized data on nodes.
        values = values.astype(np.int32)
        attributes["flag_values"] = np.array([0, 1], dtype=np.int32)
        attributes["flag_meanings"] = "false true"
    if name in file.variables:
        raise ValueError(f'there is already a variable of the name "{name}"')
    variable = file.createVariable(
        name,
        values.dtype,
        dimensions,
        compression="zlib" if dimensions else None,
        complevel=4,
        fill_value=np.nan if values.dtype.kind == "f" else False,
    )
    variable.setncatts(
        {key: value for key, value in attributes.items() if not _is_empty(value)}
    )
    variable[...] = values


def _is_empty(value: object) -> bool:
    return isinstance(value, str) and not value


def _on_mesh(mesh: CoastalMesh, location: str) -> dict[str, str]:
    attributes = {"mesh": MESH, "location": location}
    if mesh.projection.crs:
        attributes["grid_mapping"] = "wgs84"
    if location == "node":
        pair = (LONGITUDE, LATITUDE) if mesh.projection.crs else (X, Y)
        attributes["coordinates"] = " ".join(pair)
    return attributes


def _write_mesh(file: netCDF4.Dataset, mesh: CoastalMesh) -> None:
    projected = mesh.projection.crs != ""
    pair = (LONGITUDE, LATITUDE) if projected else (X, Y)
    topology = file.createVariable(MESH, "i4")
    topology.setncatts(
        {
            "cf_role": "mesh_topology",
            "long_name": "topology of the triangular mesh",
            "topology_dimension": np.int32(2),
            "node_coordinates": " ".join(pair),
            "face_node_connectivity": FACE_NODES,
            "node_dimension": "node",
            "face_dimension": "face",
        }
    )
    topology[...] = 0
    if projected:
        _write_projection(file, mesh)
    for column, (name, axis) in enumerate([(X, "x"), (Y, "y")]):
        _variable(
            file,
            name,
            mesh.points[:, column],
            ("node",),
            standard_name=f"projection_{axis}_coordinate",
            long_name=f"{axis} of the nodes",
            units="m",
        )
    _variable(
        file,
        FACE_NODES,
        mesh.triangles.astype(np.int32),
        ("face", "corner"),
        cf_role="face_node_connectivity",
        long_name="nodes of the triangles, counter-clockwise",
        start_index=np.int32(0),
    )
    _variable(
        file,
        "depth",
        mesh.depth,
        ("node",),
        standard_name="sea_floor_depth_below_geoid",
        long_name="depth below mean sea level",
        units="m",
        positive="down",
        **_on_mesh(mesh, "node"),
    )


def _write_projection(file: netCDF4.Dataset, mesh: CoastalMesh) -> None:
    place = mesh.projection.inverse(mesh.points)
    for column, (name, word, direction) in enumerate(
        [(LONGITUDE, "longitude", "east"), (LATITUDE, "latitude", "north")]
    ):
        _variable(
            file,
            name,
            place[:, column],
            ("node",),
            standard_name=word,
            long_name=f"{word} of the nodes",
            units=f"degrees_{direction}",
        )
    # The names under which QGIS and others look for the system of the coordinates. No
    # variable refers to "projection" as its grid mapping: readers take a mesh to have
    # one system only, and that is the longitude and latitude.
    geographic = {"EPSG_code": "EPSG:4326", **pyproj.CRS.from_epsg(4326).to_cf()}
    plane = pyproj.CRS.from_user_input(mesh.projection.crs).to_cf()
    plane["definition"] = mesh.projection.crs
    for name, attributes in [("wgs84", geographic), ("projection", plane)]:
        variable = file.createVariable(name, "i4")
        variable.setncatts(attributes)
        variable[...] = 0


def _write_strings(file: netCDF4.Dataset, mesh: CoastalMesh) -> None:
    strings = mesh.boundaries
    kind = np.zeros(len(mesh.points), dtype=np.int32)
    # Open strings last: they keep the end nodes that they share with the mainland.
    for code in (3, 2, 1):
        for string in strings:
            if string.kind == STRING_KINDS[code - 1]:
                kind[string.nodes] = code
    codes = np.arange(4, dtype=np.int32)
    _variable(
        file,
        "boundary_kind",
        kind,
        ("node",),
        long_name="boundary string that holds the node",
        flag_values=codes,
        flag_meanings=" ".join(("none", *STRING_KINDS)),
        **_on_mesh(mesh, "node"),
    )
    # A dimension of length 0 would be an unlimited one.
    if not strings:
        return
    file.createDimension("string", len(strings))
    file.createDimension("string_node", sum(len(string.nodes) for string in strings))
    across = ("string",)
    _variable(
        file,
        "string_count",
        np.array([len(string.nodes) for string in strings], dtype=np.int32),
        across,
        long_name="number of nodes of the boundary string",
        sample_dimension="string_node",
    )
    _variable(
        file,
        "string_kind",
        np.array(
            [STRING_KINDS.index(string.kind) + 1 for string in strings], dtype=np.int8
        ),
        across,
        long_name="kind of the boundary string",
        flag_values=codes[1:],
        flag_meanings=" ".join(STRING_KINDS),
    )
    _variable(
        file,
        "string_closed",
        np.array([string.closed for string in strings]),
        across,
        long_name="whether the boundary string is a whole ring",
    )
    _variable(
        file,
        "string_ibtype",
        np.array([string.ibtype for string in strings], dtype=np.int32),
        across,
        long_name="boundary type of ADCIRC (IBTYPE)",
    )
    _variable(
        file,
        "string_nodes",
        np.concatenate([string.nodes for string in strings]).astype(np.int32),
        ("string_node",),
        long_name="nodes of the boundary strings, one after another, water on the left",
        start_index=np.int32(0),
    )
    columns = [0 if s.extra is None else s.extra.shape[1] for s in strings]
    if any(columns):
        file.createDimension("string_column", max(columns))
        _variable(
            file,
            "string_columns",
            np.array(columns, dtype=np.int32),
            across,
            long_name="further values per node of the boundary string",
        )
        extra = np.full((sum(len(s.nodes) for s in strings), max(columns)), np.nan)
        first = 0
        for string, width in zip(strings, columns):
            if width:
                extra[first : first + len(string.nodes), :width] = string.extra
            first += len(string.nodes)
        _variable(
            file,
            "string_extra",
            extra,
            ("string_node", "string_column"),
            long_name="further columns of ADCIRC's boundary rows, nodes from 0",
        )


def _write_field(
    file: netCDF4.Dataset, mesh: CoastalMesh, field: Field, location: str
) -> None:
    values = np.asarray(field.values)
    common = _on_mesh(mesh, location)
    if not np.iscomplexobj(values):
        _variable(
            file,
            field.name,
            values,
            (location,),
            standard_name=field.standard_name,
            long_name=field.long_name,
            units=field.units,
            **common,
            **field.attributes,
        )
        return
    amplitude, phase = f"{field.name}_amplitude", f"{field.name}_phase"
    lag = np.degrees(-np.angle(values)) % 360.0
    _variable(
        file,
        amplitude,
        np.abs(values),
        (location,),
        standard_name=f"{field.standard_name}_amplitude" if field.standard_name else "",
        long_name=f"{field.long_name}, amplitude",
        units=field.units,
        phase_variable=phase,
        **common,
        **field.attributes,
    )
    _variable(
        file,
        phase,
        # The remainder of a tiny negative number is 360.
        np.where(lag >= 360.0, 0.0, lag),
        (location,),
        standard_name=f"{field.standard_name}_phase" if field.standard_name else "",
        long_name=f"{field.long_name}, Greenwich phase lag",
        units="degree",
        amplitude_variable=amplitude,
        **common,
    )


def _attribute(variable: netCDF4.Variable, name: str, default: object = "") -> object:
    return variable.getncattr(name) if name in variable.ncattrs() else default


def _values(variable: netCDF4.Variable) -> np.ndarray:
    """The values, NaN where a real number is missing."""
    values = variable[:]
    if values.dtype.kind == "f" and "_FillValue" in variable.ncattrs():
        values = np.where(values == variable.getncattr("_FillValue"), np.nan, values)
    return values


def _mesh_name(file: netCDF4.Dataset, path: Path) -> str:
    for name, variable in file.variables.items():
        if (
            _attribute(variable, "cf_role") == "mesh_topology"
            and int(_attribute(variable, "topology_dimension", 0)) == 2
        ):
            return name
    raise FormatError(
        "no two-dimensional mesh: expected a variable with the attribute "
        'cf_role = "mesh_topology" and topology_dimension = 2 (UGRID)',
        path,
    )


def _named(file: netCDF4.Dataset, name: str, path: Path) -> netCDF4.Variable:
    if name not in file.variables:
        raise FormatError(f'the mesh names a variable "{name}" that is missing', path)
    return file[name]


def _read_points(
    file: netCDF4.Dataset, mesh: str, path: Path
) -> tuple[np.ndarray, Projection]:
    names = str(_attribute(file[mesh], "node_coordinates")).split()
    by_meaning = {}
    for name in [*names, X, Y]:
        if name in file.variables:
            meaning = _attribute(file[name], "standard_name")
            by_meaning.setdefault(meaning, file[name][:].astype(np.float64))
    definition = ""
    for variable in file.variables.values():
        definition = definition or str(_attribute(variable, "definition"))
    plane = [by_meaning.get(f"projection_{axis}_coordinate") for axis in "xy"]
    place = [by_meaning.get(word) for word in ("longitude", "latitude")]
    if all(values is not None for values in plane) and (definition or None in place):
        return np.column_stack(plane), Projection(definition)
    if all(values is not None for values in place):
        longitude = np.where(place[0] > 180.0, place[0] - 360.0, place[0])
        if np.ptp(longitude) > 180.0:
            # The mesh lies across the date line.
            longitude = np.where(longitude < 0.0, longitude + 360.0, longitude)
        projection = Projection.equirectangular(
            round(float(longitude.min() + longitude.max()) / 2.0, 2),
            round(float(place[1].min() + place[1].max()) / 2.0, 2),
        )
        return projection.forward(longitude, place[1]), projection
    if len(names) == 2:
        pair = [_named(file, name, path)[:].astype(np.float64) for name in names]
        return np.column_stack(pair), Projection()
    raise FormatError(f'the mesh "{mesh}" has no node coordinates', path)


def _read_triangles(
    file: netCDF4.Dataset, mesh: str, path: Path, n_points: int
) -> np.ndarray:
    name = str(_attribute(file[mesh], "face_node_connectivity"))
    variable = _named(file, name, path)
    faces = variable[:].astype(np.int64)
    if faces.ndim != 2:
        raise FormatError(f'"{name}" must have two dimensions', path)
    if (
        faces.shape[0] == 3
        and _attribute(file[mesh], "face_dimension") == (variable.dimensions[1])
    ):
        faces = faces.T
    faces = faces - int(_attribute(variable, "start_index", 0))
    if faces.shape[1] != 3:
        raise FormatError(
            f'"{name}" has faces of up to {faces.shape[1]} nodes; only triangles can '
            "be read",
            path,
        )
    if len(faces) and (faces.min() < 0 or faces.max() >= n_points):
        raise FormatError(f'"{name}" names nodes that are missing', path)
    return faces


def _depth_name(file: netCDF4.Dataset, path: Path) -> str:
    for name, variable in file.variables.items():
        if _attribute(variable, "standard_name") == "sea_floor_depth_below_geoid":
            return name
    if "depth" in file.variables:
        return "depth"
    raise FormatError(
        'no depth: expected a variable "depth" on the nodes, positive down', path
    )


def _read_fields(file: netCDF4.Dataset, mesh: str, skip: str) -> dict[str, Field]:
    fields = {}
    for name, variable in file.variables.items():
        location = str(_attribute(variable, "location"))
        if (
            _attribute(variable, "mesh") != mesh
            or location not in ("node", "face")
            or variable.ndim != 1
            or name in (skip, "boundary_kind")
            or "amplitude_variable" in variable.ncattrs()
        ):
            continue
        values = _values(variable)
        long_name = str(_attribute(variable, "long_name"))
        standard_name = str(_attribute(variable, "standard_name"))
        phase = str(_attribute(variable, "phase_variable"))
        if phase in file.variables:
            name = name.removesuffix("_amplitude")
            long_name = long_name.removesuffix(", amplitude")
            standard_name = standard_name.removesuffix("_amplitude")
            values = values * np.exp(-1j * np.radians(file[phase][:]))
        elif _attribute(variable, "flag_meanings") == "false true":
            values = values.astype(bool)
        units = str(_attribute(variable, "units"))
        more = {
            key: variable.getncattr(key)
            for key in variable.ncattrs()
            if key not in _OWN_ATTRIBUTES
        }
        fields[name] = Field(
            name, values, units, long_name, standard_name, location, more
        )
    return fields


def _read_strings(file: netCDF4.Dataset) -> tuple[BoundaryString, ...]:
    if "string_nodes" not in file.variables:
        return ()
    cuts = np.cumsum(file["string_count"][:])[:-1]
    nodes = np.split(file["string_nodes"][:].astype(np.int64), cuts)
    extras = [None] * len(nodes)
    if "string_extra" in file.variables:
        parts = np.split(file["string_extra"][:], cuts)
        widths = file["string_columns"][:]
        extras = [part[:, :n] if n else None for part, n in zip(parts, widths)]
    return tuple(
        BoundaryString(STRING_KINDS[kind - 1], run, bool(closed), int(ibtype), extra)
        for kind, run, closed, ibtype, extra in zip(
            file["string_kind"][:],
            nodes,
            file["string_closed"][:],
            file["string_ibtype"][:],
            extras,
        )
    )
