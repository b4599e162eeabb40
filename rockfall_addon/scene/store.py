# SPDX-License-Identifier: GPL-3.0-or-later
"""What the project keeps in the scene as doubles: the global shift and the clock.

Blender's own properties are single precision; ID properties are doubles, are saved in the file and follow undo.
"""

import bpy

from ...core.georeference import GlobalShift

SHIFT_KEY = "rockfall_shift_m"
CRS_KEY = "rockfall_crs"
KEYED_RATE_KEY = "rockfall_keyed_rate_hz"

ROLE_KEY = "rockfall_role"
TERRAIN_ROLE = "terrain"
PICK_ROLE = "pick"
BLOCK_ROLE = "block"
FLIGHTS_ROLE = "flights"
TWIN_ROLE = "twin"
TWIN_FLIGHTS_ROLE = "twin_flights"
CAMERA_ROLE = "camera"


def double(value: float) -> float:
    """The double nearest to what the user typed into a single-precision property (0.35, not 0.3499999940)."""
    return float(f"{value:.7g}")


def has_shift(scene: bpy.types.Scene) -> bool:
    """Whether the project has its global shift already."""
    return SHIFT_KEY in scene or "crs x" in scene


def read_shift(scene: bpy.types.Scene) -> GlobalShift:
    """The project's global shift; one left by BlenderGIS is honoured, none means no shift."""
    if SHIFT_KEY in scene:
        x, y, z = (float(value) for value in scene[SHIFT_KEY])
        return GlobalShift(x, y, z, str(scene.get(CRS_KEY, "")))
    if "crs x" in scene and "crs y" in scene:
        return GlobalShift(float(scene["crs x"]), float(scene["crs y"]), 0.0, str(scene.get("SRID", "")))
    return GlobalShift()


def write_shift(scene: bpy.types.Scene, shift: GlobalShift) -> None:
    """Store the global shift, also where BlenderGIS looks for it."""
    scene[SHIFT_KEY] = [shift.x, shift.y, shift.z]
    scene[CRS_KEY] = shift.crs
    scene["crs x"], scene["crs y"] = shift.x, shift.y
    if shift.crs:
        scene["SRID"] = shift.crs


def with_role(scene: bpy.types.Scene, role: str) -> list[bpy.types.Object]:
    """The scene's objects of one role, by name."""
    return sorted((o for o in scene.objects if o.get(ROLE_KEY) == role), key=lambda o: o.name)


def collection(scene: bpy.types.Scene, *path: str) -> bpy.types.Collection:
    """The collection at a path below "Rockfall", created where it is missing."""
    parent = scene.collection
    for name in ("Rockfall", *path):
        child = next((c for c in parent.children if c.get("rockfall_name") == name), None)
        if child is None:
            child = bpy.data.collections.new(name)
            child["rockfall_name"] = name
            parent.children.link(child)
        parent = child
    return parent


def remove_collection(scene: bpy.types.Scene, name: str) -> None:
    """Remove a collection below "Rockfall" with those in it; their objects must be gone."""
    ours = next((c for c in scene.collection.children if c.get("rockfall_name") == "Rockfall"), None)
    for child in ours.children if ours is not None else ():
        if child.get("rockfall_name") == name:
            for each in (*child.children_recursive, child):
                bpy.data.collections.remove(each)
            return


def remove_objects(objects: list[bpy.types.Object]) -> None:
    """Remove objects with the data and actions that nothing else uses."""
    for thing in objects:
        data, action = thing.data, thing.animation_data.action if thing.animation_data else None
        bpy.data.objects.remove(thing)
        if isinstance(data, bpy.types.Mesh) and not data.users:
            bpy.data.meshes.remove(data)
        if action is not None and not action.users:
            bpy.data.actions.remove(action)
