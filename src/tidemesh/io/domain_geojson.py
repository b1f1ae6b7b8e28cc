"""A domain for a look in a GIS: boundary lines and ledger as GeoJSON."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np

from tidemesh.datatypes import LAND, OCEAN, Domain
from tidemesh.io.files import atomic


def write_domain(path: str | Path, domain: Domain) -> None:
    """Write the boundary lines by kind, and one point for each entry of the ledger.

    Parameters
    ----------
    path : path
    domain : Domain
        Places are written in degrees, to 7 decimals (about 1 cm).
    """
    features: list[dict[str, Any]] = []
    for number, ring in enumerate(domain.rings):
        places = domain.projection.inverse(ring.points).round(7)
        for kind, name in ((LAND, "land"), (OCEAN, "ocean")):
            for run in _runs(ring.segment_kind == kind):
                nodes = [*run, (run[-1] + 1) % len(places)]
                features.append(
                    {
                        "type": "Feature",
                        "properties": {"ring": number, "kind": name},
                        "geometry": {
                            "type": "LineString",
                            "coordinates": places[nodes].tolist(),
                        },
                    }
                )
    for entry in domain.ledger:
        properties = {
            "kind": "ledger",
            "action": entry.action,
            "area_km2": round(entry.area_m2 / 1e6, 4),
            "reason": entry.reason,
        }
        point = [round(entry.longitude_deg, 6), round(entry.latitude_deg, 6)]
        features.append(
            {
                "type": "Feature",
                "properties": properties,
                "geometry": {"type": "Point", "coordinates": point},
            }
        )
    text = json.dumps({"type": "FeatureCollection", "features": features})
    with atomic(path) as temporary:
        Path(temporary).write_text(text + "\n", encoding="utf-8")


def _runs(selected: np.ndarray) -> list[list[int]]:
    """Cyclic runs of selected segments, each as consecutive indices."""
    n = len(selected)
    if selected.all():
        return [list(range(n))]
    starts = np.flatnonzero(selected & ~np.roll(selected, 1))
    runs = []
    for start in starts:
        run = [int(start)]
        while selected[(run[-1] + 1) % n]:
            run.append((run[-1] + 1) % n)
        runs.append(run)
    return runs
