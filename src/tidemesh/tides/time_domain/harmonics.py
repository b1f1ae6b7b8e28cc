"""Harmonic constants of every node by least squares, without keeping the series."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from tidemesh.constants import frequency as frequency_of
from tidemesh.datatypes import TideForcing
from tidemesh.errors import InputError
from tidemesh.tides.time_domain import _kernels as kernels

COMPOUNDS: dict[str, tuple[tuple[str, int], ...]] = {
    "M4": (("M2", 2),),
    "M6": (("M2", 3),),
    "M8": (("M2", 4),),
    "S4": (("S2", 2),),
    "S6": (("S2", 3),),
    "MS4": (("M2", 1), ("S2", 1)),
    "MN4": (("M2", 1), ("N2", 1)),
    "MK3": (("M2", 1), ("K1", 1)),
    "2MK3": (("M2", 2), ("K1", -1)),
    "2SM2": (("S2", 2), ("M2", -1)),
    "MSF": (("S2", 1), ("M2", -1)),
}
"""Overtides and compound tides: the constituents that make them, and how often."""

OVERTIDES = ("M4", "M6", "STEADY")
"""What a nonlinear run is analysed for besides the constituents of its forcing."""

_BATCH = 32
_CONDITION = 1.0e8

_log = logging.getLogger(__name__)


class Constituent(NamedTuple):
    """What the analysis has to know of a constituent."""

    name: str
    frequency: float
    """rad/s."""
    factor: float
    """Nodal factor."""
    argument: float
    """Equilibrium argument at time 0 (rad)."""


def analysed_constituents(
    forcing: TideForcing, names: Sequence[str] | None, nonlinear: bool
) -> tuple[Constituent, ...]:
    """Constituents of an analysis with their nodal factors and arguments.

    Those of the forcing have the forcing's; overtides and compound tides get the
    product of the factors, and the sum of the arguments, of what makes them.

    Raises
    ------
    InputError
        If a constituent is neither in the forcing nor made by those that are.
    """
    n_c = len(forcing.names)
    factor = np.ones(n_c) if forcing.nodal_factor is None else forcing.nodal_factor
    argument = np.zeros(n_c) if forcing.argument is None else forcing.argument
    given = {
        name.upper(): Constituent(name, float(w), float(f), float(a))
        for name, w, f, a in zip(forcing.names, forcing.frequency, factor, argument)
    }
    if names is None:
        names = forcing.names
        if nonlinear:
            made = [n for n in OVERTIDES if n not in given and _parts(n, given)]
            names = (*names, *made)
    return tuple(_constituent(name, given) for name in names)


def _parts(name: str, given: dict[str, Constituent]) -> bool:
    parts = COMPOUNDS.get(name, ())
    return name == "STEADY" or (bool(parts) and all(p in given for p, _ in parts))


def _constituent(name: str, given: dict[str, Constituent]) -> Constituent:
    key = name.upper()
    if key in given:
        return given[key]
    if key == "STEADY":
        return Constituent(name, 0.0, 1.0, 0.0)
    if not _parts(key, given):
        try:
            speed = f" (rad/s: {frequency_of(key):.9g})"
        except KeyError:
            speed = ""
        raise InputError(
            f'the harmonic analysis cannot have "{name}": it is not in the forcing '
            f"({', '.join(c.name for c in given.values())}), nor an overtide of what "
            f"is; add it to the forcing{speed}, with zero amplitude if it is not driven"
        )
    frequency, factor, argument = 0.0, 1.0, 0.0
    for part, times in COMPOUNDS[key]:
        frequency += times * given[part].frequency
        factor *= given[part].factor ** abs(times)
        argument += times * given[part].argument
    return Constituent(name, frequency, factor, argument)


class HarmonicSums:
    """Normal equations of the harmonic analysis of several nodal fields.

    Samples are added one after another, so that the sums do not depend on when they
    are saved and taken up again.

    Parameters
    ----------
    constituents : sequence of Constituent
    size : int
        Values of a sample.
    """

    def __init__(self, constituents: Sequence[Constituent], size: int):
        self.constituents = tuple(constituents)
        columns = _basis(self.constituents, np.zeros(1)).shape[1]
        self.normal = np.zeros((columns, columns))
        self.sums = np.zeros((columns, size))
        self.count = 0
        self._basis = np.empty((_BATCH, columns))
        self._samples = np.empty((_BATCH, size))
        self._waiting = 0

    def add(self, time: float, sample: np.ndarray) -> None:
        """Add a sample (size,) at a time (s)."""
        row = _basis(self.constituents, np.array([time]))[0]
        self.normal += np.outer(row, row)
        self._basis[self._waiting] = row
        self._samples[self._waiting] = sample
        self._waiting += 1
        self.count += 1
        if self._waiting == _BATCH:
            self.flush()

    def flush(self) -> None:
        """Bring the sums up to date."""
        kernels.accumulate(
            self.sums, self._basis[: self._waiting], self._samples[: self._waiting]
        )
        self._waiting = 0

    def solve(self) -> np.ndarray:
        """(n_c, size) complex amplitudes, nodal factors and arguments divided out."""
        self.flush()
        solved = np.linalg.solve(self.normal, self.sums)
        answer = np.empty((len(self.constituents), self.sums.shape[1]), dtype=complex)
        column = 0
        for k, c in enumerate(self.constituents):
            answer[k] = solved[column]
            column += 1
            if c.frequency != 0.0:
                answer[k] += 1j * solved[column]
                column += 1
        return answer


def check_window(constituents: Sequence[Constituent], times: np.ndarray) -> None:
    """See beforehand that samples at some times (s) tell the constituents apart.

    Pairs that beat more slowly than the window is long are logged.

    Raises
    ------
    InputError
        If they do not.
    """
    basis = _basis(constituents, times)
    condition = np.inf
    if len(times) >= basis.shape[1]:
        condition = np.linalg.cond(basis.T @ basis)
    length = times[-1] - times[0] if len(times) else 0.0
    if not condition < _CONDITION:
        raise InputError(
            f"the harmonic analysis over {length / 86400.0:.2f} days ({len(times)} "
            "samples) cannot tell the constituents "
            f"{', '.join(c.name for c in constituents)} apart: analyse a longer part "
            "of the run (analysis_start_day), more often (analysis_every_s), or for "
            "fewer constituents (constituents; [] for none)"
        )
    for k, one in enumerate(constituents):
        for other in constituents[:k]:
            beats = abs(one.frequency - other.frequency) * length / (2.0 * np.pi)
            if beats < 1.0:
                _log.warning(
                    "%s and %s beat %.2f times in the %.1f days of the harmonic "
                    "analysis: their constants will not be well told apart",
                    other.name,
                    one.name,
                    beats,
                    length / 86400.0,
                )


def _basis(constituents: Sequence[Constituent], times: np.ndarray) -> np.ndarray:
    """(n, columns) factors of the real and imaginary parts at some times."""
    columns = []
    for c in constituents:
        phase = c.frequency * times + c.argument
        columns.append(c.factor * np.cos(phase))
        if c.frequency != 0.0:
            columns.append(-c.factor * np.sin(phase))
    return np.stack(columns, axis=1)
