# SPDX-License-Identifier: GPL-3.0-or-later
"""Every field of a grid that changes what its numbers mean, against GDAL (rasterio)."""

from pathlib import Path

import numpy as np
import pytest
import rasterio
import tifffile
from rasterio.crs import CRS
from rasterio.enums import MaskFlags
from rasterio.transform import Affine
from rockfall.core.errors import InputError
from rockfall.core.terrain.geotiff import read_geotiff
from rockfall.core.terrain.grids import read_ascii_grid
from rockfall.core.terrain.opening import HowToRead, read_placed
from rockfall.core.terrain.source import Source

CASES = Path(__file__).parents[1] / "data" / "field_cases"
HEIGHTS = np.arange(1200, 1230, dtype=np.float32).reshape(5, 6)
PLACE = Affine(2.0, 0.0, 2600000.0, 0.0, -2.0, 1200010.0)
FOOT, US_FOOT = 0.3048, 1200 / 3937


def write(path: Path, heights: np.ndarray = HEIGHTS, crs: str | None = "EPSG:2056", **options) -> Path:
    """A GeoTIFF of GDAL's; `mask`, `scale`, `offset`, `unit` and `tags` are set after its heights."""
    more = {key: options.pop(key, None) for key in ("mask", "scale", "offset", "unit")}
    options = {"transform": PLACE, "dtype": heights.dtype, "crs": crs, **options}
    bands = heights if heights.ndim == 3 else heights[None]
    count, height, width = bands.shape
    with rasterio.open(path, "w", driver="GTiff", width=width, height=height, count=count, **options) as file:
        file.write(bands)
        if more["scale"] is not None:
            file.scales, file.offsets = [more["scale"]] * count, [more["offset"]] * count
        if more["unit"] is not None:
            file.set_band_unit(1, more["unit"])
        if more["mask"] is not None:
            file.write_mask(more["mask"])
    return path


def as_gdal(path: Path) -> tuple[np.ndarray, np.ndarray]:
    """(n, 2) centres of cells, and (n,) heights in the file's unit with NaN where there is none, as GDAL says."""
    with rasterio.open(path) as file:
        values = file.read(1, masked=True)
        heights = np.ma.filled(values.astype(np.float64), np.nan) * file.scales[0] + file.offsets[0]
        column, row = np.meshgrid(np.arange(file.width) + 0.5, np.arange(file.height) + 0.5)
        x, y = file.transform @ (column.ravel(), row.ravel())
    return np.column_stack([x, y]), heights.ravel()


def check_as_gdal(path: Path) -> Source:
    source = read_geotiff(path)
    places, heights = as_gdal(path)
    np.testing.assert_allclose(source.points[:, :2], places, rtol=0, atol=1e-6)
    np.testing.assert_allclose(source.points[:, 2], heights, rtol=1e-12)
    return source


def metres(path: Path, **how) -> Source:
    return read_placed(path, HowToRead(**how))


def raw_tiff(path: Path, heights: np.ndarray = HEIGHTS, tags=(), **options) -> Path:
    extra = [(code, type_, 0 if type_ == 2 else len(value), value, True) for code, type_, value in tags]
    options = {"photometric": "minisblack", "metadata": None, **options}
    tifffile.imwrite(path, heights, extratags=extra, **options)
    return path


PIXEL_SCALE = (33550, 12, (2.0, 2.0, 0.0))
TIE_POINT = (33922, 12, (0.0, 0.0, 0.0, 2600000.0, 1200010.0, 0.0))


def geokeys(*keys: tuple[int, int]) -> tuple[int, int, tuple[int, ...]]:
    return 34735, 3, (1, 1, 0, len(keys), *(n for key, value in keys for n in (key, 0, 1, value)))


def test_scale_and_offset_of_a_geotiff(tmp_path):
    raw = np.arange(20000, 20030, dtype=np.int16).reshape(5, 6)
    raw[0, 0] = -32768
    path = write(tmp_path / "a.tif", raw, scale=0.01, offset=1000.0, nodata=-32768)
    source = check_as_gdal(path)
    assert np.isnan(source.points[0, 2])
    assert source.points[1, 2] == pytest.approx(1200.01)
    assert any("0.01 times" in note for note in source.notes)
    heights = read_geotiff(CASES / "01-tiff-scale-offset" / "int16scaled.tif").points[:, 2]
    assert (heights.min(), heights.max()) == pytest.approx((1200.0, 1213.0))


def test_scale_unit_and_no_data_of_the_file_beside(tmp_path):
    """GDAL puts there what a format, or somebody who may not write the file, cannot say in it."""
    path = write(tmp_path / "a.tif", nodata=1201.0)
    path.with_name("a.tif.aux.xml").write_text(
        "<PAMDataset><GeoTransform>10, 3, 0, 20, 0, -3</GeoTransform><PAMRasterBand band='1'>"
        "<NoDataValue>1205</NoDataValue><UnitType>ft</UnitType><Offset>7</Offset><Scale>0.5</Scale>"
        "</PAMRasterBand></PAMDataset>"
    )
    source = check_as_gdal(path)
    assert np.flatnonzero(np.isnan(source.points[:, 2])).tolist() == [5]
    np.testing.assert_allclose(metres(path).points[0], [11.5, 18.5, (1200 * 0.5 + 7) * FOOT])
    path.with_name("a.tif.aux.xml").write_text("<PAMDataset><PAMRasterBand")
    with pytest.raises(InputError, match=r"a\.tif\.aux\.xml: .*cannot be read"):
        read_geotiff(path)


@pytest.mark.parametrize(
    ("crs", "flat", "height"),
    [
        ("EPSG:2056", 1.0, 1.0),
        ("EPSG:2229", US_FOOT, US_FOOT),
        ("EPSG:2222", FOOT, FOOT),
        ("EPSG:32611+6360", 1.0, US_FOOT),
        ("EPSG:2229+5703", US_FOOT, 1.0),
        ("+proj=tmerc +lat_0=0 +lon_0=9 +k=1 +x_0=0 +y_0=0 +ellps=GRS80 +to_meter=0.5 +no_defs", 0.5, 0.5),
    ],
)
def test_units_of_the_systems_of_a_geotiff(tmp_path, crs, flat, height):
    with rasterio.Env(GTIFF_REPORT_COMPD_CS=True):
        path = write(tmp_path / "a.tif", crs=crs)
    places, heights = as_gdal(path)
    source = metres(path)
    np.testing.assert_allclose(source.points[:, :2], places * flat, rtol=1e-12)
    np.testing.assert_allclose(source.points[:, 2], heights * height, rtol=1e-12)
    overruled = metres(path, unit_m=2.0, height_unit_m=3.0).points
    np.testing.assert_allclose(overruled, np.column_stack([places * 2.0, heights * 3.0]), rtol=1e-12)
    np.testing.assert_allclose(metres(path, height_unit_m=1.0).points[:, 2], heights)
    assert any("Nothing says" in note for note in source.notes) == (height == flat != 1.0)
    assert source.crs.endswith(" in metres") == (flat != 1.0 and bool(source.crs))


def test_a_unit_that_is_stated_goes_before_that_of_the_code(tmp_path):
    """As in GDAL; 9001 is the metre, 9002 the foot, 32767 a unit whose length stands in another key."""
    for code, length in ((9001, 1.0), (9002, FOOT)):
        keys = geokeys((1024, 1), (1025, 1), (3072, 2229), (3076, code), (4099, 9002))
        path = raw_tiff(tmp_path / "a.tif", tags=[PIXEL_SCALE, TIE_POINT, keys])
        with rasterio.open(path) as file:
            assert file.crs.linear_units_factor[1] == pytest.approx(length)
        assert metres(path).points[0] == pytest.approx([2600001 * length, 1200009 * length, 1200 * FOOT])
    directory = (1, 1, 0, 3, 1024, 0, 1, 1, 3076, 0, 1, 32767, 3077, 34736, 1, 0)
    tags = [PIXEL_SCALE, TIE_POINT, (34735, 3, directory), (34736, 12, (0.25,))]
    assert metres(raw_tiff(tmp_path / "b.tif", tags=tags)).points[0, 0] == 2600001 * 0.25


def test_the_unit_of_a_band_goes_before_that_of_the_heights(tmp_path):
    path = write(tmp_path / "a.tif", unit="US survey foot")
    assert metres(path).points[0, 2] == pytest.approx(1200 * US_FOOT)
    with pytest.raises(InputError, match=r'a\.tif: The grid is in "degree"'):
        read_geotiff(write(tmp_path / "a.tif", unit="degree"))


@pytest.mark.parametrize(
    ("crs", "problem"),
    [("EPSG:4326", "in degrees"), ("EPSG:4978", "geocentric"), ("EPSG:32631+5715", "depths, which grow downwards")],
)
def test_systems_without_plane_coordinates_and_heights_are_refused(tmp_path, crs, problem):
    """In the file, beside it, and where a project states it."""
    from rockfall.core.terrain.readers import read_terrain, read_tiles

    (tmp_path / "b.asc").write_text("ncols 2\nnrows 2\nxllcorner 0\nyllcorner 0\ncellsize 1\n1 2\n3 4\n")
    with pytest.raises(InputError, match=problem):
        read_tiles([tmp_path / "b.asc"], HowToRead(crs=crs))
    (tmp_path / "b.prj").write_text(CRS.from_string(crs).to_wkt(version="WKT2_2019"))
    with pytest.raises(InputError, match=problem):
        read_terrain(tmp_path / "b.asc")
    if crs != "EPSG:4978":  # which GDAL does not put into a GeoTIFF
        with rasterio.Env(GTIFF_REPORT_COMPD_CS=True), pytest.raises(InputError, match=problem):
            read_terrain(write(tmp_path / "a.tif", crs=crs))


@pytest.mark.parametrize("internal", [True, False], ids=["in the file", "beside it"])
def test_masks_of_a_geotiff(tmp_path, internal):
    there = np.ones(HEIGHTS.shape, np.bool_)
    there[1:3, 2] = False
    with rasterio.Env(GDAL_TIFF_INTERNAL_MASK=internal):
        path = write(tmp_path / "a.tif", mask=there)
    assert (tmp_path / "a.tif.msk").exists() != internal
    with rasterio.open(path) as file:
        assert MaskFlags.per_dataset in file.mask_flag_enums[0]
    source = check_as_gdal(path)
    np.testing.assert_array_equal(np.isfinite(source.points[:, 2]), there.ravel())
    assert "2 cells have no height (the file's mask)." in source.notes


def test_an_alpha_band_takes_cells_out(tmp_path):
    alpha = np.full(HEIGHTS.shape, 65535, np.uint16)
    alpha[4, 5] = 0
    path = write(tmp_path / "a.tif", np.stack([HEIGHTS.astype(np.uint16), alpha]), ALPHA="YES")
    heights = check_as_gdal(path).points[:, 2]
    assert np.flatnonzero(np.isnan(heights)).tolist() == [29]


@pytest.mark.parametrize(
    ("kind", "stored", "text"),
    [
        ("f4", -3.4028234663852886e38, "-3.4028234663852886e+38"),
        ("f4", np.float32(-9999.9), "-9999.9"),
        ("f8", -9999.9, "-9999.9"),
        ("i2", -32768, "-32768"),
        ("u2", 65535, "65535"),
        ("i4", -2147483648, "-2147483648.0"),
    ],
)
def test_the_declared_no_data_value_is_compared_in_the_precision_of_the_heights(tmp_path, kind, stored, text):
    heights = HEIGHTS.astype(kind)
    heights[2, 2] = stored
    heights[3, 3] = 1
    path = raw_tiff(tmp_path / "a.tif", heights, [PIXEL_SCALE, TIE_POINT, (42113, 2, text)])
    assert np.flatnonzero(np.isnan(check_as_gdal(path).points[:, 2])).tolist() == [14]


@pytest.mark.parametrize("filler", [-9999, -32768, 32767, -99999, 3.4028235e38, -3.4028235e38, 1e38])
def test_fillers_that_no_file_declares_are_no_heights(tmp_path, filler):
    heights = HEIGHTS.copy()
    heights[1, 1:3] = filler
    source = read_geotiff(write(tmp_path / "a.tif", heights))
    assert np.flatnonzero(np.isnan(source.points[:, 2])).tolist() == [7, 8]
    rows = "\n".join(" ".join(f"{value:.8g}" for value in row) for row in heights.tolist())
    (tmp_path / "a.asc").write_text(f"ncols 6\nnrows 5\nxllcorner 0\nyllcorner 0\ncellsize 1\n{rows}\n")
    np.testing.assert_array_equal(read_ascii_grid(tmp_path / "a.asc").points[:, 2], source.points[:, 2])
    if abs(filler) < 1e30:
        assert any(f"2 cells of exactly {filler} are taken as without height" in note for note in source.notes)


def test_a_number_of_fillers_among_other_heights_is_one_of_them(tmp_path):
    """A grid in millimetres reaches them."""
    heights = np.linspace(-12000, 40000, 30).reshape(5, 6).astype(np.float32)
    heights[2, 2], heights[3, 3] = -9999, 32767
    assert np.isfinite(read_geotiff(write(tmp_path / "a.tif", heights)).points[:, 2]).all()


def test_pits_of_zero_are_no_heights_but_the_sea_is(tmp_path):
    pits, coast = HEIGHTS.copy(), HEIGHTS - 1200
    pits[2, 2:4] = 0
    source = read_geotiff(write(tmp_path / "a.tif", pits))
    assert np.flatnonzero(np.isnan(source.points[:, 2])).tolist() == [14, 15]
    assert any("2 cells of exactly 0 are taken as without height: the height nearest" in note for note in source.notes)
    coast[0, :3] = 0
    assert np.isfinite(read_geotiff(write(tmp_path / "a.tif", coast)).points[:, 2]).all()
    for name in ("mask.tif", "undecl9999.tif", "zero.tif", "nodatazero.asc"):
        heights = read_placed(CASES / "06-tiff-nodata" / name, HowToRead()).points[:, 2]
        assert int(np.isnan(heights).sum()) == 4, name
        assert (np.nanmin(heights), np.nanmax(heights)) == (1200.0, 1213.0), name


def test_world_files_say_where_the_centre_of_the_first_cell_is(tmp_path):
    for name, rows in (("a.tfw", "2\n0\n0\n-2\n100,5\n200,5\n"), ("b.TFW", "1\n0.5\n0.25\n-2\n1000\n2000\n")):
        path = raw_tiff(tmp_path / f"{name[0]}.tif")
        (tmp_path / name).write_text(rows)
        source = check_as_gdal(path) if "," not in rows else read_geotiff(path)
        numbers = [float(word.replace(",", ".")) for word in rows.split()]
        np.testing.assert_allclose(source.points[0, :2], numbers[4:])
        np.testing.assert_allclose(source.points[1, :2] - source.points[0, :2], numbers[:2])
        assert f"Its place is that of {name}." in source.notes
    for extension in (".tifw", ".wld"):
        path = raw_tiff(tmp_path / f"{extension[1:]}.tif")
        path.with_suffix(extension).write_text("2\n0\n0\n-2\n7\n8\n")
        assert read_geotiff(path).points[0, :2].tolist() == [7.0, 8.0]
    for bad in ("2\n0\n0\n-2\n7\n", "2\n0\n0\nx\n7\n8\n", "0\n0\n0\n-2\n7\n8\n"):
        path.with_suffix(".wld").write_text(bad)
        with pytest.raises(InputError, match=r"wld\.wld: (The world file does not have six|The pixels .* no area)"):
            read_geotiff(path)


def test_a_world_file_beside_a_geotiff(tmp_path):
    """The GeoTIFF goes before it, as in GDAL, unless its place only counts its cells; the system is that of the prj."""
    path = write(tmp_path / "a.tif")
    path.with_suffix(".tfw").write_text("2\n0\n0\n-2\n2600001\n1200009\n")
    assert not [note for note in check_as_gdal(path).notes if "another place" in note]
    path.with_suffix(".tfw").write_text("2\n0\n0\n-2\n7\n8\n")
    assert "a.tfw says another place than the GeoTIFF, which goes before it." in check_as_gdal(path).notes
    case = CASES / "15-world-file" / "tfw.tif"
    assert read_geotiff(case).points[0, :2].tolist() == [352000.0, 5130020.0]
    alone = tmp_path / "tfw.tif"
    alone.write_bytes(case.read_bytes())
    with pytest.raises(InputError, match=r"tfw\.tif: The TIFF's georeference only counts its pixels"):
        read_geotiff(alone)
    alone.with_suffix(".tfw").write_text("2\n0\n0\n-2\n6000000\n2000000\n")
    alone.with_suffix(".prj").write_text(CRS.from_epsg(2229).to_wkt(version="WKT1_ESRI"))
    assert metres(alone).points[0] == pytest.approx([6e6 * US_FOOT, 2e6 * US_FOOT, 1201 * US_FOOT], rel=1e-9)


def test_rows_with_a_negative_height_run_south_as_in_gdal(tmp_path):
    path = raw_tiff(tmp_path / "a.tif", tags=[(33550, 12, (2.0, -2.0, 3.0)), TIE_POINT])
    notes = check_as_gdal(path).notes
    assert [any(words in note for note in notes) for words in ("run south", "gives z a scale of 3")] == [True, True]


def test_control_points_are_no_georeference(tmp_path):
    points = (33922, 12, (0.0, 0.0, 0.0, 10.0, 20.0, 0.0, 5.0, 0.0, 0.0, 30.0, 21.0, 0.0))
    with pytest.raises(InputError, match=r"a\.tif: The TIFF has control points \(2\), not a georeference"):
        read_geotiff(raw_tiff(tmp_path / "a.tif", tags=[points]))


def test_pieces_that_the_file_leaves_out_have_no_height(tmp_path):
    heights = np.full((64, 64), 1200.0, np.float32)
    heights[:32, 32:] = 0
    path = write(tmp_path / "a.tif", heights, tiled=True, blockxsize=32, blockysize=32, SPARSE_OK=True)
    source = read_geotiff(path)
    expected = np.zeros((64, 64), np.bool_)
    expected[:32, 32:] = True
    np.testing.assert_array_equal(np.isnan(source.points[:, 2]), expected.ravel())
    assert "1,024 cells have no height (a piece of the file that is not there)." in source.notes


def test_overviews_are_not_the_heights_and_further_pictures_are_said(tmp_path):
    heights = np.arange(4096, dtype=np.float32).reshape(64, 64)
    path = write(tmp_path / "a.tif", heights)
    with rasterio.open(path, "r+") as file:
        file.build_overviews([2, 4])
    assert len(check_as_gdal(path).points) == 4096
    tags = [(code, type_, len(value), value, True) for code, type_, value in (PIXEL_SCALE, TIE_POINT)]
    with tifffile.TiffWriter(tmp_path / "b.tif") as tiff:
        tiff.write(HEIGHTS, subfiletype=1, metadata=None)
        tiff.write(HEIGHTS + 1, extratags=tags, metadata=None)
        tiff.write(HEIGHTS + 2, metadata=None)
    source = read_geotiff(tmp_path / "b.tif")
    assert source.points[0, 2] == 1201.0
    assert "The first of 2 pictures in the file is taken as the heights." in source.notes


@pytest.mark.parametrize(
    ("options", "problem"),
    [
        ({"photometric": "palette", "colormap": np.zeros((3, 256), np.uint16)}, "a picture with a palette of colours"),
        ({"photometric": "rgb"}, "picture of 3 bands"),
        ({"photometric": "rgb", "kind": np.uint16}, r"a picture with colours \(rgb\)"),
    ],
)
def test_pictures_are_no_heights(tmp_path, options, problem):
    kind = options.pop("kind", np.uint8)
    shape = (5, 6) if options["photometric"] == "palette" else (5, 6, 3)
    path = raw_tiff(tmp_path / "a.tif", np.zeros(shape, kind), [PIXEL_SCALE, TIE_POINT], **options)
    with pytest.raises(InputError, match=problem):
        read_geotiff(path)


def test_what_looks_like_a_picture_is_said(tmp_path):
    source = read_geotiff(write(tmp_path / "a.tif", (HEIGHTS - 1200).astype(np.uint8)))
    assert any("The heights have 8 bits" in note for note in source.notes)


def test_values_are_as_stored_whatever_a_viewer_does_with_them(tmp_path):
    """White at zero, and an orientation: GDAL applies neither to numbers."""
    whole = (HEIGHTS - 1200).astype(np.uint8)
    check_as_gdal(raw_tiff(tmp_path / "a.tif", whole, [PIXEL_SCALE, TIE_POINT], photometric="miniswhite"))
    check_as_gdal(raw_tiff(tmp_path / "b.tif", tags=[PIXEL_SCALE, TIE_POINT, (274, 3, (3,))]))
    keys = geokeys((1024, 1), (1025, 2), (3072, 2056))
    check_as_gdal(raw_tiff(tmp_path / "c.tif", tags=[PIXEL_SCALE, TIE_POINT, keys]))


HEADER = {"ncols": "3", "nrows": "2", "xllcorner": "10", "yllcorner": "20", "cellsize": "2", "NODATA_value": "-9999"}
ROWS = "1 2 3\n4 5 -9999\n"


def asc(path: Path, change: dict[str, str | None] | None = None, rows: str = ROWS, before: bytes = b"") -> Path:
    header = {key: value for key, value in (HEADER | (change or {})).items() if value is not None}
    text = "".join(f"{key} {value}\n" for key, value in header.items()) + rows
    path.write_bytes(before + text.encode())
    return path


@pytest.mark.parametrize(
    ("change", "rows", "before"),
    [
        ({}, ROWS, b""),
        ({}, ROWS, b"\xef\xbb\xbf"),
        ({"xllcorner": "10,0", "cellsize": "2,0"}, "1,0 2,0 3,0\n4,0 5,0 -9999\n", b""),
        ({"xllcorner": None, "yllcorner": None, "xllcenter": "11", "yllcenter": "21"}, ROWS, b""),
        ({"cellsize": None, "dx": "2", "dy": "2"}, ROWS, b""),
        ({"NODATA_value": "-3.4028235e38"}, ROWS.replace("-9999", "-3.40282346638529e+38"), b""),
        ({"NODATA_value": "-3.4028e38"}, ROWS.replace("-9999", "-3.40282346638529e+38"), b""),
        ({"NODATA_value": "-1.1"}, ROWS.replace("-9999", "-1.10000002384186"), b""),
        ({"NODATA_value": None}, ROWS, b""),
        ({"NODATA_value": "nan"}, ROWS.replace("-9999", "nan"), b""),
        ({}, ROWS.replace("-9999", "-1.#IND00"), b""),
    ],
)
def test_headers_of_ascii_grids(tmp_path, change, rows, before):
    source = read_ascii_grid(asc(tmp_path / "a.asc", change, rows, before))
    expected = [[11, 23, 1], [13, 23, 2], [15, 23, 3], [11, 21, 4], [13, 21, 5], [15, 21, np.nan]]
    np.testing.assert_array_equal(source.points, expected)


def test_headers_of_ascii_grids_in_any_order_and_case(tmp_path):
    (tmp_path / "a.asc").write_text(
        "CELLSIZE 2\nnodata_value -9999 NRows 2\nYLLCORNER 20\nXllCorner 10\nnCols 3\n" + ROWS
    )
    np.testing.assert_array_equal(
        read_ascii_grid(tmp_path / "a.asc").points, read_ascii_grid(asc(tmp_path / "b.asc")).points
    )
    (tmp_path / "a.asc").write_text("ncols 3\nncols 4\nnrows 2\n" + ROWS)
    with pytest.raises(InputError, match=r"a\.asc, row 2: The header has ncols twice"):
        read_ascii_grid(tmp_path / "a.asc")


def test_the_cases_of_ascii_grids_are_one_grid():
    grids = {
        name: read_ascii_grid(CASES / "13-asc-headers" / f"{name}.asc") for name in ("bom", "comma", "nodatafloat")
    }
    for name, source in grids.items():
        assert source.grid_shape == (21, 21)
        np.testing.assert_array_equal(source.points[0, :2], [352000.0, 5130020.0], name)
        assert np.nanmax(source.points[:, 2]) == pytest.approx(1213.0)
    assert int(np.isnan(grids["nodatafloat"].points[:, 2]).sum()) == 4


def test_units_beside_an_ascii_grid(tmp_path):
    """Of a .prj in Esri's or other well-known text, and of GDAL's .aux.xml."""
    path = asc(tmp_path / "a.asc")
    for version in ("WKT1_ESRI", "WKT1_GDAL", "WKT2_2019"):
        path.with_suffix(".prj").write_text(CRS.from_string("EPSG:32611+6360").to_wkt(version=version))
        np.testing.assert_allclose(metres(path).points[0], [11, 23, US_FOOT])
    path.with_suffix(".prj").write_text(CRS.from_epsg(2222).to_wkt(version="WKT1_ESRI"))
    np.testing.assert_allclose(metres(path).points[0], np.array([11, 23, 1]) * FOOT)
    path.with_name("a.asc.aux.xml").write_text(
        "<PAMDataset><PAMRasterBand><UnitType>m</UnitType></PAMRasterBand></PAMDataset>"
    )
    np.testing.assert_allclose(metres(path).points[0], [11 * FOOT, 23 * FOOT, 1])


def test_the_case_of_a_geotiff_in_survey_feet():
    path = CASES / "02-crs-in-feet" / "ftUS.tif"
    source = metres(path)
    assert source.crs == "EPSG:2229 in metres"
    assert np.nanmin(source.points[:, 2]) == pytest.approx(1200.0, abs=0.01)
    assert np.nanmax(source.points[:, 2]) == pytest.approx(1213.0, abs=0.01)
    np.testing.assert_allclose(source.points[1, 0] - source.points[0, 0], 1.0, atol=1e-6)
