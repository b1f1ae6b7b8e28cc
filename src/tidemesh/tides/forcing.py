"""Elevation at the ocean nodes from a table of tidal constants."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.spatial import Delaunay, QhullError, cKDTree

from tidemesh.datatypes import CoastalMesh, TideForcing, TideTable
from tidemesh.errors import EngineError, InputError

_FLAT = 1.0e-6
"""Width over length below which places count as lying on one line."""


def boundary_forcing(
    mesh: CoastalMesh,
    table: TideTable,
    names: Sequence[str],
    *,
    max_distance_m: float = 50_000.0,
) -> TideForcing:
    """Interpolate tidal constants to the open boundary nodes.

    Complex amplitudes are interpolated, never amplitudes and phases apart: linearly in
    the Delaunay triangles of the places; outside their hull linearly along its nearest
    side. So a grid of places, scattered places and places along the boundary itself
    are all served, and a single place gives its own value everywhere.

    Parameters
    ----------
    mesh : CoastalMesh
    table : TideTable
    names : sequence of str
        Constituents wanted, in the order of the result.
    max_distance_m : float
        Farthest that the nearest place may be from an ocean node.

    Returns
    -------
    forcing : TideForcing

    Raises
    ------
    EngineError
        If the mesh has no open boundary.
    InputError
        If the table lacks a constituent, or its places are too far away.
    """
    nodes = mesh.open_nodes
    if len(nodes) == 0:
        raise EngineError(
            "the mesh has no open (ocean) boundary, so nothing drives the tide"
        )
    rows = [_row(table, name) for name in names]
    targets = mesh.points[nodes]
    places = mesh.projection.forward(table.longitude_deg, table.latitude_deg)
    # A global atlas has places that the map of this mesh cannot hold.
    near = _within(places, targets, max_distance_m)

    elevation = np.empty((len(rows), len(nodes)), dtype=np.complex128)
    weights: dict[bytes, tuple[np.ndarray, np.ndarray]] = {}
    for k, row in enumerate(rows):
        known = near & np.isfinite(table.elevation[row])
        key = known.tobytes()
        if key not in weights:
            _check_distance(
                mesh,
                targets,
                places,
                table,
                row,
                np.isfinite(places).all(axis=1) & np.isfinite(table.elevation[row]),
                max_distance_m,
            )
            index = np.flatnonzero(known)
            corner, weight = interpolation_weights(places[index], targets)
            weights[key] = index[corner], weight
        corner, weight = weights[key]
        elevation[k] = (table.elevation[row][corner] * weight).sum(axis=1)
    return TideForcing(
        names=tuple(table.names[row] for row in rows),
        frequency=table.frequency[rows],
        nodes=nodes,
        elevation=elevation,
    )


def interpolation_weights(
    places: np.ndarray, targets: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Linear interpolation from scattered places, along the nearest side outside.

    Parameters
    ----------
    places : (n_places, 2) float array
    targets : (n, 2) float array

    Returns
    -------
    corner : (n, 3) int array
        Places that a target draws on.
    weight : (n, 3) float array
        Not negative, sum 1.
    """
    triangulation = _triangulate(places)
    if triangulation is None:
        return _along_line(places, targets)
    corner = np.zeros((len(targets), 3), dtype=np.int64)
    weight = np.zeros((len(targets), 3))
    simplex = triangulation.find_simplex(targets)
    inside = simplex >= 0
    transform = triangulation.transform[simplex[inside]]
    two = np.einsum("nij,nj->ni", transform[:, :2], targets[inside] - transform[:, 2])
    weight[inside] = np.column_stack([two, 1.0 - two.sum(axis=1)]).clip(0.0)
    weight[inside] /= weight[inside].sum(axis=1, keepdims=True)
    corner[inside] = triangulation.simplices[simplex[inside]]
    corner[~inside], weight[~inside] = _nearest_side(
        places, triangulation.convex_hull, targets[~inside]
    )
    return corner, weight


def _triangulate(places: np.ndarray) -> Delaunay | None:
    if len(places) < 3:
        return None
    spread = np.linalg.svd(places - places.mean(axis=0), compute_uv=False)
    if spread[1] <= _FLAT * spread[0]:
        return None
    try:
        return Delaunay(places)
    except QhullError:
        return None


def _along_line(
    places: np.ndarray, targets: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Places on one line: between the two neighbours along it, constant beyond."""
    centred = places - places.mean(axis=0)
    direction = np.linalg.svd(centred, full_matrices=False)[2][0]
    order = np.argsort(centred @ direction, kind="stable")
    if len(places) == 1:
        sides = np.zeros((1, 2), dtype=np.int64)
    else:
        sides = np.column_stack([order[:-1], order[1:]])
    return _nearest_side(places, sides, targets)


def _nearest_side(
    places: np.ndarray, sides: np.ndarray, targets: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Weights of the location nearest to each target on a set of segments."""
    start, along = places[sides[:, 0]], places[sides[:, 1]] - places[sides[:, 0]]
    square = np.maximum((along**2).sum(axis=1), np.finfo(float).tiny)
    corner = np.empty((len(targets), 3), dtype=np.int64)
    weight = np.zeros((len(targets), 3))
    for k, target in enumerate(targets):
        fraction = (((target - start) * along).sum(axis=1) / square).clip(0.0, 1.0)
        gap = target - start - fraction[:, None] * along
        side = int(np.argmin((gap**2).sum(axis=1)))
        corner[k] = sides[side, 0], sides[side, 1], sides[side, 1]
        weight[k, :2] = 1.0 - fraction[side], fraction[side]
    return corner, weight


def _row(table: TideTable, name: str) -> int:
    known = [n.upper() for n in table.names]
    if name.upper() not in known:
        raise InputError(
            f"the table of tidal constants has no {name}; it has "
            + ", ".join(table.names)
        )
    return known.index(name.upper())


def _within(places: np.ndarray, targets: np.ndarray, distance: float) -> np.ndarray:
    """Places in the box around the targets, widened by twice the distance."""
    low, high = targets.min(axis=0) - 2 * distance, targets.max(axis=0) + 2 * distance
    with np.errstate(invalid="ignore"):
        return ((places >= low) & (places <= high)).all(axis=1)


def _check_distance(
    mesh: CoastalMesh,
    targets: np.ndarray,
    places: np.ndarray,
    table: TideTable,
    row: int,
    usable: np.ndarray,
    limit: float,
) -> None:
    name = table.names[row]
    if not usable.any():
        raise InputError(f"the table of tidal constants has no value of {name}")
    index = np.flatnonzero(usable)
    gap, nearest = cKDTree(places[index]).query(targets)
    worst = int(np.argmax(gap))
    if gap[worst] > limit:
        longitude, latitude = mesh.projection.inverse(targets[worst])
        place = index[nearest[worst]]
        raise InputError(
            f"the tidal constants of {name} are too far from the ocean boundary: the "
            f"node at ({longitude:.4f}, {latitude:.4f}) is {gap[worst] / 1e3:.1f} km "
            f"from the nearest place, ({table.longitude_deg[place]:.4f}, "
            f"{table.latitude_deg[place]:.4f}), more than {limit / 1e3:g} km; use a "
            "table that covers the boundary (longitudes are positive to the east), "
            "or raise max_forcing_distance_km"
        )
