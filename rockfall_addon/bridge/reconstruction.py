# SPDX-License-Identifier: GPL-3.0-or-later
"""The scene's picks and settings → the core's reconstruction → the scene."""

import bpy

from ...core.constants import AIR_DENSITY_KGPM3, DRAG_COEFFICIENT, GRAVITY_MPS2
from ...core.exchange.project import Project
from ...core.reconstruction.block import Block
from ...core.reconstruction.picks import Picks
from ...core.reconstruction.trajectory import Reconstruction, reconstruct
from ..properties.settings import double
from . import picks as pick_objects
from . import state, terrain, trajectories

SITE_KEY, GRAVITY_KEY, BLOCKS_KEY = "rockfall_site", "rockfall_gravity_mps2", "rockfall_blocks"


def reconstruct_scene(scene: bpy.types.Scene, picks: Picks | None = None) -> Reconstruction:
    """Reconstruct picks (by default those in the scene) with the scene's terrain and settings."""
    settings = scene.rockfall
    ground = terrain.active_terrain(scene)
    own = scene.get(BLOCKS_KEY, {})
    return reconstruct(
        pick_objects.picks_of(scene) if picks is None else picks,
        surface=None if ground is None else terrain.surface_of(ground),
        block=Block(*[double(settings.block_diameter_m)] * 3, density=double(settings.density_kgpm3)),
        blocks={name: Block(*list(own[name])) for name in own.keys()},
        drag=Drag() if settings.use_drag else None,
        gravity_mps2=float(scene.get(GRAVITY_KEY, GRAVITY_MPS2)),
        normal_radius_m=double(settings.normal_radius_m) or None,
        site=str(scene.get(SITE_KEY, "")),
    )
