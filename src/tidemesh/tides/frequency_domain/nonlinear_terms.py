"""The nonlinear terms of the shallow water equations, projected on the constituents.

    e_t + div((h + e) u) = 0
    u_t + f k x u = -g grad(e - p) - C_f |u| u / (h + e) - (u . grad) u

What is not linear is sampled over the phases of the tide and brought back to complex
amplitudes; so friction, the flux e u and the advection of momentum act on every
constituent, whatever their number.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from tidemesh.tides.frequency_domain.parallel import each
from tidemesh.tides.frequency_domain.sampling import PhaseLattice
from tidemesh.tides.settings import TideSettings

LEAST_WATER = 0.2
"""Least depth of water that friction sees, over the depth below mean level."""

_CHUNK = 64
_TINY = 1.0e-12
"""m/s, added to speeds that something is divided by."""


class Places(NamedTuple):
    """Where the terms are evaluated: triangles or nodes, with what friction needs."""

    depth: np.ndarray
    """(n,) m."""
    drag: np.ndarray
    """(n,) C_f; or for Manning's formula g n**2 (m^(1/3)), see `manning`."""


class Terms(NamedTuple):
    """Complex amplitudes of the nonlinear terms."""

    friction: np.ndarray
    """(n_c, 2, n) m/s2, C_f |u| u / (h + e)."""
    advection: np.ndarray | None
    """(n_c, 2, n) m/s2, (u . grad) u; None where it is left out."""
    flux: np.ndarray | None
    """(n_c, 2, n) m2/s, e u; None for a fixed depth."""


class NonlinearTerms:
    """Evaluates the nonlinear terms that the settings switch on.

    Parameters
    ----------
    lattice : PhaseLattice
    places : Places
    settings : TideSettings
    linear : (n,) array, optional
        Linear friction (1/s) in place of the drag, where the law is linear.
    """

    def __init__(
        self,
        lattice: PhaseLattice,
        places: Places,
        settings: TideSettings,
        linear: np.ndarray | None = None,
    ):
        self.lattice = lattice
        self.places = places
        self.settings = settings
        self.linear = linear

    def evaluate(
        self,
        velocity: np.ndarray,
        elevation: np.ndarray | None = None,
        shear: np.ndarray | None = None,
        *,
        transport: bool = True,
        carried: np.ndarray | None = None,
    ) -> Terms:
        """Project the terms on the constituents.

        Parameters
        ----------
        velocity : (n_c, 2, n) complex array
            m/s.
        elevation : (n_c, n) complex array, optional
            m; needed for a finite amplitude.
        shear : (n_c, 4, n) complex array, optional
            u_x, u_y, v_x, v_y (1/s); needed for the advection.
        transport : bool
            Whether the flux e u is wanted.
        carried : (n_c, 2, n) complex array, optional
            m/s; velocity that friction holds back where it is not the one whose speed
            makes the friction: a time-stepping model has the speed of the last level
            and the mean velocity of two.
        """
        finite = self.settings.finite_amplitude
        force = np.empty_like(velocity)
        flux = np.empty_like(velocity) if finite and transport else None
        advection = None if shear is None else np.empty_like(velocity)
        sample, project = self.lattice.samples, self.lattice.amplitudes

        def fill(part: slice) -> None:
            u, v = sample(velocity[:, 0, part]), sample(velocity[:, 1, part])
            drag, depth = self.places.drag[part], self.places.depth[part]
            water = depth
            if finite:
                rise = sample(elevation[:, part])
                if flux is not None:
                    flux[:, 0, part] = project(rise * u)
                    flux[:, 1, part] = project(rise * v)
                water = self._water(depth, rise)
            if shear is not None:
                ux, uy, vx, vy = (sample(shear[:, k, part]) for k in range(4))
                advection[:, 0, part] = project(u * ux + v * uy)
                advection[:, 1, part] = project(u * vx + v * vy)
            if self.linear is None:
                resistance = self._resistance(drag, water) * np.sqrt(u * u + v * v)
                if carried is not None:
                    u, v = sample(carried[:, 0, part]), sample(carried[:, 1, part])
                force[:, 0, part] = project(resistance * u)
                force[:, 1, part] = project(resistance * v)

        each(fill, self._parts(velocity.shape[-1]), self.settings.threads)
        if self.linear is not None:
            force[:] = self.linear * (velocity if carried is None else carried)
        return Terms(force, advection, flux)

    def mean_slope(
        self, velocity: np.ndarray, elevation: np.ndarray | None = None
    ) -> np.ndarray:
        """(3, n) mean derivative of the friction by the velocity (1/s): xx, xy, yy.

        With the friction split into this part, which is solved for, and the rest, which
        is lagged, an iteration changes little from step to step. Where the derivative
        has peaks of more than twice its mean (shallow water at low tide) it is raised
        to half of them, since the lagged rest would outweigh it.
        """
        n = velocity.shape[-1]
        if self.linear is not None:
            return np.stack([self.linear, np.zeros(n), self.linear])
        tensor = np.empty((3, n))

        def fill(part: slice) -> None:
            u = self.lattice.samples(velocity[:, 0, part])
            v = self.lattice.samples(velocity[:, 1, part])
            uu, vv = u * u, v * v
            speed = np.sqrt(uu + vv) + _TINY
            water = self.places.depth[part]
            if self.settings.finite_amplitude:
                water = self._water(water, self.lattice.samples(elevation[:, part]))
            scale = self._resistance(self.places.drag[part], water)
            tensor[0, part] = (scale * (speed + uu / speed)).mean(axis=0)
            tensor[1, part] = (scale * (u * v / speed)).mean(axis=0)
            tensor[2, part] = (scale * (speed + vv / speed)).mean(axis=0)
            # The sum of xx and yy is three times this.
            half_peak = 1.5 * (scale * speed).max(axis=0)
            mean = tensor[0, part] + tensor[2, part]
            tensor[:, part] *= np.maximum(half_peak / (mean + _TINY), 1.0)

        each(fill, self._parts(n), self.settings.threads)
        return tensor

    @staticmethod
    def _water(depth: np.ndarray, rise: np.ndarray) -> np.ndarray:
        return np.maximum(depth + rise, LEAST_WATER * depth)

    def _resistance(self, drag: np.ndarray, water: np.ndarray) -> np.ndarray:
        """C_f over the depth of water (1/m)."""
        if self.settings.friction_law == "manning":
            return drag / (water * np.cbrt(water))
        return drag / water

    def _parts(self, n: int) -> Iterator[slice]:
        # So few at a time that the samples stay in the cache.
        return (slice(first, first + _CHUNK) for first in range(0, n, _CHUNK))
