# SPDX-License-Identifier: GPL-3.0-or-later
"""The selected impact's numbers."""

import math

import bpy

from ..bridge import state
from ..bridge.trajectories import RESULT_KEY
from .base import RockfallPanel, facts

FLAG_WORDS = {
    "first": "First of its chain: no incident velocity",
    "last": "Last of its chain: no restituted velocity",
    "departing": "Leaves the ground before the impact",
    "into_ground": "Restituted into the ground",
    "below_terrain": "Flight passes below the terrain",
    "gap": "The chain is cut here",
    "contact": "Rolls or slides before or after it",
}


class ROCKFALL_PT_impact(RockfallPanel, bpy.types.Panel):
    bl_label = "Selected Impact"
    bl_idname = "ROCKFALL_PT_impact"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return bool(state.with_role(context.scene, state.PICK_ROLE))

    def draw(self, context: bpy.types.Context) -> None:
        layout, pick = self.layout, context.object
        if pick is None or pick.get(state.ROLE_KEY) != state.PICK_ROLE:
            layout.label(text="Click a disc on the slope.", icon="RESTRICT_SELECT_OFF")
            return
        rows = [
            ("Trajectory", pick["rockfall_trajectory"]),
            ("Kind", f"{pick['rockfall_kind']}, {pick['rockfall_status']}"),
            ("Time", f"{pick['rockfall_time_s']:.3f} s"),
        ]
        result = pick.get(RESULT_KEY)
        if result is not None:
            rows += [
                ("Incident speed", _speed(result["incident_mps"])),
                ("Restituted speed", _speed(result["restituted_mps"])),
                ("R", _number(result["r"])),
                ("R_N", _number(result["rn"])),
                ("R_T", _number(result["rt"])),
                ("Impact angle θ₁", _number(result["theta1_deg"], "°", 1)),
                ("Deviation", _number(result["theta_dev_deg"], "°", 1)),
                ("Spread of normal", _number(result["normal_spread_deg"], "°", 1)),
            ]
        facts(layout, rows)
        for flag in filter(None, result["flags"].split(";") if result is not None else ()):
            layout.label(text=FLAG_WORDS.get(flag, flag), icon="INFO")
        layout.operator("rockfall.show_impact", icon="TIME")


def _speed(vector: object) -> str:
    return _number([math.hypot(*vector)], " m/s", 2)


def _number(values: object, unit: str = "", digits: int = 2) -> str:
    value = float(values[0])
    return "not defined" if math.isnan(value) else f"{value:.{digits}f}{unit}"


CLASSES = (ROCKFALL_PT_impact,)
