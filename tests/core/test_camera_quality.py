# SPDX-License-Identifier: GPL-3.0-or-later
"""What a camera rests on goes with its file, and is said by whatever is measured with the camera."""

import re
import shutil
from pathlib import Path

import numpy as np
import pytest
from rockfall.core.camera.path import fixed
from rockfall.core.camera.quality import PARAMETERS, CameraQuality, from_plain, remarks_on_quality, to_plain
from rockfall.core.cli import main
from rockfall.core.errors import InputError
from rockfall.core.exchange.cameras import read_camera, read_pairs, write_camera
from rockfall.core.exchange.project import read_project
from rockfall.core.film.composed.material import open_material
from rockfall.core.film.composed.request import FilmRequest
from rockfall.core.georeference import Z_UP
from rockfall.core.workflow.alignment import AlignmentOptions, align
from rockfall.core.workflow.opening import camera_remarks, read_project_camera

DEMO = Path(__file__).parents[2] / "assets" / "demo" / "footage"
SIZE = (1280, 720)
RESTS = "rests on 5 pairs, after pair P6 was left out (3 observations more than unknowns)"


def few(count: int = 5):
    """The camera of the demo's footage from some of its pairs."""
    pairs = read_pairs(DEMO / "pairs.csv")
    return align(pairs.some(np.arange(count)), AlignmentOptions(SIZE)).found


@pytest.fixture
def project(tmp_path) -> Path:
    """The demo's footage, whose camera is that of five pairs."""
    folder = tmp_path / "site"
    shutil.copytree(DEMO, folder, ignore=shutil.ignore_patterns("truth"))
    text = (folder / "project.toml").read_text(encoding="utf-8")
    for name in re.findall(r'"(\.\./[^"]+)"', text):
        text = text.replace(name, (DEMO / name).resolve().as_posix())
    (folder / "project.toml").write_text(text, encoding="utf-8")
    read = read_camera(folder / "camera.toml")
    quality = CameraQuality(5, 3, ("P6",), ("P2",), 2.04)
    write_camera(
        folder / "camera.toml", read.path, rmse_px=read.rmse_px, sigma=read.sigma,
        pose_covariance=read.pose_covariance, quality=quality,
    )  # fmt: skip
    return folder / "project.toml"


def test_quality_goes_through_the_file_to_the_last_bit(tmp_path) -> None:
    found = few()
    write_camera(tmp_path / "camera.toml", fixed(found.camera), quality=found.quality)
    read = read_camera(tmp_path / "camera.toml").quality
    assert read is not None
    assert (read.pairs, read.redundancy, read.left_out) == (5, 3, ())
    assert read.sigma_position_m == found.quality.sigma_position_m
    np.testing.assert_array_equal(read.covariance, found.whole)
    again = from_plain(to_plain(read))
    names = ("pairs", "redundancy", "left_out", "asked", "sigma_position_m")
    assert [getattr(again, name) for name in names] == [getattr(read, name) for name in names]
    np.testing.assert_array_equal(again.covariance, found.whole)


def test_files_of_earlier_versions_say_nothing(tmp_path) -> None:
    write_camera(tmp_path / "camera.toml", fixed(few().camera), rmse_px=0.3)
    assert "quality" not in (tmp_path / "camera.toml").read_text(encoding="utf-8")
    read = read_camera(tmp_path / "camera.toml")
    assert read.quality is None
    assert remarks_on_quality(read.quality, "left") == ()


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("redundancy = 3", "", "quality.redundancy is missing"),
        ("redundancy = 3", "redundancy = -3", "quality.redundancy"),
        ("pairs = 5", 'pairs = "five"', "quality.pairs"),
        ('"rx"', '"roll"', "quality.covariance_of is"),
        ("sigma_position_m = ", "sigma_position_m = -", "quality.sigma_position_m is"),
    ],
)
def test_a_wrong_quality_names_its_key(tmp_path, old, new, said) -> None:
    path, found = tmp_path / "camera.toml", few()
    write_camera(path, fixed(found.camera), quality=found.quality)
    text = path.read_text(encoding="utf-8")
    assert old in text
    path.write_text(text.replace(old, new), encoding="utf-8")
    with pytest.raises(InputError) as caught:
        read_camera(path)
    assert said in str(caught.value)


def test_what_is_said_of_few_pairs_and_of_a_pair_to_look_at() -> None:
    (few_pairs,) = remarks_on_quality(CameraQuality(5, 3, ("4",), (), 2.0), "left")
    assert few_pairs.severity == "warning"
    assert few_pairs.text == (
        "All that is measured with the camera left rests on 5 pairs, after pair 4 was left out (3 observations more "
        "than unknowns): its position is known to 2 m (standard deviation). A wrong pair would hardly show. Add pairs "
        "(10 or more are good), near and far, out to the edges."
    )
    (asked,) = remarks_on_quality(CameraQuality(28, 48, (), ("27",), 0.9), "left")
    assert "It hangs on pair 27: look at it again." in asked.text
    assert "Add pairs" not in asked.text
    assert remarks_on_quality(CameraQuality(20, 33, ("4",), (), 0.1), "left") == ()


def test_the_covariance_turns_with_the_world() -> None:
    """Of a terrain whose second axis is up: the pose's position turns, the lens and the camera's own axes do not."""
    quality = few().quality
    turned = quality.turned(Z_UP)
    assert quality.covariance is not None
    assert turned.covariance is not None
    np.testing.assert_allclose(turned.covariance[3:6, 3:6], Z_UP @ quality.covariance[3:6, 3:6] @ Z_UP.T, atol=1e-12)
    np.testing.assert_array_equal(turned.covariance[6:, 6:], quality.covariance[6:, 6:])
    assert len(PARAMETERS) == 15


def test_align_says_it_and_keeps_it(tmp_path, capsys) -> None:
    lines = (DEMO / "pairs.csv").read_text(encoding="utf-8").splitlines()
    (tmp_path / "pairs.csv").write_text("\n".join(lines[:6]) + "\n", encoding="utf-8")
    assert main(["align", str(tmp_path / "pairs.csv"), "--size", "1280x720", "--out", str(tmp_path / "out")]) == 0
    assert "With 5 pairs a wrong one can hardly be told." in capsys.readouterr().out
    quality = read_camera(tmp_path / "out" / "camera.toml").quality
    assert quality is not None
    assert quality.pairs == 5
    assert quality.covariance is not None


def test_whatever_is_made_with_such_a_camera_says_so(project, tmp_path, capsys) -> None:
    (said,) = camera_remarks(read_project(project))
    assert RESTS in said.text
    assert RESTS in " ".join(read_project_camera(project.parent / "camera.toml", None)[1])
    refined = tmp_path / "refine" / "project.toml"
    for command in (
        ["refine", str(project)],
        ["motion", str(refined), "--tables-only"],
        ["reconstruct", str(refined)],
    ):
        assert main([*command, "--out", str(tmp_path / command[0])]) == 0, capsys.readouterr().err
        assert RESTS in capsys.readouterr().out, command
    assert any(RESTS in remark for remark in open_material(FilmRequest("overlay", refined)).remarks)


def test_a_refined_camera_says_it_still_but_keeps_no_covariance_of_the_old_pose(project, tmp_path) -> None:
    assert main(["refine", str(project), "--free", "camera", "--out", str(tmp_path / "out")]) == 0
    (file,) = (tmp_path / "out").glob("camera_*.toml")
    quality = read_camera(file).quality
    assert quality is not None
    assert (quality.pairs, quality.left_out, quality.covariance) == (5, ("P6",), None)


def test_a_camera_that_cannot_be_read_stops_no_reconstruction(project) -> None:
    (project.parent / "camera.toml").write_text("width = 3\n", encoding="utf-8")
    assert camera_remarks(read_project(project)) == ()
