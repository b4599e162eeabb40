# SPDX-License-Identifier: GPL-3.0-or-later
"""Seconds and frames: scene frame 0 is display time 0, whatever the scene's frame rate is.

*Clock* time is that of the picks. *Display* time is what the scene plays: either the clock itself from its origin on
(that of the project, or the first pick), or all blocks started together, one after the other by a fixed delay.
"""

import json

import bpy
import numpy as np
from numpy.typing import NDArray

from ....core.reconstruction.picks import Picks
from ..picks import block_keys
from ..storage import keepers, store


def frame_rate(scene: bpy.types.Scene) -> float:
    """Frames per second of the scene, with its base (30 000 / 1 001)."""
    return scene.render.fps / scene.render.fps_base


def keyed_rate(scene: bpy.types.Scene) -> float:
    """Frames per second for which our keys are written; differs from `frame_rate` until they have followed a change."""
    return float(scene.get(store.KEYED_RATE, 0.0)) or frame_rate(scene)


def display_offsets(picks: Picks, real_time: bool, stagger_s: float, origin_s: float | None = None) -> dict[str, float]:
    """What is subtracted from a trajectory's clock time to get its display time [s].

    origin_s : clock time of display time 0 in real time; None takes the first pick.
    """
    names = list(dict.fromkeys(picks.trajectory.tolist()))
    first = {name: float(picks.time_s[picks.trajectory == name].min()) for name in names}
    if real_time:
        return dict.fromkeys(names, min(first.values(), default=0.0) if origin_s is None else origin_s)
    return {name: first[name] - i * stagger_s for i, name in enumerate(names)}


def origin_s(scene: bpy.types.Scene) -> float | None:
    """Clock time of display time 0 when the scene plays as filmed; None when it is the first pick's."""
    return float(scene[store.TIME_ORIGIN]) if store.TIME_ORIGIN in scene else None


def offsets_of(scene: bpy.types.Scene, picks: Picks) -> dict[str, float]:
    """`display_offsets` as the scene's settings want them."""
    settings = scene.rockfall
    return display_offsets(picks, settings.playback == "REAL", settings.stagger_s, origin_s(scene))


def shown_offsets(scene: bpy.types.Scene, picks: Picks) -> dict[str, float]:
    """The offsets with which the trajectories are shown."""
    return offsets_of(scene, picks) | kept_offsets(scene)


def kept_offsets(scene: bpy.types.Scene) -> dict[str, float]:
    """The offsets with which the scene's keys were written."""
    return store.read_json(scene, store.OFFSETS, {})


def keep_offsets(scene: bpy.types.Scene, offsets: dict[str, float]) -> None:
    """Remember them: as text, since a trajectory's name may be longer than Blender's names."""
    scene[store.OFFSETS] = json.dumps(offsets)


def offset_of(scene: bpy.types.Scene, trajectory: str, first_s: float) -> float:
    """The offset of one trajectory, which stays while its picks are edited; a new trajectory gets and keeps one.

    first_s : clock time of its first pick [s].
    """
    offsets = kept_offsets(scene)
    if trajectory not in offsets:
        settings, origin = scene.rockfall, origin_s(scene)
        if settings.playback == "REAL":
            offsets[trajectory] = next(iter(offsets.values()), first_s) if origin is None else origin
        else:
            offsets[trajectory] = first_s - len(offsets) * settings.stagger_s
        keep_offsets(scene, offsets)
    return offsets[trajectory]


def follow_frame_rate(scene: bpy.types.Scene) -> bool:
    """Move all our keys to where their times are at the scene's present frame rate; True when they had to move."""
    rate, keyed = frame_rate(scene), float(scene.get(store.KEYED_RATE, 0.0))
    if not keyed or abs(rate - keyed) < 1e-9:
        return False
    factor = rate / keyed
    roles = (store.BLOCK_ROLE, store.PICK_ROLE, store.MODEL_BLOCK_ROLE)
    elsewhere = keepers.kept_elsewhere(scene)
    objects = [obj for role in roles for obj in store.with_role(scene, role) if obj not in elsewhere]
    actions = {o.animation_data.action for o in objects if o.animation_data and o.animation_data.action}
    for action in actions:
        for layer in action.layers:
            for strip in layer.strips:
                for bag in strip.channelbags:
                    for curve in bag.fcurves:
                        _stretch(curve, factor)
    for obj in objects:
        if obj[store.ROLE] == store.PICK_ROLE and store.KEY_FRAME in obj:
            obj[store.KEY_FRAME] *= factor
        elif obj[store.ROLE] == store.BLOCK_ROLE:
            block_keys.stretch(obj, factor)
    scene[store.KEYED_RATE] = rate
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
