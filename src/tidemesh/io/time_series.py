"""Levels at stations and fields of a mesh in time, as NetCDF after CF and UGRID."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from datetime import UTC, datetime
from pathlib import Path

import netCDF4
import numpy as np

from tidemesh import __version__
from tidemesh.datatypes import CoastalMesh, TideRecord
from tidemesh.errors import FormatError, InputError
from tidemesh.io.files import atomic
from tidemesh.io.ugrid import MESH, write_ugrid

EPOCH = "1970-01-01T00:00:00Z"
_UNITS = "seconds since 1970-01-01 00:00:00"


def utc(seconds: float) -> str:
    """ISO 8601 of a time since 1970-01-01 UTC.

    Examples
    --------
    >>> utc(883612800.0)
    '1998-01-01T00:00:00Z'
    """
    moment = datetime.fromtimestamp(round(float(seconds)), UTC)
    return moment.strftime("%Y-%m-%dT%H:%M:%SZ")


def write_stations(
    path: str | Path, records: Sequence[TideRecord], *, title: str = ""
) -> None:
    """Write water levels at stations (CF discrete sampling geometry timeSeries).

    Parameters
    ----------
    path : path
    records : sequence of TideRecord
        With the same times.
    title : str

    Raises
    ------
    ValueError
        If there is no record, or the times differ.
    InputError
        If the file cannot be written.
    """
    if not records:
        raise ValueError("there are no records to write")
    time = records[0].time
    for record in records:
        if not np.array_equal(record.time, time):
            raise ValueError(f"the times of {record.station} differ from the first")
    with (
        atomic(path) as temporary,
        _told(path),
        netCDF4.Dataset(temporary, "w", format="NETCDF4") as file,
    ):
        file.setncatts(
            {
                "Conventions": "CF-1.11",
                "featureType": "timeSeries",
                "title": title or "Water levels at stations",
                "source": f"tidemesh {__version__}",
            }
        )
        names = np.array([record.station.encode() for record in records])
        width = max(names.dtype.itemsize, 1)
        file.createDimension("station", len(records))
        file.createDimension("time", len(time))
        file.createDimension("name_length", width)
        name = file.createVariable("station_name", "S1", ("station", "name_length"))
        name.setncatts({"long_name": "station name", "cf_role": "timeseries_id"})
        name._Encoding = "utf-8"
        name.set_auto_chartostring(False)
        name[...] = names.astype(f"S{width}").view("S1").reshape(-1, width)
        for word, direction in (("longitude", "east"), ("latitude", "north")):
            place = file.createVariable(word, "f8", ("station",))
            place.setncatts(
                {
                    "standard_name": word,
                    "long_name": f"{word} of the station",
                    "units": f"degrees_{direction}",
                }
            )
            place[...] = [getattr(record, f"{word}_deg") for record in records]
        _time_variable(file)[...] = time
        level = file.createVariable(
            "water_level",
            "f8",
            ("station", "time"),
            fill_value=np.nan,
            compression="zlib",
        )
        level.setncatts(
            {
                "standard_name": "sea_surface_height_above_mean_sea_level",
                "long_name": f"water level above {records[0].datum}",
                "units": "m",
                "coordinates": "station_name longitude latitude",
            }
        )
        level[...] = np.stack([record.elevation for record in records])


def read_stations(path: str | Path) -> tuple[TideRecord, ...]:
    """Read what `write_stations` writes.

    Raises
    ------
    InputError
        If the file cannot be read.
    FormatError
        If it is not such a file.
    """
    path = Path(path)
    if not path.is_file():
        raise InputError(f"{path}: there is no such file; check the name")
    try:
        with netCDF4.Dataset(path) as file:
            file.set_auto_mask(False)
            file.set_auto_chartostring(False)
            names = [row.tobytes() for row in file["station_name"][:]]
            return tuple(
                TideRecord(
                    time=file["time"][:],
                    elevation=level,
                    station=name.rstrip(b"\x00").decode(),
                    longitude_deg=float(longitude),
                    latitude_deg=float(latitude),
                )
                for name, longitude, latitude, level in zip(
                    names,
                    file["longitude"][:],
                    file["latitude"][:],
                    file["water_level"][:],
                )
            )
    except (OSError, IndexError, KeyError, ValueError) as error:
        raise FormatError(
            f"not a file of water levels at stations ({error})", path
        ) from error


class FieldWriter:
    """Levels and currents on all nodes of a mesh, one time after another.

    The file is complete after every `write`; a run that is taken up again goes on
    where its restart file stands, over what was written after it.

    Parameters
    ----------
    path : path
    mesh : CoastalMesh
    resume : bool
        Go on with an existing file.

    Raises
    ------
    InputError
        If the file cannot be written, or does not belong to the mesh.
    """

    def __init__(self, path: str | Path, mesh: CoastalMesh, *, resume: bool = False):
        self.path, self._mesh = Path(path), mesh
        if resume and self.path.is_file():
            with _told(self.path):
                self._file = netCDF4.Dataset(self.path, "r+")
            if self._file.dimensions["node"].size != len(mesh.points):
                self._file.close()
                raise InputError(
                    f"{path}: holds fields of another mesh; remove it or start anew"
                )
            return
        write_ugrid(self.path, mesh, title="Water levels and currents")
        with _told(self.path):
            self._file = netCDF4.Dataset(self.path, "r+")
            self._file.createDimension("time", None)
            _time_variable(self._file)
            for name, units, standard in (
                ("water_level", "m", "sea_surface_height_above_mean_sea_level"),
                ("eastward_velocity", "m s-1", "eastward_sea_water_velocity"),
                ("northward_velocity", "m s-1", "northward_sea_water_velocity"),
            ):
                variable = self._file.createVariable(
                    name,
                    "f4",
                    ("time", "node"),
                    fill_value=np.float32(np.nan),
                    compression="zlib",
                    complevel=2,
                    chunksizes=(1, len(mesh.points)),
                )
                like = self._file["depth"]
                variable.setncatts(
                    {
                        "standard_name": standard,
                        "long_name": name.replace("_", " "),
                        "units": units,
                        "mesh": MESH,
                        "location": "node",
                        "coordinates": like.coordinates,
                    }
                )
                if "grid_mapping" in like.ncattrs():
                    variable.grid_mapping = like.grid_mapping

    def write(
        self, index: int, time: float, elevation: np.ndarray, velocity: np.ndarray
    ) -> None:
        """Write the fields (n_points,) m and (n_points, 2) m/s of one time.

        Parameters
        ----------
        index : int
            Place in the file, from 0.
        time : float
            s since 1970-01-01 UTC.
        elevation, velocity : arrays
            The velocity along x and y of the mesh.
        """
        east_north = self._mesh.projection.east_north(self._mesh.points, velocity)
        with _told(self.path):
            self._file["time"][index] = time
            self._file["water_level"][index] = elevation
            self._file["eastward_velocity"][index] = east_north[:, 0]
            self._file["northward_velocity"][index] = east_north[:, 1]
            self._file.sync()

    def close(self) -> None:
        """Close the file."""
        self._file.close()


@contextmanager
def _told(path: str | Path) -> Iterator[None]:
    """The NetCDF library's complaints as `InputError`."""
    try:
        yield
    except RuntimeError as error:
        raise InputError(
            f"{path}: cannot be written ({error}); check the space left"
        ) from error


def _time_variable(file: netCDF4.Dataset) -> netCDF4.Variable:
    time = file.createVariable("time", "f8", ("time",))
    time.setncatts(
        {
            "standard_name": "time",
            "long_name": "time",
            "units": _UNITS,
            "calendar": "standard",
            "axis": "T",
        }
    )
    return time
