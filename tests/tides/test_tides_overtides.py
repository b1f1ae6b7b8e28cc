"""Overtides from finite amplitude and advection, against second-order theory."""

import adcirc_cases
import numpy as np
import pytest
from numpy.testing import assert_allclose

from tidemesh import constants
from tidemesh.datatypes import BoundaryString, CoastalMesh, TideForcing
from tidemesh.errors import InputError
from tidemesh.io.fort53 import read_fort53
from tidemesh.tides import TideSettings, solve
from tidemesh.tides.frequency_domain import with_overtides

G = 9.81
OMEGA = constants.frequency("M2")
LENGTH, DEPTH, TAU = 60e3, 10.0, 3e-4


def channel(n):
    """Two triangles wide, open at x = LENGTH."""
    side = LENGTH / n
    x, y = np.meshgrid(np.linspace(0.0, LENGTH, n + 1), [0.0, side])
    points = np.stack([x, y], axis=-1).reshape(-1, 2)
    a = np.arange(n)
    b, c, d = a + 1, a + n + 2, a + n + 1
    even = (a % 2 == 0)[:, None]
    one = np.where(even, np.stack([a, b, c], 1), np.stack([a, b, d], 1))
    two = np.where(even, np.stack([a, c, d], 1), np.stack([b, c, d], 1))
    return CoastalMesh(
        points,
        np.concatenate([one, two]),
        np.full(len(points), DEPTH),
        (BoundaryString("open", [n, 2 * n + 1]),),
    )


def driven(mesh, amplitudes):
    nodes = mesh.open_nodes
    return TideForcing(
        tuple(amplitudes),
        np.array([constants.frequency(name) for name in amplitudes]),
        nodes,
        np.array([np.full(len(nodes), value) for value in amplitudes.values()]),
    )


class SecondOrder:
    """Channel of constant depth with linear friction: what products of M2 make.

    First order: e = A cos kx, u = B sin kx. Their products force M4 as cos 2kx, to
    which a free wave is added that makes M4 vanish at the mouth; and the mean level.
    """

    def __init__(self, amplitude, *, finite, advection):
        q = 1j * OMEGA + TAU
        self.k = np.sqrt(-1j * OMEGA * q / (G * DEPTH))
        self.a = amplitude / np.cos(self.k * LENGTH)
        self.b = -1j * OMEGA * self.a / (DEPTH * self.k)
        self.finite, self.advection = float(finite), float(advection)

    def m4(self, x):
        k, rate = self.k, 2j * OMEGA
        q = rate + TAU
        source = self.finite * -0.5 * self.a * self.b * k
        source += self.advection * 0.5 * DEPTH / q * self.b**2 * k**2
        forced = source / (rate + 4.0 * k**2 * DEPTH * G / q)
        free = np.sqrt(-rate * q / (G * DEPTH))
        mouth = np.cos(2.0 * k * LENGTH) / np.cos(free * LENGTH)
        return forced * (np.cos(2.0 * k * x) - mouth * np.cos(free * x))

    def level(self, x):
        """Mean level: friction of the current that returns the Stokes transport."""
        fine = np.linspace(0.0, LENGTH, 20_001)
        e, u = self.a * np.cos(self.k * fine), self.b * np.sin(self.k * fine)
        transport = self.finite * 0.5 * (e * u.conj()).real
        slope = TAU * transport / (G * DEPTH)
        slope -= self.advection * np.gradient(np.abs(u) ** 2, fine) / (4.0 * G)
        level = np.concatenate([[0.0], np.cumsum(0.5 * (slope[1:] + slope[:-1]))])
        level *= fine[1]
        return np.interp(x, fine, level - level[-1])


@pytest.mark.parametrize(
    ("finite", "advection"), [(True, False), (False, True), (True, True)]
)
def test_m4_and_mean_level_of_a_channel(finite, advection):
    amplitude = 0.01
    theory = SecondOrder(amplitude, finite=finite, advection=advection)
    settings = TideSettings(
        friction=TAU,
        finite_amplitude=finite,
        advection=advection,
        overtides=("M4", "STEADY"),
        tolerance=1e-8,
    )
    errors = []
    for n in (40, 80, 160):
        mesh = channel(n)
        x = mesh.points[:, 0]
        tide = solve(mesh, driven(mesh, {"M2": amplitude}), settings)
        assert tide.names == ("M2", "M4", "STEADY")
        m4, level = theory.m4(x), theory.level(x)
        errors.append(
            [
                np.linalg.norm(tide.elevation[1] - m4) / np.linalg.norm(m4),
                np.linalg.norm(tide.elevation[2] - level) / np.linalg.norm(level),
            ]
        )
    order = np.log2(np.array(errors[:-1]) / errors[1:])
    if advection:
        # The velocity at the mouth is that of the triangles inside of it.
        assert (np.array(errors[-1]) < 1e-2).all()
        assert (order > 0.95).all()
    else:
        # Third order in the amplitude is left: 0.01/10, to the power two.
        assert (np.array(errors[-1]) < 1e-3).all()
        assert order[0] == pytest.approx(2.0, abs=0.25)


def test_overtides_grow_with_the_square_of_the_tide():
    mesh = channel(30)
    settings = TideSettings(
        friction=TAU,
        finite_amplitude=True,
        advection=True,
        overtides=("M4", "M6", "STEADY"),
        tolerance=1e-10,
    )
    small, large = (
        solve(mesh, driven(mesh, {"M2": a}), settings).elevation for a in (0.01, 0.02)
    )
    grown = np.linalg.norm(large, axis=1) / np.linalg.norm(small, axis=1)
    assert_allclose(grown, [2.0, 4.0, 8.0, 4.0], rtol=2e-3)


def test_compound_tides_of_two_constituents():
    # M2 and S2 of small and equal amplitude: by symmetry of the products MS4 is about
    # twice M4 and S4, as 2ab beside a**2 and b**2.
    mesh = channel(40)
    settings = TideSettings(
        friction=TAU,
        finite_amplitude=True,
        overtides=("M4", "MS4", "S4"),
        tolerance=1e-9,
    )
    tide = solve(mesh, driven(mesh, {"M2": 0.01, "S2": 0.01}), settings)
    m4, ms4, s4 = np.linalg.norm(tide.elevation[2:], axis=1)
    assert ms4 == pytest.approx(2.0 * np.sqrt(m4 * s4), rel=5e-3)
    assert tide.frequency[3] == pytest.approx(OMEGA + constants.frequency("S2"))


def test_quadratic_friction_makes_odd_overtides_only():
    mesh = channel(30)
    settings = TideSettings(
        friction_law="quadratic", overtides=("M4", "M6", "STEADY"), tolerance=1e-7
    )
    tide = solve(mesh, driven(mesh, {"M2": 0.5}), settings)
    size = np.abs(tide.elevation).max(axis=1)
    assert size[2] > 1e-3
    assert size[1] < 1e-9
    assert size[3] < 1e-9


# --- ADCIRC -----------------------------------------------------------------------


@pytest.mark.skipif(
    not adcirc_cases.FOLDER.is_dir(), reason="the ADCIRC reference runs are not here"
)
@pytest.mark.parametrize(
    # Differences relative to M2; equivalent linear friction leaves 8e-3 in M2.
    ("name", "bounds"),
    [
        (
            "qa_r4_nl",
            {"STEADY": 8e-5, "M2": 2.2e-3, "M4": 4e-4, "M6": 1.4e-3, "M8": 5e-4},
        ),
        (
            "qa_r4_nlcor",
            {"STEADY": 3e-4, "M2": 4e-3, "M4": 6e-4, "M6": 1.2e-3, "M8": 5e-4},
        ),
    ],
)
def test_agrees_with_adcirc(name, bounds):
    case = adcirc_cases.load(name)
    given = case.settings
    forcing = TideForcing(
        ("M2",),
        np.array([given["omega"]]),
        case.mesh.open_nodes,
        case.forcing.elevation,
    )
    settings = TideSettings(
        friction_law="quadratic",
        drag_coefficient=given["friction"],
        finite_amplitude=True,
        advection=True,
        overtides=("STEADY", "M4", "M6", "M8"),
        minimum_inner_angle_deg=given["anginn"],
    )
    tide = solve(case.mesh, forcing, settings, coriolis=given["cori"])
    theirs = read_fort53(adcirc_cases.FOLDER / name / "fort.53.gz")
    scale = np.linalg.norm(theirs.values[theirs.names.index("M2")])
    for overtide, bound in bounds.items():
        ours = tide.elevation[tide.names.index(overtide)]
        other = theirs.values[theirs.names.index(overtide)]
        assert np.linalg.norm(ours - other) < bound * scale, overtide


# --- constituents -----------------------------------------------------------------

NONLINEAR = {"friction_law": "quadratic", "finite_amplitude": True}


def test_overtides_take_frequency_and_nodal_factor_from_what_makes_them():
    mesh = channel(4)
    forcing = TideForcing(
        ("M2", "S2"),
        np.array([1.405e-4, constants.frequency("S2")]),
        mesh.open_nodes,
        np.ones((2, 2)),
        nodal_factor=[0.97, 1.0],
        argument=[0.3, 1.1],
    )
    settings = TideSettings(overtides=("m4", "MS4", "STEADY", "2SM2"), **NONLINEAR)
    longer = with_overtides(forcing, settings)
    assert longer.names == ("M2", "S2", "M4", "MS4", "STEADY", "2SM2")
    m, s = forcing.frequency
    assert_allclose(longer.frequency[2:], [2 * m, m + s, 0.0, 2 * s - m])
    assert_allclose(longer.nodal_factor[2:], [0.97**2, 0.97, 1.0, 0.97])
    assert_allclose(longer.argument[2:], [0.6, 1.4, 0.0, 1.9])
    assert (longer.elevation[2:] == 0.0).all()


@pytest.mark.parametrize(
    ("names", "overtides", "message"),
    [
        (("M2", "m2"), (), "M2 is twice in the forcing"),
        (("M2",), ("M4", "M4"), "M4 is twice in overtides"),
        (("M2", "M4"), ("M4",), "M4 is among the overtides, and the forcing drives"),
        (("M2",), ("X9",), "the overtide X9 is unknown; known are M2,"),
        (("S2",), ("M4",), "M4 is no combination of the driven constituents S2"),
    ],
)
def test_refuses_constituents_that_contradict_each_other(names, overtides, message):
    mesh = channel(4)
    forcing = TideForcing(
        names,
        np.array([constants.frequency(name) for name in names]),
        mesh.open_nodes,
        np.ones((len(names), 2)),
    )
    with pytest.raises(InputError, match=message):
        solve(mesh, forcing, TideSettings(overtides=overtides, **NONLINEAR))


def test_refuses_overtides_that_nothing_makes():
    mesh = channel(4)
    with pytest.raises(InputError, match="nothing makes the overtides M4"):
        solve(mesh, driven(mesh, {"M2": 1.0}), TideSettings(overtides=("M4",)))


def test_refuses_two_names_for_one_frequency():
    mesh = channel(4)
    forcing = TideForcing(
        ("M2", "X"), np.array([OMEGA, OMEGA]), mesh.open_nodes, np.ones((2, 2))
    )
    with pytest.raises(InputError, match="M2 and X have the same frequency"):
        solve(mesh, forcing, TideSettings(**NONLINEAR))
