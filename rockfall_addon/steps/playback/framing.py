# SPDX-License-Identifier: GPL-3.0-or-later
"""The free views show a trajectory, or all of them, as large as they can."""

import bpy

from ...scene.storage import store
from ...view import look
from ...view.reporting import possible


class ROCKFALL_OT_frame_trajectory(bpy.types.Operator):
    """Show the trajectory of what is selected, or all of them, as large as the free views can"""

    bl_idname = "rockfall.frame_trajectory"
    bl_label = "Frame Trajectory"
    bl_options = {"REGISTER"}
    looks_only = True

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return possible(cls, store.has_role(context.scene, store.FLIGHTS_ROLE), "There are no flights yet")

    def execute(self, context: bpy.types.Context) -> set[str]:
        flights = store.with_role(context.scene, store.FLIGHTS_ROLE)
        name = context.object.get(store.TRAJECTORY) if context.object is not None else None
        look.frame(context, [obj for obj in flights if obj[store.TRAJECTORY] == name] or flights)
        return {"FINISHED"}


CLASSES = (ROCKFALL_OT_frame_trajectory,)
