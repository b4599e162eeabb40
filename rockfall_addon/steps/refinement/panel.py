# SPDX-License-Identifier: GPL-3.0-or-later
"""Step 5: refinement, before and after."""

import bpy

from ...scene import refinement, store
from ...view.panel import RockfallPanel, State, advise, facts, paragraph

MOST_ROWS = 12


class ROCKFALL_PT_refinement(RockfallPanel, bpy.types.Panel):
    bl_label = "5  Refinement"
    bl_idname = "ROCKFALL_PT_refinement"
    bl_options = {"DEFAULT_CLOSED"}

    @staticmethod
    def step_state(context: bpy.types.Context) -> State:
        if refinement.ready(context.scene):
            return "TO_DO"
        return "ATTENTION" if context.scene.get(store.PROPOSAL) else "READY"  # it waits for a decision

    def draw(self, context: bpy.types.Context) -> None:
        layout, scene = self.layout, context.scene
        settings = scene.rockfall_picking
        lacking = refinement.ready(scene)
        found = refinement.proposal(scene)
        if lacking:
            advise(context, layout, False, lacking[0])
        elif found is None:
            advise(context, layout, True, "Fit the picks' places and times to where the block was seen.")
        column = layout.column()
        column.active = not lacking
        column.row().prop(settings, "scope", expand=True)
        column.label(text="Also fit:")
        grid = column.grid_flow(columns=2, align=True, even_columns=True)
        grid.prop(settings, "free")
        layout.operator("rockfall.refine", icon="SHADERFX")
        if found is not None:
            _draw_proposal(context, layout, found)


def _draw_proposal(context: bpy.types.Context, layout: bpy.types.UILayout, found: dict) -> None:
    box = layout.box()
    if found["stale"]:
        paragraph(context, box, "The picks were changed since: refine again.", "ERROR")
    row = box.row()
    row.label(text="")
    row.label(text="Before")
    row.label(text="After")
    row = box.row()
    row.label(text="Residual")
    row.label(text=f"{found['before_px']:.2f} px")
    row.label(text=f"{found['after_px']:.2f} px")
    facts(box, [("Pixels", f"{found['pixels']}, {found['outliers']} outliers")])
    if len(found["by_video"]) > 1:
        facts(box, [(name, f"{px:.2f} px") for name, px in found["by_video"].items()])
    facts(box, [(name, f"{value:.5g} ± {sigma:.2g}") for name, value, sigma in found["unknowns"]])
    column = box.column(align=True)
    head = column.split(factor=0.5)
    head.label(text="Pick moves by")
    for text in ("cm", "ms"):
        head.label(text=text)
    for label, shift, later, sigma_m, sigma_s in found["picks"][:MOST_ROWS]:
        row = column.split(factor=0.5)
        row.label(text=label)
        row.label(text=f"{shift:.0f} ± {sigma_m:.0f}")
        row.label(text=f"{later:+.0f} ± {sigma_s:.0f}")
    if len(found["picks"]) > MOST_ROWS:
        column.label(text=f"… and {len(found['picks']) - MOST_ROWS} more")
    for sentence in found["advice"]:
        paragraph(context, box, sentence, "INFO")
    paragraph(context, box, "The proposed flights are drawn in light blue.")
    row = box.row(align=True)
    row.operator("rockfall.apply_refinement", text="Apply", icon="CHECKMARK")
    row.operator("rockfall.discard_refinement", text="Discard", icon="X")


CLASSES = (ROCKFALL_PT_refinement,)
