"""The tide at Charleston: constants and the water levels of Fig. 9 (paper, section 4).

    python validation/charleston.py [out/charleston]

Meshes the coast with 10,000 nodes, from the fine data (fine.toml) and from the shipped
ones (south_carolina.toml), solves M2 S2 N2 K1 O1 with several friction laws and two
boundaries, and prints one row each: errors of M2 at Charleston and at Springmaid Pier,
the rms error of M2 at the gauges on the open coast and at all gauges in or near the
mesh, and what the solution cost. Then the other constituents, the levels of 16 to 31
March 1998, M4 and M6.

Two things are varied to see where the errors come from. "fitted": the boundary values
are moved, smoothly, until five piers and an inlet are met; Charleston takes no part.
"rivers": the Ashley, Cooper, Wando and Stono, which the shoreline leaves out, are cut
into the land where the bathymetry knows them.
"""

from __future__ import annotations

import json
import sys
import time
from dataclasses import replace
from functools import partial
from pathlib import Path

import msgspec
import netCDF4
import numpy as np
import shapely

from tidemesh import plots, tides, verification
from tidemesh.constants import frequency
from tidemesh.datatypes import CoastalMesh, TideForcing, TideRecord, TideSolution
from tidemesh.errors import TidemeshError
from tidemesh.io.tide_tables import read_tide_table
from tidemesh.pipeline import store
from tidemesh.pipeline.run import run_case
from tidemesh.tides import TideSettings
from tidemesh.tides.astronomy import predict
from tidemesh.tides.gauge_fit import fit_boundary

ROOT = Path(__file__).parents[1]
EXAMPLE = ROOT / "examples" / "south_carolina"
FINE_DATA = ROOT.parent / "shared" / "data" / "south_carolina"
CHARLESTON, SPRINGMAID = "Charleston (Customhouse Wharf)", "Springmaid Pier"
NAMES = ("M2", "S2", "N2", "K1", "O1")
COMMON = ["output.figures=false", "sizing.nodes=10000"]
DAYS = ("1998-03-16", "1998-04-01")
RIVERS_DEG = (-80.25, 32.55, -79.7, 33.1)
"""Where the fine bathymetry is a survey of 200 m (its source 1)."""

BASE = TideSettings(constituents=NAMES, coriolis="latitude", friction_law="quadratic")
LAWS = {
    "quadratic 0.003": {},
    "quadratic 0.0025": {"drag_coefficient": 0.0025},
    "Manning 0.020": {"friction_law": "manning", "manning_n": 0.020},
    "Manning 0.025": {"friction_law": "manning", "manning_n": 0.025},
    "linear 0.0004": {"friction_law": "linear", "friction": 4e-4},
    "linear 0.0001": {"friction_law": "linear", "friction": 1e-4},
}


def main(output: str = "out/charleston") -> None:
    """Print the tables; figures into the output folder."""
    if not FINE_DATA.is_dir():
        print(f"skipped: the fine data are not there ({FINE_DATA})")
        return
    folder = Path(output)
    folder.mkdir(parents=True, exist_ok=True)
    rivers = shoreline_with_rivers(folder / "rivers.geojson")
    fine_table = FINE_DATA / "open_boundary_forcing.csv"
    coarse_table = EXAMPLE / "data" / "open_boundary.csv"
    fine = mesh_of(EXAMPLE / "fine.toml", folder / "fine")
    carved = mesh_of(
        EXAMPLE / "fine.toml",
        folder / "rivers",
        f"domain.shoreline={rivers}",
        "domain.min_spacing_m=250",
        "sizing.min_m=120",
    )
    coarse = mesh_of(EXAMPLE / "south_carolina.toml", folder / "coarse")

    print(HEADER)
    for law in LAWS:
        row("fine", fine, driven(fine, fine_table), law)
    best = row("fine, fitted", fine, fitted(fine, fine_table), "quadratic 0.003")
    row("rivers", carved, driven(carved, fine_table), "quadratic 0.003")
    row("rivers, fitted", carved, fitted(carved, fine_table), "quadratic 0.003")
    for law in LAWS:
        row("shipped", coarse, driven(coarse, coarse_table), law)
    row("shipped, fitted", coarse, fitted(coarse, coarse_table), "quadratic 0.003")
    if best is not None:
        constituents_and_levels(fine, best, folder)
        overtides(fine, fitted(fine, fine_table))


# ---- cases -----------------------------------------------------------------------


def mesh_of(case: Path, folder: Path, *overrides: str) -> CoastalMesh:
    """Run a case; its mesh."""
    run_case(case, output=folder, overrides=[*COMMON, *overrides], until="mesh")
    return store.load(folder / "stages" / "mesh.npz")


def driven(mesh: CoastalMesh, table: Path) -> TideForcing:
    """Boundary values of a table."""
    return tides.boundary_forcing(mesh, read_tide_table(table), NAMES)


def fitted(mesh: CoastalMesh, table: Path) -> TideForcing:
    """The same, moved to meet gauges on the open coast."""
    gauges = read_tide_table(EXAMPLE / "data" / "open_coast_gauges.csv")
    return fit_boundary(mesh, gauges, BASE, first_guess=driven(mesh, table)).forcing


def shoreline_with_rivers(path: Path) -> Path:
    """Land polygons less the river cells of the bathymetry that reach the sea."""
    source = FINE_DATA / "shoreline_gshhg_full.geojson"
    content = json.loads(source.read_text(encoding="utf-8"))
    land = [shapely.geometry.shape(f["geometry"]) for f in content["features"]]
    west, south, east, north = RIVERS_DEG
    with netCDF4.Dataset(FINE_DATA / "bathymetry_dem_15s.nc") as data:
        x, y = np.asarray(data["lon"][:]), np.asarray(data["lat"][:])
        wet = (np.asarray(data["elevation"][:]) < -1.0) & (
            np.asarray(data["source"][:]) == 1
        )
    wet &= ((y > south) & (y < north))[:, None] & ((x > west) & (x < east))
    i, j = np.nonzero(wet)
    # A hair wider than the cells, so that neighbours join.
    half = 0.5005 * (x[1] - x[0])
    cells = shapely.union_all(
        shapely.box(x[j] - half, y[i] - half, x[j] + half, y[i] + half)
    )
    window = shapely.box(west - 0.3, south - 0.3, east + 0.3, north)
    sea = window.difference(shapely.union_all(land))
    connected = max(
        shapely.get_parts(shapely.union(sea, cells)), key=lambda part: part.area
    )
    water = shapely.intersection(cells, connected).buffer(0)
    parts = np.concatenate([shapely.get_parts(p.difference(water)) for p in land])
    features = [
        {"type": "Feature", "properties": {}, "geometry": shapely.geometry.mapping(p)}
        for p in parts
        if p.geom_type == "Polygon" and p.area > 1e-6
    ]
    path.write_text(
        json.dumps({"type": "FeatureCollection", "features": features}),
        encoding="utf-8",
    )
    return path


# ---- table -----------------------------------------------------------------------

HEADER = (
    f"{'case':16} {'friction':17} {'Charleston M2':>17} {'Springmaid M2':>17} "
    f"{'open coast':>10} {'all gauges':>12} {'steps':>5} {'CPU s':>5}"
)


def row(
    case: str, mesh: CoastalMesh, forcing: TideForcing, law: str
) -> TideSolution | None:
    """Solve and print one row."""
    started = time.process_time()
    settings = msgspec.structs.replace(BASE, **LAWS[law])
    try:
        tide, report = tides.solve_with_report(mesh, forcing, settings)
    except TidemeshError as error:
        print(f"{case:16} {law:17} {error}")
        return None
    seconds = time.process_time() - started
    compared = at_gauges(mesh, tide)
    open_coast = read_tide_table(EXAMPLE / "data" / "open_coast_gauges.csv")
    piers = verification.compare_constants(compared.modelled, open_coast, names=["M2"])
    m2 = compared.summary[0]
    print(
        f"{case:16} {law:17} {error_of(compared, CHARLESTON, 'M2'):>17} "
        f"{error_of(compared, SPRINGMAID, 'M2'):>17} "
        f"{piers.rss_error_m:8.3f} m {m2.rms_error_m:7.3f} ({m2.gauges:2}) "
        f"{report.iterations:5} {seconds:5.1f}",
        flush=True,
    )
    return tide


def at_gauges(
    mesh: CoastalMesh, tide: TideSolution
) -> verification.ConstantsComparison:
    """Compare with the shipped gauges."""
    observed = read_tide_table(EXAMPLE / "data" / "gauges.csv")
    found = verification.constants_at_gauges(mesh, tide, observed)
    return verification.compare_constants(
        found.table, observed, distance_m=found.distance_m
    )


def error_of(
    compared: verification.ConstantsComparison, gauge: str, constituent: str
) -> str:
    """Amplitude error (%) and phase error (degrees) as text."""
    for one in compared.rows:
        if (one.gauge, one.constituent) == (gauge, constituent):
            percent, lag = one.amplitude_error_percent, one.phase_error_deg
            return f"{percent:+.1f} % {lag:+.1f} deg"
    return "not in the mesh"


# ---- Charleston in detail --------------------------------------------------------


def constituents_and_levels(
    mesh: CoastalMesh, tide: TideSolution, folder: Path
) -> None:
    """Every constituent at Charleston, and the levels of Fig. 9."""
    compared = at_gauges(mesh, tide)
    print("\nCharleston, fine data, fitted boundary, quadratic 0.003:")
    for name in NAMES:
        print(f"  {name}: {error_of(compared, CHARLESTON, name)}")
    seconds = [np.datetime64(day).astype("datetime64[s]").astype(float) for day in DAYS]
    hours = np.arange(seconds[0], seconds[1] + 1.0, 3600.0)
    published = read_tide_table(EXAMPLE / "data" / "charleston_constants.csv")
    place = compared.observed.stations.index(CHARLESTON)
    observed = TideRecord(hours, predict(published, hours, place=0), CHARLESTON)
    five = replace(
        published,
        names=NAMES,
        frequency=[frequency(name) for name in NAMES],
        elevation=compared.modelled.elevation[
            [compared.modelled.names.index(name) for name in NAMES]
        ][:, [place]],
    )
    modelled = TideRecord(hours, predict(five, hours, place=0), CHARLESTON)
    levels = verification.compare_records(modelled, observed)
    print(levels.as_text())
    plots.save_figure(
        folder / "levels.png",
        partial(plots.plot_records, levels),
        size_inches=(10.0, 4.5),
    )
    plots.save_figure(folder / "constants.png", partial(plots.plot_constants, compared))
    plots.save_figure(
        folder / "gauges.png", partial(plots.plot_gauge_map, mesh, compared, "M2")
    )
    verification.write_verification(folder, constants=compared, records=[levels])


def overtides(mesh: CoastalMesh, forcing: TideForcing) -> None:
    """M4 and M6 that the nonlinear terms make inside."""
    settings = msgspec.structs.replace(
        BASE, overtides=("M4", "M6"), finite_amplitude=True
    )
    try:
        tide, _ = tides.solve_with_report(mesh, forcing, settings)
    except TidemeshError as error:
        print(f"M4, M6: {error}")
        return
    print("with finite amplitude, M4 and M6:")
    for one in at_gauges(mesh, tide).rows:
        if one.gauge == CHARLESTON and one.constituent in ("M2", "M4", "M6"):
            print(
                f"  {one.constituent}: {one.modelled_m:.3f} m "
                f"{one.modelled_phase_deg:.0f} deg, observed {one.observed_m:.3f} m "
                f"{one.observed_phase_deg:.0f} deg"
            )


if __name__ == "__main__":
    main(*sys.argv[1:])
