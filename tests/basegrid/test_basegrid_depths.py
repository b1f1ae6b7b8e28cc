"""Depths: planes and quadratics known in closed form, and every refusal."""

import math

import numpy as np
import pytest
import rasterio
from basegrid_shapes import disc
from rasterio.transform import from_origin

from tidemesh.basegrid import (
    BaseGridSettings,
    DepthSettings,
    DepthSource,
    build_base_grid,
    read_sources,
    sample_depths,
)
from tidemesh.basegrid.base_grid import node_spacing
from tidemesh.basegrid.raster_sampling import WeightedRaster
from tidemesh.basegrid.scattered import interpolate_scattered
from tidemesh.datatypes import Raster, Soundings
from tidemesh.errors import InputError
from tidemesh.geometry.projection import Projection
from tidemesh.geometry.systems import from_degrees, to_degrees
from tidemesh.io.dem import read_raster
from tidemesh.triangulation.topology import check_mesh

PLANE = Projection()
CAROLINA = Projection.stereographic(-79.4, 33.0)


def grid(elevation, *, half=20_000.0, cell=1_000.0, crs="", name="grid", centre=(0, 0)):
    x = np.arange(-half, half + 1.0, cell) + centre[0]
    y = np.arange(-half, half + 1.0, cell) + centre[1]
    return Raster(x, y, elevation(*np.meshgrid(x, y)), crs, name)


def slope(x, y):
    return -50.0 + 1e-3 * x - 5e-4 * y


def somewhere(n=400, half=19_000.0, seed=1):
    return np.random.default_rng(seed).uniform(-half, half, (n, 2))


def test_plane_is_reproduced_exactly():
    points = somewhere()
    depth, report = sample_depths(points, PLANE, [grid(slope)])
    assert np.allclose(depth, -slope(*points.T), rtol=0, atol=1e-11)
    assert report.from_source == (("grid", 400),)
    assert (report.filled, report.raised, report.averaged) == (0, 0, 0)


@pytest.mark.parametrize("spacing", [1_500.0, 4_000.0, 7_777.0])
def test_mean_of_a_plane_is_the_plane(spacing):
    points = somewhere(half=15_000.0)
    depth, report = sample_depths(
        points, PLANE, [grid(slope)], spacing=np.full(400, spacing)
    )
    assert report.averaged == 400
    assert np.allclose(depth, -slope(*points.T), rtol=0, atol=1e-9)


def test_mean_of_a_quadratic():
    # The mean of x² over a square of side a about x0 is x0² + a²/12; linear pieces of
    # length c between its nodes add c²/6 on average.
    def bowl(x, y):
        return -100.0 + 1e-7 * (x * x + 2.0 * y * y)

    points = somewhere(half=12_000.0)
    spacing = 6_000.0
    side = spacing * math.sqrt(math.sqrt(3.0) / 2.0)
    exact = bowl(*points.T) + 3e-7 * side**2 / 12.0
    for cell in (1_000.0, 500.0):
        depth, _ = sample_depths(
            points, PLANE, [grid(bowl, cell=cell)], spacing=np.full(400, spacing)
        )
        assert np.abs(-depth - exact).max() < 3e-7 * cell**2 / 4.0
        assert (-depth - exact).mean() == pytest.approx(3e-7 * cell**2 / 6.0, rel=0.05)


def test_averaging_keeps_the_volume():
    # Boxes side by side cover the raster once: their means times area add up to its
    # integral, whatever the bed.
    rng = np.random.default_rng(5)
    x = np.arange(13.0)
    cells = rng.uniform(-9.0, -1.0, (13, 13))
    raster = WeightedRaster(x, x, cells, np.ones((13, 13)))
    centres = np.stack(np.meshgrid([2.0, 6.0, 10.0], [2.0, 6.0, 10.0]), -1)
    means = raster.box_mean(centres.reshape(-1, 2), np.full((9, 2), 2.0))
    edges = np.ones(13)
    edges[[0, -1]] = 0.5
    assert means.sum() * 16.0 == pytest.approx(edges @ cells @ edges)


def test_small_boxes_tend_to_the_value_at_the_place():
    rng = np.random.default_rng(6)
    x, y = np.cumsum(rng.uniform(0.5, 2.0, 9)), np.cumsum(rng.uniform(0.5, 2.0, 7))
    weights = (rng.random((7, 9)) > 0.3) * 1.0
    raster = WeightedRaster(x, y, rng.uniform(-9.0, -1.0, (7, 9)) * weights, weights)
    points = rng.uniform([x[0], y[0]], [x[-1], y[-1]], (300, 2))
    at_place = raster.bilinear(points)
    small = raster.box_mean(points, np.full((300, 2), 1e-3))
    clear = np.isfinite(at_place) & np.isfinite(small)
    # Beside cells that do not count the surface is steep.
    assert np.median(np.abs(at_place - small)[clear]) < 1e-3
    assert clear.sum() > 250


def test_land_does_not_bleed_into_the_water():
    def cliff(x, y):
        return np.where(x < 500.0, -10.0, 200.0)

    x = np.linspace(-1_000.0, 900.0, 39)
    points = np.stack([x, np.zeros_like(x)], axis=1)
    for spacing in (None, np.full(39, 3_000.0)):
        dropped, _ = sample_depths(points, PLANE, [grid(cliff)], spacing=spacing)
        assert np.allclose(dropped, 10.0)
    used, report = sample_depths(
        points, PLANE, [grid(cliff)], DepthSettings(land="use")
    )
    assert used.min() == 1.5
    assert report.raised > 0
    shallow, _ = sample_depths(
        points, PLANE, [grid(cliff)], DepthSettings(land="minimum")
    )
    assert shallow.min() == pytest.approx(1.5 * 0.9 + 10.0 * 0.1)


def test_minimum_depth_is_kept_and_counted():
    points = somewhere()
    settings = DepthSettings(minimum_m=50.0)
    depth, report = sample_depths(points, PLANE, [grid(slope)], settings)
    assert np.allclose(depth, np.maximum(-slope(*points.T), 50.0))
    assert report.raised == (slope(*points.T) > -50.0).sum()
    assert report.shallowest_m == 50.0


def test_first_source_decides_where_it_knows():
    fine = grid(lambda x, y: 0 * x - 7.0, half=5_000.0, cell=500.0, name="fine")
    with_gap = fine.elevation.copy()
    with_gap[8:13, 8:13] = np.nan
    fine = Raster(fine.x, fine.y, with_gap, "", "fine")
    coarse = grid(lambda x, y: 0 * x - 30.0, name="coarse")
    points = np.array([[3e3, 3e3], [0.0, 0.0], [9e3, 0.0]])
    depth, report = sample_depths(points, PLANE, [fine, coarse])
    assert depth.tolist() == [7.0, 30.0, 30.0]
    assert report.from_source == (("fine", 1), ("coarse", 2))
    depth, _ = sample_depths(points, PLANE, [coarse, fine])
    assert depth.tolist() == [30.0, 30.0, 30.0]


def test_utm_geotiff_and_degrees_agree(tmp_path):
    def bed(lonlat):
        return -40.0 + 10.0 * (lonlat[..., 0] + 79.4) - 8.0 * (lonlat[..., 1] - 33.0)

    lon, lat = np.arange(-79.8, -78.99, 0.01), np.arange(32.6, 33.41, 0.01)
    degrees = Raster(
        lon, lat, bed(np.stack(np.meshgrid(lon, lat), -1)), "EPSG:4326", "degrees"
    )
    corners = from_degrees("EPSG:32617", [-79.8, -79.0], [32.6, 33.4])
    x = np.arange(corners[0, 0] - 5e3, corners[1, 0] + 5e3, 500.0)
    y = np.arange(corners[0, 1] - 5e3, corners[1, 1] + 5e3, 500.0)[::-1]
    flat = np.stack(np.meshgrid(x, y), -1).reshape(-1, 2)
    values = bed(to_degrees("EPSG:32617", flat)).reshape(len(y), len(x))
    path = tmp_path / "utm.tif"
    with rasterio.open(
        path,
        "w",
        driver="GTiff",
        width=len(x),
        height=len(y),
        count=1,
        dtype="float64",
        crs="EPSG:32617",
        transform=from_origin(x[0] - 250.0, y[0] + 250.0, 500.0, 500.0),
    ) as file:
        file.write(values, 1)
    utm = read_raster(path, box_deg=(-79.7, 32.7, -79.1, 33.3))
    points = somewhere(half=25_000.0)
    exact = -bed(CAROLINA.inverse(points))
    for spacing in (None, np.full(400, 3_000.0)):
        for raster in (degrees, utm):
            depth, _ = sample_depths(points, CAROLINA, [raster], spacing=spacing)
            # The plane in degrees is curved in metres by less than a millimetre.
            assert np.allclose(depth, exact, atol=2e-3)


def test_longitudes_of_any_turn():
    lon, lat = np.arange(279.0, 282.0, 0.1), np.arange(32.0, 34.0, 0.1)
    raster = Raster(lon, lat, -lon[None, :] + 0 * lat[:, None], "EPSG:4326", "turned")
    depth, _ = sample_depths(np.zeros((1, 2)), CAROLINA, [raster])
    assert depth == pytest.approx([360.0 - 79.4])


def test_soundings_of_a_plane():
    at = somewhere(3_000, half=20_000.0, seed=2)
    soundings = Soundings(at, slope(*at.T), "", "survey")
    points = somewhere(half=17_000.0)
    depth, report = sample_depths(points, PLANE, [soundings])
    assert np.allclose(depth, -slope(*points.T), atol=1e-9)
    assert report.from_source == (("survey", 400),)
    # Outside the hull the nearest one serves, but only near by.
    depth, report = sample_depths(np.array([[20_500.0, 0.0]]), PLANE, [soundings])
    assert report.filled == 1
    assert depth[0] == pytest.approx(-slope(2e4, 0.0), abs=1.0)


def test_few_soundings_serve_as_nearest_water():
    soundings = Soundings([[0.0, 0.0], [500.0, 0.0]], [-4.0, -8.0], "", "two")
    depth, report = sample_depths(
        np.array([[100.0, 0.0], [450.0, 10.0]]), PLANE, [soundings]
    )
    assert depth.tolist() == [4.0, 8.0]
    assert report.filled == 2


def test_harbour_that_the_raster_shows_as_land_takes_the_nearest_water():
    def coast(x, y):
        return np.where(x < 0.0, slope(x, y), 3.0)

    points = np.concatenate([somewhere() * [0.4, 1.0] - [9e3, 0.0], [[4_000.0, 0.0]]])
    depth, report = sample_depths(points, PLANE, [grid(coast)])
    assert depth[-1] == pytest.approx(-slope(-1_000.0, 0.0))
    assert report.filled == 1
    assert report.farthest_fill_m == pytest.approx(5_000.0)
    assert report.filled_deg == ((4_000.0, 0.0),)
    with pytest.raises(InputError, match=r"1 nodes are land.*5\.0 km.*max_fill_km"):
        sample_depths(points, PLANE, [grid(coast)], DepthSettings(max_fill_km=4.0))
    with pytest.raises(InputError, match=r"1 nodes have no depth.*4000\.0"):
        sample_depths(points, PLANE, [grid(coast)], DepthSettings(fill="error"))


def test_hole_over_water_is_refused():
    raster = grid(slope)
    holed = raster.elevation.copy()
    holed[10:24, 10:24] = np.nan
    holed = Raster(raster.x, raster.y, holed, "", "holed")
    points = somewhere()
    with pytest.raises(InputError, match=r"\d+ nodes lie in a hole.*max_hole_km"):
        sample_depths(points, PLANE, [holed])
    depth, _ = sample_depths(points, PLANE, [holed, raster])
    # Beside the hole the cells at hand decide: up to one cell times the slope.
    assert np.allclose(depth, -slope(*points.T), atol=1.5)
    depth, report = sample_depths(
        points, PLANE, [holed], DepthSettings(max_hole_km=20.0)
    )
    assert np.isfinite(depth).all()
    assert report.filled > 0


def test_refused_sources():
    points = somewhere()
    with pytest.raises(InputError, match="no source of depths"):
        sample_depths(points, PLANE, [])
    with pytest.raises(InputError, match="grid: has no coordinate system"):
        sample_depths(points, CAROLINA, [grid(slope)])
    with pytest.raises(InputError, match='set crs = "plane"'):
        sample_depths(points, PLANE, [grid(slope, crs="EPSG:32617")])
    away = grid(slope, centre=(1e5, 0.0))
    with pytest.raises(InputError, match=r"does not overlap.*80000 to 120000"):
        sample_depths(points, PLANE, [away])
    flipped = grid(lambda x, y: -slope(x, y))
    with pytest.raises(InputError, match=r'100% of the nodes.*set positive to "down"'):
        sample_depths(points, PLANE, [flipped])
    at = somewhere(seed=3)
    with pytest.raises(InputError, match='come out as land; set positive to "down"'):
        sample_depths(points, PLANE, [Soundings(at, -slope(*at.T), "", "survey")])
    with pytest.raises(InputError, match="no sounding lies in or near"):
        sample_depths(points, PLANE, [Soundings(at + 1e6, slope(*at.T), "", "survey")])


@pytest.mark.parametrize("fill", [-32768.0, 1e20, -9999.0, -999.0])
def test_fill_values_left_in_are_refused(fill):
    raster = grid(slope)
    elevation = raster.elevation.copy()
    elevation[2, 3:15] = fill
    broken = Raster(raster.x, raster.y, elevation, "", "broken")
    with pytest.raises(InputError, match=r"broken: 12 values.*-17000\.0.*fill_value"):
        sample_depths(somewhere(), PLANE, [broken])


def test_base_grid_of_a_disc():
    domain = disc(15_000.0, 1_000.0, island_radius=3_000.0)
    progress = []
    mesh, report = build_base_grid(
        domain,
        [grid(slope)],
        BaseGridSettings(spacing_m=1_000.0),
        progress=progress.append,
    )
    assert check_mesh(mesh.points, mesh.triangles, mesh.depth, mesh.boundaries) == []
    assert [b.kind for b in mesh.boundaries] == ["mainland", "island"]
    assert report.nodes == len(mesh.points)
    assert np.allclose(mesh.depth, -slope(*mesh.points.T), atol=0.1)
    assert progress[-1] == 1.0
    assert progress == sorted(progress)
    spacing = node_spacing(mesh.points, mesh.triangles)
    assert np.median(spacing) == pytest.approx(1_000.0)


def test_sources_named_in_settings(tmp_path):
    (tmp_path / "s.csv").write_text(
        "lon,lat,depth\n"
        + "".join(
            f"{lon:.3f},{lat:.3f},{20 + lon + 79.4:.4f}\n"
            for lon in np.arange(-79.8, -78.9, 0.05)
            for lat in np.arange(32.6, 33.45, 0.05)
        )
    )
    domain = disc(20_000.0, 2_000.0, projection=CAROLINA)
    settings = DepthSettings(sources=(DepthSource(path="s.csv"),))
    (survey,) = read_sources(domain, settings, folder=tmp_path)
    mesh, _ = build_base_grid(
        domain, [survey], BaseGridSettings(spacing_m=2_000.0), settings
    )
    lon = CAROLINA.inverse(mesh.points)[:, 0]
    assert np.allclose(mesh.depth, 20.0 + lon + 79.4, atol=1e-3)
    gone = DepthSettings(sources=(DepthSource(path="gone.nc"),))
    with pytest.raises(InputError, match=r"gone\.nc: no such file"):
        read_sources(domain, gone, folder=tmp_path)


def test_shipped_bathymetry_is_water_where_the_sea_is(examples):
    raster = read_raster(examples / "south_carolina" / "data" / "bathymetry.nc")
    assert raster.crs
    offshore = np.array([[-79.0, 32.5], [-78.0, 33.0], [-79.5, 31.8]])
    depth, _ = sample_depths(CAROLINA.forward(*offshore.T), CAROLINA, [raster])
    assert ((depth > 15.0) & (depth < 400.0)).all()
    inland = np.array([[-81.0, 34.5]])
    with pytest.raises(InputError):
        sample_depths(CAROLINA.forward(*inland.T), CAROLINA, [raster])


def test_soundings_at_one_place_count_with_their_mean():
    at = np.array([[0, 0], [4, 0], [4, 4], [0, 4], [4, 4], [2, 0]], dtype=float)
    values = np.array([-2.0, -2.0, -2.0, -2.0, -4.0, -2.0])
    points = np.array([[4.0, 4.0], [1.0, 1.0], [3.0, 2.0], [9.0, 9.0]])
    found = interpolate_scattered(at, values, points)
    assert found[0] == -3.0
    assert found[1] <= -2.0
    assert np.isnan(found[3])
    line = np.array([[0.0, 0.0], [1.0, 1.0], [2.0, 2.0]])
    assert np.isnan(interpolate_scattered(line, values[:3], points)).all()


def volume(points, triangles, depth):
    a, b, c = (points[triangles[:, k]] for k in range(3))
    one, other = (b - a).T, (c - a).T
    area = 0.5 * (one[0] * other[1] - one[1] * other[0])
    return float((area * depth[triangles].mean(axis=1)).sum())


def coarse_square(half, side):
    axis = np.arange(-half, half + 1.0, side)
    points = np.stack(np.meshgrid(axis, axis), axis=-1).reshape(-1, 2)
    n = len(axis)
    corner = (np.arange(n - 1)[:, None] * n + np.arange(n - 1)).ravel()
    lower = np.stack([corner, corner + 1, corner + n + 1], axis=1)
    upper = np.stack([corner, corner + n + 1, corner + n], axis=1)
    return points, np.concatenate([lower, upper])


@pytest.mark.parametrize("spacing", [None, 4_000.0])
def test_volume_over_a_quadratic_bed_is_conserved(spacing):
    # The integral of r² over a square of side 2 a is 8/3 a⁴. Linear depths between
    # nodes on the bed hold 1/64 of their error at the middles of 64 parts.
    points, triangles = coarse_square(16_000.0, 4_000.0)
    raster = grid(lambda x, y: -(300.0 - 6e-3 * x - 1e-7 * (x * x + y * y)), cell=250.0)
    exact = 1200.0 * 16_000.0**2 - 8e-7 / 3.0 * 16_000.0**4
    found = {}
    for conserve in (True, False):
        depth, report = sample_depths(
            points,
            PLANE,
            [raster],
            DepthSettings(conserve_volume=conserve),
            spacing=None if spacing is None else np.full(len(points), spacing),
            triangles=triangles,
        )
        found[conserve] = abs(volume(points, triangles, depth) / exact - 1.0)
        assert (report.corrected > 0) == conserve
    assert found[False] > 1e-3
    assert found[True] < found[False] / 30.0


def test_volume_leaves_a_plane_and_fine_meshes_alone():
    points, triangles = coarse_square(16_000.0, 4_000.0)
    depth, _ = sample_depths(points, PLANE, [grid(slope)], triangles=triangles)
    assert np.allclose(depth, -slope(*points.T), rtol=0, atol=1e-9)
    points, triangles = coarse_square(4_000.0, 500.0)
    _, report = sample_depths(points, PLANE, [grid(slope)], triangles=triangles)
    assert report.corrected == 0


def test_corrected_depths_stay_within_those_around():
    # A cliff: the correction would put the shallow side above the water.
    points, triangles = coarse_square(16_000.0, 4_000.0)
    raster = grid(lambda x, y: np.where(x < 1_000.0, -5.0, -800.0), cell=250.0)
    depth, _ = sample_depths(points, PLANE, [raster], triangles=triangles)
    assert depth.min() == pytest.approx(5.0)
    assert depth.max() == pytest.approx(800.0)
