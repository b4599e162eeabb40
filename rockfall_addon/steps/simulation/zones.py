# SPDX-License-Identifier: GPL-3.0-or-later
"""Zones of the ground are added and taken away."""

import bpy

from ...scene.terrain import terrain
from ...view.reporting import possible, reported


class ROCKFALL_OT_add_zone(bpy.types.Operator):
    """A new zone: a vertex group of the terrain, with the vertices that are selected in Edit Mode"""

    bl_idname = "rockfall.add_zone"
    bl_label = "Add Zone"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return possible(cls, terrain.tiles(context.scene), "Import the terrain first, in step 1")

    @reported
    def execute(self, context: bpy.types.Context) -> set[str]:
        zones = context.scene.rockfall_simulation.zones
        taken, number = {zone.name for zone in zones}, len(zones) + 1
        while f"Zone {number}" in taken:
            number += 1
        zone = zones.add()
        zone.name = f"Zone {number}"
        for tile in terrain.tiles(context.scene):
            group = tile.vertex_groups.get(zone.name) or tile.vertex_groups.new(name=zone.name)
            tile.vertex_groups.active = group
            if tile.mode == "EDIT":
                tile.update_from_editmode()
                if any(vertex.select for vertex in tile.data.vertices):
                    with context.temp_override(active_object=tile, object=tile, edit_object=tile):
                        bpy.ops.object.vertex_group_assign()
        return {"FINISHED"}


class ROCKFALL_OT_remove_zone(bpy.types.Operator):
    """The ground has the parameters of the whole here again; the vertex group stays"""

    bl_idname = "rockfall.remove_zone"
    bl_label = "Remove Zone"
    bl_options = {"INTERNAL", "UNDO"}

    place: bpy.props.IntProperty()

    @reported
    def execute(self, context: bpy.types.Context) -> set[str]:
        context.scene.rockfall_simulation.zones.remove(self.place)
        return {"FINISHED"}


CLASSES = (ROCKFALL_OT_add_zone, ROCKFALL_OT_remove_zone)
