"""The tide of a mesh as the settings ask for it: forcing, friction, engine."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from tidemesh import constants, tides
from tidemesh.basegrid.raster_sampling import WeightedRaster
from tidemesh.datatypes import CoastalMesh, TideForcing, TideSolution
from tidemesh.errors import InputError
from tidemesh.geometry.systems import from_degrees
from tidemesh.io.dem import read_raster
from tidemesh.io.tide_tables import read_tide_table
from tidemesh.io.ugrid import Field
from tidemesh.pipeline.case import ForcingSettings
from tidemesh.tides.frequency_domain.gwce import solve_gwce
from tidemesh.tides.settings import TideSettings
from tidemesh.triangulation import locate

Progress = Callable[[float], None]


def _ignore(_: float) -> None:
    pass


# ---- forcing --------------------------------------------------------------------


def check_tide_inputs(tide: TideSettings, files: Mapping[str, Path]) -> None:
    """Find what is wrong with tables of tide constants before long work starts.

    Raises
    ------
    InputError
        If a table cannot be read or lacks a constituent, or a date is none.
    """
    for key in ("forcing.table", "forcing.from_gauges.table"):
        if key not in files:
            continue
        table = read_tide_table(files[key])
        for name in tide.constituents:
            if name not in table.names:
                raise InputError(
                    f"{files[key]}: no constituent {name}; the table has "
                    f"{', '.join(table.names)}: change tide.constituents or the table; "
                    "what nonlinear terms make inside belongs into tide.overtides"
                )
    if "forcing.gauges" in files:
        read_tide_table(files["forcing.gauges"])
    if tide.date is not None:
        seconds(tide.date)


def make_forcing(
    mesh: CoastalMesh,
    settings: TideSettings,
    forcing: ForcingSettings | None,
    files: Mapping[str, Path],
    *,
    progress: Progress = _ignore,
) -> tuple[TideForcing, dict[str, Any]]:
    """Elevation at the ocean nodes from the table, the atlas or the gauges of a case.

    Nodal factors and the astronomical potential are added where the settings ask for
    them.

    Parameters
    ----------
    mesh : CoastalMesh
    settings : TideSettings
    forcing : ForcingSettings or None
        None for a mesh without open boundary, driven by the potential alone.
    files : mapping
        Paths by key of the case: "forcing.table", "forcing.from_gauges.table".

    Returns
    -------
    forcing : TideForcing
    report : dict
        What there is to say of the fit to gauges, or nothing.

    Raises
    ------
    InputError
        If a file cannot be used, or a constituent is unknown or missing.
    """

    def complete(driven: TideForcing) -> TideForcing:
        if settings.date is not None:
            latitude = float(mesh.projection.inverse(mesh.points)[:, 1].mean())
            driven = tides.with_astronomy(driven, seconds(settings.date), latitude)
        if settings.tidal_potential:
            driven = tides.with_potential(mesh, driven)
        return driven

    if forcing is None:
        return complete(_nothing_at_the_boundary(settings.constituents)), {}
    if forcing.from_gauges is not None:
        known = bottom_coefficient(mesh, settings, files.get("tide.friction_file"))
        return _fit_to_gauges(mesh, settings, forcing, files, complete, known, progress)
    if forcing.atlas is not None:
        driven = tides.atlas_forcing(
            mesh,
            settings.constituents,
            files["forcing.atlas.directory"],
            forcing.atlas.model,
            max_distance_m=1e3 * settings.max_forcing_distance_km,
        )
    else:
        driven = _from_table(mesh, settings, files["forcing.table"])
    return complete(driven), {}


def _nothing_at_the_boundary(names: Sequence[str]) -> TideForcing:
    for name in names:
        if name.upper() not in constants.SPEED_DEG_PER_HOUR:
            raise InputError(
                f"the constituent {name} is unknown; known are "
                + ", ".join(constants.SPEED_DEG_PER_HOUR)
            )
    return TideForcing(
        names=tuple(names),
        frequency=np.array([constants.frequency(name) for name in names]),
        nodes=np.empty(0, dtype=np.int64),
        elevation=np.empty((len(names), 0), dtype=np.complex128),
    )


def _from_table(mesh: CoastalMesh, settings: TideSettings, path: Path) -> TideForcing:
    return tides.boundary_forcing(
        mesh,
        read_tide_table(path),
        settings.constituents,
        max_distance_m=1e3 * settings.max_forcing_distance_km,
    )


def _fit_to_gauges(
    mesh: CoastalMesh,
    settings: TideSettings,
    forcing: ForcingSettings,
    files: Mapping[str, Path],
    complete: Callable[[TideForcing], TideForcing],
    known: Mapping[str, np.ndarray],
    progress: Progress,
) -> tuple[TideForcing, dict[str, Any]]:
    first = None
    if forcing.table is not None:
        first = _from_table(mesh, settings, files["forcing.table"])
    fit = tides.fit_boundary(
        mesh,
        read_tide_table(files["forcing.from_gauges.table"]),
        settings,
        smoothness=forcing.from_gauges.smoothness,
        max_distance_m=1e3 * forcing.from_gauges.max_distance_km,
        outlier=forcing.from_gauges.outlier,
        first_guess=first,
        complete=complete,
        progress=progress,
        **known,
    )
    return fit.forcing, {"boundary_fit": _fit_report(fit)}


def _fit_report(fit: tides.BoundaryFit) -> dict[str, Any]:
    """Errors of every gauge, fitted and predicted by the others."""

    def rms(values: np.ndarray) -> float | None:
        known = np.abs(values[np.isfinite(values)]) ** 2
        return float(np.sqrt(0.5 * known.mean())) if len(known) else None

    stations = fit.gauges.stations or [""] * len(fit.gauges.longitude_deg)
    report: dict[str, Any] = {
        "left_out": [dataclasses.asdict(one) for one in fit.left_out]
    }
    for c, name in enumerate(fit.gauges.names):
        report[name] = {
            "smoothness": float(fit.smoothness[c]),
            "rms_residual_m": rms(fit.residual[c]),
            "rms_leave_one_out_m": rms(fit.leave_one_out[c]),
            "largest_standard_error_m": float(fit.standard_error[c].max()),
            "gauges": [
                {
                    "gauge": stations[g],
                    "observed_m": float(abs(fit.observed[c, g])),
                    "residual_m": float(abs(fit.residual[c, g])),
                    "leave_one_out_m": float(abs(fit.leave_one_out[c, g])),
                }
                for g in np.flatnonzero(np.isfinite(fit.observed[c]))
            ],
        }
    return report


def boundary_of(
    tide: TideSolution, base: CoastalMesh, mesh: CoastalMesh
) -> TideForcing:
    """Forcing of a new mesh: the solution on another along the new ocean boundary."""
    nodes = mesh.open_nodes
    locator = locate.Locator(base.points, base.triangles)
    return TideForcing(
        names=tide.names,
        frequency=tide.frequency,
        nodes=nodes,
        elevation=locator.interpolate(tide.elevation, mesh.points[nodes]),
    )


def seconds(date: str) -> float:
    """Seconds since 1970 of a date or time, UTC if it does not say.

    Raises
    ------
    InputError
        If it is not a date as ISO 8601 writes them.
    """
    try:
        when = datetime.fromisoformat(date)
    except ValueError:
        raise InputError(
            f'"{date}" is not a date: expected for instance "1998-03-24" or '
            '"1998-03-24T12:00:00Z"'
        ) from None
    return (when if when.tzinfo else when.replace(tzinfo=UTC)).timestamp()


# ---- solution -------------------------------------------------------------------


def bottom_coefficient(
    mesh: CoastalMesh, settings: TideSettings, path: Path | None
) -> dict[str, np.ndarray]:
    """Coefficient of the friction law at the nodes, where a raster gives it.

    Returns
    -------
    keyword : dict
        "friction" (1/s) or "drag" (C_f, or Manning's n) for `tides.solve`; empty
        without a raster.

    Raises
    ------
    InputError
        If the raster does not cover the mesh, or holds a negative value.
    """
    if path is None:
        return {}
    places = mesh.projection.inverse(mesh.points)
    box = (*places.min(axis=0).tolist(), *places.max(axis=0).tolist())
    raster = read_raster(path, positive="up", box_deg=box)
    known = np.isfinite(raster.elevation)
    sampled = WeightedRaster(
        raster.x, raster.y, np.where(known, raster.elevation, 0.0), known.astype(float)
    )
    values = sampled.bilinear(from_degrees(raster.crs, *places.T))
    bad = ~(values >= 0.0)
    if bad.any():
        longitude, latitude = places[np.flatnonzero(bad)[0]]
        raise InputError(
            f"tide.friction_file: {path}: no usable value at {int(bad.sum())} of "
            f"{len(values)} nodes, the first at ({longitude:.4f}, {latitude:.4f}); the "
            "raster must cover the whole mesh with values that are not negative"
        )
    if settings.friction_law == "linear":
        return {"friction": values}
    return {"drag": values}


def placed(
    adcirc: tides.AdcircSettings, files: Mapping[str, Path]
) -> tides.AdcircSettings:
    """The settings with the path of the job script where the case file puts it."""
    if "adcirc.batch_template" not in files:
        return adcirc
    path = str(files["adcirc.batch_template"])
    return msgspec.structs.replace(adcirc, batch_template=path)


def solve_tide(
    mesh: CoastalMesh,
    forcing: TideForcing,
    settings: TideSettings,
    *,
    adcirc: tides.AdcircSettings,
    folder: Path,
    friction_file: Path | None = None,
    progress: Progress = _ignore,
    **known: Any,
) -> tuple[TideSolution, dict[str, Any]]:
    """Solve with the engine that the settings name.

    Parameters
    ----------
    mesh : CoastalMesh
    forcing : TideForcing
    settings : TideSettings
    adcirc : AdcircSettings
    folder : path
        Run directory of an external engine.
    friction_file : path, optional
        Raster of the coefficient of the friction law.
    **known : arrays
        ``friction``, ``drag``, ``coriolis`` of `tides.solve`, in place of what the
        settings say.

    Returns
    -------
    tide : TideSolution
    report : dict
        Largest amplitudes, energy balance and the iteration, for summary.json.
    """
    known = {**bottom_coefficient(mesh, settings, friction_file), **known}
    weight = known.pop("tau0", None)
    if weight is not None and settings.tau0 is None:
        if np.ndim(weight):
            tide = solve_gwce(
                mesh, forcing, settings, tau0=weight, progress=progress, **known
            )
            return tide, _amplitudes(tide)
        settings = msgspec.structs.replace(settings, tau0=float(weight))
    if settings.engine == "adcirc":
        engine = tides.Adcirc(adcirc, settings, folder)
        tide = engine.solve(mesh, forcing, progress=progress, **known)
        return tide, {**_amplitudes(tide), "engine": engine.report()}
    tide, iterations = tides.solve_with_report(
        mesh, forcing, settings, progress=progress, **known
    )
    report = _amplitudes(tide)
    linear = settings.friction_law == "linear" and forcing.potential is None
    # Of ADCIRC's equation the balance holds up to the error of the mesh.
    if settings.discretisation == "galerkin" or linear:
        balance = tides.energy_balance(mesh, tide, forcing.nodes, settings)
        for c, name in enumerate(tide.names):
            report[name]["energy_inflow_w"] = float(balance.inflow[c])
            report[name]["energy_dissipation_w"] = float(balance.dissipation[c])
            if settings.tidal_potential:
                report[name]["energy_of_potential_w"] = float(balance.potential[c])
            if settings.advection or settings.finite_amplitude:
                report[name]["energy_transfer_w"] = float(balance.transfer[c])
    if iterations is not None and iterations.iterations:
        report["iterations"] = iterations._asdict()
    return _plain(tide), report


def _plain(tide: TideSolution) -> TideSolution:
    """The solution alone, without what an engine keeps beside it."""
    names = [field.name for field in dataclasses.fields(TideSolution)]
    return TideSolution(**{name: getattr(tide, name) for name in names})


def _amplitudes(tide: TideSolution) -> dict[str, Any]:
    return {
        name: {"largest_amplitude_m": float(np.abs(tide.elevation[c]).max())}
        for c, name in enumerate(tide.names)
    }


# ---- files ----------------------------------------------------------------------


def tide_fields(mesh: CoastalMesh, tide: TideSolution) -> list[Field]:
    """Everything of a solution, to write: what `solution_of` reads back.

    Velocities are true east and north; frequencies (rad/s) go along as attributes.
    """
    velocity = mesh.projection.east_north(mesh.points, tide.velocity)
    fields = []
    for c, name in enumerate(tide.names):
        speed = {"angular_frequency": float(tide.frequency[c])}
        fields += [
            Field(
                f"elevation_{name}",
                tide.elevation[c],
                "m",
                f"{name} elevation of the sea surface",
                attributes=speed,
            ),
            Field(
                f"u_{name}",
                velocity[c, :, 0],
                "m s-1",
                f"{name} eastward velocity",
            ),
            Field(
                f"v_{name}",
                velocity[c, :, 1],
                "m s-1",
                f"{name} northward velocity",
            ),
        ]
    if tide.friction.ndim == 2:
        fields += [
            Field(
                f"friction_{name}",
                tide.friction[c],
                "s-1",
                f"linear friction coefficient of {name}",
            )
            for c, name in enumerate(tide.names)
        ]
    else:
        fields.append(
            Field("friction", tide.friction, "s-1", "linear friction coefficient")
        )
    if tide.coriolis is not None:
        fields.append(
            Field(
                "coriolis",
                tide.coriolis,
                "s-1",
                "Coriolis parameter",
                "coriolis_parameter",
            )
        )
    return fields


def solution_of(
    mesh: CoastalMesh,
    fields: Mapping[str, Field],
    settings: TideSettings | None = None,
) -> TideSolution | None:
    """The solution that `tide_fields` wrote, or None if the fields hold none.

    Friction that is not among the fields is the settings'.
    """
    names = [n.removeprefix("elevation_") for n in fields if n.startswith("elevation_")]
    names = [n for n in names if f"u_{n}" in fields and f"v_{n}" in fields]
    if not names:
        return None
    east_north = np.stack(
        [np.stack([fields[f"{c}_{n}"].values for c in "uv"], axis=-1) for n in names]
    )
    frequency = [
        fields[f"elevation_{n}"].attributes.get("angular_frequency") for n in names
    ]
    if "friction" in fields:
        friction = fields["friction"].values
    elif f"friction_{names[0]}" not in fields:
        given = TideSettings() if settings is None else settings
        friction = np.full(len(mesh.points), given.friction)
    else:
        friction = np.stack([fields[f"friction_{n}"].values for n in names])
    coriolis = fields["coriolis"].values if "coriolis" in fields else None
    return TideSolution(
        names=tuple(names),
        frequency=[
            constants.frequency(n) if f is None else f for n, f in zip(names, frequency)
        ],
        elevation=np.stack([fields[f"elevation_{n}"].values for n in names]),
        velocity=mesh.projection.from_east_north(mesh.points, east_north),
        friction=friction,
        coriolis=coriolis,
    )
