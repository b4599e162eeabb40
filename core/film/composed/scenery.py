# SPDX-License-Identifier: GPL-3.0-or-later
"""What composed films draw over a picture: paths, blocks, impacts, and how large things are."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cache

import numpy as np

from ...camera.model import Camera, project
from ...terrain.surface import Surface
from ...vectors import Array, Mask
from ..simulated import path_opacity
from .blocks import Pose, block_pixels, draw_block, draw_shadow, sun_direction
from .canvas import Anchor, Box, Canvas, text_width
from .falls import UP, Fall
from .look import INK, MEASURED, PAPER, REGULAR, STRONG, Colour
from .sight import pixel_size, visible
from .solids import solid
from .texts import Texts

HIDDEN_OPACITY = 0.35
HALO_OPACITY = 0.55
EXPOSURE = 0.5
"""Part of a frame's time for which a film camera's shutter is open: 180°."""
BLUR_MOMENTS = 6
BLUR_FROM_PX = 1.5
"""A block that moves less during the exposure is drawn sharp."""
LEAST_SOLID_PX = 2.5
"""A simulated block of a smaller radius is a disc."""
NORTH = np.array([0.0, 1.0, 0.0])
PERSON_M = 1.75
PERSON = (
    # Half of the outline of somebody who stands: across and up, in heights.
    (0.0, 0.83), (0.03, 0.83), (0.035, 0.81), (0.10, 0.79), (0.125, 0.74), (0.135, 0.60), (0.135, 0.46), (0.10, 0.46),
    (0.095, 0.62), (0.085, 0.72), (0.085, 0.50), (0.09, 0.44), (0.085, 0.24), (0.075, 0.03), (0.10, 0.0), (0.03, 0.0),
    (0.03, 0.24), (0.012, 0.46), (0.0, 0.46),
)  # fmt: skip
HEAD_M, HEAD_RADIUS = 0.915, 0.068


@dataclass(frozen=True, eq=False)
class Scene:
    """What is shown of a site.

    Attributes
    ----------
    terrain : hides what is behind it, and takes shadows; None where there is none.
    falls : the blocks.
    kind : of solid, see `solids`.
    sun : (3,) unit vector towards it.
    seed : of angular blocks.
    body : the scanned block that stands for all.
    traced : where the paths lie in a picture.
    """

    terrain: Surface | None
    falls: Sequence[Fall]
    kind: str = "rock"
    sun: Array = field(default_factory=lambda: sun_direction(315.0, 50.0))
    seed: int = 0
    body: Surface | None = None
    traced: "Traced" = field(default_factory=lambda: Traced())

    def solid_of(self, fall: Fall) -> Surface:
        """What is drawn for a block."""
        return self.body if self.body is not None else _solid(self.kind, tuple(fall.diameters_m.tolist()), self.seed)


@cache
def _solid(kind: str, diameters_m: tuple[float, ...], seed: int) -> Surface:
    return solid(kind, np.array(diameters_m), seed)


class Traced:
    """Where the paths lie in the picture of the camera that was asked for last."""

    def __init__(self) -> None:
        self.camera: Camera | None = None
        self.paths: dict[int, tuple[Array, Mask]] = {}

    def of(self, scene: Scene, camera: Camera, fall: Fall) -> tuple[Array, Mask]:
        """Pixels (n, 2) of the rows of a fall, and which of them are seen."""
        if camera is not self.camera:
            self.camera, self.paths = camera, {}
        if id(fall) not in self.paths:
            places = fall.position
            self.paths[id(fall)] = project(camera, places), visible(scene.terrain, camera, places, fall.radius_m)
        return self.paths[id(fall)]


def draw_paths(canvas: Canvas, camera: Camera, scene: Scene, moment_s: float) -> None:
    """The way of each block up to a moment: white and strong if measured, in its model's colour and thin if not.

    What the terrain hides is dashed for measured blocks, and left out for others.
    """
    look = canvas.look
    others = [fall for fall in scene.falls if not fall.is_measured]
    for colour in dict.fromkeys(fall.colour for fall in others):
        shown = [_seen_path(canvas, camera, scene, fall, moment_s)[0] for fall in others if fall.colour == colour]
        many = len(shown) > 3
        canvas.lines(
            shown, colour, look.thin if many else look.line, max(path_opacity(len(shown)), 0.12) if many else 0.9
        )
    for fall in (fall for fall in scene.falls if fall.is_measured):
        seen, hidden = _seen_path(canvas, camera, scene, fall, moment_s)
        canvas.dashes(hidden, fall.colour, look.thin, 6.0 * look.line, HIDDEN_OPACITY)
        canvas.lines([seen], INK, look.line + 2 * look.thin, HALO_OPACITY)
        canvas.lines([seen], fall.colour, look.line)


def _seen_path(canvas: Canvas, camera: Camera, scene: Scene, fall: Fall, moment_s: float) -> tuple[Array, Array]:
    """Pixels (m, 2) of a path where it is seen, NaN elsewhere; and where it is hidden."""
    known = int(np.searchsorted(fall.time_s, moment_s, side="right"))
    if not known:
        return np.empty((0, 2)), np.empty((0, 2))
    where, seen = scene.traced.of(scene, camera, fall)
    where, seen = where[:known], seen[:known]
    chain, now = fall.chain[:known], fall.state(moment_s)
    if now is not None and fall.time_s[known - 1] < moment_s:
        where, seen = np.vstack([where, project(camera, now[0][None])]), np.append(seen, seen[-1])
        chain = np.append(chain, chain[-1])
    breaks = np.flatnonzero(np.diff(chain)) + 1
    where, seen = np.insert(where, breaks, np.nan, axis=0), np.insert(seen, breaks, False)
    joined = seen.copy()  # the first hidden point ends the line that is seen, so that no gap opens
    joined[1:] |= seen[:-1]
    hidden = np.where((~seen & np.isfinite(where[:, 0]))[:, None], where, np.nan)
    return np.where(joined[:, None], where, np.nan), hidden


def draw_blocks(
    canvas: Canvas, camera: Camera, scene: Scene, moment_s: float, frame_s: float = 0.0, *, measured: bool = True
) -> None:
    """The blocks at a moment, with their shadows; those that are small get a ring.

    Parameters
    ----------
    frame_s : seconds of the fall in a frame of the film: blocks are blurred as they move while the shutter is open.
    measured : whether measured blocks are drawn as solids; in a picture that shows the real one it has a ring alone.
    """
    look, now = canvas.look, []
    for fall in scene.falls:
        state = fall.state(moment_s)
        if state is not None:
            now.append((fall, state[0], scene.solid_of(fall)))
    if scene.terrain is not None:
        for fall, place, body in now:
            solid_is_drawn = measured or not fall.is_measured
            if solid_is_drawn and block_pixels(camera, place, fall.radius_m)[1] > LEAST_SOLID_PX:
                draw_shadow(canvas, camera, scene.terrain, body, Pose(place, fall.turn(moment_s)), scene.sun)
    for fall, place, body in sorted(now, key=lambda one: -float(np.linalg.norm(one[1] - camera.position))):
        centre, radius = block_pixels(camera, place, fall.radius_m)
        if not np.isfinite(centre).all():
            continue
        seen = bool(visible(scene.terrain, camera, place[None], fall.radius_m)[0])
        if radius <= LEAST_SOLID_PX and not fall.is_measured:
            if seen:
                canvas.disc(centre, max(radius, 1.2 * look.thin) + look.thin, INK, HALO_OPACITY)
                canvas.disc(centre, max(radius, 1.2 * look.thin), fall.colour)
            continue
        if measured or not fall.is_measured:
            draw_block(
                canvas, camera, scene.terrain, body, _poses(camera, fall, moment_s, frame_s), fall.colour, scene.sun
            )
        small = radius < look.least_mark
        if small or (fall.is_measured and not measured):
            size = max(radius + 1.5 * look.line, look.least_mark if fall.is_measured else 0.6 * look.least_mark)
            opacity = 1.0 if seen else HIDDEN_OPACITY
            canvas.ring(centre, size, INK, look.line + 2 * look.thin, HALO_OPACITY * opacity)
            canvas.ring(centre, size, fall.colour, look.line, opacity)


def _poses(camera: Camera, fall: Fall, moment_s: float, frame_s: float) -> list[Pose]:
    """Where a block is while the shutter is open, which is about the moment."""
    open_s = EXPOSURE * frame_s
    states = [(t, fall.state(t)) for t in moment_s + open_s * ((np.arange(BLUR_MOMENTS) + 0.5) / BLUR_MOMENTS - 0.5)]
    known = [(t, state[0]) for t, state in states if state is not None]
    if len(known) > 1:
        ends = project(camera, np.array([known[0][1], known[-1][1]]))
        if np.hypot(*(ends[1] - ends[0])) > BLUR_FROM_PX:
            return [Pose(place, fall.turn(t)) for t, place in known]
    state = fall.state(moment_s)
    return [] if state is None else [Pose(state[0], fall.turn(moment_s))]


def draw_impacts(canvas: Canvas, camera: Camera, scene: Scene, moment_s: float) -> None:
    """Where measured blocks have hit by a moment: a dot with a ring."""
    look = canvas.look
    for fall in scene.falls:
        if fall.hits is None or not len(fall.hits.time_s):
            continue
        past = fall.hits.time_s <= moment_s + 1e-6
        where, seen = (
            project(camera, fall.hits.position),
            visible(scene.terrain, camera, fall.hits.position, 2 * fall.radius_m),
        )
        for place in where[past & seen & np.isfinite(where[:, 0])]:
            canvas.disc(place, 2.2 * look.line, INK, 0.7)
            canvas.disc(place, 1.5 * look.line, fall.colour)


def draw_person(canvas: Canvas, camera: Camera, foot: Array, words: Texts) -> Box | None:
    """Somebody of 1.75 m who stands at a place (3,), with the height beside; None where too small to be read."""
    ends = project(camera, np.array([foot, foot + PERSON_M * UP]))
    if not np.isfinite(ends).all():
        return None
    up = ends[1] - ends[0]
    height = float(np.hypot(*up))
    if height < canvas.look.body:
        return None
    aside = np.array([-up[1], up[0]])
    half = np.array(PERSON)
    outline = np.concatenate([half, half[::-1] * [-1.0, 1.0]])
    body = ends[0] + outline[:, :1] * aside + outline[:, 1:] * up
    head = ends[0] + HEAD_M * up
    for grow, colour in ((1.5, INK), (0.0, PAPER)):
        if grow:
            canvas.lines([np.concatenate([body, body[:1]])], colour, round(2 * grow), 0.8)
            canvas.disc(head, HEAD_RADIUS * height + grow, colour, 0.8)
        else:
            canvas.area([body], colour)
            canvas.disc(head, HEAD_RADIUS * height, colour)
    look = canvas.look
    _haloed(canvas, words.say("person"), float(ends[0][0]) + 0.3 * height, float(ends[0][1]), look.small, "left")
    return canvas.written[-1].box


def north_on_picture(camera: Camera, place: Array, length_m: float = 1.0) -> Array | None:
    """(2,) unit vector of the picture that leads north from a place; None where it leads straight away."""
    ends = project(camera, np.array([place, place + length_m * NORTH]))
    step = ends[1] - ends[0]
    size = float(np.hypot(*step))
    return step / size if np.isfinite(size) and size > 1e-6 else None


@dataclass(frozen=True)
class Key:
    """A line of the legend: a colour and what has it."""

    colour: Colour
    text: str


def keys_of(scene: Scene, words: Texts) -> tuple[Key, ...]:
    """The legend: measured first, then each model that is shown, and that it is simulated."""
    made = [Key(MEASURED, words.say("measured"))] if any(fall.is_measured for fall in scene.falls) else []
    groups = dict.fromkeys((fall.group, fall.colour) for fall in scene.falls if fall.group)
    return (*made, *(Key(colour, words.say("simulated_by", model=group)) for group, colour in groups))


def draw_keys(canvas: Canvas, keys: Sequence[Key], left: float, bottom: float) -> Box:
    """The legend on a panel whose lower left corner is given."""
    look = canvas.look
    step, pad = round(1.45 * look.body), look.gap
    swatch = round(1.3 * look.body)
    width = swatch + 3 * pad + max((text_width(key.text, look.body) for key in keys), default=0)
    box = Box(left, bottom - len(keys) * step - pad, left + width + pad, bottom)
    canvas.panel(box)
    for i, key in enumerate(keys):
        middle = box.top + pad / 2 + (i + 0.5) * step
        canvas.lines([np.array([[left + pad, middle], [left + pad + swatch, middle]])], key.colour, look.line + 1)
        canvas.disc(np.array([left + pad + swatch / 2, middle]), 0.24 * look.body, key.colour)
        canvas.text(key.text, left + 2 * pad + swatch, middle + 0.35 * look.body, look.body)
    return box


def badge_width(canvas: Canvas, lines: Sequence[str], strong: bool = True) -> float:
    """How wide `draw_badge` makes its panel [px]."""
    size = canvas.look.body
    widths = [text_width(line, size, STRONG if strong and i == 0 else REGULAR) for i, line in enumerate(lines)]
    return max(widths) + 3 * canvas.look.gap


def draw_badge(canvas: Canvas, lines: Sequence[str], right: float, bottom: float, strong: bool = True) -> Box:
    """Lines on a panel whose lower right corner is given; the first one is strong."""
    look = canvas.look
    step, pad = round(1.4 * look.body), look.gap
    weights = [STRONG if strong and i == 0 else REGULAR for i in range(len(lines))]
    box = Box(right - badge_width(canvas, lines, strong), bottom - len(lines) * step - pad, right, bottom)
    canvas.panel(box)
    for i, (line, weight) in enumerate(zip(lines, weights, strict=True)):
        canvas.text(
            line, box.right - 1.5 * pad, box.top + pad / 2 + (i + 0.72) * step, look.body, weight=weight, anchor="right"
        )
    return box


def draw_heading(canvas: Canvas, heading: str, note: str = "", opacity: float = 1.0) -> Box:
    """The chapter's name at the upper left, a note below it."""
    look = canvas.look
    pad = look.gap
    left, top = look.margin, look.margin
    lines = [(heading, look.heading, STRONG), *([(note, look.body, 400)] if note else [])]
    width = max(text_width(text, size, weight) for text, size, weight in lines)
    height = sum(1.3 * size for _, size, _ in lines)
    box = Box(left, top, left + width + 3 * pad, top + height + pad)
    canvas.panel(box, opacity=0.62 * opacity)
    baseline = top + pad / 2
    for text, size, weight in lines:
        baseline += 1.3 * size
        canvas.text(text, left + 1.5 * pad, baseline - 0.32 * size, size, weight=weight, opacity=opacity)
    return box


def scale_length(camera: Camera, place: Array, wanted_px: float) -> tuple[float, float]:
    """A round length [m] of about so many pixels at a place, and how many it has there."""
    size = pixel_size(camera, place)
    if not np.isfinite(size) or size <= 0:
        return float("nan"), float("nan")
    raw = wanted_px / size
    power = 10.0 ** np.floor(np.log10(raw))
    length = float(next(step * power for step in (5.0, 2.0, 1.0) if step * power <= raw))
    return length, length * size


def draw_scale(canvas: Canvas, camera: Camera, place: Array, words: Texts) -> Box | None:
    """A bar of a round length as it is at a place, at the upper right; None where it cannot be said."""
    look = canvas.look
    length, size = scale_length(camera, place, 0.16 * canvas.look.width)
    if not np.isfinite(size):
        return None
    right, y = canvas.look.width - look.margin, look.margin + 2.6 * look.body
    ends = np.array([[right - size, y], [right, y]])
    ticks = [end + 0.3 * look.body * np.array([[0.0, -1.0], [0.0, 1.0]]) for end in ends]
    for colour, width in ((INK, look.line + 2 * look.thin + 1), (PAPER, look.line)):
        canvas.lines([ends, *ticks], colour, width, 0.9 if colour is PAPER else HALO_OPACITY)
    text = words.say("metres", length=words.number(length, 1))
    box = Box(right - size, y - 1.6 * look.body, right, y + look.body)
    _haloed(canvas, text, right, y - 0.5 * look.body, look.small, "right")
    return box


def draw_north(canvas: Canvas, camera: Camera, place: Array, words: Texts) -> None:
    """An arrow that leads north, at the upper right."""
    way = north_on_picture(camera, place)
    if way is None:
        return
    look = canvas.look
    size = 1.5 * look.body
    centre = np.array([canvas.look.width - look.margin - size, look.margin + 4.6 * look.body + size])
    aside = np.array([-way[1], way[0]])
    tip = centre + 0.8 * size * way
    head = np.array(
        [
            tip,
            tip - 0.55 * size * way + 0.28 * size * aside,
            tip - 0.4 * size * way,
            tip - 0.55 * size * way - 0.28 * size * aside,
        ]
    )
    tail = np.array([tip - 0.4 * size * way, centre - 0.8 * size * way])
    for colour, grow, opacity in ((INK, 2 * look.thin + 1, HALO_OPACITY), (PAPER, 0, 0.95)):
        canvas.lines([tail], colour, look.line + grow, opacity)
        if grow:
            canvas.lines([np.vstack([head, head[:1]])], colour, look.line + grow, opacity)
        else:
            canvas.area([head], colour, opacity)
    at = tip + 0.6 * look.body * way
    _haloed(canvas, words.say("north"), float(at[0]), float(at[1]) + 0.35 * look.small, look.small, "middle")


def _haloed(canvas: Canvas, text: str, x: float, baseline: float, size: int, anchor: Anchor) -> None:
    """Type that is read on any ground without a panel."""
    before = len(canvas.written)
    for dx, dy in ((-1, 0), (1, 0), (0, -1), (0, 1), (1, 1), (-1, -1)):
        canvas.text(
            text,
            x + dx * canvas.look.thin,
            baseline + dy * canvas.look.thin,
            size,
            INK,
            weight=STRONG,
            anchor=anchor,
            opacity=0.45,
        )
    del canvas.written[before:]
    canvas.text(text, x, baseline, size, PAPER, weight=STRONG, anchor=anchor)


DUST: Colour = (0.80, 0.74, 0.65)
DUST_S, DUST_PUFFS = 0.9, 7


def draw_dust(canvas: Canvas, camera: Camera, scene: Scene, moment_s: float) -> None:
    """Dust that hard impacts raise: drawn by a rule, not measured. It grows and thins out within a second."""
    for fall in scene.falls:
        if fall.hits is None:
            continue
        since = moment_s - fall.hits.time_s
        for i in np.flatnonzero((since >= 0) & (since < DUST_S)).tolist():
            place = fall.hits.position[i]
            lost = fall.hits.energy1_j[i] - np.nan_to_num(fall.hits.energy2_j[i])
            if not (
                np.isfinite(lost) and lost > 0 and visible(scene.terrain, camera, place[None], 2 * fall.radius_m)[0]
            ):
                continue
            random = np.random.default_rng([scene.seed, i])
            age = float(since[i]) / DUST_S
            size_m = fall.radius_m * (1.2 + 4.5 * age**0.5) * min(max((lost / 500.0) ** 0.25, 0.6), 2.0)
            for way in random.normal(size=(DUST_PUFFS, 3)) * [1, 1, 0.4] + [0, 0, 0.5]:
                at = project(camera, (place + 0.45 * size_m * (0.3 + age) * way)[None])[0]
                px = size_m * pixel_size(camera, place)
                if np.isfinite(at).all() and np.isfinite(px):
                    _puff(canvas, at, px, 0.30 * (1 - age) ** 1.5)


def _puff(canvas: Canvas, at: Array, radius: float, opacity: float) -> None:
    """A soft disc."""
    height, width = canvas.picture.shape[:2]
    low = np.clip(np.floor(at - radius), 0, (width, height)).astype(int)
    high = np.clip(np.ceil(at + radius), 0, (width, height)).astype(int)
    if (high <= low).any():
        return
    x, y = np.arange(low[0], high[0]) + 0.5 - at[0], np.arange(low[1], high[1]) + 0.5 - at[1]
    away = (x[None] ** 2 + y[:, None] ** 2) / max(radius, 1.0) ** 2
    mask = (255 * np.clip(1 - away, 0, 1) ** 2).astype(np.uint8)
    canvas.shade(mask, int(low[0]), int(low[1]), DUST, opacity)
