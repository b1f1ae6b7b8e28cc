"""Elevation at the ocean nodes from a global tide atlas that the user owns.

TPXO, FES, GOT and their kin come in many formats; pyTMD, an optional dependency, reads
them all. Its amplitudes are A exp(-i G) like ours.
"""

from __future__ import annotations

import difflib
import math
import warnings
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from types import ModuleType

import numpy as np
import pyproj
from scipy.spatial import cKDTree

from tidemesh.constants import EARTH_RADIUS
from tidemesh.datatypes import CoastalMesh, TideForcing, TideTable
from tidemesh.errors import EngineError, FormatError, InputError
from tidemesh.tides.astronomy import constituent_frequency, prediction_basis
from tidemesh.tides.forcing import boundary_forcing

_LIBRARY_NAMES = {
    "LAM2": "lambda2",
    "LDA2": "lambda2",
    "RHO": "rho1",
    "NO1": "m1",
    "SIG1": "sigma1",
    "THE1": "theta1",
    "ALP1": "alpha1",
    "BET1": "beta1",
    "GAM2": "gamma2",
    "STEADY": "z0",
}
"""Constituents that pyTMD spells otherwise than in lower case."""

_UNREADABLE = (
    OSError,
    ValueError,
    KeyError,
    IndexError,
    AttributeError,
    TypeError,
    NameError,
)
"""What pyTMD and xarray raise on a file that is not what its name says."""

_EPOCHS = (946684800.0, 1577836800.0)
"""2000-01-01 and 2020-01-01, s since 1970: where arguments are compared."""


def atlas_forcing(
    mesh: CoastalMesh,
    names: Sequence[str],
    directory: str | Path,
    model: str,
    *,
    max_distance_m: float = 50_000.0,
) -> TideForcing:
    """Interpolate the harmonic constants of a tide atlas to the open boundary nodes.

    Complex amplitudes are interpolated linearly between the atlas's sea points; an
    ocean node on the atlas's land takes its value from the sea points around it.

    Parameters
    ----------
    mesh : CoastalMesh
    names : sequence of str
        Constituents wanted, in the order of the result.
    directory : path
        Folder of the atlas's files, or the folder above it as the atlas is unpacked.
    model : str
        Name in pyTMD's list, for instance "TPXO9-atlas-v5-nc", "FES2014", "GOT5.5".
    max_distance_m : float
        Farthest that the atlas's nearest sea point may be from an ocean node.

    Returns
    -------
    forcing : TideForcing
        Amplitudes (m) with Greenwich phases of NOAA's arguments, as
        `tidemesh.tides.astronomy`; no nodal corrections.

    Raises
    ------
    EngineError
        If the mesh has no open boundary.
    InputError
        If pyTMD is not installed, the mesh has no projection, the atlas or one of its
        files or constituents is missing, or its sea is too far from the boundary.
    FormatError
        If a file cannot be read.

    Notes
    -----
    One constituent is read at a time, but over the whole globe: a grid of 1/16 degree
    needs 1.1 GB of memory, one of 1/30 degree about 4.
    """
    if len(mesh.open_nodes) == 0:
        raise EngineError(
            "the mesh has no open (ocean) boundary, so nothing drives the tide"
        )
    if not mesh.projection.crs:
        raise InputError(
            "a tide atlas has longitudes and latitudes, and this mesh lies on a bare "
            "plane: name the projection of its coordinates"
        )
    atlas = _open_atlas(Path(directory).expanduser(), model)
    wanted = [_LIBRARY_NAMES.get(name.upper(), name.lower()) for name in names]
    frequency = [constituent_frequency(name) for name in names]
    files = [atlas.file_of(name, c) for name, c in zip(names, wanted)]
    offsets = [atlas.phase_offset(name, c) for name, c in zip(names, wanted)]
    longitude, latitude = mesh.projection.inverse(mesh.points[mesh.open_nodes]).T

    elevation = np.empty((len(names), len(longitude)), dtype=np.complex128)
    for file in dict.fromkeys(files):
        rows = [k for k, other in enumerate(files) if other == file]
        found = atlas.sea_near(
            file, [wanted[k] for k in rows], longitude, latitude, max_distance_m
        )
        for k, (place_lon, place_lat, values) in zip(rows, found):
            table = TideTable(
                place_lon,
                place_lat,
                (names[k],),
                frequency[k : k + 1],
                values[None, :] * np.exp(1j * offsets[k]),
            )
            at_nodes = boundary_forcing(
                mesh, table, names[k : k + 1], max_distance_m=max_distance_m
            )
            elevation[k] = at_nodes.elevation[0]
    return TideForcing(
        names=tuple(names),
        frequency=frequency,
        nodes=mesh.open_nodes,
        elevation=elevation,
    )


def atlas_names() -> tuple[str, ...]:
    """Names of the atlases of ocean tides that can be read.

    Raises
    ------
    InputError
        If pyTMD is not installed.
    """
    return tuple(sorted(_known_atlases(_library())))


@dataclass(frozen=True)
class _Atlas:
    """An atlas's description in pyTMD and its files on this machine."""

    library: ModuleType
    name: str
    directory: Path
    files: dict[str, str]
    """Constituent -> file as pyTMD's list has it; "" -> the one file of all."""
    grid_file: str | None

    def file_of(self, name: str, constituent: str) -> Path:
        """The file of a constituent."""
        relative = self.files.get("", self.files.get(constituent))
        if relative is None:
            raise InputError(_missing(name, self.name, self.files))
        return self._found(relative)

    def phase_offset(self, name: str, constituent: str) -> float:
        """Argument of the atlas less NOAA's argument V (rad), zero for nearly all.

        Atlases count the phase of SA from perihelion, that of M3 from the other passage
        of the meridian.
        """
        corrections = self._description().corrections
        if constituent == "s1" and corrections in ("OTIS", "ATLAS", "TMD3"):
            raise InputError(
                f"the programs that read {self.name} disagree on where the phase of S1 "
                "counts from: leave S1 out (the weather makes it, not the moon)"
            )
        ours = np.angle(prediction_basis([name], _EPOCHS, 45.0, nodal="none")[0])
        try:
            theirs = np.radians(
                self.library.constituents.arguments(
                    np.array(_EPOCHS) / 86400.0 + 40587.0,
                    [constituent],
                    corrections=corrections,
                )[2][:, 0]
            )
        except ValueError:
            raise InputError(_missing(name, self.name, self.files)) from None
        first, last = np.angle(np.exp(1j * (theirs - ours)))
        if abs(math.remainder(last - first, math.tau)) > math.radians(5.0):
            raise InputError(
                f"{name} of the atlas {self.name} is another tidal line than NOAA's "
                f"{name}, of a slightly different speed: leave it out"
            )
        # Half a degree is what two programs' longitudes of the sun may differ by.
        return float(first) if abs(first) > math.radians(1.0) else 0.0

    def sea_near(
        self,
        file: Path,
        constituents: Sequence[str],
        longitude: np.ndarray,
        latitude: np.ndarray,
        distance_m: float,
    ) -> list[tuple[np.ndarray, np.ndarray, np.ndarray]]:
        """Longitudes, latitudes, amplitudes (m) of the sea points near the nodes.

        One triple for each constituent of the file that is asked for.
        """
        description = self._description()
        description.z.model_file = file if "" in self.files else [file]
        if self.grid_file is not None:
            description.z.grid_file = self._found(self.grid_file)
        packed = file.suffix == ".gz"
        try:
            # Warnings of pyTMD's and xarray's own doings.
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", UserWarning)
                data = description.open_dataset(group="z", compressed=packed)
            crs = data.tmd.crs
            x, y = (np.asarray(data[axis], dtype=np.float64) for axis in ("x", "y"))
            columns, rows, reach = _window(x, y, crs, longitude, latitude, distance_m)
            near = data.isel(x=columns, y=rows).transpose("y", "x", ...)
            layers = {
                name: near[name].to_numpy()
                for name in (*data.tmd.constituents, "bathymetry")
                if name in near
            }
        except ImportError as error:
            raise InputError(
                f"{file} cannot be read"
                + (" as it is packed: unpack it" if packed else "")
                + f" ({error})"
            ) from error
        except _UNREADABLE as error:
            raise FormatError(
                f"is not a file of the atlas {self.name} as pyTMD knows it "
                f"({type(error).__name__}: {error})",
                file,
            ) from error
        places = np.stack(np.meshgrid(x[columns], y[rows]), axis=-1)
        if not crs.is_geographic:
            places = np.stack(
                _transformer(crs).transform(
                    places[..., 0], places[..., 1], direction="INVERSE"
                ),
                axis=-1,
            )
        gap, _ = cKDTree(_on_sphere(longitude, latitude)).query(
            _on_sphere(places[..., 0], places[..., 1])
        )
        close = gap * EARTH_RADIUS <= reach
        if "bathymetry" in layers:
            close &= np.nan_to_num(layers["bathymetry"]) > 0.0
        found = []
        for constituent in constituents:
            if constituent not in layers:
                raise InputError(_missing(constituent.upper(), self.name, layers))
            values = layers[constituent]
            # Land is absent in some formats and zero in others.
            sea = close & np.isfinite(values) & (values != 0.0)
            if not sea.any():
                raise InputError(
                    f"the atlas {self.name} has no sea within {distance_m / 1e3:g} km "
                    "of the ocean boundary of the mesh"
                )
            found.append((places[sea, 0], places[sea, 1], values[sea]))
        return found

    def _description(self):
        blank = self.library.io.model(directory=self.directory, verify=False)
        return blank.from_database(self.name, group="z")

    def _found(self, relative: str) -> Path:
        """The file under the directory, whichever of the parents it was given as."""
        parts = PurePosixPath(relative).parts
        for first in range(len(parts)):
            path = self.directory.joinpath(*parts[first:])
            for candidate in (path, path.with_name(path.name + ".gz")):
                if candidate.is_file():
                    return candidate
        raise InputError(
            f"the atlas {self.name} has no file {relative} in {self.directory}: "
            "name the folder into which it was unpacked, or another version of the "
            "atlas"
        )


def _open_atlas(directory: Path, name: str) -> _Atlas:
    library = _library()
    known = _known_atlases(library)
    if name not in known:
        # Versions differ by a digit: with the case apart, the nearest come first.
        lower = {k.lower(): k for k in sorted(known)}
        near = difflib.get_close_matches(name.lower(), lower, n=3, cutoff=0.4)
        raise InputError(
            f'tide atlas "{name}" is not known; '
            + (f"nearest: {', '.join(lower[n] for n in near)}; " if near else "")
            + f"all: {', '.join(sorted(known))}"
        )
    if not directory.is_dir():
        raise InputError(f"the folder of the tide atlas, {directory}, does not exist")
    elevation = known[name]["z"]
    model_file = elevation["model_file"]
    if isinstance(model_file, str):
        files = {"": model_file}
    else:
        files = {library.io.model.parse_file(f): f for f in model_file}
        files.pop(None, None)
    return _Atlas(library, name, directory, files, elevation.get("grid_file"))


def _library() -> ModuleType:
    try:
        # It silences the warnings of everybody else.
        with warnings.catch_warnings():
            import pyTMD
            import pyTMD.constituents
            import pyTMD.io
    except ImportError as error:
        raise InputError(
            'tide atlases need the library pyTMD: pip install "tidemesh[atlas]" '
            f"({error})"
        ) from error
    return pyTMD


def _known_atlases(library: ModuleType) -> dict[str, dict]:
    """Descriptions of the ocean tides on grids (loading tides and meshes left out)."""
    return {
        name: entry
        for name, entry in library.io.load_database().items()
        if entry.get("z", {}).get("variable") in ("tide_ocean", "tide_lpe")
        and entry["format"] != "FES-native"
        and not name.endswith("_SAL")
    }


def _missing(name: str, atlas: str, known: Iterable[str]) -> str:
    has = sorted(k.upper() for k in known if k and k != "bathymetry")
    return f"the atlas {atlas} has no {name}; it has {', '.join(has)}"


def _window(
    x: np.ndarray,
    y: np.ndarray,
    crs: pyproj.CRS,
    longitude: np.ndarray,
    latitude: np.ndarray,
    distance_m: float,
) -> tuple[np.ndarray, np.ndarray, float]:
    """Columns and rows of the grid around the nodes, and how far they reach (m).

    Twice the distance, and never less than three cells, so that there are points on all
    sides to interpolate between.
    """
    step_x, step_y = (float(np.median(np.abs(np.diff(v)))) for v in (x, y))
    if not crs.is_geographic:
        unit = crs.axis_info[0].unit_conversion_factor
        reach = max(2.0 * distance_m, 3.0 * unit * math.hypot(step_x, step_y))
        node_x, node_y = _transformer(crs).transform(longitude, latitude)
        pad = reach / unit
        columns = (x >= node_x.min() - pad) & (x <= node_x.max() + pad)
        rows = (y >= node_y.min() - pad) & (y <= node_y.max() + pad)
        return np.flatnonzero(columns), np.flatnonzero(rows), reach
    metres = math.radians(1.0) * EARTH_RADIUS
    reach = max(2.0 * distance_m, 3.0 * metres * math.hypot(step_x, step_y))
    pad_y = reach / metres
    rows = (y >= latitude.min() - pad_y) & (y <= latitude.max() + pad_y)
    # Longitudes of atlas and mesh may count from different meridians.
    narrowest = math.cos(math.radians(min(89.0, np.abs(latitude).max() + pad_y)))
    pad_x = pad_y / narrowest
    west, width = longitude.min() - pad_x, np.ptp(longitude) + 2.0 * pad_x
    columns = np.mod(x - west, 360.0) <= width
    return np.flatnonzero(columns), np.flatnonzero(rows), reach


def _transformer(crs: pyproj.CRS) -> pyproj.Transformer:
    return pyproj.Transformer.from_crs(4326, crs, always_xy=True)


def _on_sphere(longitude_deg: np.ndarray, latitude_deg: np.ndarray) -> np.ndarray:
    """(..., 3) points of the unit sphere."""
    lon, lat = np.radians(longitude_deg), np.radians(latitude_deg)
    return np.stack(
        [np.cos(lat) * np.cos(lon), np.cos(lat) * np.sin(lon), np.sin(lat)], axis=-1
    )
