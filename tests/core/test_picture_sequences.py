# SPDX-License-Identifier: GPL-3.0-or-later
"""Sequences of pictures as videos: from a folder or a name, with a rate that must be stated."""

from pathlib import Path

import cv2
import numpy as np
import pytest
from rockfall.core.cli import main
from rockfall.core.errors import InputError
from rockfall.core.exchange.project import read_project
from rockfall.core.footage.sequences import sequence_beside, sequence_of
from rockfall.core.footage.video import open_video, read_frame, read_frames
from rockfall.core.workflow.footage import open_entry

NUMBERS = (7, 8, 9, 11, 12)


def picture(number: int, size: tuple[int, int] = (40, 30)) -> np.ndarray:
    """A picture whose brightness tells its number."""
    made = np.full((size[1], size[0], 3), 10 * number, np.uint8)
    made[:5] = 255
    return made


def folder(path: Path, numbers: tuple[int, ...] = NUMBERS, name: str = "img_{:04d}.png") -> Path:
    path.mkdir(exist_ok=True)
    for number in numbers:
        cv2.imwrite(str(path / name.format(number)), picture(number))
    return path


@pytest.mark.parametrize("given", ["", "img_%04d.png", "img_%d.png"])
def test_a_folder_or_a_name_is_a_video_with_the_times_of_its_numbers(given: str, tmp_path: Path) -> None:
    """A number that is missing leaves a gap in time."""
    video = open_video(folder(tmp_path / "shots") / given, rate_hz=25)
    np.testing.assert_allclose(video.time_s, np.array([0, 1, 2, 4, 5]) / 25)
    assert (video.width, video.height, video.frames) == (40, 30, 5)
    assert video.gaps.tolist() == [2]
    assert video.missing.tolist() == [1]
    assert [int(shown[20, 20, 0]) // 10 for _, shown in read_frames(video)] == list(NUMBERS)
    assert read_frame(video, 3, grey=True)[20, 20] == 110


def test_numbers_without_zeros_are_in_their_order(tmp_path: Path) -> None:
    found = sequence_of(folder(tmp_path / "s", (2, 10, 9, 1), "f{}.jpg"))
    assert found.number.tolist() == [1, 2, 9, 10]
    assert [file.name for file in found.files] == ["f1.jpg", "f2.jpg", "f9.jpg", "f10.jpg"]
    assert sequence_beside(Path("a/IMG_0012_x.JPG")) == Path("a/IMG_%04d_x.JPG")
    assert sequence_beside(Path("a/photo.png")) == Path("a/photo.png")


def test_16_bits_and_a_turn_in_the_exif_data_are_read_as_they_are_seen(tmp_path: Path) -> None:
    """EXIF orientation 6: the picture is to be turned by 90° clockwise (Exif 2.3, tag 0x0112)."""
    deep = (tmp_path / "deep").absolute()
    deep.mkdir()
    for number in (1, 2):
        cv2.imwrite(str(deep / f"{number}.png"), np.full((30, 40, 3), 257 * 10 * number, np.uint16))
    assert read_frame(open_video(deep, rate_hz=10), 1)[5, 5, 0] == 20
    turned = tmp_path / "turned"
    turned.mkdir()
    exif = b"Exif\0\0MM\0*\0\0\0\x08\0\x01\x01\x12\0\x03\0\0\0\x01\0\x06\0\0\0\0\0\0"
    for number in (1, 2):
        data = cv2.imencode(".jpg", picture(number))[1].tobytes()
        segment = b"\xff\xe1" + (len(exif) + 2).to_bytes(2, "big") + exif
        (turned / f"{number}.jpg").write_bytes(data[:2] + segment + data[2:])
    video = open_video(turned, rate_hz=10)
    assert (video.width, video.height) == (30, 40)
    assert (read_frame(video, 0)[20, -4:] > 200).all(), "the top of the stored picture is on the right"


def refusal(path: Path, rate: float | None = 25) -> str:
    with pytest.raises(InputError) as caught:
        open_video(path, rate_hz=rate)
    return str(caught.value).removeprefix(str(caught.value.file))


def test_what_is_refused(tmp_path: Path) -> None:
    shots = folder(tmp_path / "shots")
    assert "has no times of its own. Say how many were taken a second: --fps 25" in refusal(shots, None)
    assert "The rate 0 is not above 0" in refusal(shots, 0.0)
    assert "no pictures, and a sequence has two or more" in refusal(tmp_path)
    assert "a single picture" in refusal(folder(tmp_path / "one", (3,)))
    assert "no pictures" in refusal(shots / "other_%04d.png")
    cv2.imwrite(str(shots / "img_0010.png"), picture(10, (41, 30)))
    with pytest.raises(InputError, match="Frame 3 has 41 × 30 px, and the first has 40 × 30"):
        open_video(shots, rate_hz=25, thorough=True)
    (shots / "img_0010.png").write_bytes(b"no picture")
    with pytest.raises(InputError, match="cannot be read"):
        list(read_frames(open_video(shots, rate_hz=25)))
    (shots / "img_0010.png").unlink()
    cv2.imwrite(str(shots / "img_7.png"), picture(7))
    assert "img_0007.png and img_7.png have the same number" in refusal(shots)
    (shots / "img_7.png").rename(shots / "other_7.png")
    assert "pictures of 2 kinds: img_….png, other_….png" in refusal(shots)
    (shots / "other_7.png").rename(shots / "cover.png")
    assert "The picture cover.png has no number" in refusal(shots)
    with pytest.raises(InputError, match="no rate can be given"):
        open_video(Path(__file__).parents[1] / "data" / "videos" / "constant.mp4", rate_hz=25)


def test_inspect_tells_of_a_sequence(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["inspect", str(folder(tmp_path / "shots")), "--fps", "25"]) == 0
    said = capsys.readouterr().out
    assert "PNG in a sequence of pictures" in said
    assert "5 pictures, img_0007.png to img_0012.png" in said
    assert "1 missing after frame 2 at 0.080 s" in said
    assert main(["inspect", str(tmp_path / "shots")]) == 1
    assert "--fps 25" in capsys.readouterr().err


def test_a_project_names_a_sequence_and_its_rate(tmp_path: Path) -> None:
    folder(tmp_path / "shots")
    text = 'schema = 1\n[[videos]]\nname = "left"\nfile = "shots/img_%04d.png"\nrate_hz = 50.0\n'
    (tmp_path / "project.toml").write_text(text)
    entry = read_project(tmp_path / "project.toml").videos[0]
    assert entry.rate_hz == 50
    np.testing.assert_allclose(open_entry(entry).time_s, np.array([0, 1, 2, 4, 5]) / 50)


def test_align_and_track_take_a_sequence(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A disc that moves by 4 px a picture is followed to its last place; a camera gets the pictures' size."""
    rng = np.random.default_rng(2)
    ground = np.kron(110 + 15 * rng.normal(size=(30, 60)), np.ones((4, 4)))
    v, u = np.mgrid[: ground.shape[0], : ground.shape[1]]
    (tmp_path / "s").mkdir()
    for number in range(40):
        image = np.where(np.hypot(u + 0.5 - 20 - 4 * number, v + 0.5 - 40 - number) < 6, 220.0, ground)
        cv2.imwrite(
            str(tmp_path / "s" / f"a{number:03d}.png"), np.repeat(image.astype(np.uint8)[:, :, None], 3, axis=2)
        )
    given = [str(tmp_path / "s" / "a%03d.png"), "--fps", "25"]
    out = tmp_path / "o"
    assert main(["track", *given, "--click", "10,60,50", "--still", "--out", str(out)]) == 0
    capsys.readouterr()
    rows = [line.split(",") for line in (out / "track.csv").read_text().splitlines()]
    head, last = rows[0], rows[-1]
    assert float(last[head.index("time_s")]) == pytest.approx(int(last[head.index("frame")]) / 25)
    assert float(last[head.index("u_px")]) == pytest.approx(20 + 4 * int(last[head.index("frame")]), abs=0.7)
    points = np.array([[-8, 30, -3], [8, 32, -4], [-6, 40, 5], [7, 45, 6], [0, 35, 0], [3, 50, -5.0]])
    pixel = np.column_stack([120 + 240 * points[:, 0] / points[:, 1], 60 - 240 * points[:, 2] / points[:, 1]])
    lines = ["u_px,v_px,x_m,y_m,z_m", *(",".join(map(str, row)) for row in np.column_stack([pixel, points]).tolist())]
    (tmp_path / "pairs.csv").write_text("\n".join(lines))
    assert main(["align", str(tmp_path / "pairs.csv"), "--video", *given, "--out", str(tmp_path / "c")]) == 0
    assert "Focal length: 240.0" in capsys.readouterr().out
