# SPDX-License-Identifier: GPL-3.0-or-later
"""Shapefiles, KML, GeoJSON and GeoPackages of lines and polygons, as GIS write them, and those that are not read."""

import json
import shutil
import sqlite3
import struct
import zipfile
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest
import shapefile
from rockfall.core.errors import InputError
from rockfall.core.exchange.map_shapes import polygon_of, read_lines, read_polygons, read_shapes
from rockfall.core.exchange.screens import read_screens
from rockfall.core.georeference import GlobalShift

CASES = Path(__file__).parents[1] / "data" / "field_cases"
SHIFT = GlobalShift(352000.0, 5130000.0, 0.0, crs="EPSG:32632")
SQUARE = [(352010.0, 5130010.0), (352050.0, 5130010.0), (352050.0, 5130050.0), (352010.0, 5130050.0)]
HOLE = [(352020.0, 5130020.0), (352030.0, 5130020.0), (352030.0, 5130030.0), (352020.0, 5130030.0)]
FAR = [(x + 100, y) for x, y in SQUARE]
US_FOOT = 1200 / 3937
FEET = (
    'PROJCS["NAD83 / New York Long Island (ftUS)",GEOGCS["NAD83",DATUM["North_American_Datum_1983",'
    'SPHEROID["GRS 1980",6378137,298.257222101]],PRIMEM["Greenwich",0],UNIT["degree",0.0174532925199433]],'
    'PROJECTION["Lambert_Conformal_Conic_2SP"],PARAMETER["latitude_of_origin",40.1666666666667],'
    'PARAMETER["central_meridian",-74],PARAMETER["standard_parallel_1",41.0333333333333],'
    'PARAMETER["standard_parallel_2",40.6666666666667],PARAMETER["false_easting",984250],'
    'PARAMETER["false_northing",0],UNIT["US survey foot",0.304800609601219],AUTHORITY["EPSG","2263"]]'
)


def closed(ring: list[tuple[float, ...]]) -> list[tuple[float, ...]]:
    return [*ring, ring[0]]


def write_shp(path: Path, kind: int, shapes: list[list[list[tuple[float, ...]]] | None], names: list[str], **more):
    """Parts as they are given, in whatever order their corners are."""
    writer = shapefile.Writer(str(path), shapeType=kind, encoding=more.get("encoding", "utf-8"))
    writer.field("Name", "C", 40)
    writer.field("capacity_k", "N", 10, 2)
    writer.field("height_m", "N", 10, 2)
    method = {3: writer.line, 5: writer.poly, 13: writer.linez, 15: writer.polyz, 23: writer.linem, 25: writer.polym}
    for shape, name in zip(shapes, names, strict=True):
        if shape is None:
            writer.null()
        else:
            method[kind](shape)
        writer.record(name, more.get("capacity"), more.get("height"))
    writer.close()
    if "prj" in more:
        path.with_suffix(".prj").write_text(more["prj"])
    return path


def test_a_shapefile_plain_and_zipped_is_what_gdal_reads(tmp_path):
    raw = pytest.importorskip("pyogrio.raw")
    blob = raw.read(CASES / "12-shapefile-kml" / "rel_ok.shp")[2][0]
    corners = np.frombuffer(blob[13:], "<f8", 10).reshape(5, 2)
    for name in ("rel_ok.shp", "rel_ok.zip"):
        (shape,) = read_polygons(CASES / "12-shapefile-kml" / name, SHIFT)
        assert (shape.name, len(shape.parts)) == ("rel", 2)
        np.testing.assert_allclose(shape.parts[0][:, :2] + SHIFT.vector[:2], corners[:4])
        assert polygon_of(shape, name).area_m2 == pytest.approx(15 * 40 - 8 * 30)


def test_holes_islands_and_parts_in_any_order_and_orientation(tmp_path):
    island = [(352023.0, 5130023.0), (352027.0, 5130023.0), (352027.0, 5130027.0), (352023.0, 5130027.0)]
    rings = [closed(ring) for ring in (HOLE, SQUARE, island, FAR)]
    for turned in (False, True):
        parts = [ring[::-1] if turned else ring for ring in rings]
        shapes = read_polygons(write_shp(tmp_path / "a.shp", 5, [parts], ["one"]), SHIFT)
        areas = [polygon_of(shape, "a").area_m2 for shape in shapes]
        assert sorted(areas) == pytest.approx([16.0, 1600 - 100.0, 1600.0])
        assert {shape.number for shape in shapes} == {1}


def test_lines_with_heights_and_measures(tmp_path):
    line = [(*point, 800.0 + i) for i, point in enumerate(SQUARE)]
    path = write_shp(tmp_path / "z.shp", 13, [[line], [line[:2], line[2:]]], ["one", "two"])
    one, *two = read_lines(path, SHIFT)
    np.testing.assert_allclose(one.parts[0], np.array(line) - SHIFT.vector)
    assert [len(shape.parts[0]) for shape in two] == [2, 2]
    measured = read_lines(write_shp(tmp_path / "m.shp", 23, [[line]], ["m"]), SHIFT)
    assert np.isnan(measured[0].parts[0][:, 2]).all()  # kilometres along a road are no heights
    writer = shapefile.Writer(str(tmp_path / "n.shp"), shapeType=13)
    writer.field("name", "C")
    writer.linez([[(x, y, -1e39) for x, y in SQUARE]])
    writer.record("none")
    writer.close()
    assert np.isnan(read_lines(tmp_path / "n.shp", SHIFT)[0].parts[0][:, 2]).all()


def test_a_feature_without_a_geometry_is_refused(tmp_path):
    path = write_shp(tmp_path / "a.shp", 5, [[closed(SQUARE)], None], ["one", "two"])
    with pytest.raises(InputError, match="The feature 2 has no geometry"):
        read_polygons(path, SHIFT)


def test_the_encoding_of_the_names(tmp_path):
    for encoding, cpg in (("utf-8", "UTF-8"), ("cp1252", "1252"), ("cp1252", "ANSI 1252"), ("iso8859-15", "8859-15")):
        path = write_shp(tmp_path / "a.shp", 5, [[closed(SQUARE)]], ["Größe"], encoding=encoding)
        if cpg == "8859-15":
            cpg = "ISO-8859-15"
        path.with_suffix(".cpg").write_text(cpg)
        assert read_polygons(path, SHIFT)[0].name == "Größe"
    path.with_suffix(".cpg").unlink()
    write_shp(tmp_path / "a.shp", 5, [[closed(SQUARE)]], ["Größe"], encoding="cp1252")
    path.with_suffix(".cpg").unlink(missing_ok=True)
    assert read_polygons(path, SHIFT)[0].name == "Größe"
    path.with_suffix(".cpg").write_text("klingon")
    with pytest.raises(InputError, match=r"encoding 'klingon' of the \.cpg is not known"):
        read_polygons(path, SHIFT)


def test_the_unit_of_the_prj(tmp_path):
    feet = [tuple(value / US_FOOT for value in point) for point in SQUARE]
    path = write_shp(tmp_path / "a.shp", 5, [[closed(feet)]], ["feet"], prj=FEET)
    (shape,) = read_polygons(path, GlobalShift(352000.0, 5130000.0, 0.0, crs="EPSG:2263"))
    np.testing.assert_allclose(shape.parts[0][:, :2], np.array(SQUARE) - SHIFT.vector[:2], atol=1e-6)
    line = [(*point, 1000.0) for point in feet]
    (drawn,) = read_lines(
        write_shp(tmp_path / "l.shp", 13, [[line]], ["feet"], prj=FEET), GlobalShift(352e3, 513e4, 0.0, "EPSG:2263")
    )
    np.testing.assert_allclose(drawn.parts[0][:, 2], 1000 * US_FOOT)


def test_another_system_is_transformed_or_refused_never_taken_as_it_is(tmp_path):
    transform = pytest.importorskip("rasterio.warp").transform
    crs = pytest.importorskip("rasterio.crs").CRS
    x, y = np.array(SQUARE).T
    for code in (4326, 25833, 3857):
        there = list(zip(*transform("EPSG:32632", f"EPSG:{code}", x, y), strict=True))
        path = write_shp(tmp_path / "a.shp", 5, [[closed(there)]], ["a"], prj=crs.from_epsg(code).to_wkt())
        shapes = read_polygons(path, SHIFT)
        np.testing.assert_allclose(shapes[0].parts[0][:, :2], np.array(SQUARE) - SHIFT.vector[:2], atol=0.01)
        assert f"transformed from EPSG:{code} to the terrain's EPSG:32632" in str(shapes.remarks[0])
        content = {"type": "Polygon", "coordinates": [closed(there)]}
        content |= {"crs": {"type": "name", "properties": {"name": f"urn:ogc:def:crs:EPSG::{code}"}}}
        (tmp_path / "a.geojson").write_text(json.dumps(content))
        (same,) = read_polygons(tmp_path / "a.geojson", SHIFT)
        np.testing.assert_allclose(same.parts[0], shapes[0].parts[0])
    esri = crs.from_epsg(32632).to_wkt(version="WKT1_ESRI")  # no code, but the same system
    path = write_shp(tmp_path / "e.shp", 5, [[closed(SQUARE)]], ["a"], prj=esri)
    assert not read_polygons(path, SHIFT).remarks
    with pytest.raises(InputError, match=r"in EPSG:4326, and the terrain states no coordinate system\. Export it"):
        read_polygons(
            write_shp(tmp_path / "a.shp", 5, [[closed([(7.0, 46.0), (7.1, 46.0), (7.1, 46.1)])]], ["a"],
                      prj=crs.from_epsg(4326).to_wkt()),
            GlobalShift(352000.0, 5130000.0, 0.0),
        )  # fmt: skip
    path = write_shp(tmp_path / "a.shp", 5, [[closed(SQUARE)]], ["a"], prj=crs.from_epsg(27572).to_wkt())
    with pytest.raises(InputError, match=r"in EPSG:27572, the terrain in EPSG:32632\. Export it in the terrain's"):
        read_polygons(path, SHIFT)
    path = write_shp(tmp_path / "a.shp", 5, [[closed(SQUARE)]], ["a"], prj=crs.from_epsg(4326).to_wkt())
    with pytest.raises(InputError, match="says that it is in degrees"):
        read_polygons(path, SHIFT)
    path.with_suffix(".prj").unlink()
    assert "states no coordinate system" in str(read_polygons(path, SHIFT).remarks[0])


def test_geojson_without_a_system_is_in_degrees(tmp_path):
    """RFC 7946, 4."""
    transform = pytest.importorskip("rasterio.warp").transform
    ring = list(zip(*transform("EPSG:32632", "EPSG:4326", *np.array(SQUARE).T), strict=True))
    (tmp_path / "a.geojson").write_text(json.dumps({"type": "Polygon", "coordinates": [closed(ring)]}))
    (shape,) = read_polygons(tmp_path / "a.geojson", SHIFT)
    np.testing.assert_allclose(shape.parts[0][:, :2], np.array(SQUARE) - SHIFT.vector[:2], atol=0.01)


def kml(places: str, head: str = "") -> str:
    return f'<?xml version="1.0"?>{head}<kml xmlns="http://www.opengis.net/kml/2.2"><Document>{places}</Document></kml>'


def coordinates(points: list[tuple[float, ...]]) -> str:
    return "<coordinates>" + " ".join(",".join(map(repr, point)) for point in points) + "</coordinates>"


def test_kml_and_kmz(tmp_path):
    transform = pytest.importorskip("rasterio.warp").transform

    def degrees(points):
        x, y = transform("EPSG:32632", "EPSG:4326", *np.array(points).T)
        return [(a, b, 700.0) for a, b in zip(x, y, strict=True)]

    ring, hole = (f"<LinearRing>{coordinates(degrees(closed(one)))}</LinearRing>" for one in (SQUARE, HOLE))
    polygon = f"<Polygon><outerBoundaryIs>{ring}</outerBoundaryIs><innerBoundaryIs>{hole}</innerBoundaryIs></Polygon>"
    data = '<ExtendedData><Data name="friction"><value>0.6</value></Data></ExtendedData>'
    text = kml(
        f"<Folder><Placemark><name>Größe</name>{data}<MultiGeometry>{polygon}</MultiGeometry></Placemark></Folder>"
    )
    (tmp_path / "a.kml").write_text(text, encoding="utf-8")
    with zipfile.ZipFile(tmp_path / "a.kmz", "w") as archive:
        archive.writestr("doc.kml", text)
    for name in ("a.kml", "a.kmz"):
        (shape,) = read_polygons(tmp_path / name, SHIFT)
        assert (shape.name, shape.properties) == ("Größe", {"friction": "0.6"})
        np.testing.assert_allclose(shape.parts[0][:, :2], np.array(SQUARE) - SHIFT.vector[:2], atol=0.01)
        assert polygon_of(shape, name).area_m2 == pytest.approx(1500.0, abs=0.5)
        assert np.isnan(shape.parts[0][:, 2]).all()  # they are on the ground
    line = f"<Placemark><LineString>{{}}{coordinates(degrees(SQUARE))}</LineString></Placemark>"
    for mode, height in (("absolute", 700.0), ("relativeToGround", np.nan), ("clampToGround", np.nan)):
        (tmp_path / "b.kml").write_text(kml(line.format(f"<altitudeMode>{mode}</altitudeMode>")))
        np.testing.assert_array_equal(read_lines(tmp_path / "b.kml", SHIFT)[0].parts[0][:, 2], height)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (kml("", '<!DOCTYPE kml [<!ENTITY a "aaaa"><!ENTITY b "&a;&a;&a;&a;">]>'), "defines words of its own"),
        (kml("<Folder>" * 200 + "</Folder>" * 200), "nested too deeply"),
        (kml("<NetworkLink><Link><href>x</href></Link></NetworkLink>"), "only links to another"),
        (kml("<Placemark><name>x</name></Placemark>"), "The place 1 has no geometry"),
        (kml(f"<Placemark><Point>{coordinates([(7.0, 46.0)])}</Point></Placemark>"), "is a Point, where polygons"),
        (kml("<Placemark><LineString><coordinates>7,a 8,9</coordinates></LineString></Placemark>"), "not two or three"),
        ("<html><body/></html>", "This is no KML: it begins with <html>"),
        ("<kml><Placemark>", "This is no KML, or damaged"),
        ("", "This is no KML, or damaged"),
    ],
)
def test_kml_that_is_refused(tmp_path, text, said):
    (tmp_path / "map.kml").write_text(text)
    with pytest.raises(InputError) as told:
        read_polygons(tmp_path / "map.kml", SHIFT)
    assert said in str(told.value)[len(str(tmp_path)) :]


def test_archives_that_are_refused(tmp_path):
    write_shp(tmp_path / "one.shp", 5, [[closed(SQUARE)]], ["a"])
    for name in ("two.shp", "two.dbf"):
        shutil.copy(tmp_path / f"one{name[3:]}", tmp_path / name)

    def packed(*names: str) -> str:
        with zipfile.ZipFile(tmp_path / "map.zip", "w") as archive:
            for name in names:
                archive.write(tmp_path / name, f"folder/{name}")
        with pytest.raises(InputError) as told:
            read_polygons(tmp_path / "map.zip", SHIFT)
        return str(told.value)[len(str(tmp_path)) :]

    assert "several shapefiles: one.shp, two.shp" in packed("one.shp", "two.shp", "two.dbf")
    assert "no shapefile" in packed("one.dbf")
    with zipfile.ZipFile(tmp_path / "map.zip", "w", zipfile.ZIP_DEFLATED) as archive, archive.open("a.shp", "w") as out:
        for _ in range(300):
            out.write(bytes(1_000_000))  # 300 MB in 300 kB
    with pytest.raises(InputError, match=r"a\.shp in the archive is larger than 200 MB"):
        read_polygons(tmp_path / "map.zip", SHIFT)
    with pytest.raises(InputError, match=r"This is a part of a shapefile\. Give the file that ends with \.shp"):
        read_polygons(tmp_path / "one.dbf", SHIFT)


def test_a_header_that_promises_more_than_there_is(tmp_path):
    path = write_shp(tmp_path / "a.shp", 5, [[closed(SQUARE)]], ["a"])
    whole = path.read_bytes()
    for at, text in ((144, struct.pack("<I", 2**31 - 1)), (148, struct.pack("<I", 2**31 - 1))):
        path.write_bytes(whole[:at] + text + whole[at + 4 :])  # parts, points
        with pytest.raises(InputError):
            read_polygons(path, SHIFT)
    path.write_bytes(whole)
    table = path.with_suffix(".dbf")
    data = table.read_bytes()
    table.write_bytes(data[:4] + struct.pack("<I", 2**32 - 1) + data[8:])
    with pytest.raises(InputError, match=r"Its \.dbf is cut short"):
        read_polygons(path, SHIFT)
    table.write_bytes(data)
    for cut in (whole[:-16], whole + bytes(8)):
        path.write_bytes(cut)
        with pytest.raises(InputError, match="its header promises 236 bytes"):
            read_polygons(path, SHIFT)
    path.write_bytes(whole)
    two = write_shp(tmp_path / "two.shp", 5, [[closed(SQUARE)], [closed(FAR)]], ["a", "b"])
    shutil.copy(two.with_suffix(".dbf"), table)
    with pytest.raises(InputError, match=r"It has 1 shapes, and 2 rows in its \.dbf"):
        read_polygons(path, SHIFT)


def test_nothing_in_a_geopackage_is_computed(tmp_path):
    """A view or a computed column may be anything: without end, or of any size."""
    shape = b"GP\0\x01" + struct.pack("<i", 0) + struct.pack("<BII4d", 1, 2, 2, 1, 2, 30, 40)
    endless = "WITH RECURSIVE r(n) AS (SELECT 1 UNION ALL SELECT n + 1 FROM r) SELECT n, x'' AS geom FROM r"
    for schema in (
        f"CREATE VIEW map AS {endless}",
        "CREATE TABLE map (fid INTEGER PRIMARY KEY, geom BLOB, big BLOB GENERATED ALWAYS AS (zeroblob(100000000)))",
    ):
        path = tmp_path / "map.gpkg"
        path.unlink(missing_ok=True)
        with closing(sqlite3.connect(path)) as database:
            database.executescript(
                "CREATE TABLE gpkg_contents (table_name TEXT, data_type TEXT, srs_id INTEGER);"
                "CREATE TABLE gpkg_spatial_ref_sys (srs_id INTEGER, organization TEXT,"
                " organization_coordsys_id INTEGER, definition TEXT);"
                "CREATE TABLE gpkg_geometry_columns (table_name TEXT, column_name TEXT, srs_id INTEGER);"
                "INSERT INTO gpkg_contents VALUES ('map', 'features', 0);"
                f"INSERT INTO gpkg_geometry_columns VALUES ('map', 'geom', 0); {schema};"
            )
            if "TABLE" in schema:
                database.execute("INSERT INTO map (geom) VALUES (?)", (shape,))
            database.commit()
        with pytest.raises(InputError, match="is a view, or has computed columns"):
            read_lines(path, SHIFT)
    with closing(sqlite3.connect(path)) as database:
        database.executescript("DROP TABLE map; CREATE TABLE map (fid INTEGER PRIMARY KEY, geom BLOB, more BLOB);")
        database.execute("INSERT INTO map VALUES (1, ?, zeroblob(60000000))", (shape,))
        database.commit()
    with pytest.raises(InputError, match="This GeoPackage cannot be read: string or blob too big"):
        read_lines(path, SHIFT)


def test_areas_are_screens_along_their_outline(tmp_path):
    path = write_shp(tmp_path / "hut.shp", 5, [[closed(SQUARE)]], ["hut"], capacity=500, height=4)
    (screen,) = read_screens(path, SHIFT)
    assert (screen.name, screen.capacity_j, screen.height_m) == ("hut", 5e5, 4.0)
    assert screen.length_m == pytest.approx(160.0)
    np.testing.assert_array_equal(screen.line[0], screen.line[-1])
    assert [shape.kind for shape in read_shapes(path, SHIFT)] == ["polygon"]
    content = {"type": "Polygon", "coordinates": [closed(SQUARE), closed(HOLE)]}
    (tmp_path / "a.geojson").write_text(json.dumps(content))
    with pytest.raises(InputError, match="has holes"):
        read_screens(tmp_path / "a.geojson", SHIFT)
    (tmp_path / "a.geojson").write_text(json.dumps({**content, "coordinates": [closed(SQUARE)]}))
    assert read_screens(tmp_path / "a.geojson", SHIFT)[0].length_m == pytest.approx(160.0)
