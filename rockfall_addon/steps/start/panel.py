# SPDX-License-Identifier: GPL-3.0-or-later
"""What is above the steps: the way into the workspace, and the next step with its button."""

import bpy

from ...scene.next_step import PICK_TOOL, next_step
from ...view import job, workspace
from ...view.panel import RockfallPanel, paragraph

LOOKS = {
    "rockfall.load_footage_demo": ("", "FILE_MOVIE"),
    "rockfall.load_demo": ("", "PLAY"),
    "rockfall.import_terrain": ("", "IMPORT"),
    "rockfall.put_terrain_back": ("", "LOOP_BACK"),
    "rockfall.recover_picks": ("", "RECOVER_LAST"),
    "rockfall.select_set_aside": ("", "RESTRICT_SELECT_OFF"),
    "rockfall.remove_set_aside": ("", "TRASH"),
    "rockfall.open_project": ("", "FILE_FOLDER"),
    "rockfall.add_video": ("", "FILE_MOVIE"),
    "rockfall.import_picks": ("", "IMPORT"),
    "rockfall.mark_event": ("", "MARKER"),
    "rockfall.synchronise_videos": ("", "UV_SYNC_SELECT"),
    "rockfall.align_views": ("", "SPLIT_VERTICAL"),
    "rockfall.look_through": ("Look Through the Other Video", "VIEW_CAMERA"),
    "rockfall.follow_background": ("", "TRACKING_FORWARDS"),
    "rockfall.propose_impacts": ("", "OUTLINER_OB_LIGHTPROBE"),
    "rockfall.apply_refinement": ("Apply", "CHECKMARK"),
    "rockfall.discard_refinement": ("Discard", "X"),
    "rockfall.refine": ("", "SHADERFX"),
    "rockfall.export_tables": ("", "EXPORT"),
    "rockfall.draw_release": ("Draw a Release Line", "IPO_LINEAR"),
    "rockfall.select_run": ("", "EYEDROPPER"),
    "screen.animation_play": ("Play or Pause", "PLAY"),
    PICK_TOOL: ("Pick Impacts", "CURSOR"),
}
"""Text (empty: the operator's own) and icon of the buttons."""


class ROCKFALL_PT_start(RockfallPanel, bpy.types.Panel):
    bl_label = "Next Step"  # only panels with a header have a background, which text needs over footage
    bl_idname = "ROCKFALL_PT_start"
    bl_order = 0

    def draw(self, context: bpy.types.Context) -> None:
        layout = self.layout
        if not workspace.is_open(context):
            layout.operator("rockfall.open_workspace", text="Open Workspace", icon="WORKSPACE")
        job.draw(context, layout)
        step = next_step(context.scene)
        paragraph(context, layout, step.sentence, "RIGHTARROW")
        column = layout.column(align=True)
        column.scale_y = 1.4
        for action in step.actions:
            text, icon = LOOKS[action]
            if step.tile and action == "rockfall.import_terrain":
                text = "Read Again with Another Unit" if step.unit_m else "Read Again with Ground Filter"
            operator = "wm.tool_set_by_id" if action == PICK_TOOL else action
            button = column.operator(operator, icon=icon, **({"text": text} if text else {}))
            if action == PICK_TOOL:
                button.name = PICK_TOOL
            elif action == "rockfall.look_through":
                button.identifier = step.video
            elif step.tile and action == "rockfall.import_terrain":
                button.replaces = step.tile
                if step.unit_m:
                    button.unit_m = step.unit_m
                else:
                    button.ground = "FILTER"


CLASSES = (ROCKFALL_PT_start,)
