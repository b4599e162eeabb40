# SPDX-License-Identifier: GPL-3.0-or-later
"""Frames that are kept are those of the file, in any order, and are decoded once."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from rockfall.core.footage import sources
from rockfall.core.footage.sources import Kept, frames
from rockfall.core.footage.video import Video, open_video, read_frames

FILM = Path(__file__).parent.parent / "data" / "videos" / "variable.mp4"


@pytest.mark.parametrize("room", [1_000_000_000, 20 * 64 * 48 * 3, 0])
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
            np.testing.assert_array_equal(picture, truth[index])
    there = sum(kept.has(index) for index in range(67))
    if room > 1e8:
        assert sorted(decoded) == list(range(67))
    else:
        assert there <= 20
        assert len(decoded) > 67 + 30
    assert (there > 0) == (room > 0)
