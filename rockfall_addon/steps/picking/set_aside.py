# SPDX-License-Identifier: GPL-3.0-or-later
"""Picks and values of a file that cannot be used: look at them, recover them, delete them."""

import bpy

from ...scene.footage import sync
from ...scene.storage import recovery, set_aside, store
from ...view.reporting import possible, reported

NOTHING = "Nothing is set aside"


class ROCKFALL_OT_select_set_aside(bpy.types.Operator):
    """Select what is set aside, or has a value that is: it is among its custom properties"""

    bl_idname = "rockfall.select_set_aside"
    bl_label = "Select What Is Set Aside"
    bl_options = {"REGISTER", "UNDO"}
    looks_only = True

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return possible(cls, context.scene.get(store.HAS_SET_ASIDE), NOTHING)

    @reported
    def execute(self, context: bpy.types.Context) -> set[str]:
        scene, layer = context.scene, context.view_layer
        found = [obj for obj in set_aside.objects_of(scene) if obj.name in layer.objects]
        if not found:
            self.report({"INFO"}, "It is of no object: look in Scene Properties > Custom Properties.")
            return {"CANCELLED"}
        for obj in layer.objects.selected:
            obj.select_set(False)
        for obj in found:
            obj.select_set(True)
        layer.objects.active = found[0]
        self.report({"INFO"}, f"{len(found)} selected: see Object Properties > Custom Properties.")
        return {"FINISHED"}


class ROCKFALL_OT_recover_picks(bpy.types.Operator):
    """Give the picks that are set aside the place of their marker, the time of its key, its kind; they are doubtful"""

    bl_idname = "rockfall.recover_picks"
    bl_label = "Recover Picks from Markers"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        there = context.scene.get(store.HAS_SET_ASIDE) and store.has_role(context.scene, store.SET_ASIDE_ROLE)
        return possible(cls, there, "No pick is set aside")

    @reported
    def execute(self, context: bpy.types.Context) -> set[str]:
        count, left = recovery.recover(context.scene)
        sync.sync(context.scene)
        if left:
            text = f"{count} picks are recovered; the markers of {len(left)} do not show what is missing: {left[0]}."
            self.report({"WARNING"}, text)
        else:
            self.report({"INFO"}, f"{count} picks are recovered, and doubtful until you have looked at them.")
        return {"FINISHED"}


class ROCKFALL_OT_remove_set_aside(bpy.types.Operator):
    """Delete the picks and values that are set aside"""

    bl_idname = "rockfall.remove_set_aside"
    bl_label = "Delete What Is Set Aside"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return possible(cls, context.scene.get(store.HAS_SET_ASIDE), NOTHING)

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        return context.window_manager.invoke_confirm(self, event)

    @reported
    def execute(self, context: bpy.types.Context) -> set[str]:
        count = set_aside.remove(context.scene)
        sync.sync(context.scene)
        self.report({"INFO"}, f"{count} picks and values are deleted.")
        return {"FINISHED"}


def draw(layout: bpy.types.UILayout, scene: bpy.types.Scene) -> None:
    """What can be done with what is set aside, where there is any."""
    if scene.get(store.HAS_SET_ASIDE):
        column = layout.column(align=True)
        column.operator("rockfall.recover_picks", icon="RECOVER_LAST")
        column.operator("rockfall.select_set_aside", icon="RESTRICT_SELECT_OFF")
        column.operator("rockfall.remove_set_aside", icon="TRASH")


CLASSES = (ROCKFALL_OT_select_set_aside, ROCKFALL_OT_recover_picks, ROCKFALL_OT_remove_set_aside)
