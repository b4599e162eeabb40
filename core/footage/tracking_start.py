# SPDX-License-Identifier: GPL-3.0-or-later
"""Where tracking starts: what is at a click, and how fast it moves."""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from ..errors import InputError
from ..vectors import Array
from .background import BackgroundMotion, destabilise, stabilise
from .plates import Plates
from .sources import Source, frames
from .templates import Appearance, cover, first_looks, search

ACCEPTED = 0.5
"""Score of a sighting where the block is expected, at least."""
MANY = 40
"""Places in the frames beside a click that may be the block's: faint things can be many."""
SLOWER = 0.05
"""Of pairs of sightings that are as good, the slower one: what a diameter from frame to frame counts, in scores."""


@dataclass(frozen=True, eq=False)
class Footage:
    """A video, the motion of its background, the background without what moves, and frames that repeat another."""

    video: Source
    motion: BackgroundMotion
    plates: Plates
    repeated: frozenset[int] = frozenset()

    def stable(self, frame: int, pixel: Array) -> Array:
        """(2,) a pixel of a frame, in the reference frame of the background [px]."""
        return stabilise(self.motion, np.array([frame]), pixel[None])[0]

    def pixel(self, frame: int, stable: Array) -> Array:
        """(2,) the inverse of `stable` [px]."""
        return destabilise(self.motion, np.array([frame]), stable[None])[0]

    def step_s(self, frame: int) -> float:
        """From one frame to the next around a frame [s]."""
        time = self.video.time_s
        low, high = max(frame - 1, 0), min(frame + 1, time.size - 1)
        return float(time[high] - time[low]) / max(high - low, 1)

    @cached_property
    def usual_step_s(self) -> float:
        """From one frame to the next [s], the median."""
        return float(np.median(np.diff(self.video.time_s))) if self.video.time_s.size > 1 else 1.0


@dataclass(frozen=True, eq=False)
class Start:
    """The block at a click: frame, centre (2,) [px], looks, and velocity (2,) [px/s], None where it is not known."""

    frame: int
    pixel: Array
    looks: Appearance
    velocity: Array | None


def start_at(footage: Footage, frame: int, click: Array, diameter_px: float | None) -> Start:
    """What is at a click, and how fast it moves.

    Raises
    ------
    InputError : nothing moves there, or something very large.
    """
    video, motion, plates = footage.video, footage.motion, footage.plates
    low, high = int(motion.frames[0]), int(motion.frames[-1])
    others = _beside(frame, low, high)
    around = dict(frames(video, sorted({frame, *others})))
    found = first_looks(around[frame], frame, plates, click, diameter_px)
    if found is None:
        raise InputError(
            f"Nothing moves at ({click[0]:g}, {click[1]:g}) in frame {frame}",
            advice="Click on the block in a frame in which it moves and stands out from the background",
        )
    looks, centre, streak = found
    if looks.diameter_px > 0.3 * min(video.width, video.height):
        raise InputError(
            f"What moves at ({click[0]:g}, {click[1]:g}) in frame {frame} is {looks.diameter_px:.0f} pixels large",
            advice="Give the block's diameter in pixels",
        )
    looks = replace(looks, shutter=0.0)
    reach = max(5 * looks.diameter_px, 1.5 * float(np.hypot(*streak)) + 2 * looks.diameter_px, 40.0)
    origin, places = footage.stable(frame, centre), {}
    for other in others:
        away = reach * abs(other - frame)
        here = cover(around[other], other, plates, looks, footage.pixel(other, origin), away)
        pixel, score = search(here, looks, streak, MANY)
        score = np.minimum(score, 1 / np.maximum(score, ACCEPTED))  # above 1 are faint things
        good = score > ACCEPTED
        places[other] = stabilise(motion, np.full(good.sum(), other), pixel[good]), score[good]
    return Start(frame, centre, looks, _velocity(video.time_s, frame, origin, places, looks.diameter_px))


def _beside(frame: int, low: int, high: int) -> tuple[int, ...]:
    """The frames before and after one; the next two where it is the first or the last."""
    if low < frame < high:
        return frame - 1, frame + 1
    toward = 1 if frame == low else -1
    return tuple(other for other in (frame + toward, frame + 2 * toward) if low <= other <= high)


def _velocity(
    time_s: Array, frame: int, origin: Array, places: dict[int, tuple[Array, Array]], diameter: float
) -> Array | None:
    """(2,) [px/s] that joins the places in two other frames best with that in the frame itself."""
    options = {}
    for other, (place, score) in places.items():
        step = time_s[other] - time_s[frame]
        if step and len(place):
            options[other] = (place - origin) / step, score
    if len(options) == 2:
        (one, a), (two, b) = options.values()
        step = max(abs(time_s[other] - time_s[frame]) for other in options)
        differs = np.hypot(*(one[:, None] - two[None]).transpose(2, 0, 1)) * step / diameter
        far = np.hypot(*one.T)[:, None] + np.hypot(*two.T)
        cost = differs + SLOWER * far * step / diameter - a[:, None] - b[None]
        i, j = np.unravel_index(int(np.argmin(cost)), cost.shape)
        return 0.5 * (one[i] + two[j])
    for other, (velocity, score) in options.items():
        far = np.hypot(*velocity.T) * abs(time_s[other] - time_s[frame]) / diameter
        return velocity[int(np.argmax(score - SLOWER * far))]
    return None
