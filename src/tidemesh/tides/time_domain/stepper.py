"""A mesh, its forcing and the state of the water, stepped in time."""

from __future__ import annotations

import math

import numba
import numpy as np

from tidemesh.datatypes import CoastalMesh, TideForcing
from tidemesh.errors import InputError
from tidemesh.tides.settings import TideSettings
from tidemesh.tides.time_domain import _kernels as kernels
from tidemesh.tides.time_domain.discretisation import (
    Discretisation,
    at,
    weight_of_wave_equation,
)


class Stepper:
    """The generalised wave continuity equation and the momentum equations in time.

    Explicit, with lumped mass, as ADCIRC's IM = 111112 with weights 0, 1, 0
    (docs/method.md). The water is at rest at first; `set_state` gives it another start.

    Parameters
    ----------
    mesh : CoastalMesh
    forcing : TideForcing
        Elevation at the open boundary nodes; its arguments belong to time 0.
    settings : TideSettings
        Physics.
    step : float
        s.
    ramp : float
        s; the forcing grows as tanh(2 t/ramp), 0 for none.
    viscosity : float
        m2/s.
    ocean_advection : bool
        Advection counts in the triangles of the open boundary too, as in ADCIRC.
    minimum_column : float
        m.
    limit : float
        m, elevation that counts as blow-up.
    threads : int
    friction, drag : (n_points,) array, optional
        Coefficient of the friction law at the nodes (1/s; C_f or Manning's n), instead
        of the settings' number.

    Raises
    ------
    InputError
        If the forcing does not belong to the mesh or is not finite.
    MeshError
        If the mesh cannot be used.
    """

    def __init__(
        self,
        mesh: CoastalMesh,
        forcing: TideForcing,
        settings: TideSettings,
        step: float,
        *,
        ramp: float = 0.0,
        viscosity: float = 0.0,
        ocean_advection: bool = False,
        minimum_column: float = 0.1,
        limit: float = math.inf,
        threads: int = 1,
        friction: np.ndarray | None = None,
        drag: np.ndarray | None = None,
    ):
        _check_forcing(mesh, forcing)
        still = None if ocean_advection else forcing.nodes
        self.discretisation = grid = Discretisation.of(mesh, settings, still=still)
        self.settings, self.step, self.steps = settings, step, 0
        self.ramp, self.viscosity, self.limit = ramp, viscosity, limit
        self.threads = threads
        n = len(mesh.points)
        self.constants = grid.constants(
            settings, step, minimum_column, friction=friction, drag=drag
        )
        self.state = np.zeros((kernels.FIELDS, n))
        self.tally = np.zeros((-(-n // kernels.BLOCK), 2))
        self.tally[:, 0] = -1.0
        self._share = np.zeros((len(mesh.triangles), 11 if viscosity > 0.0 else 5))
        self._weights = grid.gradient * (-0.5 * settings.gravity * step)
        self._ocean = grid.place[forcing.nodes].astype(np.uint32)
        # What the wave equation says at these nodes is not used.
        self._ocean_lowest = self.constants[kernels.LOWEST, self._ocean]
        self.constants[kernels.LOWEST, self._ocean] = -np.inf
        self._elevation = (forcing.elevation.real.copy(), forcing.elevation.imag.copy())
        potential = np.empty((0, n), dtype=complex)
        if forcing.potential is not None:
            potential = forcing.potential[:, grid.order]
        self._potential = (potential.real.copy(), potential.imag.copy())
        n_c = len(forcing.names)
        self._frequency = np.array(forcing.frequency)
        self._argument = np.array(_or(forcing.argument, np.zeros(n_c)))
        self._factor = np.array(_or(forcing.nodal_factor, np.ones(n_c)))
        self._follow()

    def set_state(
        self,
        elevation: np.ndarray,
        velocity: np.ndarray | None = None,
        before: np.ndarray | None = None,
    ) -> None:
        """Start from other than rest.

        Parameters
        ----------
        elevation : (n_points,) array
            m.
        velocity : (n_points, 2) array, optional
            m/s.
        before : (n_points,) array, optional
            Elevation one step earlier (m); the same if not given.
        """
        order = self.discretisation.order
        self.state[kernels.LEVEL] = np.asarray(elevation)[order]
        if before is not None:
            change = np.asarray(elevation) - np.asarray(before)
            self.state[kernels.RISE] = change[order]
        if velocity is not None:
            self.state[[kernels.U, kernels.V]] = np.asarray(velocity)[order].T
        self._follow()

    def advance(self, steps: int) -> int | None:
        """Take some steps; the node where the elevation left the limit, if any did."""
        settings, grid = self.settings, self.discretisation
        kernel = kernels.advance_alone
        if self.threads > 1:
            kernel = kernels.advance_together
            before = numba.get_num_threads()
            numba.set_num_threads(min(self.threads, numba.config.NUMBA_NUM_THREADS))
        taken = kernel(
            steps,
            self.steps,
            self.step,
            weight_of_wave_equation(settings),
            settings.gravity,
            float(settings.finite_amplitude),
            settings.advection,
            self.viscosity,
            settings.friction_law == "manning",
            self.limit,
            grid.corners,
            grid.geometry,
            grid.incidence,
            grid.members,
            grid.starts,
            grid.others,
            self._weights,
            self.state,
            self.constants,
            self._share,
            self._ocean,
            *self._elevation,
            self._ocean_lowest,
            *self._potential,
            self._frequency,
            self._argument,
            self._factor,
            self.ramp,
            self.tally,
        )
        if self.threads > 1:
            numba.set_num_threads(before)
        self.steps += taken
        lost = self.tally[:, 0].max()
        return None if lost < 0.0 else int(grid.order[int(lost)])

    @property
    def time(self) -> float:
        """Time since the start (s)."""
        return self.steps * self.step

    @property
    def elevation(self) -> np.ndarray:
        """(n_points,) m, at the nodes of the mesh."""
        return self.state[kernels.LEVEL][self.discretisation.place]

    @property
    def velocity(self) -> np.ndarray:
        """(n_points, 2) m/s."""
        rows = self.state[[kernels.U, kernels.V]]
        return np.ascontiguousarray(rows[:, self.discretisation.place].T)

    @property
    def volume(self) -> float:
        """Water in the mesh (m3)."""
        column = self.state[kernels.LEVEL] + self.constants[kernels.DEPTH]
        return math.fsum(self.discretisation.mass * column)

    @property
    def films(self) -> np.ndarray:
        """(n_points,) number of steps in which a node was held at the least column."""
        return self.state[kernels.FILMS][self.discretisation.place].astype(np.int64)

    @property
    def film_volume(self) -> float:
        """Water that holding nodes at the least column has added (m3)."""
        tau0 = weight_of_wave_equation(self.settings)
        weight = self.step / (1.0 / self.step + 0.5 * tau0)
        return float(self.tally[:, 1].sum() * weight)

    def _follow(self) -> None:
        """What follows from elevation and velocity, as the last step leaves it."""
        state, rows, settings = self.state, self.constants, self.settings
        grid, weights = self.discretisation, self._weights
        level = state[kernels.LEVEL]
        for row, column in ((kernels.PX, 0), (kernels.PY, 1)):
            products = weights[:, column] * level[grid.others]
            state[row] = np.add.reduceat(products, grid.starts[:-1].astype(np.int64))
        column = rows[kernels.DEPTH] + settings.finite_amplitude * level
        speed = np.hypot(state[kernels.U], state[kernels.V])
        tau = rows[kernels.FRICTION] + rows[kernels.DRAG] * speed / column
        state[kernels.TAU] = np.minimum(tau, 2.0 / self.step)
        qx, qy = column * state[kernels.U], column * state[kernels.V]
        rest = weight_of_wave_equation(settings) - state[kernels.TAU]
        f = rows[kernels.CORIOLIS]
        state[kernels.QX], state[kernels.QY] = qx, qy
        state[kernels.SX], state[kernels.SY] = rest * qx + f * qy, rest * qy - f * qx


def _or(values: np.ndarray | None, otherwise: np.ndarray) -> np.ndarray:
    return otherwise if values is None else values


def _check_forcing(mesh: CoastalMesh, forcing: TideForcing) -> None:
    n = len(mesh.points)
    nodes = forcing.nodes
    if len(nodes) and (nodes.min() < 0 or nodes.max() >= n):
        raise InputError(
            f"the forcing names node {int(nodes.max())}, the mesh has {n} nodes: it "
            "belongs to another mesh"
        )
    if len(np.unique(nodes)) < len(nodes):
        raise InputError("the forcing gives an open boundary node twice")
    missed = np.setdiff1d(mesh.open_nodes, nodes)
    if len(missed):
        raise InputError(
            f"the forcing misses {len(missed)} of {len(mesh.open_nodes)} open boundary "
            f"nodes, the first is node {missed[0]} at {at(mesh, missed[0])}; make it "
            "from this mesh"
        )
    if forcing.potential is not None and forcing.potential.shape[1] != n:
        raise InputError(
            f"the tidal potential is given at {forcing.potential.shape[1]} nodes, the "
            f"mesh has {n}: it belongs to another mesh"
        )
    for name, values in (
        ("elevation", forcing.elevation),
        ("frequency", forcing.frequency),
        ("nodal factor", forcing.nodal_factor),
        ("argument", forcing.argument),
        ("tidal potential", forcing.potential),
    ):
        if values is not None and not np.isfinite(values).all():
            c = int(np.argwhere(~np.isfinite(values))[0][0])
            raise InputError(f"the {name} of {forcing.names[c]} is not a finite number")
