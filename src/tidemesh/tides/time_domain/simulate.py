"""A run in time: stations, harmonic constants, fields, restarts (paper, section 4)."""

from __future__ import annotations

import hashlib
import logging
import math
import signal
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import NamedTuple
from zipfile import BadZipFile

import msgspec
import numpy as np

from tidemesh.datatypes import CoastalMesh, TideForcing, TideRecord, TideSolution
from tidemesh.errors import EngineError, InputError
from tidemesh.io.files import atomic
from tidemesh.io.time_series import FieldWriter, utc, write_stations
from tidemesh.tides.settings import TideSettings
from tidemesh.tides.time_domain import _kernels as kernels
from tidemesh.tides.time_domain.discretisation import at
from tidemesh.tides.time_domain.harmonics import (
    HarmonicSums,
    analysed_constituents,
    check_window,
)
from tidemesh.tides.time_domain.settings import SimulationSettings
from tidemesh.tides.time_domain.stability import StepAdvice, chosen_step
from tidemesh.tides.time_domain.stepper import Stepper
from tidemesh.triangulation.locate import Locator

DAY = 86400.0
STATIONS, FIELDS, RESTART = "stations.nc", "fields.nc", "restart.npz"
"""Files of a run in its folder."""

_MOST_STEPS = 2000
_log = logging.getLogger(__name__)


class Station(NamedTuple):
    """Where a water level is recorded."""

    name: str
    longitude_deg: float
    latitude_deg: float


@dataclass(frozen=True, eq=False)
class SimulationResult:
    """What a run in time gives."""

    records: tuple[TideRecord, ...]
    """Water levels at the stations."""
    constants: TideSolution | None
    """Greenwich constants on all nodes, nodal factors divided out; None without
    harmonic analysis. Its friction is the mean of tau over the analysis."""
    time: np.ndarray
    """(n,) s since 1970-01-01 UTC, times of the volumes."""
    volume: np.ndarray
    """(n,) m3 of water in the mesh."""
    highest: np.ndarray
    """(n_points,) m, highest elevation of the samples."""
    fastest: np.ndarray
    """(n_points,) m/s, largest speed of the samples."""
    step_s: float
    """s."""
    steps: int
    """Number of steps of the whole run."""
    advice: StepAdvice
    """The longest stable step."""
    films: np.ndarray
    """(n_points,) number of steps in which a node was held at the minimum column."""
    film_volume: float
    """m3 of water that this added."""


def simulate(
    mesh: CoastalMesh,
    forcing: TideForcing,
    tide_settings: TideSettings | None = None,
    settings: SimulationSettings | None = None,
    *,
    stations: Sequence[Station] = (),
    folder: str | Path | None = None,
    restart: str | Path | None = None,
    friction: np.ndarray | None = None,
    drag: np.ndarray | None = None,
    progress: Callable[[float], None] | None = None,
) -> SimulationResult:
    """Run the tide in time.

    Parameters
    ----------
    mesh : CoastalMesh
        Positive depths.
    forcing : TideForcing
        Elevation at the open boundary nodes, and the potential if there is one; its
        arguments belong to the start of the run.
    tide_settings : TideSettings, optional
        Physics.
    settings : SimulationSettings, optional
    stations : sequence of Station
    folder : path, optional
        For ``stations.nc``, ``fields.nc`` and ``restart.npz``; no files if not given.
    restart : path, optional
        Go on from this restart file of the same run: the end is the same, bit by bit.
    friction, drag : (n_points,) array, optional
        Coefficient of the friction law at the nodes (1/s; C_f or Manning's n).
    progress : callable, optional
        Called with the fraction done.

    Returns
    -------
    result : SimulationResult

    Raises
    ------
    InputError
        If the step is unstable, a station lies outside, the forcing does not belong to
        the mesh, or a restart file to the run.
    EngineError
        If the run blows up; the last restart file stays.
    KeyboardInterrupt
        After the restart file is written.
    """
    tide = TideSettings() if tide_settings is None else tide_settings
    settings = SimulationSettings() if settings is None else settings
    run = _Run(mesh, forcing, tide, settings, stations, folder, friction, drag)
    if restart is not None:
        run.restore(restart)
    try:
        run.go(progress)
        result = run.result()
    finally:
        run.close()
    return result


def seconds_of(moment: str) -> float:
    """Seconds since 1970-01-01 UTC of an ISO 8601 time (UTC if it names no zone).

    Raises
    ------
    InputError
        If it is not a time.

    Examples
    --------
    >>> seconds_of("1998-01-01T00:00:00Z")
    883612800.0
    """
    try:
        parsed = datetime.fromisoformat(moment)
    except ValueError as error:
        raise InputError(
            f'start = "{moment}" is not a time: write it like "1998-01-01T00:00:00Z"'
        ) from error
    if parsed.tzinfo is None:
        parsed = parsed.replace(tzinfo=UTC)
    return parsed.timestamp()


class _Run:
    """One simulation: the water, what is kept of it, and its files."""

    def __init__(
        self,
        mesh: CoastalMesh,
        forcing: TideForcing,
        tide: TideSettings,
        settings: SimulationSettings,
        stations: Sequence[Station],
        folder: str | Path | None,
        friction: np.ndarray | None,
        drag: np.ndarray | None,
    ):
        self.mesh, self.forcing, self.tide, self.settings = (
            mesh,
            forcing,
            tide,
            settings,
        )
        self.start = seconds_of(settings.start)
        self.folder = None if folder is None else Path(folder)
        if self.folder is not None and not self.folder.is_dir():
            raise InputError(f"{self.folder}: there is no such folder; make it first")
        if not len(forcing.nodes):
            raise InputError(
                "the forcing has no open boundary node, so nothing drives the tide"
            )
        step, self.advice = chosen_step(mesh, settings, tide)
        self.stepper = Stepper(
            mesh,
            forcing,
            tide,
            step,
            ramp=settings.ramp_days * DAY,
            viscosity=settings.eddy_viscosity,
            ocean_advection=settings.ocean_advection,
            minimum_column=settings.minimum_column_m,
            limit=settings.level_limit_m,
            threads=settings.threads,
            friction=friction,
            drag=drag,
        )
        self.steps = max(1, round(settings.days * DAY / step))
        self.every_sample = self._steps_in(settings.analysis_every_s)
        self.every_station = self._steps_in(settings.station_every_s)
        self.every_field = self._steps_in(settings.global_every_s)
        self.every_restart = self._steps_in(settings.restart_every_days * DAY)
        self.stations = tuple(
            Station(str(name), float(longitude), float(latitude))
            for name, longitude, latitude in stations
        )
        self._corners, self._weights = self._locate()

        nonlinear = tide.finite_amplitude or tide.advection
        nonlinear = nonlinear or tide.friction_law != "linear"
        constituents = analysed_constituents(forcing, settings.constituents, nonlinear)
        since = settings.analysis_start_day
        since = 2.0 * settings.ramp_days if since is None else since
        self.since = round(since * DAY / step)
        n = len(mesh.points)
        self.sums = HarmonicSums(constituents, 3 * n) if constituents else None
        if self.sums is not None:
            every = self.every_sample
            samples = np.arange(-(-self.since // every) * every, self.steps + 1, every)
            check_window(constituents, samples * step)
        self.friction_sum = np.zeros(n)
        self.highest, self.fastest = np.full(n, -np.inf), np.zeros(n)
        self.times: list[float] = []
        self.volumes: list[float] = []
        self.levels: list[np.ndarray] = []
        self.fields = 0
        self._writer: FieldWriter | None = None
        self._resumed = False
        self._name = _fingerprint(
            mesh, forcing, tide, settings, friction, drag, self.stations
        )

    def go(self, progress: Callable[[float], None] | None) -> None:
        """Step to the end, with samples, stations, fields and restarts on the way."""
        stepper = self.stepper
        _log.info(
            "%d steps of %g s; the longest stable step is %.4g s, for %s",
            self.steps,
            stepper.step,
            self.advice.step_s,
            self.advice.reason,
        )
        with _held_interrupt() as interrupted:
            try:
                if stepper.steps == 0:
                    self._observe()
                while stepper.steps < self.steps:
                    lost = stepper.advance(self._next_stop() - stepper.steps)
                    if lost is not None:
                        raise self._blow_up(lost)
                    self._observe()
                    if progress is not None:
                        progress(stepper.steps / self.steps)
                    if interrupted():
                        raise KeyboardInterrupt
            except KeyboardInterrupt:
                self.save()
                raise
        films = stepper.films
        if films.any():
            worst = int(films.argmax())
            _log.warning(
                "%d nodes were held at the minimum water column of %g m, most often "
                "node %d, %s: %.2f %% of the run; this added %.4g m3 of water. Without "
                "wetting and drying the mesh is too shallow there for this tide",
                np.count_nonzero(films),
                self.settings.minimum_column_m,
                worst,
                at(self.mesh, worst),
                100.0 * films[worst] / self.steps,
                stepper.film_volume,
            )

    def result(self) -> SimulationResult:
        """Everything, after the last step; the station file is written."""
        records = self._records()
        if self.folder is not None and records:
            write_stations(self.folder / STATIONS, records)
        return SimulationResult(
            records=records,
            constants=self._constants(),
            time=np.array(self.times),
            volume=np.array(self.volumes),
            highest=self.highest,
            fastest=self.fastest,
            step_s=self.stepper.step,
            steps=self.steps,
            advice=self.advice,
            films=self.stepper.films,
            film_volume=self.stepper.film_volume,
        )

    def close(self) -> None:
        """Close the file of the fields."""
        if self._writer is not None:
            self._writer.close()

    def save(self) -> None:
        """Write the restart file, where there is a folder for it."""
        if self.folder is None:
            return
        arrays = {
            "run": np.array(self._name),
            "steps": np.array(self.stepper.steps),
            "state": self.stepper.state,
            "constants": self.stepper.constants,
            "tally": self.stepper.tally,
            "friction_sum": self.friction_sum,
            "highest": self.highest,
            "fastest": self.fastest,
            "times": np.array(self.times),
            "volumes": np.array(self.volumes),
            "levels": np.array(self.levels).reshape(
                len(self.levels), len(self.stations)
            ),
            "fields": np.array(self.fields),
        }
        if self.sums is not None:
            self.sums.flush()
            arrays["normal"], arrays["sums"] = self.sums.normal, self.sums.sums
            arrays["samples"] = np.array(self.sums.count)
        with atomic(self.folder / RESTART) as temporary, open(temporary, "wb") as file:
            np.savez(file, **arrays)

    def restore(self, path: str | Path) -> None:
        """Take up the run where a restart file stands."""
        path = Path(path)
        if not path.is_file():
            raise InputError(f"{path}: there is no such restart file; check the name")
        try:
            with np.load(path) as file:
                saved = {name: file[name] for name in file.files}
            name, steps = str(saved["run"]), int(saved["steps"])
        except (OSError, KeyError, ValueError, EOFError, BadZipFile) as error:
            raise InputError(f"{path}: is not a restart file ({error})") from error
        if name != self._name:
            raise InputError(
                f"{path}: belongs to another run: mesh, forcing, stations and settings "
                "(but the length, the threads and the restart interval) must be the "
                "same; start anew, or with the old settings"
            )
        if steps > self.steps:
            raise InputError(
                f"{path}: stands at day {steps * self.stepper.step / DAY:g}, after the "
                f"end of the run (days = {self.settings.days:g})"
            )
        fields = int(saved["fields"])
        if fields and self.folder is not None and not (self.folder / FIELDS).is_file():
            raise InputError(
                f"{self.folder / FIELDS}: is not there, but the restart file goes on "
                f"after {fields} times in it; bring it back, or start anew"
            )
        self.stepper.steps = steps
        self.stepper.state[...] = saved["state"]
        self.stepper.constants[...] = saved["constants"]
        self.stepper.tally[...] = saved["tally"]
        self.friction_sum, self.fields = saved["friction_sum"], fields
        self.highest, self.fastest = saved["highest"], saved["fastest"]
        self.times, self.volumes = list(saved["times"]), list(saved["volumes"])
        self.levels = list(saved["levels"])
        if self.sums is not None:
            self.sums.normal, self.sums.sums = saved["normal"], saved["sums"]
            self.sums.count = int(saved["samples"])
        self._resumed = True

    def _steps_in(self, seconds: float) -> int:
        return 0 if seconds == 0.0 else max(1, round(seconds / self.stepper.step))

    def _next_stop(self) -> int:
        """Number of the next step after which something is to be done."""
        now = self.stepper.steps
        every = (self.every_sample, self.every_field, self.every_restart)
        if self.stations:
            every = (*every, self.every_station)
        stops = [(now // k + 1) * k for k in every if k]
        return min(*stops, now + _MOST_STEPS, self.steps)

    def _observe(self) -> None:
        """What is due after this step."""
        stepper, now = self.stepper, self.stepper.steps
        state = stepper.state
        if now % self.every_sample == 0:
            self.times.append(self.start + stepper.time)
            self.volumes.append(stepper.volume)
            level = state[kernels.LEVEL]
            speed = np.hypot(state[kernels.U], state[kernels.V])
            place = stepper.discretisation.place
            np.maximum(self.highest, level[place], out=self.highest)
            np.maximum(self.fastest, speed[place], out=self.fastest)
            if self.sums is not None and now >= self.since:
                rows = state[[kernels.LEVEL, kernels.U, kernels.V]]
                self.sums.add(stepper.time, rows.ravel())
                self.friction_sum += state[kernels.TAU]
        if self.stations and now % self.every_station == 0:
            corners = state[kernels.LEVEL][self._corners]
            self.levels.append((self._weights * corners).sum(axis=1))
        if self.every_field and now % self.every_field == 0 and self.folder is not None:
            if self._writer is None:
                self._writer = FieldWriter(
                    self.folder / FIELDS, self.mesh, resume=self._resumed
                )
            time = self.start + stepper.time
            self._writer.write(self.fields, time, stepper.elevation, stepper.velocity)
            self.fields += 1
        if self.every_restart and now and now % self.every_restart == 0:
            self.save()

    def _records(self) -> tuple[TideRecord, ...]:
        interval = self.every_station * self.stepper.step
        time = self.start + interval * np.arange(len(self.levels))
        return tuple(
            TideRecord(
                time=time,
                elevation=[levels[k] for levels in self.levels],
                station=station.name,
                longitude_deg=station.longitude_deg,
                latitude_deg=station.latitude_deg,
            )
            for k, station in enumerate(self.stations)
        )

    def _constants(self) -> TideSolution | None:
        if self.sums is None:
            return None
        place = self.stepper.discretisation.place
        fields = self.sums.solve().reshape(len(self.sums.constituents), 3, -1)
        fields = fields[:, :, place]
        return TideSolution(
            names=tuple(c.name for c in self.sums.constituents),
            frequency=np.array([c.frequency for c in self.sums.constituents]),
            elevation=fields[:, 0],
            velocity=fields[:, 1:].transpose(0, 2, 1),
            friction=self.friction_sum[place] / self.sums.count,
            gravity=self.tide.gravity,
            coriolis=self.stepper.discretisation.coriolis(self.tide),
        )

    def _locate(self) -> tuple[np.ndarray, np.ndarray]:
        """(n_stations, 3) places of corners, and their weights."""
        if not self.stations:
            return np.empty((0, 3), dtype=np.int64), np.empty((0, 3))
        degrees = np.array([station[1:] for station in self.stations], dtype=float)
        points = self.mesh.projection.forward(*degrees.T)
        finder = Locator(self.mesh.points, self.mesh.triangles)
        triangle, weights, distance = finder.nearest(points)
        for station, t, away in zip(self.stations, triangle, distance):
            if t < 0 or away > self.settings.station_distance_m:
                far = "" if t < 0 else f"{away / 1000.0:.1f} km "
                raise InputError(
                    f"station {station.name} ({station.longitude_deg:g}, "
                    f"{station.latitude_deg:g}) lies {far}outside the mesh; leave it "
                    "out, or raise station_distance_m"
                )
            if away > 0.0:
                _log.info(
                    "station %s lies %.0f m outside the mesh: it gets the water level "
                    "of the nearest place on the boundary",
                    station.name,
                    away,
                )
        corners = self.mesh.triangles[triangle]
        return self.stepper.discretisation.place[corners], weights

    def _blow_up(self, node: int) -> EngineError:
        stepper = self.stepper
        level = stepper.elevation[node]
        kept = ""
        if self.folder is not None and (self.folder / RESTART).is_file():
            kept = f"; the last restart file is kept: {self.folder / RESTART}"
        state = "is not a number" if math.isnan(level) else f"came to {level:.3g} m"
        return EngineError(
            f"the run blew up: the water level {state} at node {node}, "
            f"{at(self.mesh, node)}, at {utc(self.start + stepper.time)}, after "
            f"{stepper.steps} steps of {stepper.step:g} s (longest stable step "
            f"{self.advice.step_s:.3g} s). Take a shorter step (time_step_s) or some "
            "eddy_viscosity, look at depth and forcing there, or raise level_limit_m "
            f"(now {self.settings.level_limit_m:g} m) if such a level is right{kept}"
        )


@contextmanager
def _held_interrupt() -> Iterator[Callable[[], bool]]:
    """Ctrl-C waits until the water and what is kept of it belong to one time."""
    caught = threading.Event()
    if threading.current_thread() is not threading.main_thread():
        yield caught.is_set
        return
    before = signal.signal(signal.SIGINT, lambda *_: caught.set())
    try:
        yield caught.is_set
    finally:
        signal.signal(signal.SIGINT, before)


def _fingerprint(
    mesh: CoastalMesh,
    forcing: TideForcing,
    tide: TideSettings,
    settings: SimulationSettings,
    friction: np.ndarray | None,
    drag: np.ndarray | None,
    stations: Sequence[Station],
) -> str:
    """Hash of all that decides the run but its length, threads and restarts."""
    same = msgspec.structs.replace(
        settings, days=1.0, threads=1, restart_every_days=0.0
    )
    words = [tide, same, [list(s) for s in stations], forcing.names]
    # numpy's numbers are floats too.
    parts = [msgspec.json.encode(words, enc_hook=float)]
    for string in mesh.boundaries:
        parts.append(f"{string.kind} {string.ibtype} {string.closed}".encode())
        parts.append(string.nodes.tobytes())
    for array in (
        mesh.points,
        mesh.triangles,
        mesh.depth,
        forcing.nodes,
        forcing.frequency,
        forcing.elevation,
        forcing.nodal_factor,
        forcing.argument,
        forcing.potential,
        friction,
        drag,
    ):
        parts.append(b"none" if array is None else np.asarray(array).tobytes())
    return hashlib.sha256(b"|".join(parts)).hexdigest()
