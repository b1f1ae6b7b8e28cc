"""Reading a fort.15, record by record."""

from __future__ import annotations

import numpy as np

from tidemesh.datatypes import CoastalMesh
from tidemesh.io._fortran import Records, begins_with_numbers, items, real
from tidemesh.io.control_file import (
    FLUX_TYPES,
    NAMELIST,
    NETCDF_LINES,
    RAMP_VALUES,
    BoundaryConstituent,
    ControlFile,
    FluxConstituent,
    GlobalOutput,
    HarmonicConstituent,
    PotentialConstituent,
    StationOutput,
)

_FLUX_LINE = (*FLUX_TYPES, 122)
"""Boundary types that make ADCIRC read NFFR."""

_FASTEST = 1.0e-2
"""rad/s; a frequency above it was given in other units."""

_COORDINATES = (1, 2, 20, 21, 22, 23, 24)
"""Values of ICS; negative ones turn the sphere."""

_MODEL_DIGITS = ("12345", "123", "123456", "123", "12", "0123")
"""What the digits of IM may be in a barotropic two-dimensional run."""


def listed_nodes(mesh: CoastalMesh, repeat_first: bool = False) -> np.ndarray:
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
    counts = {len(listed_nodes(mesh)), len(listed_nodes(mesh, repeat_first=True))}
    return tuple(sorted(counts))


def read_records(lines: Records, mesh: CoastalMesh | None) -> ControlFile:
    """The control file in ADCIRC's order of records; errors name the line."""
    values: dict = {
        "run_description": lines.text("the run description (RUNDES)"),
        "run_id": lines.text("the run identification (RUNID)"),
        "nfover": lines.integer("NFOVER"),
        "nabout": lines.integer("NABOUT"),
        "nscreen": lines.integer("NSCREEN"),
        "ihot": lines.choice("IHOT", (0, 17, 67, 68, 367, 368, 567, 568)),
        "ics": lines.choice("ICS", (*_COORDINATES, *(-k for k in _COORDINATES))),
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
    # With a header that need not be right, to ask whether there is one.
    so_far = ControlFile(**values, netcdf_header=("",) * len(NETCDF_LINES))
    if so_far.uses_netcdf:
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
    digits = str(model)
    plain = len(digits) == len(_MODEL_DIGITS) and all(
        digit in allowed for digit, allowed in zip(digits, _MODEL_DIGITS)
    )
    if model != 0 and not plain:
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
        if NAMELIST.match(text):
            raise lines.error(
                f'expected a line of the NetCDF header ({what}), got "{text}": NetCDF '
                f"output needs {len(NETCDF_LINES)} lines before the namelists"
            )
        header.append(text)
    return tuple(header)
