# SPDX-License-Identifier: GPL-3.0-or-later
"""Pictures that a film shows twice: found in coded films of known repeats, and not found where there are none."""

from pathlib import Path

import cv2
import numpy as np
import pytest
from rockfall.core.cli import main
from rockfall.core.exchange.footage_tables import read_events, read_track
from rockfall.core.footage.advice import with_repeats
from rockfall.core.footage.repeats import repeated_pictures, repeats_sentence, rhythm
from rockfall.core.footage.sources import repeats_at_a_glance
from rockfall.core.footage.video import open_video
from rockfall.core.reconstruction.sightings import Sightings
from rockfall.core.workflow.first_picks import _late_s

DATA = Path(__file__).parent.parent / "data"
FIELD, VIDEOS = DATA / "field_cases" / "04-repeated-frames", DATA / "videos"
ASSETS = Path(__file__).parents[2] / "assets"


def numbers(taken: int, rate: int, stored: int) -> list[int]:
    """Which of the taken pictures is shown in each frame of a film of another rate."""
    return [k * rate // stored for k in range(taken * stored // rate)]


def film(path: Path, shown: list[int], *, speed: float = 3.0, noise: float = 0.0, code: str = "mp4v") -> list[int]:
    """Write a disc before textured ground; returns the frames that repeat the one before."""
    rng = np.random.default_rng(3)
    ground = np.kron(110 + 18 * rng.normal(size=(30, 48)), np.ones((4, 4)))
    v, u = np.mgrid[: ground.shape[0], : ground.shape[1]]
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter_fourcc(*code), 30, ground.shape[::-1])
    taken: dict[int, np.ndarray] = {}
    for number in shown:
        if number not in taken:
            image = np.where(np.hypot(u - 12 - speed * number, v - 20 - 0.3 * speed * number) < 5, 215.0, ground)
            image = image + noise * rng.normal(size=image.shape)
            taken[number] = np.repeat(np.clip(image, 0, 255).astype(np.uint8)[:, :, None], 3, axis=2)
        writer.write(taken[number])
    writer.release()
    return [i for i in range(1, len(shown)) if shown[i] == shown[i - 1]]


@pytest.mark.parametrize("name", ["ball_dup.mp4", "dup23.mp4"])
def test_24_pictures_stored_as_30_in_h264(name: str) -> None:
    """Made so with ffmpeg: every fifth frame repeats the one before, at good and at low quality."""
    assert open_video(FIELD / name, thorough=True).repeated.tolist() == list(range(5, 59, 5))


@pytest.mark.parametrize("name", ["halves_crf20.mp4", "halves_crf34.mp4"])
def test_half_of_the_pictures_stored_twice_in_h264(name: str) -> None:
    assert open_video(VIDEOS / name, thorough=True).repeated.tolist() == list(range(1, 40, 2))


@pytest.mark.parametrize(("code", "suffix"), [("mp4v", ".mp4"), ("MJPG", ".avi")])
@pytest.mark.parametrize("noise", [0.0, 3.0])
@pytest.mark.parametrize(("rate", "stored"), [(24, 30), (15, 30), (24, 60)])
def test_conversions_in_other_codecs(
    rate: int, stored: int, noise: float, code: str, suffix: str, tmp_path: Path
) -> None:
    path = tmp_path / f"film{suffix}"
    twice = film(path, numbers(40, rate, stored), noise=noise, code=code)
    found = open_video(path, thorough=True).repeated.tolist()
    assert set(found) <= set(twice)
    assert len(found) >= 0.9 * len(twice)


@pytest.mark.parametrize(("speed", "noise"), [(0.0, 4.0), (0.3, 3.0), (0.3, 0.0), (3.0, 3.0), (3.0, 0.0)])
@pytest.mark.parametrize(("code", "suffix"), [("mp4v", ".mp4"), ("MJPG", ".avi")])
def test_films_without_repeats(speed: float, noise: float, code: str, suffix: str, tmp_path: Path) -> None:
    """A still ground with a sensor's noise, a block that moves by a third of a pixel, and a quick one."""
    film(tmp_path / f"film{suffix}", list(range(50)), speed=speed, noise=noise, code=code)
    assert open_video(tmp_path / f"film{suffix}", thorough=True).repeated.size == 0


@pytest.mark.parametrize("name", ["constant.mp4", "variable.mp4", "open_groups.ts", "vp9.webm", "none_crf34.mp4"])
def test_other_films_without_repeats(name: str) -> None:
    assert open_video(VIDEOS / name, thorough=True).repeated.size == 0


def test_the_demos_footage_repeats_nothing() -> None:
    """A camera that is held by hand, compressed: at a quarter, the middle and three quarters of it."""
    assert repeats_at_a_glance(open_video(ASSETS / "demo" / "footage" / "footage.mp4")) == ""
    whole = open_video(ASSETS / "demo" / "footage" / "footage.mp4", thorough=True)
    assert whole.repeated.size == 0, "where a hand turns back, the camera nearly stands still"
    assert "every 5th: about 24" in repeats_at_a_glance(open_video(FIELD / "dup23.mp4"))


def test_a_single_late_picture_is_found(tmp_path: Path) -> None:
    twice = film(tmp_path / "late.avi", [*range(12), 11, *range(12, 30)], noise=2.0, code="MJPG")
    assert open_video(tmp_path / "late.avi", thorough=True).repeated.tolist() == twice == [12]


def test_too_few_pictures_say_nothing() -> None:
    from rockfall.core.footage.repeats import Changes

    assert repeated_pictures(Changes(np.zeros(3), np.zeros(3))).size == 0


def test_rhythms() -> None:
    frames = np.arange(60)
    assert rhythm(frames[frames % 5 == 4]) == (1, 5)
    assert rhythm(frames[np.isin(frames % 5, [1, 3, 4])]) == (3, 5)
    assert rhythm(np.array([7, 19, 23, 48])) == (0, 0)
    assert rhythm(np.array([7, 12])) == (0, 0)
    assert repeats_sentence(np.empty(0, np.intp), 60, 30.0) == ""
    assert "1 of 60 frames repeats the picture before. They" in repeats_sentence(np.array([7]), 60, 30.0)
    assert "3 of every 5: about 24 pictures a second are stored as 60" in repeats_sentence(
        frames[np.isin(frames % 5, [1, 3, 4])], 60, 60.0
    )


def test_times_get_the_error_of_a_frame_that_is_uniformly_late() -> None:
    """In a rhythm all of them, else those beside a late picture; a uniform error of a step has step / √12."""
    video = open_video(VIDEOS / "constant.mp4")
    sigma, times = np.full(2, 0.001), np.array([10.2, 20.2]) / 30
    more = np.hypot(0.001, 1 / 30 / np.sqrt(12))
    np.testing.assert_allclose(with_repeats(sigma, times, video, np.arange(4, 40, 5)), more)
    np.testing.assert_allclose(with_repeats(sigma, times, video, np.array([9])), [more, 0.001])
    np.testing.assert_allclose(with_repeats(sigma, times, video, np.empty(0, np.intp)), 0.001)


def test_a_track_that_leaves_out_frames_in_a_rhythm_has_late_times() -> None:
    """As Blender and projects keep tracks, without what was found in the film."""

    def seen(frame: np.ndarray) -> Sightings:
        n = frame.size
        return Sightings(np.full(n, "a"), frame, frame / 30, np.zeros((n, 2)), np.full(n, 0.3))

    frame = np.arange(50)
    assert _late_s(seen(frame[frame % 5 != 4])) == pytest.approx(1 / 30 / np.sqrt(12))
    assert _late_s(seen(frame)) == 0.0
    assert _late_s(seen(np.setdiff1d(frame, [11, 12, 13]))) == 0.0
    assert _late_s(seen(np.full(3, -1))) == 0.0


def test_track_takes_no_repeated_picture_and_widens_the_times(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A ball that bounces off the ground at known moments, in 24 pictures a second stored as 30."""

    def place(t: float) -> tuple[float, float]:
        return 30 + 120 * t, 150 - abs(60 * np.sin(np.pi * t / 0.9))

    rng = np.random.default_rng(5)
    ground = np.kron(110 + 10 * rng.normal(size=(90, 160)), np.ones((2, 2)))
    v, u = np.mgrid[: ground.shape[0], : ground.shape[1]]
    writer = cv2.VideoWriter(str(tmp_path / "b.avi"), cv2.VideoWriter_fourcc(*"MJPG"), 30, ground.shape[::-1])
    shown = numbers(52, 24, 30)
    taken: dict[int, np.ndarray] = {}
    for number in shown:
        if number not in taken:
            x, y = place(number / 24)
            soft = np.clip(6.5 - np.hypot(u + 0.5 - x, v + 0.5 - y), 0, 1)
            image = ground * (1 - soft) + 225 * soft + 2 * rng.normal(size=ground.shape)
            taken[number] = np.repeat(np.clip(image, 0, 255).astype(np.uint8)[:, :, None], 3, axis=2)
        writer.write(taken[number])
    writer.release()
    x, y = place(shown[10] / 24)
    click = f"10,{x:.0f},{y:.0f}"
    assert main(["track", str(tmp_path / "b.avi"), "--click", click, "--still", "--out", str(tmp_path / "o")]) == 0
    said = capsys.readouterr().out
    assert "repeat the picture before, every 5th: about 24" in said
    assert "that repeat the one before are left out" in said
    twice = {i for i in range(1, len(shown)) if shown[i] == shown[i - 1]}
    track = read_track(tmp_path / "o" / "track.csv")
    assert not twice & set(track.frame.tolist())
    assert len(track) > 30
    events = read_events(tmp_path / "o" / "events.csv")
    assert len(events) == 2
    assert (events.sigma_time_s >= 1 / 30 / np.sqrt(12) - 1e-6).all()
    off = np.abs(events.time_s[:, None] - np.array([0.9, 1.8])).min(axis=1)
    assert (off < 3 * events.sigma_time_s).all()
