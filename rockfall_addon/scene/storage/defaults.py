# SPDX-License-Identifier: GPL-3.0-or-later
"""What a new project begins with, as the preferences say; a project, and what a person sets later, comes before it."""

import bpy

from .... import __package__ as ADDON_ID  # noqa: N812
from . import migration, store

SHOWN, CLICK = ("block_diameter_m", "density_kgpm3", "block_shape", "colour_by"), ("sigma_px",)
"""Settings of reconstruction and of picking that the preferences have under the same names."""


def begin(scene: bpy.types.Scene) -> None:
    """Give a scene without anything of ours what the preferences say; any other keeps what it has."""
    ours = bpy.context.preferences.addons.get(ADDON_ID)
    if ours is None or ours.preferences is None or not store.is_own(scene) or migration.version(scene) is not None:
        return
    for settings, names in ((scene.rockfall, SHOWN), (scene.rockfall_picking, CLICK)):
        for name in names:
            wanted = getattr(ours.preferences, name)
            if getattr(settings, name) != wanted:
                setattr(settings, name, wanted)
