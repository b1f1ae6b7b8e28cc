import json

import numpy as np
import pyogrio
import pyproj
import pytest
import shapely

from tidemesh.errors import FormatError, InputError
from tidemesh.io.shoreline import read_polygon, read_shoreline

BOX = (-80.0, 32.0, -79.0, 33.0)
MAINLAND = shapely.Polygon(
    [(-81, 34), (-81, 31), (-79.8, 31), (-79.5, 32.3), (-79.6, 32.6), (-78, 34)]
)
ISLAND = shapely.box(-79.3, 32.2, -79.2, 32.3)
COAST = [(-79.8, 31), (-79.5, 32.3), (-79.6, 32.6), (-78, 34)]


def write(path, geometries, crs="EPSG:4326", *, layer=None, append=False):
    kinds = sorted({g.geom_type for g in geometries if g is not None})
    pyogrio.raw.write(
        path,
        geometry=shapely.to_wkb(np.array(geometries, dtype=object)),
        field_data=[np.arange(len(geometries))],
        fields=["number"],
        geometry_type=kinds[0] if len(kinds) == 1 else "Unknown",
        crs=crs,
        layer=layer,
        append=append,
    )
    return path


def projected(geometry, crs):
    transformer = pyproj.Transformer.from_crs("EPSG:4326", crs, always_xy=True)
    return shapely.transform(
        geometry, lambda p: np.stack(transformer.transform(*p.T), axis=1)
    )


def expected():
    return shapely.union_all([MAINLAND, ISLAND]) & shapely.box(*BOX)


@pytest.mark.parametrize("suffix", ["geojson", "gpkg", "shp", "fgb"])
def test_every_format_gives_the_land_of_the_box(tmp_path, suffix):
    path = write(tmp_path / f"land.{suffix}", [MAINLAND, ISLAND])
    land = read_shoreline(path, BOX)
    assert land.geom_type == "MultiPolygon"
    assert land.is_valid
    assert shapely.equals(shapely.normalize(land), shapely.normalize(expected()))


@pytest.mark.parametrize("crs", ["EPSG:32617", "EPSG:3857", "EPSG:4269"])
def test_any_coordinate_system_becomes_degrees(tmp_path, crs):
    shapes = [projected(g, crs) for g in (MAINLAND, ISLAND)]
    path = write(tmp_path / "land.gpkg", shapes, crs)
    land = read_shoreline(path, BOX)
    assert shapely.hausdorff_distance(land, expected()) < 1e-6


def test_without_a_box_everything_is_read(tmp_path):
    path = write(tmp_path / "land.geojson", [MAINLAND, ISLAND])
    assert read_shoreline(path).area == pytest.approx(MAINLAND.area + ISLAND.area)


@pytest.mark.filterwarnings("ignore:'crs' was not provided")
def test_shapefile_without_system_is_taken_if_it_looks_like_degrees(tmp_path):
    path = write(tmp_path / "land.shp", [MAINLAND], crs=None)
    assert read_shoreline(path, BOX).area > 0
    metres = projected(MAINLAND, "EPSG:32617")
    path = write(tmp_path / "metres.shp", [metres], crs=None)
    with pytest.raises(InputError, match=r"metres\.shp: feature 0 .*add its \.prj"):
        read_shoreline(path, BOX)


def test_wrong_system_names_feature_and_place(tmp_path):
    metres = projected(ISLAND, "EPSG:32617")
    path = write(tmp_path / "land.gpkg", [ISLAND, metres], crs="EPSG:4326")
    with pytest.raises(InputError, match=r"feature 2 has a point at \(\d+, .*WGS 84"):
        read_shoreline(path)


def test_box_elsewhere_shows_both_extents(tmp_path):
    path = write(tmp_path / "land.geojson", [MAINLAND])
    with pytest.raises(InputError, match=r"box \[79, 32, 80, 33\]; it covers \[-81,"):
        read_shoreline(path, (79.0, 32.0, 80.0, 33.0))
    with pytest.raises(InputError, match="nothing in the box"):
        read_shoreline(path, (-79.4, 31.1, -79.2, 31.5))
    with pytest.raises(InputError, match="is empty"):
        read_shoreline(path, (-80.0, 33.0, -79.0, 32.0))


def test_date_line_and_longitudes_to_360(tmp_path):
    west, east = shapely.box(179, 0, 180, 1), shapely.box(-180, 0, -179, 1)
    path = write(tmp_path / "fiji.geojson", [west, east])
    land = read_shoreline(path, (178.0, -1.0, -178.0, 2.0))
    assert land.bounds == (179.0, 0.0, 181.0, 1.0)
    assert land.area == pytest.approx(2.0)
    path = write(tmp_path / "turned.gpkg", [shapely.box(280, 32, 280.5, 33)])
    assert read_shoreline(path, BOX).bounds == (-80.0, 32.0, -79.5, 33.0)


# ---- faulty files ------------------------------------------------------------------


def test_missing_or_garbled_file(tmp_path):
    with pytest.raises(InputError, match=r"absent\.shp: no such file"):
        read_shoreline(tmp_path / "absent.shp")
    path = tmp_path / "bad.geojson"
    path.write_text('{"type": "FeatureCollection", "features": [{]}')
    with pytest.raises(FormatError, match=r"bad\.geojson: cannot be read"):
        read_shoreline(path)


def test_layers_must_be_named_where_there_are_several(tmp_path):
    path = tmp_path / "land.gpkg"
    write(path, [MAINLAND], layer="coast")
    write(path, [ISLAND], layer="lakes", append=True)
    with pytest.raises(InputError, match=r"several layers.*coast, lakes"):
        read_shoreline(path)
    with pytest.raises(InputError, match=r'no layer "cost".*coast, lakes'):
        read_shoreline(path, layer="cost")
    assert read_shoreline(path, layer="lakes").area == pytest.approx(ISLAND.area)


def test_feature_without_geometry(tmp_path):
    path = tmp_path / "land.geojson"
    feature = {"type": "Feature", "properties": {}}
    data = {
        "type": "FeatureCollection",
        "features": [
            feature | {"geometry": shapely.geometry.mapping(ISLAND)},
            feature | {"geometry": None},
        ],
    }
    path.write_text(json.dumps(data))
    with pytest.raises(InputError, match="feature 1 has no geometry"):
        read_shoreline(path)
    ledger = []
    assert read_shoreline(path, repair=True, ledger=ledger).area > 0
    assert "skipped" in ledger[0].reason


def test_self_crossing_polygon_is_named_with_its_place(tmp_path):
    bow = shapely.Polygon([(-79.5, 32), (-79, 32.5), (-79, 32), (-79.5, 32.5)])
    path = write(tmp_path / "land.shp", [shapely.box(-80, 32, -79.6, 33), bow])
    with pytest.raises(
        InputError,
        match=r"feature 1: .*self-intersection at -79\.25\d* E, 32\.25\d* N.*repair",
    ):
        read_shoreline(path, BOX)
    ledger = []
    land = read_shoreline(path, BOX, repair=True, ledger=ledger)
    assert land.is_valid
    assert land.geom_type == "MultiPolygon"
    assert [entry.action for entry in ledger] == ["shoreline repaired"]
    assert ledger[0].longitude_deg == pytest.approx(-79.25)


def test_faults_outside_the_box_do_not_matter(tmp_path):
    bow = shapely.Polygon([(10, 0), (11, 1), (11, 0), (10, 1)])
    path = write(tmp_path / "land.gpkg", [MAINLAND, bow])
    assert read_shoreline(path, BOX).area > 0


@pytest.mark.parametrize(
    ("other", "word"),
    [
        (shapely.reverse(ISLAND), "are the same"),
        (shapely.box(-79.25, 32.25, -79.1, 32.4), "overlap"),
    ],
)
def test_duplicate_and_overlapping_polygons(tmp_path, other, word):
    path = write(tmp_path / "land.geojson", [MAINLAND, ISLAND, other])
    with pytest.raises(InputError, match=f"features 1 and 2 {word} at -79.2"):
        read_shoreline(path, BOX)
    ledger = []
    land = read_shoreline(path, BOX, repair=True, ledger=ledger)
    assert word in ledger[0].reason
    whole = shapely.union_all([MAINLAND, ISLAND, other]) & shapely.box(*BOX)
    assert land.area == pytest.approx(whole.area)


def test_tiles_that_share_an_edge_are_joined(tmp_path):
    tiles = [shapely.box(-80, 32, -79.5, 32.5), shapely.box(-79.5, 32, -79.2, 32.5)]
    path = write(tmp_path / "land.gpkg", tiles)
    land = read_shoreline(path, BOX)
    assert len(land.geoms) == 1
    assert land.area == pytest.approx(0.8 * 0.5)


def test_points_are_no_shoreline(tmp_path):
    path = write(tmp_path / "land.geojson", [shapely.Point(-79.5, 32.5)])
    with pytest.raises(InputError, match="expected land polygons or coastlines"):
        read_shoreline(path, BOX)


# ---- coastlines --------------------------------------------------------------------


@pytest.mark.parametrize("pieces", [1, 3])
@pytest.mark.parametrize("land_on", ["left", "right"])
def test_open_coast_and_box_enclose_the_land(tmp_path, pieces, land_on):
    coast = COAST if land_on == "left" else COAST[::-1]
    lines = [shapely.LineString(coast)]
    if pieces == 3:
        lines = [shapely.LineString(coast[i : i + 2]) for i in (1, 0, 2)]
    lines.append(ISLAND.exterior)
    lines = [shapely.LineString(shapely.get_coordinates(line)) for line in lines]
    path = write(tmp_path / "coast.gpkg", lines)
    land = read_shoreline(path, BOX, land_on=land_on)
    assert land.symmetric_difference(expected()).area < 1e-12


def test_closed_coastline_in_land_is_a_lake(tmp_path):
    lake, isle = (
        shapely.box(-79.95, 32.5, -79.8, 32.7),
        shapely.box(-79.9, 32.55, -79.85, 32.6),
    )
    rings = [shapely.LineString(p.exterior.coords) for p in (ISLAND, lake, isle)]
    path = write(tmp_path / "coast.geojson", [shapely.LineString(COAST), *rings])
    land = read_shoreline(path, BOX)
    assert land.area == pytest.approx(expected().area - lake.area + isle.area)


def test_coastline_ending_in_the_box(tmp_path):
    parts = [COAST[:2], [(-79.52, 32.34), *COAST[2:]]]
    path = write(tmp_path / "coast.geojson", [shapely.LineString(p) for p in parts])
    with pytest.raises(
        InputError, match=r"ends inside the box at -79\.5\d* E.*0\.04472 degrees"
    ):
        read_shoreline(path, BOX)


def test_coastlines_of_opposite_direction(tmp_path):
    first = shapely.LineString(COAST)
    second = shapely.LineString([(-79.2, 31), (-79.2, 32.5), (-78, 32.5)])
    path = write(tmp_path / "coast.geojson", [first, second])
    with pytest.raises(InputError, match="run in opposite directions"):
        read_shoreline(path, BOX)


def test_open_coastline_needs_a_box(tmp_path):
    path = write(tmp_path / "coast.geojson", [shapely.LineString(COAST)])
    with pytest.raises(InputError, match="give box_deg"):
        read_shoreline(path)


def test_crossing_and_duplicate_coastlines(tmp_path):
    line = shapely.LineString(COAST)
    path = write(tmp_path / "twice.geojson", [line, line])
    with pytest.raises(InputError, match="features 0 and 1 are the same"):
        read_shoreline(path, BOX)
    land = read_shoreline(path, BOX, repair=True)
    assert land.area == pytest.approx((MAINLAND & shapely.box(*BOX)).area)
    loop = shapely.LineString([COAST[0], (-79.2, 32.5), (-79.2, 32.2), COAST[2]])
    path = write(tmp_path / "loop.geojson", [loop])
    with pytest.raises(InputError, match=r"feature 0 crosses itself at -79\.\d+ E"):
        read_shoreline(path, BOX)


# ---- a drawn polygon ---------------------------------------------------------------


def test_read_polygon(tmp_path):
    path = write(tmp_path / "limit.geojson", [ISLAND])
    assert read_polygon(path).equals(ISLAND)
    path = write(tmp_path / "two.geojson", [ISLAND, MAINLAND])
    with pytest.raises(InputError, match="expected one polygon, found 2"):
        read_polygon(path)
