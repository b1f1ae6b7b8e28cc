"""The longest stable time step, before anything is run.

With lumped mass and the elevation gradient of the present level the wave equation is an
explicit three-level scheme: stable while step^2 times the largest eigenvalue of
M^-1 K is at most 4, whatever tau0, the rotation, and a friction of at most 2/step
(which is where it is capped).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sparse
from scipy.sparse.linalg import ArpackNoConvergence, eigsh

from tidemesh.datatypes import CoastalMesh
from tidemesh.errors import InputError
from tidemesh.tides.frequency_domain.elements import Elements
from tidemesh.tides.frequency_domain.metric import elements_for
from tidemesh.tides.settings import TideSettings
from tidemesh.tides.time_domain.discretisation import at
from tidemesh.tides.time_domain.settings import SimulationSettings


@dataclass(frozen=True)
class StepAdvice:
    """The longest stable step and what limits it."""

    step_s: float
    """s."""
    node: int
    """Where the fastest oscillation of the mesh is strongest."""
    longitude_deg: float
    latitude_deg: float
    reason: str
    """What limits the step, in words."""
    bound_s: float
    """s, the step of the most limiting triangle alone: never longer than `step_s`."""


def stable_step(
    mesh: CoastalMesh,
    settings: SimulationSettings | None = None,
    tide_settings: TideSettings | None = None,
) -> StepAdvice:
    """Longest stable time step of a mesh.

    The step of a linear run is sharp. With finite amplitude the water column counts up
    to the expected high water, with advection the waves run on the expected current.

    Raises
    ------
    MeshError
        If a triangle is not counter-clockwise.
    """
    settings = SimulationSettings() if settings is None else settings
    tide = TideSettings() if tide_settings is None else tide_settings
    elements = elements_for(mesh, tide.metric)
    level = settings.expected_level_m if tide.finite_amplitude else 0.0
    current = settings.expected_speed_m_s if tide.advection else 0.0
    still = np.sqrt(tide.gravity * (elements.mean(mesh.depth) + level))
    speed = still + current

    bound = 2.0 / np.sqrt(_element_rates(elements, speed).max())
    rate, vector = _largest_rate(elements, speed, mesh.open_nodes)
    node = int(np.argmax(np.abs(vector)))
    holders = np.flatnonzero((elements.corners == node).any(axis=0))
    fastest = holders[np.argmax(speed[holders])]
    shortest = np.sqrt(elements.area[holders].min() * 4.0 / np.sqrt(3.0))
    reason = (
        f"gravity waves of {still[fastest]:.1f} m/s "
        + (f"on a current of {current:g} m/s " if current else "")
        + f"in triangles of about {shortest:.0f} m"
    )
    longitude, latitude = mesh.projection.inverse(mesh.points[node])
    return StepAdvice(
        step_s=float(2.0 / np.sqrt(rate)),
        node=node,
        longitude_deg=float(longitude),
        latitude_deg=float(latitude),
        reason=reason,
        bound_s=float(bound),
    )


def chosen_step(
    mesh: CoastalMesh, settings: SimulationSettings, tide_settings: TideSettings
) -> tuple[float, StepAdvice]:
    """The step of a run: as asked, or the longest that divides the station interval.

    Raises
    ------
    InputError
        If the step asked for is longer than the longest stable one.
    """
    advice = stable_step(mesh, settings, tide_settings)
    asked = settings.time_step_s
    if asked == 0.0:
        # A little short of the limit, where nothing damps the fastest oscillation.
        longest = 0.95 * advice.step_s
        return settings.station_every_s / np.ceil(
            settings.station_every_s / longest
        ), advice
    if asked > advice.step_s:
        raise InputError(
            f"a time step of {asked:g} s is unstable on this mesh: at most "
            f"{advice.step_s:.3g} s, for {advice.reason} at node {advice.node}, "
            f"{at(mesh, advice.node)}; take a shorter step (time_step_s = 0 for the "
            "advised one) or a coarser mesh there"
        )
    return asked, advice


def _element_rates(elements: Elements, speed: np.ndarray) -> np.ndarray:
    """(n_triangles,) largest eigenvalue of the triangle's own M^-1 K (1/s2).

    The largest of them bounds that of the mesh (element eigenvalue theorem).
    """
    gx, gy = elements.gradient
    xx, yy, xy = (gx * gx).sum(0), (gy * gy).sum(0), (gx * gy).sum(0)
    largest = 0.5 * (xx + yy) + np.sqrt(0.25 * (xx - yy) ** 2 + xy * xy)
    return 3.0 * speed**2 * largest


def _largest_rate(
    elements: Elements, speed: np.ndarray, ocean: np.ndarray
) -> tuple[float, np.ndarray]:
    """Largest eigenvalue of M^-1 K off the ocean boundary, and its eigenvector."""
    n = elements.n_points
    gx, gy = elements.gradient
    conductivity = speed**2 * elements.area
    mass = elements.scatter(np.broadcast_to(elements.area / 3.0, gx.shape))
    inside = np.ones(n)
    inside[ocean] = 0.0
    scale = inside / np.sqrt(mass)
    rows, columns, values = [], [], []
    for i in range(3):
        for j in range(3):
            rows.append(elements.corners[i])
            columns.append(elements.corners[j])
            values.append(conductivity * (gx[i] * gx[j] + gy[i] * gy[j]))
    rows, columns = np.concatenate(rows), np.concatenate(columns)
    values = np.concatenate(values) * scale[rows] * scale[columns]
    matrix = sparse.csr_array((values, (rows, columns)), shape=(n, n))
    if n < 20:
        rates, vectors = np.linalg.eigh(matrix.toarray())
        return float(rates[-1]), vectors[:, -1]
    start = np.cos(np.arange(n))  # any fixed vector: the same answer every time
    try:
        rates, vectors = eigsh(matrix, k=1, which="LA", v0=start, tol=1.0e-4)
    except ArpackNoConvergence:
        rates_of_elements = _element_rates(elements, speed)
        worst = int(np.argmax(rates_of_elements))
        vector = np.zeros(n)
        vector[elements.corners[0, worst]] = 1.0
        return float(rates_of_elements[worst]), vector
    return float(rates[-1]), vectors[:, -1]
