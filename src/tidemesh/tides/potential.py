"""Equilibrium tide: the elevation that balances the astronomical forces.

Amplitudes are those of Schwiderski (1980, Rev. Geophys. 18), which ADCIRC's users
enter as TPK, for the eleven constituents that he gives; for the others those of
Cartwright and Edden (1973, Geophys. J. R. astr. Soc. 33) times 0.993, the ratio of the
two for the eleven. Factors of the yielding solid earth, 1 + k - h, are those of Wahr
(1981, Geophys. J. R. astr. Soc. 64), with the resonance of the earth's core near K1.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from tidemesh.datatypes import CoastalMesh, TideForcing
from tidemesh.errors import InputError


class PotentialConstituent(NamedTuple):
    """The equilibrium tide of one constituent."""

    species: int
    """Cycles a day: 0 long-period, 1 diurnal, 2 semidiurnal."""
    amplitude: float
    """m, of the tide on a rigid earth (ADCIRC's TPK)."""
    body_factor: float
    """1 + k - h, what a yielding earth leaves of it (ADCIRC's ETRF)."""


POTENTIAL = {
    "M2": PotentialConstituent(2, 0.242334, 0.693),
    "S2": PotentialConstituent(2, 0.112841, 0.693),
    "N2": PotentialConstituent(2, 0.046398, 0.693),
    "K2": PotentialConstituent(2, 0.030704, 0.693),
    "NU2": PotentialConstituent(2, 0.008814, 0.693),
    "MU2": PotentialConstituent(2, 0.007411, 0.693),
    "L2": PotentialConstituent(2, 0.006850, 0.693),
    "T2": PotentialConstituent(2, 0.006597, 0.693),
    "2N2": PotentialConstituent(2, 0.006141, 0.693),
    "LAM2": PotentialConstituent(2, 0.001787, 0.693),
    "R2": PotentialConstituent(2, 0.000944, 0.693),
    "K1": PotentialConstituent(1, 0.141565, 0.736),
    "O1": PotentialConstituent(1, 0.100514, 0.695),
    "P1": PotentialConstituent(1, 0.046843, 0.706),
    "Q1": PotentialConstituent(1, 0.019256, 0.695),
    "J1": PotentialConstituent(1, 0.007909, 0.691),
    "M1": PotentialConstituent(1, 0.007909, 0.696),
    "OO1": PotentialConstituent(1, 0.004330, 0.693),
    "RHO": PotentialConstituent(1, 0.003659, 0.695),
    "2Q1": PotentialConstituent(1, 0.002547, 0.694),
    "MF": PotentialConstituent(0, 0.041742, 0.693),
    "MM": PotentialConstituent(0, 0.022026, 0.693),
    "SSA": PotentialConstituent(0, 0.019446, 0.693),
    "MSF": PotentialConstituent(0, 0.003652, 0.693),
}
"""Constituents that moon and sun drive directly. S1 and SA are made by the weather, and
those of shallow water by other tides."""

_SPELLINGS = {"LAMBDA2": "LAM2", "LDA2": "LAM2", "RHO1": "RHO", "NO1": "M1"}


def equilibrium_tide(
    mesh: CoastalMesh,
    names: Sequence[str],
    *,
    amplitude: ArrayLike | None = None,
    body_factor: ArrayLike | None = None,
) -> np.ndarray:
    """Equilibrium tide at the points of a mesh, times the body-tide factor.

    Zero for every constituent outside `POTENTIAL`: nothing pulls at M4 or the steady
    part.

    Parameters
    ----------
    mesh : CoastalMesh
    names : sequence of str
        Constituents.
    amplitude, body_factor : (n_c,) array, optional
        In place of the tabulated ones (m, 1), for instance those of a fort.15.

    Returns
    -------
    tide : (n_c, n_points) complex array
        m; with nodal factor f and argument V + u at a reference time the tide is
        Re(f tide exp(i (w (t - t_ref) + V + u))), as for any Greenwich constant.

    Raises
    ------
    InputError
        If the mesh has no projection, so that its longitudes are not known.

    Notes
    -----
    With latitude phi and longitude lambda: A cos(phi)^2 exp(2 i lambda) semidiurnal,
    A sin(2 phi) exp(i lambda) diurnal, A (1/2 - 3/2 sin(phi)^2) long-period; A positive
    with Schureman's arguments.
    """
    if not mesh.projection.crs:
        raise InputError(
            "the tidal potential needs longitudes and latitudes, and this mesh lies on "
            "a bare plane: name the projection of its coordinates, or leave "
            "tidal_potential off"
        )
    longitude, latitude = np.radians(mesh.projection.inverse(mesh.points)).T
    shape = (
        0.5 - 1.5 * np.sin(latitude) ** 2,
        np.sin(2.0 * latitude) * np.exp(1j * longitude),
        np.cos(latitude) ** 2 * np.exp(2j * longitude),
    )
    tide = np.zeros((len(names), len(mesh.points)), dtype=np.complex128)
    for k, name in enumerate(names):
        constituent = potential_constituent(name)
        if constituent is None:
            continue
        size = constituent.amplitude if amplitude is None else np.asarray(amplitude)[k]
        factor = (
            constituent.body_factor
            if body_factor is None
            else np.asarray(body_factor)[k]
        )
        tide[k] = size * factor * shape[constituent.species]
    return tide


def potential_constituent(name: str) -> PotentialConstituent | None:
    """The entry of `POTENTIAL` for a name in any usual spelling, or None."""
    key = name.upper()
    return POTENTIAL.get(_SPELLINGS.get(key, key))


def with_potential(
    mesh: CoastalMesh,
    forcing: TideForcing,
    *,
    amplitude: ArrayLike | None = None,
    body_factor: ArrayLike | None = None,
) -> TideForcing:
    """Forcing with the equilibrium tide of its constituents inside the domain.

    Parameters, errors: as `equilibrium_tide`.
    """
    tide = equilibrium_tide(
        mesh, forcing.names, amplitude=amplitude, body_factor=body_factor
    )
    return replace(forcing, potential=tide)
