# SPDX-License-Identifier: GPL-3.0-or-later
"""Below step 4: the spin of the block, its marks, and what they do not tell."""

import bpy

from ....core.reconstruction.spin_marks import AXIS_WORDS
from ...scene import places, spins, store, videos
from ...scene.spins import Measured
from ...view.panel import RockfallPanel, advise, facts, field, paragraph
from .operators import AXIS_NAMES, SpinTool

MOST_MARKS = 12
MOST_RATES = 4
LEAST_COUNTED = 1e-3  # a count of 0 is none


class ROCKFALL_PT_spin(RockfallPanel, bpy.types.Panel):
    bl_label = "Spin of the Block"
    bl_idname = "ROCKFALL_PT_spin"
    bl_parent_id = "ROCKFALL_PT_picks"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return SpinTool.is_needed(context)

    def draw(self, context: bpy.types.Context) -> None:
        layout, scene = self.layout, context.scene
        name = places.trajectory(scene)
        layout.operator("wm.tool_set_by_id", text="Mark Spin", icon="FILE_REFRESH").name = SpinTool.bl_idname
        field(layout, "Trajectory").prop(scene.rockfall_picking, "trajectory", text="")
        said = {camera.name: spins.uncountable(scene, camera, name) for camera in videos.cameras(scene)}
        for video, text in said.items():
            if text:
                paragraph(context, layout, text if len(said) == 1 else f"{video}: {text}", "ERROR")
        marked = [camera for camera in videos.cameras(scene) if name in spins.names_in(camera)]
        if not marked:
            text = f"Click the same point of {name} in two pictures or more of one flight: an edge, a stain."
            advise(context, layout, False, text)
            return
        row = field(layout, "Axis")
        for axis, label in AXIS_NAMES.items():
            row.operator("rockfall.set_spin_axis", text=label, depress=axis == spins.axis_of(scene, name)).axis = axis
        if spins.is_stale(scene, name):
            paragraph(context, layout, "A camera or clock has changed since the spin was measured.", "ERROR")
            layout.operator("rockfall.measure_spin", icon="FILE_REFRESH")
        for text in spins.homeless(scene, name):
            paragraph(context, layout, text, "ERROR")
        for obj, one in spins.of_trajectory(scene, name):
            _draw_flight(context, layout.box(), obj, one)
        for camera in marked:
            _draw_marks(layout, camera, name)
        layout.operator("rockfall.clear_spin_marks", icon="X")


def _draw_flight(context: bpy.types.Context, box: bpy.types.UILayout, obj: bpy.types.Object, one: Measured) -> None:
    marks = "1 mark" if one.marks == 1 else f"{one.marks} marks"
    box.label(text=f"Flight {one.flight}: {marks}", icon="CHECKMARK" if one.is_known else "RADIOBUT_OFF")
    if one.is_known:
        facts(box, spins.words(obj))
        paragraph(context, box, f"Axis: {AXIS_WORDS[one.axis]}.")
    for text in one.remarks:
        paragraph(context, box, text, "ERROR" if one.verdict != "counted" else "INFO")
    if one.others:
        row = box.row(align=True)
        shown = one.others if not one.is_known else ()
        for rate in shown[:MOST_RATES]:
            button = row.operator("rockfall.count_turns", text=f"{round(rate, 1) + 0.0:.1f} /s")
            button.turns_per_s = rate if abs(rate) > LEAST_COUNTED else LEAST_COUNTED
            button.flight = one.flight
        box.operator("rockfall.count_turns", text="Counted …").flight = one.flight


def _draw_marks(layout: bpy.types.UILayout, camera: bpy.types.Object, name: str) -> None:
    """The pictures of the marks: a click goes there, the cross removes it."""
    frames = spins.marks_in(camera, name).frame.tolist()
    column = layout.column(align=True)
    for frame in frames[:MOST_MARKS]:
        row = column.row(align=True)
        there = row.operator("rockfall.go_to_spin_mark", text=f"{camera.name}, picture {frame}", icon="TIME")
        gone = row.operator("rockfall.remove_spin_mark", text="", icon="X")
        for button in (there, gone):
            button.video, button.frame = camera[store.ID], frame
    if len(frames) > MOST_MARKS:
        column.label(text=f"and {len(frames) - MOST_MARKS} more")


CLASSES = (ROCKFALL_PT_spin,)
