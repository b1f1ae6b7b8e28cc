"""Write the data of the island case: a bay open to the south, an island in it.

All of it is made up, from the formulas below.
"""

from __future__ import annotations

import csv
import json
from pathlib import Path

import netCDF4
import numpy as np

DATA = Path(__file__).parent / "data"
WEST, EAST, SOUTH, NORTH = -40.5, -39.5, 29.6, 30.4
ISLAND = (-40.0, 30.05)
ISLAND_RADIUS_KM = 8.0
KM_PER_DEGREE = 111.2


def shoreline() -> dict:
    """Land: a frame on three sides with rounded inner corners, and the island."""
    turn = np.linspace(0.0, 2.0 * np.pi, 73)[:-1]
    shrink = np.cos(np.radians(ISLAND[1]))
    island = np.stack(
        [
            ISLAND[0] + ISLAND_RADIUS_KM / KM_PER_DEGREE / shrink * np.cos(turn),
            ISLAND[1] + ISLAND_RADIUS_KM / KM_PER_DEGREE * np.sin(turn),
        ],
        axis=1,
    )
    rounding = 0.15
    quarter = np.linspace(0.0, np.pi / 2.0, 13)
    north_east = np.stack(
        [
            EAST - rounding + rounding * np.cos(quarter),
            NORTH - rounding + rounding * np.sin(quarter),
        ],
        axis=1,
    )
    north_west = np.stack(
        [
            WEST + rounding - rounding * np.sin(quarter),
            NORTH - rounding + rounding * np.cos(quarter),
        ],
        axis=1,
    )
    low = SOUTH - 0.2
    frame = [
        (WEST - 0.2, low),
        (WEST, low),
        *north_west[::-1],
        *north_east[::-1],
        (EAST, low),
        (EAST + 0.2, low),
        (EAST + 0.2, NORTH + 0.2),
        (WEST - 0.2, NORTH + 0.2),
    ]
    features = [
        {
            "type": "Feature",
            "properties": {"name": name},
            "geometry": {
                "type": "Polygon",
                "coordinates": [
                    [[round(float(x), 6), round(float(y), 6)] for x, y in closed(ring)]
                ],
            },
        }
        for name, ring in (("mainland", frame), ("island", island))
    ]
    return {"type": "FeatureCollection", "features": features}


def closed(ring) -> list:
    """Repeat the first point at the end."""
    ring = list(map(tuple, ring))
    return [*ring, ring[0]]


def elevation(longitude: np.ndarray, latitude: np.ndarray) -> np.ndarray:
    """Bed elevation (m): a slope to the south, a shoal around the island."""
    fraction = np.clip((NORTH - latitude) / (NORTH - SOUTH), 0.0, 1.2)
    shrink = np.cos(np.radians(ISLAND[1]))
    distance = KM_PER_DEGREE * np.hypot(
        (longitude - ISLAND[0]) * shrink, latitude - ISLAND[1]
    )
    shelf = 8.0 + 50.0 * fraction**1.5
    shoal = 0.8 * np.exp(-(((distance - ISLAND_RADIUS_KM) / 6.0) ** 2))
    return -shelf * (1.0 - shoal)


def main() -> None:
    """Write shoreline, bathymetry and tide constants."""
    DATA.mkdir(exist_ok=True)
    (DATA / "shoreline.geojson").write_text(json.dumps(shoreline()) + "\n")

    lon = np.round(np.arange(-40.75, -39.249, 0.025), 6)
    lat = np.round(np.arange(29.3, 30.651, 0.025), 6)
    with netCDF4.Dataset(DATA / "bathymetry.nc", "w", format="NETCDF4") as file:
        file.Conventions = "CF-1.11"
        file.title = "Made-up bay with an island"
        for name, values, unit in (
            ("lat", lat, "degrees_north"),
            ("lon", lon, "degrees_east"),
        ):
            file.createDimension(name, len(values))
            axis = file.createVariable(name, "f8", (name,))
            axis.units = unit
            axis[:] = values
        bed = file.createVariable("elevation", "f4", ("lat", "lon"), zlib=True)
        bed.units = "m"
        bed.positive = "up"
        bed.standard_name = "height_above_mean_sea_level"
        bed[:] = elevation(*np.meshgrid(lon, lat))

    with open(DATA / "open_boundary.csv", "w", newline="") as file:
        rows = csv.writer(file, lineterminator="\n")
        rows.writerow(
            ["lon", "lat", "constituent", "amplitude_m", "phase_deg_greenwich"]
        )
        for x in np.linspace(WEST, EAST, 11):
            share = (x - WEST) / (EAST - WEST)
            for name, size, phase in (("M2", 0.5, 100.0), ("K1", 0.1, 200.0)):
                rows.writerow(
                    [
                        f"{x:.2f}",
                        f"{SOUTH:.2f}",
                        name,
                        f"{size * (1 + 0.2 * share):.4f}",
                        f"{phase + 10.0 * share:.2f}",
                    ]
                )


if __name__ == "__main__":
    main()
