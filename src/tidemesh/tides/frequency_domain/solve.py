"""The tide of a mesh, constituent by constituent."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

from tidemesh.datatypes import CoastalMesh, TideForcing, TideSolution
from tidemesh.errors import InputError
from tidemesh.tides.frequency_domain.elements import Elements
from tidemesh.tides.frequency_domain.velocity import nodal_velocity
from tidemesh.tides.frequency_domain.wave_equation import Symbols, WaveEquation
from tidemesh.tides.settings import TideSettings


def solve(
    mesh: CoastalMesh,
    forcing: TideForcing,
    settings: TideSettings | None = None,
    *,
    friction: float | np.ndarray | None = None,
    coriolis: float | np.ndarray | None = None,
    elements: Elements | None = None,
    symbols: Sequence[Symbols] | None = None,
    progress: Callable[[float], None] | None = None,
) -> TideSolution:
    """Solve the linear tide in the frequency domain.

    One sparse complex system for each constituent takes the place of weeks of time
    stepping (docs/method.md, section 4).

    Parameters
    ----------
    mesh : CoastalMesh
        Positive depths; the boundary is closed wherever the forcing has no node.
    forcing : TideForcing
        Elevation at the open boundary nodes.
    settings : TideSettings, optional
    friction : float, (n_points,) or (n_triangles,) array, optional
        Linear friction coefficient (1/s), instead of the settings' one value.
    coriolis : float or (n_points,) array, optional
        Coriolis parameter (rad/s), instead of what the settings say.
    elements : Elements, optional
        Geometry of the triangles, instead of what ``settings.metric`` says.
    symbols : sequence of Symbols, optional
        Discrete-time symbols of every constituent, to reproduce a time-stepping
        scheme; continuous time if not given.
    progress : callable, optional
        Called with the fraction done.

    Returns
    -------
    tide : TideSolution

    Raises
    ------
    InputError
        If the forcing is not finite.
    MeshError
        If a triangle is inverted or dry, or a node has no triangle.
    EngineError
        If there is no open boundary, or the equations are singular.
    """
    settings = TideSettings() if settings is None else settings
    _check_forcing(mesh, forcing)
    if symbols is None:
        symbols = [Symbols.exact(frequency) for frequency in forcing.frequency]
    report = progress if progress is not None else _ignore
    report(0.0)
    equation = WaveEquation(
        mesh,
        forcing.nodes,
        settings,
        friction=friction,
        coriolis=coriolis,
        elements=elements,
    )
    n_c = len(forcing.names)
    steps = 3 * n_c + 2
    report(2 / steps)
    elevation = np.empty((n_c, len(mesh.points)), dtype=np.complex128)
    velocity = np.empty((n_c, len(mesh.points), 2), dtype=np.complex128)
    for k in range(n_c):
        wave = equation.factorise(symbols[k])
        report((3 * k + 4) / steps)
        elevation[k] = wave.elevation(forcing.elevation[k])
        # The factors are by far the largest thing in memory.
        del wave
        velocity[k] = nodal_velocity(equation, elevation[k], symbols[k])
        report((3 * k + 5) / steps)
    return TideSolution(
        names=tuple(forcing.names),
        frequency=forcing.frequency,
        elevation=elevation,
        velocity=velocity,
        friction=equation.friction,
        gravity=settings.gravity,
        coriolis=equation.coriolis,
    )


@dataclass(frozen=True)
class FrequencyDomain:
    """The frequency-domain solver as a `TideEngine`."""

    settings: TideSettings = field(default_factory=TideSettings)

    def solve(self, mesh: CoastalMesh, forcing: TideForcing) -> TideSolution:
        """Solve with this engine's settings; see `solve`."""
        return solve(mesh, forcing, self.settings)


def _check_forcing(mesh: CoastalMesh, forcing: TideForcing) -> None:
    finite = np.isfinite(forcing.elevation)
    if not finite.all():
        constituent, place = np.argwhere(~finite)[0]
        node = int(forcing.nodes[place])
        raise InputError(
            f"the forcing of {forcing.names[constituent]} at ocean node {node} is not "
            f"a finite number: {forcing.elevation[constituent, place]}"
        )


def _ignore(_: float) -> None:
    pass
