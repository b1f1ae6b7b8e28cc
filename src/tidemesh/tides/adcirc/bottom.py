"""Linear friction that takes as much of a tide as a quadratic law does."""

from __future__ import annotations

import numpy as np

from tidemesh.tides.frequency_domain.nonlinear_terms import NonlinearTerms, Places
from tidemesh.tides.frequency_domain.sampling import PhaseLattice, integer_phases
from tidemesh.tides.settings import TideSettings


def equivalent_friction(
    frequency: np.ndarray,
    velocity: np.ndarray,
    elevation: np.ndarray,
    places: Places,
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
    places : Places
        Depth and drag of the nodes.
    settings : TideSettings
        With a friction law that is not linear.
    driven : (n_c,) bool array, optional
        False for constituents that the nonlinear terms make: theirs is the mean
        derivative of the stress, since work tells nothing about them.

    Returns
    -------
    friction : (n_c, n_points) array
        1/s, as the embedded engine reports it.
    """
    weight = np.sqrt((np.abs(velocity) ** 2).mean(axis=(1, 2)))
    lattice = PhaseLattice(integer_phases(frequency, weight))
    terms = NonlinearTerms(lattice, places, settings)
    current = np.ascontiguousarray(velocity.transpose(0, 2, 1))
    force = terms.evaluate(current, elevation).friction
    slope = terms.mean_slope(current)
    mean = 0.5 * (slope[0] + slope[2])
    square = (np.abs(current) ** 2).sum(axis=1)
    work = (current.conj() * force).real.sum(axis=1)
    # Where one velocity nearly vanishes, the others decide about its friction.
    friction = np.clip(work / (square + np.finfo(float).tiny), 0.0, 2.0 * mean)
    if driven is not None:
        friction[~driven] = mean
    return friction
