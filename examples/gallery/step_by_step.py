"""The steps of the method one by one, on the island case.

What `tidemesh run` does, without files in between: each object is plain data, each
step one function. The number at the end is right if the budget is met within 1 %.
"""

from __future__ import annotations

from pathlib import Path

import tidemesh
from tidemesh import basegrid, sizing, truncation
from tidemesh.datatypes import CoastalMesh
from tidemesh.io.tide_tables import read_tide_table
from tidemesh.triangulation.domain import boundary_strings
from tidemesh.triangulation.locate import as_function

FOLDER = Path(__file__).parents[1] / "island"


def main() -> CoastalMesh:
    """Mesh the island case; returns the mesh."""
    case = tidemesh.read_case(FOLDER / "island.toml")

    # 3.1 Shoreline to domain.
    land = tidemesh.read_shoreline(FOLDER / case.domain.shoreline, case.domain.box_deg)
    domain = tidemesh.build_domain(land, case.domain)

    # 3.2 Base grid with depths.
    sources = basegrid.read_sources(domain, case.depth, folder=FOLDER)
    base, _ = tidemesh.build_base_grid(domain, sources, case.base_grid, case.depth)

    # 2.2 The M2 tide on it.
    table = read_tide_table(FOLDER / case.forcing.table)
    forcing = tidemesh.boundary_forcing(base, table, case.tide.constituents)
    tide = tidemesh.solve_tide(base, forcing, case.tide)

    # 3.3 and 3.4 Its curvature, and the sizes that spread it over 800 nodes.
    curvature = truncation.hessian_magnitude(
        base.points, base.triangles, tide.elevation
    )
    inputs = sizing.RuleInputs(base, tide.frequency, curvature=curvature)
    rule = sizing.build_rule(inputs, case.sizing)
    sizes = sizing.size_builder(base, rule, case.sizing)

    def count(level: float) -> int:
        spacing = as_function(sizes(level))
        return tidemesh.select_points(domain, spacing, case.hierarchy).n_points

    level = sizing.choose_level(base, rule, sizes, case.sizing, count=count).value

    # 3.5 Nodes, triangles, smoothing, depths.
    selection = tidemesh.select_points(
        domain, as_function(sizes(level)), case.hierarchy
    )
    points, triangles, _ = tidemesh.improve_mesh(
        selection.domain,
        selection.interior,
        selection.spacing,
        case.improve,
        nodes=case.sizing.nodes,
    )
    depth, _ = basegrid.sample_depths(points, domain.projection, sources, case.depth)
    strings = boundary_strings(selection.domain)
    return CoastalMesh(points, triangles, depth, strings, domain.projection)


if __name__ == "__main__":
    mesh = main()
    print(len(mesh.points), "nodes")
