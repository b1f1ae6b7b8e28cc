"""Time averages of nonlinear terms, without time.

The tide is a function of a few independent phases, those of its fundamental
constituents; every other phase is an integer combination of them (O1 = M2 - K1,
M4 = 2 M2, MS4 = M2 + S2, STEADY = 0). A long average over time is the average over all
values of these phases, which a lattice of few points gives almost exactly for smooth
functions (Sloan & Joe 1994, Lattice methods for multiple integration).
"""

from __future__ import annotations

from functools import cache

import numpy as np

SAME_FREQUENCY = 1.0e-9
"""rad/s: one turn in two hundred years. Tidal lines that differ by less differ in the
motion of the perihelion alone, or in the digits of a table."""

LARGEST_ORDER = 8
"""Sum of the integers of a combination: M8 is 4 M2, or four times K1 + O1."""

HIGHEST_HARMONIC = 32
"""The same where all constituents are harmonics of one."""

SAMPLES = (1, 64, 251, 509, 751, 1009)
"""Lattice points for 0, 1, 2 ... fundamental phases."""

_PER_HARMONIC = 16
_MANY = 4_000
_DECAY = 0.35
_EVEN = 0.1


def integer_phases(frequency: np.ndarray, weight: np.ndarray) -> np.ndarray:
    """Express the phase of every constituent by a few independent ones.

    Parameters
    ----------
    frequency : (n_c,) float array
        rad/s.
    weight : (n_c,) float array
        The heaviest constituents become the fundamental ones.

    Returns
    -------
    combination : (n_c, n_fundamental) int array
        Phase k = sum of combination[k] * fundamental phases. A fundamental
        constituent has a single 1 in its row.
    """
    combination = np.zeros((len(frequency), 0), dtype=np.int64)
    fundamental: list[int] = []
    for k in np.argsort(-np.asarray(weight), kind="stable"):
        known = as_combination(frequency[k], frequency[fundamental])
        if known is None:
            fundamental.append(int(k))
            zeros = np.zeros((len(frequency), 1), dtype=np.int64)
            combination = np.column_stack([combination, zeros])
            known = np.append(np.zeros(len(fundamental) - 1, dtype=np.int64), 1)
        combination[k] = known
    return combination


def as_combination(
    frequency: float, fundamental: np.ndarray, *, tolerance: float = SAME_FREQUENCY
) -> np.ndarray | None:
    """Smallest integers with which the fundamental frequencies add up to another.

    Returns
    -------
    integers : (n_fundamental,) int array, or None if there are none.
    """
    size = len(fundamental)
    # All combinations of many constituents are too many, and the high ones are weak.
    order = HIGHEST_HARMONIC if size == 1 else LARGEST_ORDER
    while order > 3 and len(_integers(size, order)) > 50 * _MANY:
        order -= 1
    trial = _integers(size, order)
    gap = np.abs(trial @ np.asarray(fundamental, dtype=np.float64) - frequency)
    fits = np.flatnonzero(gap <= tolerance)
    if len(fits) == 0:
        return None
    length = np.abs(trial[fits]).sum(axis=1)
    return trial[fits[np.lexsort((gap[fits], length))[0]]]


class PhaseLattice:
    """Samples of the tide over its fundamental phases.

    Parameters
    ----------
    combination : (n_c, n_fundamental) int array
        From `integer_phases`.

    Attributes
    ----------
    basis : (n_samples, 2 n_c) float array
        Samples = basis @ [real parts, imaginary parts of the amplitudes].
    """

    def __init__(self, combination: np.ndarray):
        size = combination.shape[1]
        n = SAMPLES[min(size, len(SAMPLES) - 1)]
        if size == 1:
            n = max(n, _PER_HARMONIC * int(np.abs(combination).max()))
        generator = _generator(n, tuple(map(tuple, combination.tolist())))
        turns = (combination @ np.array(generator, dtype=np.int64)) % n
        phase = 2.0 * np.pi / n * (np.outer(np.arange(n), turns) % n)
        self.basis = np.concatenate([np.cos(phase), -np.sin(phase)], axis=1)
        weight = np.where(combination.any(axis=1), 2.0, 1.0) / n
        self._weight = np.concatenate([weight, weight])[:, None]

    def samples(self, amplitudes: np.ndarray) -> np.ndarray:
        """(n_c, n) complex amplitudes -> (n_samples, n) values."""
        return self.basis @ np.concatenate([amplitudes.real, amplitudes.imag])

    def amplitudes(self, samples: np.ndarray) -> np.ndarray:
        """(n_samples, n) values -> (n_c, n) complex amplitudes."""
        real, imag = np.split(self._weight * (self.basis.T @ samples), 2)
        return real + 1j * imag


@cache
def _integers(size: int, order: int) -> np.ndarray:
    """All (n, size) integer vectors whose absolute values add up to `order` at most."""
    vectors, length = np.zeros((1, 0), dtype=np.int64), np.zeros(1, dtype=np.int64)
    for _ in range(size):
        longer, lengths = [], []
        for value in range(-order, order + 1):
            fits = length + abs(value) <= order
            column = np.full((int(fits.sum()), 1), value)
            longer.append(np.concatenate([vectors[fits], column], axis=1))
            lengths.append(length[fits] + abs(value))
        vectors, length = np.concatenate(longer), np.concatenate(lengths)
    return vectors


@cache
def _generator(n: int, combination: tuple[tuple[int, ...], ...]) -> tuple[int, ...]:
    """Generating vector (1, a, a**2 ...) mod n with the least aliasing.

    Other combinations that look like one of the constituents on the lattice fall on it.
    How strong they are is modelled on the friction |u| u of one large and several
    smaller constituents: slow decay along the first, geometric along the others, and
    little in combinations of even order.
    """
    rows = np.array(combination, dtype=np.int64).reshape(len(combination), -1)
    size = rows.shape[1]
    if size <= 1:
        return (1,) * size
    order = 12
    while order > 4 and len(_integers(size, order)) > 10 * _MANY:
        order -= 1
    trial = _integers(size, order)
    others = np.abs(trial[:, 1:]).sum(axis=1)
    strength = (1.0 + np.abs(trial[:, 0])) ** -3.0 * _DECAY**others
    strength[np.abs(trial).sum(axis=1) % 2 == 0] *= _EVEN
    heavy = np.argsort(-strength, kind="stable")[: 3 * _MANY]
    trial, strength = trial[heavy], strength[heavy]
    best, chosen = np.inf, (1,) * size
    for a in range(2, n // 2 + 1):
        vector = tuple(pow(a, power, n) for power in range(size))
        turns = (rows @ np.array(vector)) % n
        if len(np.unique(turns)) < len(turns):
            continue
        # The constituents themselves are in the sum, whatever the generator.
        seen = np.bincount((trial @ np.array(vector)) % n, strength, n)[turns].sum()
        if seen < best:
            best, chosen = seen, vector
    return chosen
