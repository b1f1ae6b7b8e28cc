"""Linear friction that takes as much of a tide as a quadratic law does."""

from __future__ import annotations

import numpy as np

from tidemesh.tides.frequency_domain.sampling import PhaseLattice, integer_phases

_SLOW_M_S = 1.0e-9
_CHUNK = 512


def equivalent_friction(
    velocity: np.ndarray, frequency: np.ndarray, coefficient: np.ndarray
) -> np.ndarray:
    """Linear coefficient of every constituent, from the mean bottom stress.

    The stress c |u| u is projected on each constituent and divided by its velocity, so
    that the same work is done. For one constituent along a line this is Lorentz's
    8 / (3 pi) c |U|.

    Parameters
    ----------
    velocity : (n_c, n_points, 2) complex array
        m/s, with their phases at one common time.
    frequency : (n_c,) array
        rad/s.
    coefficient : (n_points,) array
        C_f / depth, 1/m.

    Returns
    -------
    friction : (n_c, n_points) array
        1/s, not negative; where a constituent does not move, that of the mean speed.
    """
    weight = (np.abs(velocity) ** 2).mean(axis=(1, 2))
    lattice = PhaseLattice(integer_phases(frequency, weight))
    ratio = np.empty(velocity.shape[:2])
    for first in range(0, velocity.shape[1], _CHUNK):
        part = slice(first, first + _CHUNK)
        u, v = velocity[:, part, 0], velocity[:, part, 1]
        along, across = lattice.samples(u), lattice.samples(v)
        speed = np.hypot(along, across)
        stress = (
            lattice.amplitudes(speed * along) * u.conj()
            + lattice.amplitudes(speed * across) * v.conj()
        )
        square = np.abs(u) ** 2 + np.abs(v) ** 2
        slow = square <= _SLOW_M_S**2
        mean = np.broadcast_to(speed.mean(axis=0), square.shape)
        ratio[:, part] = np.where(slow, mean, stress.real / np.where(slow, 1.0, square))
    return coefficient * np.maximum(ratio, 0.0)
