# SPDX-License-Identifier: GPL-3.0-or-later
"""Open the motion graphs: in the place of the other graphs, in the free view, or beside the 3-D view."""

import bpy

from ...view.graphs import areas, editor
from ...view.reporting import InWindow, reported


class ROCKFALL_OT_open_motion_graphs(InWindow, bpy.types.Operator):
    """Show speed, height, energy and residuals of tracks over time in the free view, or beside the 3-D view; again for
    the free view"""

    bl_idname = "rockfall.open_motion_graphs"
    bl_label = "Motion Graphs"

    @reported
    def execute(self, context: bpy.types.Context) -> set[str]:
        areas.toggle(context, editor.MOTION)
        return {"FINISHED"}


CLASSES = (ROCKFALL_OT_open_motion_graphs,)
