# SPDX-License-Identifier: GPL-3.0-or-later
"""Maps as GeoTIFF with the styles of QGIS, against readers that are not Rockfall's, where they are installed."""

import errno
import xml.etree.ElementTree as ElementTree
from pathlib import Path

import numpy as np
import pytest
import tifffile
from rockfall.core.errors import InputError
from rockfall.core.exchange.geopackage import write_geopackage
from rockfall.core.exchange.geotiff_maps import write_map
from rockfall.core.exchange.qgis_styles import line_style, point_style, raster_style
from rockfall.core.georeference import GlobalShift, code_remarks, epsg_code
from rockfall.core.hazard.cells import Cells
from rockfall.core.hazard.classes import classes_of
from rockfall.core.hazard.maps import LAYERS
from rockfall.core.terrain.geotiff import read_geotiff
from rockfall.core.terrain.readers import read_terrain

CELLS = Cells(-20.0, -30.0, 2.0, 700, 300)
SHIFT = GlobalShift(2_600_000.0, 1_200_000.0, 800.0, "EPSG:2056")


@pytest.fixture(scope="module")
def values() -> np.ndarray:
    """A map with nothing in its south-western quarter; one cell is far above all others."""
    rng = np.random.default_rng(3)
    made = rng.lognormal(3.0, 1.5, CELLS.shape)
    made[:150, :350] = np.nan
    made[200, 500] = 123_456.0
    return made


def written(path: Path, values: np.ndarray, shift: GlobalShift = SHIFT, layer: str = "E_95CI") -> Path:
    write_map(path, CELLS, values, LAYERS[layer], shift, {"BLOCKS": "1000"})
    return path


def items_of(path: Path) -> dict[str, str]:
    with tifffile.TiffFile(path) as tiff:
        text = tiff.pages.first.tags[42112].value
    return {item.attrib["name"]: item.text or "" for item in ElementTree.fromstring(text)}


def test_our_own_reader_finds_values_places_and_system(tmp_path, values):
    source = read_geotiff(written(tmp_path / "a.tif", values, layer="Ph_95CI"))  # metres: kJ are no heights
    assert source.crs == "EPSG:2056"
    assert source.grid_shape == CELLS.shape
    points = source.points.reshape(*CELLS.shape, 3)[::-1]
    np.testing.assert_array_equal(points[..., 2], values.astype(np.float32))
    np.testing.assert_allclose(points[0, 0, :2], [2_599_981.0, 1_199_971.0], atol=1e-6)
    np.testing.assert_allclose(points[10, 20, :2], [2_600_021.0, 1_199_991.0], atol=1e-6)


def test_tiles_overviews_and_the_greatest_value_in_each(tmp_path, values):
    with tifffile.TiffFile(written(tmp_path / "a.tif", values)) as tiff:
        shapes = [page.shape for page in tiff.pages]
        assert shapes == [(300, 700), (150, 350), (75, 175)]
        assert all(page.is_tiled and page.tile == (256, 256) and page.dtype == np.float32 for page in tiff.pages)
        assert [page.is_reduced for page in tiff.pages] == [False, True, True]
        tops = [page.asarray().max() for page in tiff.pages]
        lowest = tiff.pages[2].asarray()
    assert tops == [np.float32(123_456.0)] * 3
    north_first = values[::-1]
    for row, column in ((0, 0), (40, 100), (74, 174), (60, 50)):
        four = north_first[4 * row : 4 * row + 4, 4 * column : 4 * column + 4]
        greatest = -9999.0 if np.isnan(four).all() else np.nanmax(four)
        assert lowest[row, column] == np.float32(greatest)


def test_other_programs_read_the_map_its_unit_and_its_meaning(tmp_path, values):
    rasterio = pytest.importorskip("rasterio", reason="rasterio, an independent reader of GeoTIFF, is not installed")
    with rasterio.open(written(tmp_path / "a.tif", values)) as raster:
        assert raster.crs.to_epsg() == 2056
        assert raster.nodata == -9999.0
        assert raster.bounds == (2_599_980.0, 1_199_970.0, 2_601_380.0, 1_200_570.0)
        assert raster.overviews(1) == [2, 4]
        assert raster.descriptions == ("Kinetic energy, 95 % value",)
        assert raster.units == ("kJ",)
        tags = raster.tags()
        assert (tags["CRS"], tags["VERTICAL_DATUM"], tags["BLOCKS"]) == ("EPSG:2056", "unknown", "1000")
        assert tags["MEANING"] == LAYERS["E_95CI"].meaning
        read = raster.read(1, masked=True)
    np.testing.assert_array_equal(read.mask[::-1], np.isnan(values))
    np.testing.assert_array_equal(read.compressed(), values[::-1][~np.isnan(values[::-1])].astype(np.float32))


@pytest.mark.parametrize(("crs", "said"), [("", "unknown"), ("CH1903+ / LV95", "CH1903+ / LV95")])
def test_a_system_without_a_code_is_named_and_not_invented(tmp_path, values, crs, said):
    path = written(tmp_path / "a.tif", values, GlobalShift(1000.0, 0.0, 0.0, crs), "Ph_95CI")
    assert items_of(path)["CRS"] == said
    assert read_geotiff(path).crs == ""
    rasterio = pytest.importorskip("rasterio", reason="rasterio, an independent reader of GeoTIFF, is not installed")
    with rasterio.open(path) as raster:
        assert raster.crs is None


def test_the_vertical_system_of_a_terrain_comes_back_in_its_maps(tmp_path, values):
    """A terrain with heights in LN02: known after it was opened, and in what is written of it."""
    shift = GlobalShift(2_600_000.0, 1_200_000.0, 0.0, "EPSG:2056", "EPSG:5728")
    path = written(tmp_path / "heights.tif", np.full(CELLS.shape, 500.0), shift, "Ph_95CI")
    opened = read_terrain(path).shift
    assert (opened.crs, opened.vertical) == ("EPSG:2056", "EPSG:5728")
    assert items_of(written(tmp_path / "b.tif", values, opened))["VERTICAL_DATUM"] == "EPSG:5728"
    rasterio = pytest.importorskip("rasterio", reason="rasterio, an independent reader of GeoTIFF, is not installed")
    with rasterio.open(path) as raster:
        assert raster.crs.to_epsg() == 2056 or "2056" in raster.crs.to_wkt()


def test_the_same_map_is_the_same_file(tmp_path, values):
    first, second = (written(tmp_path / name, values).read_bytes() for name in ("a.tif", "b.tif"))
    assert first == second


def test_a_disk_that_is_full_leaves_the_old_map(tmp_path, values, monkeypatch):
    path = written(tmp_path / "a.tif", values)
    before = path.read_bytes()

    def full(*_: object, **__: object) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(tifffile.TiffWriter, "write", full)
    with pytest.raises(InputError, match="Make room"):
        written(path, values + 1.0)
    assert path.read_bytes() == before
    assert [file.name for file in tmp_path.iterdir()] == ["a.tif"]


def test_a_map_of_other_cells_is_refused(tmp_path, values):
    with pytest.raises(InputError, match="is not one of"):
        written(tmp_path / "a.tif", values[:-1])


def test_every_map_has_classes_in_ascending_order():
    for name, layer in LAYERS.items():
        for greatest in (0.0, 0.02, 7.0, 314.0, 1e6):
            for spread in (1.1, 20.0, 1e5):
                values = np.array(
                    [np.nan, 0.0, *np.geomspace(greatest / spread, greatest, 50)] if greatest else [np.nan]
                )
                classes = classes_of(name, values)
                assert list(classes.limits) == sorted(set(classes.limits))
                assert len(classes.colours) == len(classes.labels) == len(classes.limits) + 1 <= 7
                assert classes.limits[-1] <= greatest or len(classes.limits) == 1
        assert ElementTree.fromstring(raster_style(classes, layer.unit).partition("\n")[2]) is not None


ENERGIES = np.geomspace(1.0, 2500.0, 100)


def test_the_classes_of_energy_have_the_swiss_limits():
    assert {30.0, 300.0} <= set(classes_of("E_95CI", ENERGIES).limits)
    assert {30.0, 300.0} <= set(classes_of("E_95CI", np.geomspace(25.0, 310.0, 20)).limits)
    values = np.array([29.9, 30.0, 299.0, 300.0, 0.0, np.nan])
    colours = classes_of("E_95CI", ENERGIES).colours_of(values)
    assert len(np.unique(colours[:4, :3], axis=0)) == 4
    assert colours[:, 3].tolist() == [1, 1, 1, 1, 0, 0]
    for value, colour in zip((29.9, 299.0, 2000.0), colours[[0, 2]], strict=False):
        np.testing.assert_allclose(colour_in_qgis(value), colour[:3], atol=0.5 / 255)


def colour_in_qgis(value: float) -> list[float]:
    """The colour of a value, as QGIS finds it in the style: that of the first entry above."""
    style = ElementTree.fromstring(raster_style(classes_of("E_95CI", ENERGIES), "kJ").partition("\n")[2])
    entry = next(item for item in style.iter("item") if value < float(item.attrib["value"]))
    return [int(entry.attrib["color"][i : i + 2], 16) / 255 for i in (1, 3, 5)]


def test_styles_of_lines_and_points_are_well_formed():
    for style in (line_style((0.9, 0.4, 0.0), 0.3, 0.5), point_style((0.0, 0.0, 0.0), 1.5, "triangle")):
        root = ElementTree.fromstring(style.partition("\n")[2])
        assert root.find("renderer-v2/symbols/symbol/layer/Option/Option") is not None


def test_points_have_an_edge_that_is_seen_on_white_paper():
    for colour, dark in (((1.0, 1.0, 1.0), True), ((0.1, 0.4, 0.8), False)):
        root = ElementTree.fromstring(point_style(colour, 1.5).partition("\n")[2])
        edge = root.find("renderer-v2/symbols/symbol/layer/Option/Option[@name='outline_color']")
        assert (max(map(int, edge.attrib["value"].split(",")[:3])) < 100) == dark


def test_codes_of_systems():
    assert epsg_code(" epsg:25832 ") == 25832
    assert epsg_code("LV95") is None
    assert code_remarks("EPSG:25832") == code_remarks("LV95") == code_remarks("") == []


@pytest.mark.parametrize("code", [900913, 102100, 102113])
def test_a_code_of_web_maps_before_epsg_had_one_is_written_as_that(tmp_path, code):
    rasterio = pytest.importorskip("rasterio", reason="rasterio, an independent reader of GeoTIFF, is not installed")
    shift = GlobalShift(800_000.0, 5_800_000.0, 0.0, f"EPSG:{code}")
    cells = Cells(0.0, 0.0, 2.0, 4, 3)
    write_map(tmp_path / "a.tif", cells, np.ones((3, 4)), next(iter(LAYERS.values())), shift)
    with rasterio.open(tmp_path / "a.tif") as opened:
        assert opened.crs.to_epsg() == 3857
    (remark,) = code_remarks(shift.crs)
    assert f"no code {code}; files are written with 3857" in remark.text


@pytest.mark.parametrize("crs", ["EPSG:65536", "EPSG:102003", "EPSG:999999999", "EPSG:0", "EPSG:32767"])
def test_a_code_that_no_file_has_room_for_is_named_in_words(tmp_path, crs):
    rasterio = pytest.importorskip("rasterio", reason="rasterio, an independent reader of GeoTIFF, is not installed")
    shift = GlobalShift(800_000.0, 5_800_000.0, 0.0, crs, "EPSG:70000")
    write_map(tmp_path / "a.tif", Cells(0.0, 0.0, 2.0, 4, 3), np.ones((3, 4)), next(iter(LAYERS.values())), shift)
    with rasterio.open(tmp_path / "a.tif") as opened:
        assert opened.crs is None
        assert opened.tags()["CRS"] == crs
    (remark,) = code_remarks(crs)
    assert remark.severity == "warning"
    write_geopackage(tmp_path / "a.gpkg", [], shift)
