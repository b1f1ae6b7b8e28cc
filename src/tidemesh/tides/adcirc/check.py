"""Whether an ADCIRC run has come to a usable end: its exit code does not tell."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from tidemesh.errors import EngineError, InputError
from tidemesh.io.fort53 import HarmonicConstants, read_fort53, read_fort54
from tidemesh.tides.adcirc.folder import read_manifest
from tidemesh.tides.adcirc.launch import LOGS, SCREEN, tail

LOG = "fort.16"
FASTEST_M_S = 50.0
"""No tidal current is as fast; what is, comes from an instability."""

_RANK_LOGS = 64
_END = "terminating normally"
_VERSION = re.compile(r"(?:VERSION|Version is)\s+(\S+)")
_ITERATIONS = re.compile(r"ITERATIONS =\s*(\d+)")
_STEP = re.compile(r"TIME STEP =\s*(\d+)")
_ERROR = re.compile(
    r"^\s*(?:ERROR\b|\*+ ?ERROR|!+\s+ERROR|forrtl: severe|Fortran runtime error)|"
    r"Program received signal|MPI_ABORT was invoked",
    re.MULTILINE,
)
_PASSING = ("INFO", "DEBUG", "ECHO")
_HEADING = re.compile(r"!!!+.*(?:WARNING|INPUT ERROR)")
_WARNING = re.compile(r"\bWARNING\b", re.IGNORECASE)

# What ADCIRC, MPI and Fortran write, in the order in which one tells more than the
# next; what it means, and what to do.
_EVEN_AT_THE_END = (r"Elevation\.gt\.ErrorElev", r"failure to converge")
_SIGNS: tuple[tuple[str, str, str], ...] = (
    (
        r"Elevation\.gt\.ErrorElev",
        "the run blew up",
        "take a shorter adcirc.time_step_s (Courant number below 1), more "
        "adcirc.eddy_viscosity or friction, or look at the depths around that node",
    ),
    (
        r"DIAGONAL TERM IN THE EQUATION",
        "the wave equation has a diagonal that is not positive",
        "look at the triangles around that node and at adcirc.weights",
    ),
    (
        r"failure to converge",
        "the solver of the wave equation did not converge",
        "raise adcirc.solver_iterations or adcirc.solver_tolerance",
    ),
    (
        r"detected an attempt to run as root",
        "Open MPI refuses to run as root",
        'add --allow-run-as-root to adcirc.launcher ("mpirun --allow-run-as-root -np '
        '{ranks}"), or run as another user',
    ),
    (
        r"not enough slots available",
        "Open MPI has fewer slots than ranks",
        "lower adcirc.ranks, or add --oversubscribe to adcirc.launcher",
    ),
    (
        r"PE\d+/fort\.1\d' was not found",
        "the directory was not divided for this many ranks",
        "run adcprep with the same number of ranks as padcirc, or let this program "
        "start both",
    ),
    (
        r"(?i)netcdf (?:is not available|output .*not)|not compiled with NetCDF",
        "this ADCIRC was built without NetCDF",
        'set adcirc.output = "ascii"',
    ),
    (
        r"Required file not found|was not found|\bnot found\b",
        "a file is missing",
        "write the directory anew",
    ),
    (
        r"is not an allowable value|INCONSISTENT|inconsistent with",
        "ADCIRC does not accept an option of fort.15",
        "look at adcirc.extra_lines and at the version: fort.15 is written for v56",
    ),
    (
        r"read14: Reading line \d+ gave|unit = 14",
        "ADCIRC cannot read fort.14",
        "the file was damaged after it was written: remove the directory and repeat",
    ),
    (
        r"Unexpectedly reached end-of-file|End of file|Bad (?:real|integer)|"
        r"I/O error during file access",
        "ADCIRC cannot read fort.15 to its end",
        "the last lines of fort.16 tell how far it came: an ADCIRC of another version "
        "or build (no NetCDF) wants other lines",
    ),
    (
        r"SIGSEGV|Segmentation fault|SIGFPE|Floating point exception|SIGBUS",
        "ADCIRC crashed",
        "raise the stack limit (ulimit -s unlimited), lower adcirc.ranks, or use "
        "another build",
    ),
    (
        r"MPI_ABORT was invoked|exited on signal|PMI.*failed|srun: error",
        "MPI stopped the run",
        "look whether ranks, adcprep and padcirc fit together, and at the other ranks' "
        "messages",
    ),
)


class AdcircPending(EngineError):
    """The run directory is ready; its results are not there yet."""


@dataclass(frozen=True, eq=False)
class RunReport:
    """Results of an ADCIRC run that may be used, and what it warned of."""

    folder: Path
    version: str
    """Of ADCIRC; "" if it does not say."""
    elevation: HarmonicConstants
    velocity: HarmonicConstants
    warnings: tuple[str, ...]
    """ADCIRC's own, each once."""
    largest_elevation_m: float
    """Largest amplitude of a constituent."""
    largest_speed_m_s: float
    solver_iterations: int
    """Most of the steps that were printed."""


def check_run(folder: str | Path, *, exit_code: int | None = None) -> RunReport:
    """Read the results of a finished run, or say why there are none to use.

    Neither the exit code nor "terminating normally" is trusted: MPI hides errors, and
    a run may end normally in numbers that are none.

    Parameters
    ----------
    folder : path
        Written by `write_run`.
    exit_code : int, optional
        Of the program, where it has run just now; None if it may still be running.

    Returns
    -------
    report : RunReport

    Raises
    ------
    AdcircPending
        If nothing has run yet, or the run has not come to its end.
    EngineError
        If it failed: with ADCIRC's own message, the log and a remedy.
    """
    folder = Path(folder)
    manifest = read_manifest(folder)
    logs = _read_logs(folder)
    harmonic = [_result(folder, number, manifest) for number in (53, 54)]
    if exit_code is None and not logs and not any(p.exists() for p in harmonic):
        raise AdcircPending(f"{folder}: ADCIRC has not run here yet")
    _raise_failure(folder, logs, manifest, exit_code)
    # Under MPI fort.16 of the directory is that of adcprep; each rank has its own.
    if not any(_END in text for text in logs.values()):
        _raise_unfinished(folder, logs, manifest, exit_code)
    elevation, velocity = (
        _constants(path, read, manifest)
        for path, read in zip(harmonic, (read_fort53, read_fort54))
    )
    return RunReport(
        folder=folder,
        version=_version(logs),
        elevation=elevation,
        velocity=velocity,
        warnings=_warnings(logs),
        largest_elevation_m=_largest(
            elevation, harmonic[0], manifest["error_elevation_m"], "m", manifest
        ),
        largest_speed_m_s=_largest(velocity, harmonic[1], FASTEST_M_S, "m/s", manifest),
        solver_iterations=_iterations(logs),
    )


def _read_logs(folder: Path) -> dict[Path, str]:
    """Text of the screen and of fort.16; of every rank, where each has its own."""
    paths = [folder / name for name in (*reversed(LOGS), LOG)]
    paths += sorted(folder.glob(f"PE*/{LOG}"))[:_RANK_LOGS]
    return {
        path: path.read_text(encoding="utf-8", errors="replace")
        for path in paths
        if path.is_file()
    }


def _result(folder: Path, number: int, manifest: dict[str, Any]) -> Path:
    suffix = ".nc" if manifest["output"] == "netcdf" else ""
    return folder / f"fort.{number}{suffix}"


# ---- failures -------------------------------------------------------------------


def _raise_failure(
    folder: Path,
    logs: dict[Path, str],
    manifest: dict[str, Any],
    exit_code: int | None,
) -> None:
    ended = any(_END in text for text in logs.values())
    for sign, meaning, remedy in _SIGNS:
        # Of a run that came to its end the same words were a warning.
        if ended and sign not in _EVEN_AT_THE_END:
            continue
        for path, text in logs.items():
            for found in re.finditer(sign, text):
                # INFO lines say in passing that optional files were not found.
                if not _line(text, found).lstrip().startswith(_PASSING):
                    raise _failed(path, meaning, _quote(text, found), remedy)
    for path, text in logs.items():
        found = _ERROR.search(text)
        if found:
            raise _failed(
                path,
                "ADCIRC stopped with an error",
                _quote(text, found),
                "look at the lines before it",
            )
    most = _iterations(logs)
    if most >= manifest["solver_iterations"]:
        raise _failed(
            folder / SCREEN,
            "the solver of the wave equation did not converge",
            f"ITERATIONS = {most}",
            "raise adcirc.solver_iterations, or adcirc.solver_tolerance",
        )
    if exit_code not in (None, 0) and not ended:
        raise _failed(
            folder / SCREEN,
            f"ADCIRC failed with exit code {exit_code}",
            tail(folder / SCREEN),
            "look at both logs",
        )


def _failed(log: Path, meaning: str, quote: str, remedy: str) -> EngineError:
    return EngineError(
        f'{log.parent}: {meaning}: "{quote}"\n{log} has the rest; {remedy}. The run '
        "directory is kept"
    )


def _raise_unfinished(
    folder: Path,
    logs: dict[Path, str],
    manifest: dict[str, Any],
    exit_code: int | None,
) -> None:
    steps = _STEP.findall(logs.get(folder / SCREEN, ""))
    done = f"step {steps[-1]} of {manifest['steps']}" if steps else "no step printed"
    last = tail(folder / LOG, 1)
    if exit_code is None:
        raise AdcircPending(
            f'{folder}: the run has not come to its end ({done}; {LOG}: "{last}"). '
            f"Wait for it, or start it again if it was stopped; if it did end, {LOG} "
            f"or {SCREEN} is missing, which alone says so"
        )
    raise EngineError(
        f'{folder}: ADCIRC ended without "{_END}" (exit code {exit_code}, {done}): '
        f'"{last}"\n{folder / LOG} and {folder / SCREEN} have the rest; the run '
        "directory is kept"
    )


def _line(text: str, found: re.Match) -> str:
    begin = text.rfind("\n", 0, found.start()) + 1
    end = text.find("\n", found.start())
    return text[begin : end if end >= 0 else None]


def _quote(text: str, found: re.Match) -> str:
    """The line with the sign, and the one above where it names the node."""
    begin = text.rfind("\n", 0, found.start()) + 1
    above = text[:begin].rstrip().rsplit("\n", 1)[-1]
    line = _line(text, found).strip()
    if "ELMAX" in above:
        line = f"{above.strip()} {line}"
    return " ".join(line.split())


# ---- results --------------------------------------------------------------------


def _constants(
    path: Path,
    read: Callable[[Path], HarmonicConstants],
    manifest: dict[str, Any],
) -> HarmonicConstants:
    if not path.is_file():
        raise EngineError(
            f"{path}: is not there although ADCIRC says that it ended normally; look "
            f"at {path.parent / LOG} for the harmonic analysis"
        )
    newest = max((path.parent / name).stat().st_mtime for name in manifest["inputs"])
    if path.stat().st_mtime < newest:
        raise EngineError(
            f"{path}: is older than the inputs of the run, so it belongs to another "
            "one; remove it and run again"
        )
    try:
        constants = read(path)
    except InputError as error:
        raise EngineError(
            f"the result of ADCIRC cannot be used: {error}\nthe run directory "
            f"{path.parent} is kept; take a shorter adcirc.time_step_s if the run blew "
            "up, run again if the file was cut off"
        ) from error
    wanted = manifest["nodes"], len(manifest["constituents"])
    got = constants.values.shape[1], constants.values.shape[0]
    if got != wanted:
        raise EngineError(
            f"{path}: has {got[0]} nodes and {got[1]} constituents, the run has "
            f"{wanted[0]} and {wanted[1]}: it belongs to another run"
        )
    frequency = np.array(manifest["frequency"])
    if np.abs(constants.frequency - frequency).max() > 1e-9:
        k = int(np.argmax(np.abs(constants.frequency - frequency)))
        raise EngineError(
            f"{path}: constituent {k + 1} has the frequency "
            f"{constants.frequency[k]:.9g} rad/s, {manifest['constituents'][k]} has "
            f"{frequency[k]:.9g}: it belongs to another run"
        )
    return constants


def _largest(
    constants: HarmonicConstants,
    path: Path,
    limit: float,
    unit: str,
    manifest: dict[str, Any],
) -> float:
    size = np.abs(constants.values)
    finite = np.isfinite(size)
    # With wetting, nodes that were dry throughout have no value.
    if not finite.all() and not (manifest["wetting"] and finite.any()):
        node = int(np.argwhere(~finite)[0][1]) + 1
        raise EngineError(
            f"{path}: node {node} and others have no finite value, although ADCIRC "
            "ended normally: the run blew up; take a shorter adcirc.time_step_s. The "
            "run directory is kept"
        )
    largest = float(np.nanmax(size))
    if largest > limit:
        where = np.unravel_index(int(np.nanargmax(size)), size.shape)
        raise EngineError(
            f"{path}: {manifest['constituents'][where[0]]} at node {where[1] + 1} is "
            f"{largest:.3g} {unit}, although ADCIRC ended normally: the run blew up; "
            "take a shorter adcirc.time_step_s. The run directory is kept"
        )
    return largest


# ---- what the logs say ----------------------------------------------------------


def _version(logs: dict[Path, str]) -> str:
    for text in logs.values():
        found = _VERSION.search(text)
        if found:
            return found[1]
    return ""


def _iterations(logs: dict[Path, str]) -> int:
    return max(
        (int(n) for text in logs.values() for n in _ITERATIONS.findall(text)), default=0
    )


def _warnings(logs: dict[Path, str]) -> tuple[str, ...]:
    """Warning lines, each with what follows a heading that ends in it."""
    kept: dict[str, None] = {}
    for text in logs.values():
        lines = text.splitlines()
        for number, line in enumerate(lines):
            if line.lstrip().startswith(_PASSING):
                continue
            if _HEADING.search(line):
                kept[_below(lines[number + 1 : number + 12])] = None
            elif "Elevation.gt.WarnElev" in line:
                # One for the whole run: every step of a surge prints its own.
                kept["Elevation.gt.WarnElev: higher than the warning level"] = None
            elif _WARNING.search(line):
                kept[" ".join(line.split())] = None
    return tuple(kept)


def _below(lines: list[str]) -> str:
    """What a heading warns of: up to ADCIRC's decision, or the next line."""
    text = [" ".join(line.split()) for line in lines]
    ends = [k for k, line in enumerate(text) if "EXECUTION WILL" in line]
    if ends:
        return " ".join(line for line in text[: ends[0]] if line)
    return next((line for line in text if line), "")
