# SPDX-License-Identifier: GPL-3.0-or-later
"""The picture without what moves: a median of frames that are laid on each other, and how much it varies."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from ..constants import IQR_PER_SD
from ..opencv import opencv
from ..progress import Progress, silent
from ..vectors import Array
from .background import BackgroundMotion, levelled
from .sources import Kept, Source, frames

SAMPLES = 15
REACH = 300
"""Frames on either side from which samples are taken."""
FEWEST = 3
"""Samples that show a place, at least."""
SHARED = 0.5
"""Share of the view that a sample has in common with the plate, at least."""
WANDERED = 0.1
"""Share of the picture by which a moving camera may wander before it needs another plate."""
NOISE_FLOOR = 2.0
"""Grey levels; compressed video shows none where nothing happens."""
QUARTILES = (0.5, 0.25, 0.75)
BORDER = 3
"""Next to the edge of a part its sigma is another one than in the whole plate [px]."""
ROOM, LEAST_ROOM = 0.6, 60
"""Around what is asked for a part is larger by so many times its size, of so many pixels at least."""
CORNER, BACK = (np.array([[1, 0, half], [0, 1, half], [0, 0, 1]]) for half in (0.5, -0.5))
"""From OpenCV's pixels to those that count from the corner of the picture, and back."""

EVERY = 16
"""Rows and columns of a picture, one of which tells its brightness where the background was not followed."""

type Box = tuple[int, int, int, int]
"""Left, top, right, bottom [px]."""
type Layers = tuple[np.ndarray, np.ndarray, np.ndarray]
"""Picture (h, w, 3), its sigma (h, w), and where it is known (h, w), float32."""


@dataclass(frozen=True, eq=False)
class Part:
    """A part of a plate.

    Attributes
    ----------
    left, top : where it begins on the plate [px].
    picture : (h, w, 3) median, uint8.
    sigma : (h, w) standard deviation of a channel [grey levels], float32.
    seen : (h, w) uint8, 255 where the background is known.
    """

    left: int
    top: int
    picture: np.ndarray
    sigma: np.ndarray
    seen: np.ndarray

    def holds(self, box: Box, size: tuple[int, int]) -> bool:
        """Whether a box lies inside, away from edges that are none of the plate's (width, height)."""
        height, width = self.seen.shape
        low = [0 if start == 0 else start + BORDER for start in (self.left, self.top)]
        ends = (self.left + width, self.top + height)
        high = [end if end == whole else end - BORDER for end, whole in zip(ends, size, strict=True)]
        return box[0] >= low[0] and box[1] >= low[1] and box[2] <= high[0] and box[3] <= high[1]


@dataclass(eq=False)
class Plate:
    """The background as seen in one frame; where the camera moves, with a margin around it.

    Attributes
    ----------
    anchor : that frame.
    across : (f, 3, 3) from each frame of the footage onto the anchor.
    wandered : (f,) how far the corners of each frame lie from those of the anchor, as a share of the picture.
    samples : frames of which it is the median, and their pictures.
    part : what has been made of it.
    """

    anchor: int
    across: Array
    wandered: Array
    samples: list[tuple[int, np.ndarray]]
    part: Part | None = None


class Plates:
    """Plates of a video, made where they are needed; the two latest are kept."""

    def __init__(self, source: Source, motion: BackgroundMotion, progress: Progress = silent) -> None:
        self._source, self._motion, self._progress = source, motion, progress
        self._kept: list[Plate] = []
        size = (source.width, source.height)
        self._margin = (0, 0) if motion.still else (int(np.ceil(WANDERED * size[0])), int(np.ceil(WANDERED * size[1])))
        self._size = (size[0] + 2 * self._margin[0], size[1] + 2 * self._margin[1])
        self._first = int(motion.frames[0])
        self._exposure = motion.exposure
        self._glimpse: np.ndarray | None = None
        self._last: tuple[int, int, int, Layers] | None = None

    @property
    def spacing(self) -> float:
        """About how far the pictures of one plate are apart [frames]."""
        return min(self._motion.frames.size, 2 * REACH) / SAMPLES

    def beside(self, picture: np.ndarray, frame: int, box: Box) -> tuple[np.ndarray, Layers]:
        """A window of a frame's picture, (h, w, 3) float32 with the exposure of the background, and the background."""
        left, top, right, bottom = box
        part = levelled(picture[top:bottom, left:right], self._brightness(frame, picture))
        return part.astype(np.float32), self.window(frame, left, top, right - left, bottom - top)

    def window(self, frame: int, left: int, top: int, width: int, height: int) -> Layers:
        """Background of a window of a frame."""
        if self._last is not None and self._last[0] == frame:  # about the same block more than one thing is asked
            column, row, layers = left - self._last[1], top - self._last[2], self._last[3]
            rows, columns = layers[1].shape
            if column >= 0 and row >= 0 and column + width <= columns and row + height <= rows:
                a, b, c = (layer[row : row + height, column : column + width] for layer in layers)
                return a, b, c
        layers = self._window(frame, left, top, width, height)
        self._last = frame, left, top, layers
        return layers

    def _window(self, frame: int, left: int, top: int, width: int, height: int) -> Layers:
        plate = self._plate(frame)
        if self._motion.still:
            part = self._part(plate, (left, top, left + width, top + height))
            own = (slice(top - part.top, top - part.top + height), slice(left - part.left, left - part.left + width))
            return tuple(a[own].astype(np.float32) for a in (part.picture, part.sigma, part.seen > 0))  # type: ignore[return-value]
        cv2 = opencv()
        shift = np.array([[1.0, 0.0, left], [0.0, 1.0, top], [0.0, 0.0, 1.0]])
        across = self._onto(frame, plate) @ shift
        part = self._part(plate, self._box(across, width, height))
        across = np.array([[1.0, 0.0, -part.left], [0.0, 1.0, -part.top], [0.0, 0.0, 1.0]]) @ across
        size, flags = (width, height), cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
        picture = cv2.warpPerspective(part.picture, across, size, flags=flags)
        sigma = cv2.warpPerspective(part.sigma, across, size, flags=flags)
        seen = cv2.warpPerspective(part.seen, across, size, flags=flags)
        return picture.astype(np.float32), np.maximum(sigma, NOISE_FLOOR), (seen > 250).astype(np.float32)

    def _box(self, across: Array, width: int, height: int) -> Box:
        """What a window needs of the plate onto which `across` leads: left, top, right, bottom, inside of it."""
        corners = np.array([[-1.0, -1.0], [width, -1.0], [-1.0, height], [width, height]])
        there = np.column_stack([corners, np.ones(4)]) @ across.T
        there = there[:, :2] / there[:, 2:]
        low = np.clip(np.floor(there.min(axis=0)), 0, self._size).astype(int)
        high = np.clip(np.ceil(there.max(axis=0)) + 2, 0, self._size).astype(int)
        return int(low[0]), int(low[1]), int(high[0]), int(high[1])

    def _part(self, plate: Plate, box: Box) -> Part:
        """A part of the plate that holds the box: the last one, or a new one with room around it."""
        if plate.part is None or not plate.part.holds(box, self._size):
            around = BORDER + int(ROOM * max(box[2] - box[0], box[3] - box[1], LEAST_ROOM))
            left, top = (max(start - around, 0) for start in box[:2])
            right, bottom = (
                max(min(end + around, whole), start + 1)
                for end, whole, start in zip(box[2:], self._size, (left, top), strict=True)
            )
            plate.part = self._made(plate, (min(left, right - 1), min(top, bottom - 1), right, bottom))
        return plate.part

    def _made(self, plate: Plate, box: Box) -> Part:
        cv2 = opencv()
        left, top, right, bottom = box
        layers, known = [], []
        full = np.full((self._source.height, self._source.width), 255, np.uint8)
        for frame, picture in plate.samples:
            brightness = self._brightness(frame, picture)
            if self._motion.still:
                layers.append(levelled(picture[top:bottom, left:right].copy(), brightness))
                continue
            shift = np.array([[1.0, 0.0, -left], [0.0, 1.0, -top], [0.0, 0.0, 1.0]])
            across, size = shift @ self._onto(frame, plate), (right - left, bottom - top)
            known.append(cv2.warpPerspective(full, across, size) > 250)
            layers.append(levelled(cv2.warpPerspective(picture, across, size), brightness))
        return Part(left, top, *_median(layers, known))

    def _brightness(self, frame: int, picture: np.ndarray) -> float:
        """Of a frame, in units of the usual one, or of the first one that is looked at by a camera said to be still."""
        if self._exposure is not None:
            return float(self._exposure[frame - self._first])
        if self._motion.brightness.size or not self._motion.still:
            return 1.0
        seen = picture[::EVERY, ::EVERY].astype(np.float32) + 1
        self._glimpse = seen if self._glimpse is None else self._glimpse
        return float(np.median(seen / self._glimpse))

    def _plate(self, frame: int) -> Plate:
        for plate in reversed(self._kept):
            if abs(plate.anchor - frame) <= REACH and plate.wandered[frame - self._first] < WANDERED:
                return plate
        across = np.linalg.solve(self._motion.homography[frame - self._first], self._motion.homography)
        wandered = self._wandered(across)
        plate = Plate(frame, across, wandered, self._samples(frame, wandered))
        self._kept = [*self._kept[-1:], plate]
        return plate

    def _samples(self, anchor: int, wandered: Array) -> list[tuple[int, np.ndarray]]:
        """Frames from all over the footage around the anchor, those that are kept if there are enough."""
        self._progress(f"Making the background around frame {anchor}", 0, 0)
        numbers = self._motion.frames
        near = numbers[(np.abs(numbers - anchor) <= REACH) & (wandered < 1 - SHARED)].tolist()
        if isinstance(self._source, Kept):
            spread = [frame for frame in near if self._source.is_spread(frame)]
            near = spread if len(spread) >= SAMPLES else near
        chosen = sorted({near[i] for i in np.linspace(0, len(near) - 1, SAMPLES).round().astype(int)})
        there = dict(sample for plate in self._kept for sample in plate.samples)
        there |= dict(frames(self._source, [frame for frame in chosen if frame not in there]))
        return [(frame, there[frame]) for frame in chosen]

    def _wandered(self, across: Array) -> Array:
        """(f,) how far homographies (f, 3, 3) move the corners, the furthest, as a share of the picture."""
        if self._motion.still:
            return np.zeros(len(across))
        size = np.array([self._source.width, self._source.height], dtype=np.float64)
        corners = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0]]) * size
        moved = np.column_stack([corners, np.ones(4)]) @ across.swapaxes(1, 2)
        share: Array = np.abs((moved[..., :2] / moved[..., 2:] - corners) / size).max(axis=(1, 2))
        return share

    def _onto(self, frame: int, plate: Plate) -> Array:
        """Frame → plate, which is larger than a frame all around, for OpenCV."""
        shift = np.array([[1.0, 0.0, self._margin[0]], [0.0, 1.0, self._margin[1]], [0.0, 0.0, 1.0]])
        return shift @ _centred(plate.across[frame - self._first])


def over_channels(one: np.ndarray, other: np.ndarray) -> np.ndarray:
    """(h, w) sums over the channels of the products of two pictures (h, w, 3), float32."""
    total: np.ndarray = opencv().transform(one * other, np.ones((1, 3), np.float32))
    return total


def _centred(homography: Array) -> Array:
    """For OpenCV, whose pixels count from the centre of the first."""
    return BACK @ homography @ CORNER


def _median(layers: list[np.ndarray], known: list[np.ndarray]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Picture, sigma and where it is known, by median and quartiles; what is not known is sorted to the end."""
    cv2 = opencv()
    partial = [not there.all() for there in known]
    for i in np.flatnonzero(partial):
        layers[i] = cv2.copyTo(np.full_like(layers[i], 255), (~known[i]).view(np.uint8), layers[i])
    ordered = _sorted(layers)
    count = len(ordered)
    middle, low, high = (ordered[int(q * (count - 1))].copy() for q in QUARTILES)
    seen = np.full(middle.shape[:2], 255, np.uint8)
    if any(partial):
        number = np.sum(known, axis=0, dtype=np.uint8)
        seen[number < FEWEST] = 0
        for fewer in np.flatnonzero(np.bincount(number.ravel(), minlength=count)[:count]).tolist():
            there = (number == fewer).view(np.uint8)
            for picture, q in zip((middle, low, high), QUARTILES, strict=True):
                cv2.copyTo(ordered[int(q * max(fewer - 1, 0))], there, picture)
    spread = (high.astype(np.float32) - low) / IQR_PER_SD
    variance = cv2.blur(over_channels(spread, spread) / np.float32(3), (5, 5))
    return middle, np.sqrt(variance + np.float32(NOISE_FLOOR) ** 2), seen


def _sorted(layers: list[np.ndarray]) -> list[np.ndarray]:
    """Sorted pixel by pixel, by a network of exchanges of whole pictures."""
    cv2, ordered = opencv(), list(layers)
    for i, j in _exchanges(len(ordered)):
        a, b = ordered[i], ordered[j]
        ordered[i], ordered[j] = cv2.min(a, b), cv2.max(a, b)
    return ordered


def _exchanges(count: int) -> Iterator[tuple[int, int]]:
    """Places that are put in order one after the other to sort so many (Batcher's merge exchange, Knuth 5.2.2 M)."""
    top = 1 << max(count - 1, 1).bit_length() - 1
    size = top
    while size:
        step, other, rest = size, top, 0
        while step:
            yield from ((i, i + step) for i in range(count - step) if i & size == rest)
            step, other, rest = other - size, other >> 1, size
        size >>= 1
