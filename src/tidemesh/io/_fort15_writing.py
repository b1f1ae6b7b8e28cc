"""Writing a fort.15, line by line."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from tidemesh.io._fortran import text_of
from tidemesh.io.control_file import ControlFile, GlobalOutput, StationOutput


def written_lines(control: ControlFile) -> list[str]:
    """The lines of the file, in ADCIRC's order."""
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
