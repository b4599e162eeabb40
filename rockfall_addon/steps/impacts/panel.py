# SPDX-License-Identifier: GPL-3.0-or-later
"""The selected pick: what it is, to be edited, and the numbers of its impact with their errors."""

import math

import bpy

from ...scene.picks import impact_numbers, picks, spins
from ...scene.storage import store
from ...view import impact_words, pointing
from ...view.panel import RockfallPanel, facts, field, fields, paragraph

NUMBERS = (  # what is shown, key of the result, key of its standard deviation, unit, digits
    ("Incident speed", "incident_mps", "sigma_speed1", " m/s", 2),
    ("Restituted speed", "restituted_mps", "sigma_speed2", " m/s", 2),
    ("Energy before", "kinetic1_j", "sigma_kinetic1_j", " kJ", 2),
    ("Energy after", "kinetic2_j", "sigma_kinetic2_j", " kJ", 2),
    ("Height of bounce", "bounce_height_m", "", " m", 2),
    ("Height over chord", "chord_height_m", "", " m", 2),
    ("Spread of normal", "normal_spread_deg", "", "°", 1),
)
JUDGED = (  # with an interval, for the normal at the block's scale: what is shown, name, digits
    ("R", "r", 2),
    ("R_N", "rn", 2),
    ("R_T", "rt", 2),
    ("Impact angle θ₁", "theta1", 0),
    ("Deviation θ_dev", "theta_dev", 0),
)


class ROCKFALL_PT_impact(RockfallPanel, bpy.types.Panel):
    bl_label = "Selected Impact"
    bl_idname = "ROCKFALL_PT_impact"
    bl_order = 1  # before the steps: it is there while a pick is selected, and must be in sight then

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return pointing.active_pick(context) is not None

    def draw(self, context: bpy.types.Context) -> None:
        layout, pick = self.layout, pointing.active_pick(context)
        result = impact_numbers.of(pick)
        row = layout.row(align=True)
        row.label(text=f"{pick[store.TRAJECTORY]}, {impact_words.name(pick)}")
        row.operator("rockfall.show_impact", text="", icon="TIME")
        _draw_editable(layout, pick.rockfall_pick)
        if result is None:
            return
        judged = [(label, impact_words.between(result, *how) or "not defined") for label, *how in JUDGED]
        numbers = (_fact(result, *how) for how in NUMBERS)
        facts(layout, [*judged, *numbers, *_slide(context.scene, pick), *spins.words(pick)])
        reasons = impact_words.reasons(pick)
        for reason in reasons:
            paragraph(context, layout, reason, "ERROR")
        for said in map(impact_words.meaning, impact_numbers.flags(pick)):
            if said not in reasons:
                paragraph(context, layout, said, "INFO")
        if _lacks_errors(result):
            paragraph(context, layout, "Give a confidence, and the numbers get their errors.")


def _slide(scene: bpy.types.Scene, pick: bpy.types.Object) -> list[tuple[str, str]]:
    """How far and how long an impact with a take-off lasts."""
    run = picks.ordered(scene, picks.objects_of(scene, [pick[store.TRAJECTORY]]))
    later = run[run.index(pick) + 1 :]
    if not later or later[0][store.KIND] != "takeoff" or later[0].get(store.STATUS) == "discarded":
        return []
    far = math.dist(pick[store.POSITION], later[0][store.POSITION])
    return [("Until the take-off", f"{far:.2f} m, {1e3 * (later[0][store.TIME] - pick[store.TIME]):.0f} ms")]


def _draw_editable(layout: bpy.types.UILayout, editable: bpy.types.PropertyGroup) -> None:
    column = layout.column(align=True)
    fields(column, editable, ("kind", "status", "confidence", "note"))
    row = field(column, editable.bl_rna.properties["time_s"].name)
    row.prop(editable, "time_s", text="")
    for frames, icon in ((-0.1, "TRIA_LEFT"), (0.1, "TRIA_RIGHT")):
        row.operator("rockfall.nudge_pick_time", text="", icon=icon).frames = frames


def _fact(
    result: impact_numbers.Numbers, label: str, key: str, sigma_key: str, unit: str, digits: int
) -> tuple[str, str]:
    text = impact_words.with_sigma(result, key, sigma_key, 1e-3 if unit == " kJ" else 1.0, digits)
    return label, f"{text}{unit}" if text else "not defined"


def _lacks_errors(result: impact_numbers.Numbers) -> bool:
    """Whether a speed is known and its error is not."""
    sides = (("incident_mps", "sigma_speed1"), ("restituted_mps", "sigma_speed2"))
    return any(math.isfinite(result[speed][0]) and math.isnan(result[sigma]) for speed, sigma in sides)


CLASSES = (ROCKFALL_PT_impact,)
