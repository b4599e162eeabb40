# SPDX-License-Identifier: GPL-3.0-or-later
"""Seconds and frames: scene frame 0 is display time 0, whatever the scene's frame rate is.

*Clock* time is that of the picks. *Display* time is what the scene plays: either the clock itself from the first pick
on, or all blocks started together, one after the other by a fixed delay.
"""

import bpy
import numpy as np
from numpy.typing import NDArray

from ...core.reconstruction.picks import Picks
from . import state


def frame_rate(scene: bpy.types.Scene) -> float:
    """Frames per second of the scene, with its base (30 000 / 1 001)."""
    return scene.render.fps / scene.render.fps_base


def display_offsets(picks: Picks, real_time: bool, stagger_s: float) -> dict[str, float]:
    """What is subtracted from a trajectory's clock time to get its display time [s]."""
    names = list(dict.fromkeys(picks.trajectory.tolist()))
    first = {name: float(picks.time_s[picks.trajectory == name].min()) for name in names}
    if real_time:
        origin = min(first.values(), default=0.0)
        return dict.fromkeys(names, origin)
    return {name: first[name] - i * stagger_s for i, name in enumerate(names)}


def follow_frame_rate(scene: bpy.types.Scene) -> bool:
    """Move all our keys to where their times are at the scene's present frame rate; True when they had to move."""
    rate, keyed = frame_rate(scene), float(scene.get(state.KEYED_RATE_KEY, 0.0))
    if not keyed or abs(rate - keyed) < 1e-9:
        return False
    factor = rate / keyed
    roles = (state.BLOCK_ROLE, state.PICK_ROLE, state.TWIN_ROLE)
    objects = [thing for role in roles for thing in state.with_role(scene, role)]
    actions = {o.animation_data.action for o in objects if o.animation_data and o.animation_data.action}
    for action in actions:
        for layer in action.layers:
            for strip in layer.strips:
                for bag in strip.channelbags:
                    for curve in bag.fcurves:
                        _stretch(curve, factor)
    scene[state.KEYED_RATE_KEY] = rate
    scene.frame_end = max(1, round(scene.frame_end * factor))
    return True


def _stretch(curve: bpy.types.FCurve, factor: float) -> None:
    points = curve.keyframe_points
    for part in ("handle_left", "handle_right", "co"):
        values: NDArray = np.empty(2 * len(points), dtype=np.float32)
        points.foreach_get(part, values)
        values[0::2] *= factor
        points.foreach_set(part, values)
    curve.update()
