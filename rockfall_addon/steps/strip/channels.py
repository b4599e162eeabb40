# SPDX-License-Identifier: GPL-3.0-or-later
"""The keys of all picks and blocks as a list of channels, in the place of the timeline."""

import bpy

from ...scene.storage import store
from ...view.reporting import possible, reported


class ROCKFALL_OT_open_keys(bpy.types.Operator):
    """Show the keys of all picks and blocks with a list of their channels in the timeline's place; again to have the
    timeline back"""

    bl_idname = "rockfall.open_keys"
    bl_label = "Keys of All Picks"
    bl_options = {"REGISTER"}
    looks_only = True

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return possible(cls, _area(context) is not None, "There is no timeline in this window")

    @reported
    def execute(self, context: bpy.types.Context) -> set[str]:
        area = _area(context)
        if area.ui_type != "TIMELINE":
            area.ui_type = "TIMELINE"
            return {"FINISHED"}
        area.ui_type = "DOPESHEET"
        space = area.spaces.active
        space.dopesheet.show_only_selected = False
        space.dopesheet.show_expanded_summary = True
        space.dopesheet.filter_collection = store.collection(context.scene, "Trajectories")
        space.show_region_channels = space.show_seconds = True
        return {"FINISHED"}


def _area(context: bpy.types.Context) -> bpy.types.Area | None:
    """The largest timeline or dope sheet of the window."""
    areas = context.screen.areas if context.screen is not None else ()
    kinds = ("TIMELINE", "DOPESHEET")
    return max((area for area in areas if area.ui_type in kinds), key=lambda area: area.height, default=None)


CLASSES = (ROCKFALL_OT_open_keys,)
