"""The command line: ``tidemesh run``, ``init`` and ``info``."""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Callable
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
    from tidemesh.pipeline.runner import SilentReporter

    reporter: Any = SilentReporter()
    if not quiet:
        from tidemesh.pipeline.progress import RichReporter

        reporter = RichReporter()
    with reporter if not quiet else _nothing():
        result = run_case(
            case, output=output, until=until, overrides=overrides, reporter=reporter
        )
    if as_json:
        click.echo(json.dumps(result.summary, indent=2))
    elif not quiet:
        _print_summary(result)


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


class _nothing:
    def __enter__(self) -> None:
        return None

    def __exit__(self, *exception: object) -> None:
        return None


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
