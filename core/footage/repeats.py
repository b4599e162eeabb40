# SPDX-License-Identifier: GPL-3.0-or-later
"""Pictures that a film shows twice, as after its conversion to another rate: found although compression alters them."""

from dataclasses import dataclass
from math import sqrt

import numpy as np

from ..opencv import opencv
from ..vectors import Array, Indices, Mask

LONGEST_PX = 960
"""Pictures are compared at this width or height at most."""
PART = 8
"""Width of the parts of a picture of which half are taken to show nothing that moves [px]."""
AROUND = 5
"""Pairs on either side with which one is compared: 12 pictures a second stored as 60 repeat four times."""
UNLIKE, LIKE = 0.2, 0.5
"""A repeated picture changes by less than this part of what its neighbours do; and one in the rhythm of others."""
AT_ONCE = 0.65
"""The pictures before and after a repeated one change by more than this part of what is usual there. A camera that
turns back, held by hand, slows down first."""
LEAST_CHANGE = 10.0
"""Grey levels: the coding of a still picture changes by less."""
QUIET = 0.6
"""Where nothing moves, a repeated picture changes by less than this part of what is usual: a sensor's noise is new."""
NOISE = 0.25
"""Mean grey levels of a change where nothing moves, below which there is no noise to compare."""
MOST_OF_A_FILM = 0.83
PERIODS = (2, 3, 4, 5, 6, 25)
"""Rhythms of conversions: 15 to 30, 20 to 30, …, 25 to 30, 24 to 25."""
FEWEST_OF_A_RHYTHM = 3
RHYTHM = (0.4, 0.7)
"""The median of that part is below the one for pictures repeated in a rhythm, above the other for all others."""
IN_STEP = 0.8
DIP, FEWEST_DIPS = 0.7, 10


@dataclass(frozen=True, eq=False)
class Changes:
    """How each of p pictures differs from the one before; the first has no change, 0.

    Attributes
    ----------
    strongest : (p,) of the part that changes most, a few pixels wide [grey levels].
    usual : (p,) where nothing moves: mean of the lower half of all parts [grey levels].
    """

    strongest: Array
    usual: Array


class ChangeMeter:
    """Takes the pictures of a film one after the other, and measures their changes."""

    def __init__(self) -> None:
        self._before: np.ndarray | None = None
        self._strongest: list[float] = []
        self._usual: list[float] = []

    def add(self, picture: np.ndarray) -> None:
        """The next picture, (h, w, 3) BGR or (h, w) uint8."""
        cv2 = opencv()
        grey = cv2.cvtColor(picture, cv2.COLOR_BGR2GRAY) if picture.ndim == 3 else picture
        scale = max(grey.shape) / LONGEST_PX
        if scale > 1:
            size = round(grey.shape[1] / scale), round(grey.shape[0] / scale)
            grey = cv2.resize(grey, size, interpolation=cv2.INTER_AREA)
        strongest = usual = 0.0
        if self._before is not None and self._before.shape == grey.shape:
            apart = cv2.blur(cv2.absdiff(grey, self._before).astype(np.float32), (3, 3))
            strongest = float(apart.max())
            height, width = apart.shape
            parts = cv2.resize(apart, (max(width // PART, 1), max(height // PART, 1)), interpolation=cv2.INTER_AREA)
            usual = float(np.sort(parts, axis=None)[: max(parts.size // 2, 1)].mean())
        self._strongest.append(strongest)
        self._usual.append(usual)
        self._before = grey

    @property
    def changes(self) -> Changes:
        """Of the pictures so far."""
        return Changes(np.array(self._strongest), np.array(self._usual))


def repeated_pictures(changes: Changes) -> Indices:
    """(r,) pictures that repeat the one before.

    Notes
    -----
    A repeated picture hardly changes where pictures on both sides of it do. What stands still, or moves slowly, has the
    same change throughout; what begins or ends to move has no change on one side. Coding makes of a repeated picture a
    slightly different one, at keyframes more than elsewhere: where there is a rhythm, such a one is accepted in it.
    """
    strongest, usual = changes.strongest, changes.usual
    if strongest.size < 4:
        return np.empty(0, np.intp)
    level = _lower_of_sides(strongest)
    calm = usual < np.maximum(QUIET * _new_around(usual), NOISE)
    moving = level > LEAST_CHANGE
    moving[0] = False
    part = np.where(moving, strongest / np.maximum(level, LEAST_CHANGE), np.nan)
    found = calm & (part < UNLIKE)
    found &= _beside(strongest, found) > AT_ONCE * level
    found |= (in_step := _in_rhythm(part)) & (part < LIKE)
    if in_step.any():  # also where the film begins or ends, with pictures on one side alone
        ends = _lower_of_sides(strongest, np.inf)
        ends[0] = 0.0
        found |= in_step & (ends > LEAST_CHANGE) & (strongest < LIKE * ends)
    found |= _dips_in_rhythm(strongest, moving)
    if found.sum() > MOST_OF_A_FILM * max(int(moving.sum()), 1):
        return np.empty(0, np.intp)
    return np.flatnonzero(found)


def _beside(strongest: Array, found: Mask) -> Array:
    """(p,) the smaller change of the nearest pictures on both sides that are not found."""
    others = np.flatnonzero(~found)
    after = np.clip(np.searchsorted(others, np.arange(found.size), side="right"), 0, others.size - 1)
    before = np.clip(np.searchsorted(others, np.arange(found.size)) - 1, 0, others.size - 1)
    return np.minimum(strongest[others[before]], strongest[others[after]])


def rhythm(repeated: Indices) -> tuple[int, int]:
    """How many of how many pictures are repeated, over and over: (1, 5), (3, 5); (0, 0) where there is no rhythm."""
    if repeated.size < FEWEST_OF_A_RHYTHM:
        return 0, 0
    shown = np.zeros(int(np.ptp(repeated)) + 1, np.bool_)
    shown[repeated - repeated.min()] = True
    for period in PERIODS:
        share = np.array([shown[rest::period].mean() for rest in range(min(period, shown.size))])
        often = share >= IN_STEP
        if often.any() and not often.all() and (share[~often] <= 1 - IN_STEP).all() and repeated.size > often.sum():
            return int(often.sum()), period
    return 0, 0


def repeat_sigma_s(step_s: float) -> float:
    """What repeated pictures add to the error of a time: one is shown up to a step after it was taken [s].

    A conversion that fills up a rate shows each picture at the next of the new times: late by 0 to a step, uniformly.
    """
    return step_s / sqrt(12)


def picture_rate(repeated: Indices, frames: int, rate_hz: float) -> float:
    """Pictures of their own a second, of so many frames at a rate of which some repeat the one before [Hz]."""
    some, every = rhythm(repeated)
    return rate_hz * (1 - some / every if every else 1 - repeated.size / frames)


def repeats_sentence(repeated: Indices, frames: int, rate_hz: float) -> str:
    """That so many of the frames repeat the one before, and in which rhythm, a sentence; empty where none does."""
    if not repeated.size:
        return ""
    some, every = rhythm(repeated)
    kept = picture_rate(repeated, frames, rate_hz)
    count = f"{repeated.size} of {frames} frames {'repeats' if repeated.size == 1 else 'repeat'} the picture before"
    if every:
        which = f"every {every}{_ordinal(every)}" if some == 1 else f"{some} of every {every}"
        count += f", {which}: about {kept:.3g} pictures a second are stored as {rate_hz:.4g}"
    return (
        f"{count}. They are no new positions, and times get a further ± {1000 * repeat_sigma_s(1 / rate_hz):.0f} ms. "
        "The original of the camera is better than a converted copy."
    )


def _ordinal(number: int) -> str:
    return "th" if 10 < number % 100 < 14 else {1: "st", 2: "nd", 3: "rd"}.get(number % 10, "th")


def _in_rhythm(part: Array) -> Mask:
    """(p,) the pictures of a rhythm in which pictures change little, of those in which they change as the others."""
    for period in PERIODS:
        classes = [part[rest::period] for rest in range(period)]
        if min(int(np.isfinite(one).sum()) for one in classes) < FEWEST_OF_A_RHYTHM:
            continue
        usual = np.array([np.nanmedian(one) for one in classes])
        low, high = usual < RHYTHM[0], usual > RHYTHM[1]
        if low.any() and high.any() and (low | high).all():
            return low[np.arange(part.size) % period]
    return np.zeros(part.size, np.bool_)


def _dips_in_rhythm(strongest: Array, moving: Mask) -> Mask:
    """(p,) the pictures of a rhythm of which nearly all change less than those beside them, and no others do.

    So many dips in one class of a rhythm are no chance: one picture in three changes less than both beside it.
    """
    padded = np.pad(strongest, 1, mode="edge")
    beside = np.minimum(padded[:-2], padded[2:])
    dips = moving & (strongest < DIP * beside)
    for period in PERIODS[:5]:
        rest = np.arange(strongest.size) % period
        classes = [dips[(rest == one) & moving] for one in range(period)]
        if min(map(len, classes)) < FEWEST_DIPS:
            continue
        share = np.array([one.mean() for one in classes])
        if share.max() > IN_STEP and np.sort(share)[-2] < 1 - IN_STEP:
            return (rest == int(share.argmax())) & moving & (strongest < beside)
    return np.zeros(strongest.size, np.bool_)


def _lower_of_sides(values: Array, beyond: float = 0.0) -> Array:
    """(p,) the greatest value of the few before and of the few after each, the lower of the two; `beyond` both ends."""
    padded = np.pad(values[1:], (AROUND + 1, AROUND), constant_values=beyond)
    windows = np.lib.stride_tricks.sliding_window_view(padded, 2 * AROUND + 1)
    lower: Array = np.minimum(windows[:, :AROUND].max(axis=1), windows[:, AROUND + 1 :].max(axis=1))
    return lower


def _new_around(values: Array) -> Array:
    """(p,) what is usual for new pictures around each: a high quantile, as most may be repeated."""
    from scipy.ndimage import percentile_filter

    around: Array = percentile_filter(values, 80, size=4 * AROUND + 1, mode="nearest")
    return around
