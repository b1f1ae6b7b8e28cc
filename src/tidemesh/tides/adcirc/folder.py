"""The run directory of ADCIRC: its inputs, what made them, old results."""

from __future__ import annotations

import json
import logging
import os
import re
import shutil
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from tidemesh.datatypes import CoastalMesh, TideForcing
from tidemesh.errors import EngineError, InputError
from tidemesh.io.files import atomic, sha256
from tidemesh.io.fort13 import write_fort13
from tidemesh.io.fort14 import write_fort14
from tidemesh.io.fort15 import write_fort15
from tidemesh.tides.adcirc.control import RunInputs, harmonic_order, run_inputs
from tidemesh.tides.adcirc.launch import LOGS
from tidemesh.tides.adcirc.settings import AdcircSettings
from tidemesh.tides.settings import TideSettings

logger = logging.getLogger(__name__)

MANIFEST = "tidemesh_run.json"
"""Beside the inputs: their fingerprints, and what the results must look like."""

INPUTS = ("fort.13", "fort.14", "fort.15")

# What ADCIRC and adcprep leave behind; job scripts and notes of the user stay.
_RESULT = re.compile(
    r"fort\.(?!1[345]$)\d+(\.nc)?(\.gz)?|(max|min)\w+\.63(\.nc)?|rads\.64(\.nc)?|"
    r"PE\d{4,}|partmesh\.txt|metis_graph\.txt|adcirc\.log|debug\.txt"
)


@dataclass(frozen=True)
class RunFolder:
    """A run directory with its inputs."""

    path: Path
    written: bool
    """Whether this call wrote the inputs; False if the same were there."""
    manifest: dict[str, Any]


def write_run(
    folder: str | Path,
    mesh: CoastalMesh,
    forcing: TideForcing,
    tide: TideSettings,
    settings: AdcircSettings,
    *,
    friction: float | np.ndarray | None = None,
    drag: float | np.ndarray | None = None,
    coriolis: float | np.ndarray | None = None,
) -> RunFolder:
    """Write a complete run directory: fort.14, fort.15, and fort.13 where needed.

    A directory that holds the same inputs is left as it is, with its results. Other
    inputs of an earlier run are replaced, which is said in the log, and its results
    removed: a stale fort.53 would pass for the result of a failed run.

    Parameters
    ----------
    folder : path
        Need not exist.
    mesh, forcing, tide, settings, friction, drag, coriolis
        See `run_inputs`.

    Returns
    -------
    run : RunFolder

    Raises
    ------
    InputError
        If the directory holds ADCIRC files that are not from here, or were changed by
        hand; or see `run_inputs`.
    """
    inputs = run_inputs(
        mesh,
        forcing,
        tide,
        settings,
        friction=friction,
        drag=drag,
        coriolis=coriolis,
    )
    return write_inputs(folder, inputs, settings)


def write_inputs(
    folder: str | Path,
    inputs: RunInputs,
    settings: AdcircSettings,
) -> RunFolder:
    """The same from inputs that are put together already."""
    folder = Path(folder)
    before = _known(folder)
    # Beside its place, so that a directory is complete or not there.
    beside = folder.with_name(f".{folder.name}.{os.getpid()}.part")
    try:
        beside.mkdir(parents=True)
        manifest = _write(beside, inputs, settings)
        if before is not None and before["inputs"] == manifest["inputs"]:
            # What is expected of the results may differ, not the run itself.
            _write_manifest(folder, manifest)
            return RunFolder(folder, False, manifest)
        if before is None and not folder.exists():
            os.replace(beside, folder)
            return RunFolder(folder, True, manifest)
        if before is not None:
            names = sorted(
                name
                for name in {*before["inputs"], *manifest["inputs"]}
                if before["inputs"].get(name) != manifest["inputs"].get(name)
            )
            logger.warning(
                "%s: holds another ADCIRC run; %s replaced, its results removed",
                folder,
                ", ".join(names),
            )
        remove_results(folder)
        (folder / MANIFEST).unlink(missing_ok=True)
        for name in INPUTS:
            if (beside / name).exists():
                os.replace(beside / name, folder / name)
            else:
                (folder / name).unlink(missing_ok=True)
        # Last: with it the directory counts as whole.
        _write_manifest(folder, manifest)
        return RunFolder(folder, True, manifest)
    except OSError as error:
        raise InputError(
            f"{folder}: the ADCIRC run cannot be written ({error.strerror or error})"
        ) from error
    finally:
        shutil.rmtree(beside, ignore_errors=True)


def read_manifest(folder: str | Path) -> dict[str, Any]:
    """What `write_run` noted in a run directory.

    Raises
    ------
    EngineError
        If the directory is not from here.
    """
    path = Path(folder) / MANIFEST
    try:
        manifest = json.loads(path.read_text(encoding="utf-8"))
        if not isinstance(manifest["inputs"], dict):
            raise KeyError("inputs")
        return manifest
    except FileNotFoundError:
        raise EngineError(
            f"{folder} is no run directory of this program: it has no {MANIFEST}"
        ) from None
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise EngineError(f"{path}: is damaged ({error}); remove {folder}") from error


def remove_results(folder: Path) -> None:
    """Remove what earlier runs left in a run directory; inputs and scripts stay."""
    for path in folder.iterdir():
        if _RESULT.fullmatch(path.name) or path.name in LOGS:
            if path.is_dir() and not path.is_symlink():
                shutil.rmtree(path)
            else:
                path.unlink()


def _known(folder: Path) -> dict[str, Any] | None:
    """The manifest of an earlier run; None for a new or unused directory."""
    if not folder.exists():
        return None
    if not folder.is_dir():
        raise InputError(f"{folder}: is a file, a run directory was expected")
    if not (folder / MANIFEST).exists():
        foreign = sorted(p.name for p in folder.iterdir() if p.name.startswith("fort."))
        if foreign:
            raise InputError(
                f"{folder}: holds ADCIRC files that this program did not write "
                f"({', '.join(foreign[:5])}); name another directory or move them away"
            )
        return None
    manifest = read_manifest(folder)
    for name, fingerprint in manifest["inputs"].items():
        path = folder / name
        if not path.exists() or sha256(path) != fingerprint:
            what = "was changed" if path.exists() else "was removed"
            raise InputError(
                f"{path}: {what} since this program wrote it. Lines for fort.15 belong "
                "in adcirc.extra_lines; to write the run anew remove the directory, to "
                "keep it name another one"
            )
    return manifest


def _write(folder: Path, inputs: RunInputs, settings: AdcircSettings) -> dict[str, Any]:
    write_fort14(folder / "fort.14", inputs.mesh, title="mesh for a tide run")
    write_fort15(folder / "fort.15", inputs.control)
    if inputs.attributes is not None:
        write_fort13(folder / "fort.13", inputs.attributes)
    forcing = inputs.forcing
    order = harmonic_order(forcing)
    manifest = {
        "inputs": {
            name: sha256(folder / name) for name in INPUTS if (folder / name).exists()
        },
        "nodes": len(inputs.mesh.points),
        "constituents": [forcing.names[k] for k in order],
        "frequency": [float(forcing.frequency[k]) for k in order],
        "output": settings.output,
        "steps": inputs.plan.steps,
        "time_step_s": inputs.plan.time_step_s,
        "solver_iterations": settings.solver_iterations,
        "error_elevation_m": settings.error_elevation_m,
        "wetting": settings.wetting,
        "notes": list(inputs.plan.notes),
    }
    _write_manifest(folder, manifest)
    return manifest


def _write_manifest(folder: Path, manifest: dict[str, Any]) -> None:
    with atomic(folder / MANIFEST) as temporary:
        temporary.write_text(
            json.dumps(manifest, indent=1) + "\n", encoding="utf-8", newline="\n"
        )
