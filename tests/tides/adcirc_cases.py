"""The kept ADCIRC runs: mesh, forcing, settings and answers of a case."""

from __future__ import annotations

import gzip
import json
from pathlib import Path
from typing import NamedTuple

import netCDF4
import numpy as np

from tidemesh.datatypes import BoundaryString, CoastalMesh, TideForcing
from tidemesh.geometry.projection import Projection
from tidemesh.io.fort53 import read_fort53, read_fort54
from tidemesh.tides import Symbols

FOLDER = Path(__file__).parents[3] / "shared" / "reference" / "adcirc"


class Case(NamedTuple):
    mesh: CoastalMesh
    forcing: TideForcing
    settings: dict
    elevation: np.ndarray
    velocity: np.ndarray


def load(name: str) -> Case:
    folder = FOLDER / name
    settings = json.loads((FOLDER / "cases.json").read_text())[name]
    xy, depth, triangles, strings = _read_mesh(folder / "fort.14.gz")
    projection = Projection()
    if settings["ics"] != 1:
        lon0, lat0 = settings["slam0_sfea0"]
        if settings["ics"] == 2:
            projection = Projection.equirectangular(lon0, lat0)
        else:
            projection = Projection(
                f"+proj=merc +lat_ts={lat0} +lon_0={lon0} +R=6378206.4 +units=m"
            )
    mesh = CoastalMesh(
        projection.forward(*xy.T),
        triangles,
        np.maximum(depth, settings["h0"]),
        strings,
        projection,
    )
    if (folder / "fort.53.nc").exists():
        elevation, velocity = _read_netcdf(folder)
    else:
        elevation = read_fort53(folder / "fort.53.gz").values[0]
        velocity = read_fort54(folder / "fort.54.gz").values[0]
    ocean = mesh.open_nodes
    forcing = TideForcing(
        ("M2",),
        np.array([settings["omega"]]),
        ocean,
        _read_forcing(folder / "fort.15.gz", len(ocean))[None],
    )
    return Case(mesh, forcing, settings, elevation, velocity)


def discrete_symbols(settings: dict) -> Symbols:
    """ADCIRC's three-level wave equation and Crank-Nicolson momentum, tau0 = tau."""
    step, omega, tau = settings["dt"], settings["omega"], settings["friction"]
    a, b, c = settings["weights"]
    z = np.exp(1j * omega * step)
    second = (z - 2.0 + 1.0 / z) / step**2
    first = (z - 1.0 / z) / (2.0 * step)
    momentum = 2.0 / step * (z - 1.0) / (z + 1.0)
    continuity = (second + tau * first) / (a * z + b + c / z) / (momentum + tau)
    return Symbols(continuity, momentum)


def _read_mesh(path):
    lines = iter(gzip.decompress(path.read_bytes()).decode().splitlines()[1:])

    def integers(count):
        return [int(word) for word in next(lines).split()[:count]]

    n_triangles, n_points = integers(2)
    rows = np.array([next(lines).split()[:4] for _ in range(n_points)], dtype=float)
    triangles = np.array([integers(5)[2:] for _ in range(n_triangles)]) - 1
    strings = []
    (n_open,) = integers(1)
    integers(1)
    for _ in range(n_open):
        (count,) = integers(1)
        nodes = [integers(1)[0] - 1 for _ in range(count)]
        strings.append(BoundaryString("open", nodes))
    (n_land,) = integers(1)
    integers(1)
    for _ in range(n_land):
        count, ibtype = integers(2)
        nodes = [integers(1)[0] - 1 for _ in range(count)]
        kind = "island" if ibtype in (1, 11, 21) else "mainland"
        strings.append(
            BoundaryString(kind, nodes, closed=kind == "island", ibtype=ibtype)
        )
    return rows[:, 1:3], rows[:, 3], triangles, tuple(strings)


def _read_forcing(path, count):
    lines = gzip.decompress(path.read_bytes()).decode().splitlines()
    words = [line.split("!")[0].split() for line in lines]
    names = [k for k, row in enumerate(words) if row == ["M2"]]
    rows = np.array(words[names[1] + 1 : names[1] + 1 + count], dtype=float)
    return rows[:, 0] * np.exp(-1j * np.radians(rows[:, 1]))


def _read_netcdf(folder):
    with netCDF4.Dataset(folder / "fort.53.nc") as data:
        elevation = _complex(data, "amp", "phs")
    with netCDF4.Dataset(folder / "fort.54.nc") as data:
        velocity = np.stack(
            [_complex(data, "u_amp", "u_phs"), _complex(data, "v_amp", "v_phs")], axis=1
        )
    return elevation, velocity


def _complex(data, amplitude, phase):
    size, lag = (np.asarray(data[name][:])[:, 0] for name in (amplitude, phase))
    return size * np.exp(-1j * np.radians(lag))
