"""Imitates what an ADCIRC run leaves behind, well or badly: see `BEHAVIOURS`.

A test copies this file, with a first line and the two names below filled in, to where
the engine looks for a program. What it prints are ADCIRC's own words.
"""

import os
import shutil
import signal
import sys
import time
from pathlib import Path

BEHAVIOUR = "success"
RESULTS = ""

VERSION = "ADCIRC Version is v56.2.0"
STEP = " TIME STEP ={:8d} {:6.2f}% COMPLETE     ITERATIONS ={:5d}     TIME =  0.1E+05"
NORMALLY = "INFO: ADCIRC_Final: ADCIRC terminating normally"
BLOW_UP = """ TIME STEP =      12     ITERATIONS =   12     TIME =  0.36000000E+05
  ELMAX =  1.5836E+003 AT NODE         6  SPEEDMAX =  5.1226E+002 AT NODE         7
  ** ERROR: Elevation.gt.ErrorElev, ADCIRC stopping. **
ERROR: timestep: Elevation exceeded ErrorElev threshold
ERROR: timestep: ADCIRC terminating with error code: 1"""


def say(text, *, log=True):
    print(text, flush=True)
    if log:
        with open("fort.16", "a", encoding="ascii") as file:
            file.write(text + "\n")


def step_through(iterations=12):
    for step in (10, 20, 30):
        say(STEP.format(step, step / 0.3, iterations), log=False)


def give(*numbers, end=NORMALLY):
    for number in numbers or (53, 54):
        shutil.copyfile(Path(RESULTS) / f"fort.{number}", f"fort.{number}")
    if end:
        say(end)


def change(number, old, new):
    path = Path(f"fort.{number}")
    path.write_text(path.read_text().replace(old, new, 1))


def success():
    step_through()
    give()


def warns():
    say(" !!!!!!!!!!  WARNING - NONFATAL INPUT ERROR  !!!!!!!!!")
    say("\n TYPICALLY YOUR INPUT VALUE FOR TAU0 SHOULD BE SET EQUAL TO TAU")
    for _ in range(3):
        say("  ELMAX =  2.1E+001 AT NODE  6  ** WARNING: Elevation.gt.WarnElev **")
    success()


def blow_up():
    say(BLOW_UP)
    return 1


def blow_up_of_rank_0():
    # MPI gives the number of the rank that aborts for an exit code.
    say(BLOW_UP, log=False)
    return 0


def not_a_number():
    give()
    path = Path("fort.53")
    lines = path.read_text().splitlines()
    lines[4] = "               NaN         NaN"
    path.write_text("\n".join(lines) + "\n")


def huge():
    give()
    lines = Path("fort.53").read_text().splitlines()
    lines[4] = "    2.47435086E+151    270.0445"
    Path("fort.53").write_text("\n".join(lines) + "\n")


def no_elevation():
    give(54)


def cut_off():
    give()
    text = Path("fort.54").read_text()
    Path("fort.54").write_text(text[: len(text) // 2])


def of_another_mesh():
    give()
    for number in (53, 54):
        lines = Path(f"fort.{number}").read_text().splitlines()
        lines[2] = str(int(lines[2]) - 1)
        Path(f"fort.{number}").write_text("\n".join(lines[:-2]) + "\n")


def bad_option():
    say(
        "ERROR: read_input: Your selection of NOLIBF (a UNIT 15 input parameter) is "
        "not an allowable value."
    )
    return 1


def fort15_ends():
    say("     CONSTANT CORIOLIS COEFFICIENT = 0.00000000E+00     1/SEC")
    say("At line 3349 of file read_input.F (unit = 15)", log=False)
    say("Fortran runtime error: End of file", log=False)
    return 2


def garbage_mesh():
    say("ERROR: read14: Reading line 5 gave the following error code: 5010.")
    return 1


def no_file():
    say("ERROR: openFileForRead: Required file not found: ./fort.15")
    return 1


def not_converged():
    step_through(iterations=100)
    give()


def converged_but_once():
    # From then on every step is "solved" in one iteration.
    step_through(iterations=1)
    say("     in itpackv routine jcg\n     failure to converge in  100 iterations")
    give()


def crash():
    say(NORMALLY.replace("terminating normally", "begins"))
    os.kill(os.getpid(), signal.SIGSEGV)


def stops_in_between():
    step_through()
    say("INFO: ADCIRC_Run: Begin timestepping.")


def root_refused():
    say("mpirun has detected an attempt to run as root.", log=False)
    return 1


def hangs():
    step_through()
    time.sleep(60)


def crash_136():
    print("Program received signal SIGFPE: Floating-point exception", flush=True)
    return 136


def nothing():
    return 0


if __name__ == "__main__":
    print(VERSION, sys.argv[1:], flush=True)
    sys.exit(globals()[BEHAVIOUR]() or 0)
