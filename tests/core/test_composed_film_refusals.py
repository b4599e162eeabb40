# SPDX-License-Identifier: GPL-3.0-or-later
"""What of a project, a video or a folder no composed film can be made of: it is said, with what to do."""

import shutil
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from rockfall.core.camera.model import Camera, look_at
from rockfall.core.camera.path import fixed
from rockfall.core.cli import main
from rockfall.core.errors import RockfallError
from rockfall.core.exchange.cameras import write_camera
from rockfall.core.film.check import check_film, check_index, check_picture

VIDEO = Path(__file__).parents[1] / "data" / "videos" / "constant.mp4"
"""40 frames of 64 × 48 pixels in 1.3 s."""
PROJECT = """schema = 1
[terrain]
file = "slope.obj"
[picks]
file = "picks.csv"
[block]
d1_m = 0.5
d2_m = 0.5
d3_m = 0.4
[[videos]]
name = "side"
file = "side.mp4"
camera = "side.toml"
offset_s = 0.0
[[videos]]
name = "unaligned"
file = "side.mp4"
[[render]]
name = "small"
width = 192
height = 108
fps = 5.0
"""


@pytest.fixture
def camera() -> Camera:
    return look_at(64, 48, [2.0, -25.0, 12.0], [4.0, 0.0, -3.0], focal_px=60.0)


@pytest.fixture
def site(tmp_path: Path, camera: Camera) -> Path:
    """A plane, two runs of which the video shows the first, and a camera."""
    folder = tmp_path / "site"
    folder.mkdir()
    corners = [(x, y, -0.8 * x) for x, y in ((-20, -20), (40, -20), (40, 20), (-20, 20))]
    (folder / "slope.obj").write_text("".join(f"v {x} {y} {z}\n" for x, y, z in corners) + "f 1 2 3\nf 1 3 4\n")
    rows = ["trajectory,time_s,x_m,y_m,z_m,kind"]
    for name, start in (("A", 0.0), ("B", 100.0)):
        rows += [f"{name},{start + 0.4 * k},{3.0 * k},0,{-2.4 * k},impact" for k in range(4)]
    (folder / "picks.csv").write_text("\n".join(rows) + "\n")
    shutil.copy(VIDEO, folder / "side.mp4")
    write_camera(folder / "side.toml", fixed(camera))
    (folder / "project.toml").write_text(PROJECT)
    return folder


def refused(site: Path, capsys: pytest.CaptureFixture[str], *words: str) -> str:
    """What is said; nothing may be written."""
    out = site.parent / "out"
    assert main(["render", str(site / "project.toml"), "--preset", "small", *words, "--out", str(out)]) == 1
    assert not out.exists()
    return capsys.readouterr().err.strip().split("\n")[-1]


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--film", "story2"], "There is no film 'story2'. Did you mean story"),
        (["--film", "overlay", "--still", "--language", "it"], "Films do not speak 'it'. Known languages: en, fr, de"),
        (["--film", "overlay", "--images", "--frames", "900-910"], "The film has no frame 900. Its last frame is "),
        (["--film", "overlay", "--still", "--block", "cube"], "There is no solid and no file 'cube'. Give --block one"),
        (["--film", "overlay", "--still", "--trajectory", "C"], "There is no trajectory 'C'. There are: A, B"),
        (["--film", "overlay", "--still", "--video", "top"], "There is no video 'top'. Videos of the project: side"),
        (["--film", "overlay", "--still", "--video", "unaligned"], "'unaligned' has no file or no camera. Align it"),
        (["--film", "contact_sheet", "--trajectory", "B"], "'side' shows none of the measured blocks: it lasts from 0"),
        (["--film", "stroboscopic", "--trajectory", "B"], "'side' shows none of the measured blocks"),
    ],
)
def test_requests_that_do_not_fit_the_project(
    site: Path, capsys: pytest.CaptureFixture[str], words: list[str], said: str
) -> None:
    assert said in refused(site, capsys, *words)


@pytest.mark.parametrize(
    ("option", "text", "said"),
    [
        *(
            ("--sun", text, f"{text} is no place of the sun: azimuth 0 to")
            for text in ("400,50", "10,0", "10,91", "x", "1")
        ),
        *(("--frames", text, f"{text} is no frame, and no range") for text in ("5-2", "a", "1-", "3.5")),
        *(("--slow-at", text, f"{text} are not the numbers of impacts") for text in ("2,x", "1.5", "2,")),
    ],
)
def test_options_that_cannot_be_read(
    site: Path, capsys: pytest.CaptureFixture[str], option: str, text: str, said: str
) -> None:
    words = ["render", str(site / "project.toml"), "--film", "overlay", option, text, "--out", str(site / "out")]
    assert main(words) == 2
    assert f"argument {option}: {said}" in capsys.readouterr().err
    assert not (site / "out").exists()


def test_a_project_without_footage_or_terrain(site: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (site / "project.toml").write_text(PROJECT.replace('camera = "side.toml"\n', ""))
    said = refused(site, capsys, "--film", "overlay", "--still")
    assert f"{site / 'project.toml'}: The film 'overlay' shows footage" in said
    assert "make the film turntable or fly_along" in said
    (site / "project.toml").write_text(PROJECT.replace('[terrain]\nfile = "slope.obj"\n', ""))
    said = refused(site, capsys, "--film", "turntable", "--still")
    assert "The film 'turntable' shows the terrain, and the project names none. Add [terrain]" in said


def test_a_camera_of_another_picture(site: Path, camera: Camera, capsys: pytest.CaptureFixture[str]) -> None:
    write_camera(site / "side.toml", fixed(replace(camera, width=640, height=480)))
    said = refused(site, capsys, "--film", "overlay", "--still")
    assert f"{site / 'side.toml'}: The camera is of a picture of 640 × 480 pixels, the video has 64 × 48. " in said


@pytest.mark.parametrize("name", ["k1", "k2", "k3", "p1", "p2"])
def test_a_lens_that_cannot_be(site: Path, capsys: pytest.CaptureFixture[str], name: str) -> None:
    text = (site / "side.toml").read_text()
    assert f"{name} = 0.0\n" in text
    (site / "side.toml").write_text(text.replace(f"{name} = 0.0\n", f"{name} = 1e308\n"))
    said = refused(site, capsys, "--film", "overlay", "--still")
    assert f"{site / 'side.toml'}: {name} is 1e+308, beyond what can be (±1e+06). Correct it" in said


def test_runs_of_which_nothing_is_known(site: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (site / "picks.csv").write_text("trajectory,time_s,x_m,y_m,z_m,kind\nA,0,0,0,0,impact\n")
    said = refused(site, capsys, "--film", "turntable", "--still")
    assert str(site) in said
    assert "project.toml: Nothing measured can be shown. Pick impacts first" in said


def test_a_contact_sheet_of_a_video_without_impacts(site: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The block flies while it lasts."""
    text = (site / "picks.csv").read_text().split("\n")
    (site / "picks.csv").write_text("\n".join([text[0], "A,-3,0,0,0,impact", "A,9,9,0,-7.2,impact"]) + "\n")
    assert "No impact happens while the video lasts. Pick impacts, or name another video" in refused(
        site, capsys, "--film", "contact_sheet"
    )


def test_a_stroboscope_of_a_block_that_is_behind_the_camera(site: Path, recwarn: pytest.WarningsRecorder) -> None:
    """It has no pixels: the picture is made, and no library warns."""
    behind = look_at(64, 48, [2.0, -25.0, 12.0], [2.0, -90.0, 2.0], focal_px=60.0)
    write_camera(site / "side.toml", fixed(behind))
    words = ["--preset", "small", "--film", "stroboscopic", "--out", str(site / "out")]
    assert main(["render", str(site / "project.toml"), *words]) == 0
    assert not [str(one.message) for one in recwarn]
    assert (site / "out" / "stroboscopic.png").is_file()


def test_a_folder_of_somebody_elses_pictures_is_left_alone(site: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = site.parent / "film"
    (out / "turntable").mkdir(parents=True)
    (out / "turntable" / "holiday.jpg").write_bytes(b"sea")
    words = ["--preset", "small", "--film", "turntable", "--images", "--frames", "0-1", "--out", str(out)]
    assert main(["render", str(site / "project.toml"), *words]) == 1
    assert "The folder for the frames holds other files (holiday.jpg). Move them" in capsys.readouterr().err
    assert [file.name for file in (out / "turntable").iterdir()] == ["holiday.jpg"]
    assert (out / "turntable" / "holiday.jpg").read_bytes() == b"sea"


def test_films_that_are_not_whole(tmp_path: Path) -> None:
    check_film(VIDEO, 40, (64, 48))
    check_index(VIDEO, 40, (64, 48))
    with pytest.raises(RockfallError, match=r"constant.mp4 as it should be: 40 of its 41 frames can be read\. "):
        check_film(VIDEO, 41, (64, 48))
    with pytest.raises(RockfallError, match=r"its frames have 64 × 48 pixels instead of 64 × 36\. "):
        check_film(VIDEO, 40, (64, 36))
    with pytest.raises(RockfallError, match=r"it says that it has 40 frames of 64 × 48 pixels\. "):
        check_index(VIDEO, 39, (64, 48))
    empty = tmp_path / "empty.mp4"
    empty.touch()
    for check in (check_film, check_index):
        with pytest.raises(RockfallError, match=r"empty.mp4 as it should be: nothing was written\. "):
            check(empty, 1, (64, 48))


def test_pictures_that_are_not_whole(tmp_path: Path) -> None:
    whole = cv2.imencode(".png", np.full((8, 9, 3), 90, np.uint8))[1].tobytes()
    file = tmp_path / "still.png"
    file.write_bytes(whole)
    check_picture(file, (9, 8))
    with pytest.raises(RockfallError, match="it cannot be read"):
        check_picture(file, (8, 9))
    file.write_bytes(whole[:-1])
    with pytest.raises(RockfallError, match="it ends too early"):
        check_picture(file, (9, 8))
    file.write_bytes(b"no picture" + whole[-12:])
    with pytest.raises(RockfallError, match="it cannot be read"):
        check_picture(file, (9, 8))
    file.unlink()
    with pytest.raises(RockfallError, match="nothing was written"):
        check_picture(file, (9, 8))


def test_a_page_of_runs_of_which_nothing_is_known(site: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (site / "picks.csv").write_text("trajectory,time_s,x_m,y_m,z_m,kind\nA,0,0,0,0,impact\n")
    assert main(["web", str(site / "project.toml"), "--out", str(site / "out")]) == 1
    said = f"{site / 'project.toml'}: No measured block can be shown: no flight is known. Pick two impacts or more"
    assert said in capsys.readouterr().err
    assert not (site / "out").exists()


def test_a_page_of_simulated_blocks_without_a_terrain(site: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (site / "project.toml").write_text(PROJECT.replace('[terrain]\nfile = "slope.obj"\n', ""))
    words = ["web", str(site / "project.toml"), "--simulate", "noel_2017", "--out", str(site / "out")]
    assert main(words) == 1
    said = f"{site / 'project.toml'}: Simulated blocks fall on a terrain, and the project names none. Add [terrain]"
    assert said in capsys.readouterr().err
    assert not (site / "out").exists()
