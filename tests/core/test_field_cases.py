# SPDX-License-Identifier: GPL-3.0-or-later
"""Small files of the kinds that have gone wrong in the field, each through its command: the right number, or the cause.

What each file holds is known from how it was made: see its ``command.txt``.
"""

import csv
from pathlib import Path

import numpy as np
import pytest
import trimesh
from rockfall.core import cli

CASES = Path(__file__).parents[1] / "data" / "field_cases"
EDGE = 0.5


def heights(folder: Path) -> np.ndarray:
    return np.asarray(trimesh.load(folder / "terrain.ply", process=False).vertices)[:, 2]


def area_in_plan(folder: Path) -> float:
    mesh = trimesh.load(folder / "terrain.ply", process=False)
    return float(np.abs(mesh.face_normals[:, 2] * mesh.area_faces).sum())


@pytest.fixture
def terrain(tmp_path: Path, capsys: pytest.CaptureFixture):
    def run(name: str) -> tuple[Path, str]:
        """The output, and what was said."""
        assert cli.main(["terrain", str(CASES / name), "--no-picture", "--out", str(tmp_path / "o")]) == 0
        said = capsys.readouterr().out.replace(str(tmp_path), "")
        return tmp_path / "o", said

    return run


@pytest.mark.parametrize(
    ("file", "low", "high"),
    [
        ("01-tiff-scale-offset/int16scaled.tif", 1200.0, 1213.0),
        ("15-world-file/tfw.tif", None, None),
        ("13-asc-headers/bom.asc", None, None),
        ("13-asc-headers/comma.asc", None, None),
        ("13-asc-headers/nodatafloat.asc", None, None),
        ("14-ply-vertex-list/list_var.ply", None, None),
        ("14-ply-vertex-list/be_list.ply", None, None),
    ],
)
def test_it_is_read(terrain, file: str, low: float | None, high: float | None) -> None:
    folder, _ = terrain(file)
    found = heights(folder)
    assert np.isfinite(found).all()
    assert np.ptp(found) < 1000  # no filler, no list that was taken for a coordinate
    assert np.abs(found).max() < 5000
    if low is not None and high is not None:
        np.testing.assert_allclose([found.min(), found.max()], [low, high], atol=EDGE)


@pytest.mark.parametrize(
    ("file", "words"),
    [
        ("02-crs-in-feet/ftUS.tif", "US survey feet"),
        ("03-point-number-first/numid.txt", "left out"),
        ("05-las-withheld/withheld.las", "withheld"),
        ("06-tiff-nodata/mask.tif", "mask"),
        ("06-tiff-nodata/undecl9999.tif", "-9999"),
        ("06-tiff-nodata/zero.tif", "0"),
        ("06-tiff-nodata/nodatazero.asc", "0"),
        ("07-coarse-coordinates/f32utm.ply", "steps of"),
        ("07-coarse-coordinates/utm.stl", "steps of"),
        ("07-coarse-coordinates/sixdigits.obj", "steps of"),
        ("07-coarse-coordinates/scale1.las", "steps of"),
    ],
)
def test_it_is_read_and_said(terrain, file: str, words: str) -> None:
    folder, said = terrain(file)
    assert words.lower() in said.lower()
    assert np.ptp(heights(folder)) < 1000


@pytest.mark.parametrize(
    ("file", "area"), [("08-concave-polygon/L2.obj", 300.0), ("08-concave-polygon/ngon.obj", 400.0)]
)
def test_polygons_keep_their_area(terrain, file: str, area: float) -> None:
    folder, _ = terrain(file)
    assert area_in_plan(folder) == pytest.approx(area, rel=1e-6)


def test_decimal_commas_of_an_obj_are_named(tmp_path: Path, capsys: pytest.CaptureFixture) -> None:
    file = CASES / "13-asc-headers" / "comma.obj"
    assert cli.main(["terrain", str(file), "--no-picture", "--out", str(tmp_path / "o")]) == 1
    assert "decimal comma" in capsys.readouterr().err.partition("comma.obj")[2]


@pytest.mark.parametrize(
    ("file", "words"),
    [
        ("04-repeated-frames/ball_dup.mp4", "repeat"),
        ("04-repeated-frames/dup23.mp4", "repeat"),
        ("09-second-stream/two.mkv", "stream"),
        ("16-capture-fps-tag/slow_meta.mp4", "120"),
    ],
)
def test_of_a_video_it_is_said(file: str, words: str, capsys: pytest.CaptureFixture) -> None:
    assert cli.main(["inspect", str(CASES / file)]) == 0
    assert words in capsys.readouterr().out.replace(str(CASES), "")


def test_pairs_in_feet_are_refused_and_pixels_that_are_not_square_are_held(
    tmp_path: Path, capsys: pytest.CaptureFixture
) -> None:
    folder = CASES / "10-nonsquare-camera"
    video = str(folder / "par1080.mp4")
    assert cli.main(["align", str(folder / "nonsq.csv"), "--video", video, "--out", str(tmp_path / "a")]) == 0
    with (tmp_path / "a" / "pairs_residuals.csv").open(newline="") as stream:
        off = [[float(row["residual_u_px"]), float(row["residual_v_px"])] for row in csv.DictReader(stream)]
    assert np.sqrt(np.mean(np.square(off))) < 1.0  # 4 px with square pixels
    capsys.readouterr()
    assert cli.main(["align", str(folder / "ftz.csv"), "--size", "1920x1080", "--out", str(tmp_path / "b")]) == 1
    assert "feet" in capsys.readouterr().err


@pytest.mark.parametrize("file", ["rel_ok.shp", "rel_ok.zip"])
def test_a_shapefile_releases_blocks(file: str, tmp_path: Path) -> None:
    folder = CASES / "12-shapefile-kml"
    command = ["simulate", "--terrain", str(folder / "dem.tif"), "--from-polygon", str(folder / file)]
    assert cli.main([*command, "--number", "5", "--model", "noel_2017", "--out", str(tmp_path / "o")]) == 0
    with (tmp_path / "o" / "runs.csv").open(newline="") as stream:
        assert len(list(csv.DictReader(stream))) == 5


def test_what_lies_outside_is_said(tmp_path: Path, capsys: pytest.CaptureFixture) -> None:
    folder = CASES / "11-release-outside"
    command = ["simulate", "--terrain", str(folder / "dem.tif"), "--from-polygon", str(folder / "partly.geojson")]
    assert cli.main([*command, "--number", "5", "--model", "noel_2017", "--out", str(tmp_path / "o")]) == 0
    assert "75 % of the area of the release area" in capsys.readouterr().out


def test_a_map_in_degrees_of_another_place_is_named(tmp_path: Path, capsys: pytest.CaptureFixture) -> None:
    folder = CASES / "12-shapefile-kml"
    command = ["simulate", "--terrain", str(folder / "dem.tif"), "--from-polygon", str(folder / "rel.kml")]
    assert cli.main([*command, "--number", "5", "--model", "noel_2017", "--out", str(tmp_path / "o")]) == 1
    assert "outside of the terrain" in capsys.readouterr().err.partition("rel.kml")[2]
