"""Linear friction that takes as much of a tide as a quadratic law does."""

from __future__ import annotations

import numpy as np

from tidemesh.tides.frequency_domain.sampling import PhaseLattice, integer_phases
from tidemesh.tides.settings import TideSettings

LEAST_WATER = 0.1
"""Least depth of water that friction sees, over the depth below mean level."""
_CHUNK = 512


def equivalent_friction(
    frequency: np.ndarray,
    velocity: np.ndarray,
    elevation: np.ndarray,
    depth: np.ndarray,
    drag: np.ndarray,
    settings: TideSettings,
    *,
    driven: np.ndarray | None = None,
) -> np.ndarray:
    """Linear coefficient of every constituent, from the mean bottom stress.

    The stress is projected on each constituent and divided by its velocity, so that the
    same work is done. For one constituent along a line this is Lorentz's
    8 / (3 pi) C_f |U| / h.

    Parameters
    ----------
    frequency : (n_c,) array
        rad/s.
    velocity : (n_c, n_points, 2) complex array
        m/s.
    elevation : (n_c, n_points) complex array
        m; counts where the settings have a finite amplitude.
    depth : (n_points,) array
        m.
    drag : (n_points,) array
        C_f, or g n**2 for Manning's formula.
    settings : TideSettings
        With a friction law that is not linear.
    driven : (n_c,) bool array, optional
        False for constituents that the nonlinear terms make: theirs is the mean
        derivative of the stress by the velocity, since work tells nothing about them.

    Returns
    -------
    friction : (n_c, n_points) array
        1/s, as the embedded engine reports it.
    """
    weight = np.sqrt((np.abs(velocity) ** 2).mean(axis=(1, 2)))
    lattice = PhaseLattice(integer_phases(frequency, weight))
    friction = np.empty(elevation.shape)
    for first in range(0, len(depth), _CHUNK):
        part = slice(first, first + _CHUNK)
        u, v = velocity[:, part, 0], velocity[:, part, 1]
        along, across = lattice.samples(u), lattice.samples(v)
        water = depth[part]
        if settings.finite_amplitude:
            rise = lattice.samples(elevation[:, part])
            water = np.maximum(water + rise, LEAST_WATER * water)
        shrink = np.cbrt(water) if settings.friction_law == "manning" else 1.0
        resistance = drag[part] * np.hypot(along, across) / (water * shrink)
        work = (
            lattice.amplitudes(resistance * along) * u.conj()
            + lattice.amplitudes(resistance * across) * v.conj()
        ).real
        # The derivative of |u| u is 2 |u| along the current and |u| across.
        slope = 1.5 * resistance.mean(axis=0)
        square = np.abs(u) ** 2 + np.abs(v) ** 2
        # Where one velocity nearly vanishes, the others decide about its friction.
        own = np.divide(
            work, square, out=np.tile(slope, (len(work), 1)), where=square > 0.0
        )
        friction[:, part] = np.clip(own, 0.0, 2.0 * slope)
        if driven is not None:
            friction[~driven, part] = slope
    return friction
