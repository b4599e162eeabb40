# SPDX-License-Identifier: GPL-3.0-or-later
"""From project.toml to the scene: what *Load demo* and a film without a window have in common."""

from pathlib import Path

import bpy

from ...core.exchange.opening import open_project
from ...core.exchange.parameters import checked_parameters
from ...core.exchange.project import read_project
from ...core.reconstruction.trajectory import Reconstruction
from ...core.terrain.shading import shade
from . import reconstruction, state, terrain, twins


def load_project(scene: bpy.types.Scene, path: Path) -> Reconstruction:
    """Show a project in a scene: its terrain, its picks, and what is reconstructed from them.

    Raises
    ------
    RockfallError : the project or one of its files is bad. The scene is as it was.
    """
    project = read_project(path)
    parameters = checked_parameters(project.extra["models"], path) if "models" in project.extra else {}
    surface, result = open_project(project)
    shading = None if surface is None else shade(surface)

    state.write_shift(scene, result.picks.shift)
    reconstruction.keep_settings(scene, project, sorted(set(result.picks.trajectory.tolist())))
    twins.keep_parameters(scene, parameters)
    if surface is not None and shading is not None:
        terrain.add_terrain(scene, surface, shading)
    reconstruction.show(scene, result)
    return result
