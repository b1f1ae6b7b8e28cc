"""Open the depth sources that the settings name."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np

from tidemesh.basegrid.settings import DepthSettings, DepthSource
from tidemesh.datatypes import Domain, Raster, Soundings
from tidemesh.io.dem import read_raster, read_soundings

_TEXT = (".csv", ".csv.gz", ".txt", ".txt.gz", ".tsv", ".tsv.gz")


def read_sources(
    domain: Domain, settings: DepthSettings, *, folder: str | os.PathLike = "."
) -> tuple[Raster | Soundings, ...]:
    """Read the part of every source that a domain needs.

    Parameters
    ----------
    domain : Domain
    settings : DepthSettings
    folder : path
        Where relative paths start.

    Returns
    -------
    sources : tuple of Raster and Soundings
        In order of priority, as in the settings.

    Raises
    ------
    InputError
        If a file cannot be used, or does not overlap the domain.
    """
    box = bounding_box_deg(domain)
    return tuple(_read(Path(folder), source, box) for source in settings.sources)


def bounding_box_deg(domain: Domain) -> tuple[float, float, float, float]:
    """West, south, east, north of a domain in degrees (metres on the bare plane)."""
    place = domain.projection.inverse(domain.rings[0].points)
    return (*place.min(axis=0).tolist(), *place.max(axis=0).tolist())


def _read(folder: Path, source: DepthSource, box) -> Raster | Soundings:
    path = folder / source.path
    is_text = path.name.lower().endswith(_TEXT)
    soundings = source.kind == "soundings" or (source.kind == "auto" and is_text)
    read = read_soundings if soundings else read_raster
    if soundings:
        # Soundings outside still shape the bed near the edge, sparse ones from afar.
        margin = 0.25 * np.array([box[2] - box[0], box[3] - box[1]])
        box = (*(np.array(box[:2]) - margin), *(np.array(box[2:]) + margin))
    return read(
        path,
        variable=source.variable,
        positive=source.positive,
        crs=source.crs,
        fill_value=source.fill_value,
        box_deg=box,
    )
