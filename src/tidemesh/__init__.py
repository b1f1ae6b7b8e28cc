"""Meshes for tide models, sized by tidal truncation error.

The public names, in the order of the method::

    case = tidemesh.read_case("case.toml")
    result = tidemesh.run_case("case.toml", output="out")

    land = tidemesh.read_shoreline("shoreline.geojson")
    domain = tidemesh.build_domain(land, case.domain)
    base, depths = tidemesh.build_base_grid(domain, sources, case.base_grid, case.depth)
    tide = tidemesh.solve_tide(base, forcing, case.tide)
    series = tidemesh.momentum_series(base, tide, case.truncation)
    sizes = tidemesh.allowable_sizes(base, rule, level, case.sizing)
    selection = tidemesh.select_points(domain, spacing, case.hierarchy)
    points, triangles, report = tidemesh.improve_mesh(selection.domain, ...)
    tidemesh.write_fort14("mesh.14", mesh)
"""

from __future__ import annotations

import importlib
from typing import Any

__version__ = "0.1.0"

_WHERE = {
    "read_case": "tidemesh.pipeline.case",
    "run_case": "tidemesh.pipeline.run",
    "read_shoreline": "tidemesh.io.shoreline",
    "build_domain": "tidemesh.boundary",
    "build_base_grid": "tidemesh.basegrid",
    "boundary_forcing": "tidemesh.tides.forcing",
    "solve_tide": "tidemesh.tides:solve",
    "simulate_tide": "tidemesh.tides.time_domain:simulate",
    "stable_step": "tidemesh.tides.time_domain",
    "fit_boundary": "tidemesh.tides.gauge_fit",
    "predict_tide": "tidemesh.tides:predict",
    "compare_constants": "tidemesh.verification",
    "compare_records": "tidemesh.verification",
    "momentum_series": "tidemesh.truncation",
    "allowable_sizes": "tidemesh.sizing",
    "select_points": "tidemesh.hierarchy",
    "improve_mesh": "tidemesh.improve",
    "read_fort14": "tidemesh.io.fort14",
    "write_fort14": "tidemesh.io.fort14",
    "read_fort15": "tidemesh.io.fort15",
    "write_fort15": "tidemesh.io.fort15",
    "read_fort53": "tidemesh.io.fort53",
    "write_ugrid": "tidemesh.io.ugrid",
    "check_mesh": "tidemesh.triangulation.topology",
}

__all__ = ["__version__", *_WHERE]


def __getattr__(name: str) -> Any:
    # Loaded on first use: `import tidemesh` and `tidemesh --help` stay instant.
    if name in _WHERE:
        module, _, attribute = _WHERE[name].partition(":")
        return getattr(importlib.import_module(module), attribute or name)
    raise AttributeError(f"module 'tidemesh' has no attribute '{name}'")


def __dir__() -> list[str]:
    return sorted(__all__)
