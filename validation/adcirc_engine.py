"""Real ADCIRC through the engine, beside the embedded one; and what its failures say.

    python validation/adcirc_engine.py --adcirc DIR examples/south_carolina/fine.toml

DIR holds adcirc, adcprep and padcirc. Prints relative L2 differences of the complex
elevations and velocities at all nodes, CPU seconds of both, and the messages of runs
that are made to fail. Runs on two ranks must give what one gives.
"""

from __future__ import annotations

import argparse
import logging
import resource
import shutil
import time
from dataclasses import dataclass
from pathlib import Path

import msgspec
import numpy as np

from tidemesh import constants
from tidemesh.datatypes import BoundaryString, CoastalMesh, TideForcing
from tidemesh.errors import ConvergenceError, EngineError
from tidemesh.io.fort14 import read_fort14
from tidemesh.io.tide_tables import read_tide_table
from tidemesh.pipeline.run import run_case
from tidemesh.tides.adcirc import Adcirc, AdcircSettings, check_run, write_run
from tidemesh.tides.adcirc.launch import run_adcirc
from tidemesh.tides.forcing import boundary_forcing
from tidemesh.tides.frequency_domain.solve import solve
from tidemesh.tides.settings import TideSettings

OVERTIDES = ("M4", "M6", "STEADY")
LINEAR = TideSettings(friction=4.0e-4)
QUADRATIC = TideSettings(friction_law="quadratic", overtides=OVERTIDES)
FINITE = msgspec.structs.replace(QUADRATIC, finite_amplitude=True)
NONLINEAR = msgspec.structs.replace(FINITE, advection=True)


@dataclass(frozen=True)
class Case:
    """One comparison."""

    name: str
    mesh: CoastalMesh
    forcing: TideForcing
    tide: TideSettings
    settings: dict
    embedded: dict[str, dict]
    """What the embedded engine is told besides, by a label."""


def main() -> None:
    """Print the table and the messages."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--adcirc", type=Path, required=True)
    parser.add_argument("case")
    parser.add_argument("--output", type=Path, default=Path("out/adcirc"))
    parser.add_argument("--nodes", type=int, default=4000)
    parser.add_argument(
        "--launcher",
        default="mpirun --allow-run-as-root --oversubscribe "
        "--mca mpi_yield_when_idle 1 -np {ranks}",
    )
    options = parser.parse_args()
    logging.basicConfig(level=logging.WARNING, format="  %(message)s")
    programs = {
        name: str((options.adcirc / name).resolve())
        for name in ("adcirc", "adcprep", "padcirc")
    }
    common = {**programs, "launcher": options.launcher}
    annulus = _annulus(24, 32)
    shelf, forcing = _shelf(options)
    for case in _cases(annulus, _quarter_forcing(annulus), shelf, forcing):
        _compare(case, common, options.output)
    for name, tide in (("linear", LINEAR), ("nonlinear", NONLINEAR)):
        _two_ranks(name, shelf, forcing, tide, common, options.output)
    _fail(annulus, common, options.output)


def _cases(
    annulus: CoastalMesh, quarter: TideForcing, shelf: CoastalMesh, forcing: TideForcing
) -> list[Case]:
    corner = msgspec.structs.replace(LINEAR, minimum_inner_angle_deg=110.0)
    sphere = msgspec.structs.replace(LINEAR, metric="sphere")
    turning = msgspec.structs.replace(LINEAR, metric="adcirc", coriolis="latitude")
    discrete = {"discretisation": "gwce", "time_step_s": 30.0}
    netcdf, short = {"output": "netcdf"}, {"ramp_days": 1.0}
    return [
        Case("annulus", annulus, quarter, corner, netcdf, {"": {}, "step": discrete}),
        Case("shelf", shelf, forcing, LINEAR, short, {"": {}, "step": discrete}),
        Case("shelf, Mercator", shelf, forcing, sphere, short, {"": {}}),
        Case(
            "shelf, Coriolis",
            shelf,
            forcing,
            turning,
            short,
            {"": {}, "gwce": {"discretisation": "gwce"}, "step": discrete},
        ),
        Case(
            "shelf, quadratic",
            shelf,
            forcing,
            QUADRATIC,
            short,
            {"": {}, "gwce": {"discretisation": "gwce", "tau0": 0.009}},
        ),
        Case("shelf, finite", shelf, forcing, FINITE, short, {"": {}}),
        Case(
            "shelf, nonlinear",
            shelf,
            forcing,
            NONLINEAR,
            short,
            {"": {}, "calm": {"advection": False}},
        ),
    ]


def _compare(case: Case, common: dict, output: Path) -> None:
    folder = output / case.name.replace(",", "").replace(" ", "_")
    engine = Adcirc(AdcircSettings(**common, **case.settings), case.tide, folder)
    begin = resource.getrusage(resource.RUSAGE_CHILDREN)
    wall = time.perf_counter()
    theirs = engine.solve(case.mesh, case.forcing)
    wall = time.perf_counter() - wall
    end = resource.getrusage(resource.RUSAGE_CHILDREN)
    report = engine.report()
    print(
        f"{case.name}: {len(case.mesh.points):,} nodes, ADCIRC "
        f"{end.ru_utime - begin.ru_utime:.1f} CPU s ({wall:.1f} s)"
    )
    for line in (*report["plan"], *(f"WARNING {w}" for w in report["warnings"])):
        print(f"  {line}")
    print(
        f"  {'':15} {'elevat.':>8} {'velocity':>8} {'friction':>8} {'most (m)':>9}"
        f" {'largest':>8} {'CPU s':>7}"
    )
    for label, options in case.embedded.items():
        begin_cpu = time.process_time()
        settings = msgspec.structs.replace(case.tide, **options)
        try:
            ours = solve(case.mesh, case.forcing, settings)
        except ConvergenceError as error:
            print(f"  {label:6} {error}", flush=True)
            continue
        cpu = time.process_time() - begin_cpu
        for name in theirs.names:
            a, b = theirs.names.index(name), ours.names.index(name)
            gap = np.abs(ours.elevation[b] - theirs.elevation[a]).max()
            bottom = (np.atleast_2d(ours.friction), np.atleast_2d(theirs.friction))
            friction = _relative(
                bottom[0][b % len(bottom[0])], bottom[1][a % len(bottom[1])]
            )
            print(
                f"  {label:6} {name:8}"
                f" {_relative(ours.elevation[b], theirs.elevation[a]):8.1e}"
                f" {_relative(ours.velocity[b], theirs.velocity[a]):8.1e}"
                f" {friction:8.1e} {gap:9.1e}"
                f" {np.abs(theirs.elevation[a]).max():8.3f} {cpu:7.2f}",
                flush=True,
            )


def _two_ranks(
    name: str,
    mesh: CoastalMesh,
    forcing: TideForcing,
    tide: TideSettings,
    common: dict,
    output: Path,
) -> None:
    """One day, serial and on two ranks."""
    short = {"ramp_days": 0.4, "spin_up_days": 0.4, "run_days": 1.0}
    one, two = (
        Adcirc(
            AdcircSettings(**common, **short, ranks=ranks),
            tide,
            output / f"{name}_{ranks}_ranks",
        ).solve(mesh, forcing)
        for ranks in (1, 2)
    )
    print(
        f"{name}, two ranks against one: elevation "
        f"{_relative(two.elevation, one.elevation):.1e}, velocity "
        f"{_relative(two.velocity, one.velocity):.1e}",
        flush=True,
    )


def _relative(ours: np.ndarray, theirs: np.ndarray) -> float:
    return float(np.linalg.norm(ours - theirs) / np.linalg.norm(theirs))


def _fail(mesh: CoastalMesh, common: dict, output: Path) -> None:
    """Runs that must not pass for good ones."""
    forcing = _quarter_forcing(mesh)
    tide = msgspec.structs.replace(LINEAR, tau0=0.05)
    for name, settings in (
        ("step too long", {"time_step_s": 3000.0}),
        ("step too long, 2 ranks", {"time_step_s": 3000.0, "ranks": 2}),
        ("more ranks than the mesh has parts", {"ranks": 400}),
        ("launcher", {"ranks": 2, "launcher": "mpirun -np {ranks}"}),
        ("solver", {"solver_iterations": 2, "time_step_s": 30.0}),
        ("time limit", {"timeout_s": 0.5, "time_step_s": 1.0}),
    ):
        folder = output / ("fails_" + name.replace(",", "").replace(" ", "_"))
        engine = Adcirc(AdcircSettings(**{**common, **settings}), tide, folder)
        try:
            engine.solve(mesh, forcing)
            print(
                f"{name}: ran to its end, {engine.report()['solver_iterations']} "
                "iterations at most"
            )
        except EngineError as error:
            print(f"{name}: {type(error).__name__}: {error}", flush=True)
    settings = AdcircSettings(**common)
    for name, line, text in (
        ("fort.14", 5, "3 garbage"),
        ("fort.15", 9, "7 ! NOLIBF"),
        ("fort.15", 40, "! nothing"),
    ):
        run = write_run(output / f"fails_line_{line}", mesh, forcing, tide, settings)
        path = run.path / name
        lines = path.read_text().splitlines()
        path.write_text("\n".join([*lines[: line - 1], text, *lines[line:]]) + "\n")
        code = run_adcirc(run.path, settings, run.manifest["steps"])
        try:
            check_run(run.path, exit_code=code)
            print(f"{name}, line {line}: ran to its end")
        except EngineError as error:
            print(f"{name}, line {line}: {error}", flush=True)
        # Edited by hand, it would not be written over.
        shutil.rmtree(run.path)


def _shelf(options: argparse.Namespace) -> tuple[CoastalMesh, TideForcing]:
    """The mesh of a case, with M2 on its ocean boundary."""
    folder = options.output / "mesh"
    if not (folder / "mesh.14").exists():
        run_case(
            options.case,
            output=folder,
            overrides=[f"sizing.nodes={options.nodes}", "output.figures=false"],
        )
    mesh = read_fort14(folder / "mesh.14")
    data = Path(options.case).parent / "../../../shared/data/south_carolina"
    table = read_tide_table(data / "open_boundary_forcing.csv")
    return mesh, boundary_forcing(mesh, table, ["M2"])


def _annulus(n_r: int, n_theta: int) -> CoastalMesh:
    """Quarter annulus of Lynch & Gray (1978), depth growing with the radius squared."""
    r = np.linspace(60_960.0, 152_400.0, n_r + 1)
    angle = np.linspace(0.0, 0.5 * np.pi, n_theta + 1)
    radius, turn = np.meshgrid(r, angle)
    points = np.stack([radius * np.cos(turn), radius * np.sin(turn)], axis=-1)
    node = np.arange(radius.size).reshape(radius.shape)
    a, b = node[:-1, :-1].ravel(), node[:-1, 1:].ravel()
    c, d = node[1:, 1:].ravel(), node[1:, :-1].ravel()
    row, column = np.divmod(np.arange(len(a)), n_r)
    even = ((row + column) % 2 == 0)[:, None]
    one = np.where(even, np.stack([a, b, c], 1), np.stack([a, b, d], 1))
    two = np.where(even, np.stack([a, c, d], 1), np.stack([b, c, d], 1))
    land = np.concatenate([node[-1, ::-1], node[-2::-1, 0], node[0, 1:]])
    return CoastalMesh(
        points.reshape(-1, 2),
        np.concatenate([one, two]),
        3.048 * (radius.ravel() / 60_960.0) ** 2,
        (BoundaryString("open", node[:, -1]), BoundaryString("mainland", land)),
    )


def _quarter_forcing(mesh: CoastalMesh) -> TideForcing:
    nodes = mesh.open_nodes
    return TideForcing(
        ("M2",),
        np.array([constants.frequency("M2")]),
        nodes,
        np.full((1, len(nodes)), 0.3048),
    )


if __name__ == "__main__":
    main()
