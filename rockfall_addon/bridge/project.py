# SPDX-License-Identifier: GPL-3.0-or-later
"""From project.toml to the scene: what *Load demo* and a film without a window have in common."""

import bpy

from ...core.errors import RockfallError
from ...core.exchange.project import Project
from ...core.exchange.tables import read_picks
from ...core.reconstruction.trajectory import Reconstruction
from ...core.terrain.readers import read_terrain
from ...core.terrain.shading import shade
from . import reconstruction, state, terrain


def load_project(scene: bpy.types.Scene, project: Project) -> Reconstruction:
    """Show a project in a scene: its terrain, its picks, and what is reconstructed from them.

    Raises
    ------
    RockfallError : the project names no picks, or a file is bad. The scene is as it was.
    """
    if project.picks is None:
        raise RockfallError('The project names no table of picks: add [picks] file = "picks.csv" to it.')
    source = project.terrain
    surface = shading = None
    if source is not None:
        surface = read_terrain(source.file, shift=source.global_shift, up=source.up, unit_m=source.unit_m)
        shading = shade(surface)
    picks = read_picks(project.picks, None if surface is None else surface.shift)
    state.write_shift(scene, picks.shift)
    reconstruction.keep_settings(scene, project, sorted(set(picks.trajectory.tolist())))
    if surface is not None and shading is not None:
        terrain.add_terrain(scene, surface, shading)
    result = reconstruction.reconstruct_scene(scene, picks)
    reconstruction.show(scene, result)
    return result
