# SPDX-License-Identifier: GPL-3.0-or-later
"""Step 1: remove a terrain, or put another in its place; what is on it stays, and that is said."""

import bpy
from bpy.props import StringProperty

from ....core.errors import RockfallError
from ...scene.footage import pairs, sync, videos
from ...scene.picks import picks
from ...scene.storage import store
from ...scene.terrain import terrain
from ...view.reporting import possible, reported


def tiles_of(scene: bpy.types.Scene, identifier: str) -> list[bpy.types.Object]:
    """The tile with an id, all for an empty one.

    Raises
    ------
    RockfallError : there is no such tile.
    """
    found = [tile for tile in store.with_role(scene, store.TERRAIN_ROLE) if identifier in ("", tile.get(store.ID))]
    if not found:
        raise RockfallError("This terrain is not there any more.")
    return found


def what_stays(scene: bpy.types.Scene, tiles: list[bpy.types.Object]) -> str:
    """What was made on tiles, and what becomes of it without them, in sentences; empty when it is nothing."""
    marked = [pair for camera in videos.cameras(scene) for pair in pairs.complete_of(camera)]
    counts = ((len(picks.objects_of(scene)), "pick"), (len(marked), "pair"))
    there = [f"{count} {one}{'' if count == 1 else 's'}" for count, one in counts if count]
    zones = [row.name for row in scene.rockfall_simulation.zones]
    lost = [name for name in zones if any(terrain.has_part(tile, name) for tile in tiles)]
    said = [f"{' and '.join(there)} stay where they are."] if there else []
    said += [f"What was painted on it is gone with it: {', '.join(lost)}."] if lost else []
    return " ".join(said)


class ROCKFALL_OT_remove_terrain(bpy.types.Operator):
    """Remove this terrain from the scene. Picks, pairs, videos and the file itself stay"""

    bl_idname = "rockfall.remove_terrain"
    bl_label = "Remove Terrain"
    bl_options = {"REGISTER", "UNDO"}

    identifier: StringProperty(description="Id of the tile; all without", options={"SKIP_SAVE"})

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return possible(cls, store.has_role(context.scene, store.TERRAIN_ROLE), "There is no terrain to remove")

    @reported
    def execute(self, context: bpy.types.Context) -> set[str]:
        scene = context.scene
        tiles = tiles_of(scene, self.identifier)
        names, said = ", ".join(tile.name for tile in tiles), what_stays(scene, tiles)
        terrain.remove(scene, tiles)
        sync.sync(scene)
        self.report({"WARNING"} if said else {"INFO"}, f"Removed {names}. {said}".strip())
        return {"FINISHED"}


CLASSES = (ROCKFALL_OT_remove_terrain,)
