# SPDX-License-Identifier: GPL-3.0-or-later
"""The film that the panel asks for, as a render preset of a project."""

from dataclasses import replace

import bpy

from ...core.exchange.project import ENGINES, RenderPreset
from ...core.film.presets import BUILT_IN
from .footage import timing
from .storage import store

NAME = "film"
"""Of the preset that an exported project has for it."""


def preset_of(scene: bpy.types.Scene) -> RenderPreset:
    """The film that is wanted, at the scene's frame rate and with its delay between blocks."""
    wanted, settings = scene.rockfall_film, scene.rockfall
    return replace(
        next(preset for preset in BUILT_IN if preset.name == wanted.size),
        fps=timing.frame_rate(scene),
        engine=wanted.engine,
        stagger_s=settings.stagger_s if settings.playback == "TOGETHER" else None,
        time_scale=store.double(wanted.time_scale),
    )


def take(scene: bpy.types.Scene, presets: tuple[RenderPreset, ...]) -> tuple[RenderPreset, ...]:
    """Ask for the film of a project's presets, as far as the panel can; returns those that are left."""
    film = next((preset for preset in presets if preset.name == NAME), None)
    size = None if film is None else next((one for one in BUILT_IN if one.width == film.width), None)
    if film is None or size is None or size.height != film.height or film.camera is not None or film.extra:
        return presets
    scene.rockfall_film.size = size.name
    scene.rockfall_film.engine = film.engine if film.engine in ENGINES else "auto"
    scene.rockfall_film.time_scale = film.time_scale
    scene.rockfall.playback = "REAL" if film.stagger_s is None else "TOGETHER"
    if film.stagger_s is not None:
        scene.rockfall.stagger_s = film.stagger_s
    return tuple(preset for preset in presets if preset is not film)
