"""A run in time: analysis, stations, files, restarts, messages."""

import math
import signal

import numpy as np
import pytest
import xarray
from annulus import FREQUENCY, annulus_forcing, annulus_mesh

from tidemesh.constants import frequency
from tidemesh.datatypes import CoastalMesh, TideForcing
from tidemesh.errors import EngineError, FormatError, InputError
from tidemesh.geometry.projection import Projection
from tidemesh.io.time_series import read_stations, utc
from tidemesh.tides import TideSettings, solve
from tidemesh.tides.time_domain import SimulationSettings, Station, simulate
from tidemesh.tides.time_domain.harmonics import (
    COMPOUNDS,
    HarmonicSums,
    analysed_constituents,
)

NONLINEAR = TideSettings(
    friction_law="quadratic", tau0=0.009, finite_amplitude=True, advection=True
)
START = "1998-01-01T00:00:00Z"


def relative(ours, exact):
    return np.linalg.norm(ours - exact) / np.linalg.norm(exact)


def forced(mesh, names=("M2",), **extra):
    nodes = mesh.open_nodes
    size = np.linspace(0.3, 0.1, len(names))[:, None]
    lag = np.exp(-0.5j - 0.3j * np.arange(len(names)))[:, None]
    return TideForcing(
        names,
        [frequency(name) for name in names],
        nodes,
        size * lag * np.ones((1, len(nodes))),
        **extra,
    )


def short(**change):
    fields = {
        "days": 2.0,
        "ramp_days": 0.3,
        "time_step_s": 180.0,
        "expected_level_m": 0.5,
        "expected_speed_m_s": 0.5,
        "restart_every_days": 0.0,
        **change,
    }
    return SimulationSettings(**fields)


def placed(mesh):
    """The same mesh somewhere on the globe."""
    return CoastalMesh(
        mesh.points,
        mesh.triangles,
        mesh.depth,
        mesh.boundaries,
        Projection.stereographic(-79.0, 32.0),
    )


@pytest.fixture(scope="module")
def mesh():
    return annulus_mesh(8, 6, 2)


# --- harmonic analysis ----------------------------------------------------------------


def test_linear_run_has_the_constants_of_the_frequency_domain(mesh):
    forcing = forced(mesh, ("M2", "K1"), nodal_factor=[1.1, 0.8], argument=[0.7, -1.9])
    physics = TideSettings(mass="lumped", friction=4e-4, minimum_inner_angle_deg=80.0)
    run = simulate(
        mesh,
        forcing,
        physics,
        short(days=7.0, ramp_days=0.5, time_step_s=60.0, analysis_start_day=2.5),
    )
    exact = solve(mesh, forcing, physics)
    # Nodal factors and arguments have gone: what is left is the error of the step,
    # (w step)^2.
    assert run.constants.names == ("M2", "K1")
    assert relative(run.constants.elevation, exact.elevation) < 2e-5
    assert relative(run.constants.velocity, exact.velocity) < 2e-5
    np.testing.assert_allclose(run.constants.friction, 4e-4)


def test_sums_recover_what_was_put_in():
    constituents = analysed_constituents(
        TideForcing(
            ("M2", "S2"),
            [frequency("M2"), frequency("S2")],
            [0],
            np.ones((2, 1)),
            nodal_factor=[0.9, 1.2],
            argument=[0.4, 1.0],
        ),
        ("M2", "S2", "M4", "STEADY"),
        nonlinear=True,
    )
    by_name = {c.name: c for c in constituents}
    assert by_name["M4"].factor == pytest.approx(0.81)
    assert by_name["M4"].argument == pytest.approx(0.8)
    rng = np.random.default_rng(3)
    amplitude = rng.standard_normal((4, 5)) + 1j * rng.standard_normal((4, 5))
    amplitude[3] = amplitude[3].real
    sums = HarmonicSums(constituents, 5)
    for time in 600.0 * np.arange(20 * 144):
        turn = [
            c.factor * np.exp(1j * (c.frequency * time + c.argument))
            for c in constituents
        ]
        sums.add(time, (np.array(turn) @ amplitude).real)
    np.testing.assert_allclose(sums.solve(), amplitude, rtol=0, atol=1e-10)


@pytest.mark.parametrize("name", COMPOUNDS)
def test_compound_tides_have_the_frequency_of_the_table(name):
    parts = ("M2", "S2", "N2", "K1")
    forcing = TideForcing(parts, [frequency(p) for p in parts], [0], np.ones((4, 1)))
    (made,) = analysed_constituents(forcing, (name,), nonlinear=True)
    assert made.frequency == pytest.approx(frequency(name), rel=1e-6)


def test_nonlinear_runs_get_overtides_and_linear_ones_do_not(mesh):
    def names(nonlinear):
        found = analysed_constituents(forced(mesh, ("M2", "S2")), None, nonlinear)
        return [c.name for c in found]

    assert names(False) == ["M2", "S2"]
    assert names(True) == ["M2", "S2", "M4", "M6", "STEADY"]


def test_analysis_that_cannot_work_is_refused_before_the_run(mesh):
    for change, match in (
        ({"analysis_start_day": 1.95}, "cannot tell the constituents"),
        ({"analysis_start_day": 3.0}, "cannot tell"),
        ({"constituents": ("M2", "Q1")}, '"Q1": it is not in the forcing'),
        ({"constituents": ("MS4",)}, "overtide of what"),
    ):
        with pytest.raises(InputError, match=match):
            simulate(mesh, forced(mesh), NONLINEAR, short(**change))


# --- stations, maxima, volume, files --------------------------------------------------


def test_records_maxima_and_volume(mesh):
    place = mesh.points[10]
    run = simulate(
        mesh,
        forced(mesh),
        NONLINEAR,
        short(station_every_s=360.0, analysis_start_day=0.9),
        stations=[Station("at a node", *place), ("at the edge", 60e3, 0.0)],
    )
    node, edge = run.records
    assert node.station == "at a node"
    assert node.time[0] == 883612800.0
    np.testing.assert_allclose(np.diff(node.time), 360.0)
    assert len(node.time) == 2 * 240 + 1
    # The harmonics rebuild the record once the ramp is over.
    late = node.time > node.time[0] + 1.2 * 86400.0
    time = (node.time - node.time[0])[late]
    tide = run.constants
    rebuilt = sum(
        (a * np.exp(1j * w * time)).real
        for w, a in zip(tide.frequency, tide.elevation[:, 10], strict=True)
    )
    assert relative(node.elevation[late], rebuilt) < 0.02
    assert run.highest[10] == pytest.approx(node.elevation.max(), abs=2e-3)
    assert run.fastest.max() > 0.05
    assert edge.elevation.max() > 0.1
    # In at flood, out at ebb, about the water at rest.
    rest = run.volume[0]
    assert run.volume.min() < rest < run.volume.max()
    assert not run.films.any()
    assert run.film_volume == 0.0


def test_files_open_in_xarray(mesh, tmp_path):
    somewhere = placed(mesh)
    lon, lat = somewhere.projection.inverse(mesh.points[10])
    run = simulate(
        somewhere,
        forced(mesh),
        NONLINEAR,
        short(days=0.5, ramp_days=0.1, global_every_s=21600.0, constituents=()),
        stations=[Station("Pier", lon, lat)],
        folder=tmp_path,
    )
    assert run.constants is None
    with xarray.open_dataset(tmp_path / "stations.nc") as data:
        assert data.attrs["featureType"] == "timeSeries"
        assert data.time.values[0] == np.datetime64("1998-01-01")
        assert data.station_name.values.astype(str).tolist() == ["Pier"]
        np.testing.assert_array_equal(
            data.water_level.values[0], run.records[0].elevation
        )
    (again,) = read_stations(tmp_path / "stations.nc")
    np.testing.assert_array_equal(again.elevation, run.records[0].elevation)
    assert (again.station, again.longitude_deg) == ("Pier", lon)
    with xarray.open_dataset(tmp_path / "fields.nc") as data:
        assert data.water_level.dims == ("time", "node")
        assert data.time.values[-1] == np.datetime64("1998-01-01T12:00")
        np.testing.assert_allclose(
            data.water_level.values[:, 10],
            run.records[0].elevation[::60],
            rtol=1e-6,
            atol=1e-7,
        )
        assert data["mesh2d"].attrs["cf_role"] == "mesh_topology"
        assert data.eastward_velocity.attrs["mesh"] == "mesh2d"
        assert np.abs(data.northward_velocity.values[-1]).max() > 0.01
    (tmp_path / "bad.nc").write_bytes(b"nothing")
    with pytest.raises(FormatError, match=r"bad\.nc"):
        read_stations(tmp_path / "bad.nc")
    with pytest.raises(InputError, match="no such file"):
        read_stations(tmp_path / "none.nc")


# --- restarts -------------------------------------------------------------------------


def outcome(run, folder):
    fields = xarray.load_dataset(folder / "fields.nc")
    return [
        run.constants.elevation,
        run.constants.velocity,
        run.constants.friction,
        run.records[0].elevation,
        run.volume,
        run.highest,
        run.fastest,
        fields.time.values.astype(float),
        fields.water_level.values,
        fields.eastward_velocity.values,
    ]


@pytest.mark.parametrize("law", ["quadratic", "manning"])
def test_a_run_taken_up_again_ends_the_same(mesh, tmp_path, law):
    physics = TideSettings(
        friction_law=law, tau0=0.009, finite_amplitude=True, advection=True
    )
    settings = short(
        global_every_s=7200.0, analysis_start_day=0.5, restart_every_days=0.7
    )
    stations = [Station("one", *mesh.points[10])]
    forcing = forced(mesh)
    whole, parts = tmp_path / "whole", tmp_path / "parts"
    for folder in (whole, parts):
        folder.mkdir()
    run = simulate(mesh, forcing, physics, settings, stations=stations, folder=whole)
    expected = outcome(run, whole)

    def interrupt(done):
        if done > 0.83:
            signal.raise_signal(signal.SIGINT)

    with pytest.raises(KeyboardInterrupt):
        simulate(
            mesh,
            forcing,
            physics,
            settings,
            stations=stations,
            folder=parts,
            progress=interrupt,
        )
    resumed = simulate(
        mesh,
        forcing,
        physics,
        settings,
        stations=stations,
        folder=parts,
        restart=parts / "restart.npz",
    )
    for ours, theirs in zip(outcome(resumed, parts), expected, strict=True):
        np.testing.assert_array_equal(ours, theirs)
    # From the earlier restart file too: what was written after it is written again.
    resumed = simulate(
        mesh,
        forcing,
        physics,
        settings,
        stations=stations,
        folder=parts,
        restart=whole / "restart.npz",
    )
    for ours, theirs in zip(outcome(resumed, parts), expected, strict=True):
        np.testing.assert_array_equal(ours, theirs)
    (parts / "fields.nc").unlink()
    with pytest.raises(InputError, match=r"fields\.nc: is not there"):
        simulate(
            mesh,
            forcing,
            physics,
            settings,
            stations=stations,
            folder=parts,
            restart=parts / "restart.npz",
        )


def test_a_restart_file_of_another_run_is_refused(mesh, tmp_path):
    settings = short(days=0.2, ramp_days=0.1, constituents=(), restart_every_days=0.1)
    simulate(mesh, forced(mesh), NONLINEAR, settings, folder=tmp_path)
    path = tmp_path / "restart.npz"
    other = forced(mesh, argument=[0.1])
    with pytest.raises(InputError, match="another run"):
        simulate(mesh, other, NONLINEAR, settings, restart=path)
    with pytest.raises(InputError, match="no such restart"):
        simulate(mesh, other, NONLINEAR, settings, restart=tmp_path / "none.npz")
    bytes_of = path.read_bytes()
    path.write_bytes(bytes_of[: len(bytes_of) // 2])
    with pytest.raises(InputError, match="is not a restart file"):
        simulate(mesh, forced(mesh), NONLINEAR, settings, restart=path)
    path.write_bytes(bytes_of)
    shorter = short(days=0.1, ramp_days=0.1, constituents=())
    with pytest.raises(InputError, match="after the end of the run"):
        simulate(mesh, forced(mesh), NONLINEAR, shorter, restart=path)
    # Longer is the same run.
    longer = short(days=0.3, ramp_days=0.1, constituents=())
    assert simulate(mesh, forced(mesh), NONLINEAR, longer, restart=path).steps == 144


# --- steps and messages ---------------------------------------------------------------


def test_advised_step_divides_the_station_interval(mesh):
    run = simulate(
        mesh,
        forced(mesh),
        NONLINEAR,
        short(time_step_s=0.0, days=0.1, ramp_days=0.0, constituents=()),
    )
    assert run.step_s <= 0.95 * run.advice.step_s
    parts = 360.0 / run.step_s
    assert parts == pytest.approx(round(parts))


def test_a_step_too_long_is_refused_with_the_place(mesh):
    with pytest.raises(InputError, match=r"at most .* s, for gravity waves .* node"):
        simulate(mesh, forced(mesh), NONLINEAR, short(time_step_s=5000.0))


def test_blow_up_names_time_and_place_and_keeps_the_restart(mesh, tmp_path):
    huge = TideForcing(
        ("M2",),
        [FREQUENCY],
        mesh.open_nodes,
        np.full((1, len(mesh.open_nodes)), 80.0),
    )
    settings = short(ramp_days=5.0, restart_every_days=0.05, constituents=())
    with pytest.raises(
        EngineError, match=r"came to .* m at node \d+, .*1998-01-0"
    ) as e:
        simulate(mesh, huge, TideSettings(), settings, folder=tmp_path)
    assert "restart file is kept" in str(e.value)
    assert (tmp_path / "restart.npz").is_file()


def test_bad_settings_and_stations(mesh, tmp_path):
    forcing = annulus_forcing(mesh)
    with pytest.raises(InputError, match='start = "soon" is not a time'):
        simulate(mesh, forcing, None, short(start="soon"))
    with pytest.raises(InputError, match=r"station Far .* km outside the mesh"):
        simulate(mesh, forcing, None, short(), stations=[Station("Far", 0.0, 0.0)])
    with pytest.raises(InputError, match="station Lost"):
        simulate(
            mesh, forcing, None, short(), stations=[Station("Lost", math.nan, 0.0)]
        )
    with pytest.raises(InputError, match="no such folder"):
        simulate(mesh, forcing, None, short(), folder=tmp_path / "none")
    nothing = TideForcing(("M2",), [FREQUENCY], [], np.zeros((1, 0)))
    closed = CoastalMesh(mesh.points, mesh.triangles, mesh.depth)
    with pytest.raises(InputError, match="nothing drives the tide"):
        simulate(closed, nothing, None, short())


def test_times_are_written_in_utc():
    assert utc(883612800.0 + 3661.0) == "1998-01-01T01:01:01Z"
