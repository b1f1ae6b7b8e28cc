"""What a modeller wants to know about a mesh before running it."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

import numpy as np

from tidemesh.datatypes import CoastalMesh
from tidemesh.errors import InputError
from tidemesh.geometry.projection import Projection
from tidemesh.io.fort14 import read_fort14
from tidemesh.io.ugrid import read_ugrid
from tidemesh.triangulation import quality, topology

_NETCDF = (".nc", ".nc4", ".cdf")


def read_mesh(path: str | Path) -> CoastalMesh:
    """Read a mesh by the ending of its name: NetCDF is UGRID, all else fort.14.

    Raises
    ------
    InputError
        If the file is missing or not of its format.
    """
    path = Path(path)
    if not path.is_file():
        raise InputError(f"{path}: no such mesh file")
    if path.suffix.lower() in _NETCDF:
        return read_ugrid(path)[0]
    return read_fort14(path)


def goes_round_the_globe(mesh: CoastalMesh) -> bool:
    """Whether the map tears triangles apart: no flat map holds the mesh."""
    if not mesh.projection.crs:
        return False
    longitude = mesh.projection.inverse(mesh.points)[:, 0]
    return bool(np.ptp(longitude[mesh.triangles], axis=1).max() > 180.0)


def on_a_conformal_map(mesh: CoastalMesh) -> CoastalMesh:
    """The same mesh with true angles: ADCIRC's own map stretches them off its middle.

    On the stereographic map lengths are right to 0.1 % within 800 km of the middle.
    """
    if not mesh.projection.crs:
        return mesh
    places = mesh.projection.inverse(mesh.points)
    middle = 0.5 * (places.min(axis=0) + places.max(axis=0))
    projection = Projection.stereographic(*middle.tolist())
    points = projection.forward(*places.T)
    return dataclasses.replace(mesh, points=points, projection=projection)


def describe_mesh(path: str | Path) -> dict[str, Any]:
    """Size, extent, depths, boundaries, quality and faults of a mesh file."""
    mesh = on_a_conformal_map(read_mesh(path))
    problems = topology.check_mesh(
        mesh.points, mesh.triangles, mesh.depth, mesh.boundaries
    )
    edge = topology.edges(mesh.triangles)
    length = np.linalg.norm(mesh.points[edge[:, 1]] - mesh.points[edge[:, 0]], axis=1)
    places = mesh.projection.inverse(mesh.points)
    low, high = places.min(axis=0), places.max(axis=0)
    return {
        "file": str(path),
        "nodes": len(mesh.points),
        "elements": len(mesh.triangles),
        "coordinates": "degrees" if mesh.projection.crs else "metres",
        "extent": [*low.tolist(), *high.tolist()],
        "area_km2": float(quality.area(mesh.points, mesh.triangles).sum() / 1e6),
        "depth_m": [float(mesh.depth.min()), float(mesh.depth.max())],
        "edge_length_m": [float(length.min()), float(length.max())],
        "boundaries": [
            {
                "kind": string.kind,
                "nodes": len(string.nodes),
                "ibtype": int(string.ibtype),
            }
            for string in mesh.boundaries
        ],
        "quality": quality.quality_summary(mesh.points, mesh.triangles),
        "problems": [str(problem) for problem in problems],
    }


def format_description(description: dict[str, Any]) -> str:
    """The same as lines of text."""
    strings = description["boundaries"]
    count = {
        kind: [s for s in strings if s["kind"] == kind]
        for kind in ("open", "mainland", "island")
    }
    west, south, east, north = description["extent"]
    figure = description["quality"]
    lines = [
        description["file"],
        f"  nodes        {description['nodes']}",
        f"  elements     {description['elements']}",
        f"  extent       {west:.5g} .. {east:.5g}, {south:.5g} .. {north:.5g} "
        f"{description['coordinates']}",
        f"  area         {description['area_km2']:.6g} km2",
        "  depth        {:.4g} .. {:.4g} m".format(*description["depth_m"]),
        "  edges        {:.4g} .. {:.4g} m".format(*description["edge_length_m"]),
        *(
            f"  {kind:<12} {len(found)} strings, {sum(s['nodes'] for s in found)} nodes"
            for kind, found in count.items()
        ),
        f"  quality q    mean {figure['quality_mean']:.3f}, "
        f"min {figure['quality_minimum']:.3f}",
    ]
    lines += [f"  FAULT        {problem}" for problem in description["problems"]]
    lines += [] if description["problems"] else ["  no faults found"]
    return "\n".join(lines)
