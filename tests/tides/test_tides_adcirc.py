"""Against ADCIRC's own linear solutions (kept beside the repository)."""

import adcirc_cases
import numpy as np
import pytest

from tidemesh.tides import TideSettings, solve
from tidemesh.tides.frequency_domain.metric import adcirc_elements

pytestmark = pytest.mark.skipif(
    not adcirc_cases.FOLDER.is_dir(), reason="the ADCIRC reference runs are not here"
)


def relative(ours, theirs):
    return np.linalg.norm(ours - theirs) / np.linalg.norm(theirs)


def run(case, symbols=None):
    given = case.settings
    elements = None
    if given["ics"] == 2:
        elements = adcirc_elements(case.mesh, given["slam0_sfea0"][1])
    settings = TideSettings(
        friction=given["friction"],
        gravity=given["g"],
        minimum_inner_angle_deg=given["anginn"],
        metric="sphere" if given["ics"] == 22 else "plane",
    )
    tide = solve(
        case.mesh,
        case.forcing,
        settings,
        coriolis=given["cori"],
        elements=elements,
        symbols=symbols,
    )
    return (
        relative(tide.elevation[0], case.elevation),
        relative(tide.velocity[0], case.velocity),
    )


# What ADCIRC's time step leaves (linear cases), and the second-order difference of its
# wave equation from Galerkin's with rotation: the table kept with the runs.
@pytest.mark.parametrize(
    ("name", "elevation", "velocity"),
    [
        ("qa_ts_lin", 9.4e-5, 1.2e-4),
        ("qa_r1_lin", 9.4e-5, 1.2e-4),
        ("qa_r2_lin", 9.3e-5, 1.2e-4),
        ("qa_r4_lin", 2.3e-5, 3.0e-5),
        ("qa_r8_lin", 5.8e-6, 7.4e-6),
        ("sh_lin", 7.1e-7, 3.9e-6),
        ("sh_lin_cart", 7.2e-7, 3.9e-6),
        # On the sphere the direction of the shore is ADCIRC's only up to its map.
        ("sh_lin_ics22", 7.0e-7, 6.0e-4),
        ("qa_r1_cor", 5.3e-3, 8.4e-3),
        ("qa_r4_cor", 4.4e-4, 1.6e-3),
        ("qa_r8_cor", 1.3e-4, 7.6e-4),
        ("sh_cor", 2.6e-4, 1.4e-2),
    ],
)
def test_agrees_as_far_as_the_time_step_lets_it(name, elevation, velocity):
    errors = run(adcirc_cases.load(name))
    assert errors[0] < elevation
    assert errors[1] < velocity


@pytest.mark.parametrize(
    ("name", "elevation", "velocity"),
    [
        ("qa_r1_lin_nc", 5e-12, 1e-11),
        ("qa_r4_lin", 6e-7, 6e-7),
        ("sh_lin", 6e-7, 6e-7),
    ],
)
def test_is_the_same_with_the_symbols_of_its_time_stepping(name, elevation, velocity):
    case = adcirc_cases.load(name)
    errors = run(case, [adcirc_cases.discrete_symbols(case.settings)])
    assert errors[0] < elevation
    assert errors[1] < velocity
