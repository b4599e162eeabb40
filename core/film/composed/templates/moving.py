# SPDX-License-Identifier: GPL-3.0-or-later
"""Films of a camera that moves over the terrain: along with the block, and around the site."""

import numpy as np

from ....camera.model import Camera, look_at
from ....terrain.raycast import heights_above
from ....vectors import Array, unit
from ..canvas import Canvas
from ..falls import Fall
from ..material import Material
from ..shots import ComposedFilm, Shot
from ..stage import Moving, Stage, slope_camera
from .timing import nice_rate, shown_clock

TURN_S, TURN_DEG = 14.0, 360.0
FLIGHT_S = 14.0
LEAST_ABOVE_M = 1.5
FOLLOW_S = 0.9
"""Over which the way of the block is smoothed for the camera."""
BEHIND_M, ABOVE_M = 11.0, 5.5
FOV_DEG = 55.0


def turntable(material: Material) -> ComposedFilm:
    """Once around the site, with all that was measured."""
    falls, words = material.together, material.words
    end = max(float(fall.time_s[-1]) for fall in falls)
    first = slope_camera(material, falls, material.size)
    middle = _middle(falls)
    away = first.position - middle
    stage = Stage(material, material.scene(falls), solids=True, heading=material.title, note=words.say("turntable"), numbers=False)

    def camera(film_s: float) -> Camera:
        angle = np.radians(TURN_DEG) * (film_s / TURN_S)
        c, s = np.cos(angle), np.sin(angle)
        turned = np.array([c * away[0] - s * away[1], s * away[0] + c * away[1], abs(away[2])])
        place = _above(material, middle + turned)
        return look_at(*material.size, place, middle, focal_px=first.fx)

    moving = Moving(material.ground, camera)
    return _film(material, Shot("turntable", TURN_S, lambda film_s: stage.draw(moving.at(film_s), end, 1.0)))


def fly_along(material: Material) -> ComposedFilm:
    """Behind the block, down the slope."""
    fall = max(material.together, key=lambda one: float(one.time_s[-1]))
    duration = float(fall.time_s[-1])
    clock = shown_clock(material, fall, (0.0, duration), nice_rate(duration, FLIGHT_S))
    times = np.arange(-2.0, duration + 2.0, 1 / 20)
    way = np.array([_place(fall, float(np.clip(t, 0.0, duration))) for t in times])
    weight = np.exp(-0.5 * ((times[:, None] - times[None]) / FOLLOW_S) ** 2)
    weight /= weight.sum(axis=1, keepdims=True)
    smooth = weight @ way
    heading = weight @ unit(np.gradient(smooth, axis=0) + 1e-9)
    reach = max(BEHIND_M, 22 * fall.radius_m)
    behind = smooth - reach * unit(heading * [1, 1, 0.35]) + [0, 0, max(ABOVE_M, 11 * fall.radius_m)]
    behind = weight @ np.array([_above(material, place) for place in behind])
    stage = Stage(material, material.scene(material.together), solids=True, heading=material.title, note=material.words.say("fly_along"))

    def camera(film_s: float) -> Camera:
        t = float(clock.fall_at(film_s)[0])
        place, target = (np.array([np.interp(t, times, of[:, i]) for i in range(3)]) for of in (behind, smooth))
        return look_at(*material.size, place, target, fov_deg=FOV_DEG)

    moving = Moving(material.ground, camera)

    def draw(film_s: float) -> Canvas:
        return stage.draw(moving.at(film_s), float(clock.fall_at(film_s)[0]), clock.rate_at(film_s))

    return _film(material, Shot("fly_along", clock.duration_s + 1.0, draw))


def _film(material: Material, shot: Shot) -> ComposedFilm:
    return ComposedFilm(*material.size, material.request.fps, [shot])


def _middle(falls: tuple[Fall, ...]) -> Array:
    points = np.vstack([fall.position for fall in falls])
    middle: Array = (points.min(axis=0) + points.max(axis=0)) / 2
    return middle


def _place(fall: Fall, moment_s: float) -> Array:
    """Where a block is; in a gap, where it was last."""
    state = fall.state(moment_s)
    return fall.position[max(int(np.searchsorted(fall.time_s, moment_s, side="right")) - 1, 0)] if state is None else state[0]


def _above(material: Material, place: Array) -> Array:
    """A place, lifted until the terrain is well below."""
    high = place + [0.0, 0.0, 500.0]
    height = float(heights_above(material.terrain, high[None])[0]) - 500.0
    return place + [0.0, 0.0, max(LEAST_ABOVE_M - height, 0.0)] if np.isfinite(height) else place

