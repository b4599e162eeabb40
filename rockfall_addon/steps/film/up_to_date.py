# SPDX-License-Identifier: GPL-3.0-or-later
"""Whether a scene is set up for the film that is wanted, of what is shown now."""

import hashlib
import json

import bpy

from ...scene.storage import store
from . import remembered

SETTINGS = (
    "rockfall_film.size", "rockfall_film.engine", "rockfall_film.time_scale", "rockfall_film.graphs",
    "rockfall.playback", "rockfall.stagger_s", "rockfall_simulation.show_blocks", "rockfall_simulation.show_paths",
    "render.fps", "render.fps_base",
)  # fmt: skip
SHOWN = (store.SHOWN, store.SHOWN_MODELS, store.MODEL_PARAMETERS, store.SIMULATION, store.SITE)


def keep(scene: bpy.types.Scene) -> None:
    """The scene has just been set up."""
    scene[store.FILM_OF] = _of(scene)


def is_up_to_date(scene: bpy.types.Scene) -> bool:
    """Whether nothing has changed since the scene was set up, and its camera is there."""
    return remembered.is_set_up(scene) and scene.camera is not None and scene.get(store.FILM_OF) == _of(scene)


def _of(scene: bpy.types.Scene) -> str:
    """Fingerprint of the settings, and of what is shown."""
    settings = [getattr(*remembered.owner(scene, name)) for name in SETTINGS]
    return hashlib.sha256(json.dumps([settings, *(str(scene.get(name, "")) for name in SHOWN)]).encode()).hexdigest()
