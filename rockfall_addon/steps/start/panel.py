# SPDX-License-Identifier: GPL-3.0-or-later
"""What is above the steps: the way into the workspace, and the next step with its button."""

import bpy

from ...scene import alignment, migration, places, proposal, sightings, store, videos
from ...view import workspace
from ...view.panel import RockfallPanel, paragraph

PICK_TOOL = ("wm.tool_set_by_id", "Pick Impacts", "CURSOR")

type Button = tuple[str, str, str]
"""Operator, text (empty: the operator's own), icon."""


class ROCKFALL_PT_start(RockfallPanel, bpy.types.Panel):
    bl_label = "Start"
    bl_idname = "ROCKFALL_PT_start"
    bl_options = {"HIDE_HEADER"}

    def draw(self, context: bpy.types.Context) -> None:
        layout = self.layout
        if not workspace.is_open(context):
            layout.operator("rockfall.open_workspace", text="Open Workspace", icon="WORKSPACE")
        sentence, buttons = next_step(context.scene)
        paragraph(context, layout, sentence, "RIGHTARROW")
        column = layout.column(align=True)
        column.scale_y = 1.4
        for identifier, text, icon in buttons:
            button = column.operator(identifier, icon=icon, **({"text": text} if text else {}))
            if identifier == "wm.tool_set_by_id":
                button.name = workspace.PICK_TOOL


def next_step(scene: bpy.types.Scene) -> tuple[str, list[Button]]:
    """One sentence about what to do next, and the buttons for it."""
    if migration.is_newer(scene):
        return migration.warning(scene), []
    camera = videos.active_camera(scene)
    picks = store.with_role(scene, store.PICK_ROLE)
    if not store.with_role(scene, store.TERRAIN_ROLE) and not picks:
        return "Import your scan, or begin with a demo.", [
            ("rockfall.load_footage_demo", "", "FILE_MOVIE"),
            ("rockfall.load_demo", "", "PLAY"),
            ("rockfall.import_terrain", "", "IMPORT"),
            ("rockfall.open_project", "", "FILE_FOLDER"),
        ]
    if camera is None and not picks:
        return "Add the videos of the fall, or import a table of timed picks.", [
            ("rockfall.add_video", "", "FILE_MOVIE"),
            ("rockfall.import_picks", "", "IMPORT"),
        ]
    if camera is not None and not videos.is_solved(camera):
        said = alignment.hint(scene, camera)
        return said or "Align the camera: mark the same places in the footage and on the terrain.", [
            ("rockfall.align_views", "", "SPLIT_VERTICAL")
        ]
    if not picks:
        return _begin_picking(scene, camera)
    found = proposal.read(scene)
    if found is not None:
        fit = f"Refined: {found.before_px:.2f} px from the tracked pixels before, {found.after_px:.2f} px after."
        return f"{fit} The new flights are light blue in the free view; step 5 has the numbers.", [
            ("rockfall.apply_refinement", "Apply", "CHECKMARK"),
            ("rockfall.discard_refinement", "Discard", "X"),
        ]
    refined = all(store.NORMAL in pick for pick in picks if pick.get(store.KIND) != "pass")
    if camera is not None and not refined and not proposal.lacking(scene):
        return "Look at each pick and correct it. Refine fits them all to the tracked pixels.", [
            PICK_TOOL,
            ("rockfall.refine", "", "SHADERFX"),
        ]
    return "Play the fall; then models, film and tables: steps 6 to 9.", [
        ("screen.animation_play", "Play or Pause", "PLAY"),
        ("rockfall.export_tables", "", "EXPORT"),
    ]


def _begin_picking(scene: bpy.types.Scene, camera: bpy.types.Object) -> tuple[str, list[Button]]:
    if len(sightings.seen_in(camera, places.trajectory(scene))):
        return "The block is tracked. Propose its impacts, or click the block at each (step with ← →).", [
            ("rockfall.propose_impacts", "", "OUTLINER_OB_LIGHTPROBE"),
            PICK_TOOL,
        ]
    return "Step to an impact with ← →, and click the block there. Each further impact adds a flight.", [PICK_TOOL]


CLASSES = (ROCKFALL_PT_start,)
