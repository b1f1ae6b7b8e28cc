"""What goes into the files of an ADCIRC run: mesh, control file, nodal attributes."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import msgspec
import numpy as np
import pyproj

from tidemesh.datatypes import CoastalMesh, TideForcing
from tidemesh.errors import EngineError, InputError, MeshError
from tidemesh.geometry.projection import Projection
from tidemesh.io.fort13 import NodalAttributes
from tidemesh.io.fort15 import (
    FLUX_TYPES,
    BoundaryConstituent,
    ControlFile,
    FluxConstituent,
    HarmonicConstituent,
    PotentialConstituent,
    boundary_rows,
)
from tidemesh.tides.adcirc.plan import RunPlan, plan_run
from tidemesh.tides.adcirc.settings import AdcircSettings
from tidemesh.tides.frequency_domain.solve import with_overtides
from tidemesh.tides.frequency_domain.wave_equation import coriolis_parameter
from tidemesh.tides.potential import potential_constituent
from tidemesh.tides.settings import TideSettings
from tidemesh.triangulation.quality import area

FRICTION = "quadratic_friction_coefficient_at_sea_floor"
"""C_f at the nodes; with linear friction ADCIRC takes the same attribute for tau."""
MANNING = "mannings_n_at_sea_floor"
ADVECTION = "advection_state"

ICS = {"metres": 1, "adcirc": 2, "equal_area": 20, "mercator": 22}
_PROGRESS_LINES = 200
_ABYSS_M = 99999.0
_EASY, _FEW = 5.0, 50
"""Courant number up to which the equations of a step are solved in some 20 iterations;
iterations below which they may not be."""
_CONSISTENT_GRAVITY = 9.81


@dataclass(frozen=True, eq=False)
class RunInputs:
    """Everything that an ADCIRC run reads."""

    forcing: TideForcing
    """With the overtides of the settings."""
    mesh: CoastalMesh
    """As it is written: without a map where the run is in metres."""
    control: ControlFile
    attributes: NodalAttributes | None
    plan: RunPlan
    coefficient: float | np.ndarray
    """tau (1/s), C_f or Manning's n, of all nodes or (n_points,)."""
    coriolis: float | np.ndarray | None
    """rad/s, of all nodes or (n_points,); None for no rotation."""


def run_inputs(
    mesh: CoastalMesh,
    forcing: TideForcing,
    tide: TideSettings,
    settings: AdcircSettings,
    *,
    friction: float | np.ndarray | None = None,
    drag: float | np.ndarray | None = None,
    coriolis: float | np.ndarray | None = None,
) -> RunInputs:
    """Put an ADCIRC run together.

    Parameters
    ----------
    mesh : CoastalMesh
    forcing : TideForcing
        At every open boundary node; the settings' overtides are added.
    tide : TideSettings
    settings : AdcircSettings
    friction : float or (n_points,) array, optional
        Linear coefficient tau (1/s), in place of the settings' one number; ADCIRC takes
        one number only.
    drag : float or (n_points,) array, optional
        C_f of the quadratic law, or Manning's n, likewise.
    coriolis : float or (n_points,) array, optional
        rad/s, in place of what the settings say; ADCIRC takes one number only.

    Returns
    -------
    inputs : RunInputs

    Raises
    ------
    InputError
        If the forcing does not fit the mesh, or ADCIRC cannot do what is asked for.
    MeshError
        If ADCIRC would misread the mesh.
    """
    _check_mesh(mesh)
    _check_forcing(mesh, forcing)
    forcing = with_overtides(forcing, tide)
    linear = tide.friction_law == "linear"
    coefficient = _coefficient(mesh, tide, friction if linear else drag)
    if linear:
        tide = msgspec.structs.replace(tide, friction=coefficient)
    plan = plan_run(mesh, forcing, tide, settings)
    rotation = _coriolis(mesh, tide, coriolis)
    ncor = int(np.ndim(rotation) > 0)
    ics = _coordinates(mesh, forcing, tide, settings, ncor)
    potential = _potential_rows(mesh, forcing)
    attributes = _attributes(mesh, tide, settings, coefficient)
    centre = (0.0, 0.0) if ics == 1 else _centre(mesh)
    control = ControlFile(
        run_description=f"tidemesh {tide.friction_law}",
        run_id=" ".join(forcing.names)[:24],
        # Advection without finite amplitude is a combination that ADCIRC calls
        # inconsistent, and takes when it may go on after such a warning.
        nfover=int(tide.advection and not tide.finite_amplitude),
        nabout=1,
        # Never 0: that switches the check for blow-up off.
        nscreen=max(1, plan.steps // _PROGRESS_LINES),
        ics=ics,
        nolibf=0 if linear else 1,
        nolifa=2 if settings.wetting else int(tide.finite_amplitude),
        nolica=int(tide.advection),
        nolicat=int(tide.advection),
        nwp=() if attributes is None else attributes.names,
        ncor=ncor,
        ntip=int(bool(potential)),
        nramp=int(plan.ramp_days > 0.0),
        gravity=tide.gravity,
        tau0=plan.tau0,
        tau0_range=settings.tau0_range if plan.tau0 == -5.0 else None,
        time_step=plan.time_step_s,
        run_days=plan.run_days,
        ramp_days=(plan.ramp_days,),
        weights=settings.weights,
        minimum_depth=plan.minimum_depth_m,
        wet_dry=(12, 12, settings.minimum_wetting_speed) if settings.wetting else None,
        slam0=centre[0],
        sfea0=centre[1],
        # With Manning's formula this is the least C_f.
        friction=0.0 if tide.friction_law == "manning" else float(np.mean(coefficient)),
        eddy_viscosity=settings.eddy_viscosity,
        cori=0.0 if ncor or rotation is None else float(rotation),
        potential=potential,
        forcing=_boundary_constituents(mesh, forcing),
        angle_minimum=tide.minimum_inner_angle_deg,
        **_rivers(mesh, forcing),
        harmonic=tuple(
            HarmonicConstituent(
                forcing.names[k],
                float(forcing.frequency[k]),
                *_astronomy(forcing, k),
            )
            for k in harmonic_order(forcing)
        ),
        harmonic_days=plan.harmonic_days,
        harmonic_every=plan.harmonic_every,
        harmonic_output=(0, 0, 1, 1) if settings.output == "ascii" else (0, 0, 5, 5),
        solver=(
            1,
            # Tells of every step, since ADCIRC hides the one that does not converge.
            int(plan.courant > _EASY or settings.solver_iterations < _FEW),
            settings.solver_tolerance,
            settings.solver_iterations,
        ),
        netcdf_header=None if settings.output == "ascii" else _netcdf_header(tide),
        namelists=_namelists(settings),
    )
    if ics == 1:
        mesh = replace(mesh, projection=Projection())
    return RunInputs(forcing, mesh, control, attributes, plan, coefficient, rotation)


def harmonic_order(forcing: TideForcing) -> np.ndarray:
    """(n_c,) constituents as ADCIRC wants them analysed: the steady one first."""
    return np.argsort(forcing.frequency != 0.0, kind="stable")


def is_uniform(values: np.ndarray) -> bool:
    """Whether all values are the same."""
    return bool((values == values.flat[0]).all())


# ---- what ADCIRC would not notice ----------------------------------------------


def _check_mesh(mesh: CoastalMesh) -> None:
    for name, values in (("points", mesh.points), ("depth", mesh.depth)):
        if not np.isfinite(values).all():
            node = int(np.argwhere(~np.isfinite(values))[0][0])
            raise MeshError(f"the {name} of node {node} are not finite")
    wrong = np.flatnonzero(area(mesh.points, mesh.triangles) <= 0.0)
    if len(wrong):
        raise MeshError(
            f"triangle {wrong[0]} is inverted or flat ({len(wrong)} in all); ADCIRC "
            "would turn it round without a word"
        )
    used = np.zeros(len(mesh.points), dtype=bool)
    used[mesh.triangles] = True
    if not used.all():
        raise MeshError(
            f"node {int(np.argmin(used))} has no triangle; ADCIRC would carry it along "
            "without a word"
        )


def _check_forcing(mesh: CoastalMesh, forcing: TideForcing) -> None:
    nodes = mesh.open_nodes
    if len(nodes) == 0 and forcing.potential is None:
        raise EngineError(
            "the mesh has no open (ocean) boundary, so nothing drives the tide"
        )
    missing = np.setdiff1d(nodes, forcing.nodes)
    foreign = np.setdiff1d(forcing.nodes, nodes)
    if len(missing) or len(foreign):
        node = int([*missing, *foreign][0])
        where = "has no forcing" if len(missing) else "is not on the open boundary"
        raise InputError(
            f"the forcing has {len(forcing.nodes)} nodes, the open boundary of the "
            f"mesh {len(nodes)}: node {node} {where}; ADCIRC wants a value at every "
            "node of the open boundary and at no other"
        )
    finite = np.isfinite(forcing.elevation)
    if not finite.all():
        constituent, place = np.argwhere(~finite)[0]
        raise InputError(
            f"the forcing of {forcing.names[constituent]} at ocean node "
            f"{int(forcing.nodes[place])} is not a finite number"
        )


# ---- physics -------------------------------------------------------------------


def _coefficient(
    mesh: CoastalMesh, tide: TideSettings, given: float | np.ndarray | None
) -> float | np.ndarray:
    """tau, C_f or Manning's n: one number where it is the same everywhere."""
    if given is None:
        laws = {
            "linear": tide.friction,
            "quadratic": tide.drag_coefficient,
            "manning": tide.manning_n,
        }
        return float(laws[tide.friction_law])
    values = np.asarray(given, dtype=np.float64)
    if values.ndim and values.shape != mesh.depth.shape:
        raise InputError(
            f"the friction coefficient has the shape {values.shape}; ADCIRC takes one "
            f"number, or one for each of the {len(mesh.depth)} nodes"
        )
    values = np.broadcast_to(values, mesh.depth.shape)
    if not (np.isfinite(values) & (values >= 0.0)).all():
        node = int(np.argmin(np.isfinite(values) & (values >= 0.0)))
        raise InputError(
            f"the friction coefficient of node {node} is {values[node]:g}; it must be "
            "a number that is not negative"
        )
    if is_uniform(values):
        return float(values[0])
    if tide.friction_law == "linear":
        raise InputError(
            "ADCIRC takes linear friction as one number, not values at the nodes: use "
            'friction_law = "quadratic" or "manning"'
        )
    return values


def _attributes(
    mesh: CoastalMesh,
    tide: TideSettings,
    settings: AdcircSettings,
    coefficient: float | np.ndarray,
) -> NodalAttributes | None:
    """What goes into the fort.13: names, units, the usual value, values."""
    rows: list[tuple[str, str, float, np.ndarray]] = []
    if tide.friction_law == "manning" or np.ndim(coefficient):
        values = np.broadcast_to(coefficient, mesh.depth.shape)
        # The value of most nodes need not be listed.
        common, count = np.unique(values, return_counts=True)
        manning = tide.friction_law == "manning"
        name, unit = (MANNING, "s/m^(1/3)") if manning else (FRICTION, "unitless")
        rows.append((name, unit, float(common[np.argmax(count)]), values))
    rings = settings.ocean_rings_without_advection
    if tide.advection and rings and len(mesh.open_nodes):
        near = np.zeros(len(mesh.points), dtype=bool)
        near[mesh.open_nodes] = True
        for _ in range(rings - 1):
            near[mesh.triangles[near[mesh.triangles].any(axis=1)]] = True
        # Momentum is advected in elements deeper than this at all their nodes.
        rows.append((ADVECTION, "m", -_ABYSS_M, np.where(near, _ABYSS_M, -_ABYSS_M)))
    if not rows:
        return None
    names, units, usual, values = zip(*rows)
    return NodalAttributes(
        "nodal attributes of a tide run",
        names,
        units,
        tuple(np.array([value]) for value in usual),
        tuple(column[:, None] for column in values),
    )


def _coriolis(
    mesh: CoastalMesh, tide: TideSettings, given: float | np.ndarray | None
) -> float | np.ndarray | None:
    """One parameter, those of the latitudes of the nodes, or None."""
    if given is None:
        return coriolis_parameter(mesh, tide)
    values = np.asarray(given, dtype=np.float64)
    if not is_uniform(values):
        raise InputError(
            "ADCIRC takes one Coriolis parameter, or that of the latitude "
            '(tide.coriolis = "latitude"), not values at the nodes'
        )
    return float(values.flat[0])


def _coordinates(
    mesh: CoastalMesh,
    forcing: TideForcing,
    tide: TideSettings,
    settings: AdcircSettings,
    ncor: int,
) -> int:
    wants_latitude = ncor == 1 or forcing.potential is not None
    name = settings.coordinates
    if name == "auto":
        if not mesh.projection.crs or (tide.metric == "plane" and not wants_latitude):
            name = "metres"
        else:
            name = "adcirc" if tide.metric == "adcirc" else "mercator"
    if name == "metres" and wants_latitude:
        what = "tidal potential" if ncor == 0 else "Coriolis force by latitude"
        raise InputError(
            f"a run in metres (adcirc.coordinates) can have no {what}: choose "
            '"mercator", on a mesh with a map projection'
        )
    if name != "metres" and not mesh.projection.crs:
        raise InputError(
            f'adcirc.coordinates = "{name}" needs a mesh with a map projection; this '
            "one lies on the bare plane"
        )
    if name != "metres" and abs(tide.gravity - _CONSISTENT_GRAVITY) > 0.01:
        raise InputError(
            f"tide.gravity = {tide.gravity:g}: ADCIRC takes only 9.81 m/s2 on the "
            "sphere"
        )
    return ICS[name]


def _centre(mesh: CoastalMesh) -> tuple[float, float]:
    """Longitude and latitude (degrees) of the middle, on ADCIRC's map that map's own.

    The middle of the map counts for nothing but the direction of the shore.
    """
    operation = pyproj.CRS.from_user_input(mesh.projection.crs).coordinate_operation
    if operation is not None and "Equidistant Cylindrical" in operation.method_name:
        value = {p.name: p.value for p in operation.params}
        return (
            value["Longitude of natural origin"],
            value["Latitude of 1st standard parallel"],
        )
    place = mesh.projection.inverse(mesh.points)
    middle = 0.5 * (place.min(axis=0) + place.max(axis=0))
    return round(float(middle[0]), 6), round(float(middle[1]), 6)


# ---- forcing -------------------------------------------------------------------


def _astronomy(forcing: TideForcing, k: int) -> tuple[float, float]:
    """Nodal factor, and argument in degrees."""
    factor, argument = forcing.nodal_factor, forcing.argument
    return (
        1.0 if factor is None else float(factor[k]),
        0.0 if argument is None else math.degrees(float(argument[k])) % 360.0,
    )


def _boundary_constituents(
    mesh: CoastalMesh, forcing: TideForcing
) -> tuple[BoundaryConstituent, ...]:
    if len(forcing.nodes) == 0:
        return ()
    place = np.argsort(forcing.nodes)
    place = place[np.searchsorted(forcing.nodes[place], mesh.open_nodes)]
    driven = np.flatnonzero(np.abs(forcing.elevation).max(axis=1) > 0.0)
    if len(driven) == 0:
        # Without any, ADCIRC would ask for a file of other boundary values.
        driven = np.array([int(np.argmax(forcing.frequency))])
    return tuple(
        BoundaryConstituent(
            forcing.names[k],
            float(forcing.frequency[k]),
            *_astronomy(forcing, k),
            boundary_rows(mesh, forcing.elevation[k][place]),
        )
        for k in driven
    )


def _potential_rows(
    mesh: CoastalMesh, forcing: TideForcing
) -> tuple[PotentialConstituent, ...]:
    """Amplitudes from the values at the nodes, body-tide factors included."""
    if forcing.potential is None:
        return ()
    if not mesh.projection.crs:
        raise InputError(
            "the tidal potential needs a mesh with a map projection; this one lies on "
            "the bare plane"
        )
    longitude, latitude = np.radians(mesh.projection.inverse(mesh.points)).T
    cosine = np.cos(latitude)
    shapes = (
        1.5 * cosine**2 - 1.0,
        np.sin(2.0 * latitude) * np.exp(1j * longitude),
        cosine**2 * np.exp(2j * longitude),
    )
    rows = []
    for k, name in enumerate(forcing.names):
        values = forcing.potential[k]
        if not np.abs(values).max() > 0.0:
            continue
        frequency = float(forcing.frequency[k])
        # The rule by which ADCIRC tells the species apart.
        shape = shapes[min(round(frequency / 7.0e-5), 2)]
        amplitude = np.vdot(shape, values) / np.vdot(shape, shape).real
        rest = np.abs(values - amplitude * shape).max()
        if rest > 1.0e-3 * np.abs(values).max():
            raise InputError(
                f"the tidal potential of {name} is not that of its species "
                "(long-period, diurnal or semidiurnal): ADCIRC makes it from one "
                "amplitude"
            )
        factor, argument = _astronomy(forcing, k)
        argument += math.degrees(float(np.angle(amplitude)))
        size, body = abs(amplitude), 1.0
        known = potential_constituent(name)
        if known is not None and math.isclose(
            size, known.amplitude * known.body_factor, rel_tol=1e-9
        ):
            # As its users know them; ADCIRC multiplies the two.
            size, body = known.amplitude, known.body_factor
        rows.append(
            PotentialConstituent(name, size, frequency, body, factor, argument % 360.0)
        )
    return tuple(rows)


def _rivers(mesh: CoastalMesh, forcing: TideForcing) -> dict:
    """No flow through the river boundaries that a mesh may have."""
    elevation: list[complex] = []
    for string in mesh.boundaries:
        if string.kind != "open" and string.ibtype in FLUX_TYPES:
            ring = string.kind == "mainland" and string.closed
            # Only the type that radiates has an elevation in its rows.
            given = 0.0 if string.ibtype == 32 else complex(np.nan, np.nan)
            elevation += [given] * (len(string.nodes) + ring)
    if not elevation:
        return {}
    k = int(np.argmax(forcing.frequency))
    row = FluxConstituent(
        forcing.names[k],
        float(forcing.frequency[k]),
        1.0,
        0.0,
        np.zeros(len(elevation), dtype=np.complex128),
        np.array(elevation, dtype=np.complex128),
    )
    return {"nffr": 1, "flux": (row,)}


# ---- output --------------------------------------------------------------------


def _namelists(settings: AdcircSettings) -> str:
    lines = [
        f"&WarnElevControl WarnElev={settings.warning_elevation_m:.6g}, "
        f"ErrorElev={settings.error_elevation_m:.6g} /",
        *settings.extra_lines,
    ]
    return "\n".join(lines)


def _netcdf_header(tide: TideSettings) -> tuple[str, ...]:
    day = (tide.date or "2000-01-01")[:10]
    return (
        "tidal harmonic constants",
        "-",
        "ADCIRC",
        "-",
        "-",
        "-",
        "-",
        "-",
        "-",
        f"{day} 00:00:00",
    )
