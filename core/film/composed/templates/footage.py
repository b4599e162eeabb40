# SPDX-License-Identifier: GPL-3.0-or-later
"""Films over the footage: the overlay, beside the model, and upright for phones."""

import numpy as np

from ....camera.model import Camera
from ..canvas import Canvas
from ..falls import Fall
from ..film_clock import FilmClock
from ..material import Material
from ..shots import ComposedFilm, Shot
from ..stage import Filmed, Plate, Stage, filling_footage, following_footage, inset_of, slope_camera, whole_footage
from .cards import draw_hit_card
from .timing import shown_clock

STANDS = 1e-6
GAP_PX = 0.004
"""Between two pictures in one, in parts of the width."""
UPRIGHT_PART = 0.56
"""Part of an upright film's height that the footage takes."""


def overlay(material: Material) -> ComposedFilm:
    """The footage with the reconstructed path over it, as the lens bends it."""
    clock = shown_clock(material, material.falls[0], material.span_s, 1.0)
    stage = Stage(
        material, material.scene((*material.falls, *asked_models(material))), solids=False,
        heading=material.title, note=material.words.say("overlay"),
        inset=inset_of(material, material.size, material.falls),
    )  # fmt: skip
    return _film(material, [path_shot(material, whole_footage(material), stage, clock)])


def side_by_side(material: Material) -> ComposedFilm:
    """Footage and model beside each other, seen by the same camera."""
    clock, words = shown_clock(material, material.falls[0], material.span_s, 1.0), material.words
    width, height = material.size
    gap = max(round(GAP_PX * width), 2)
    sizes = (width - gap) // 2, height
    backdrop = filling_footage(material, sizes)
    models = asked_models(material)
    left = Stage(
        material, material.scene(material.falls), solids=False, heading=words.say("footage"),
        note=words.say("measured"), paths=False, impacts=False, scale=False, numbers=False,
    )  # fmt: skip
    right = Stage(
        material, material.scene((*material.falls, *models)), solids=True, heading=words.say("reconstruction"),
        note=words.say("same_camera"),
    )  # fmt: skip
    plate = _SameCamera(material, backdrop)

    def draw(film_s: float) -> Canvas:
        moment, rate = backdrop.moment(float(clock.fall_at(film_s)[0])), clock.rate_at(film_s)
        both = Canvas(np.zeros((height, width, 3), np.uint8))
        both.paste(left.draw(backdrop.at(moment), moment, rate), 0, 0)
        both.paste(right.draw(plate.at(moment), moment, rate), width - sizes[0], 0)
        return both

    return _film(material, [Shot("side_by_side", clock.duration_s, draw)])


def vertical(material: Material) -> ComposedFilm:
    """Upright, for phones: the footage that follows the block above, the site with its path below."""
    clock, words = shown_clock(material, material.falls[0], material.span_s, 0.5), material.words
    width, height = sorted(material.size)
    gap = max(round(GAP_PX * width), 2)
    upper = width, round(UPRIGHT_PART * height)
    lower = width, height - upper[1] - gap
    backdrop = following_footage(material, upper)
    video = Stage(
        material, material.scene(material.falls), solids=False, heading=material.title, note=words.say("footage"),
        scale=False, numbers=False,
    )  # fmt: skip
    site = Stage(
        material,
        material.scene((*material.falls, *asked_models(material))),
        solids=True,
        heading=words.say("reconstruction"),
    )
    plate = Plate(material.ground, slope_camera(material, material.falls, lower))

    def draw(film_s: float) -> Canvas:
        moment, rate = backdrop.moment(float(clock.fall_at(film_s)[0])), clock.rate_at(film_s)
        both = Canvas(np.zeros((height, width, 3), np.uint8))
        both.paste(video.draw(backdrop.at(moment), moment, rate), 0, 0)
        both.paste(site.draw(plate.at(moment), moment, rate), 0, height - lower[1])
        return both

    film = _film(material, [Shot("vertical", clock.duration_s, draw)])
    return ComposedFilm(width, height, film.fps, film.shots)


def path_shot(material: Material, backdrop: Filmed, stage: Stage, clock: FilmClock, name: str = "overlay") -> Shot:
    """The footage on a clock, with what a stage draws, and the numbers of an impact wherever the clock stands."""
    hits = [(fall, row) for fall in material.falls if fall.hits is not None for row in range(len(fall.hits.time_s))]

    def draw(film_s: float) -> Canvas:
        asked, rate = float(clock.fall_at(film_s)[0]), clock.rate_at(film_s)
        moment = backdrop.moment(asked)
        seen = backdrop.at(moment)
        canvas = stage.draw(seen, moment, rate)
        if rate == 0.0:
            for fall, row in hits:
                assert fall.hits is not None
                if abs(float(fall.hits.time_s[row]) - asked) < STANDS:
                    draw_hit_card((canvas, seen[1]), material, fall, row)
        return canvas

    return Shot(name, clock.duration_s, draw)


class _SameCamera:
    """The terrain as the camera of the footage sees it; drawn once where that stands still."""

    def __init__(self, material: Material, backdrop: Filmed) -> None:
        self.material, self.backdrop = material, backdrop
        self.plate: Plate | None = None

    def at(self, moment_s: float) -> tuple[Canvas, Camera]:
        footage = self.backdrop.footage
        if self.plate is None or not footage.path.is_fixed:
            self.plate = Plate(self.material.ground, self.backdrop.window(moment_s).camera(footage.camera(moment_s)))
        return self.plate.at(moment_s)


def asked_models(material: Material) -> tuple[Fall, ...]:
    """The blocks of the models that were asked for, from each impact to their landing."""
    if not material.request.models:
        return ()
    return tuple(
        fall
        for measured in material.falls
        if measured.hits is not None
        for fall in material.predicted(measured.name, measured.hits.number.tolist())
    )


def _film(material: Material, shots: list[Shot]) -> ComposedFilm:
    return ComposedFilm(*material.size, material.request.fps, shots)
