"""ADCIRC as a `TideEngine`: write the run, run it or wait for it, read the tide."""

from __future__ import annotations

import logging
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from tidemesh.datatypes import CoastalMesh, TideForcing, TideSolution
from tidemesh.errors import EngineError
from tidemesh.tides.adcirc.bottom import equivalent_friction
from tidemesh.tides.adcirc.check import AdcircPending, RunReport, check_run
from tidemesh.tides.adcirc.control import RunInputs, harmonic_order, run_inputs
from tidemesh.tides.adcirc.folder import RunFolder, remove_results, write_inputs
from tidemesh.tides.adcirc.launch import (
    command_line,
    job_script,
    missing_program,
    run_adcirc,
)
from tidemesh.tides.adcirc.settings import AdcircSettings
from tidemesh.tides.frequency_domain.solve import drag_coefficient
from tidemesh.tides.settings import TideSettings

logger = logging.getLogger(__name__)


@dataclass
class Adcirc:
    """ADCIRC in a run directory of its own."""

    settings: AdcircSettings
    tide: TideSettings
    folder: Path
    _report: dict[str, Any] = field(default_factory=dict, init=False, repr=False)

    def solve(
        self,
        mesh: CoastalMesh,
        forcing: TideForcing,
        *,
        friction: float | np.ndarray | None = None,
        drag: float | np.ndarray | None = None,
        coriolis: float | np.ndarray | None = None,
        progress: Callable[[float], None] | None = None,
    ) -> TideSolution:
        """Write the run directory, run ADCIRC there, and read its harmonic constants.

        Results of the same inputs that are in the directory are read without a run, so
        that a job elsewhere, or an earlier call, is gone on from.

        Parameters
        ----------
        mesh : CoastalMesh
        forcing : TideForcing
        friction, drag, coriolis : float or (n_points,) array, optional
            See `run_inputs`.
        progress : callable, optional
            Called with the fraction done.

        Returns
        -------
        tide : TideSolution

        Raises
        ------
        AdcircPending
            If ADCIRC is not installed or a job script is wanted: the directory is ready
            and the message says what to do.
        EngineError
            If ADCIRC failed; see `check_run`.
        InputError, MeshError
            If the run cannot be put together; see `run_inputs` and `write_run`.
        """
        inputs = run_inputs(
            mesh,
            forcing,
            self.tide,
            self.settings,
            friction=friction,
            drag=drag,
            coriolis=coriolis,
        )
        run = write_inputs(self.folder, inputs, self.settings)
        for note in inputs.plan.notes:
            logger.info("%s: %s", run.path, note)
        results = self._results(run, progress)
        for warning in results.warnings:
            logger.warning("%s: ADCIRC warns: %s", run.path, warning)
        self._report = {
            "version": results.version,
            "plan": list(inputs.plan.notes),
            "warnings": list(results.warnings),
            "largest_elevation_m": results.largest_elevation_m,
            "largest_speed_m_s": results.largest_speed_m_s,
            "solver_iterations": results.solver_iterations,
        }
        return tide_solution(results, inputs, mesh, self.tide)

    def report(self) -> dict[str, Any]:
        """What there is to say of the last run: version, choices, warnings."""
        return dict(self._report)

    def _results(
        self, run: RunFolder, progress: Callable[[float], None] | None
    ) -> RunReport:
        waits = self.settings.batch_template is not None
        if not run.written:
            try:
                return check_run(run.path)
            except AdcircPending as pending:
                # A job that is on its way must not be disturbed.
                if waits:
                    raise self._pending(run, str(pending)) from None
            except EngineError as failure:
                if waits:
                    raise
                logger.warning("run again after: %s", failure)
        if waits:
            job_script(run.path, self.settings)
            raise self._pending(run, "")
        missing = missing_program(self.settings)
        if missing is not None:
            raise self._pending(run, f"{missing} is not installed")
        remove_results(run.path)
        code = run_adcirc(run.path, self.settings, run.manifest["steps"], progress)
        return check_run(run.path, exit_code=code)

    def _pending(self, run: RunFolder, reason: str) -> AdcircPending:
        if self.settings.batch_template is None:
            what = f"run there: {command_line(self.settings)}"
        else:
            name = Path(self.settings.batch_template).name
            what = f"submit {run.path / name}"
        return AdcircPending(
            (f"{reason}. " if reason else "")
            + f"The ADCIRC run directory is ready at {run.path}; {what}; when fort.16, "
            "fort.53 and fort.54 are there, repeat the same command"
        )


def tide_solution(
    results: RunReport, inputs: RunInputs, mesh: CoastalMesh, tide: TideSettings
) -> TideSolution:
    """Results of a run as the embedded engine gives them.

    Constituents in the order of the forcing; velocities along x and y of the mesh, also
    where ADCIRC's point east and north; nodes that were dry throughout are still.
    Quadratic friction as the linear coefficient of every constituent that does the same
    work.
    """
    forcing = inputs.forcing
    back = np.argsort(harmonic_order(forcing))
    elevation = np.nan_to_num(results.elevation.values[back])
    velocity = np.nan_to_num(results.velocity.values[back])
    if inputs.control.ics != 1:
        velocity = mesh.projection.from_east_north(mesh.points, velocity)
    coriolis = inputs.coriolis
    if coriolis is not None:
        coriolis = np.broadcast_to(coriolis, mesh.depth.shape)
    return TideSolution(
        names=tuple(forcing.names),
        frequency=forcing.frequency,
        elevation=elevation,
        velocity=velocity,
        friction=_friction(inputs, mesh, tide, elevation, velocity),
        gravity=tide.gravity,
        coriolis=coriolis,
    )


def _friction(
    inputs: RunInputs,
    mesh: CoastalMesh,
    tide: TideSettings,
    elevation: np.ndarray,
    velocity: np.ndarray,
) -> np.ndarray:
    depth = np.maximum(mesh.depth, inputs.plan.minimum_depth_m)
    coefficient = np.broadcast_to(inputs.coefficient, depth.shape)
    if tide.friction_law == "linear":
        return coefficient
    forcing = inputs.forcing
    # What the bottom felt were the currents of the run's own time.
    factor = 1.0 if forcing.nodal_factor is None else forcing.nodal_factor
    argument = 0.0 if forcing.argument is None else forcing.argument
    turn = np.broadcast_to(factor * np.exp(1j * np.asarray(argument)), len(velocity))
    driven = np.abs(forcing.elevation).max(axis=1, initial=0.0) > 0.0
    if forcing.potential is not None:
        driven |= np.abs(forcing.potential).max(axis=1) > 0.0
    return equivalent_friction(
        forcing.frequency,
        turn[:, None, None] * velocity,
        turn[:, None] * elevation,
        depth,
        drag_coefficient(mesh, tide, coefficient),
        tide,
        driven=driven,
    )
