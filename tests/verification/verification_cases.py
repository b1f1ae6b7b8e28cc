"""Tables and records whose differences are known."""

from __future__ import annotations

import numpy as np

from tidemesh import constants
from tidemesh.datatypes import TideRecord, TideTable

HOUR = 3600.0
DAY = 86400.0


def table(values, *, stations=("Charleston", "Springmaid"), longitude=(-80.0, -79.0)):
    """Table of {constituent: [(amplitude, phase in degrees) of each gauge]}."""
    elevation = [
        [a * np.exp(-1j * np.radians(g)) for a, g in gauges]
        for gauges in values.values()
    ]
    n = len(elevation[0])
    return TideTable(
        longitude_deg=longitude[:n],
        latitude_deg=np.linspace(32.5, 33.5, n),
        names=tuple(values),
        frequency=[constants.frequency(name) for name in values],
        elevation=elevation,
        stations=stations[:n],
    )


def cosine(amplitude, lag_s, *, days=30, step_s=600.0, period_s=12.42 * HOUR, mean=0.0):
    """Cosine that is late by a lag."""
    time = np.arange(0.0, days * DAY + 1.0, step_s)
    level = mean + amplitude * np.cos(2 * np.pi * (time - lag_s) / period_s)
    return TideRecord(time, level, station="Charleston")
