# SPDX-License-Identifier: GPL-3.0-or-later
"""Where frames come from: a video file, decoded again or kept, or pictures that are already in memory."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from ..memory import available_bytes
from ..opencv import opencv
from ..progress import Progress, silent
from ..vectors import Array, Indices
from .ahead import ahead
from .repeats import ChangeMeter, repeated_pictures, repeats_sentence
from .video import Video, read_frames

CHUNK, CHUNK_BYTES = (12, 48), 300_000_000
"""Frames held at a time while a video is read backwards: as many as fit, at least and at most."""
MOST_BYTES, PART_OF_MEMORY = 900_000_000, 0.25
"""Room for the frames that are kept, and as a part of the memory that is there."""
SPREAD, SPREAD_FRAMES = 20, 30
"""So many of the frames that are kept are evenly spaced, or one in so many of a long film if these are more."""
LARGEST = 2_300_000
"""Pictures of more pixels are followed at half their size, or a quarter, …: 4K as 1080p."""
GLANCES, GLANCE, FEWEST_REPEATS = (0.25, 0.5, 0.75), 24, 3
"""Where a video is looked at for repeated pictures, over how many frames, and how many of them are enough to say so."""
SMALLEST = 5.0
"""A block is not made smaller than this by reducing pictures [px]; at 5 its places are a fifth less exact at most."""


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
    """A video whose frames, once decoded, are kept in memory, as far as there is room, large ones reduced.

    Following the background, making it without what moves, and following the block all go through the same frames. Of
    a film that does not fit, evenly spaced frames are kept, and those before and after the frame `upto`: from there the
    block is followed back, in which direction a film cannot be decoded.

    Attributes
    ----------
    video : the file.
    scale : how many times as wide and high as the kept ones its pictures are; 1 when `whole` is asked for.
    """

    def __init__(
        self, video: Video, first: int = 0, last: int | None = None, upto: int | None = None, *, whole: bool = False
    ) -> None:
        count = (video.frames - 1 if last is None else last) - first + 1
        self.video = video
        self.scale = 1 if whole else reduction(video.width, video.height)
        self._room = int(min(MOST_BYTES, PART_OF_MEMORY * available_bytes())) // self.frame_bytes
        spread = self._room if upto is None else min(self._room, max(SPREAD, count // SPREAD_FRAMES))
        self._every = 1 if self._room >= count else max(-(-count // max(spread, 1)), 1)
        begin = first if upto is None else max(upto + 1 - (self._room - spread), first)
        self._around = range(begin, begin + self._room - spread)
        self._pictures: dict[int, np.ndarray] = {}

    @property
    def time_s(self) -> Array:
        """(f,) ascending [s]."""
        return self.video.time_s

    @property
    def width(self) -> int:
        """Of a kept picture [px]."""
        return self.video.width // self.scale

    @property
    def height(self) -> int:
        """Of a kept picture [px]."""
        return self.video.height // self.scale

    @property
    def frame_bytes(self) -> int:
        """Of a picture in memory."""
        return self.width * self.height * 3 // (2 if self._is_even else 1)

    @property
    def _is_even(self) -> bool:
        return self.width % 2 == self.height % 2 == 0

    def is_spread(self, frame: int) -> bool:
        """Whether a frame is one of the evenly spaced ones, which are kept once they are decoded."""
        return frame % self._every == 0

    def forget(self) -> None:
        """Give the memory back; what is asked for again is decoded again."""
        self._pictures.clear()

    def ascending(
        self, indices: Sequence[int], *, beside: bool = True, as_decoded: bool = False
    ) -> Iterator[tuple[int, np.ndarray]]:
        """Index and picture of ascending frames, those decoded that are not there, `beside` the caller's own work.

        All are as they come out of memory, so that a picture that a film repeats is the same, unless `as_decoded`.
        """
        missing = [index for index in indices if index not in self._pictures]
        decoded, fresh = _decoded(self.video, missing, beside), dict.fromkeys(missing)
        for index in indices:
            if index not in fresh:
                yield index, _unpacked(self._pictures[index])
                continue
            picture = reduced(next(decoded)[1], self.scale)
            packed = _packed(picture) if self._is_even else picture
            if (index % self._every == 0 or index in self._around) and len(self._pictures) < self._room:
                self._pictures[index] = packed
            yield index, picture if as_decoded else _unpacked(packed)


def reduction(width: int, height: int) -> int:
    """How many times as wide and high as its followed picture a video's is: 1, 2, 4, …, by which it can be divided."""
    scale = 1
    while width * height > LARGEST * scale**2 and width % (2 * scale) == height % (2 * scale) == 0:
        scale *= 2
    return scale


def reduced(picture: np.ndarray, scale: int) -> np.ndarray:
    """A picture so many times less wide and high, each pixel the mean of those that it covers."""
    if scale == 1:
        return picture
    cv2, (height, width) = opencv(), picture.shape[:2]
    smaller: np.ndarray = cv2.resize(picture, (width // scale, height // scale), interpolation=cv2.INTER_AREA)
    return smaller


def _packed(picture: np.ndarray) -> np.ndarray:
    """A picture of even width and height as films hold it, colours at half the resolution: half the memory."""
    cv2 = opencv()
    packed: np.ndarray = cv2.cvtColor(picture, cv2.COLOR_BGR2YUV_I420)
    return packed


def _unpacked(picture: np.ndarray) -> np.ndarray:
    """(h, w, 3) BGR."""
    cv2 = opencv()
    whole: np.ndarray = cv2.cvtColor(picture, cv2.COLOR_YUV2BGR_I420) if picture.ndim == 2 else picture
    return whole


type Source = Video | Pictures | Kept


def kept(
    source: Source, first: int, last: int, upto: int | None = None, diameter_px: float | None = None
) -> Pictures | Kept:
    """The source with its frames from first to last kept in memory, as far as there is room; see `Kept`.

    diameter_px : of the block that is followed, where it is known: small ones are followed in whole pictures.
    """
    if not isinstance(source, Video):
        return source
    small = diameter_px is not None and diameter_px < SMALLEST * reduction(source.width, source.height)
    return Kept(source, first, last, upto, whole=small)


def frames(source: Source, indices: Sequence[int], *, as_decoded: bool = False) -> Iterator[tuple[int, np.ndarray]]:
    """Index and (h, w, 3) BGR picture of the frames `indices`, all ascending or all descending.

    `as_decoded` is quicker, and takes that frames which are kept differ by roundings from one time to the next.
    """
    if isinstance(source, Pictures):
        for index in indices:
            picture = source.images[index]
            yield index, picture if picture.ndim == 3 else np.repeat(picture[:, :, None], 3, axis=2)
    elif len(indices) > 1 and indices[1] < indices[0]:
        chunk = int(np.clip(CHUNK_BYTES // (3 * source.width * source.height), *CHUNK))
        for start in range(0, len(indices), chunk):
            yield from reversed(list(_ascending(source, sorted(indices[start : start + chunk]), False, as_decoded)))
    else:
        yield from _ascending(source, indices, True, as_decoded)


def repeated_in(source: Source, first: int, last: int, progress: Progress = silent) -> Indices:
    """(r,) frames from first to last that show the picture of the one before."""
    if isinstance(source, Video) and source.decoded:
        return source.repeated[(source.repeated > first) & (source.repeated <= last)]
    meter = ChangeMeter()
    for done, (_, picture) in enumerate(frames(source, range(first, last + 1))):
        progress("Looking for repeated pictures", done, last - first + 1)
        meter.add(picture)
    return repeated_pictures(meter.changes) + first


def repeats_at_a_glance(video: Video) -> str:
    """That pictures of a video repeat the one before, a sentence, as a few stretches of it tell; else empty."""
    found = []
    for part in GLANCES:
        middle = int(part * video.frames)
        first, last = max(middle - GLANCE // 2, 0), min(middle + GLANCE // 2, video.frames - 1)
        if last - first >= GLANCE // 2:
            found.append((repeated_in(video, first, last), last - first + 1))
    best = max(found, key=lambda one: one[0].size, default=None)
    if best is None or best[0].size < FEWEST_REPEATS:
        return ""
    return f"As a glance at {best[1]} of its frames tells: {repeats_sentence(*best, video.rate_hz)}"


def _ascending(
    source: Video | Kept, indices: Sequence[int], beside: bool, as_decoded: bool
) -> Iterator[tuple[int, np.ndarray]]:
    if isinstance(source, Kept):
        return source.ascending(indices, beside=beside, as_decoded=as_decoded)
    return _decoded(source, indices, beside)


def _decoded(video: Video, indices: Sequence[int], beside: bool) -> Iterator[tuple[int, np.ndarray]]:
    """Frames of a file; `beside` the caller's work on them, if there are several."""
    found = read_frames(video, indices)
    return ahead(found) if beside and len(indices) > 1 else found
