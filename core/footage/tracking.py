# SPDX-License-Identifier: GPL-3.0-or-later
"""Assisted tracking: from one click the block is followed through the video, until it is honestly lost."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from ..errors import InputError
from ..progress import Progress, silent
from ..vectors import Array, Indices
from .background import BackgroundMotion, background_motion, destabilise, stabilise
from .kinks import find_kinks
from .plates import Plates
from .sources import Source, frames
from .templates import Appearance, Cover, Sighting, clip_window, cover, first_looks, fit, learn, search

ACCEPTED = 0.5
"""Score of a sighting where the block is expected, at least."""
SURE = 0.65
"""Score of a sighting elsewhere, and after a gap."""
RIVAL = 0.12
"""Scores that are nearer than this are not told apart."""
GAP_FRAMES = 12
JUMP_FRAMES = 4
"""Unseen frames after which it is looked for only where its motion leads, or where it left the picture."""
MEMORY = 10
CONFIRMED = 3
"""Sightings in a row that make one after a gap or a jump credible."""
LARGEST_JUMP = 1.6
"""Change of the step between frames at an impact, in steps before it, at most."""
SHUTTERS = (0.0, 0.25, 0.5, 0.75, 1.0)
LEARNING = 0.12
VISIBLE = 0.4
CONTRAST = 2.0
"""With the background, in standard deviations of a pixel, at least."""
KINK_SIGMAS = 4.0
NEIGHBOURS = 8
SHAPE = 0.005
"""Standard deviation of the centre of a block that is no sphere, in diameters."""


@dataclass(frozen=True, eq=False)
class BlockTrack:
    """The block's centre in m frames.

    Attributes
    ----------
    frame : (m,) ascending; frames in which it is not seen are left out.
    time_s : (m,) video time [s].
    pixel : (m, 2) centre of the block, of the streak when it is blurred [px].
    sigma_px : (m,) standard deviation of each coordinate.
    score : (m,) likeness to the block: 1 for a perfect disc of its colour.
    stable : (m, 2) `pixel` in the reference frame of the background.
    diameter_px : (m,) fitted size.
    stopped : sentences: why the track begins where it does, and why it ends.
    """

    frame: Indices
    time_s: Array
    pixel: Array
    sigma_px: Array
    score: Array
    stable: Array
    diameter_px: Array
    stopped: tuple[str, str]


@dataclass(frozen=True, eq=False)
class _Row:
    frame: int
    time_s: float
    seen: Sighting
    stable: Array


@dataclass(frozen=True, eq=False)
class _Memory:
    """What was known before a sighting that may be wrong."""

    rows: list[_Row]
    past: list[tuple[float, Array, float]]
    looks: Appearance
    missed: int


@dataclass(frozen=True, eq=False)
class _Start:
    frame: int
    pixel: Array
    looks: Appearance
    velocity: Array | None


def track_block(
    video: Source,
    frame: int,
    pixel: Array | Sequence[float],
    *,
    clicks: Sequence[tuple[int, float, float]] = (),
    diameter_px: float | None = None,
    background: BackgroundMotion | None = None,
    first: int | None = None,
    last: int | None = None,
    progress: Progress = silent,
) -> BlockTrack:
    """Follow the block forwards and backwards from a click.

    Parameters
    ----------
    frame, pixel : the click, somewhere on the block.
    clicks : further ones (frame, u, v), which bring the track back to the block.
    diameter_px : of the block; measured at the click when it is not given.
    background : its motion; found when it is not given.
    first, last : frames beyond which is not looked.

    Raises
    ------
    InputError : a click outside the video, nothing that moves at a click, a background that cannot be followed.

    Notes
    -----
    The block is looked for where a motion of constant acceleration over the last frames puts it; where it is not
    there, around its last place, as an impact may have turned it. A sighting must look like the block: a disc or
    streak of its colour and size in front of the background. It is not looked for beyond a gap of a few frames.

    `sigma_px` tells the scatter from frame to frame. Where one side of the block is in the shade and as dark as the
    ground, the centre is that of the side that shows: an offset of up to a fifth of the diameter, the same in all
    frames, which `sigma_px` does not hold; times of impacts hardly feel it.
    """
    first, last = 0 if first is None else first, video.time_s.size - 1 if last is None else last
    marks = sorted({int(f): (float(u), float(v)) for f, u, v in [*clicks, (frame, *pixel)]}.items())
    _check(video, marks, first, last)
    motion = (
        background_motion(video, first=first, last=last, progress=progress)[0] if background is None else background
    )
    plates = Plates(video, motion, progress)
    starts = [_start(video, plates, motion, at, np.array(place), diameter_px) for at, place in marks]

    def follow(start: _Start, end: int) -> tuple[list[_Row], str]:
        return _follow(video, plates, motion, start, end, progress)

    rows, before = follow(starts[0], first)
    rows = rows[::-1]
    for start, following in pairwise(starts):
        rows += _between(follow, start, following)[bool(rows) :]
    forwards, after = follow(starts[-1], last)
    rows += forwards[bool(rows) :]
    return _assembled(rows, (before, after))


def _check(video: Source, marks: Sequence[tuple[int, tuple[float, float]]], first: int, last: int) -> None:
    count = video.time_s.size
    if not 0 <= first <= last < count:
        raise InputError(f"Frames {first} to {last} are not in the video, which has the frames 0 to {count - 1}")
    for frame, (u, v) in marks:
        if not first <= frame <= last:
            raise InputError(
                f"The click in frame {frame} is outside the frames {first} to {last}",
                advice="Click in a frame that is looked at",
            )
        if not (0 <= u <= video.width and 0 <= v <= video.height):
            raise InputError(
                f"The click at ({u:g}, {v:g}) is outside the picture of {video.width} × {video.height} pixels",
                advice="Pixels count from the top left corner, u to the right and v down",
            )


def _start(
    video: Source, plates: Plates, motion: BackgroundMotion, frame: int, click: Array, diameter_px: float | None
) -> _Start:
    """What is at a click, and how fast it moves."""
    low, high = int(motion.frames[0]), int(motion.frames[-1])
    around = dict(frames(video, range(max(frame - 1, low), min(frame + 1, high) + 1)))
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
    places = {}
    for other in (frame - 1, frame + 1):
        if other in around:
            at = destabilise(motion, np.array([other]), stabilise(motion, np.array([frame]), centre[None]))[0]
            here = cover(around[other], other, plates, looks, at, reach)
            pixel, score = search(here, looks, streak, reach)
            good = score > max(ACCEPTED, score.max(initial=0) - 0.2)
            places[other] = stabilise(motion, np.full(good.sum(), other), pixel[good]), score[good]
    origin = stabilise(motion, np.array([frame]), centre[None])[0]
    return _Start(frame, centre, looks, _velocity(video.time_s, frame, origin, places, looks.diameter_px))


def _velocity(
    time_s: Array, frame: int, origin: Array, places: dict[int, tuple[Array, Array]], diameter: float
) -> Array | None:
    """(2,) [px/s] that joins the places in the frames before and after best with that in the frame itself."""
    options = {}
    for other, (place, score) in places.items():
        step = time_s[other] - time_s[frame]
        if step and len(place):
            options[other] = (place - origin) / step, score
    if len(options) == 2:
        (before, a), (after, b) = options[frame - 1], options[frame + 1]
        step = abs(time_s[frame + 1] - time_s[frame])
        differs = np.hypot(*(before[:, None] - after[None]).transpose(2, 0, 1)) * step / diameter
        cost = differs - a[:, None] - b[None]
        i, j = np.unravel_index(int(np.argmin(cost)), cost.shape)
        return 0.5 * (before[i] + after[j])
    for velocity, score in options.values():
        return velocity[int(np.argmax(score))]
    return None


def _between(follow: Callable[[_Start, int], tuple[list[_Row], str]], start: _Start, end: _Start) -> list[_Row]:
    """Rows from one click to the next: forwards while this leads there, backwards from the next where it does not."""
    there, _ = follow(start, end.frame)
    back, _ = follow(end, start.frame)
    back = back[::-1]
    near = {row.frame: row for row in back}
    shared = [i for i, row in enumerate(there) if row.frame in near]
    if not shared:
        return there + [row for row in back if row.frame > there[-1].frame] if there else back
    apart = [float(np.hypot(*(there[i].stable - near[there[i].frame].stable))) for i in shared]
    turn = there[shared[len(apart) - 1 - int(np.argmin(apart[::-1]))]].frame
    return [row for row in there if row.frame <= turn] + [row for row in back if row.frame > turn]


def _follow(
    video: Source, plates: Plates, motion: BackgroundMotion, start: _Start, end: int, progress: Progress
) -> tuple[list[_Row], str]:
    """Rows from the start, its own frame first, and why they end."""
    step = 1 if end >= start.frame else -1
    state = _State(start, video, motion)
    for frame, picture in frames(video, range(start.frame, end + step, step)):
        progress("Following the block", abs(frame - start.frame), abs(end - start.frame))
        reason = state.advance(frame, picture, plates)
        if reason:
            return state.credible(), reason
    edge = "first" if step < 0 else "last"
    if state.missed:
        verb = "leaves the picture" if state.leaving else "is not seen"
        return state.credible(), f"It {verb} after frame {state.rows[-1].frame}"
    return state.rows, f"Frame {end} is the {edge} that was looked at"


class _State:
    """The block on its way: what it looks like, where it has been, how long it has not been seen."""

    def __init__(self, start: _Start, video: Source, motion: BackgroundMotion) -> None:
        self.start, self.video, self.motion = start, video, motion
        self.looks = start.looks
        self.rows: list[_Row] = []
        self.past: list[tuple[float, Array, float]] = []
        self.missed = self.since = 0
        self.votes = np.zeros(len(SHUTTERS))
        self.before: np.ndarray | None = None
        self.leaving = False
        self.doubtful: _Memory | None = None
        self.why = ""

    def advance(self, frame: int, picture: np.ndarray, plates: Plates) -> str:
        """Look for the block in the next frame; the reason when it is given up."""
        time = float(self.video.time_s[frame])
        if not self.rows and not self.missed:
            return self._begin(frame, time, picture, plates)
        if self.past and time == self.past[-1][0]:
            return ""
        stable, sigma, velocity = self._predicted(time)
        centre = destabilise(self.motion, np.array([frame]), stable[None])[0]
        diameter = self.looks.diameter_px
        step = velocity * self._step_s(frame)
        self.leaving = self._outside(centre, 0.0) and (self.leaving or self.missed <= 2)
        centre = np.clip(centre, 0.0, (self.video.width, self.video.height))
        tight = 0.5 * diameter + 3 * sigma
        wide = diameter + LARGEST_JUMP * float(np.hypot(*step)) * (1 + min(self.missed, JUMP_FRAMES))
        wide = max(tight, wide) if self.leaving or self.missed < JUMP_FRAMES else tight
        wide = min(wide, 0.25 * max(picture.shape[:2]))
        reach = wide + diameter + 0.5 * float(np.hypot(*step)) * self.looks.shutter + 3
        if self._repeated(picture, centre, reach):
            return ""
        here = cover(picture, frame, plates, self.looks, centre, reach)
        seen, jumped = self._choose(here, centre, step, tight, wide)
        if seen is None:
            self._take_back()
            self.missed += 1
            return self._given_up(sigma, velocity, frame)
        self._accept(frame, time, picture, plates, here, seen, jumped, (stable, sigma), step)
        return ""

    def _begin(self, frame: int, time: float, picture: np.ndarray, plates: Plates) -> str:
        velocity = np.zeros(2) if self.start.velocity is None else self.start.velocity
        step, diameter = velocity * self._step_s(frame), self.looks.diameter_px
        here = cover(picture, frame, plates, self.looks, self.start.pixel, 2 * diameter + float(np.hypot(*step)) + 3)
        self._vote(here, self.start.pixel, step)
        seen = fit(here, self.looks, self.start.pixel, step * self.looks.shutter)
        if seen is not None and seen.contrast < 1.5 * CONTRAST:
            raise InputError(
                f"The block hardly stands out from the background in frame {frame}",
                advice="Click on it in a frame in which it does",
            )
        if seen is None or seen.score < 0.3:
            seen = Sighting(self.start.pixel, 0.2 * diameter, diameter, 0.5, 1.0, 1.0, 0.0)
        stable = self._stable(frame, seen.pixel)
        self.rows.append(_Row(frame, time, seen, stable))
        if self.start.velocity is not None:
            lag = np.sign(self._lag(frame)) * self._step_s(frame)
            self.past.append((time - lag, stable - velocity * lag, 0.5 * diameter))
        self.past.append((time, stable, max(seen.sigma_px, 0.2)))
        self.since = CONFIRMED
        return ""

    def _choose(
        self, here: Cover, centre: Array, step: Array, tight: float, wide: float
    ) -> tuple[Sighting | None, bool]:
        """The sighting where the block is expected, else the only one around that looks like it, and whether so."""
        streak = step * self.looks.shutter
        pixel, score = search(here, self.looks, streak, wide)
        away = np.hypot(*(pixel - centre).T) if len(pixel) else np.zeros(0)
        needed = SURE if self.missed > 2 else ACCEPTED
        value = score - 0.3 * (away / tight) ** 2
        for i in np.argsort(-value):
            if away[i] <= tight and score[i] >= needed - 0.1:
                seen = fit(here, self.looks, pixel[i], streak)
                if seen is not None and seen.score >= needed and seen.visible > 0.15 and seen.contrast > CONTRAST:
                    return seen, False
        self.why = self._reason(here, centre, score, away, tight)
        if wide <= tight or self.since < CONFIRMED - 1:
            return None, False
        return self._elsewhere(here, centre, streak, wide), True

    def _elsewhere(self, here: Cover, centre: Array, streak: Array, wide: float) -> Sighting | None:
        """After an impact: the streak has another direction, so that a place is judged with its own."""
        last = destabilise(self.motion, np.array([self._frame_now]), self.rows[-1].stable[None])[0]
        found: list[Sighting] = []
        length = float(np.hypot(*streak))
        for trial in (streak, np.zeros(2)) if length > 0.4 * self.looks.diameter_px else (streak,):
            pixel, score = search(here, self.looks, trial, wide)
            for place, likeness in zip(pixel, score, strict=True):
                if np.hypot(*(place - centre)) > wide or likeness < SURE - 0.2:
                    continue
                own = (place - last) / (1 + self.missed) * self.looks.shutter
                seen = fit(here, self.looks, place, own)
                if (
                    seen is not None
                    and seen.score > SURE
                    and seen.amplitude > 0.6
                    and seen.visible > VISIBLE
                    and seen.contrast > CONTRAST
                ):
                    found.append(seen)
        found.sort(key=lambda seen: -seen.score)
        rivals = [
            seen
            for seen in found[1:]
            if np.hypot(*(seen.pixel - found[0].pixel)) > 0.5 * self.looks.diameter_px
            and seen.score > found[0].score - RIVAL
        ]
        if rivals:
            self.why = "ambiguous: more than one thing looks like it"
            return None
        return found[0] if found else None

    def _accept(
        self,
        frame: int,
        time: float,
        picture: np.ndarray,
        plates: Plates,
        here: Cover,
        seen: Sighting,
        jumped: bool,
        predicted: tuple[Array, float],
        step: Array,
    ) -> None:
        stable = self._stable(frame, seen.pixel)
        if not jumped and len(self.past) > 2:
            self._vote(here, seen.pixel, step)
        innovation = float(np.hypot(*(stable - predicted[0])))
        usual = np.sqrt(predicted[1] ** 2 + seen.sigma_px**2 + (0.06 * seen.diameter_px + 0.2) ** 2)
        if jumped or self.missed:
            self._take_back()
            self.doubtful = _Memory(self.rows, self.past, self.looks, self.missed)
            self.since = 0
        else:
            self.since += 1
        if jumped or innovation > KINK_SIGMAS * usual:
            when, where, _ = self.past[-1]
            self.past = [(when, where, 0.3 * seen.diameter_px + 0.3 * float(np.hypot(*step)))]
        self.missed = 0
        self.past = [*self.past[1 - MEMORY :], (time, stable, max(seen.sigma_px, 0.1))]
        self.rows = [*self.rows, _Row(frame, time, seen, stable)]
        if seen.score > 0.75 and seen.visible > 0.9 and self.since >= CONFIRMED:
            blurred = float(np.hypot(*step)) * self.looks.shutter > 0.6 * seen.diameter_px
            if not blurred:
                self.looks = learn(picture, frame, plates, self.looks, seen, LEARNING)

    def _vote(self, here: Cover, centre: Array, step: Array) -> None:
        """Find the share of the time for which the shutter is open, from the first frames in which this shows."""
        if self.votes.max() > 6 or np.hypot(*step) < 0.35 * self.looks.diameter_px:
            return
        scores = [fit(here, self.looks, centre, step * shutter) for shutter in SHUTTERS]
        self.votes += [0.0 if seen is None else max(seen.score, 0.0) for seen in scores]
        self.looks = replace(self.looks, shutter=SHUTTERS[int(np.argmax(self.votes))])

    def _predicted(self, time: float) -> tuple[Array, float, Array]:
        """Place (2,), its standard deviation, and velocity (2,) at a time, in the reference frame."""
        when = np.array([t for t, _, _ in self.past])
        place = np.array([p for _, p, _ in self.past])
        sigma = np.array([s for _, _, s in self.past])
        scale = max(float(np.abs(when - time).max()), 1e-9)
        degree = min(len(self.past) - 1, 1 if len(self.past) < 5 else 2)
        design = ((when - time) / scale)[:, None] ** np.arange(degree + 1) / sigma[:, None]
        normal = design.T @ design
        if degree == 2:  # an acceleration is expected to move it by less than a diameter or two
            normal[2, 2] += 1 / (4 * self.looks.diameter_px) ** 2
        values = np.linalg.solve(normal, design.T @ (place / sigma[:, None]))
        spread = float(np.sqrt(np.linalg.inv(normal)[0, 0]))
        velocity = values[1] / scale if degree else np.zeros(2)
        if degree == 0:
            spread = 1.5 * self.looks.diameter_px
        ahead = abs(time - self.past[-1][0]) / max(self._usual_s, 1e-9)
        return values[0], spread + 0.05 * self.looks.diameter_px * min(ahead, 4), velocity

    def _reason(self, here: Cover, centre: Array, score: Array, away: Array, tight: float) -> str:
        rows, columns = here.noise.shape
        row, column = int(centre[1] - here.top), int(centre[0] - here.left)
        half = max(int(self.looks.diameter_px / 2), 1)
        around = here.noise[max(row - half, 0) : row + half + 1, max(column - half, 0) : column + half + 1]
        if 0 <= row < rows and 0 <= column < columns and around.size and np.median(around) > 0.5:
            return "the contrast with the background is too low"
        best = float(score[away <= tight].max(initial=0))
        return "hidden" if best < 0.4 else "hidden in part or changed"

    def _given_up(self, sigma: float, velocity: Array, frame: int) -> str:
        fades = self.missed > GAP_FRAMES or (sigma > 4 * self.looks.diameter_px and not self.leaving)
        if not fades:
            return ""
        credible = self.credible()
        at = credible[-1].frame if credible else frame
        if self.leaving:
            return f"It leaves the picture after frame {at}"
        slow = float(np.hypot(*velocity)) * self._usual_s < 0.05 * self.looks.diameter_px
        return f"It is lost after frame {at}: {'at rest, or ' if slow else ''}{self.why or 'hidden'}"

    def credible(self) -> list[_Row]:
        """Rows without the last few that come after a gap or a jump and lead nowhere."""
        return self.doubtful.rows if self.doubtful is not None and self.since < CONFIRMED else self.rows

    def _take_back(self) -> None:
        """Sightings after a gap or a jump that lead nowhere have not been the block."""
        if self.doubtful is not None and self.since < CONFIRMED:
            kept, wrong = self.doubtful, len(self.rows) - len(self.doubtful.rows)
            self.rows, self.past, self.looks = kept.rows, kept.past, kept.looks
            self.missed += kept.missed + wrong
        self.doubtful, self.since = None, CONFIRMED

    def _outside(self, centre: Array, margin: float) -> bool:
        return bool(
            (centre < -margin).any() or (centre > np.array([self.video.width, self.video.height]) + margin).any()
        )

    def _repeated(self, picture: np.ndarray, centre: Array, reach: float) -> bool:
        """The same picture once more, as some cameras and converters write it."""
        left, top, right, bottom = clip_window(picture, centre, reach)
        before, self.before = self.before, picture
        part = (slice(top, bottom), slice(left, right))
        return before is not None and right > left and bottom > top and np.array_equal(before[part], picture[part])

    def _stable(self, frame: int, pixel: Array) -> Array:
        self._frame_now = frame
        return stabilise(self.motion, np.array([frame]), pixel[None])[0]

    def _lag(self, frame: int) -> float:
        return 1.0 if frame >= self.start.frame else -1.0

    def _step_s(self, frame: int) -> float:
        """From one frame to the next around a frame [s]."""
        self._frame_now = frame
        time = self.video.time_s
        low, high = max(frame - 1, 0), min(frame + 1, time.size - 1)
        return float(time[high] - time[low]) / max(high - low, 1)

    @property
    def _usual_s(self) -> float:
        return float(np.median(np.diff(self.video.time_s))) if self.video.time_s.size > 1 else 1.0


def _assembled(rows: Sequence[_Row], stopped: tuple[str, str]) -> BlockTrack:
    track = BlockTrack(
        frame=np.array([row.frame for row in rows], dtype=np.intp),
        time_s=np.array([row.time_s for row in rows]),
        pixel=np.array([row.seen.pixel for row in rows]),
        sigma_px=np.array([row.seen.sigma_px for row in rows]),
        score=np.array([min(row.seen.score, 1.0) for row in rows]),
        stable=np.array([row.stable for row in rows]),
        diameter_px=np.array([row.seen.diameter_px for row in rows]),
        stopped=stopped,
    )
    return replace(track, sigma_px=_calibrated(track))


def _calibrated(track: BlockTrack) -> Array:
    """Standard deviations that agree with how far the places scatter about smooth motion.

    What the fit of one frame says is scaled by one factor, from the residuals of the places against parabolas through
    their neighbours in the same flight. A share of the size stands for the shape, whose turning shows only slowly;
    where the block looks less like itself than usual, because a part of it is hidden, more is added.
    """
    if track.frame.size < 3:
        return 2 * track.sigma_px + 0.05 * track.diameter_px
    unlike = np.maximum(np.median(track.score) - 0.03 - track.score, 0)
    fitted, shape = np.maximum(track.sigma_px, 0.01), SHAPE * track.diameter_px + 0.35 * track.diameter_px * unlike
    scale, breaks = 1.5, np.zeros(0)
    for _ in range(3):
        sigma = np.hypot(fitted * scale, shape)
        ratio = _smooth_ratio(track.time_s, track.stable, sigma, breaks)
        if ratio.size < 8:
            break
        scale = float(np.clip(scale * np.sqrt(np.mean(np.minimum(ratio, 12.0)) / 2), 0.3, 8.0))
        breaks = find_kinks(track.time_s, track.stable, np.hypot(fitted * scale, shape)).time_s
    return np.hypot(fitted * scale, shape)


def _smooth_ratio(time_s: Array, place: Array, sigma: Array, breaks: Array) -> Array:
    """(k,) squared residuals, both coordinates, over their expected variance; chi-squared with 2 degrees of freedom.

    Each is that of a sighting against the parabola through its neighbours on both sides, none beyond a break.
    """
    flight = np.searchsorted(breaks, time_s)
    ratio = []
    for i in range(time_s.size):
        window = np.arange(max(i - NEIGHBOURS, 0), min(i + NEIGHBOURS + 1, time_s.size))
        window = window[(flight[window] == flight[i]) & (window != i)]
        if min((window < i).sum(), (window > i).sum()) < 3:
            continue
        when = (time_s[window] - time_s[i]) / np.ptp(time_s[window])
        design = when[:, None] ** np.arange(3) / sigma[window, None]
        spread = np.linalg.inv(design.T @ design)
        value = spread @ design.T @ (place[window] / sigma[window, None])
        ratio.append(np.sum((place[i] - value[0]) ** 2) / (sigma[i] ** 2 + spread[0, 0]))
    return np.array(ratio)
