# SPDX-License-Identifier: GPL-3.0-or-later
"""The film of a saved .blend: as its settings say."""

import bpy

from ....core.errors import InputError
from ....core.film.job import AS_SET_UP, FilmJob
from ...scene.film_preset import preset_of
from ...scene.storage import store
from ...scene.storage.saved import open_saved
from . import dressing, remembered, up_to_date
from .engine import engine_of, quickest_engine
from .properties import graphs_of


def open_film(job: FilmJob) -> bpy.types.Scene:
    """Open a .blend; its scene is set up for its film where nobody has done it, or for another engine.

    Raises
    ------
    RockfallError : it cannot be opened, there is nothing to film, or something has changed since it was set up.
    """
    scene = open_saved(job.source, job.scene)
    if not store.has_role(scene, store.FLIGHTS_ROLE):
        raise InputError(
            "There are no trajectories to film", file=job.source, advice="Import picks in Blender, and save the file"
        )
    if remembered.is_set_up(scene) and not up_to_date.is_up_to_date(scene):
        raise InputError(
            "Something has changed since the film was set up",
            file=job.source,
            advice="Press Update Set-up in the step Film, and save the file",
        )
    asked = scene.rockfall_film.engine if job.engine == AS_SET_UP else job.engine
    if not remembered.is_set_up(scene) or (job.engine != AS_SET_UP and engine_of(scene) != asked):
        engine = quickest_engine() if asked == "auto" else asked
        dressing.set_up_film(scene, preset_of(scene), engine, graphs_of(scene))
    return scene
