# SPDX-License-Identifier: GPL-3.0-or-later
"""The scene's picks and settings → the core's reconstruction → the scene."""

from collections.abc import Callable, Sequence
from functools import partial

import bpy
import numpy as np

from ...core.constants import AIR_DENSITY_KGPM3, DRAG_COEFFICIENT, GRAVITY_MPS2
from ...core.errors import InputError, RockfallError
from ...core.exchange.project import BlockEntry, Project, ReconstructionSettings
from ...core.reconstruction.block import Block
from ...core.reconstruction.drag import Drag
from ...core.reconstruction.picks import Picks
from ...core.reconstruction.trajectory import Reconstruction, reconstruct
from ...core.remarks import Remark
from ...core.terrain.surface import Surface
from ...core.workflow.opening import block_of
from . import (
    fingerprints,
    migration,
    models,
    own_blocks,
    problems,
    set_aside_words,
    simulation,
    store,
    terrain,
    trajectories,
)
from . import picks as pick_objects
from .stored_values import block_problem


def reconstruct_scene(
    scene: bpy.types.Scene, picks: Picks | None = None, surface: Surface | None = None
) -> Reconstruction:
    """Reconstruct picks (by default those in the scene) with a terrain (by default the scene's) and its settings.

    Raises
    ------
    RockfallError : whatever the core refuses.
    """
    picks = pick_objects.picks_of(scene) if picks is None else picks
    return reconstruction_of(scene, picks, surface)()


def reconstruction_of(
    scene: bpy.types.Scene, picks: Picks, surface: Surface | None = None
) -> Callable[[], Reconstruction]:
    """`reconstruct_scene` as work that knows nothing of Blender, for a thread: settings are those of now."""
    gravity_mps2, drag = forces_of(scene)
    return partial(
        reconstruct,
        pick_objects.trusted(picks),
        surface=ground(scene) if surface is None else surface,
        block=blocks_of(scene, set(picks.trajectory.tolist())),
        drag=drag,
        gravity_mps2=gravity_mps2,
        normal_radius_m=_exact(scene, store.NORMAL_RADIUS, scene.rockfall.normal_radius_m) or None,
        site=str(scene.get(store.SITE, "")),
        flights=scene.rockfall.flights_join,
    )


def reconstruct_good(scene: bpy.types.Scene) -> tuple[Reconstruction, tuple[Remark, ...]]:
    """The trajectories that can be reconstructed; and what is missing, and why.

    Raises
    ------
    RockfallError : none can be.
    """
    _, result, said = _good(scene)
    return result, said


def good_picks(scene: bpy.types.Scene) -> tuple[Picks, tuple[Remark, ...]]:
    """The picks of these trajectories, as they stand in the scene; what is missing, and errors, as there."""
    picks, _, said = _good(scene)
    return picks, said


def _good(scene: bpy.types.Scene) -> tuple[Picks, Reconstruction, tuple[Remark, ...]]:
    objects = pick_objects.ordered(scene, pick_objects.objects_of(scene))
    surface, said = ground(scene), tuple(set_aside_words.grave(scene))

    def together(members: Sequence[bpy.types.Object]) -> tuple[Picks, Reconstruction]:
        picks = pick_objects.read(scene, members)
        return picks, reconstruct_scene(scene, picks, surface)

    try:
        return *together(objects), said
    except RockfallError as error:
        first = error
    good, bad = [], []
    for name, members in fingerprints.by_trajectory(objects).items():
        try:
            together(members)
            good += members
        except RockfallError as error:
            bad.append(Remark(str(error), "problem", name))
    if not good:
        raise first
    return *together(good), (*bad, *said)


def forces_of(scene: bpy.types.Scene) -> tuple[float, Drag | None]:
    """Gravity [m/s²], and the drag of the air where it is wanted."""
    drag = Drag(*list(scene.get(store.DRAG, (AIR_DENSITY_KGPM3, DRAG_COEFFICIENT))))
    return float(scene.get(store.GRAVITY, GRAVITY_MPS2)), drag if scene.rockfall.use_drag else None


def ground(scene: bpy.types.Scene) -> Surface | None:
    """The scene's terrain; None without."""
    return terrain.surface_of_scene(scene)


def blocks_of(scene: bpy.types.Scene, names: set[str]) -> dict[str, Block]:
    """The block of each trajectory: its own, or that of the settings."""
    default = default_block(scene)
    own = store.read_json(scene, store.BLOCKS, {})
    return {name: _own_block(name, own[name]) if name in own else default for name in names}


def default_block(scene: bpy.types.Scene) -> Block:
    """The block of the settings."""
    return Block(*_default_block(scene))


def _own_block(name: str, values: list[float]) -> Block:
    problem = block_problem(values)
    if problem:
        advice = "Give it another one: step 4, panel Block"
        raise InputError(f"Its block cannot be: {problem.rstrip('.')}", trajectory=name, advice=advice)
    return Block(*values)


def show(scene: bpy.types.Scene, result: Reconstruction) -> None:
    """Bring everything that is shown in line with a reconstruction, the models' twins included.

    Raises
    ------
    RockfallError : the twins that were shown cannot be had any more; they are gone, the rest is shown.
    """
    for _ in show_in_steps(scene, result):
        pass


def show_in_steps(scene: bpy.types.Scene, result: Reconstruction) -> trajectories.Steps:
    """The same, with pauses; until it goes on nothing may change what is shown."""
    scene[store.SCHEMA] = migration.SCHEMA
    yield from trajectories.show_reconstruction(scene, result, ground(scene))
    fingerprints.remember_all(scene)
    problems.keep_trajectories(scene, problems.of_result(scene, result))
    problems.update(scene)
    simulation.follow(scene)
    models.follow(scene, result)


def refresh(scene: bpy.types.Scene) -> Reconstruction | None:
    """Reconstruct and show again what is in the scene; None when it has no picks."""
    if not pick_objects.objects_of(scene):
        return None
    result = reconstruct_scene(scene)
    show(scene, result)
    return result


def keep_settings(scene: bpy.types.Scene, project: Project) -> None:
    """Store a project's settings in the scene: doubles where they matter, the others where the panels show them."""
    settings, how = scene.rockfall, project.reconstruction
    scene[store.SITE], scene[store.GRAVITY] = project.site.name, how.gravity_mps2
    scene[store.DRAG] = [how.air_density_kgpm3, how.drag_coefficient]
    scene[store.BLOCKS] = "{}"
    for entry in project.blocks:
        own_blocks.give(scene, entry.name, block_of(project, entry.name))
    default = project.block
    scene[store.DEFAULT_BLOCK] = [default.d1_m, default.d2_m, default.d3_m, default.density_kgpm3]
    scene[store.NORMAL_RADIUS] = how.normal_radius_m or 0.0
    settings.block_diameter_m = (project.block.d1_m + project.block.d2_m + project.block.d3_m) / 3
    settings.density_kgpm3 = project.block.density_kgpm3
    settings.block_shape = project.block.shape
    settings.normal_radius_m = how.normal_radius_m or 0.0
    settings.use_drag = how.drag
    settings.flights_join = how.flights


def project_settings(scene: bpy.types.Scene, names: list[str]) -> Project:
    """The settings as a project keeps them; blocks for the trajectories that have their own."""
    settings = scene.rockfall
    own = store.read_json(scene, store.BLOCKS, {})
    density, coefficient = scene.get(store.DRAG, (AIR_DENSITY_KGPM3, DRAG_COEFFICIENT))
    return Project(
        block=BlockEntry("", *_default_block(scene)),
        blocks=tuple(BlockEntry(name, *own[name]) for name in dict.fromkeys(names) if name in own),
        reconstruction=ReconstructionSettings(
            normal_radius_m=_exact(scene, store.NORMAL_RADIUS, settings.normal_radius_m) or None,
            gravity_mps2=float(scene.get(store.GRAVITY, GRAVITY_MPS2)),
            drag=settings.use_drag,
            drag_coefficient=coefficient,
            air_density_kgpm3=density,
            flights=settings.flights_join,
        ),
    )


def _exact(scene: bpy.types.Scene, key: str, typed: float) -> float:
    """The double that is kept for a setting, unless the setting was changed since."""
    kept = scene.get(key)
    return store.double(typed) if kept is None or np.float32(kept) != np.float32(typed) else float(kept)


def _default_block(scene: bpy.types.Scene) -> tuple[float, float, float, float, str]:
    """d1, d2, d3 [m], density [kg/m³] and shape of the blocks that have none of their own."""
    settings = scene.rockfall
    d1, d2, d3, density = scene.get(store.DEFAULT_BLOCK, (0.0, 0.0, 0.0, 0.0))
    if np.float32((d1 + d2 + d3) / 3) != np.float32(settings.block_diameter_m):
        d1 = d2 = d3 = store.double(settings.block_diameter_m)
    if np.float32(density) != np.float32(settings.density_kgpm3):
        density = store.double(settings.density_kgpm3)
    return d1, d2, d3, density, settings.block_shape
