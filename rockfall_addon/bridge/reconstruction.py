# SPDX-License-Identifier: GPL-3.0-or-later
"""The scene's picks and settings → the core's reconstruction → the scene."""

import json

import bpy

from ...core.constants import AIR_DENSITY_KGPM3, DRAG_COEFFICIENT, GRAVITY_MPS2
from ...core.errors import RockfallError
from ...core.exchange.project import Project
from ...core.reconstruction.block import Block
from ...core.reconstruction.drag import Drag
from ...core.reconstruction.picks import Picks
from ...core.reconstruction.trajectory import Reconstruction, reconstruct
from ...core.terrain.surface import Surface
from . import migration, problems, shown, terrain, trajectories, twins
from . import picks as pick_objects
from .state import double

SITE_KEY, GRAVITY_KEY = "rockfall_site", "rockfall_gravity_mps2"
BLOCKS_KEY, DRAG_KEY = "rockfall_blocks", "rockfall_drag"  # d1, d2, d3, density by trajectory, as text; ρ, C_D


def reconstruct_scene(scene: bpy.types.Scene, picks: Picks | None = None) -> Reconstruction:
    """Reconstruct picks (by default those in the scene) with the scene's terrain and settings.

    Raises
    ------
    RockfallError : the file is of a newer Rockfall; whatever the core refuses.
    """
    migration.refuse_newer(scene)
    settings = scene.rockfall
    picks = pick_objects.trusted(pick_objects.picks_of(scene) if picks is None else picks)
    return reconstruct(
        picks,
        surface=ground(scene),
        block=blocks_of(scene, set(picks.trajectory.tolist())),
        drag=Drag(*list(scene.get(DRAG_KEY, (AIR_DENSITY_KGPM3, DRAG_COEFFICIENT)))) if settings.use_drag else None,
        gravity_mps2=float(scene.get(GRAVITY_KEY, GRAVITY_MPS2)),
        normal_radius_m=double(settings.normal_radius_m) or None,
        site=str(scene.get(SITE_KEY, "")),
        flights=settings.flights_join,
    )


def ground(scene: bpy.types.Scene) -> Surface | None:
    """The scene's terrain; None without."""
    return terrain.surface_of_scene(scene)


def blocks_of(scene: bpy.types.Scene, names: set[str]) -> dict[str, Block]:
    """The block of each trajectory: its own, or that of the settings."""
    settings = scene.rockfall
    default = Block(*[double(settings.block_diameter_m)] * 3, density=double(settings.density_kgpm3))
    own = json.loads(scene.get(BLOCKS_KEY, "{}"))
    return {name: Block(*own[name]) if name in own else default for name in names}


def show(scene: bpy.types.Scene, result: Reconstruction) -> None:
    """Bring everything that is shown in line with a reconstruction, the models' twins included.

    Raises
    ------
    RockfallError : the twins that were shown cannot be had any more; they are gone, the rest is shown.
    """
    scene[migration.SCHEMA_KEY] = migration.SCHEMA
    trajectories.show_reconstruction(scene, result, ground(scene))
    shown.remember_all(scene)
    problems.keep_trajectories(scene, problems.of_result(scene, result))
    problems.tell(scene)
    twins.follow(scene, result)


def refresh(scene: bpy.types.Scene) -> Reconstruction | None:
    """Reconstruct and show again what is in the scene; None when it has no picks."""
    if not pick_objects.things_of(scene):
        return None
    result = reconstruct_scene(scene)
    show(scene, result)
    return result


def refresh_or_tell(scene: bpy.types.Scene) -> None:
    """`refresh` for a changed setting, where nobody can catch an error: the panel shows it.

    When one trajectory has a problem, the others still follow.
    """
    from . import live

    try:
        refresh(scene)
    except RockfallError:
        live.sync(scene, again=True)


def keep_settings(scene: bpy.types.Scene, project: Project, names: list[str]) -> None:
    """Store a project's settings in the scene: doubles where they matter, the others where the panels show them."""
    settings, how = scene.rockfall, project.reconstruction
    scene[SITE_KEY], scene[GRAVITY_KEY] = project.site.name, how.gravity_mps2
    scene[DRAG_KEY] = [how.air_density_kgpm3, how.drag_coefficient]
    blocks = {name: project.block_of(name) for name in names}
    scene[BLOCKS_KEY] = json.dumps({n: [b.d1_m, b.d2_m, b.d3_m, b.density_kgpm3] for n, b in blocks.items()})
    settings.block_diameter_m = (project.block.d1_m + project.block.d2_m + project.block.d3_m) / 3
    settings.density_kgpm3 = project.block.density_kgpm3
    settings.normal_radius_m = how.normal_radius_m or 0.0
    settings.use_drag = how.drag
    settings.flights_join = how.flights
