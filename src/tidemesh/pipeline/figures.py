"""The figures of a run."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from tidemesh import plots
from tidemesh.pipeline.runner import Context, Stage
from tidemesh.pipeline.stages import read_land


def draw_figures(context: Context) -> dict[str, Any]:
    """Draw every figure into ``figures/``."""
    draws = _drawings(context)
    for number, (name, draw) in enumerate(draws.items(), start=1):
        path = context.path(f"figures/{name}.png")
        plots.save_figure(path, draw, dpi=context.case.output.resolution_dpi)
        context.progress(number / len(draws))
    context.report["figures"] = list(draws)
    return {}


def _drawings(context: Context) -> Mapping[str, Callable]:
    domain, base, mesh = context["domain"], context["base_grid"], context["mesh"]
    tide, check = context["tide"], context["check"]
    sizes = context["sizing"]["field"]
    published = context.case.sizing.rule == "truncation_error"
    kind, label = (
        ("error", "truncation error (m/s²)")
        if published
        else ("interpolation_error", "interpolation error of elevation (m)")
    )
    before, after = context["truncation"][kind], check[kind]
    draws: dict[str, Callable] = {
        "domain": lambda axis: plots.depth_contours(base, axis=axis),
        "boundary_strings": lambda axis: plots.boundary_strings(mesh, axis=axis),
        "sizes": lambda axis: plots.size_map(sizes, mesh=base, axis=axis),
        "mesh": lambda axis: plots.mesh_map(mesh, axis=axis),
        "quality": lambda axis: plots.quality_histogram(mesh, axis=axis),
    }
    if "domain.shoreline" in context.files:
        land = read_land(context, repairs=[])
        draws["boundary"] = lambda axis: plots.boundary_before_after(
            land, domain, axis=axis
        )
    for c, name in enumerate(tide.names):
        draws[f"tide_{name}"] = lambda axis, name=name: plots.cotidal_chart(
            base, tide, name, axis=axis
        )
        draws[f"error_{name}"] = lambda axis, c=c: plots.error_before_after(
            base, before[c], mesh, after[c], label=label, axis=axis
        )
    return draws


FIGURES = Stage(
    "figures",
    draw_figures,
    ("domain", "sizing", "output"),
    ("domain.",),
    ("domain", "base_grid", "tide", "truncation", "sizing", "mesh", "check"),
)
