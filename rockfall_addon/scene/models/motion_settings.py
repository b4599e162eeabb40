# SPDX-License-Identifier: GPL-3.0-or-later
"""What the motion graphs show: quantities, and limits of the axes; kept with the scene."""

import json

import bpy
from bpy.props import BoolProperty, EnumProperty

from ....core.analysis.axes import Limits
from ....core.analysis.motion_graphs import (
    CLEARANCE,
    HEIGHT,
    KINETIC,
    QUANTITIES,
    RESIDUAL,
    SPEED,
    TOTAL,
    USUAL,
    Quantity,
)
from ..storage import store
from . import graph_settings

TIME = "time"
"""The name of the time axis among the limits."""

WORDS = {
    SPEED: ("Speed", "Speed of the block [m/s]"),
    HEIGHT: ("Height", "Vertical height of the block's underside above the ground [m]"),
    CLEARANCE: ("Distance", "Shortest distance of the block's underside from the ground [m]"),
    KINETIC: ("Energy", "Kinetic energy of the translation [kJ]"),
    TOTAL: ("With Rotation", "Kinetic energy with rotation, where the spin is known [kJ]"),
    RESIDUAL: ("Residual", "How far the tracked pixels lie from the computed motion [px]"),
}


def _changed(self: bpy.types.PropertyGroup, context: bpy.types.Context) -> None:
    graph_settings.redraw()


class MotionGraphProperties(bpy.types.PropertyGroup):
    """What the motion graphs show."""

    quantities: EnumProperty(
        name="Quantities", description="What is shown over the time; what is not known is left out",
        items=[(q.name, *WORDS[q], "NONE", 1 << i) for i, q in enumerate(QUANTITIES)],
        default={q.name for q in USUAL}, options={"ENUM_FLAG"}, update=_changed,
    )  # fmt: skip
    only_selected: BoolProperty(
        name="Selected Only", description="Show the selected trajectories alone", default=False, update=_changed
    )
    in_frames: BoolProperty(
        name="Frames", description="Number the time axis in frames of the scene instead of seconds", default=False,
        update=_changed,
    )  # fmt: skip


CLASSES = (MotionGraphProperties,)


def register() -> None:
    bpy.types.Scene.rockfall_motion = bpy.props.PointerProperty(type=MotionGraphProperties)


def unregister() -> None:
    del bpy.types.Scene.rockfall_motion


def asked(scene: bpy.types.Scene) -> tuple[Quantity, ...]:
    """The quantities that are to be shown."""
    return tuple(one for one in QUANTITIES if one.name in scene.rockfall_motion.quantities)


def limits_of(scene: bpy.types.Scene) -> dict[str, Limits]:
    """Time, or name of a quantity → the limits of its axis, where a person has chosen them."""
    kept = store.read_json(scene, store.MOTION_LIMITS, {})
    return {name: (low, high) for name, (low, high) in kept.items()}


def keep_limits(scene: bpy.types.Scene, limits: dict[str, Limits]) -> None:
    """Store them: as text, which keeps every digit."""
    scene[store.MOTION_LIMITS] = json.dumps(limits)
