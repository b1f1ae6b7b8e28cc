"""An ADCIRC case read into the terms of the embedded engine."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import msgspec
import numpy as np

from tidemesh.constants import EARTH_RADIUS, EARTH_ROTATION
from tidemesh.datatypes import CoastalMesh, TideForcing
from tidemesh.errors import InputError
from tidemesh.geometry.projection import Projection
from tidemesh.io.fort13 import NodalAttributes, read_fort13
from tidemesh.io.fort15 import ControlFile, fort15_forcing, read_fort15
from tidemesh.tides.settings import TideSettings
from tidemesh.triangulation import quality

MANNING = "mannings_n_at_sea_floor"
QUADRATIC = "quadratic_friction_coefficient_at_sea_floor"
MERCATOR = 22
"""ICS of the spherical equations on Mercator's map."""
WEIGHT = "primitive_weighting_in_continuity_equation"


TOLERANCE = 1.0e-5
"""Of the iteration, where ADCIRC's own discretisation leaves no larger error."""

ODD = (3, 5, 7, 9, 11, 13)
"""Overtides that quadratic friction makes of one constituent and that act back on it:
in a narrow inlet all of them together change it by 2e-3, what is left by 2e-5."""

_SAME = 1.0e-9
"""rad/s."""


class AdcircCase(NamedTuple):
    """What a fort.15 says, as the arguments of `tides.solve`."""

    control: ControlFile
    mesh: CoastalMesh
    """On ADCIRC's map about SLAM0, SFEA0; depths raised to H0."""
    forcing: TideForcing
    settings: TideSettings
    known: dict[str, Any]
    """Nodal arrays in place of the settings: friction, drag, coriolis."""
    notes: tuple[str, ...]
    """Where the embedded engine cannot do what the file says."""


def read_adcirc_case(
    mesh: CoastalMesh, fort15: str | Path, fort13: str | Path | None = None
) -> AdcircCase:
    """Read a fort.15, and the fort.13 that it asks for.

    The discretisation is ADCIRC's own where nothing but the friction is nonlinear.
    Other runs go by harmonic iteration of the Galerkin equations. All nonlinear ones
    have the constituents of the harmonic analysis that nothing drives as overtides.

    Parameters
    ----------
    mesh : CoastalMesh
        As read from the fort.14.
    fort15, fort13 : path
        The fort.13 is looked for beside the fort.15 if it is not given.

    Raises
    ------
    FormatError
        If a file does not follow its format or belongs to another mesh.
    InputError
        If nodal attributes are asked for and there is no fort.13.
    """
    control = read_fort15(fort15, mesh)
    notes: list[str] = []
    mesh = _on_its_map(mesh, control)
    attributes = _attributes(control, Path(fort15), fort13, mesh)
    settings, known = _physics(control, attributes, mesh, notes)
    forcing = fort15_forcing(control, mesh)
    fixed_depth = not (settings.finite_amplitude or settings.advection)
    linear = fixed_depth and settings.friction_law == "linear"
    driven = {name.upper() for name in forcing.names}
    made = [c.name for c in control.harmonic if c.name.upper() not in driven]
    if fixed_depth:
        tau0 = _weight(control, attributes, notes, varies=linear)
        if tau0 is not None:
            known["tau0"] = tau0
            settings = msgspec.structs.replace(
                settings, discretisation="gwce", tolerance=TOLERANCE
            )
    if not linear:
        forcing = _with_made(forcing, control, made)
    settings = msgspec.structs.replace(
        settings,
        constituents=forcing.names[: len(driven)],
        overtides=forcing.names[len(driven) :],
    )
    return AdcircCase(control, mesh, forcing, settings, known, tuple(notes))


def with_odd_overtides(
    forcing: TideForcing, settings: TideSettings
) -> tuple[TideForcing, int]:
    """Odd overtides that a run of ADCIRC has, whether it analyses them or not.

    Only for quadratic friction in ADCIRC's discretisation, and one constituent: of
    several, the combinations are too many.

    Returns
    -------
    forcing : TideForcing
        The overtides that it lacked come last.
    asked : int
        The number of constituents before them.
    """
    asked = len(forcing.names)
    moved = np.abs(forcing.elevation).max(axis=1, initial=0.0) > 0.0
    if forcing.potential is not None:
        moved |= np.abs(forcing.potential).max(axis=1) > 0.0
    if (
        settings.engine != "frequency_domain"
        or settings.discretisation != "gwce"
        or settings.friction_law == "linear"
        or moved.sum() != 1
    ):
        return forcing, asked
    k = int(np.argmax(moved))
    frequency = forcing.frequency[k]
    turns = np.rint(forcing.frequency / frequency)
    if np.abs(forcing.frequency - turns * frequency).max() > _SAME:
        return forcing, asked
    odd = np.array([n for n in ODD if n not in turns])
    n = len(odd)
    more: dict[str, Any] = {}
    if forcing.nodal_factor is not None:
        factor = forcing.nodal_factor[k] ** odd
        more["nodal_factor"] = np.concatenate([forcing.nodal_factor, factor])
    if forcing.argument is not None:
        argument = forcing.argument[k] * odd
        more["argument"] = np.concatenate([forcing.argument, argument])
    if forcing.potential is not None:
        none = np.zeros((n, forcing.potential.shape[1]))
        more["potential"] = np.concatenate([forcing.potential, none])
    still = np.zeros((n, len(forcing.nodes)))
    name = forcing.names[k]
    longer = dataclasses.replace(
        forcing,
        names=(*forcing.names, *(f"{turn} {name}" for turn in odd)),
        frequency=np.concatenate([forcing.frequency, odd * frequency]),
        elevation=np.concatenate([forcing.elevation, still]),
        **more,
    )
    return longer, asked


def still_known(
    known: Mapping[str, Any], theirs: TideSettings, wanted: TideSettings
) -> dict[str, Any]:
    """Nodal arrays of a fort.15 that no other setting takes the place of.

    Parameters
    ----------
    known : mapping
        Of an `AdcircCase`.
    theirs, wanted : TideSettings
        As the fort.15 has them, and with what the user sets instead.
    """

    def changed(*names: str) -> bool:
        return any(getattr(theirs, name) != getattr(wanted, name) for name in names)

    gone = set()
    if changed(
        "friction_law", "friction", "drag_coefficient", "manning_n", "friction_file"
    ):
        gone |= {"friction", "drag"}
    if changed("coriolis", "latitude_deg"):
        gone.add("coriolis")
    if changed("tau0") or wanted.discretisation != "gwce":
        gone.add("tau0")
    return {name: value for name, value in known.items() if name not in gone}


def _on_its_map(mesh: CoastalMesh, control: ControlFile) -> CoastalMesh:
    """The mesh where ADCIRC computes: on its map, no shallower than H0."""
    if control.ics == 1 and mesh.projection.crs:
        raise InputError(
            "ICS = 1 takes the coordinates for metres, but the mesh is in degrees: "
            "set ICS = 2 in the fort.15"
        )
    if control.ics != 1:
        if not mesh.projection.crs:
            raise InputError(
                f"ICS = {control.ics} takes the coordinates for degrees, but the mesh "
                "is in metres: set ICS = 1 in the fort.15"
            )
        places = mesh.projection.inverse(mesh.points)
        projection = _map(control)
        points = projection.forward(*places.T)
        mesh = dataclasses.replace(
            mesh,
            points=points,
            triangles=_counter_clockwise(points, mesh.triangles),
            projection=projection,
        )
    if control.nolifa in (0, 1) or not (mesh.depth > 0.0).all():
        mesh = dataclasses.replace(
            mesh, depth=np.maximum(mesh.depth, control.minimum_depth)
        )
    return mesh


def _counter_clockwise(points: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """Triangles in order on this map, where another one was torn at another place."""
    clockwise = quality.area(points, triangles) < 0.0
    turned = triangles.copy()
    turned[clockwise, 1:] = triangles[clockwise, :0:-1]
    return turned


def _map(control: ControlFile) -> Projection:
    """ADCIRC's map: Mercator's (ICS = 22), or its own equirectangular one."""
    if abs(control.ics) == MERCATOR:
        return Projection(
            f"+proj=merc +lat_ts={control.sfea0} +lon_0={control.slam0} "
            f"+R={EARTH_RADIUS} +units=m"
        )
    return Projection.equirectangular(control.slam0, control.sfea0)


def _attributes(
    control: ControlFile, fort15: Path, fort13: str | Path | None, mesh: CoastalMesh
) -> NodalAttributes | None:
    if fort13 is not None and not Path(fort13).is_file():
        raise InputError(f"{fort13}: no such file of nodal attributes (fort.13)")
    if not control.nwp:
        return None
    path = Path(fort13) if fort13 is not None else fort15.with_name("fort.13")
    if not path.is_file():
        raise InputError(
            f"{fort15} asks for the nodal attributes {', '.join(control.nwp)}, but "
            f"there is no {path}"
        )
    attributes = read_fort13(path, mesh)
    missing = [name for name in control.nwp if name not in attributes.names]
    if missing:
        raise InputError(f"{path}: holds no {', '.join(missing)}, which {fort15} names")
    return attributes


def _physics(
    control: ControlFile,
    attributes: NodalAttributes | None,
    mesh: CoastalMesh,
    notes: list[str],
) -> tuple[TideSettings, dict[str, Any]]:
    """Settings that one number decides, and nodal arrays for what varies."""
    known: dict[str, Any] = {}
    named = {} if attributes is None else dict(zip(attributes.names, attributes.values))
    named = {name: value for name, value in named.items() if name in control.nwp}
    law = "linear" if control.nolibf == 0 else "quadratic"
    if law == "quadratic":
        drag = np.full(len(mesh.points), control.friction)
        if control.nolibf == 2 and control.hybrid is not None:
            # ADCIRC's hybrid law: more friction in water shallower than HBREAK.
            depth_of_break, theta, gamma = control.hybrid
            ratio = (depth_of_break / mesh.depth) ** theta
            drag = drag * (1.0 + ratio) ** (gamma / theta)
        if QUADRATIC in named:
            drag = np.ravel(named[QUADRATIC])
        if MANNING in named:
            manning = np.ravel(named[MANNING])
            floor = control.friction if control.nolibf == 1 else 0.0
            drag = np.maximum(control.gravity * manning**2 / np.cbrt(mesh.depth), floor)
        known["drag"] = drag
    used = {MANNING, QUADRATIC, WEIGHT}
    others = [name for name in control.nwp if name not in used]
    if others:
        notes.append(f"nodal attributes left out: {', '.join(others)}")
    if control.eddy_viscosity:
        notes.append(f"lateral eddy viscosity {control.eddy_viscosity:g} m2/s left out")
    if control.nffr is not None:
        notes.append("flow through river boundaries (NFFR) left out: they are walls")
    if control.ntip == 2:
        notes.append("self-attraction and loading (NTIP = 2, fort.24) left out")
    if control.nolifa == 2:
        notes.append("wetting and drying left out: elements stay wet")
    if control.ncor == 1:
        latitude = mesh.projection.inverse(mesh.points)[:, 1]
        known["coriolis"] = 2.0 * EARTH_ROTATION * np.sin(np.radians(latitude))
    elif control.cori:
        known["coriolis"] = np.full(len(mesh.points), control.cori)
    metric = "plane" if control.ics == 1 else "adcirc"
    if control.ics not in (1, 2, MERCATOR):
        # All full spherical forms converge to the tide of the sphere.
        metric = "geographic"
        notes.append(
            f"ICS = {control.ics}: triangles are measured on the sphere instead"
        )
    settings = TideSettings(
        constituents=("M2",),
        friction_law=law,
        friction=control.friction if law == "linear" else 4.0e-4,
        drag_coefficient=control.friction if law == "quadratic" else 3.0e-3,
        finite_amplitude=law == "quadratic" and control.nolifa > 0,
        advection=control.nolica > 0,
        tidal_potential=control.ntip > 0,
        gravity=control.gravity,
        metric=metric,
        minimum_inner_angle_deg=control.angle_minimum,
    )
    if law == "linear" and (control.nolifa or control.nolica):
        settings = msgspec.structs.replace(
            settings,
            finite_amplitude=control.nolifa > 0,
            advection=control.nolica > 0,
        )
    return settings, known


def _weight(
    control: ControlFile,
    attributes: NodalAttributes | None,
    notes: list[str],
    *,
    varies: bool,
) -> Any:
    """Weight tau0 of ADCIRC's wave equation; None where it cannot be imitated."""
    if attributes is not None and WEIGHT in control.nwp:
        if varies:
            return np.ravel(attributes.of(WEIGHT))
        what = f"{WEIGHT} varies from node to node"
    elif control.tau0 >= 0.0:
        return control.tau0
    else:
        what = f"TAU0 = {control.tau0:g} lets the weight of the wave equation vary"
    notes.append(f"{what}: Galerkin's method, to which all weights converge, stands in")
    return None


def _with_made(
    forcing: TideForcing, control: ControlFile, made: list[str]
) -> TideForcing:
    """The constituents of the harmonic analysis that nothing drives, as overtides."""
    wanted = {c.name: c for c in control.harmonic}
    frequency = [wanted[name].frequency for name in made]
    n = len(made)
    still = np.zeros((n, len(forcing.nodes)))
    more: dict[str, Any] = {}
    if forcing.nodal_factor is not None:
        factor = [wanted[name].nodal_factor or 1.0 for name in made]
        argument = [np.radians(wanted[name].argument_deg) for name in made]
        more["nodal_factor"] = np.concatenate([forcing.nodal_factor, factor])
        more["argument"] = np.concatenate([forcing.argument, argument])
    if forcing.potential is not None:
        none = np.zeros((n, forcing.potential.shape[1]))
        more["potential"] = np.concatenate([forcing.potential, none])
    return dataclasses.replace(
        forcing,
        names=(*forcing.names, *made),
        frequency=np.concatenate([forcing.frequency, frequency]),
        elevation=np.concatenate([forcing.elevation, still]),
        **more,
    )
