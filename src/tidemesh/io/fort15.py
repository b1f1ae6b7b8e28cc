"""ADCIRC's control file, fort.15: options, forcing, output (two-dimensional runs).

One record a line, in a fixed order in which earlier values decide what follows; text
after the values of a line is a comment. Fields bear the names of ADCIRC's documentation
in lower case, or whole words where those say more.
"""

from __future__ import annotations

import logging
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from tidemesh.datatypes import CoastalMesh, TideForcing
from tidemesh.errors import InputError
from tidemesh.io._fortran import (
    Records,
    begins_with_numbers,
    items,
    read_bytes,
    real,
    text_of,
    writing,
)

logger = logging.getLogger(__name__)

RAMP_VALUES = (1, 1, 3, 4, 5, 6, 7, 8, 9)
"""Numbers on the DRAMP line by NRAMP."""

FLUX_TYPES = (2, 12, 22, 32, 52)
"""Boundary types (IBTYPE) whose nodes have a prescribed flow."""

_FLUX_LINE = (*FLUX_TYPES, 122)
"""Boundary types that make ADCIRC read NFFR."""

NETCDF_LINES = (
    "title",
    "institution",
    "source",
    "history",
    "references",
    "comments",
    "host",
    "convention",
    "contact",
    "base date, yyyy-MM-dd hh:mm:ss",
)
"""What the lines of the NetCDF header say."""

_NETCDF_HOT_STARTS = (3, 5, 367, 368, 567, 568)
_FASTEST = 1.0e-2
"""rad/s; a frequency above it was given in other units."""
_HARMLESS = (
    "metcontrol",
    "warnelevcontrol",
    "inundationoutputcontrol",
    "swanoutputcontrol",
)
"""Namelists that leave a tide without weather as it is."""
_NAMELIST = re.compile(r"^\s*[&$](\w+)", re.MULTILINE)


@dataclass(frozen=True, eq=False)
class PotentialConstituent:
    """A constituent of the tidal potential (NTIF)."""

    name: str
    amplitude: float
    """TPK, m, of the equilibrium tide."""
    frequency: float
    """AMIGT, rad/s."""
    earth_tide_factor: float
    """ETRF, for the tide of the solid earth."""
    nodal_factor: float
    """FFT."""
    argument_deg: float
    """FACET, V + u at the reference time."""


@dataclass(frozen=True, eq=False)
class BoundaryConstituent:
    """A constituent of the elevation at the open boundary (NBFR)."""

    name: str
    frequency: float
    """AMIG, rad/s."""
    nodal_factor: float
    """FF."""
    argument_deg: float
    """FACE, V + u at the reference time."""
    elevation: np.ndarray
    """(n_rows,) complex m: EMO * exp(-i EFA), a row for every node of every open string
    of the mesh, in the order of the fort.14; ADCIRC adds the rows of a node that two
    strings share (`boundary_rows` makes them)."""


@dataclass(frozen=True, eq=False)
class FluxConstituent:
    """A constituent of the flow through river boundaries (NFFR)."""

    name: str
    frequency: float
    """FAMIG, rad/s."""
    nodal_factor: float
    """FFF."""
    argument_deg: float
    """FFACE."""
    flux: np.ndarray
    """(n_rows,) complex m2/s into the domain: QNAM * exp(-i QNPH)."""
    elevation: np.ndarray
    """(n_rows,) complex m at nodes of IBTYPE 32, NaN at others."""


@dataclass(frozen=True)
class HarmonicConstituent:
    """A constituent of the harmonic analysis (NFREQ)."""

    name: str
    frequency: float
    """HAFREQ, rad/s."""
    nodal_factor: float = 1.0
    """HAFF."""
    argument_deg: float = 0.0
    """HAFACE."""


@dataclass(frozen=True)
class GlobalOutput:
    """Output at all nodes: NOUT, TOUTS, TOUTF, NSPOOL."""

    nout: int = 0
    """0 none, 1 text, 3 and 5 NetCDF, 4 compact text; negative: a new file after a hot
    start instead of appending."""
    start_day: float = 0.0
    end_day: float = 0.0
    every: int = 0
    """Steps between two records."""


@dataclass(frozen=True, eq=False)
class StationOutput:
    """Output at stations."""

    nout: int = 0
    """0 none, 1 text, 3 and 5 NetCDF; negative as in `GlobalOutput`."""
    start_day: float = 0.0
    end_day: float = 0.0
    every: int = 0
    """Steps between two records."""
    points: np.ndarray = field(default_factory=lambda: np.empty((0, 2)))
    """(n, 2) in the coordinates of the fort.14: m (ICS 1), or degrees."""
    names: tuple[str, ...] = ()
    """(n,), "" where there is none; or empty."""
    in_file: int = 0
    """Number of stations that ADCIRC finds in elev_stat.151 or vel_stat.151."""


@dataclass(frozen=True, eq=False, kw_only=True)
class ControlFile:
    """A fort.15 in memory. The defaults are those of a linear run without output."""

    run_description: str = ""
    run_id: str = ""
    nfover: int = 0
    """1: ADCIRC corrects errors that are not fatal."""
    nabout: int = 1
    nscreen: int = 1
    """0 also switches the check for blow-up off."""
    ihot: int = 0
    ics: int = 1
    """1: m; 2, 20 to 24: degrees; negative: rotated sphere."""
    im: int = 0
    nolibf: int = 0
    """Friction: 0 linear, 1 quadratic, 2 hybrid."""
    nolifa: int = 0
    """Finite amplitude: 0 no, 1 yes, 2 with wetting and drying."""
    nolica: int = 0
    """Advection."""
    nolicat: int = 0
    """Advection in the time derivative of the wave equation."""
    nwp: tuple[str, ...] = ()
    """Names of the nodal attributes wanted from the fort.13."""
    ncor: int = 0
    """Coriolis: 0 constant `cori`, 1 from the latitude."""
    ntip: int = 0
    """Tidal potential: 0 no, 1 yes, 2 with self-attraction and loading (fort.24)."""
    nws: int = 0
    nramp: int = 1
    gravity: float = 9.81
    tau0: float = 0.0
    """1/s; a negative number is a scheme of ADCIRC's."""
    tau0_range: tuple[float, float] | None = None
    """Smallest and largest tau0, with -6 < tau0 <= -5."""
    time_step: float
    """DTDP, s; negative: predictor-corrector scheme."""
    statim: float = 0.0
    """Day of the start."""
    reftim: float = 0.0
    """Day of the reference time of nodal factors and arguments."""
    run_days: float
    """RNDAY."""
    ramp_days: tuple[float, ...] = (0.0,)
    """DRAMP and further numbers, as many as `RAMP_VALUES` says of `nramp`."""
    weights: tuple[float, float, float] = (0.35, 0.30, 0.35)
    """A00, B00, C00."""
    minimum_depth: float = 1.0
    """H0, m."""
    wet_dry: tuple[int, int, float] | None = None
    """NODEDRYMIN, NODEWETMIN, VELMIN with `nolifa` = 2."""
    slam0: float = 0.0
    """Longitude of the middle of the map, degrees."""
    sfea0: float = 0.0
    """Latitude of the middle of the map, degrees."""
    friction: float = 0.0
    """TAU, 1/s, or CF, by `nolibf`."""
    hybrid: tuple[float, float, float] | None = None
    """HBREAK (m), FTHETA, FGAMMA with `nolibf` = 2."""
    eddy_viscosity: float = 0.0
    """ESLM, m2/s; negative: Smagorinsky's coefficient."""
    cori: float = 0.0
    """Coriolis parameter, 1/s, with `ncor` = 0."""
    potential: tuple[PotentialConstituent, ...] = ()
    forcing: tuple[BoundaryConstituent, ...] = ()
    angle_minimum: float = 90.0
    """ANGINN, degrees."""
    nffr: int | None = None
    """None without river boundaries; 0 or -1: flow from the fort.20; else the number
    of `flux` constituents."""
    flux: tuple[FluxConstituent, ...] = ()
    elevation_stations: StationOutput = StationOutput()
    velocity_stations: StationOutput = StationOutput()
    global_elevation: GlobalOutput = GlobalOutput()
    global_velocity: GlobalOutput = GlobalOutput()
    harmonic: tuple[HarmonicConstituent, ...] = ()
    harmonic_days: tuple[float, float] = (0.0, 0.0)
    """THAS, THAF."""
    harmonic_every: int = 0
    """NHAINC, steps."""
    fmv: float = 0.0
    """Part of the analysis whose means and variances are compared."""
    harmonic_output: tuple[int, int, int, int] = (0, 0, 0, 0)
    """NHASE, NHASV, NHAGE, NHAGV (fort.51 to 54): 0, 1 text, 3 and 5 NetCDF."""
    hot_start: tuple[int, int] = (0, 0)
    """NHSTAR, NHSINC."""
    solver: tuple[int, int, float, int] = (1, 0, 1.0e-10, 50)
    """ITITER, ISLDIA, CONVCR, ITMAX."""
    netcdf_header: tuple[str, ...] | None = None
    """The ten lines of `NETCDF_LINES`; needed where any output is NetCDF."""
    namelists: str = ""
    """What follows the last line, carried through as it stands."""

    def __post_init__(self) -> None:
        problem = _problem(self)
        if problem:
            raise ValueError(problem)

    @property
    def uses_netcdf(self) -> bool:
        """Whether any output is NetCDF, so that ADCIRC reads the header lines."""
        outputs = (
            self.elevation_stations.nout,
            self.velocity_stations.nout,
            self.global_elevation.nout,
            self.global_velocity.nout,
        )
        return (
            any(abs(nout) in (3, 5) for nout in outputs)
            or any(nha > 1 for nha in self.harmonic_output)
            or abs(self.hot_start[0]) in _NETCDF_HOT_STARTS
            or self.ihot in _NETCDF_HOT_STARTS
        )

    @property
    def namelist_names(self) -> tuple[str, ...]:
        """Names of the namelists at the end, in lower case."""
        return tuple(name.lower() for name in _NAMELIST.findall(self.namelists))


def read_fort15(path: str | Path, mesh: CoastalMesh | None = None) -> ControlFile:
    """Read the control file of a two-dimensional run without weather.

    Parameters
    ----------
    path : path
        May be gzipped.
    mesh : CoastalMesh, optional
        The mesh of the run. Without it the numbers of boundary rows are found from
        where the rows end.

    Returns
    -------
    control : ControlFile

    Raises
    ------
    FormatError
        If the file does not follow the format, does not belong to the mesh, or asks for
        what is not supported (weather and waves, three dimensions, transport,
        baroclinic terms); with the line.
    InputError
        If there is no such file.
    """
    path = Path(path)
    return _read(Records(path, read_bytes(path)), mesh)


def write_fort15(path: str | Path, control: ControlFile) -> None:
    """Write a control file as ADCIRC (v45 to v56) reads it; gzipped if named .gz.

    Numbers are written so that the same doubles are read again; boundary phases with
    twelve decimals of a degree.

    Raises
    ------
    InputError
        If the file cannot be written.
    """
    lines = _written(control)
    text = "\n".join(lines) + "\n"
    with writing(Path(path)) as file:
        file.write(text.encode("utf-8", errors="surrogateescape"))


def fort15_forcing(control: ControlFile, mesh: CoastalMesh) -> TideForcing:
    """What drives the tide of an ADCIRC run, for the embedded engines.

    Constituents of the boundary come first, then those that only the tidal potential
    has (with elevation 0 at the boundary, as in ADCIRC). The potential counts where
    `control.ntip` is not 0; species by frequency as ADCIRC tells them apart.

    Parameters
    ----------
    control : ControlFile
    mesh : CoastalMesh
        Needs a projection where there is a tidal potential.

    Returns
    -------
    forcing : TideForcing
        With nodal factors, arguments, and the potential if there is one.

    Raises
    ------
    InputError
        If the boundary rows do not belong to the mesh, or constituents contradict each
        other.
    """
    nodes = mesh.open_nodes
    names = [c.name for c in control.forcing]
    frequency = [c.frequency for c in control.forcing]
    factor = [c.nodal_factor for c in control.forcing]
    argument = [c.argument_deg for c in control.forcing]
    elevation = [_at_nodes(c, mesh, nodes) for c in control.forcing]
    rows = control.potential if control.ntip else ()
    potential = np.zeros((len(names), len(mesh.points)), dtype=np.complex128)
    for row in rows:
        part = _equilibrium(row, mesh)
        if row.name in names:
            k = names.index(row.name)
            if abs(row.frequency - frequency[k]) > 1.0e-9:
                raise InputError(
                    f"constituent {row.name} has the frequency {row.frequency:.9g} "
                    f"rad/s in the tidal potential and {frequency[k]:.9g} at the open "
                    "boundary; make them equal, or call one by another name"
                )
            if factor[k] == 0.0:
                raise InputError(
                    f"constituent {row.name} has the nodal factor 0 at the open "
                    "boundary, so that its tidal potential cannot be scaled"
                )
            # One factor and one argument a constituent; the potential carries what is
            # different about its own.
            shift = np.exp(1j * np.radians(row.argument_deg - argument[k]))
            potential[k] += row.nodal_factor / factor[k] * shift * part
            continue
        names.append(row.name)
        frequency.append(row.frequency)
        factor.append(row.nodal_factor)
        argument.append(row.argument_deg)
        elevation.append(np.zeros(len(nodes), dtype=np.complex128))
        potential = np.concatenate([potential, part[None]])
    if not names:
        raise InputError(
            "the fort.15 has no periodic forcing (NBFR and NTIF are 0); elevations of "
            "a fort.19 are not supported"
        )
    if control.nffr is not None:
        logger.warning("the flow through river boundaries (NFFR) is left out")
    if control.ntip == 2:
        logger.warning("self-attraction and loading (NTIP 2, fort.24) are left out")
    for name in control.namelist_names:
        if name not in _HARMLESS:
            logger.warning("the namelist %s is left out", name)
    return TideForcing(
        names=tuple(names),
        frequency=np.array(frequency, dtype=np.float64),
        nodes=nodes,
        elevation=np.array(elevation, dtype=np.complex128).reshape(
            len(names), len(nodes)
        ),
        nodal_factor=np.array(factor, dtype=np.float64),
        argument=np.radians(np.array(argument, dtype=np.float64)),
        potential=potential if rows else None,
    )


def boundary_rows(mesh: CoastalMesh, elevation: np.ndarray) -> np.ndarray:
    """Values at the ocean nodes as rows of a fort.15.

    ADCIRC adds the rows of a node that stands in two open strings, so the second one
    is 0.

    Parameters
    ----------
    mesh : CoastalMesh
    elevation : (n_ocean,) complex array
        At `mesh.open_nodes`.

    Returns
    -------
    rows : (n_rows,) complex array
        A value for every node of every open string.
    """
    listed = _listed(mesh)
    nodes = mesh.open_nodes
    order = np.argsort(nodes)
    rows = np.asarray(elevation)[order[np.searchsorted(nodes[order], listed)]]
    first = np.zeros(len(listed), dtype=bool)
    first[np.unique(listed, return_index=True)[1]] = True
    return np.where(first, rows, 0.0)


def _listed(mesh: CoastalMesh, repeat_first: bool = False) -> np.ndarray:
    """Nodes of all open strings as the fort.14 lists them."""
    runs = [np.empty(0, dtype=np.int64)]
    for string in mesh.boundaries:
        if string.kind == "open":
            runs.append(string.nodes)
            if string.closed and repeat_first:
                runs.append(string.nodes[:1])
    return np.concatenate(runs)


def _row_counts(mesh: CoastalMesh) -> tuple[int, ...]:
    """Numbers of boundary rows that fit; a ring may or may not repeat its first."""
    counts = {len(_listed(mesh)), len(_listed(mesh, repeat_first=True))}
    return tuple(sorted(counts))


def _at_nodes(
    constituent: BoundaryConstituent, mesh: CoastalMesh, nodes: np.ndarray
) -> np.ndarray:
    rows = np.asarray(constituent.elevation)
    for listed in (_listed(mesh), _listed(mesh, repeat_first=True)):
        if len(listed) == len(rows):
            break
    else:
        raise InputError(
            f"constituent {constituent.name} has {len(rows)} boundary rows, the mesh "
            f"lists {len(_listed(mesh))} open boundary nodes: this fort.15 does not "
            "belong to the mesh"
        )
    order = np.argsort(nodes)
    where = order[np.searchsorted(nodes[order], listed)]
    forced = np.bincount(where, weights=np.abs(rows) > 0.0, minlength=len(nodes))
    if (forced > 1).any():
        node = int(nodes[np.flatnonzero(forced > 1)[0]]) + 1
        logger.warning(
            "%s: node %d is listed twice at the open boundary; its rows are added up, "
            "as ADCIRC does",
            constituent.name,
            node,
        )
    real = np.bincount(where, weights=rows.real, minlength=len(nodes))
    imaginary = np.bincount(where, weights=rows.imag, minlength=len(nodes))
    return real + 1j * imaginary


def _equilibrium(row: PotentialConstituent, mesh: CoastalMesh) -> np.ndarray:
    """(n_points,) complex m, times the body-tide factor."""
    if not mesh.projection.crs:
        raise InputError(
            f"the tidal potential of {row.name} needs longitudes and latitudes, the "
            "mesh has none (ICS = 1)"
        )
    longitude, latitude = np.radians(mesh.projection.inverse(mesh.points)).T
    species = min(round(row.frequency / 7.0e-5), 2)
    cosine = np.cos(latitude)
    height = (1.5 * cosine**2 - 1.0, np.sin(2.0 * latitude), cosine**2)[species]
    size = row.amplitude * row.earth_tide_factor
    return size * height * np.exp(1j * species * longitude)


def _problem(control: ControlFile) -> str:
    """What the fields contradict each other in; "" if nothing."""
    if not 0 <= control.nramp < len(RAMP_VALUES):
        return f"nramp must be 0 to {len(RAMP_VALUES) - 1}, got {control.nramp}"
    want = RAMP_VALUES[control.nramp]
    if len(control.ramp_days) != want:
        return (
            f"ramp_days must have {want} value(s) with nramp = {control.nramp}, got "
            f"{len(control.ramp_days)}"
        )
    needed = {
        "wet_dry with nolifa = 2": (control.nolifa == 2, control.wet_dry),
        "hybrid with nolibf = 2": (control.nolibf == 2, control.hybrid),
        "tau0_range with -6 < tau0 <= -5": (
            -6.0 < control.tau0 <= -5.0,
            control.tau0_range,
        ),
        "netcdf_header with NetCDF output": (
            control.uses_netcdf,
            control.netcdf_header,
        ),
    }
    for what, (wanted, value) in needed.items():
        if wanted and value is None:
            return f"{what} is missing"
    if control.netcdf_header is not None and len(control.netcdf_header) != len(
        NETCDF_LINES
    ):
        return (
            f"netcdf_header must have {len(NETCDF_LINES)} lines, got "
            f"{len(control.netcdf_header)}"
        )
    if len({len(c.elevation) for c in control.forcing}) > 1:
        return "all boundary constituents must have the same number of rows"
    flows = 0 if control.nffr is None else max(control.nffr, 0)
    if len(control.flux) != flows:
        return f"flux must have {flows} constituent(s) (nffr), got {len(control.flux)}"
    for output in (control.elevation_stations, control.velocity_stations):
        if output.names and len(output.names) != len(output.points):
            return "stations must have as many names as points, or none"
        if output.in_file and len(output.points):
            return "stations are either listed or in a file of their own"
    return ""


_ROTATED = (-1, -2, -20, -21, -22, -23, -24)


def _read(lines: Records, mesh: CoastalMesh | None) -> ControlFile:
    values: dict = {
        "run_description": lines.text("the run description (RUNDES)"),
        "run_id": lines.text("the run identification (RUNID)"),
        "nfover": lines.integer("NFOVER"),
        "nabout": lines.integer("NABOUT"),
        "nscreen": lines.integer("NSCREEN"),
        "ihot": lines.choice("IHOT", (0, 17, 67, 68, 367, 368, 567, 568)),
        "ics": lines.choice("ICS", (*(1, 2, 20, 21, 22, 23, 24), *_ROTATED)),
        "im": _read_model(lines),
        "nolibf": lines.choice("NOLIBF", (0, 1, 2)),
        "nolifa": lines.choice("NOLIFA", (0, 1, 2)),
        "nolica": lines.choice("NOLICA", (0, 1)),
        "nolicat": lines.choice("NOLICAT", (0, 1)),
    }
    number = lines.count("NWP, the number of nodal attributes")
    values["nwp"] = tuple(_read_attribute(lines) for _ in range(number))
    values["ncor"] = lines.choice("NCOR", (0, 1))
    values["ntip"] = lines.choice("NTIP", (0, 1, 2))
    values["nws"] = _read_weather(lines)
    _read_time(lines, values)
    values["weights"] = tuple(lines.values("A00, B00, C00", "rrr"))
    if values["nolifa"] == 2:
        depth, *wet_dry = lines.values("H0, NODEDRYMIN, NODEWETMIN, VELMIN", "riir")
        values["wet_dry"] = tuple(wet_dry)
    else:
        depth = lines.number("H0")
    if depth <= 0.0:
        raise lines.error(f"expected a positive least depth H0, got {depth:g}")
    values["minimum_depth"] = depth
    values["slam0"], values["sfea0"] = lines.values("SLAM0, SFEA0", "rr")
    if values["nolibf"] == 2:
        values["friction"], *hybrid = lines.values("CF, HBREAK, FTHETA, FGAMMA", "rrrr")
        values["hybrid"] = tuple(hybrid)
    else:
        values["friction"] = lines.number("the friction coefficient (TAU or CF)")
    values["eddy_viscosity"] = lines.number("ESLM")
    values["cori"] = lines.number("CORI")
    values["potential"] = _read_potential(lines, values)
    values["forcing"] = _read_boundary(lines, mesh)
    values["angle_minimum"] = lines.number("ANGINN")
    values["nffr"], values["flux"] = _read_flux(lines, mesh)
    values["elevation_stations"] = _read_stations(lines, "E")
    values["velocity_stations"] = _read_stations(lines, "V")
    for name, letter in (("global_elevation", "E"), ("global_velocity", "V")):
        record = _read_output(lines, f"G{letter}", (0, 1, 3, 4, 5, 7))
        values[name] = GlobalOutput(*record)
    _read_harmonic(lines, values)
    values["hot_start"] = tuple(lines.values("NHSTAR, NHSINC", "ii"))
    values["solver"] = tuple(lines.values("ITITER, ISLDIA, CONVCR, ITMAX", "iiri"))
    dummy = ControlFile(**values | {"netcdf_header": ("",) * len(NETCDF_LINES)})
    if dummy.uses_netcdf:
        values["netcdf_header"] = _read_header(lines)
    lines.warn_of_open_end()
    values["namelists"] = lines.rest()
    return ControlFile(**values)


def _read_attribute(lines: Records) -> str:
    (name,) = lines.values("the name of a nodal attribute", "w")
    if begins_with_numbers(name, 1):
        raise lines.error(f'expected the name of a nodal attribute, got "{name}"')
    return name


def _read_model(lines: Records) -> int:
    model = lines.integer("IM")
    if model == 0:
        return model
    digits = str(model)
    plain = len(digits) == 6 and all(
        digit in allowed
        for digit, allowed in zip(
            digits, ("12345", "123", "123456", "123", "12", "0123")
        )
    )
    if not plain:
        raise lines.error(
            f"IM = {model} (three dimensions, transport or density) is not supported; "
            "expected 0, or six digits from 111111 of a barotropic two-dimensional run"
        )
    return model


def _read_weather(lines: Records) -> int:
    weather = lines.integer("NWS")
    if weather != 0:
        raise lines.error(
            f"NWS = {weather} (wind, pressure, waves or ice) is not supported; "
            "expected 0: take the weather and its lines out"
        )
    return weather


def _read_time(lines: Records, values: dict) -> None:
    nramp = lines.choice("NRAMP", tuple(range(len(RAMP_VALUES))))
    values["nramp"] = nramp
    values["gravity"] = lines.number("G")
    if values["gravity"] <= 0.0:
        raise lines.error(f"expected a positive G, got {values['gravity']:g}")
    values["tau0"] = lines.number("TAU0")
    if -6.0 < values["tau0"] <= -5.0:
        values["tau0_range"] = tuple(
            lines.values("Tau0FullDomainMin, Tau0FullDomainMax", "rr")
        )
    values["time_step"] = lines.number("DTDP")
    if values["time_step"] == 0.0:
        raise lines.error("expected a time step DTDP other than 0")
    values["statim"] = lines.number("STATIM")
    values["reftim"] = lines.number("REFTIM")
    values["run_days"] = lines.number("RNDAY")
    if values["run_days"] <= 0.0:
        raise lines.error(f"expected a positive RNDAY, got {values['run_days']:g}")
    what = f"DRAMP and what NRAMP = {nramp} asks for"
    values["ramp_days"] = tuple(lines.values(what, "r" * RAMP_VALUES[nramp]))


def _read_name(lines: Records, number: int, what: str) -> str:
    words = lines.text(f"the name of {what}").split()
    name = words[0] if words else f"C{number}"
    if begins_with_numbers(name, 1):
        raise lines.error(f'expected the name of {what}, got "{" ".join(words)}"')
    return name


def _read_frequency(lines: Records, what: str, kinds: str, index: int = 0) -> list:
    row = lines.values(what, kinds)
    if not 0.0 <= row[index] <= _FASTEST:
        raise lines.error(
            f"expected a frequency in rad/s, 0 to {_FASTEST:g}, got {row[index]:g}"
        )
    return row


def _once(lines: Records, names: list[str], name: str, what: str) -> None:
    if name in names:
        raise lines.error(f"{what} {name} was given before")
    names.append(name)


def _read_potential(lines: Records, values: dict) -> tuple[PotentialConstituent, ...]:
    number = lines.count("NTIF, the number of constituents of the tidal potential")
    if number and not values["ntip"]:
        raise lines.error(
            f"NTIF = {number} contradicts NTIP = 0 (no tidal potential): ADCIRC stops "
            "at this; set NTIP to 1 or NTIF to 0"
        )
    rows = []
    names: list[str] = []
    for k in range(number):
        what = "a constituent of the tidal potential"
        name = _read_name(lines, k + 1, what)
        _once(lines, names, name, "tidal potential of")
        size, frequency, *rest = _read_frequency(
            lines, "TPK, AMIGT, ETRF, FFT, FACET", "rrrrr", 1
        )
        rows.append(PotentialConstituent(name, size, frequency, *rest))
    return tuple(rows)


def _read_boundary(
    lines: Records, mesh: CoastalMesh | None
) -> tuple[BoundaryConstituent, ...]:
    number = lines.count("NBFR, the number of constituents at the open boundary")
    names: list[str] = []
    heads = []
    for k in range(number):
        name = _read_name(lines, k + 1, "a constituent of the open boundary")
        _once(lines, names, name, "open boundary constituent")
        heads.append((name, *_read_frequency(lines, "AMIG, FF, FACE", "rrr")))
    result = []
    for k, head in enumerate(heads):
        _check_label(lines, names, k)
        rows = _read_rows(lines, head[0], mesh)
        if k and len(rows) != len(result[0].elevation):
            raise lines.error(
                f"{head[0]} has {len(rows)} boundary rows, {names[0]} has "
                f"{len(result[0].elevation)}"
            )
        elevation = rows[:, 0] * np.exp(-1j * np.radians(rows[:, 1]))
        result.append(BoundaryConstituent(*head, elevation))
    return tuple(result)


def _check_label(lines: Records, names: list[str], index: int) -> None:
    """The line over the rows is free text, but must not name another constituent."""
    label = lines.text(f"the name over the boundary rows of {names[index]}")
    word = label.split()[0].upper() if label else ""
    own = names[index].upper()
    if word != own and word in [name.upper() for name in names]:
        raise lines.error(
            f"expected the boundary rows of {names[index]}, got those of {word}: the "
            "rows must stand in the order of the constituents"
        )
    if begins_with_numbers(label, 2):
        raise lines.error(
            f"expected the name over the boundary rows of {names[index]}, got "
            f'"{label}": if this is a row, there are more rows than open boundary '
            "nodes and this fort.15 does not belong to the mesh"
        )


def _read_rows(lines: Records, name: str, mesh: CoastalMesh | None) -> np.ndarray:
    """(n_rows, 2) amplitudes and phases of one constituent."""
    ahead = lines.rows_ahead(2)
    if mesh is None:
        if ahead == 0:
            raise lines.error(
                f"expected boundary rows of {name} (amplitude, phase), there are none; "
                "a mesh tells how many there must be"
            )
        return lines.table(ahead, 2, f"amplitude and phase of {name}")
    counts = _row_counts(mesh)
    count = ahead if ahead in counts else counts[0]
    foreign = (
        f"the mesh has {counts[0]} open boundary nodes, there are {ahead} rows for "
        f"{name}"
    )
    if ahead > count:
        lines.table(count, 2, f"amplitude and phase of {name}")
        lines.raw("ANGINN")
        raise lines.error(f"this fort.15 does not belong to the mesh: {foreign}")
    if ahead < count:
        lines.table(ahead, 2, f"amplitude and phase of {name}")
        text = lines.raw(f"amplitude and phase of {name}").strip()
        raise lines.error(
            f"expected amplitude and phase of {name} at open boundary node "
            f'{ahead + 1} of {counts[0]}, got "{text}"; if the rows end here, this '
            f"fort.15 does not belong to the mesh ({foreign})"
        )
    return lines.table(count, 2, f"amplitude and phase of {name}")


def _read_flux(
    lines: Records, mesh: CoastalMesh | None
) -> tuple[int | None, tuple[FluxConstituent, ...]]:
    ahead = lines.peek()
    has_line = ahead is not None and not begins_with_numbers(ahead, 4)
    if mesh is not None:
        types = {string.ibtype for string in mesh.boundaries if string.kind != "open"}
        rivers = sorted(types & set(_FLUX_LINE))
        if rivers and not has_line:
            lines.raw("NFFR")
            raise lines.error(
                f"expected NFFR, since the mesh has boundaries of type {rivers[0]} "
                f'(prescribed flow), got "{(ahead or "").strip()}": this fort.15 does '
                "not belong to the mesh"
            )
        if not rivers:
            return None, ()
    elif not has_line:
        return None, ()
    number = lines.integer(
        "NFFR, the number of flow constituents (or NOUTE, TOUTSE, TOUTFE, NSPOOLE)"
    )
    if number < -1:
        raise lines.error(f"expected NFFR, -1 or more, got {number}")
    names: list[str] = []
    heads = []
    for k in range(number):
        name = _read_name(lines, k + 1, "a flow constituent")
        _once(lines, names, name, "flow constituent")
        heads.append((name, *_read_frequency(lines, "FAMIG, FFF, FFACE", "rrr")))
    result = []
    for k, head in enumerate(heads):
        _check_label(lines, names, k)
        rows = _read_flux_rows(lines, head[0], mesh)
        flux = rows[:, 0] * np.exp(-1j * np.radians(rows[:, 1]))
        elevation = rows[:, 2] * np.exp(-1j * np.radians(rows[:, 3]))
        result.append(FluxConstituent(*head, flux, elevation))
    return number, tuple(result)


def _read_flux_rows(lines: Records, name: str, mesh: CoastalMesh | None) -> np.ndarray:
    """(n_rows, 4) flux and phase, elevation and phase (NaN where not given)."""
    what = f"flow and phase of {name}"
    if mesh is None:
        # The rows of the last constituent end at the four numbers of NOUTE.
        widths = [2] * (lines.rows_ahead(2, not_as_many_as=4))
        if not widths:
            raise lines.error(
                f"expected rows of {what}; the mesh tells how many and how wide"
            )
    else:
        widths = []
        for string in mesh.boundaries:
            if string.kind != "open" and string.ibtype in FLUX_TYPES:
                ring = string.kind == "mainland" and string.closed
                width = 4 if string.ibtype == 32 else 2
                widths += [width] * (len(string.nodes) + ring)
    rows = np.full((len(widths), 4), np.nan)
    for k, width in enumerate(widths):
        text = lines.peek()
        if text is None or not begins_with_numbers(text, width):
            lines.raw(what)
            raise lines.error(
                f"expected {what} at river node {k + 1} of {len(widths)} ({width} "
                f'numbers), got "{(text or "").strip()}"; if the rows end here, this '
                "fort.15 does not belong to the mesh"
            )
        rows[k, :width] = lines.values(what, "r" * width)
    return rows


def _read_output(lines: Records, letters: str, allowed: tuple[int, ...]) -> list:
    what = f"NOUT{letters}, TOUTS{letters}, TOUTF{letters}, NSPOOL{letters}"
    record = lines.values(what, "irri")
    if abs(record[0]) not in allowed:
        few = ", ".join(str(number) for number in allowed)
        raise lines.error(f"expected NOUT{letters} {few} or negative, got {record[0]}")
    return record


def _read_stations(lines: Records, letter: str) -> StationOutput:
    record = _read_output(lines, letter, (0, 1, 3, 5))
    number = lines.integer(f"NSTA{letter}, the number of stations")
    if number < 0:
        return StationOutput(*record, in_file=-number)
    points, names = [], []
    for k in range(number):
        what = f"coordinates of station {k + 1} of {number}"
        text = lines.raw(what)
        # Four numbers are the next line of the file, not a station.
        if not begins_with_numbers(text, 2) or begins_with_numbers(text, 4):
            raise lines.error(f'expected {what}, got "{text.strip()}"')
        x, y, name = _station(text)
        points.append((x, y))
        names.append(name)
    return StationOutput(
        *record,
        points=np.array(points, dtype=np.float64).reshape(number, 2),
        names=tuple(names),
    )


def _station(text: str) -> tuple[float, float, str]:
    """Coordinates, and the name behind them: up to a mark, or behind a leading one."""
    first, second = items(text, 2)
    left = text.strip()
    for word in (first, second):
        left = left[left.index(word) + len(word) :].lstrip(" \t,")
    name = left.lstrip("! \t").split("!", 1)[0].strip()
    return real(first), real(second), name


def _read_harmonic(lines: Records, values: dict) -> None:
    names: list[str] = []
    rows = []
    for k in range(lines.count("NFREQ, the number of constituents analysed")):
        name = _read_name(lines, k + 1, "a constituent of the harmonic analysis")
        _once(lines, names, name, "analysed constituent")
        record = _read_frequency(lines, "HAFREQ, HAFF, HAFACE", "rrr")
        rows.append(HarmonicConstituent(name, *record))
    values["harmonic"] = tuple(rows)
    start, end, every, fmv = lines.values("THAS, THAF, NHAINC, FMV", "rrir")
    values["harmonic_days"] = start, end
    values["harmonic_every"] = every
    values["fmv"] = fmv
    values["harmonic_output"] = tuple(
        lines.values("NHASE, NHASV, NHAGE, NHAGV", "iiii")
    )


def _read_header(lines: Records) -> tuple[str, ...]:
    header = []
    for what in NETCDF_LINES:
        text = lines.text(f"a line of the NetCDF header ({what})")
        if _NAMELIST.match(text):
            raise lines.error(
                f'expected a line of the NetCDF header ({what}), got "{text}": NetCDF '
                f"output needs {len(NETCDF_LINES)} lines before the namelists"
            )
        header.append(text)
    return tuple(header)


def _written(control: ControlFile) -> list[str]:
    """The lines of the file."""
    lines: list[str] = []

    def add(comment: str, *values: object) -> None:
        text = " ".join(v if isinstance(v, str) else text_of(v) for v in values)
        lines.append(f" {text:<37s} ! {comment}")

    def add_name(comment: str, name: str) -> None:
        # ADCIRC compares names with their blanks (fort.24): none in front.
        lines.append(f"{name:<38s} ! {comment}")

    # Without comments: ADCIRC copies these lines into its output.
    for text in (control.run_description, control.run_id):
        lines.append(" ".join(text.split()))
    add("NFOVER", control.nfover)
    add("NABOUT", control.nabout)
    add("NSCREEN", control.nscreen)
    add("IHOT", control.ihot)
    add("ICS", control.ics)
    add("IM", control.im)
    add("NOLIBF", control.nolibf)
    add("NOLIFA", control.nolifa)
    add("NOLICA", control.nolica)
    add("NOLICAT", control.nolicat)
    add("NWP", len(control.nwp))
    lines += control.nwp
    add("NCOR", control.ncor)
    add("NTIP", control.ntip)
    add("NWS", control.nws)
    add("NRAMP", control.nramp)
    add("G", float(control.gravity))
    add("TAU0", float(control.tau0))
    if -6.0 < control.tau0 <= -5.0:
        add("Tau0FullDomainMin, Tau0FullDomainMax", *control.tau0_range)
    add("DTDP", float(control.time_step))
    add("STATIM", float(control.statim))
    add("REFTIM", float(control.reftim))
    add("RNDAY", float(control.run_days))
    add("DRAMP and others", *map(float, control.ramp_days))
    add("A00, B00, C00", *map(float, control.weights))
    if control.nolifa == 2:
        dry, wet, velocity = control.wet_dry
        add(
            "H0, NODEDRYMIN, NODEWETMIN, VELMIN",
            float(control.minimum_depth),
            int(dry),
            int(wet),
            float(velocity),
        )
    else:
        add("H0", float(control.minimum_depth))
    add("SLAM0, SFEA0", float(control.slam0), float(control.sfea0))
    if control.nolibf == 2:
        hybrid = map(float, control.hybrid)
        add("CF, HBREAK, FTHETA, FGAMMA", float(control.friction), *hybrid)
    else:
        add("TAU" if control.nolibf == 0 else "CF", float(control.friction))
    add("ESLM", float(control.eddy_viscosity))
    add("CORI", float(control.cori))
    add("NTIF", len(control.potential))
    for row in control.potential:
        add_name("TIPOTAG", row.name)
        add(
            "TPK, AMIGT, ETRF, FFT, FACET",
            float(row.amplitude),
            float(row.frequency),
            float(row.earth_tide_factor),
            float(row.nodal_factor),
            float(row.argument_deg),
        )
    add("NBFR", len(control.forcing))
    _add_heads(add, add_name, control.forcing, "BOUNTAG", "AMIG, FF, FACE")
    for forced in control.forcing:
        add_name("ALPHA", forced.name)
        lines += [f" {size} {lag}" for size, lag in _pairs(forced.elevation)]
    add("ANGINN", float(control.angle_minimum))
    if control.nffr is not None:
        add("NFFR", control.nffr)
        _add_heads(add, add_name, control.flux, "FBOUNTAG", "FAMIG, FFF, FFACE")
        for flow in control.flux:
            add_name("ALPHA", flow.name)
            rising = np.isfinite(flow.elevation)
            level = _pairs(np.where(rising, flow.elevation, 0.0))
            for row, both, more in zip(_pairs(flow.flux), rising, level):
                lines.append(" " + " ".join(row + more if both else row))
    for letter, stations in (
        ("E", control.elevation_stations),
        ("V", control.velocity_stations),
    ):
        _add_output(add, letter, stations)
        add(f"NSTA{letter}", -stations.in_file or len(stations.points))
        names = stations.names or ("",) * len(stations.points)
        for (x, y), name in zip(stations.points.tolist(), names):
            lines.append(f" {x!r} {y!r}" + (f" ! {name}" if name else ""))
    _add_output(add, "GE", control.global_elevation)
    _add_output(add, "GV", control.global_velocity)
    add("NFREQ", len(control.harmonic))
    _add_heads(add, add_name, control.harmonic, "NAMEFR", "HAFREQ, HAFF, HAFACE")
    add(
        "THAS, THAF, NHAINC, FMV",
        *map(float, control.harmonic_days),
        int(control.harmonic_every),
        float(control.fmv),
    )
    add("NHASE, NHASV, NHAGE, NHAGV", *control.harmonic_output)
    add("NHSTAR, NHSINC", *control.hot_start)
    add("ITITER, ISLDIA, CONVCR, ITMAX", *control.solver)
    if control.uses_netcdf:
        lines += control.netcdf_header
    if control.namelists:
        lines.append(control.namelists)
    return lines


def _add_heads(
    add: Callable, add_name: Callable, rows: Sequence, tag: str, comment: str
) -> None:
    for row in rows:
        add_name(tag, row.name)
        add(
            comment,
            float(row.frequency),
            float(row.nodal_factor),
            float(row.argument_deg),
        )


def _add_output(
    add: Callable, letters: str, output: GlobalOutput | StationOutput
) -> None:
    add(
        f"NOUT{letters}, TOUTS{letters}, TOUTF{letters}, NSPOOL{letters}",
        output.nout,
        float(output.start_day),
        float(output.end_day),
        output.every,
    )


def _pairs(values: np.ndarray) -> list[tuple[str, str]]:
    """Amplitude and phase (degrees) so that decimals come back as they were given."""
    values = np.asarray(values, dtype=np.complex128)
    lag = np.round(np.degrees(-np.angle(values)) % 360.0, 12)
    lag[lag >= 360.0] = 0.0
    return [
        (f"{size:.15g}", repr(angle))
        for size, angle in zip(np.abs(values).tolist(), lag.tolist())
    ]
