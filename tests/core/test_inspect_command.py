# SPDX-License-Identifier: GPL-3.0-or-later
"""``rockfall inspect``: what it says, writes and refuses."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from rockfall.core.cli import main
from rockfall.core.commands.inspect import _timing
from rockfall.core.footage.video import open_video

FOLDER = Path(__file__).parent.parent / "data" / "videos"


def told(capsys, *argv):
    assert main(["inspect", *map(str, argv)]) == 0
    captured = capsys.readouterr()
    assert captured.err == ""
    return captured.out


def test_it_tells_what_there_is(capsys):
    said = told(capsys, FOLDER / "variable.mp4")
    assert "64 × 48 px\n" in said
    assert "H.264 in MP4" in said
    assert "67 can be decoded, 67 announced" in said
    assert "variable (lowest" in said
    assert "2 missing after frame 9 at" in said
    assert "3 frames are missing in 2 gaps" in said
    assert "motion" not in said


def test_rates_and_the_first_of_many_gaps():
    """100 frames at 30 a second, of which some are missing after seven of them."""
    step = np.full(99, 1 / 30)
    step[[10, 20, 31, 47, 58, 70, 88]] += np.array([1, 2, 1, 3, 1, 1, 5]) / 30
    video = replace(open_video(FOLDER / "constant.mp4"), time_s=1.5 + np.r_[0, np.cumsum(step)])
    rows = dict(_timing(video, None))
    assert rows["rate"] == "30 frames a second, constant (lowest 5, median 30, highest 30); announced 30"
    assert rows["duration"] == "3.800 s, frames from 1.500 to 5.267 s"
    assert rows["gaps"].split("; ") == [
        "1 missing after frame 10 at 1.833 s",
        "2 missing after frame 20 at 2.200 s",
        "1 missing after frame 31 at 2.633 s",
        "3 missing after frame 47 at 3.200 s",
        "1 missing after frame 58 at 3.667 s",
        "and 2 more gaps",
    ]
    six = replace(video, time_s=video.time_s[:80])
    assert dict(_timing(six, None))["gaps"].endswith("; 1 missing after frame 58 at 3.667 s; and 1 more gap")
    five = replace(video, time_s=video.time_s[:60])
    assert dict(_timing(five, None))["gaps"].endswith("; 1 missing after frame 58 at 3.667 s")
    assert dict(_timing(replace(video, time_s=video.time_s[:5]), None))["gaps"] == "none"
    doubled = replace(video, time_s=np.repeat(np.arange(20) / 8, 2) + np.tile([0, 0.05], 20))
    assert (
        "(lowest 13.33, median 20, highest 20, times rounded to milliseconds)" in dict(_timing(doubled, None))["rate"]
    )


def test_rotation_and_slow_motion(capsys):
    said = told(capsys, FOLDER / "rotated.mov", "--capture-rate", "239.76")
    assert "48 × 64 px, shown turned by 90° clockwise" in said
    assert "29.97 frames a second, constant" in said
    assert "8 times slower than life: the 1.335 s took 0.167 s" in said
    assert "up to 48 a second" in said


def test_cut_files(capsys):
    assert "the file should have 24 frames, and 11 can be decoded" in told(capsys, FOLDER / "cut.avi")
    assert "1 can be decoded, 1 announced" in told(capsys, FOLDER / "single.mp4")


def test_speed_is_given_or_told_by_picks(tmp_path, capsys):
    picks = tmp_path / "picks.csv"
    picks.write_text("trajectory,time_s,x_m,y_m,z_m\na,0,0,0,0\na,1,0,0,-4\na,2,0,0,-13\nb,0,900,0,0\n")
    block = ["--diameter", "0.35"]
    by_speed = told(capsys, FOLDER / "constant.mp4", *block, "--speed", "9")
    assert "At 9 m/s a rolling block of 0.35 m diameter turns 8.2 times a second: 41 frames" in by_speed
    assert told(capsys, FOLDER / "constant.mp4", *block, "--picks", picks) == by_speed


def test_frames_are_written(tmp_path, capsys):
    out = tmp_path / "out"
    assert "Written: frames.csv" in told(capsys, FOLDER / "variable.mkv", "--out", out)
    lines = (out / "frames.csv").read_text().splitlines()
    assert lines[:3] == ["frame,time_s,step_s", "0,0.000000,", "1,0.037000,0.037000"]
    times = np.array([float(line.split(",")[1]) for line in lines[1:]])
    assert times.size == 67
    assert (np.diff(times) > 0).all()


@pytest.mark.parametrize("name", ["none.mp4", "cut.mp4", "strange.mp4"])
def test_bad_videos_end_with_status_1(name, tmp_path, capsys):
    assert main(["inspect", str(FOLDER / name), "--out", str(tmp_path / "out")]) == 1
    captured = capsys.readouterr()
    assert captured.out == ""
    *progress, message = captured.err.splitlines()
    assert message.startswith(f"rockfall: {FOLDER / name}: ")
    assert all(line.endswith(" …") for line in progress)
    assert not (tmp_path / "out").exists()


def test_picks_without_a_pair_give_no_speed(tmp_path, capsys):
    (tmp_path / "picks.csv").write_text("trajectory,time_s,x_m,y_m,z_m\na,0,0,0,0\nb,1,0,0,-4\n")
    argv = ["inspect", str(FOLDER / "constant.mp4"), "--diameter", "0.35", "--picks", str(tmp_path / "picks.csv")]
    assert main(argv) == 1
    assert "picks.csv: No trajectory has two picks, so there is no speed. Use --speed." in capsys.readouterr().err


def test_usage(capsys):
    assert main(["inspect", str(FOLDER / "constant.mp4"), "--speed", "-3"]) == 2
    assert main(["inspect"]) == 2
    assert "usage" in capsys.readouterr().err
