"""An ADCIRC run's options, forcing and output: a fort.15 in memory.

Fields bear the names of ADCIRC's documentation in lower case, or whole words where
those say more.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field

import numpy as np

RAMP_VALUES = (1, 1, 3, 4, 5, 6, 7, 8, 9)
"""Numbers on the DRAMP line by NRAMP."""

FLUX_TYPES = (2, 12, 22, 32, 52)
"""Boundary types (IBTYPE) whose nodes have a prescribed flow."""

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
"""Values of IHOT and NHSTAR that mean NetCDF."""

NAMELIST = re.compile(r"^\s*[&$](\w+)", re.MULTILINE)


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
        return tuple(name.lower() for name in NAMELIST.findall(self.namelists))


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
