"""An existing model measured and meshed again: its mesh and tide to error and sizes."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from tidemesh.basegrid.settings import DepthSettings
from tidemesh.datatypes import CoastalMesh, Domain, TideSolution
from tidemesh.errors import InputError, MeshError
from tidemesh.hierarchy.settings import HierarchySettings
from tidemesh.improve.settings import ImproveSettings
from tidemesh.io.domain_geojson import write_domain
from tidemesh.pipeline import stages
from tidemesh.pipeline.case import OutputSettings, apply_overrides, decode_case
from tidemesh.pipeline.info import (
    goes_round_the_globe,
    on_a_conformal_map,
    read_mesh,
)
from tidemesh.pipeline.runner import Context, Reporter, Run, Stage, run_stages
from tidemesh.pipeline.solution import find_solution, read_solution
from tidemesh.sizing.settings import SizingSettings
from tidemesh.tides.adcirc.settings import AdcircSettings
from tidemesh.tides.settings import TideSettings
from tidemesh.triangulation import quality, topology
from tidemesh.triangulation.domain import domain_from_mesh
from tidemesh.truncation.settings import TruncationSettings

_STRICT = {"frozen": True, "kw_only": True, "forbid_unknown_fields": True}


class ExistingCase(msgspec.Struct, **_STRICT):
    """What decides how an existing model is measured and meshed again."""

    title: str = ""
    tide: TideSettings = TideSettings()
    adcirc: AdcircSettings = AdcircSettings()
    depth: DepthSettings = DepthSettings(sources=())
    truncation: TruncationSettings = TruncationSettings()
    sizing: SizingSettings = SizingSettings()
    hierarchy: HierarchySettings = HierarchySettings()
    improve: ImproveSettings = ImproveSettings()
    output: OutputSettings = OutputSettings()


def estimate(
    mesh: str | Path,
    solution: str | Path,
    *,
    output: str | Path,
    remesh: bool = False,
    overrides: Sequence[str] = (),
    reporter: Reporter | None = None,
) -> Run:
    """Measure where a tide model errs, choose sizes, and mesh it again if wanted.

    Parameters
    ----------
    mesh : path
        fort.14 or UGRID.
    solution : path
        fort.53 (with the fort.54 beside it), NetCDF of this program, or a folder.
    output : path
        Folder of the results: ``error.nc`` and ``size.nc``; with ``remesh`` also
        ``mesh.14``, ``mesh.nc``, the tide on it and figures.
    remesh : bool
    overrides : sequence of "section.key=value"
    reporter : Reporter, optional

    Returns
    -------
    Run

    Raises
    ------
    InputError
        If a file or value cannot be used, or mesh and solution do not match.
    """
    data: dict[str, Any] = {"title": Path(mesh).stem}
    apply_overrides(data, overrides)
    case = decode_case(data, kind=ExistingCase, name="--set")
    path = Path(mesh)
    if not path.is_file():
        raise InputError(f"{path}: no such mesh file")
    files = {"mesh": path, "solution": find_solution(solution)}
    steps = STAGES
    if remesh and case.output.figures:
        # Loads matplotlib, which takes longer than a small mesh.
        from tidemesh.pipeline.figures import FIGURES

        steps = (*STAGES, _adapted(FIGURES))
    return run_stages(
        steps,
        case,
        files,
        Path(output),
        until=None if remesh else "sizing",
        reporter=reporter,
    )


# ---- stages ---------------------------------------------------------------------


def take_domain(context: Context) -> Domain:
    """The water body that the mesh covers."""
    mesh = _given_mesh(context)
    path = context.files["mesh"]
    try:
        domain = domain_from_mesh(mesh)
    except MeshError as error:
        raise InputError(f"{path}: {error}") from None
    context.report["domain"] = {
        "boundary_nodes": sum(len(ring.points) for ring in domain.rings),
        "islands": len(domain.rings) - 1,
    }
    write_domain(context.path("domain.geojson"), domain)
    return domain


def take_mesh(context: Context) -> CoastalMesh:
    """The mesh of the model, its depths no less than the minimum."""
    mesh = _given_mesh(context)
    topology.require_valid(mesh.points, mesh.triangles, mesh.depth)
    minimum = context.case.depth.minimum_m
    context.report["base_grid"] = {
        "nodes": len(mesh.points),
        "elements": len(mesh.triangles),
        "depth_m": [float(mesh.depth.min()), float(mesh.depth.max())],
        "depths_raised": int((mesh.depth < minimum).sum()),
        "quality": quality.quality_summary(mesh.points, mesh.triangles),
    }
    return dataclasses.replace(mesh, depth=np.maximum(mesh.depth, minimum))


def take_tide(context: Context) -> TideSolution:
    """The solution of the model on its mesh."""
    mesh = context["base_grid"]
    _, tide = read_solution(context.files["solution"], mesh, context.case.tide)
    context.report["base_tide"] = {
        name: {"largest_amplitude_m": float(np.abs(tide.elevation[c]).max())}
        for c, name in enumerate(tide.names)
    }
    return tide


def _given_mesh(context: Context) -> CoastalMesh:
    path = context.files["mesh"]
    mesh = read_mesh(path)
    if goes_round_the_globe(mesh):
        raise InputError(
            f"{path}: the mesh goes round the globe; sizes are chosen on a flat map, "
            "so cut out the ocean that matters"
        )
    return on_a_conformal_map(mesh)


def _adapted(stage: Stage) -> Stage:
    """A stage of the full case, without the sections that this case has not."""
    kept = tuple(
        s for s in stage.sections if hasattr(ExistingCase, s.partition(".")[0])
    )
    return dataclasses.replace(stage, sections=kept)


STAGES = (
    Stage("domain", take_domain, (), ("mesh",)),
    Stage("base_grid", take_mesh, ("depth",), ("mesh",)),
    Stage("tide", take_tide, ("tide",), ("mesh", "solution"), ("base_grid",)),
    *(
        _adapted(stage)
        for stage in stages.STAGES
        if stage.name in ("truncation", "sizing", "mesh", "check")
    ),
)
