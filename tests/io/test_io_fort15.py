"""ADCIRC's control file."""

import gzip
import logging
from dataclasses import fields, is_dataclass, replace
from pathlib import Path

import numpy as np
import pytest
from io_meshes import small_mesh
from numpy.testing import assert_allclose, assert_array_equal

from tidemesh.datatypes import BoundaryString, CoastalMesh
from tidemesh.errors import FormatError, InputError
from tidemesh.geometry.projection import Projection
from tidemesh.io.fort15 import (
    BoundaryConstituent,
    ControlFile,
    FluxConstituent,
    GlobalOutput,
    HarmonicConstituent,
    PotentialConstituent,
    StationOutput,
    boundary_rows,
    fort15_forcing,
    read_fort15,
    write_fort15,
)

ROWS_M2 = "0.1 10.0\n0.2, 20.0\n 3D-1 30. first digit\n.4 -40\n" + 5 * "0.5 50 ! same\n"
ROWS_K1 = "0.01 0.0\n" + 4 * "1.0E-02 90\n" + "4*0.25\n" + 3 * "0.02,180\n"

# Names of the fields behind the values, or not; all that list-directed input allows.
CONTROL = f"""\
 small bay   ! RUNDES
 two constituents
 0
 1  NABOUT without a mark
 600 ! NSCREEN
 0
 2, ICS
 0
 2                     NOLIBF
 2
 1
 1
 1
 mannings_n_at_sea_floor
 1
 1
 0
 2
 9.81
 -5.0
 0.005 0.2
 2.5D1
 0.25
 0.5
 10
 2 0.5 1 /
 0.35 0.3 0.35
 0.05 2*12 0.02
 -72.5 40.5
 0.0025 1. 10 .33333
 5.0
 1.0-4

 1
 M2
 0.242334 1.405189e-4 0.693 1.02 98.8
 2
 M2 principal lunar
 1.405189e-4 1.02 98.8
 K1    ! BOUNTAG
 0.72921E-4 0.9 -30.0
 M2
{ROWS_M2}\
 rows of the second one
{ROWS_K1}\
 90.0
 1 0.0 5.0 60
 3
 -72.5 40.5 ! Ocean buoy ! two miles out
 -72.4,40.6, Inner bay
 -72.3 40.7
 0 3*0
 0
 4 0 5 120
 -1 0 5 120
 2
 STEADY
 0 1 0
 M2
 1.405189e-4 1.02 98.8
 5.0 10.0 1 0.0
 0 0 1 1
 0 0
 1 0 1.E-10 25
"""


@pytest.fixture
def mesh():
    return small_mesh(Projection.equirectangular(-72.5, 40.5))


@pytest.fixture
def path(tmp_path):
    return tmp_path / "fort.15"


def read_text(path, text, mesh=None):
    path.write_text(text)
    return read_fort15(path, mesh)


def assert_equal(have, wanted):
    """Field by field, and the parts of fields; arrays as arrays."""
    assert type(have) is type(wanted)
    if is_dataclass(have):
        for item in fields(have):
            assert_equal(getattr(have, item.name), getattr(wanted, item.name))
    elif isinstance(have, tuple):
        assert len(have) == len(wanted)
        for pair in zip(have, wanted):
            assert_equal(*pair)
    elif isinstance(have, np.ndarray):
        assert_allclose(have, wanted, rtol=1e-13, atol=0.0)
    else:
        assert have == wanted


def test_reads_what_list_directed_input_allows(path, mesh):
    control = read_text(path, CONTROL, mesh)
    assert control.run_description == "small bay"
    assert (control.nabout, control.ics, control.nolibf, control.nolifa) == (1, 2, 2, 2)
    assert control.nwp == ("mannings_n_at_sea_floor",)
    assert control.tau0_range == (0.005, 0.2)
    assert control.time_step == 25.0
    assert (control.statim, control.reftim, control.run_days) == (0.25, 0.5, 10.0)
    assert control.wet_dry == (12, 12, 0.02)
    assert control.hybrid == (1.0, 10.0, 0.33333)
    assert control.cori == 1e-4
    assert control.potential[0].earth_tide_factor == 0.693
    assert [c.name for c in control.forcing] == ["M2", "K1"]
    first = 0.3 * np.exp(-1j * np.radians(30.0))
    assert_allclose(control.forcing[0].elevation[2], first, rtol=1e-15)
    assert_allclose(
        control.forcing[1].elevation[5], 0.25 * np.exp(-0.25j * np.pi / 180)
    )
    assert control.forcing[1].argument_deg == -30.0
    stations = control.elevation_stations
    assert stations.names == ("Ocean buoy", "Inner bay", "")
    assert_array_equal(stations.points, [[-72.5, 40.5], [-72.4, 40.6], [-72.3, 40.7]])
    assert control.global_elevation == GlobalOutput(4, 0.0, 5.0, 120)
    assert control.global_velocity.nout == -1
    assert control.harmonic[0] == HarmonicConstituent("STEADY", 0.0, 1.0, 0.0)
    assert control.solver == (1, 0, 1e-10, 25)
    assert control.netcdf_header is None
    assert control.namelists == ""


@pytest.mark.parametrize("with_mesh", [False, True])
@pytest.mark.parametrize("suffix", ["", ".gz"])
def test_written_is_read(tmp_path, path, mesh, with_mesh, suffix):
    mesh = mesh if with_mesh else None
    control = read_text(path, CONTROL, mesh)
    again = tmp_path / f"again.15{suffix}"
    write_fort15(again, control)
    first = again.read_bytes()
    read = read_fort15(again, mesh)
    assert_equal(read, control)
    write_fort15(again, read)
    assert again.read_bytes() == first


def test_names_stand_at_the_beginning_of_their_lines(path):
    """ADCIRC compares those of the tidal potential blank by blank with its fort.24."""
    write_fort15(path, read_text(path, CONTROL))
    lines = path.read_text().splitlines()
    assert lines[:2] == ["small bay", "two constituents"]
    named = [line[:5] for line in lines if line.endswith(("TAG", "ALPHA", "NAMEFR"))]
    assert named == ["M2   ", "M2   ", "K1   ", "M2   ", "K1   ", "STEAD", "M2   "]


def test_netcdf_lines_and_namelists_are_carried_through(path):
    header = [f"line {k}" for k in range(9)] + ["2020-04-28 00:00:00"]
    tail = "&WarnElevControl WarnElev=2.0,\n ErrorElev=5.0 /\n&metControl\n/"
    text = CONTROL.replace(" 4 0 5 120\n", " -5 0 5 120\n")
    text += "\n".join(header) + " ! base date\n" + tail + "\n"
    control = read_text(path, text)
    assert control.netcdf_header == tuple(header)
    assert control.namelists == tail
    assert control.namelist_names == ("warnelevcontrol", "metcontrol")
    write_fort15(path, control)
    assert_equal(read_fort15(path), control)
    assert path.read_text().endswith(tail + "\n")
    with pytest.raises(FormatError, match="needs 10 lines before the namelists"):
        read_text(path, text.replace("line 0\n", ""))


def test_rivers(path, mesh):
    types = ((22, 2), (32, 4))
    land = [s for s in mesh.boundaries if s.kind == "mainland"]
    strings = [s for s in mesh.boundaries if s.kind != "mainland"]
    strings += [replace(s, ibtype=t) for s, (t, _) in zip(land, types)]
    river = CoastalMesh(mesh.points, mesh.triangles, mesh.depth, strings)
    base = read_text(path, CONTROL, mesh)
    level = np.r_[np.full(5, np.nan), np.arange(1.0, 7.0) * 1j]
    flow = FluxConstituent("STEADY", 0.0, 1.0, 0.0, np.arange(11.0) * (1 + 1j), level)
    control = replace(base, nffr=1, flux=(flow,))
    write_fort15(path, control)
    assert_equal(read_fort15(path, river), control)
    # Without the mesh nobody knows how wide the rows are.
    with pytest.raises(FormatError):
        read_fort15(path)
    with pytest.raises(FormatError, match="NOUTE"):
        read_fort15(path, mesh)
    # All rows two numbers wide end at the four of NOUTE.
    narrow = replace(flow, elevation=np.full(11, np.nan))
    write_fort15(path, replace(control, flux=(narrow,)))
    assert_equal(read_fort15(path).flux[0], narrow)
    with pytest.raises(FormatError, match=r"river node 6 of 11 \(4 numbers\)"):
        read_fort15(path, river)
    write_fort15(path, base)
    with pytest.raises(FormatError, match=r"expected NFFR.*does not belong"):
        read_fort15(path, river)
    write_fort15(path, replace(base, nffr=-1))
    assert read_fort15(path, river).nffr == -1
    assert read_fort15(path).nffr == -1


def test_stations_in_a_file_of_their_own(path):
    base = read_text(path, CONTROL)
    control = replace(base, velocity_stations=StationOutput(1, 0.0, 5.0, 60, in_file=7))
    write_fort15(path, control)
    assert_equal(read_fort15(path), control)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (" 2 0.5 1 /", " 2 0.5 /", "expected 3 values on one line .DRAMP"),
        (" 0.35 0.3 0.35", " 0.35,,0.35", "expected 3 values on one line .A00"),
        (" 0.5\n 10\n", " 0.5\n soon\n", 'a number .RNDAY., got "soon"'),
        (" 9.81", " -9.81", "positive G"),
        (" 2.5D1", " 0", "time step DTDP other than 0"),
        (" 0.05 2*12 0.02", " 0 2*12 0.02", "positive least depth H0"),
        (" 0.05 2*12 0.02", " 0.05 12 1.5 0.02", "a whole number .H0"),
        (" 2                     NOLIBF", " 3", "expected NOLIBF 0, 1, 2, got 3"),
        (" 0\n 2\n 9.81", " 8\n 2\n 9.81", "NWS = 8 .wind.* is not supported"),
        (" 0\n 2     ", " 21\n 2     ", "IM = 21 .three dim.* is not supported"),
        (" 1\n M2\n", " -1\n M2\n", "NTIF.* not negative, got -1"),
        ("M2\n 0.242334 1.405189e-4", "M2\n 0.2 28.984", "rad/s, 0 to 0.01, got 28.9"),
        ("K1    ! BOUNTAG", "M2", "constituent M2 was given before"),
        ("rows of the second one", "M2", "rows of K1, got those of M2"),
        (" 1.0-4\n\n 1\n", " 1.0-4\n\n", 'whole number .NTIF.*, got "M2"'),
        ("0.2, 20.0\n", "", "belong to the mesh"),
        ("0.2, 20.0\n", "0.2\n", 'at open boundary node 2 of 9, got "0.2"'),
        ("0.2, 20.0\n", "0.2 20.0\n0.2 20.0\n", "10 rows for M2"),
        (" 90.0\n", "0.02 180\n 90.0\n", "10 rows for K1"),
        (" 1 0.0 5.0 60\n", " 4 0.0 5.0 60\n", "NOUTE 0, 1, 3, 5 or negative, got 4"),
        ("-72.3 40.7\n", "", "coordinates of station 3 of 3"),
        (" 5.0 10.0 1 0.0\n", " 5.0 10.0\n", "4 values on one line .THAS"),
        (" 1 0 1.E-10 25\n", "", "the file ends here; expected ITITER"),
    ],
)
def test_what_cannot_be_read_is_named_with_its_line(path, mesh, old, new, message):
    assert CONTROL.count(old) >= 1
    begin = CONTROL.index(old)
    text = CONTROL.replace(old, new, 1)
    with pytest.raises(FormatError, match=message) as caught:
        read_text(path, text, mesh)
    # Where the text was changed, or where its consequence is met.
    first = text[:begin].count("\n") + 1
    assert first - 1 <= caught.value.line <= first + 11
    assert caught.value.path == path


def test_potential_that_is_switched_off_but_listed(path):
    text = CONTROL.replace(" 1\n 1\n 0\n 2\n 9.81", " 1\n 0\n 0\n 2\n 9.81")
    with pytest.raises(FormatError, match="NTIF = 1 contradicts NTIP = 0"):
        read_text(path, text)


def test_missing_empty_and_broken_files(tmp_path):
    with pytest.raises(InputError, match="no such file"):
        read_fort15(tmp_path / "none")
    for name, content, message in (
        ("empty", b"", "the file ends here"),
        ("noise", bytes(range(256)) * 20, "expected"),
        ("cut.gz", gzip.compress(CONTROL.encode())[:200], "damaged"),
    ):
        (tmp_path / name).write_bytes(content)
        with pytest.raises(FormatError, match=message):
            read_fort15(tmp_path / name)


def test_a_line_too_few_or_too_many_is_noticed(path, mesh):
    lines = CONTROL.splitlines(keepends=True)
    quiet = []
    for k, line in enumerate(lines):
        for more, text in (
            (-1, lines[:k] + lines[k + 1 :]),
            (1, [*lines[:k], line, *lines[k:]]),
        ):
            try:
                read_text(path, "".join(text), mesh)
            except FormatError:
                continue
            quiet.append((more, line.strip()))
    # Without its first line the range of tau0 is a tau0, Fortran skips blank lines, and
    # what follows the last record is no concern of it.
    assert quiet == [(-1, "-5.0"), (-1, ""), (1, ""), (1, "1 0 1.E-10 25")]


def test_every_cut_is_noticed(path, mesh, caplog):
    rng = np.random.default_rng(5)
    last = CONTROL.rindex("25")
    for cut in rng.integers(0, last + 1, 150):
        with pytest.raises(FormatError) as caught:
            read_text(path, CONTROL[:cut], mesh)
        assert caught.value.line is not None
    # In the last number of all nobody can tell, but it is said.
    with caplog.at_level(logging.WARNING):
        read_text(path, CONTROL[: last + 1], mesh)
    assert "may be cut off" in caplog.text


def test_garbled_files_are_refused_or_read_but_nothing_else(path, mesh):
    rng = np.random.default_rng(6)
    content = CONTROL.encode()
    refused = []
    for _ in range(250):
        damaged = bytearray(content)
        for place in rng.integers(0, len(damaged), rng.integers(1, 5)):
            damaged[place] = rng.integers(0, 256)
        path.write_bytes(bytes(damaged))
        try:
            read_fort15(path, mesh if rng.random() < 0.5 else None)
        except FormatError as error:
            refused.append(error.line)
    assert len(refused) > 50
    assert None not in refused


def test_forcing_of_the_embedded_engines(path, mesh):
    control = read_text(path, CONTROL, mesh)
    forcing = fort15_forcing(control, mesh)
    assert forcing.names == ("M2", "K1")
    assert_array_equal(forcing.nodes, mesh.open_nodes)
    assert_array_equal(forcing.elevation, [c.elevation for c in control.forcing])
    assert_allclose(forcing.nodal_factor, [1.02, 0.9])
    assert_allclose(forcing.argument, np.radians([98.8, -30.0]))
    assert_array_equal(forcing.potential[1], 0.0)


def test_tidal_potential_is_the_sum_of_the_listed_cosines(path, mesh):
    """Values at times against the formula of the equilibrium tide, term by term."""
    rows = (
        PotentialConstituent("M2", 0.242334, 1.405189e-4, 0.693, 1.1, 40.0),
        PotentialConstituent("O1", 0.100514, 6.75977e-5, 0.695, 0.9, 70.0),
        PotentialConstituent("MF", 0.041742, 5.3234e-6, 0.693, 1.3, 10.0),
    )
    control = replace(read_text(path, CONTROL, mesh), potential=rows)
    forcing = fort15_forcing(control, mesh)
    assert forcing.names == ("M2", "K1", "O1", "MF")
    assert_array_equal(forcing.elevation[2:], 0.0)
    longitude, latitude = np.radians(mesh.projection.inverse(mesh.points)).T
    heights = (
        np.cos(latitude) ** 2,
        np.sin(2 * latitude),
        0.5 - 1.5 * np.sin(latitude) ** 2,
    )
    for time in (0.0, 4321.0, 1e5):
        wanted = sum(
            r.amplitude
            * r.earth_tide_factor
            * r.nodal_factor
            * height
            * np.cos(
                r.frequency * time + np.radians(r.argument_deg) + species * longitude
            )
            for r, height, species in zip(rows, heights, (2, 1, 0))
        )
        turned = np.exp(1j * (forcing.frequency * time + forcing.argument))
        have = ((forcing.nodal_factor * turned)[:, None] * forcing.potential).real.sum(
            0
        )
        assert_allclose(have, wanted, atol=1e-15)
    assert (
        fort15_forcing(replace(control, ntip=0, potential=()), mesh).potential is None
    )


def test_constituents_that_contradict_each_other(path, mesh):
    control = read_text(path, CONTROL, mesh)
    row = replace(control.potential[0], frequency=1.4e-4)
    with pytest.raises(
        InputError, match=r"M2 has the frequency.*in the tidal potential"
    ):
        fort15_forcing(replace(control, potential=(row,)), mesh)
    with pytest.raises(InputError, match="does not belong to the mesh"):
        fort15_forcing(control, replace(mesh, boundaries=mesh.boundaries[:2]))
    with pytest.raises(InputError, match="needs longitudes"):
        fort15_forcing(control, small_mesh())
    with pytest.raises(InputError, match="no periodic forcing"):
        fort15_forcing(replace(control, forcing=(), potential=()), mesh)


def test_what_the_embedded_engines_leave_out_is_said(path, mesh, caplog):
    control = read_text(path, CONTROL, mesh)
    tail = "&metControl /\n&densityControl densityRunType='none' /"
    fort15_forcing(replace(control, ntip=2, nffr=-1, namelists=tail), mesh)
    for what in ("self-attraction", "NFFR", "densitycontrol"):
        assert what in caplog.text
    assert "metcontrol" not in caplog.text


def test_decimals_come_back_as_they_were_given(path):
    rng = np.random.default_rng(4)
    rows = [f"{a:.8f} {g:.4f}" for a, g in rng.random((2000, 2)) * (3.0, 360.0)]
    head, tail = CONTROL.split(ROWS_M2)
    text = head.replace(" 2\n M2 pr", " 1\n M2 pr")
    text = text[: text.index(" K1 ")] + " M2\n" + "\n".join(rows) + "\n"
    text += tail[tail.index(" 90.0\n") :]
    write_fort15(path, read_text(path, text))
    lines = path.read_text().splitlines()
    first = next(k for k, line in enumerate(lines) if line.endswith("ALPHA")) + 1
    for line, row in zip(lines[first : first + len(rows)], rows, strict=True):
        assert [float(word) for word in line.split()] == [
            float(word) for word in row.split()
        ]


def test_node_of_two_strings(mesh, caplog):
    """ADCIRC adds the rows of such a node (seen in a run of it)."""
    strings = (BoundaryString("open", [0, 1, 2]), BoundaryString("open", [2, 3, 4]))
    shared = replace(mesh, boundaries=strings)
    value = np.arange(1, 6) * np.exp(0.3j)
    rows = boundary_rows(shared, value)
    assert_allclose(np.abs(rows), [1, 2, 3, 0, 4, 5])

    def forcing(elevation):
        row = BoundaryConstituent("M2", 1.4e-4, 1.0, 0.0, elevation)
        return fort15_forcing(
            ControlFile(time_step=1.0, run_days=1.0, forcing=(row,)), shared
        ).elevation[0]

    assert_allclose(forcing(rows), value)
    assert not caplog.records
    assert_allclose(forcing(np.ones(6)), [1, 1, 2, 1, 1])
    assert "node 3 is listed twice" in caplog.text


def test_a_ring_of_open_nodes_may_repeat_its_first(path, mesh):
    ring = replace(mesh, boundaries=(BoundaryString("open", [7, 8, 13, 12], True),))
    base = ControlFile(time_step=1.0, run_days=1.0)
    for count in (4, 5):
        row = BoundaryConstituent("M2", 1.4e-4, 1.0, 0.0, np.arange(count) + 0j)
        write_fort15(path, replace(base, forcing=(row,)))
        forcing = fort15_forcing(read_fort15(path, ring), ring)
        assert_allclose(forcing.elevation[0], [0 if count == 4 else 4, 1, 2, 3])
    row = replace(row, elevation=np.ones(6))
    write_fort15(path, replace(base, forcing=(row,)))
    with pytest.raises(FormatError, match="does not belong to the mesh"):
        read_fort15(path, ring)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"nramp": 2}, r"ramp_days must have 3 value\(s\) with nramp = 2, got 1"),
        ({"nolifa": 2}, "wet_dry with nolifa = 2 is missing"),
        ({"nolibf": 2}, "hybrid with nolibf = 2 is missing"),
        ({"tau0": -5.0}, "tau0_range .* is missing"),
        ({"harmonic_output": (0, 0, 5, 5)}, "netcdf_header .* is missing"),
        ({"netcdf_header": ("one",)}, "netcdf_header must have 10 lines, got 1"),
        ({"nffr": 1}, r"flux must have 1 constituent\(s\)"),
    ],
)
def test_a_control_file_that_adcirc_could_not_read_is_not_made(change, message):
    with pytest.raises(ValueError, match=message):
        ControlFile(time_step=1.0, run_days=1.0, **change)


def test_the_kept_adcirc_runs(tmp_path, monkeypatch):
    """Against the settings and rows kept beside them."""
    monkeypatch.syspath_prepend(Path(__file__).parents[1] / "tides")
    cases = pytest.importorskip("adcirc_cases")
    names = ("qa_r1_cor", "qa_ts_nl", "sh_lin", "sh_qf", "sh_lin_ics22")
    if not cases.FOLDER.is_dir():
        pytest.skip("the reference runs of ADCIRC are not there")
    for name in names:
        case = cases.load(name)
        control = read_fort15(cases.FOLDER / name / "fort.15.gz", case.mesh)
        forcing = fort15_forcing(control, case.mesh)
        assert_allclose(forcing.elevation, case.forcing.elevation, rtol=1e-15)
        assert_allclose(forcing.frequency, case.settings["omega"])
        assert control.ics == case.settings["ics"]
        assert control.time_step == case.settings["dt"]
        assert control.friction == case.settings["friction"]
        assert control.minimum_depth == case.settings["h0"]
        write_fort15(tmp_path / "fort.15", control)
        assert_equal(read_fort15(tmp_path / "fort.15", case.mesh), control)
