"""What the figures show on tiny meshes, and that their files do not vary."""

from dataclasses import replace
from functools import partial

import matplotlib
import numpy as np
import pytest
import shapely
from matplotlib.collections import LineCollection, PathCollection
from matplotlib.figure import Figure
from scipy.spatial import Delaunay

from tidemesh import plots
from tidemesh.datatypes import (
    LAND,
    OCEAN,
    BoundaryString,
    CoastalMesh,
    Domain,
    LedgerEntry,
    Ring,
    SizeField,
    TideSolution,
)
from tidemesh.errors import InputError
from tidemesh.geometry.projection import Projection
from tidemesh.plots.domain import depth_levels
from tidemesh.plots.error import colour_limits
from tidemesh.plots.maps import latitude_label, longitude_label, round_steps
from tidemesh.plots.tide import greenwich_phase, phase_levels

PLACE = Projection.stereographic(-80.0, 33.0)


def square_mesh(projection=PLACE, n=12, step=2000.0):
    x, y = np.meshgrid(np.arange(n) * step, np.arange(n) * step)
    points = np.stack([x.ravel(), y.ravel()], axis=1)
    triangles = Delaunay(points + 0.01 * points[:, ::-1]).simplices
    index = np.arange(n * n).reshape(n, n)
    south = index[0]
    land = np.concatenate([index[:, -1], index[-1, -2::-1], index[-2::-1, 0]])
    strings = (BoundaryString("open", south), BoundaryString("mainland", land))
    depth = 2.0 + 30.0 * (1.0 - points[:, 1] / points[:, 1].max())
    return CoastalMesh(points, triangles, depth, strings, projection)


def tide_on(mesh, phase_deg, amplitude=1.0):
    elevation = amplitude * np.exp(-1j * np.radians(phase_deg))
    n = len(mesh.points)
    return TideSolution(
        ("M2",), [1.4e-4], elevation[None], np.zeros((1, n, 2)), np.full(n, 4e-4)
    )


def square_domain():
    corners = np.array([[0, 0], [2e4, 0], [2e4, 2e4], [0, 2e4]], dtype=float)
    domain = Domain(
        (Ring(corners, [OCEAN, LAND, LAND, LAND]),),
        PLACE,
        (
            LedgerEntry("narrow water removed", -79.895, 33.19, -2e6, "narrow"),
            LedgerEntry("separate water left out", -79.5, 33.5, -9e9, "apart"),
            LedgerEntry("island dropped", -79.9, 33.1, 1e5, "small"),
        ),
    )
    hull = shapely.Polygon(PLACE.inverse(corners))
    creek = shapely.box(-79.9, 33.1, -79.89, 33.2)
    land = shapely.box(-81, 32.99, -79, 34).difference(hull).difference(creek)
    return land, domain


def drawings():
    mesh = square_mesh()
    land, domain = square_domain()
    sizes = SizeField(mesh.points, mesh.triangles, 500.0 + mesh.points[:, 1])
    error = 1e-8 * (1.0 + mesh.points[:, 0])
    error[:15] = np.nan
    return {
        "depth": partial(plots.depth_contours, mesh),
        "boundary": partial(plots.boundary_before_after, land, domain),
        "sizes": partial(plots.size_map, sizes, mesh=mesh),
        "mesh": partial(plots.mesh_map, mesh),
        "tide": partial(
            plots.cotidal_chart, mesh, tide_on(mesh, mesh.points[:, 0] / 1e3)
        ),
        "error": partial(plots.error_before_after, mesh, error, mesh, error / 3),
        "quality": partial(plots.quality_histogram, mesh),
        "strings": partial(plots.boundary_strings, mesh),
    }


@pytest.mark.parametrize("name", drawings())
def test_takes_and_returns_the_axis(name):
    axis = Figure().subplots()
    assert drawings()[name](axis=axis) is axis
    assert axis.get_title()
    assert axis.get_xlabel()


@pytest.mark.parametrize("name", ["mesh", "tide"])
def test_files_are_identical(name, tmp_path):
    first, second = (
        plots.save_figure(tmp_path / f"{k}.png", drawings()[name], dpi=50)
        for k in range(2)
    )
    assert first.read_bytes() == second.read_bytes()
    assert b"Software" not in first.read_bytes()


def test_user_style_has_no_say(tmp_path):
    draw = drawings()["quality"]
    first = plots.save_figure(tmp_path / "a.png", draw, dpi=50)
    with matplotlib.rc_context({"font.size": 30, "axes.facecolor": "red"}):
        second = plots.save_figure(tmp_path / "b.png", draw, dpi=50)
        assert matplotlib.rcParams["font.size"] == 30
    assert first.read_bytes() == second.read_bytes()


@pytest.mark.parametrize("ending", ["svg", "pdf"])
def test_vector_files_are_identical(ending, tmp_path):
    first, second = (
        plots.save_figure(tmp_path / f"{k}.{ending}", drawings()["strings"])
        for k in range(2)
    )
    assert first.read_bytes() == second.read_bytes()


def test_missing_folder_is_named(tmp_path):
    with pytest.raises(InputError, match="nowhere"):
        plots.save_figure(tmp_path / "nowhere" / "a.png", drawings()["quality"])


def test_degrees_on_the_earth_and_km_on_the_plane():
    axis = plots.depth_contours(square_mesh())
    assert (axis.get_xlabel(), axis.get_ylabel()) == ("longitude", "latitude")
    assert axis.get_aspect() == pytest.approx(1 / np.cos(np.radians(33.1)), rel=1e-3)
    assert -80.1 < axis.get_xlim()[0] < -80.0
    axis = plots.depth_contours(square_mesh(Projection()))
    assert (axis.get_xlabel(), axis.get_ylabel()) == ("x (km)", "y (km)")
    assert axis.get_aspect() == 1.0
    assert 22.0 < axis.get_xlim()[1] < 23.0


def test_degree_labels():
    assert longitude_label(-79.5) == "79.5°W"
    assert longitude_label(0.1 + 0.2) == "0.3°E"
    assert longitude_label(181.0) == "179°W"
    assert longitude_label(-182.5) == "177.5°E"
    assert latitude_label(-33.0) == "33°S"
    assert latitude_label(0.0) == "0°"


def test_mesh_map_has_two_panels_and_all_edges():
    mesh = square_mesh()
    axis = plots.mesh_map(mesh)
    assert len(axis.figure.axes) == 3
    assert [a.get_title(loc="left") for a in axis.figure.axes[1:]] == ["a", "b"]
    n_edges = 12 * 11 * 2 + 11 * 11
    drawn = axis.lines[0].get_xdata()
    assert np.isnan(drawn).sum() == n_edges
    assert f"{len(mesh.points)} nodes" in axis.get_title()


def test_outline_parts_land_from_sea():
    axis = plots.size_map(
        SizeField(*(mesh := square_mesh()).points[None], mesh.triangles, mesh.depth),
        mesh=mesh,
    )
    lines = [c for c in axis.collections if isinstance(c, LineCollection)]
    assert [len(c.get_segments()) for c in lines] == [33, 11]


def test_outline_of_open_sea_all_round():
    mesh = square_mesh()
    ring = np.concatenate([s.nodes[:-1] for s in mesh.boundaries])
    strings = (BoundaryString("open", ring, closed=True),)
    axis = plots.depth_contours(replace(mesh, boundaries=strings))
    lines = [c for c in axis.collections if isinstance(c, LineCollection)]
    assert [len(c.get_segments()) for c in lines] == [0, 44]


def test_strings_are_numbered_by_group():
    mesh = square_mesh()
    axis = plots.boundary_strings(mesh)
    assert [text.get_text() for text in axis.texts] == ["O1", "L1"]
    labels = [text.get_text() for text in axis.get_legend().get_texts()]
    assert labels == ["open sea: 1", "mainland: 1"]


def test_boundary_shows_the_water_removed():
    land, domain = square_domain()
    axis = plots.boundary_before_after(land, domain)
    fills = [c for c in axis.collections if isinstance(c, PathCollection)]
    removed = fills[1].get_paths()
    assert len(removed) == 1
    shown = shapely.Polygon(removed[0].vertices)
    assert shown.area == pytest.approx(0.01 * (33.2 - 33.18024), rel=1e-3)
    assert shown.centroid.x == pytest.approx(-79.895, abs=1e-4)
    # The panel is centred on the water removed, not on the island, nor on water that
    # was never part of the domain.
    panel = axis.figure.axes[1]
    assert np.mean(panel.get_xlim()) == pytest.approx(-79.895)


def test_phase_of_a_lag():
    np.testing.assert_allclose(
        greenwich_phase(np.exp(-1j * np.radians([10, 350]))), [10, 350]
    )


@pytest.mark.parametrize(
    ("low", "high", "step", "levels"),
    [
        (12.0, 47.0, 5.0, [15, 20, 25, 30, 35, 40, 45]),
        (350.5, 362.5, 1.0, [0, 1, 2, *range(351, 360)]),
        (300.0, 420.0, 10.0, [0, 10, 20, 30, 40, 50, 60, *range(300, 360, 10)]),
    ],
)
def test_phase_levels_across_360(low, high, step, levels):
    elevation = np.exp(-1j * np.radians(np.linspace(low, high, 500)))
    got_step, got = phase_levels(elevation)
    assert got_step == step
    np.testing.assert_allclose(got, levels)


def test_phase_lines_do_not_jump_at_360():
    # The phase grows from 345 to 367 degrees eastwards: straight lines, one each, at
    # the longitudes known from the phase.
    mesh = square_mesh(Projection())
    x = mesh.points[:, 0]
    axis = plots.cotidal_chart(mesh, tide_on(mesh, 345.0 + x / 1e3))
    lines = {text.get_text(): float(text.get_position()[0]) for text in axis.texts}
    assert sorted(lines) == sorted(
        f"{g}°" for g in (346, 348, 350, 352, 354, 356, 358, 0, 2, 4, 6)
    )
    for label, place in lines.items():
        expected = (float(label.rstrip("°")) - 345.0) % 360.0
        assert place == pytest.approx(expected, abs=0.2)


def test_amphidrome_has_all_phases():
    mesh = square_mesh(Projection())
    x, y = (mesh.points - mesh.points.mean(axis=0)).T + 7.0
    tide = tide_on(mesh, np.degrees(np.arctan2(y, x)), np.hypot(x, y))
    step, levels = phase_levels(tide.elevation[0])
    assert step == 30.0
    assert len(levels) == 12
    plots.cotidal_chart(mesh, tide)


def test_unknown_constituent():
    mesh = square_mesh()
    with pytest.raises(ValueError, match='no constituent "S2" among M2'):
        plots.cotidal_chart(mesh, tide_on(mesh, mesh.points[:, 0]), "S2")


def test_error_panels_share_their_colours_and_leave_unknown_blank():
    mesh = square_mesh()
    error = np.geomspace(1e-9, 1e-6, len(mesh.points))
    unknown = error.copy()
    unknown[:30] = np.nan
    axis = plots.error_before_after(mesh, error, mesh, unknown)
    second = axis.figure.axes[1]
    first_shades, second_shades = axis.collections[0], second.collections[0]
    assert first_shades.norm.vmin == second_shades.norm.vmin
    assert first_shades.norm.vmax == second_shades.norm.vmax
    shown = second_shades._triangulation.get_masked_triangles()
    assert shown.min() >= 30


def test_colour_limits_without_anything_known():
    assert colour_limits(np.full(3, np.nan)) == (0.1, 1.0)


def test_quality_of_equilateral_triangles():
    points = np.array([[0, 0], [1, 0], [0.5, 3**0.5 / 2], [1.5, 3**0.5 / 2]]) * 1e3
    mesh = CoastalMesh(points, [[0, 1, 2], [1, 3, 2]], np.ones(4))
    axis = plots.quality_histogram(mesh)
    labels = [text.get_text() for text in axis.get_legend().get_texts()]
    assert labels == ["mean 1.000", "least 1.000"]
    assert sum(patch.get_height() for patch in axis.patches) == 2


def test_round_steps():
    np.testing.assert_allclose(round_steps(1.5, 40.0), [1, 2, 5, 10, 20, 50])
    np.testing.assert_allclose(round_steps(0.2, 1.0), [0.2, 0.5, 1.0])


@pytest.mark.parametrize(
    "depth", [[1.5, 600.0], [10.0, 10.0], [-3.0, 20.0], [90.0, 99.0]]
)
def test_depth_levels_hold_every_depth(depth):
    levels = depth_levels(np.array(depth))
    assert (np.diff(levels) > 0).all()
    assert levels[0] <= min(depth)
    assert max(depth) <= levels[-1]
    assert len(levels) >= 4
