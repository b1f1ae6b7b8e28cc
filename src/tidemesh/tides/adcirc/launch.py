"""Start ADCIRC, follow it, and never leave it running."""

from __future__ import annotations

import os
import re
import shlex
import shutil
import signal
import subprocess
import time
from collections.abc import Callable, Sequence
from pathlib import Path

from tidemesh.errors import EngineError, InputError
from tidemesh.tides.adcirc.settings import AdcircSettings

SCREEN = "screen.log"
"""What ADCIRC wrote to the screen, in the run directory."""

PARTITION, PREPARE = "adcprep_partmesh.log", "adcprep_prepall.log"
LOGS = (PARTITION, PREPARE, SCREEN)

_STEP = re.compile(rb"TIME STEP =\s*(\d+)")
_POLL_S = 0.1
_GRACE_S = 5.0


def commands(settings: AdcircSettings) -> tuple[tuple[list[str], str], ...]:
    """Commands to type in the run directory, each with the name of its log file."""
    if settings.ranks == 1:
        return (([_from_anywhere(settings.adcirc)], SCREEN),)
    prepare = [_from_anywhere(settings.adcprep), "--np", str(settings.ranks)]
    launcher = shlex.split(settings.launcher.replace("{ranks}", str(settings.ranks)))
    return (
        ([*prepare, "--partmesh"], PARTITION),
        ([*prepare, "--prepall"], PREPARE),
        ([*launcher, _from_anywhere(settings.padcirc)], SCREEN),
    )


def _from_anywhere(program: str) -> str:
    """A path holds in the run directory too; a name is looked for on the PATH."""
    return str(Path(program).absolute()) if Path(program).name != program else program


def command_line(settings: AdcircSettings) -> str:
    """The same as one line for a shell or a job script."""
    return " && ".join(
        f"{shlex.join(words)} > {log} 2>&1" for words, log in commands(settings)
    )


def missing_program(settings: AdcircSettings) -> str | None:
    """The first program that is not there, or None."""
    names = [words[0] for words, _ in commands(settings)]
    if settings.ranks > 1:
        names.append(settings.padcirc)
    for name in names:
        if shutil.which(name) is None:
            return name
    return None


def job_script(folder: Path, settings: AdcircSettings) -> Path:
    """Write the user's job script with its placeholders filled in.

    Raises
    ------
    InputError
        If the template cannot be read, or has no place for the command.
    """
    template = Path(str(settings.batch_template))
    try:
        text = template.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(
            f"adcirc.batch_template: {template}: cannot be read ({error})"
        ) from error
    if "{command}" not in text:
        raise InputError(
            f"adcirc.batch_template: {template}: has no {{command}}; write it where "
            f'the script starts ADCIRC, it becomes "{command_line(settings)}"'
        )
    # Plain replacement: shell scripts are full of other braces.
    for name, value in (
        ("{folder}", str(folder.resolve())),
        ("{ranks}", str(settings.ranks)),
        ("{command}", command_line(settings)),
    ):
        text = text.replace(name, value)
    path = folder / template.name
    path.write_text(text, encoding="utf-8", newline="\n")
    shutil.copymode(template, path)
    return path


def run_adcirc(
    folder: Path,
    settings: AdcircSettings,
    steps: int,
    progress: Callable[[float], None] | None = None,
) -> int:
    """Run ADCIRC in a directory; what it writes to the screen goes into log files.

    Parameters
    ----------
    folder : path
    settings : AdcircSettings
    steps : int
        Of the whole run, to tell the fraction done.
    progress : callable, optional
        Called with the fraction done.

    Returns
    -------
    exit_code : int
        Of the model; says little, see `check_run`.

    Raises
    ------
    EngineError
        If a program cannot be started, the preparation fails, or the time is over.
    """
    deadline = None
    if settings.timeout_s is not None:
        deadline = time.monotonic() + settings.timeout_s
    for words, log in commands(settings):
        code = _run(folder, words, folder / log, deadline, settings, steps, progress)
        if log != SCREEN and code != 0:
            raise EngineError(
                f"{shlex.join(words)} {_ending(code)}: {tail(folder / log)}\n"
                f"its messages are in {folder / log}; the run directory is kept. Use "
                f"fewer than {settings.ranks} ranks (1 needs no preparation), or look "
                "whether adcprep and padcirc are of one version"
            )
    return code


def tail(path: Path, lines: int = 3) -> str:
    """The last lines with text of a log file, to quote."""
    try:
        text = path.read_text(encoding="utf-8", errors="replace")
    except OSError:
        return f"({path} is not there)"
    # Not the rules between ADCIRC's paragraphs.
    kept = [line.strip() for line in text.splitlines() if line.strip(" _-\t")]
    return " | ".join(kept[-lines:]) if kept else "(it wrote nothing)"


def _run(
    folder: Path,
    words: Sequence[str],
    log: Path,
    deadline: float | None,
    settings: AdcircSettings,
    steps: int,
    progress: Callable[[float], None] | None,
) -> int:
    program = shutil.which(words[0])
    if program is None:
        raise EngineError(f"{words[0]}: there is no such program")
    # gfortran keeps 8 kB of the screen back otherwise, and with it the progress.
    environment = {**os.environ, "GFORTRAN_UNBUFFERED_PRECONNECTED": "1"}
    with open(log, "wb") as screen, open(log, "rb") as reader:
        try:
            process = subprocess.Popen(
                [str(Path(program).absolute()), *words[1:]],
                cwd=folder,
                stdin=subprocess.DEVNULL,
                stdout=screen,
                stderr=subprocess.STDOUT,
                env=environment,
                # Its own group, so that a launcher's children end with it.
                start_new_session=True,
            )
        except OSError as error:
            raise EngineError(
                f"{program} cannot be started ({error.strerror}): is it a program for "
                "this machine?"
            ) from error
        try:
            while True:
                try:
                    return process.wait(_POLL_S)
                except subprocess.TimeoutExpired:
                    pass
                if progress is not None and (found := _STEP.findall(reader.read())):
                    progress(min(int(found[-1]) / max(steps, 1), 1.0))
                if deadline is not None and time.monotonic() > deadline:
                    raise EngineError(
                        f"{words[0]} was stopped after adcirc.timeout_s = "
                        f"{settings.timeout_s:g} s; its last words: {tail(log)}\n"
                        f"the run directory is kept, the screen is in {log}; raise "
                        "the time, use more ranks, or a longer time_step_s"
                    )
        finally:
            # Ctrl-C and the time limit come this way too.
            _end(process)


def _end(process: subprocess.Popen) -> None:
    if process.poll() is not None:
        return
    # A launcher passes the first signal on to its ranks; the second leaves no choice.
    for number in (signal.SIGTERM, getattr(signal, "SIGKILL", signal.SIGTERM)):
        try:
            if hasattr(os, "killpg"):
                os.killpg(process.pid, number)
            else:
                process.kill()
            process.wait(_GRACE_S)
        except ProcessLookupError:
            return
        except subprocess.TimeoutExpired:
            continue
        else:
            return


def _ending(code: int) -> str:
    if code < 0:
        try:
            return f"crashed ({signal.Signals(-code).name})"
        except ValueError:
            return f"crashed (signal {-code})"
    if code > 128:
        return f"crashed (exit code {code}, signal {code - 128})"
    return f"failed (exit code {code})"
