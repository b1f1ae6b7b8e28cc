"""The stages of the method, from shoreline to figures (paper, sections 3.1 to 3.5)."""

from __future__ import annotations

import dataclasses
import math
from typing import Any

import msgspec
import numpy as np

from tidemesh import basegrid, boundary, hierarchy, improve, sizing, truncation
from tidemesh.basegrid.volume import volume_corrected
from tidemesh.datatypes import (
    CoastalMesh,
    Domain,
    LedgerEntry,
    SizeField,
    TideSolution,
)
from tidemesh.geometry.polygons import ring_area
from tidemesh.io.domain_geojson import write_domain
from tidemesh.io.fort14 import write_fort14
from tidemesh.io.shoreline import read_polygon, read_shoreline
from tidemesh.io.tide_tables import read_tide_table
from tidemesh.io.ugrid import Field, write_ugrid
from tidemesh.pipeline.case import Case
from tidemesh.pipeline.compare import compare_with_base, compare_with_gauges
from tidemesh.pipeline.runner import Context, Stage
from tidemesh.pipeline.tide import (
    boundary_of,
    make_forcing,
    placed,
    solve_tide,
    tide_fields,
)
from tidemesh.triangulation import domain as domain_mesh
from tidemesh.triangulation import locate, quality, topology

# ---- 1. domain (section 3.1) ----------------------------------------------------


def make_domain(context: Context) -> Domain:
    """Shoreline to typed rings of water."""
    settings = context.case.domain
    repairs: list[LedgerEntry] = []
    land = read_land(context, repairs)
    context.progress(0.3)
    region_land = [
        read_shoreline(
            context.files[key],
            box_deg=_extent(region.polygon_deg),
            land_on=settings.land_on,
            repair=settings.repair,
            ledger=repairs,
        )
        if (key := f"domain.regions[{index}].shoreline") in context.files
        else None
        for index, region in enumerate(settings.regions)
    ]
    drawn = context.files.get("domain.ocean.file")
    domain = boundary.build_domain(
        land,
        settings,
        region_land,
        drawn_ocean=None if drawn is None else read_polygon(drawn),
        repairs=repairs,
    )
    counts: dict[str, int] = {}
    areas: dict[str, float] = {}
    for entry in domain.ledger:
        counts[entry.action] = counts.get(entry.action, 0) + 1
        areas[entry.action] = areas.get(entry.action, 0.0) + entry.area_m2 / 1e6
    context.report["domain"] = {
        "boundary_nodes": sum(len(ring.points) for ring in domain.rings),
        "islands": len(domain.rings) - 1,
        "area_km2": sum(ring_area(ring.points) for ring in domain.rings) / 1e6,
        "ledger": counts,
        "ledger_area_km2": areas,
    }
    write_domain(context.path("domain.geojson"), domain)
    return domain


def _extent(polygon_deg) -> tuple[float, float, float, float]:
    """West, south, east, north of a polygon (degrees)."""
    longitudes, latitudes = zip(*polygon_deg)
    return min(longitudes), min(latitudes), max(longitudes), max(latitudes)


def read_land(context: Context, repairs: list[LedgerEntry]):
    """Land polygons of the case, in degrees; repairs are added to the list."""
    settings = context.case.domain
    return read_shoreline(
        context.files["domain.shoreline"],
        box_deg=settings.box_deg,
        layer=settings.layer,
        land_on=settings.land_on,
        repair=settings.repair,
        ledger=repairs,
    )


# ---- 2. base grid (section 3.2) -------------------------------------------------


def make_base_grid(context: Context) -> CoastalMesh:
    """Rings to a fine grid with depths."""
    case = context.case
    domain = context["domain"]
    sources = basegrid.read_sources(domain, case.depth, folder=context.folder)
    context.progress(0.2)
    mesh, depths = basegrid.build_base_grid(
        domain, sources, case.base_grid, case.depth, progress=context.progress
    )
    context.report["base_grid"] = {
        "nodes": len(mesh.points),
        "elements": len(mesh.triangles),
        "depth_m": _range(mesh.depth),
        "depths": _plain(depths),
        "quality": quality.quality_summary(mesh.points, mesh.triangles),
    }
    write_ugrid(context.path("base_mesh.nc"), mesh, (), title=case.title)
    return mesh


# ---- 3. tide (sections 2.2 and 3.3) ---------------------------------------------


def solve_base_tide(context: Context) -> TideSolution:
    """Base grid to complex elevation and velocity."""
    mesh = context["base_grid"]
    tide, context.report["base_tide"] = _solve(context, mesh, "base")
    write_ugrid(
        context.path("tide.nc"), mesh, tide_fields(mesh, tide), title=context.case.title
    )
    return tide


def _solve(
    context: Context, mesh: CoastalMesh, name: str
) -> tuple[TideSolution, dict[str, Any]]:
    case, files = context.case, context.files
    if hasattr(case, "forcing"):
        forcing, fitted = make_forcing(mesh, case.tide, case.forcing, files)
    else:
        # An existing model: its own solution along the new ocean boundary.
        forcing, fitted = boundary_of(context["tide"], context["base_grid"], mesh), {}
    tide, report = solve_tide(
        mesh,
        forcing,
        case.tide,
        adcirc=placed(case.adcirc, files),
        folder=context.output / "adcirc" / name,
        friction_file=files.get("tide.friction_file"),
        progress=context.progress,
    )
    return tide, {**report, **fitted}


# ---- 4. truncation error (section 3.3) ------------------------------------------


def measure_error(context: Context) -> dict[str, Any]:
    """Tide to the truncation error series and the curvature of the elevation."""
    mesh, tide = context["base_grid"], context["tide"]
    settings = context.case.truncation
    series = truncation.momentum_series(mesh, tide, settings)
    context.progress(0.7)
    curvature = truncation.hessian_magnitude(
        mesh.points, mesh.triangles, tide.elevation
    )
    spacing = base_spacing(context)
    error = truncation.error_at(series, spacing)
    known = np.isfinite(error).all(axis=0) & series.known
    context.report["truncation"] = {
        "known_nodes": int(series.known.sum()),
        "peak_error_m_s2": float(error[:, known].max()) if known.any() else None,
        "median_error_m_s2": float(np.median(error[:, known])) if known.any() else None,
        "spacing_m": _range(spacing),
    }
    fields = error_fields(tide, error, "the base spacing")
    fields += [
        Field(
            f"curvature_{name}",
            curvature[c],
            "m-1",
            f"size of the second derivatives of the {name} elevation",
        )
        for c, name in enumerate(tide.names)
    ]
    write_ugrid(context.path("error.nc"), mesh, fields, title=context.case.title)
    return {
        "series": series,
        "curvature": curvature,
        "error": error,
        "interpolation_error": interpolation_error(curvature, spacing),
    }


def error_fields(tide: TideSolution, error: np.ndarray, where: str) -> list[Field]:
    """Truncation error (n_c, n_points) of every constituent, as fields to write."""
    return [
        Field(
            f"truncation_error_{name}",
            error[c],
            "m s-2",
            f"{name} truncation error at {where}",
        )
        for c, name in enumerate(tide.names)
    ]


def interpolation_error(curvature: np.ndarray, spacing: np.ndarray) -> np.ndarray:
    """Bound on the error (m) of linear interpolation on equilateral triangles.

    Half the curvature times the squared circumradius, spacing / sqrt(3).
    """
    return curvature * spacing**2 / 6.0


def base_spacing(context: Context) -> np.ndarray:
    """Spacing of the base grid (m) at its nodes: the lattice's, or that of its edges.

    On the lattice all nodes have the same, as the paper has its 900 m.
    """
    mesh = context["base_grid"]
    grid = getattr(context.case, "base_grid", None)
    if grid is None:
        return node_spacing(mesh.points, mesh.triangles)
    if grid.kind == "hexagonal" or context.case.truncation.lattice_spacing_m:
        spacing = context.case.truncation.lattice_spacing_m or grid.spacing_m
        return np.full(len(mesh.points), float(spacing))
    return node_spacing(mesh.points, mesh.triangles)


def node_spacing(points: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """Mean length (m) of the edges at every node: (n_points,)."""
    edge = topology.edges(triangles)
    length = np.linalg.norm(points[edge[:, 1]] - points[edge[:, 0]], axis=1)
    total = np.bincount(edge.ravel(), np.repeat(length, 2), len(points))
    return total / np.maximum(np.bincount(edge.ravel(), minlength=len(points)), 1)


# ---- 5. sizes (section 3.4) -----------------------------------------------------


def choose_sizes(context: Context) -> dict[str, Any]:
    """Error to the allowed spacing that meets the tolerance or the node budget."""
    case = context.case
    mesh, domain = context["base_grid"], context["domain"]
    measured = context["truncation"]
    settings = case.sizing
    inputs = sizing.RuleInputs(
        mesh,
        context["tide"].frequency,
        series=measured["series"],
        curvature=measured["curvature"],
    )
    rule = sizing.build_rule(inputs, settings)
    sizes = sizing.size_builder(mesh, rule, settings)

    calls = 0

    def count(level: float) -> int:
        nonlocal calls
        calls += 1
        context.progress(1.0 - 0.85**calls)
        return place_nodes(case, domain, mesh, sizes(level)).n_points

    level = sizing.choose_level(
        mesh,
        rule,
        sizes,
        settings,
        count=count if settings.tolerance == "nodes" else None,
        base_spacing=base_spacing(context),
        series=measured["series"],
    ).value
    field = sizes(level)
    asked = rule(level)
    context.report["sizing"] = {
        "rule": settings.rule,
        "level": level,
        "rule_spacing_m": _range(asked[np.isfinite(asked)]),
        "spacing_m": _range(field.spacing),
        "expected_nodes": sizing.expected_nodes(field),
    }
    fields = [Field("spacing", field.spacing, "m", "allowed node spacing")]
    write_ugrid(context.path("size.nc"), mesh, fields, title=case.title)
    return {"field": field, "level": level}


# ---- 6. mesh (section 3.5) ------------------------------------------------------


def make_mesh(context: Context) -> CoastalMesh:
    """Sizes to the finished mesh: hierarchy, Delaunay, smoothing, depths, strings."""
    case = context.case
    base, field = context["base_grid"], context["sizing"]["field"]
    selection = place_nodes(case, context["domain"], base, field)
    context.progress(0.3)
    points, triangles, improved = improve.improve_mesh(
        selection.domain,
        selection.interior,
        selection.spacing,
        case.improve,
        nodes=case.sizing.nodes if case.sizing.tolerance == "nodes" else None,
    )
    domain = selection.domain
    context.progress(0.6)
    spacing = node_spacing(points, triangles)
    if case.depth.sources:
        sources = basegrid.read_sources(domain, case.depth, folder=context.folder)
        depth, depths = basegrid.sample_depths(
            points,
            domain.projection,
            sources,
            case.depth,
            spacing=spacing,
            triangles=triangles,
        )
    else:
        depth, depths = depths_of(base, points, triangles), {}
    mesh = CoastalMesh(
        points,
        triangles,
        depth,
        domain_mesh.boundary_strings(domain),
        domain.projection,
    )
    topology.require_valid(
        mesh.points,
        mesh.triangles,
        mesh.depth,
        mesh.boundaries,
        minimum_depth=case.depth.minimum_m,
    )
    context.progress(0.8)
    target = selection.spacing(points)
    edge = topology.edges(triangles)
    length = np.linalg.norm(points[edge[:, 1]] - points[edge[:, 0]], axis=1)
    ratio = length / target[edge].mean(axis=1)
    context.report.update(
        {
            "nodes": len(points),
            "elements": len(triangles),
            "boundary_strings": {
                kind: sum(b.kind == kind for b in mesh.boundaries)
                for kind in ("open", "mainland", "island")
            },
            "depth_m": _range(depth),
            "edge_length_m": _range(length),
            "quality": quality.quality_summary(points, triangles),
            "edges_within_sqrt2_of_target": float(
                ((ratio >= math.sqrt(0.5)) & (ratio <= math.sqrt(2.0))).mean()
            ),
            "depths": _plain(depths),
            "placement": _plain(selection.report),
            "improvement": _plain(improved),
        }
    )
    fields = [Field("spacing", target, "m", "allowed node spacing")]
    write_ugrid(context.path("mesh.nc"), mesh, fields, title=case.title)
    write_fort14(context.path("mesh.14"), mesh, title=case.title or "tidemesh")
    return mesh


def depths_of(
    base: CoastalMesh, points: np.ndarray, triangles: np.ndarray
) -> np.ndarray:
    """Depths (m) of another mesh at new nodes, the water volume kept."""
    locator = locate.Locator(base.points, base.triangles)
    depth = locator.interpolate(base.depth, points)
    spacing = node_spacing(base.points, base.triangles)

    def bed(places: np.ndarray, _: np.ndarray) -> np.ndarray:
        return locator.interpolate(base.depth, places)

    depth = volume_corrected(points, triangles, depth, bed, float(spacing.min()))
    # Rounding must not take a depth below the least one.
    return np.clip(depth, base.depth.min(), base.depth.max())


def place_nodes(
    case: Case, domain: Domain, base: CoastalMesh, field: SizeField
) -> hierarchy.Selection:
    """Nodes on the boundary and inside that follow a size field."""
    kept = None
    if case.hierarchy.near_shore == "keep":
        # The ring points come first; what is kept of the base grid lies inside.
        kept = base.points[sum(len(ring.points) for ring in domain.rings) :]
    return hierarchy.select_points(
        domain, locate.as_function(field), case.hierarchy, near_shore_points=kept
    )


# ---- 7. check: the tide on the mesh ---------------------------------------------


def check_mesh_tide(context: Context) -> dict[str, Any]:
    """Solve the tide again on the mesh; set it beside the base grid and the gauges."""
    base, base_tide = context["base_grid"], context["tide"]
    mesh = context["mesh"]
    tide, context.report["tide"] = _solve(context, mesh, "mesh")
    context.progress(0.5)
    series = truncation.momentum_series(mesh, tide, _least_squares(context.case))
    spacing = node_spacing(mesh.points, mesh.triangles)
    error = truncation.error_at(series, spacing)
    curvature = truncation.hessian_magnitude(
        mesh.points, mesh.triangles, tide.elevation
    )
    context.progress(0.9)
    context.report["against_base_grid"] = compare_with_base(
        base,
        base_tide,
        mesh,
        tide,
        boundary.distance_to_land(context["domain"], base.points),
        context.case.hierarchy.strip_width_m,
    )
    if "forcing.gauges" in context.files:
        table = read_tide_table(context.files["forcing.gauges"])
        context.report["gauges"] = compare_with_gauges(mesh, tide, table)
    fields = tide_fields(mesh, tide) + error_fields(
        tide, error, "the spacing of the mesh"
    )
    write_ugrid(context.path("mesh_tide.nc"), mesh, fields, title=context.case.title)
    return {
        "tide": tide,
        "error": error,
        "interpolation_error": interpolation_error(curvature, spacing),
    }


def _least_squares(case: Case):
    # A graded mesh has no lattice for the published molecules.
    return msgspec.structs.replace(case.truncation, derivatives="least_squares")


# ---- small helpers --------------------------------------------------------------


def _range(values: np.ndarray) -> list[float]:
    return [float(np.min(values)), float(np.max(values))]


def _plain(report: Any) -> Any:
    """Dataclasses and named tuples as dictionaries, arrays left out."""
    if dataclasses.is_dataclass(report):
        report = {f.name: getattr(report, f.name) for f in dataclasses.fields(report)}
    elif hasattr(report, "_asdict"):
        report = report._asdict()
    if isinstance(report, dict):
        return {
            str(k): _plain(v)
            for k, v in report.items()
            if not isinstance(v, np.ndarray)
        }
    if isinstance(report, list | tuple):
        return [_plain(v) for v in report]
    if isinstance(report, np.generic):
        return report.item()
    return report


_TIDE_FILES = (
    "forcing.table",
    "forcing.atlas",
    "forcing.from_gauges",
    "tide.friction_file",
    "adcirc.batch_template",
)

STAGES = (
    Stage("domain", make_domain, ("domain",), ("domain.",)),
    Stage(
        "base_grid",
        make_base_grid,
        ("title", "domain", "base_grid", "depth"),
        ("depth.",),
        ("domain",),
    ),
    Stage(
        "tide",
        solve_base_tide,
        ("title", "tide", "adcirc", "forcing.atlas", "forcing.from_gauges"),
        _TIDE_FILES,
        ("base_grid",),
    ),
    Stage(
        "truncation",
        measure_error,
        ("title", "truncation", "base_grid"),
        (),
        ("base_grid", "tide"),
    ),
    Stage(
        "sizing",
        choose_sizes,
        ("title", "base_grid", "truncation", "sizing", "hierarchy"),
        (),
        ("domain", "base_grid", "tide", "truncation"),
    ),
    Stage(
        "mesh",
        make_mesh,
        ("title", "domain", "sizing", "hierarchy", "improve", "depth"),
        ("depth.",),
        ("domain", "base_grid", "sizing"),
    ),
    Stage(
        "check",
        check_mesh_tide,
        (
            "title",
            "tide",
            "adcirc",
            "forcing.atlas",
            "forcing.from_gauges",
            "truncation",
            "hierarchy",
        ),
        (*_TIDE_FILES, "forcing.gauges"),
        ("domain", "base_grid", "tide", "mesh"),
    ),
)
