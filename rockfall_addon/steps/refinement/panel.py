# SPDX-License-Identifier: GPL-3.0-or-later
"""Step 5: refinement, before and after."""

import bpy

from ...scene.picks import proposal
from ...scene.picks.proposal import Proposal
from ...view import job
from ...view.panel import RockfallPanel, State, advise, facts, is_grave, numbers, paragraph, show_remarks

MOST_ROWS = 12


class ROCKFALL_PT_refinement(RockfallPanel, bpy.types.Panel):
    bl_label = "5  Refinement"
    bl_idname = "ROCKFALL_PT_refinement"
    bl_options = {"DEFAULT_CLOSED"}

    @staticmethod
    def step_state(context: bpy.types.Context) -> State:
        if proposal.lacking(context.scene):
            return "TO_DO"
        if proposal.is_there(context.scene):
            return "ATTENTION"  # it waits for a decision
        return "READY" if proposal.is_applied(context.scene) else "TO_DO"

    def draw(self, context: bpy.types.Context) -> None:
        layout, scene = self.layout, context.scene
        settings = scene.rockfall_picking
        lacking = proposal.lacking(scene)
        found = proposal.read(scene)
        if lacking:
            advise(context, layout, False, lacking)
        elif found is None:
            advise(context, layout, True, "Fit the picks' places and times to where the block was seen.")
        column = layout.column()
        column.active = not lacking
        column.row().prop(settings, "scope", expand=True)
        column.label(text="Also fit:")
        grid = column.grid_flow(columns=2, align=True, even_columns=True)
        grid.prop(settings, "free")
        layout.operator("rockfall.refine", icon="SHADERFX")
        job.draw(context, layout, "refinement")
        if found is not None:
            _draw_proposal(context, layout, found)


def _draw_proposal(context: bpy.types.Context, layout: bpy.types.UILayout, found: Proposal) -> None:
    box = layout.box()
    if found.stale:
        paragraph(context, box, "The picks were changed since: refine again.", "ERROR")
    else:
        paragraph(context, box, "Nothing is changed yet: apply it, or discard it.", "ERROR")
    grave = [remark for remark in found.remarks if is_grave(remark)]
    show_remarks(context, box, grave)
    for texts in (("", "Before", "After"), ("Residual", f"{found.before_px:.2f} px", f"{found.after_px:.2f} px")):
        row = box.row()
        for text in texts:
            row.label(text=text)
    facts(box, [("Pixels", f"{found.pixels}, {found.outliers} outliers")])
    if len(found.by_video) > 1:
        facts(box, [(name, f"{px:.2f} px") for name, px in found.by_video.items()])
    facts(box, [(name, f"{value:.5g} ± {sigma:.2g}") for name, value, sigma in found.unknowns])
    column = box.column(align=True)
    head = column.split(factor=0.5)
    head.label(text="Pick moves by")
    for text in ("cm", "ms"):
        head.label(text=text)
    for change in found.changes[:MOST_ROWS]:
        row = column.split(factor=0.5)
        row.label(text=change.label)
        row.label(text=f"{change.moved_cm:.0f} ± {change.sigma_cm:.0f}")
        row.label(text=f"{change.later_ms:+.0f} ± {change.sigma_ms:.0f}")
    if len(found.changes) > MOST_ROWS:
        column.label(text=f"… and {len(found.changes) - MOST_ROWS} more")
    _draw_table(box, ("What if: at most", "Speed", "R"), found.what_if)
    _draw_table(box, ("Not detectable below", "", "Speed"), found.unnoticed)
    show_remarks(context, box, [remark for remark in found.remarks if remark not in grave])
    paragraph(context, box, "The proposed flights are drawn in light blue.")
    row = box.row(align=True)
    row.operator("rockfall.apply_refinement", text="Apply", icon="CHECKMARK")
    row.operator("rockfall.discard_refinement", text="Discard", icon="X")


def _draw_table(layout: bpy.types.UILayout, head: tuple[str, str, str], rows: tuple[tuple[str, str, str], ...]) -> None:
    """The greatest effect of a changed input, or the errors of what is stated that are not detectable."""
    if not rows:
        return
    column = layout.column(align=True)
    for name, *values in (head, *rows):
        numbers(column, name, values, 0.5)


CLASSES = (ROCKFALL_PT_refinement,)
