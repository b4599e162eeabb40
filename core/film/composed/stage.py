# SPDX-License-Identifier: GPL-3.0-or-later
"""Where a shot is seen from, and what stands in every shot."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from ...analysis.motion_graphs import MotionCourse, motion_courses
from ...camera.model import Camera, look_at, project
from ...terrain.raycast import any_hit, heights_above
from ...vectors import Array, cross, norm, unit
from ..framing import Margins, View, downhill_direction, place_camera
from ..graphs import FILMED, FilmGraphs, impact_graphs, motion_graphs
from .canvas import Box, Canvas, Picture
from .falls import UP, Fall
from .filmed import Footage, warped
from .ground import Ground, ground_picture
from .inset import Inset
from .look import MEASURED
from .material import Material
from .scenery import (
    Scene,
    badge_width,
    draw_badge,
    draw_blocks,
    draw_dust,
    draw_heading,
    draw_impacts,
    draw_keys,
    draw_north,
    draw_paths,
    draw_person,
    draw_scale,
    keys_of,
)
from .sight import Window, centred, whole

Seen = tuple[Canvas, Camera]
WATCHED_POINTS = 160
LIFT_M = 0.5
BESIDE_LEGEND = Margins(0.07, 0.07, 0.16, 0.16)
SMOOTH_S = 0.5


@dataclass(frozen=True, eq=False)
class Filmed:
    """The footage as a backdrop.

    Attributes
    ----------
    footage : the video.
    window : which part of a frame is shown, at a moment [s of the fall].
    """

    footage: Footage
    window: Callable[[float], Window]
    _fixed: dict[Window, Camera] = field(default_factory=dict)

    def at(self, moment_s: float) -> Seen:
        """The frame on display, and its camera for the pixels of the film."""
        window, frame = self.window(moment_s), self.footage.frame(moment_s)
        picture = warped(self.footage.picture(frame), window.matrix, (window.width, window.height))
        if self.footage.path.is_fixed:
            if window not in self._fixed:
                self._fixed.clear()
                self._fixed[window] = window.camera(self.footage.camera(moment_s))
            return Canvas(picture), self._fixed[window]
        return Canvas(picture), window.camera(self.footage.camera(self.footage.moment(frame)))

    def moment(self, moment_s: float) -> float:
        """When the frame that is shown was taken [s of the fall]."""
        return self.footage.moment(self.footage.frame(moment_s))


@dataclass(frozen=True, eq=False)
class Plate:
    """The terrain from a camera that stands still."""

    ground: Ground
    camera: Camera

    @cached_property
    def picture(self) -> Picture:
        """Drawn once."""
        return ground_picture(self.ground, self.camera)[0]

    def at(self, moment_s: float) -> Seen:
        """A copy to draw on."""
        return Canvas(self.picture.copy()), self.camera


@dataclass(frozen=True, eq=False)
class Moving:
    """The terrain from a camera that moves with the time of the film."""

    ground: Ground
    camera: Callable[[float], Camera]

    def at(self, film_s: float) -> Seen:
        """Drawn anew."""
        camera = self.camera(film_s)
        return Canvas(ground_picture(self.ground, camera)[0]), camera


def whole_footage(material: Material, size: tuple[int, int] | None = None) -> Filmed:
    """The footage in the middle of the picture, all of it."""
    window = whole(material.filmed.size, size or material.size)
    return Filmed(material.filmed, lambda _: window)


def filling_footage(material: Material, size: tuple[int, int]) -> Filmed:
    """The part of the footage about the way of the blocks that fills a picture."""
    footage = material.filmed
    track = block_track(material)
    scale = max(size[i] / footage.size[i] for i in range(2))
    middle = (track[1].min(axis=0) + track[1].max(axis=0)) / 2
    window = centred(footage.size, size, scale, middle)
    return Filmed(footage, lambda _: window)


def following_footage(material: Material, size: tuple[int, int], closer: float = 1.0) -> Filmed:
    """The part of the footage that follows the blocks, smoothly."""
    footage = material.filmed
    times, track = block_track(material)
    scale = closer * max(size[i] / footage.size[i] for i in range(2))
    weight = np.exp(-0.5 * ((times[:, None] - times[None]) / SMOOTH_S) ** 2)
    smooth = weight @ track / weight.sum(axis=1, keepdims=True)

    def window(moment_s: float) -> Window:
        on = np.array([np.interp(moment_s, times, smooth[:, i]) for i in range(2)])
        return centred(footage.size, size, scale, on)

    return Filmed(footage, window)


def block_track(material: Material) -> tuple[Array, Array]:
    """Moments (n,) and pixels (n, 2) of the first block in the footage, where the lens shows it."""
    footage, fall = material.filmed, material.falls[0]
    begin, end = material.span_s
    times = np.arange(begin, end + 1e-9, 1 / 15)
    states = [fall.state(float(np.clip(t, fall.time_s[0], fall.time_s[-1]))) for t in times]
    places = np.array([np.full(3, np.nan) if state is None else state[0] for state in states])
    pixels = np.array(
        [project(footage.camera(float(t)), place[None])[0] for t, place in zip(times, places, strict=True)]
    )
    known = np.isfinite(pixels).all(axis=1)
    if not known.any():
        return np.array([begin, end]), np.tile(np.array(footage.size) / 2, (2, 1))
    where: Array = np.column_stack([np.interp(times, times[known], pixels[known, i]) for i in range(2)])
    return np.asarray(times, dtype=np.float64), where


def slope_camera(
    material: Material, falls: Sequence[Fall], size: tuple[int, int], margins: Margins = BESIDE_LEGEND
) -> Camera:
    """A camera opposite the slope that shows all of some blocks' ways."""
    points = np.vstack([fall.position[:: max(len(fall.position) // 200, 1)] for fall in falls])
    low, high = np.quantile(points, (0.01, 0.99), axis=0)
    measured = np.vstack([fall.position for fall in falls if fall.is_measured] or [points])
    low, high = np.minimum(low, measured.min(axis=0)), np.maximum(high, measured.max(axis=0))
    points = points[((points >= low) & (points <= high)).all(axis=1)]
    starts, ends = (np.array([fall.position[i] for fall in falls]) for i in (0, -1))
    surface = material.terrain
    watched = points[:: max(len(points) // WATCHED_POINTS, 1)] + np.array([0.0, 0.0, LIFT_M])

    def seen(position: Array) -> Array:
        away = position - watched
        return (~any_hit(surface, watched, away, norm(away))).astype(np.float64)

    return camera_of(place_camera(points, downhill_direction(starts, ends), size[0] / size[1], seen, margins), size)


def camera_of(view: View, size: tuple[int, int]) -> Camera:
    """The camera of a view."""
    target = view.position + view.forward
    return look_at(*size, view.position, target, fov_deg=float(np.degrees(view.fov)), up=tuple(view.up))


@dataclass(frozen=True, eq=False)
class Stage:
    """What is drawn over a backdrop in every shot of a kind.

    Attributes
    ----------
    material : of the film.
    scene : the blocks.
    solids : whether the measured blocks are drawn as solids; a picture that shows the real ones needs none.
    heading, note : at the upper left.
    paths, impacts : whether they are drawn.
    scale : whether the size of things is said: a person or a bar, and north.
    inset : graphs; None without.
    """

    material: Material
    scene: Scene
    solids: bool
    heading: str = ""
    note: str = ""
    paths: bool = True
    impacts: bool = True
    scale: bool = True
    numbers: bool = True
    inset: Inset | None = None

    def draw(self, seen: Seen, moment_s: float, rate: float | None) -> Canvas:
        """Everything at a moment of the fall [s].

        Parameters
        ----------
        rate : seconds of the fall in a second of film, which is said; None where no time passes.
        """
        canvas, camera = seen
        look, words, size = canvas.look, self.material.words, (seen[0].look.width, seen[0].look.height)
        if self.paths:
            draw_paths(canvas, camera, self.scene, moment_s)
        if self.impacts:
            draw_impacts(canvas, camera, self.scene, moment_s)
        draw_blocks(canvas, camera, self.scene, moment_s, self.material.frame_s(rate or 0.0), measured=self.solids)
        if self.material.request.dust:
            draw_dust(canvas, camera, self.scene, moment_s)
        if self.scale and self.inset is None:
            draw_north(canvas, camera, self.middle, words)
            draw_scale(canvas, camera, self.middle, words)
        if self.heading:
            draw_heading(canvas, self.heading, self.note)
        legend = draw_keys(canvas, keys_of(self.scene, words), look.margin, size[1] - look.margin)
        if rate is not None:
            lines = [words.pace(rate), *(self.number_lines(moment_s) if self.numbers and self.inset is None else [])]
            room = size[0] - look.margin - legend.right - look.gap
            wide = badge_width(canvas, lines) > room
            bottom = legend.top - look.gap if wide else size[1] - look.margin
            draw_badge(canvas, lines, size[0] - look.margin, bottom)
        if self.scale:
            self._draw_person(canvas, camera)
        if self.inset is not None:
            self.inset.draw(canvas, moment_s)
        return canvas

    def number_lines(self, moment_s: float) -> list[str]:
        """Speed, height and energy of the measured block that is the fastest."""
        words = self.material.words
        moving = [(fall, fall.state(moment_s)) for fall in self.scene.falls if fall.is_measured]
        known = [(fall, state) for fall, state in moving if state is not None]
        if not known:
            return []
        fall, (place, velocity) = max(known, key=lambda one: float(norm(one[1][1])))
        speed = float(norm(velocity))
        about = "≈ " if self.material.is_unrefined else ""
        lines = [f"{words.say('speed')} {about}{words.number(speed, 2)} m/s"]
        if speed > 0:
            lines.append(f"{words.say('energy')} {about}{words.energy(0.5 * fall.mass_kg * speed**2)}")
        if self.scene.terrain is not None:
            height = float(heights_above(self.scene.terrain, place[None])[0]) - fall.radius_m
            if np.isfinite(height) and height > HEIGHT_SAID_M:
                lines.append(f"{words.say('height')} {about}{words.number(height, 2)} m")
        return lines

    def draw_size(self, canvas: Canvas, camera: Camera) -> None:
        """How large things are, and where north is."""
        draw_north(canvas, camera, self.middle, self.material.words)
        draw_scale(canvas, camera, self.middle, self.material.words)
        self._draw_person(canvas, camera)

    @cached_property
    def middle(self) -> Array:
        """(3,) the place whose scale is said."""
        fall = next((fall for fall in self.scene.falls if fall.is_measured), self.scene.falls[0])
        return fall.position[len(fall.position) // 2]

    def _draw_person(self, canvas: Canvas, camera: Camera) -> bool:
        surface = self.scene.terrain
        if surface is None:
            return False
        fall = next((fall for fall in self.scene.falls if fall.is_measured), None)
        if fall is None or fall.hits is None or not len(fall.hits.time_s):
            return False
        aside = unit(cross(camera.position - self.middle, UP))
        foot = fall.hits.position[len(fall.hits.position) // 2] + PERSON_ASIDE_M * aside
        drop = float(heights_above(surface, (foot + FROM_ABOVE_M * UP)[None])[0])
        if not np.isfinite(drop):
            return False
        where = project(camera, np.array([foot + (FROM_ABOVE_M - drop) * UP]))[0]
        around = Box(where[0], where[1], where[0], where[1]).grown(2 * canvas.look.body)
        look = canvas.look
        inside = (
            around.left > 0
            and around.top > 0
            and around.right + 2 * look.body < look.width
            and around.bottom < look.height
        )
        if not inside or any(one.box.meets(around) for one in canvas.written):
            return False
        return draw_person(canvas, camera, foot + (FROM_ABOVE_M - drop) * UP, self.material.words) is not None


HEIGHT_SAID_M = 0.05
PERSON_ASIDE_M, FROM_ABOVE_M = 1.6, 5.0


def inset_of(material: Material, size: tuple[int, int], falls: Sequence[Fall]) -> Inset | None:
    """The graphs that are asked for, at the right of a picture; None where none are."""
    kind = material.request.graphs
    if not kind:
        return None
    result = material.result
    offsets = dict.fromkeys(result.picks.trajectory.tolist(), 0.0)
    names = {fall.name for fall in falls}
    if kind == "impacts":
        from ...analysis.comparison import compare

        row = np.flatnonzero(np.isin(result.impacts.trajectory, list(names)))
        models = material.request.models
        own = {name: values for name, values in material.request.parameters.items() if name in models}
        predictions = compare(result.impacts, models, own) if models else None
        made: FilmGraphs = impact_graphs(
            result.impacts, offsets, size, predictions, row=row if row.size < len(result.impacts) else None
        )
    else:
        courses = [c for c in motion_courses(result, material.surface, quantities=FILMED) if c.trajectory in names]
        made = _since(material.span_s[0], courses, offsets, size)
    return Inset(made, size[1], words=material.words)


def _since(begin_s: float, courses: Sequence[MotionCourse], names: Iterable[str], size: tuple[int, int]) -> FilmGraphs:
    """Graphs whose axis counts from the film's beginning, while what is drawn appears at moments of the fall."""
    made = motion_graphs(courses, dict.fromkeys(names, begin_s), size, MEASURED)
    graphs = tuple(
        replace(graph, strokes=tuple(replace(strokes, since_s=strokes.since_s + begin_s) for strokes in graph.strokes))
        for graph in made.graphs
    )
    cursor = None if made.cursor_s is None else (made.cursor_s[0] + begin_s, made.cursor_s[1] + begin_s)
    return replace(made, graphs=graphs, cursor_s=cursor)
