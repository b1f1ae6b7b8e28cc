"""What harmonic output leaves out: friction, rotation, and velocities if need be."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from tidemesh.datatypes import CoastalMesh, TideSolution
from tidemesh.tides.frequency_domain.velocity import nodal_velocity
from tidemesh.tides.frequency_domain.wave_equation import (
    Symbols,
    WaveEquation,
    coriolis_parameter,
)
from tidemesh.tides.settings import TideSettings


def complete_solution(
    mesh: CoastalMesh,
    names: Sequence[str],
    frequency: np.ndarray,
    elevation: np.ndarray,
    velocity: np.ndarray | None = None,
    settings: TideSettings | None = None,
) -> TideSolution:
    """Make a solution of harmonic constants that another model has written.

    Parameters
    ----------
    mesh : CoastalMesh
    names : sequence of str
    frequency : (n_c,) array
        rad/s.
    elevation : (n_c, n_points) complex array
        m.
    velocity : (n_c, n_points, 2) complex array, optional
        m/s along x and y. Left out: by the linear momentum equation with the
        settings' friction.
    settings : TideSettings, optional
        Friction law, rotation and gravity. Under a quadratic law the linear friction is
        Lorentz's, 8/(3 pi) C_f |u|/h of the strongest current, known where the
        velocities are.

    Returns
    -------
    tide : TideSolution

    Raises
    ------
    InputError, MeshError
        As `WaveEquation`, if velocities have to be computed.

    Notes
    -----
    Lorentz's linear friction spends the energy of the quadratic one (docs/method.md).
    """
    settings = TideSettings() if settings is None else settings
    friction = np.full(len(mesh.points), settings.friction)
    coriolis = coriolis_parameter(mesh, settings)
    if coriolis is not None:
        coriolis = np.broadcast_to(np.asarray(coriolis, float), len(mesh.points))
    if velocity is None:
        edge = mesh.open_nodes if len(mesh.open_nodes) else np.array([0])
        equation = WaveEquation(mesh, edge, settings)
        velocity = np.stack(
            [
                nodal_velocity(equation, row, Symbols.exact(w))
                for w, row in zip(frequency, elevation)
            ]
        )
    elif settings.friction_law != "linear":
        # Root sum of squares: the currents of several constituents act together.
        speed = np.sqrt((np.abs(velocity) ** 2).sum(axis=(0, 2)))
        drag = np.full(len(mesh.points), settings.drag_coefficient)
        if settings.friction_law == "manning":
            drag = settings.gravity * settings.manning_n**2 / np.cbrt(mesh.depth)
        friction = 8.0 / (3.0 * math.pi) * drag * speed / mesh.depth
    return TideSolution(
        names=tuple(names),
        frequency=np.asarray(frequency),
        elevation=elevation,
        velocity=velocity,
        friction=friction,
        gravity=settings.gravity,
        coriolis=coriolis,
    )
