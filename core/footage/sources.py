# SPDX-License-Identifier: GPL-3.0-or-later
"""Where frames come from: a video file, or pictures that are already in memory."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from ..vectors import Array
from .video import Video, read_frames

CHUNK = 48
"""Frames held at a time while a video is read backwards."""


@dataclass(frozen=True, eq=False)
class Pictures:
    """Frames in memory.

    Attributes
    ----------
    images : f pictures, each (h, w, 3) BGR or (h, w) uint8.
    time_s : (f,) ascending [s].
    """

    images: Sequence[np.ndarray]
    time_s: Array

    @property
    def width(self) -> int:
        """[px]."""
        return int(self.images[0].shape[1])

    @property
    def height(self) -> int:
        """[px]."""
        return int(self.images[0].shape[0])


Source = Video | Pictures


def frames(source: Source, indices: Sequence[int]) -> Iterator[tuple[int, np.ndarray]]:
    """Index and (h, w, 3) BGR picture of the frames `indices`, all ascending or all descending."""
    if isinstance(source, Pictures):
        for index in indices:
            picture = source.images[index]
            yield index, picture if picture.ndim == 3 else np.repeat(picture[:, :, None], 3, axis=2)
    elif len(indices) > 1 and indices[1] < indices[0]:
        for start in range(0, len(indices), CHUNK):
            part = sorted(indices[start : start + CHUNK])
            yield from reversed(list(read_frames(source, part)))
    else:
        yield from read_frames(source, indices)
