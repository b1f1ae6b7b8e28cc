"""One call from a case file to its results."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from tidemesh.pipeline.case import Case, input_files, read_case
from tidemesh.pipeline.runner import Reporter, Run, run_stages
from tidemesh.pipeline.stages import STAGES
from tidemesh.pipeline.tide import check_tide_inputs


def run_case(
    case: str | Path,
    *,
    output: str | Path | None = None,
    until: str | None = None,
    overrides: Sequence[str] = (),
    reporter: Reporter | None = None,
) -> Run:
    """Mesh a case: shoreline, base grid, tide, error, sizes, mesh, check, figures.

    Parameters
    ----------
    case : path
        Case file (TOML).
    output : path, optional
        Folder of the results; ``out/NAME-OF-CASE`` if not given.
    until : str, optional
        Stop after this stage.
    overrides : sequence of "section.key=value"
        Replace values of the case.
    reporter : Reporter, optional
        Hears about the progress.

    Returns
    -------
    Run
        Output folder, summary, and the stages taken over from an earlier run.

    Raises
    ------
    InputError
        If the case or its files cannot be used; before long work starts.
    """
    path = Path(case)
    checked = read_case(path, overrides)
    files = input_files(checked, path.parent)
    check_inputs(checked, files)
    folder = Path(output) if output is not None else Path("out") / path.stem
    stages = STAGES
    if checked.output.figures:
        # Loads matplotlib, which takes longer than a small mesh.
        from tidemesh.pipeline.figures import FIGURES

        stages = (*STAGES, FIGURES)
    return run_stages(
        stages,
        checked,
        files,
        folder,
        folder=path.parent,
        until=until,
        reporter=reporter,
    )


def check_inputs(case: Case, files: dict[str, Path]) -> None:
    """Find what is wrong with the input files before long work starts.

    Raises
    ------
    InputError
        If a table of tide constants cannot be read or lacks a constituent.
    """
    check_tide_inputs(case.tide, files)
