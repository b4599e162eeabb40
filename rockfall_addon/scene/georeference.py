# SPDX-License-Identifier: GPL-3.0-or-later
"""The project's global shift, kept in the scene, also where BlenderGIS keeps it."""

import bpy

from ...core.georeference import GlobalShift
from ...core.terrain.crs import IN_METRES
from . import store


def has_shift(scene: bpy.types.Scene) -> bool:
    """Whether the project has its global shift already."""
    return store.SHIFT in scene or "crs x" in scene


def read_shift(scene: bpy.types.Scene) -> GlobalShift:
    """The project's global shift; one left by BlenderGIS is honoured, none means no shift."""
    if store.SHIFT in scene:
        x, y, z = (float(value) for value in scene[store.SHIFT])
        return GlobalShift(x, y, z, str(scene.get(store.CRS, "")), str(scene.get(store.VERTICAL, "")))
    if "crs x" in scene and "crs y" in scene:
        return GlobalShift(float(scene["crs x"]), float(scene["crs y"]), 0.0, str(scene.get("SRID", "")))
    return GlobalShift()


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
