# SPDX-License-Identifier: GPL-3.0-or-later
"""Frames that are kept are those of the file, in any order, and are decoded once."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from rockfall.core.footage import sources
from rockfall.core.footage.sources import Kept, frames, reduced, reduction
from rockfall.core.footage.video import Video, open_video, read_frames

ROUNDING = 4
"""Grey levels by which a picture may differ that was kept as the film holds it."""
FILM = Path(__file__).parent.parent / "data" / "videos" / "variable.mp4"


@pytest.mark.parametrize("room", [1_000_000_000, 20 * 64 * 48 * 3 // 2, 0])
def test_kept_frames_are_those_of_the_file(room: int, monkeypatch: pytest.MonkeyPatch) -> None:
    decoded: list[int] = []

    def counted(video: Video, indices: Sequence[int]) -> object:
        decoded.extend(indices)
        return read_frames(video, indices)

    monkeypatch.setattr(sources, "MOST_BYTES", room)
    monkeypatch.setattr(sources, "read_frames", counted)
    video = open_video(FILM)
    truth = dict(read_frames(video))
    kept = Kept(video)
    for order in (range(67), range(66, -1, -1), [3, 9, 9, 40], range(20, 50)):
        found = list(frames(kept, order))
        assert [index for index, _ in found] == list(order)
        for index, picture in found:
            np.testing.assert_allclose(picture.astype(float), truth[index], atol=ROUNDING)
    there = len(kept._pictures)
    if room > 1e8:
        assert sorted(decoded) == list(range(67))
    else:
        assert there <= 20
        assert len(decoded) > 67 + 30
    assert (there > 0) == (room > 0)


def test_a_picture_that_is_asked_for_twice_is_the_same(monkeypatch: pytest.MonkeyPatch) -> None:
    """Kept or decoded again: films that repeat pictures are known by it."""
    monkeypatch.setattr(sources, "MOST_BYTES", 20 * 64 * 48 * 3 // 2)
    kept = Kept(open_video(FILM), upto=40)
    first, second = (dict(frames(kept, range(67))) for _ in range(2))
    assert 0 < len(kept._pictures) <= 20
    for index in range(67):
        np.testing.assert_array_equal(first[index], second[index])


def test_the_frames_around_the_click_are_kept_where_not_all_fit(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sources, "MOST_BYTES", 40 * 64 * 48 * 3 // 2)
    kept = Kept(open_video(FILM), upto=30)
    list(frames(kept, range(67)))
    assert set(range(11, 31)) <= set(kept._pictures)
    even = [index for index in range(67) if kept.is_spread(index)]
    assert set(even) <= set(kept._pictures)
    assert set(np.diff(even).tolist()) == {even[1] - even[0]}
    assert len(even) > 15


@pytest.mark.parametrize(
    ("width", "height", "scale"),
    [
        (640, 360, 1),
        (1920, 1080, 1),
        (2048, 1080, 1),
        (3840, 2160, 2),
        (2704, 1520, 2),
        (7680, 4320, 4),
        (3841, 2160, 1),
    ],
)
def test_large_pictures_are_reduced_to_about_full_hd(width: int, height: int, scale: int) -> None:
    assert reduction(width, height) == scale


def test_reduced_pixels_are_means() -> None:
    picture = np.random.default_rng(1).integers(0, 255, (8, 12, 3), dtype=np.uint8)
    means = picture.reshape(4, 2, 6, 2, 3).mean(axis=(1, 3))
    np.testing.assert_allclose(reduced(picture, 2), means, atol=0.51)
