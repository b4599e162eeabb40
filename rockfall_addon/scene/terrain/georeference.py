# SPDX-License-Identifier: GPL-3.0-or-later
"""The project's global shift, kept in the scene, also where BlenderGIS keeps it."""

import math

import bpy

from ....core.georeference import GlobalShift
from ....core.terrain.crs import IN_METRES
from ..storage import store


def has_shift(scene: bpy.types.Scene) -> bool:
    """Whether the project has its global shift already."""
    return store.SHIFT in scene or _of_blender_gis(scene) is not None


def read_shift(scene: bpy.types.Scene) -> GlobalShift:
    """The project's global shift; one left by BlenderGIS is honoured, none means no shift."""
    if store.SHIFT in scene:
        x, y, z = (float(value) for value in scene[store.SHIFT])
        return GlobalShift(x, y, z, str(scene.get(store.CRS, "")), str(scene.get(store.VERTICAL, "")))
    return _of_blender_gis(scene) or GlobalShift()


def _of_blender_gis(scene: bpy.types.Scene) -> GlobalShift | None:
    """What BlenderGIS has left, where that is two numbers."""
    kept = [scene.get(key) for key in ("crs x", "crs y")]
    if not all(isinstance(value, (int, float)) and math.isfinite(value) for value in kept):
        return None
    return GlobalShift(float(kept[0]), float(kept[1]), 0.0, str(scene.get("SRID", "")))


def forget_shift(scene: bpy.types.Scene) -> None:
    """The project has no shift any more."""
    for key in (store.SHIFT, store.CRS, store.VERTICAL, "crs x", "crs y", "SRID"):
        scene.pop(key, None)


def write_shift(scene: bpy.types.Scene, shift: GlobalShift) -> None:
    """Store the global shift, also where BlenderGIS looks for it."""
    scene[store.SHIFT] = [shift.x, shift.y, shift.z]
    scene[store.CRS], scene[store.VERTICAL] = shift.crs, shift.vertical
    scene["crs x"], scene["crs y"] = shift.x, shift.y
    if shift.crs and not shift.crs.endswith(IN_METRES):
        scene["SRID"] = shift.crs
