# SPDX-License-Identifier: GPL-3.0-or-later
"""The scene's picks and settings → the core's reconstruction → the scene."""

import bpy

from ...core.constants import AIR_DENSITY_KGPM3, DRAG_COEFFICIENT, GRAVITY_MPS2
from ...core.errors import RockfallError
from ...core.exchange.project import Project
from ...core.reconstruction.block import Block
from ...core.reconstruction.drag import Drag
from ...core.reconstruction.picks import Picks
from ...core.reconstruction.trajectory import Reconstruction, reconstruct
from . import picks as pick_objects
from . import state, terrain, trajectories, twins
from .state import double

PROBLEM_KEY = "rockfall_problem"
SITE_KEY, GRAVITY_KEY = "rockfall_site", "rockfall_gravity_mps2"
BLOCKS_KEY, DRAG_KEY = "rockfall_blocks", "rockfall_drag"  # d1, d2, d3, density by trajectory; ρ, C_D


def reconstruct_scene(scene: bpy.types.Scene, picks: Picks | None = None) -> Reconstruction:
    """Reconstruct picks (by default those in the scene) with the scene's terrain and settings."""
    settings = scene.rockfall
    ground = terrain.active_terrain(scene)
    picks = pick_objects.picks_of(scene) if picks is None else picks
    default = Block(*[double(settings.block_diameter_m)] * 3, density=double(settings.density_kgpm3))
    own = scene.get(BLOCKS_KEY, {})
    return reconstruct(
        picks,
        surface=None if ground is None else terrain.surface_of(ground),
        block={name: Block(*list(own[name])) if name in own else default for name in set(picks.trajectory.tolist())},
        drag=Drag(*list(scene.get(DRAG_KEY, (AIR_DENSITY_KGPM3, DRAG_COEFFICIENT)))) if settings.use_drag else None,
        gravity_mps2=float(scene.get(GRAVITY_KEY, GRAVITY_MPS2)),
        normal_radius_m=double(settings.normal_radius_m) or None,
        site=str(scene.get(SITE_KEY, "")),
    )


def show(scene: bpy.types.Scene, result: Reconstruction) -> None:
    """Bring everything that is shown in line with a reconstruction, the models' twins included.

    Raises
    ------
    RockfallError : the twins that were shown cannot be had any more; they are gone, the rest is shown.
    """
    trajectories.show_reconstruction(scene, result)
    twins.follow(scene, result)


def refresh(scene: bpy.types.Scene) -> Reconstruction | None:
    """Reconstruct and show again what is in the scene; None when it has no picks."""
    if not state.with_role(scene, state.PICK_ROLE):
        return None
    result = reconstruct_scene(scene)
    show(scene, result)
    scene[PROBLEM_KEY] = ""
    return result


def refresh_or_tell(scene: bpy.types.Scene) -> None:
    """`refresh` for a changed setting, where nobody can catch an error: the panel shows it."""
    try:
        refresh(scene)
    except RockfallError as error:
        scene[PROBLEM_KEY] = str(error)


def keep_settings(scene: bpy.types.Scene, project: Project, names: list[str]) -> None:
    """Store a project's settings in the scene: doubles where they matter, the others where the panels show them."""
    settings, how = scene.rockfall, project.reconstruction
    scene[SITE_KEY], scene[GRAVITY_KEY] = project.site.name, how.gravity_mps2
    scene[DRAG_KEY] = [how.air_density_kgpm3, how.drag_coefficient]
    blocks = {name: project.block_of(name) for name in names}
    scene[BLOCKS_KEY] = {n: [b.d1_m, b.d2_m, b.d3_m, b.density_kgpm3] for n, b in blocks.items()}
    settings.block_diameter_m = (project.block.d1_m + project.block.d2_m + project.block.d3_m) / 3
    settings.density_kgpm3 = project.block.density_kgpm3
    settings.normal_radius_m = how.normal_radius_m or 0.0
    settings.use_drag = how.drag
