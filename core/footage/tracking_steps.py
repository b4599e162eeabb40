# SPDX-License-Identifier: GPL-3.0-or-later
"""The block from frame to frame, in one direction: what is known of it, and what one more frame adds."""

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from ..errors import InputError
from ..progress import Progress
from ..vectors import Array
from .silhouette import Patch, patch_of
from .sources import frames
from .templates import Appearance, Cover, Sighting, clip_window, cover, fit, learn, search
from .tracking_start import ACCEPTED, Footage, Start

SURE = 0.65
"""Score of a sighting elsewhere, and after a gap."""
RIVAL = 0.12
"""Scores that are nearer than this are not told apart."""
GAP_FRAMES = 12
JUMP_FRAMES = 4
"""Unseen frames after which it is looked for only where its motion leads; as one that has left the picture is."""
MEMORY = 10
CONFIRMED = 3
"""Sightings in a row that make one after a gap or a jump credible."""
LARGEST_JUMP = 1.6
"""Change of the step between frames at an impact, in steps before it, at most."""
SHUTTERS = (0.0, 0.25, 0.5, 0.75, 1.0)
LEARNING = 0.12
"""Share of what is new in each sighting; none where the block moves by less than its diameter from one picture of the
background to the next: it fades into it.
"""
VISIBLE = 0.4
CONTRAST, HELD_CONTRAST = 2.0, 1.5
"""With the background, in standard deviations of a pixel, at least; and where the block is expected, so that it does
not come and go at the limit."""
KINK_SIGMAS = 4.0


@dataclass(frozen=True, eq=False)
class Row:
    """A sighting; `stable` is its centre in the reference frame of the background, `patch` what is seen around it.

    The patch is scaled by `scale_px`, the block's size as it is known by then.
    """

    frame: int
    time_s: float
    seen: Sighting
    stable: Array
    scale_px: float
    patch: Patch | None


class Place(NamedTuple):
    """Where the block was: time [s], place (2,) in the reference frame of the background, standard deviation [px]."""

    time_s: float
    stable: Array
    sigma_px: float


@dataclass(frozen=True, eq=False)
class State:
    """The block on its way.

    Attributes
    ----------
    looks : what it looks like.
    rows : where it has been seen.
    past : the last places of its present flight.
    missed : frames in a row in which it is not seen.
    confirmed : sightings in a row since a doubtful one.
    doubtful : what was known before a sighting that may be wrong, None when there is none.
    votes : (k,) for each of `SHUTTERS`.
    leaving : it is expected outside the picture.
    rivals : places (2,) in the reference frame of the background at which more than one thing looked like it, in the
        frame before.
    picture : the one before.
    """

    looks: Appearance
    rows: tuple[Row, ...]
    past: tuple[Place, ...]
    votes: Array
    missed: int = 0
    confirmed: int = CONFIRMED
    doubtful: "State | None" = None
    leaving: bool = False
    rivals: tuple[Array, ...] = ()
    picture: np.ndarray | None = None

    @property
    def credible(self) -> tuple[Row, ...]:
        """Rows without the last few that come after a gap or a jump and lead nowhere."""
        return self.doubtful.rows if self.doubtful is not None and self.confirmed < CONFIRMED else self.rows


@dataclass(frozen=True, eq=False)
class Expected:
    """Where the block should be in a frame.

    Attributes
    ----------
    frame, time_s : the frame.
    stable, sigma_px : (2,) place in the reference frame of the background, its standard deviation [px].
    centre, inside : (2,) place in the picture or beside it, and the nearest one in it [px].
    velocity, step : (2,) [px/s], and to the next frame [px].
    tight, wide : how far around it is looked for as expected, and after an impact [px].
    """

    frame: int
    time_s: float
    stable: Array
    sigma_px: float
    centre: Array
    inside: Array
    velocity: Array
    step: Array
    tight: float
    wide: float


def follow(footage: Footage, start: Start, end: int, progress: Progress) -> tuple[tuple[Row, ...], str]:
    """Rows from the start, its own frame first, and why they end.

    Raises
    ------
    InputError : the block hardly stands out at the start.
    """
    step, total = 1 if end >= start.frame else -1, abs(end - start.frame)
    state: State | None = None
    for done, (frame, picture) in enumerate(frames(footage.video, range(start.frame, end + step, step))):
        progress("Following the block", done, total)
        if state is None:
            state = _begin(footage, start, picture)
            continue
        state, lost = _next(footage, state, frame, picture)
        if lost:
            return state.credible, lost
    assert state is not None  # the frame of the start is always among them
    if state.missed:
        verb = "leaves the picture" if state.leaving else "is not seen"
        return state.credible, f"It {verb} after frame {state.rows[-1].frame}"
    return state.rows, f"Frame {end} is the {'first' if step < 0 else 'last'} that was looked at"


def _begin(footage: Footage, start: Start, picture: np.ndarray) -> State:
    frame, looks, diameter = start.frame, start.looks, start.looks.diameter_px
    velocity = np.zeros(2) if start.velocity is None else start.velocity
    step_s = footage.step_s(frame)
    step = velocity * step_s
    here = cover(picture, frame, footage.plates, looks, start.pixel, 2 * diameter + float(np.hypot(*step)) + 3)
    looks, votes = _with_shutter(looks, np.zeros(len(SHUTTERS)), here, start.pixel, step)
    seen = fit(here, looks, start.pixel, step * looks.shutter)
    if seen is not None and seen.contrast < 1.5 * CONTRAST:
        raise InputError(
            f"The block hardly stands out from the background in frame {frame}",
            advice="Click on it in a frame in which it does",
        )
    if seen is None or seen.score < 0.3:
        seen = Sighting(start.pixel, 0.2 * diameter, diameter, 0.5, 1.0, 1.0, 0.0)
    time_s, stable = float(footage.video.time_s[frame]), footage.stable(frame, seen.pixel)
    past: tuple[Place, ...] = (Place(time_s, stable, max(seen.sigma_px, 0.2)),)
    if start.velocity is not None:
        past = (Place(time_s - step_s, stable - velocity * step_s, 0.5 * diameter), *past)
    return State(looks, (_row(footage, frame, picture, seen, stable, looks),), past, votes)


def _row(footage: Footage, frame: int, picture: np.ndarray, seen: Sighting, stable: Array, looks: Appearance) -> Row:
    patch = patch_of(picture, frame, footage.plates, seen.pixel, looks.diameter_px)
    return Row(frame, float(footage.video.time_s[frame]), seen, stable, looks.diameter_px, patch)


def _next(footage: Footage, state: State, frame: int, picture: np.ndarray) -> tuple[State, str]:
    """The state after one more frame, and why the block is given up, empty while it is not."""
    time_s = float(footage.video.time_s[frame])
    if time_s == state.past[-1].time_s or frame in footage.repeated:
        return state, ""
    state, expected = _expected(footage, state, frame, time_s)
    before, state = state.picture, replace(state, picture=picture)
    reach = expected.wide + state.looks.diameter_px + 0.5 * float(np.hypot(*expected.step)) * state.looks.shutter + 3
    if before is not None and _repeated(before, picture, expected.inside, reach):
        return state, ""
    here = cover(picture, frame, footage.plates, state.looks, expected.inside, reach)
    found = search(here, state.looks, expected.step * state.looks.shutter)
    if (seen := _as_expected(state, here, expected, found)) is not None:
        return _accepted(footage, state, picture, here, seen, expected, jumped=False), ""
    why = _reason(state, here, expected, found)
    if expected.wide > expected.tight and state.confirmed >= CONFIRMED - 1:
        elsewhere = _elsewhere(footage, state, here, expected, found)
        places = tuple(footage.stable(frame, seen.pixel) for seen in elsewhere)
        if len(elsewhere) > 1:
            elsewhere = [seen for seen, place in zip(elsewhere, places, strict=True) if _moves(state, place)]
        if len(elsewhere) == 1:
            return _accepted(footage, state, picture, here, elsewhere[0], expected, jumped=True), ""
        why = "ambiguous: more than one thing looks like it" if places else why
        state = replace(state, rivals=places)
    state = _without_doubtful(state)
    state = replace(state, missed=state.missed + 1)
    return state, _given_up(state, expected, footage.usual_step_s, why)


def _expected(footage: Footage, state: State, frame: int, time_s: float) -> tuple[State, Expected]:
    """Where the block should be, and the state that knows whether it is leaving the picture."""
    diameter, size = state.looks.diameter_px, np.array([footage.video.width, footage.video.height])
    stable, sigma, velocity = _predicted(state, time_s, footage.usual_step_s)
    centre, step = footage.pixel(frame, stable), velocity * footage.step_s(frame)
    outside = bool((centre < 0).any() or (centre > size).any())
    leaving = outside and (state.leaving or state.missed <= 2)
    gone = bool((centre < -diameter / 2).any() or (centre > size + diameter / 2).any())
    tight = 0.5 * diameter + 3 * sigma
    wide = diameter + LARGEST_JUMP * float(np.hypot(*step)) * (1 + min(state.missed, JUMP_FRAMES))
    wide = max(tight, wide) if state.missed < JUMP_FRAMES and not gone else tight
    wide = min(wide, 0.25 * float(size.max()))
    expected = Expected(frame, time_s, stable, sigma, centre, np.clip(centre, 0.0, size), velocity, step, tight, wide)
    return replace(state, leaving=leaving), expected


def _predicted(state: State, time_s: float, usual_step_s: float) -> tuple[Array, float, Array]:
    """Place (2,), its standard deviation, and velocity (2,) at a time, in the reference frame."""
    diameter, past = state.looks.diameter_px, state.past
    when, place, sigma = (np.array(values) for values in zip(*past, strict=True))
    scale = max(float(np.abs(when - time_s).max()), 1e-9)
    degree = min(len(past) - 1, 1 if len(past) < 5 else 2)
    design = ((when - time_s) / scale)[:, None] ** np.arange(degree + 1) / sigma[:, None]
    normal = design.T @ design
    if degree == 2:  # an acceleration is expected to move it by less than a diameter or two
        normal[2, 2] += 1 / (4 * diameter) ** 2
    values = np.linalg.solve(normal, design.T @ (place / sigma[:, None]))
    spread = float(np.sqrt(np.linalg.inv(normal)[0, 0])) if degree else 1.5 * diameter
    velocity = values[1] / scale if degree else np.zeros(2)
    ahead = abs(time_s - past[-1].time_s) / max(usual_step_s, 1e-9)
    return values[0], spread + 0.05 * diameter * min(ahead, 4), velocity


def _repeated(before: np.ndarray, picture: np.ndarray, centre: Array, reach: float) -> bool:
    """The same picture once more, as some cameras and converters write it."""
    left, top, right, bottom = clip_window(picture, centre, reach)
    part = (slice(top, bottom), slice(left, right))
    return right > left and bottom > top and np.array_equal(before[part], picture[part])


def _as_expected(state: State, here: Cover, expected: Expected, found: tuple[Array, Array]) -> Sighting | None:
    """The sighting where the block is expected."""
    pixel, score = found
    away = np.hypot(*(pixel - expected.centre).T)
    needed = SURE if state.missed > 2 else ACCEPTED
    most = 1.0 if state.confirmed < CONFIRMED else np.inf  # scores above are of faint things
    for i in np.argsort(0.3 * (away / expected.tight) ** 2 - np.minimum(score, most), kind="stable"):
        if away[i] <= expected.tight and score[i] >= needed - 0.1:
            seen = fit(here, state.looks, pixel[i], expected.step * state.looks.shutter)
            if seen is not None and seen.score >= needed and seen.visible > 0.15 and seen.contrast > HELD_CONTRAST:
                return seen
    return None


def _elsewhere(
    footage: Footage, state: State, here: Cover, expected: Expected, found: tuple[Array, Array]
) -> list[Sighting]:
    """What looks like the block around, the best first, and none that is clearly less like it.

    After an impact its streak has another direction, so that a place is judged with its own.
    """
    looks, streak = state.looks, expected.step * state.looks.shutter
    last = footage.pixel(expected.frame, state.rows[-1].stable)
    tries = [found]
    if float(np.hypot(*streak)) > 0.4 * looks.diameter_px:
        tries.append(search(here, looks, np.zeros(2)))
    sightings: list[Sighting] = []
    for pixel, score in tries:
        for place, likeness in zip(pixel, score, strict=True):
            if np.hypot(*(place - expected.centre)) > expected.wide or likeness < SURE - 0.2:
                continue
            seen = fit(here, looks, place, (place - last) / (1 + state.missed) * looks.shutter)
            if (
                seen is not None
                and seen.score > SURE
                and seen.amplitude > 0.6
                and seen.visible > VISIBLE
                and seen.contrast > CONTRAST
            ):
                sightings.append(seen)
    sightings.sort(key=lambda seen: -seen.score)
    rivals = [
        seen
        for seen in sightings[1:]
        if np.hypot(*(seen.pixel - sightings[0].pixel)) > 0.5 * looks.diameter_px
        and seen.score > sightings[0].score - RIVAL
    ]
    return sightings[:1] + rivals


def _moves(state: State, stable: Array) -> bool:
    """Whether nothing like the block was at this place of the background in the frame before, as dust of an impact."""
    return all(np.hypot(*(stable - rival)) > 0.35 * state.looks.diameter_px for rival in state.rivals)


def _accepted(
    footage: Footage,
    state: State,
    picture: np.ndarray,
    here: Cover,
    seen: Sighting,
    expected: Expected,
    *,
    jumped: bool,
) -> State:
    """The state with one more sighting."""
    frame, step = expected.frame, expected.step
    stable = footage.stable(frame, seen.pixel)
    if not jumped and len(state.past) > 2:
        looks, votes = _with_shutter(state.looks, state.votes, here, seen.pixel, step)
        state = replace(state, looks=looks, votes=votes)
    innovation = float(np.hypot(*(stable - expected.stable)))
    usual = np.sqrt(expected.sigma_px**2 + seen.sigma_px**2 + (0.06 * seen.diameter_px + 0.2) ** 2)
    if jumped or state.missed:
        state = _without_doubtful(state)
        state = replace(state, doubtful=state, confirmed=0)
    else:
        state = replace(state, confirmed=state.confirmed + 1)
    past = state.past
    if jumped or innovation > KINK_SIGMAS * usual:
        past = (past[-1]._replace(sigma_px=0.3 * seen.diameter_px + 0.3 * float(np.hypot(*step))),)
    past = (*past[1 - MEMORY :], Place(expected.time_s, stable, max(seen.sigma_px, 0.1)))
    rows = (*state.rows, _row(footage, frame, picture, seen, stable, state.looks))
    state = replace(state, missed=0, past=past, rows=rows, rivals=())
    moved = float(np.hypot(*step))
    blurred = moved * state.looks.shutter > 0.6 * seen.diameter_px
    slow = moved * footage.plates.spacing < seen.diameter_px
    if seen.score > 0.75 and seen.visible > 0.9 and state.confirmed >= CONFIRMED and not (blurred or slow):
        return replace(state, looks=learn(picture, frame, footage.plates, state.looks, seen, LEARNING))
    return state


def _with_shutter(looks: Appearance, votes: Array, here: Cover, centre: Array, step: Array) -> tuple[Appearance, Array]:
    """The share of the time for which the shutter is open, from the first frames in which this shows."""
    if votes.max() > 6 or np.hypot(*step) < 0.35 * looks.diameter_px:
        return looks, votes
    sightings = [fit(here, looks, centre, step * shutter) for shutter in SHUTTERS]
    votes = votes + [0.0 if seen is None else max(seen.score, 0.0) for seen in sightings]
    return replace(looks, shutter=SHUTTERS[int(np.argmax(votes))]), votes


def _without_doubtful(state: State) -> State:
    """The state before sightings after a gap or a jump that led nowhere: they have not been the block."""
    kept = state.doubtful
    if kept is not None and state.confirmed < CONFIRMED:
        missed = state.missed + kept.missed + len(state.rows) - len(kept.rows)
        state = replace(state, rows=kept.rows, past=kept.past, looks=kept.looks, missed=missed)
    return replace(state, doubtful=None, confirmed=CONFIRMED)


def _reason(state: State, here: Cover, expected: Expected, found: tuple[Array, Array]) -> str:
    """Why the block is not seen where it is expected."""
    rows, columns = here.noise.shape
    row, column = int(expected.inside[1] - here.top), int(expected.inside[0] - here.left)
    half = max(int(state.looks.diameter_px / 2), 1)
    around = here.noise[max(row - half, 0) : row + half + 1, max(column - half, 0) : column + half + 1]
    if 0 <= row < rows and 0 <= column < columns and around.size and np.median(around) > 0.5:
        return "the contrast with the background is too low"
    pixel, score = found
    best = float(score[np.hypot(*(pixel - expected.centre).T) <= expected.tight].max(initial=0))
    return "hidden" if best < 0.4 else "hidden in part or changed"


def _given_up(state: State, expected: Expected, usual_step_s: float, why: str) -> str:
    """The sentence when the block is not looked for any longer, else empty."""
    diameter, frame = state.looks.diameter_px, state.rows[-1].frame
    if state.missed <= GAP_FRAMES and (expected.sigma_px <= 4 * diameter or state.leaving):
        return ""
    if state.leaving:
        return f"It leaves the picture after frame {frame}"
    slow = float(np.hypot(*expected.velocity)) * usual_step_s < 0.05 * diameter
    return f"It is lost after frame {frame}: {'at rest, or ' if slow else ''}{why}"
