"""The command line: one command a purpose, one function of the pipeline each."""

from __future__ import annotations

import json
import logging
import os
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

# Before numpy is loaded: the sparse solver works on small dense blocks, and more BLAS
# threads than one make it many times slower.
os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import click

import tidemesh

DONE, FAILED, BAD_INPUT, INTERRUPTED = 0, 1, 2, 3

STAGES = (
    "domain",
    "base_grid",
    "tide",
    "truncation",
    "sizing",
    "mesh",
    "check",
    "figures",
)


@click.group(context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(tidemesh.__version__, prog_name="tidemesh")
def app() -> None:
    """Design triangular meshes for tide models from the physics.

    Start with `tidemesh init DIR`, then `tidemesh run DIR/south_carolina.toml`.
    """


@app.command()
@click.argument("case", type=click.Path(path_type=Path))
@click.option(
    "--output",
    "-o",
    type=click.Path(path_type=Path),
    help="Folder for the results [default: out/NAME-OF-CASE].",
)
@click.option(
    "--until",
    metavar="STAGE",
    help=f"Stop after a stage: {', '.join(STAGES)}.",
)
@click.option(
    "--set",
    "overrides",
    multiple=True,
    metavar="KEY=VALUE",
    help="Replace a value of the case, for instance sizing.nodes=5000; repeatable.",
)
@click.option("--quiet", "-q", is_flag=True, help="Print nothing but errors.")
@click.option("--json", "as_json", is_flag=True, help="Print summary.json at the end.")
def run(
    case: Path,
    output: Path | None,
    until: str | None,
    overrides: tuple[str, ...],
    quiet: bool,
    as_json: bool,
) -> None:
    """Mesh a CASE file (TOML): shoreline to mesh in one go.

    A second run goes on at the first stage whose inputs have changed.
    """
    from tidemesh.pipeline.run import run_case

    with _reporting(quiet) as reporter:
        result = run_case(
            case, output=output, until=until, overrides=overrides, reporter=reporter
        )
    if as_json:
        click.echo(json.dumps(result.summary, indent=2))
    elif not quiet:
        _print_summary(result)


_MESH = click.Path(path_type=Path)
_SET = click.option(
    "--set",
    "overrides",
    multiple=True,
    metavar="KEY=VALUE",
    help="Replace a setting, for instance tide.friction=0.001; repeatable.",
)
_QUIET = click.option("--quiet", "-q", is_flag=True, help="Print nothing but errors.")
_JSON = click.option("--json", "as_json", is_flag=True, help="Print the summary.")


_OUTPUT = click.option(
    "--output",
    "-o",
    type=click.Path(path_type=Path),
    required=True,
    help="Folder for the results.",
)


def _forced(command: Callable) -> Callable:
    """Options that say what drives a tide."""
    options = (
        ("--fort15", "Forcing and physics of an ADCIRC case."),
        ("--fort13", "Its nodal attributes [default: beside it]."),
        ("--case", "Case file: its sections tide, forcing, adcirc, simulation."),
        ("--table", "Harmonic constants along the ocean boundary (CSV)."),
    )
    for name, words in reversed(options):
        command = click.option(name, type=_MESH, help=words)(command)
    return command


@app.command()
@click.argument("mesh", type=_MESH)
@_forced
@_OUTPUT
@_SET
@_QUIET
@_JSON
def solve(
    mesh: Path,
    fort15: Path | None,
    fort13: Path | None,
    case: Path | None,
    table: Path | None,
    output: Path,
    overrides: tuple[str, ...],
    quiet: bool,
    as_json: bool,
) -> None:
    """Solve the tide on a MESH (fort.14 or UGRID) in the frequency domain.

    Writes tide.nc, fort.53, fort.54 and summary.json. With --fort15 the constituents,
    boundary values, friction, rotation and coordinates are those of an ADCIRC case,
    and so is the discretisation where the run is linear or only its friction is not.
    """
    from tidemesh.pipeline.solve import solve_mesh

    with _reporting(quiet) as reporter:
        reporter.start("tide", 0, 1)
        summary = solve_mesh(
            mesh,
            output=output,
            fort15=fort15,
            fort13=fort13,
            case=case,
            table=table,
            overrides=overrides,
            progress=reporter.update,
        )
        reporter.finish("tide", summary["seconds"], False)
    if as_json:
        click.echo(json.dumps(summary, indent=2))
    elif not quiet:
        click.echo(_tide_lines(summary, output))


@app.command()
@click.argument("mesh", type=_MESH)
@_forced
@click.option(
    "--stations",
    type=_MESH,
    help="Table of places for water levels [default: NOAA's gauges].",
)
@_OUTPUT
@_SET
@_QUIET
@_JSON
def simulate(
    mesh: Path,
    fort15: Path | None,
    fort13: Path | None,
    case: Path | None,
    table: Path | None,
    stations: Path | None,
    output: Path,
    overrides: tuple[str, ...],
    quiet: bool,
    as_json: bool,
) -> None:
    """Run the nonlinear tide on a MESH in time (the paper's section 4).

    Writes levels at stations (NetCDF and CSV), harmonic constants, maxima and
    restart files; the same command goes on after an interruption. Span, step and
    output by --set simulation.days=90 and the like.
    """
    from tidemesh.pipeline.simulate import simulate_mesh

    with _reporting(quiet) as reporter:
        reporter.start("simulation", 0, 1)
        summary = simulate_mesh(
            mesh,
            output=output,
            fort15=fort15,
            fort13=fort13,
            case=case,
            table=table,
            stations=stations,
            overrides=overrides,
            progress=reporter.update,
        )
        reporter.finish("simulation", summary["seconds"], False)
    if as_json:
        click.echo(json.dumps(summary, indent=2))
    elif not quiet:
        click.echo(_tide_lines(summary, output))


@app.command()
@click.argument("mesh", type=_MESH)
@click.argument("solution", type=_MESH)
@click.option("--nodes", type=int, help="Node budget of the sizes and the new mesh.")
@click.option("--remesh", is_flag=True, help="Mesh the same water again.")
@_OUTPUT
@_SET
@_QUIET
@_JSON
def estimate(
    mesh: Path,
    solution: Path,
    nodes: int | None,
    remesh: bool,
    output: Path,
    overrides: tuple[str, ...],
    quiet: bool,
    as_json: bool,
) -> None:
    """Measure where a model errs: a MESH and its SOLUTION to error.nc and size.nc.

    SOLUTION is a fort.53 (the fort.54 is looked for beside it), a NetCDF file of
    `tidemesh solve`, or a folder with one of them. With --remesh also mesh.14 and the
    tide on it.
    """
    from tidemesh.pipeline.existing import estimate as run_estimate

    if nodes is not None:
        overrides = (*overrides, f"sizing.nodes={nodes}")
    with _reporting(quiet) as reporter:
        result = run_estimate(
            mesh,
            solution,
            output=output,
            remesh=remesh,
            overrides=overrides,
            reporter=reporter,
        )
    if as_json:
        click.echo(json.dumps(result.summary, indent=2))
    elif not quiet:
        _print_summary(result)


@app.command()
@click.argument("solution", type=_MESH)
@click.option("--mesh", type=_MESH, help="fort.14 of the solution, for a fort.53.")
@click.option(
    "--gauges",
    type=_MESH,
    help="Harmonic constants at gauges [default: NOAA's of South Carolina].",
)
@click.option("--constituents", help="Names with commas [default: all in both].")
@click.option("--observed", type=_MESH, help="Observed water levels (CSV, CO-OPS).")
@click.option("--modelled", type=_MESH, help="Levels of a simulation at stations.")
@click.option("--station", help="The one gauge whose levels are compared.")
@click.option("--stations", help="Names of a fort.61's stations, with commas.")
@click.option("--cold-start", help="Time 0 of a fort.61, for instance 1998-01-01.")
@click.option(
    "--analyse", is_flag=True, help="Constants from the levels (UTide), both sides."
)
@click.option("--start", help="First day of the levels, for instance 1998-03-16.")
@click.option("--end", help="Last day of the levels.")
@click.option("--farthest-km", default=3.0, show_default=True, help="Gauge from mesh.")
@click.option("--no-figures", is_flag=True, help="Write tables only.")
@_OUTPUT
@_QUIET
@_JSON
def verify(
    solution: Path,
    mesh: Path | None,
    gauges: Path | None,
    constituents: str | None,
    observed: Path | None,
    modelled: Path | None,
    station: str | None,
    stations: str | None,
    cold_start: str | None,
    analyse: bool,
    start: str | None,
    end: str | None,
    farthest_km: float,
    no_figures: bool,
    output: Path,
    quiet: bool,
    as_json: bool,
) -> None:
    """Compare a SOLUTION with gauges: harmonic constants, and water levels.

    SOLUTION is a folder of `tidemesh run`, `solve` or `simulate`, a NetCDF file of
    theirs, or a fort.53 (with --mesh). With --start and --end the levels of a time are
    compared: with --observed, or else with the astronomical tide of the gauge.
    """
    from tidemesh.pipeline.verify import verify as run_verify

    with _warnings(quiet):
        result = run_verify(
            solution,
            output=output,
            mesh=mesh,
            gauges=gauges,
            constituents=constituents.split(",") if constituents else None,
            observed=observed,
            modelled=modelled,
            station=station,
            stations=stations.split(",") if stations else (),
            cold_start=cold_start,
            analyse=analyse,
            start=start,
            end=end,
            farthest_m=1e3 * farthest_km,
            figures=not no_figures,
        )
    if as_json:
        click.echo((output / "verification.json").read_text(encoding="utf-8"))
    elif not quiet:
        click.echo(result.constants.as_text())
        for record in result.records:
            click.echo(record.as_text())
        for one in result.left_out:
            click.echo(f"left out: {one.gauge}: {one.reason}")
        click.echo(f"results in {output}")


@app.command()
@click.argument("folder", type=click.Path(path_type=Path))
@click.option(
    "--example",
    default="south_carolina",
    show_default=True,
    help="Which shipped case: south_carolina or island.",
)
def init(folder: Path, example: str) -> None:
    """Write a commented case with its data into FOLDER."""
    from tidemesh.pipeline.examples import copy_example

    case = copy_example(example, folder)
    click.echo(f"wrote {case}\nnext: tidemesh run {case}")


@app.command()
@click.argument("mesh", type=click.Path(path_type=Path))
@click.option("--json", "as_json", is_flag=True, help="Print as JSON.")
def info(mesh: Path, as_json: bool) -> None:
    """Describe a MESH (fort.14 or UGRID): size, quality, boundaries, faults.

    The exit code is 1 if the mesh has a fault that would stop or spoil a model run.
    """
    from tidemesh.pipeline.info import describe_mesh, format_description

    description = describe_mesh(mesh)
    if as_json:
        click.echo(json.dumps(description, indent=2))
    else:
        click.echo(format_description(description))
    if description["problems"]:
        raise SystemExit(FAILED)


def _print_summary(result: Any) -> None:
    summary = result.summary
    lines = [f"results in {result.output}"]
    if "nodes" in summary:
        quality = summary["quality"]
        lines.append(
            f"{summary['nodes']} nodes, {summary['elements']} elements, "
            f"mean q {quality['quality_mean']:.3f}, "
            f"min q {quality['quality_minimum']:.3f}, "
            f"{summary['seconds']:.1f} s"
        )
    click.echo("\n".join(lines))


def _tide_lines(summary: dict[str, Any], output: Path) -> str:
    lines = [f"results in {output}", f"{summary['nodes']} nodes"]
    for name in summary["constituents"]:
        found = summary["tide"][name]
        lines.append(f"  {name:<6} up to {found['largest_amplitude_m']:.4f} m")
    lines += [f"  note: {note}" for note in summary.get("left_out", [])]
    return "\n".join(lines)


@contextmanager
def _reporting(quiet: bool) -> Iterator[Any]:
    """A reporter that draws progress, or says nothing."""
    if quiet:
        from tidemesh.pipeline.runner import SilentReporter

        with _warnings(quiet):
            yield SilentReporter()
        return
    from tidemesh.pipeline.progress import RichReporter

    with _warnings(quiet), RichReporter() as reporter:
        yield reporter


@contextmanager
def _warnings(quiet: bool) -> Iterator[None]:
    """What the library warns of goes to stderr, or nowhere."""
    log = logging.getLogger("tidemesh")
    level, propagate = log.level, log.propagate
    handler = logging.StreamHandler()
    handler.setFormatter(logging.Formatter("warning: %(message)s"))
    log.addHandler(handler)
    log.setLevel(logging.ERROR if quiet else logging.WARNING)
    # Other libraries set up logging in their own way.
    log.propagate = False
    try:
        yield
    finally:
        log.removeHandler(handler)
        log.setLevel(level)
        log.propagate = propagate


def main(arguments: list[str] | None = None) -> int:
    """Run the command line; the exit code tells how it went.

    0 done, 2 bad input or usage, 3 interrupted, 1 anything else.
    """
    code = _guard(lambda: app.main(arguments, standalone_mode=False))
    if arguments is None:
        sys.exit(code)
    return code


def _guard(call: Callable[[], Any]) -> int:
    try:
        result = call()
        return result if isinstance(result, int) else DONE
    except click.exceptions.Abort:
        return _say("interrupted; run the same command again to go on", INTERRUPTED)
    except click.ClickException as error:
        error.show()
        return BAD_INPUT
    except click.exceptions.Exit as stop:
        return stop.exit_code
    except KeyboardInterrupt:
        return _say("interrupted; run the same command again to go on", INTERRUPTED)
    except SystemExit as stop:
        return stop.code if isinstance(stop.code, int) else FAILED
    except Exception as error:
        from tidemesh.errors import InputError, TidemeshError

        if isinstance(error, InputError):
            return _say(f"error: {error}", BAD_INPUT)
        if isinstance(error, TidemeshError | MemoryError):
            return _say(f"error: {error or type(error).__name__}", FAILED)
        raise


def _say(message: str, code: int) -> int:
    click.echo(message, err=True)
    return code
