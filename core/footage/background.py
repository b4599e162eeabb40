# SPDX-License-Identifier: GPL-3.0-or-later
"""Motion of the background: how every frame of hand-held or stabilised footage lies on the first one.

Corners are followed by pyramidal Lucas–Kanade (Bouguet 2001) in pictures of the same exposure, each now and then
followed back to where it came from (Kalal et al. 2010). They are always compared with the frame in which they were
found, not with the one before, so that errors do not add up; a homography to the reference frame is estimated robustly
(MAGSAC++, Barath et al. 2020), then by least squares.
"""

from dataclasses import dataclass, field, replace

import numpy as np

from ..errors import InputError
from ..opencv import opencv
from ..progress import Progress, silent
from ..vectors import Array, Indices
from .sources import Kept, Source, frames, reduced, reduction

GRID = (16, 10)
PER_CELL = 4
WINDOW_PX = 17
LEVELS = 3
FINE, COARSE = (30, 0.02), (10, 0.03)
"""Most steps of Lucas and Kanade, and the step that ends them [px]."""
GUESSED_FROM, GUESS_INLIER_PX = 100, 4.0
"""So many corners tell about where all have gone."""
TOGETHER = 0.8
LEVELLED = 0.01
"""By how much brightness may differ from frame to frame before it is made the same."""
FORWARD_BACKWARD_PX = 0.5
CHECKED = 4
"""Each corner is followed back to where it came from in one of so many frames."""
INLIER_PX = 1.5
FEWEST = 12
FEWEST_SHARE = 0.25
RENEW_SHARE = 0.6
type Steps = tuple[int, float]

REGIONS, FAR_PX = (4, 3), 3.0
"""Of the picture, in which corners are compared with the motion of all; no corner counts as further off [px]."""
STEADY = 9
"""Frames of which the median tells whether a region is off."""
APART_PX, APART_SHARE = 0.4, 1 / 3200
"""One ground gives less, also where its corners are bad, and less than this share of the picture's width."""
GLANCES, GLANCED_AT = 4, 250_000
"""Pictures of a first look, and the pixels that they are reduced to."""
LEAST_GLANCED = 120
ALIKE = 0.08
"""Of the peak of a phase correlation: below it two pictures show different things."""
STILL_PX = 0.15
"""A tripod: the typical corner never moves further than this."""


@dataclass(frozen=True, eq=False)
class BackgroundMotion:
    """Where the background of f consecutive frames lies in the reference frame.

    Attributes
    ----------
    frames : (f,) frame numbers, ascending without gaps.
    homography : (f, 3, 3) frame → reference frame, on pixels whose origin is the corner of the image.
    inliers : (f,) corners that agree.
    rms_px : (f,) of their residuals, in the reference frame.
    still : the camera does not move: every homography is the identity.
    apart_px : (f,) how far the corners of one region of the picture lie, on average, from where the motion of all puts
        them, in the region in which it is furthest; empty where nobody has looked.
    """

    frames: Indices
    homography: Array
    inliers: Indices
    rms_px: Array
    still: bool
    apart_px: Array = field(default_factory=lambda: np.zeros(0))
    brightness: Array = field(default_factory=lambda: np.zeros(0))

    @property
    def exposure(self) -> Array | None:
        """(f,) brightness in units of the middle one; None where it stays, or where nobody has looked."""
        if not self.brightness.size:
            return None
        relative: Array = self.brightness / np.sort(self.brightness)[self.brightness.size // 2]
        return relative if np.abs(relative - 1).max() > LEVELLED else None

    @property
    def steadily_apart_px(self) -> Array:
        """(f,) `apart_px` without single frames that stand out, such as blurred ones."""
        if not self.apart_px.size:
            return self.apart_px
        beyond = np.pad(self.apart_px, STEADY // 2, mode="edge")
        return np.median(np.lib.stride_tricks.sliding_window_view(beyond, STEADY), axis=1)


@dataclass(frozen=True, eq=False)
class TrackedFeatures:
    """m sightings of background corners.

    Attributes
    ----------
    frame, feature : (m,) frame number, and number of the corner.
    pixel : (m, 2) [px].
    """

    frame: Indices
    feature: Indices
    pixel: Array


def reduced_motion(motion: BackgroundMotion, scale: int) -> BackgroundMotion:
    """The motion in pictures that are so many times less wide and high."""
    if scale == 1:
        return motion
    size = np.diag([scale, scale, 1.0])
    return replace(
        motion,
        homography=np.linalg.inv(size) @ motion.homography @ size,
        rms_px=motion.rms_px / scale,
        apart_px=motion.apart_px / scale,
    )


def no_motion(first: int, last: int) -> BackgroundMotion:
    """What is known of a camera on a tripod without looking: frames `first` to `last` do not move."""
    count = last - first + 1
    return BackgroundMotion(
        frames=np.arange(first, last + 1),
        homography=np.tile(np.eye(3), (count, 1, 1)),
        inliers=np.zeros(count, dtype=np.intp),
        rms_px=np.full(count, np.nan),
        still=True,
    )


def stabilise(motion: BackgroundMotion, frame: Indices, pixels: Array) -> Array:
    """(n, 2) pixels of frames (n,) as they would lie in the reference frame."""
    return _through(_of(motion, frame), pixels)


def destabilise(motion: BackgroundMotion, frame: Indices, pixels: Array) -> Array:
    """(n, 2) pixels of the reference frame as they lie in frames (n,); undoes `stabilise`."""
    return _through(np.linalg.inv(_of(motion, frame)).astype(np.float64), pixels)


def layers_px(motion: BackgroundMotion, width: int) -> tuple[float, int] | None:
    """By how much parts of the background move differently [px], and the frame in which they are furthest apart.

    None where all of it moves as one plane does, or as seen by a camera that only turns, in pictures of this width.
    """
    apart = motion.steadily_apart_px
    if motion.still or not apart.size or apart.max() <= max(APART_PX, APART_SHARE * width):
        return None
    return float(apart.max()), int(motion.frames[np.argmax(apart)])


def glance(source: Source) -> float:
    """How far the middle of a few pictures lies from that of the first one, the furthest [px]; NaN if that is not seen.

    A look at the whole picture (phase correlation), not at its corners: for a first word on whether a camera is on a
    tripod, within half a second. A motion that comes back between these pictures is not seen, nor one in tiny pictures.

    Raises
    ------
    InputError : a picture cannot be read.
    """
    cv2 = opencv()
    chosen = np.unique(np.linspace(0, source.time_s.size - 1, GLANCES).astype(np.intp)).tolist()
    first, window, furthest = None, None, np.nan
    for _, picture in frames(source, chosen):
        if min(picture.shape[:2]) < LEAST_GLANCED:
            break
        grey = cv2.cvtColor(picture, cv2.COLOR_BGR2GRAY)
        while grey.size > GLANCED_AT:
            grey = cv2.pyrDown(grey)
        small = grey.astype(np.float32)
        if first is None or window is None:
            first, window = small, cv2.createHanningWindow(small.shape[::-1], cv2.CV_32F)
            continue
        (x, y), response = cv2.phaseCorrelate(first, small, window)
        if response >= ALIKE:
            furthest = np.nanmax([furthest, np.hypot(x, y) * picture.shape[1] / small.shape[1]])
    return float(furthest)


def background_motion(
    source: Source, *, first: int = 0, last: int | None = None, progress: Progress = silent
) -> tuple[BackgroundMotion, TrackedFeatures]:
    """Follow the background; frame `first` is the reference.

    Raises
    ------
    InputError : the background cannot be followed, with the frame.
    """
    last = source.time_s.size - 1 if last is None else last
    inside = reduction(source.width, source.height)
    scale = inside * source.scale if isinstance(source, Kept) else inside
    follower, numbers, homographies, inliers, rms, apart, brightness = None, [], [], [], [], [], []
    sightings: list[tuple[int, Indices, Array]] = []
    for frame, picture in frames(source, range(first, last + 1), as_decoded=True):
        progress("Following the background", frame - first, last - first + 1)
        grey = opencv().cvtColor(reduced(picture, inside), opencv().COLOR_BGR2GRAY)
        if follower is None:
            follower = _Follower(grey, frame)
        else:
            follower.advance(grey, frame)
        numbers.append(frame)
        homographies.append(follower.homography)
        inliers.append(follower.names.size)
        rms.append(scale * follower.rms)
        apart.append(scale * follower.apart)
        brightness.append(follower.brightness)
        sightings.append((frame, follower.names, scale * (follower.pixel + 0.5)))
    still = _is_still(sightings)
    count = len(numbers)
    features = TrackedFeatures(
        frame=np.concatenate([np.full(names.size, frame) for frame, names, _ in sightings]),
        feature=np.concatenate([names for _, names, _ in sightings]),
        pixel=np.concatenate([pixel for _, _, pixel in sightings]),
    )
    corner = np.array([[scale, 0, scale / 2], [0, scale, scale / 2], [0, 0, 1]])
    homography = np.tile(np.eye(3), (count, 1, 1)) if still else corner @ np.array(homographies) @ np.linalg.inv(corner)
    return BackgroundMotion(
        frames=np.array(numbers),
        homography=homography,
        inliers=np.array(inliers),
        rms_px=np.array(rms),
        still=still,
        apart_px=np.array(apart),
        brightness=np.array(brightness),
    ), features


class _Follower:
    """Corners on their way through the frames, in OpenCV's pixels.

    names, pixel, reference: of the corners that agree in the current frame: number, place there, and in the reference.
    """

    def __init__(self, grey: np.ndarray, frame: int) -> None:
        self.homography, self.rms, self.apart = np.eye(3), 0.0, 0.0
        self.brightness = self.key_brightness = 1.0
        self.names = np.zeros(0, dtype=np.intp)
        self.pixel = self.reference = np.zeros((0, 2))
        self.count = self.key_count = 0
        self.key, self.key_pixel = grey, self.pixel
        self.small = self.key_small = _quartered(grey)
        self._renew(grey)
        if self.names.size < FEWEST:
            raise _lost(frame, f"only {self.names.size} corners are found in it")

    def advance(self, grey: np.ndarray, frame: int) -> None:
        """Follow all corners into the next frame."""
        small = _quartered(grey)
        guess, levels = self._guess(small)
        ratio = float(np.median(_brightness(small, guess) / _brightness(self.key_small, self.key_pixel)))
        self.brightness = ratio * self.key_brightness
        bright = levelled(grey, ratio)
        pixel, good = _flow(self.key, bright, self.key_pixel, guess, levels)
        checked = np.flatnonzero(good & (self.names % CHECKED == frame % CHECKED))
        back, back_good = _flow(bright, self.key, pixel[checked], self.key_pixel[checked], 0, COARSE)
        good[checked] = back_good & (np.hypot(*(back - self.key_pixel[checked]).T) < FORWARD_BACKWARD_PX)
        height, width = grey.shape
        good &= (pixel > 1).all(axis=1) & (pixel < (width - 2, height - 2)).all(axis=1)
        if good.sum() < FEWEST:
            raise _lost(frame, f"only {good.sum()} corners of the frames before are found again in it")
        homography, agrees = _fit(pixel[good], self.reference[good])
        off = _through(homography, pixel[good]) - self.reference[good]
        self.apart = _apart(off, _cell(pixel[good], width, height, REGIONS))
        kept = np.flatnonzero(good)[agrees]
        if kept.size < max(FEWEST, FEWEST_SHARE * self.pixel.shape[0]):
            raise _lost(frame, f"only {kept.size} of {self.pixel.shape[0]} corners move together")
        self.small, self.homography = small, homography
        self.names, self.pixel = self.names[kept], pixel[kept]
        self.reference, self.key_pixel = self.reference[kept], self.key_pixel[kept]
        self.rms = float(np.sqrt(np.mean(np.sum(off[agrees] ** 2, axis=1))))
        if self.names.size < RENEW_SHARE * self.key_count:
            self._renew(grey)

    def _guess(self, small: np.ndarray) -> tuple[Array, int]:
        """(n, 2) about where the corners are in the next frame, from the motion of some in a small picture.

        And from which level of the pyramid they are to be looked for: the lowest where nearly all move together.
        """
        some = self.pixel[:: max(len(self.pixel) // GUESSED_FROM, 1)]
        moved, good = _flow(self.small, small, some / 4, None, LEVELS, COARSE)
        if good.sum() >= FEWEST:
            cv2 = opencv()
            cv2.setRNGSeed(1)
            across, agrees = cv2.findHomography(some[good], 4 * moved[good], cv2.USAC_MAGSAC, GUESS_INLIER_PX)
            if across is not None:
                return _through(across, self.pixel), 0 if agrees.sum() > TOGETHER * len(some) else 1
        return self.pixel + _median(4 * moved - some), 1

    def _renew(self, grey: np.ndarray) -> None:
        """Make this the frame that corners are compared with, and find new ones where there are few."""
        fresh = _corners(grey, self.pixel)
        self.names = np.concatenate([self.names, self.count + np.arange(len(fresh))])
        self.count += len(fresh)
        self.pixel = np.concatenate([self.pixel, fresh])
        self.reference = np.concatenate([self.reference, _through(self.homography, fresh)])
        self.key, self.key_small, self.key_pixel, self.key_count = grey, self.small, self.pixel, self.names.size
        self.key_brightness = self.brightness


def _quartered(grey: np.ndarray) -> np.ndarray:
    """A quarter as wide and high."""
    cv2 = opencv()
    small: np.ndarray = cv2.pyrDown(cv2.pyrDown(grey))
    return small


def _brightness(small: np.ndarray, pixel: Array) -> Array:
    """(n,) grey levels at corners, told from a picture a quarter as wide and high."""
    height, width = small.shape
    column, row = (np.clip(np.nan_to_num(pixel / 4), 0, (width - 1, height - 1)) + 0.5).astype(np.intp).T
    return small[row, column].astype(np.float64) + 1.0


def levelled(picture: np.ndarray, brightness: float) -> np.ndarray:
    """A picture of uint8 whose brightness differs, as if it did not: the flow and the plates take it as kept."""
    if abs(brightness - 1.0) < LEVELLED:
        return picture
    alike: np.ndarray = opencv().convertScaleAbs(picture, alpha=1.0 / brightness)
    return alike


def _corners(grey: np.ndarray, taken: Array) -> Array:
    """(n, 2) corners, at most `PER_CELL` in every cell of a grid, those that are taken counted."""
    cv2 = opencv()
    height, width = grey.shape
    apart = max(min(width, height) / 100, 4.0)
    found = cv2.goodFeaturesToTrack(grey, 4000, 0.004, apart)
    found = np.zeros((0, 2)) if found is None else found.reshape(-1, 2).astype(np.float64)
    if len(taken) and len(found):
        squared = (found**2).sum(axis=1)[:, None] - 2 * found @ taken.T + (taken**2).sum(axis=1)
        found = found[squared.min(axis=1) > apart**2]
    room = np.full(GRID[0] * GRID[1], PER_CELL)
    np.subtract.at(room, _cell(taken, width, height), 1)
    cell = _cell(found, width, height)
    order = np.argsort(cell, kind="stable")
    start = np.searchsorted(cell[order], cell[order], side="left")
    rank = np.empty(len(found), dtype=np.intp)
    rank[order] = np.arange(len(found)) - start
    return found[rank < room[cell]]


def _cell(pixel: Array, width: int, height: int, grid: tuple[int, int] = GRID) -> Indices:
    """(n,) number of the cell of a grid."""
    column = np.clip(pixel[:, 0] * grid[0] / width, 0, grid[0] - 1).astype(np.intp)
    row = np.clip(pixel[:, 1] * grid[1] / height, 0, grid[1] - 1).astype(np.intp)
    return row * grid[0] + column


def _apart(off: Array, region: Indices) -> float:
    """How far corners (n, 2) lie from where the one motion of all puts them, in the region in which most do so [px]."""
    size = REGIONS[0] * REGIONS[1]
    number = np.bincount(region, minlength=size)
    many = number >= FEWEST
    mean = [np.bincount(region, np.clip(along, -FAR_PX, FAR_PX), size)[many] / number[many] for along in off.T]
    return float(np.hypot(*mean).max(initial=0.0))


def _flow(
    before: np.ndarray, after: np.ndarray, pixel: Array, guess: Array | None, levels: int, steps: Steps = FINE
) -> tuple[Array, np.ndarray]:
    """Places in the picture after, NaN where they are lost, and whether they are found."""
    cv2 = opencv()
    moved, status, _ = cv2.calcOpticalFlowPyrLK(
        before,
        after,
        pixel.astype(np.float32),
        (pixel if guess is None else guess).astype(np.float32),
        winSize=(WINDOW_PX, WINDOW_PX),
        maxLevel=levels,
        criteria=(cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_COUNT, *steps),
        flags=cv2.OPTFLOW_USE_INITIAL_FLOW,
    )
    good = status.ravel().astype(np.bool_)
    return np.where(good[:, None], moved.astype(np.float64), np.nan), good


def _fit(pixel: Array, reference: Array) -> tuple[Array, np.ndarray]:
    """Homography, and which corners agree with it."""
    cv2 = opencv()
    cv2.setRNGSeed(1)
    homography, mask = cv2.findHomography(pixel, reference, cv2.USAC_MAGSAC, INLIER_PX, maxIters=2000, confidence=0.999)
    if homography is None:
        return np.eye(3), np.zeros(len(pixel), dtype=np.bool_)
    agrees = mask.ravel().astype(np.bool_)
    if agrees.sum() >= FEWEST:
        refined, _ = cv2.findHomography(pixel[agrees], reference[agrees], 0)
        homography = homography if refined is None else refined
    return homography, agrees


def _is_still(sightings: list[tuple[int, Indices, Array]]) -> bool:
    """Whether the corners of the first frame stay where they are, the typical one of every quarter of them."""
    _, names, start = sightings[0]
    place = dict(zip(names.tolist(), range(names.size), strict=True))
    middle = np.median(start, axis=0)
    for _, here, pixel in sightings[1:]:
        which = np.array([place.get(name, -1) for name in here.tolist()])
        known = which >= 0
        if known.sum() < FEWEST:
            return False
        moved = pixel[known] - start[which[known]]
        quarter = (start[which[known]] > middle) @ (1, 2)
        for q in range(4):
            if (quarter == q).sum() >= 5 and np.hypot(*np.median(moved[quarter == q], axis=0)) > STILL_PX * 2:
                return False
        if np.hypot(*np.median(moved, axis=0)) > STILL_PX:
            return False
    return True


def _of(motion: BackgroundMotion, frame: Indices) -> Array:
    index = np.asarray(frame, dtype=np.intp) - motion.frames[0]
    outside = (index < 0) | (index >= motion.frames.size)
    if outside.any():
        which = np.atleast_1d(np.asarray(frame))[np.atleast_1d(outside)][0]
        raise InputError(
            f"The motion of the background is not known at frame {which}",
            advice=f"It is from frame {motion.frames[0]} to {motion.frames[-1]}",
        )
    return motion.homography[index]


def _through(homography: Array, pixel: Array) -> Array:
    """(n, 2) through one homography or one for each."""
    moved = np.einsum("...ij,...j->...i", homography[..., :2], pixel) + homography[..., 2]
    return moved[..., :2] / moved[..., 2:]


def _median(steps: Array) -> Array:
    known = steps[np.isfinite(steps).all(axis=1)]
    return np.median(known, axis=0) if len(known) else np.zeros(2)


def _lost(frame: int, why: str) -> InputError:
    return InputError(
        f"The background cannot be followed into frame {frame}: {why}",
        advice="Stay within one shot and clear pictures (--from, --to), or say that the camera stands still (--still)",
    )
