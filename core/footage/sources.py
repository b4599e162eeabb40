# SPDX-License-Identifier: GPL-3.0-or-later
"""Where frames come from: a video file, decoded again or kept, or pictures that are already in memory."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from ..memory import available_bytes
from ..vectors import Array
from .ahead import ahead
from .video import Video, read_frames

CHUNK, CHUNK_BYTES = (12, 48), 300_000_000
"""Frames held at a time while a video is read backwards: as many as fit, at least and at most."""
MOST_BYTES, PART_OF_MEMORY = 900_000_000, 0.25
"""Room for the frames that are kept, and as a part of the memory that is there."""


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


class Kept:
    """A video whose frames, once decoded, are kept in memory: all of a short clip, evenly spaced ones of a longer.

    Following the background, making it without what moves, and following the block all go through the same frames.
    """

    def __init__(self, video: Video, first: int = 0, last: int | None = None) -> None:
        last = video.frames - 1 if last is None else last
        self.video = video
        self._room = int(min(MOST_BYTES, PART_OF_MEMORY * available_bytes()))
        self._every = max(-(-(last - first + 1) * self.frame_bytes // max(self._room, 1)), 1)
        self._pictures: dict[int, np.ndarray] = {}

    @property
    def time_s(self) -> Array:
        """(f,) ascending [s]."""
        return self.video.time_s

    @property
    def width(self) -> int:
        """[px]."""
        return self.video.width

    @property
    def height(self) -> int:
        """[px]."""
        return self.video.height

    @property
    def frame_bytes(self) -> int:
        """Of a picture in memory."""
        return 3 * self.width * self.height

    def has(self, frame: int) -> bool:
        """Whether a frame is there without decoding it."""
        return frame in self._pictures

    def ascending(self, indices: Sequence[int], *, beside: bool = True) -> Iterator[tuple[int, np.ndarray]]:
        """Index and picture of ascending frames, those decoded that are not there, `beside` the caller's own work."""
        missing = [index for index in indices if index not in self._pictures]
        decoded, kept = _decoded(self.video, missing, beside), dict.fromkeys(missing)
        for index in indices:
            picture = next(decoded)[1] if index in kept else self._pictures[index]
            if index % self._every == 0 and (len(self._pictures) + 1) * self.frame_bytes <= self._room:
                self._pictures[index] = picture
            yield index, picture


type Source = Video | Pictures | Kept


def kept(source: Source, first: int, last: int) -> Pictures | Kept:
    """The source with its frames from first to last kept in memory, as far as there is room."""
    return Kept(source, first, last) if isinstance(source, Video) else source


def frames(source: Source, indices: Sequence[int]) -> Iterator[tuple[int, np.ndarray]]:
    """Index and (h, w, 3) BGR picture of the frames `indices`, all ascending or all descending."""
    if isinstance(source, Pictures):
        for index in indices:
            picture = source.images[index]
            yield index, picture if picture.ndim == 3 else np.repeat(picture[:, :, None], 3, axis=2)
    elif len(indices) > 1 and indices[1] < indices[0]:
        chunk = int(np.clip(CHUNK_BYTES // (3 * source.width * source.height), *CHUNK))
        for start in range(0, len(indices), chunk):
            yield from reversed(list(_ascending(source, sorted(indices[start : start + chunk]), False)))
    else:
        yield from _ascending(source, indices, True)


def _ascending(source: Video | Kept, indices: Sequence[int], beside: bool) -> Iterator[tuple[int, np.ndarray]]:
    if isinstance(source, Kept):
        return source.ascending(indices, beside=beside)
    return _decoded(source, indices, beside)


def _decoded(video: Video, indices: Sequence[int], beside: bool) -> Iterator[tuple[int, np.ndarray]]:
    """Frames of a file; `beside` the caller's work on them, if there are several."""
    found = read_frames(video, indices)
    return ahead(found) if beside and len(indices) > 1 else found
