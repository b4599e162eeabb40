# SPDX-License-Identifier: GPL-3.0-or-later
"""``rockfall track`` on the filmed ball."""

from pathlib import Path

import cv2
import numpy as np
import pytest
import rockfall
from rockfall.core.cli import main
from rockfall.core.exchange.footage_tables import read_events, read_track

BALL = Path(rockfall.__file__).parent / "assets" / "examples" / "bouncing_ball"
VIDEO = str(BALL / "balle1-vp9.avi")


def test_tables_picture_and_words(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "out"
    clicks = tmp_path / "clicks.csv"
    clicks.write_text("trajectory,frame,u_px,v_px\nball,120,206,170\nother,5,1,1\n")
    arguments = ["--clicks", str(clicks), "--trajectory", "ball", "--from", "90", "--to", "190", "--still"]
    assert main(["track", VIDEO, *arguments, "--capture-rate", "187.35", "--out", str(out)]) == 0
    told = capsys.readouterr().out
    track, events = read_track(out / "track.csv"), read_events(out / "events.csv")
    assert set(track.trajectory.tolist()) == {"ball"} == set(events.trajectory.tolist())
    assert track.frame[[0, -1]].tolist() == [90, 190]
    assert f"{len(track)} frames, 90 to 190" in told
    assert (track.sigma_px > 0).all()
    assert ((track.score > 0) & (track.score <= 1)).all()

    assert events.kind.tolist() == ["impact"]
    assert events.frame[0] in (136, 137)
    steady = (events.time_s[0] - track.time_s[0]) + 90 / 187.35  # the file's steps after the first are even
    assert steady == pytest.approx(0.733, abs=0.006)
    assert f"{steady:.3f}" in told
    assert 0 < events.sigma_time_s[0] < 0.003

    picture = cv2.imread(str(out / "track.png"))
    assert picture.shape[1] >= 1200
    plain = cv2.imread(str(out / "track.png"), cv2.IMREAD_REDUCED_COLOR_8)
    assert plain is not None
    saturated = (picture.max(axis=2).astype(int) - picture.min(axis=2)) > 120
    assert saturated.sum() > 2000  # the line


@pytest.mark.parametrize("near_px", [0.0, 8.0])
def test_near_and_far_ground_that_move_differently_are_told(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], near_px: float
) -> None:
    rng, film = np.random.default_rng(5), str(tmp_path / "film.avi")
    far, near = (cv2.GaussianBlur(rng.integers(0, 255, (400, 500, 3), np.uint8), (0, 0), 2) for _ in "ab")
    writer = cv2.VideoWriter(film, cv2.VideoWriter_fourcc(*"MJPG"), 30, (400, 300))
    for frame in range(40):
        pan = 2 * frame
        picture = far[:300, pan : pan + 400].copy()
        beyond = round(near_px * np.sin(frame / 6))
        picture[190:] = near[190 + 20 + beyond : 320 + beyond, pan : pan + 400]
        cv2.circle(picture, (30 + 8 * frame, 40 + 4 * frame), 9, (255, 255, 255), -1)
        writer.write(picture)
    writer.release()
    assert main(["track", film, "--click", "10,110,80", "--out", str(tmp_path / "out")]) == 0
    told = capsys.readouterr().out
    assert ("Parts of the background move differently, by " in told) == (near_px > 0)


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["--click", "60,400,48"], "outside the picture"),
        (["--click", "600,147,48"], "There is no frame 600"),
        (["--click", "60,147,48", "--to", "40"], "outside the frames 0 to 40"),
        (["--click", "60,147,48", "--from", "80", "--to", "70"], "comes after"),
        (["--click", "60,250,20"], "Nothing moves"),
        (["--clicks", "CLICKS"], "trajectories a, b"),
        ([], "no click"),
    ],
)
def test_bad_input_says_what_to_do_and_writes_nothing(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], arguments: list[str], says: str
) -> None:
    clicks = tmp_path / "clicks.csv"
    clicks.write_text("trajectory,frame,u_px,v_px\na,60,147,48\nb,70,157,54\n")
    arguments = [str(clicks) if word == "CLICKS" else word for word in arguments]
    out = tmp_path / "out"
    assert main(["track", VIDEO, *arguments, "--still", "--out", str(out)]) == 1
    assert says in capsys.readouterr().err
    assert not out.exists()


def test_files_that_are_no_video(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    broken = tmp_path / "broken.mp4"
    broken.write_bytes(np.random.default_rng(0).bytes(4000))
    for path in (broken, tmp_path / "missing.mp4"):
        assert main(["track", str(path), "--click", "0,1,1", "--out", str(tmp_path / "out")]) == 1
        assert path.name in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_a_click_must_be_three_numbers(tmp_path: Path) -> None:
    assert main(["track", VIDEO, "--click", "60;147;48", "--out", str(tmp_path / "out")]) == 2
