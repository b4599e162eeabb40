# SPDX-License-Identifier: GPL-3.0-or-later
"""Units of coordinate systems by code, and in the records of clouds, against PROJ's database."""

import importlib.util
import json
from pathlib import Path

import laspy
import numpy as np
import pytest
from laspy.vlrs.known import GeoDoubleParamsVlr, GeoKeyDirectoryVlr, GeoKeyEntryStruct, WktCoordinateSystemVlr
from rasterio.crs import CRS
from rockfall.core.errors import InputError
from rockfall.core.georeference import GlobalShift
from rockfall.core.terrain import epsg_units
from rockfall.core.terrain.crs import (
    metric_name,
    named_system,
    surely_different,
    system_from_wkt,
    unit_words,
)
from rockfall.core.terrain.opening import HowToRead, read_placed
from rockfall.core.terrain.readers import inspect_terrain, read_terrain

FOOT, US_FOOT = 0.3048, 1200 / 3937
POINTS = np.array([[6e6, 2e6, 4000.0], [6e6 + 10, 2e6, 4001.0], [6e6, 2e6 + 10, 4003.0], [6e6 + 10, 2e6 + 10, 4004.0]])


@pytest.mark.parametrize("code", [2056, 2154, 2229, 2222, 2225, 3435, 6423, 26729, 32058, 29371, 22300, 24370, 32632])
def test_units_of_codes_are_those_of_proj(code):
    _, length = CRS.from_epsg(code).linear_units_factor
    assert named_system(f"EPSG:{code}").unit_m == pytest.approx(length, rel=1e-12)


@pytest.mark.parametrize("version", ["WKT1_GDAL", "WKT1_ESRI", "WKT2_2015", "WKT2_2019"])
@pytest.mark.parametrize(
    ("name", "kind", "flat", "height", "depths"),
    [
        ("EPSG:2229", "plane", US_FOOT, None, False),
        ("EPSG:2222", "plane", FOOT, None, False),
        ("EPSG:32611+6360", "plane", 1.0, US_FOOT, False),
        ("EPSG:2229+8228", "plane", US_FOOT, FOOT, False),
        ("EPSG:2056+5728", "plane", 1.0, 1.0, False),
        ("EPSG:32631+5715", "plane", 1.0, 1.0, True),
        ("EPSG:4326", "geographic", None, None, False),
        ("EPSG:4269+5703", "geographic", None, 1.0, False),
    ],
)
def test_units_of_well_known_texts(version, name, kind, flat, height, depths):
    found = system_from_wkt(CRS.from_string(name).to_wkt(version=version))
    assert (found.kind, found.depths) == (kind, depths)
    if kind == "plane":
        assert found.unit_m == pytest.approx(flat, rel=1e-15)
    assert found.height_unit_m == (None if height is None else pytest.approx(height, rel=1e-15))
    if version != "WKT1_ESRI":
        assert found.name == name.partition("+")[0]
        assert named_system(name).height_unit_m == found.height_unit_m
        assert (named_system(name).kind, named_system(name).depths) == (kind, depths)


def test_well_known_text_that_is_none():
    for text in (
        "",
        "[[[",
        "]]]",
        "PROJCS",
        'PROJCS["a',
        "PROJCS[" * 5000,
        'UNIT["metre",1]',
        'PROJCS["a",UNIT["b",x]]',
    ):
        assert system_from_wkt(text).unit_m is None


def test_a_system_in_another_unit_loses_its_code():
    assert metric_name("EPSG:2229") == "EPSG:2229 in metres" == metric_name("EPSG:2229 in metres")
    assert metric_name("EPSG:2056") == "EPSG:2056"
    assert named_system("EPSG:2229 in metres").unit_m == 1.0
    assert not surely_different("EPSG:2229", "epsg:2229 in metres")
    assert surely_different("EPSG:2229 in metres", "EPSG:2230")
    assert [unit_words(length) for length in (FOOT, US_FOOT, 1.0)] == ["feet", "US survey feet", "metres"]


def test_the_lists_of_codes_are_those_that_the_script_makes(tmp_path, monkeypatch):
    script = Path(__file__).parents[2] / "scripts" / "making" / "epsg_units.py"
    spec = importlib.util.spec_from_file_location("epsg_units_script", script)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    monkeypatch.setattr(module, "TARGET", tmp_path / "made.py")
    module.main()
    made: dict[str, object] = {}
    exec((tmp_path / "made.py").read_text(encoding="utf-8"), made)
    if made["__doc__"] != epsg_units.__doc__:
        pytest.skip("rasterio brings another version of the EPSG dataset")
    for name in ("HORIZONTAL", "VERTICAL", "DEPTHS", "GEOGRAPHIC", "GEOCENTRIC", "LENGTHS"):
        assert made[name] == getattr(epsg_units, name)


def cloud(path: Path, *records) -> Path:
    las = laspy.LasData(laspy.LasHeader(point_format=6, version="1.4"))
    las.header.scales, las.header.offsets = [0.001] * 3, [6e6, 2e6, 0]
    las.x, las.y, las.z = POINTS.T
    las.header.vlrs.extend(records)
    las.write(path)
    return path


def key(number: int, value: int, tag: int = 0) -> GeoKeyEntryStruct:
    return GeoKeyEntryStruct(id=number, tiff_tag_location=tag, count=1, value_offset=value)


def keys(*entries: GeoKeyEntryStruct) -> GeoKeyDirectoryVlr:
    record = GeoKeyDirectoryVlr()
    record.geo_keys = list(entries)
    record.geo_keys_header.number_of_keys = len(entries)
    return record


@pytest.mark.parametrize(
    ("records", "flat", "height"),
    [
        (lambda: [WktCoordinateSystemVlr(CRS.from_string("EPSG:2229+6360").to_wkt())], US_FOOT, US_FOOT),
        (lambda: [WktCoordinateSystemVlr(CRS.from_string("EPSG:32611+6360").to_wkt())], 1.0, US_FOOT),
        (lambda: [keys(key(1024, 1), key(3072, 2229), key(4099, 9001))], US_FOOT, 1.0),
        (lambda: [keys(key(1024, 1), key(3072, 2222), key(4096, 6360))], FOOT, US_FOOT),
        (lambda: [keys(key(1024, 1), key(3076, 9002))], FOOT, FOOT),
        (lambda: [keys(key(1024, 1), key(3076, 32767), key(3077, 0, 34736)), lengths(0.5)], 0.5, 0.5),
    ],
)
def test_units_of_the_records_of_a_cloud(tmp_path, records, flat, height):
    path = cloud(tmp_path / "a.las", *records())
    np.testing.assert_allclose(read_placed(path, HowToRead()).points, POINTS * [flat, flat, height], rtol=1e-12)
    np.testing.assert_allclose(read_placed(path, HowToRead(unit_m=1.0)).points, POINTS, rtol=1e-12)
    info = inspect_terrain(path)
    np.testing.assert_allclose(info.maximum, POINTS.max(axis=0) * [flat, flat, height], rtol=1e-12)
    assert info.stated_units_m == info.units_m == (flat, height)
    assert inspect_terrain(path, unit_m=0.1).units_m == (0.1, 0.1)


def lengths(*values: float) -> GeoDoubleParamsVlr:
    record = GeoDoubleParamsVlr()
    record.parse_record_data(np.array(values).tobytes())
    return record


def test_the_system_that_a_project_states_has_a_unit(tmp_path):
    """Of files that state none; the shift is in metres, and so is what is written."""
    from rockfall.core.exchange.project import read_project, write_project
    from rockfall.core.workflow.opening import open_terrain

    np.savetxt(tmp_path / "a.xyz", POINTS)

    def opened(more: str) -> tuple[np.ndarray, GlobalShift]:
        (tmp_path / "project.toml").write_text(f'schema = 1\n[terrain]\nfile = "a.xyz"\n{more}')
        project = read_project(tmp_path / "project.toml")
        surface = open_terrain(project)
        assert surface is not None
        write_project(project, tmp_path / "again.toml")
        assert read_project(tmp_path / "again.toml").terrain == project.terrain
        return surface.shift.to_survey(surface.vertices), surface.shift

    places, shift = opened('crs = "EPSG:2229"\nshift = [1828800.0, 609600.0, 1200.0]\n')
    np.testing.assert_allclose(np.sort(places, axis=0), np.sort(POINTS * US_FOOT, axis=0))
    assert (shift.x, shift.crs) == (1828800.0, "EPSG:2229 in metres")
    places, shift = opened('crs = "EPSG:32611"\nvertical_datum = "EPSG:6360"\n')
    np.testing.assert_allclose(np.sort(places, axis=0), np.sort(POINTS * [1, 1, US_FOOT], axis=0))
    assert (shift.crs, shift.vertical) == ("EPSG:32611", "EPSG:6360 in metres")
    places, _ = opened('crs = "EPSG:2229"\nunit_m = 1.0\nheight_unit_m = 0.3048\n')
    np.testing.assert_allclose(np.sort(places, axis=0), np.sort(POINTS * [1, 1, FOOT], axis=0))


def test_a_terrain_that_was_written_in_metres_is_read_in_metres(tmp_path):
    from rockfall.core.terrain.writers import write_ply

    surface = read_terrain(cloud(tmp_path / "a.las", WktCoordinateSystemVlr(CRS.from_epsg(2229).to_wkt())))
    write_ply(surface, tmp_path / "a.ply")
    again = read_terrain(tmp_path / "a.ply")
    assert again.shift.crs == "EPSG:2229 in metres"
    np.testing.assert_allclose(again.shift.to_survey(again.vertices), surface.shift.to_survey(surface.vertices))


def test_maps_of_a_terrain_in_feet_are_where_they_belong(tmp_path):
    """GDAL takes the unit that a GeoTIFF states for that of its system's coordinates."""
    import rasterio
    from rasterio.warp import transform
    from rockfall.core.exchange.geotiff_maps import write_map
    from rockfall.core.hazard.cells import Cells
    from rockfall.core.hazard.maps import Layer

    shift = GlobalShift(6e6 * US_FOOT, 2e6 * US_FOOT, 0.0, "EPSG:2229 in metres")
    write_map(tmp_path / "m.tif", Cells(0.0, 0.0, 1.0, 3, 2), np.zeros((2, 3)), Layer("a", "", "b"), shift)
    with rasterio.open(tmp_path / "m.tif") as file:
        here = transform(file.crs, "EPSG:4326", *([value] for value in file.transform @ (0, file.height)))
    expected = transform("EPSG:2229", "EPSG:4326", [6e6], [2e6])
    np.testing.assert_allclose(np.ravel(here), np.ravel(expected), atol=1e-8)


def test_polygons_in_feet_come_to_their_place(tmp_path):
    from rockfall.core.exchange.map_shapes import read_polygons

    square = [[6e6, 2e6], [6e6 + 100, 2e6], [6e6 + 100, 2e6 + 100]]
    crs = {"type": "name", "properties": {"name": "urn:ogc:def:crs:EPSG::2229"}}
    feature = {"type": "Feature", "properties": {}, "geometry": {"type": "Polygon", "coordinates": [square]}}
    content = {"type": "FeatureCollection", "crs": crs, "features": [feature]}
    (tmp_path / "a.geojson").write_text(json.dumps(content))
    shift = GlobalShift(1828800.0, 609600.0, 0.0, "EPSG:2229 in metres")
    (shape,) = read_polygons(tmp_path / "a.geojson", shift)
    np.testing.assert_allclose(shape.parts[0][:, :2], np.array(square) * US_FOOT - [1828800.0, 609600.0], atol=1e-6)
    with pytest.raises(InputError, match="is in EPSG:2229, the terrain in EPSG:2230 in metres"):
        read_polygons(tmp_path / "a.geojson", GlobalShift(crs="EPSG:2230 in metres"))


def test_columns_in_us_survey_feet(tmp_path):
    from rockfall.core.exchange.tables import read_picks

    (tmp_path / "picks.csv").write_text("trajectory,time_s,x_usft,y_usft,z_ft\nA,0,6000000,2000000,100\n")
    picks = read_picks(tmp_path / "picks.csv", GlobalShift())
    np.testing.assert_allclose(picks.position[0], [6e6 * US_FOOT, 2e6 * US_FOOT, 30.48])
