# SPDX-License-Identifier: GPL-3.0-or-later
"""When a block is there: from its first pick on, and after its last one only when it has come to rest."""

import bpy

from ...scene.footage import timing
from ...scene.storage import store
from .motions import Motion

LINGER_S = 0.4
HIDING = ("hide_render", "hide_viewport")


def show_while_moving(scene: bpy.types.Scene, motions: list[Motion]) -> None:
    """Key the visibility of the blocks."""
    rate = timing.frame_rate(scene)
    at_rest = resting(scene)
    for obj in store.with_role(scene, store.BLOCK_ROLE):
        motion = next((each for each in motions if each.name == obj[store.TRAJECTORY]), None)
        if motion is None:
            continue
        start, end = float(motion.time_s[0]) * rate, float(motion.time_s[-1] + LINGER_S) * rate
        keys = [(min(-1.0, start - 1.0), True), (start, False)]
        if motion.name not in at_rest:
            keys.append((end, True))
        for name in HIDING:
            for frame, hidden in keys:
                setattr(obj, name, hidden)
                obj.keyframe_insert(name, frame=frame)


def show_always(scene: bpy.types.Scene) -> None:
    """Take the keys away."""
    for obj in store.with_role(scene, store.BLOCK_ROLE):
        for name in HIDING:
            _remove_curve(obj, name)
            setattr(obj, name, False)


def resting(scene: bpy.types.Scene) -> set[str]:
    """Trajectories whose last pick is a stop."""
    last: dict[str, bpy.types.Object] = {}
    for obj in store.with_role(scene, store.PICK_ROLE):
        name = obj[store.TRAJECTORY]
        if name not in last or obj[store.TIME] > last[name][store.TIME]:
            last[name] = obj
    return {name for name, obj in last.items() if obj[store.KIND] == "stop"}


def _remove_curve(obj: bpy.types.Object, name: str) -> None:
    action = obj.animation_data.action if obj.animation_data else None
    for layer in action.layers if action else ():
        for strip in layer.strips:
            for bag in strip.channelbags:
                curve = bag.fcurves.find(name)
                if curve is not None:
                    bag.fcurves.remove(curve)
