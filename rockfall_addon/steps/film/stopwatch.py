# SPDX-License-Identifier: GPL-3.0-or-later
"""How long a frame of the film takes on this machine: measured, and known as long as Blender is open."""

from time import perf_counter

import bpy

from ....core.film.wording import duration_words, estimate
from ....core.progress import Progress

_taken: dict[tuple, float] = {}


def started() -> float:
    """A moment to measure from [s]."""
    return perf_counter()


def measured(scene: bpy.types.Scene, start: float) -> None:
    """A frame of a scene has taken the time since then."""
    _taken[_key(scene)] = perf_counter() - start


def expected(scene: bpy.types.Scene) -> str:
    """How long the film will take, in words; empty before a frame of it was measured."""
    frame_s = _taken.get(_key(scene))
    return "" if frame_s is None else estimate(frame_s, scene.frame_end - scene.frame_start + 1)


def with_time_left(progress: Progress) -> Progress:
    """Progress that says how long each part of the work will last, once some of it is done."""
    begun: dict[str, tuple[float, int]] = {}

    def told(text: str, done: int = 0, total: int = 0) -> None:
        now = perf_counter()
        since, first = begun.setdefault(text, (now, done))
        if first < done < total:
            text += f", {duration_words((now - since) / (done - first) * (total - done))} left"
        progress(text, done, total)

    return told


def _key(scene: bpy.types.Scene) -> tuple:
    """What a frame's time depends on."""
    render = scene.render
    return scene.session_uid, render.engine, render.resolution_x, render.resolution_y, scene.rockfall_film.graphs
