# SPDX-License-Identifier: GPL-3.0-or-later
"""Films of a camera that moves over the terrain: along with the block, and around the site."""

import numpy as np

from ....camera.model import Camera, look_at
from ....terrain.raycast import any_hit, heights_above
from ....vectors import Array, norm, unit
from ..canvas import Canvas
from ..falls import UP, Fall
from ..material import Material
from ..shots import ComposedFilm, Shot
from ..stage import Moving, Stage, slope_camera
from .timing import nice_rate, shown_clock

TURN_S, TURN_DEG = 14.0, 360.0
FLIGHT_S = 14.0
ELEVATIONS_DEG = (22.0, 28.0, 34.0, 40.0, 46.0, 52.0, 58.0, 64.0)
WATCHED, SIDES, NEARLY_ALL = 60, 24, 0.9
LEAST_ABOVE_M, FROM_ABOVE_M = 1.5, 500.0
FOLLOW_S = 0.9
"""Over which the way of the block is smoothed for the camera."""
BEHIND_M, ABOVE_M = 11.0, 5.5
FLATTER = np.array([1.0, 1.0, 0.35])
FOV_DEG = 55.0


def turntable(material: Material) -> ComposedFilm:
    """Once around the site, with all that was measured."""
    falls, words = material.together, material.words
    end = max(float(fall.time_s[-1]) for fall in falls)
    first = slope_camera(material, falls, material.size)
    middle = _middle(falls)
    reach = float(norm(first.position - middle))
    start = float(np.arctan2(*(first.position - middle)[1::-1]))
    lift = _clear_elevation(material, falls, middle, reach)
    stage = Stage(
        material, material.scene(falls), solids=True, heading=material.title, note=words.say("turntable"), numbers=False
    )

    def camera(film_s: float) -> Camera:
        place = _above(material, _around(middle, reach, start + np.radians(TURN_DEG) * (film_s / TURN_S), lift))
        return look_at(*material.size, place, middle, focal_px=first.fx)

    moving = Moving(material.ground, camera)
    return _film(material, Shot("turntable", TURN_S, lambda film_s: stage.draw(moving.at(film_s), end, None)))


def _around(middle: Array, reach: float, angle: float, elevation_deg: float) -> Array:
    up = np.radians(elevation_deg)
    return middle + reach * np.array([np.cos(angle) * np.cos(up), np.sin(angle) * np.cos(up), np.sin(up)])


def _clear_elevation(material: Material, falls: tuple[Fall, ...], middle: Array, reach: float) -> float:
    """The lowest elevation from which nearly all of the ways is seen from nearly all sides [°]."""
    points = np.vstack([fall.position for fall in falls])
    points = points[:: max(len(points) // WATCHED, 1)] + 0.5 * UP
    for elevation in ELEVATIONS_DEG:
        seen = []
        for angle in np.linspace(0, 2 * np.pi, SIDES, endpoint=False):
            away = _around(middle, reach, float(angle), elevation) - points
            seen.append(float((~any_hit(material.terrain, points, away, norm(away))).mean()))
        if np.quantile(seen, 0.15) > NEARLY_ALL:
            return elevation
    return ELEVATIONS_DEG[-1]


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
    behind = smooth - reach * unit(heading * FLATTER) + max(ABOVE_M, 11 * fall.radius_m) * UP
    behind = weight @ np.array([_above(material, place) for place in behind])
    stage = Stage(
        material,
        material.scene(material.together),
        solids=True,
        heading=material.title,
        note=material.words.say("fly_along"),
    )

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
    return (
        fall.position[max(int(np.searchsorted(fall.time_s, moment_s, side="right")) - 1, 0)]
        if state is None
        else state[0]
    )


def _above(material: Material, place: Array) -> Array:
    """A place, lifted until the terrain is well below."""
    high = place + FROM_ABOVE_M * UP
    height = float(heights_above(material.terrain, high[None])[0]) - FROM_ABOVE_M
    return place + max(LEAST_ABOVE_M - height, 0.0) * UP if np.isfinite(height) else place
