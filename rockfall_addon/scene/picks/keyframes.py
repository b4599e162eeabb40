# SPDX-License-Identifier: GPL-3.0-or-later
"""Keyframes that are the trajectory itself.

Between two impacts a block's coordinates are polynomials of degree two in time, and a cubic Bézier segment whose
handles lie at the thirds represents them exactly. So a key at each impact (at its sub-frame time) with handles from the
velocities gives the exact parabola at every frame and at any frame rate.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import bpy
import numpy as np

from ....core.reconstruction.flight import Flights, flight_states
from ....core.vectors import Array
from ..storage import store

DRAG_KEY_STEP_S = 0.1  # with drag the cubic is an approximation: Hermite's error at this step is below 0.1 mm
JUMP_FRAMES = 1e-3
SAME_TIME_S, SAME_PLACE_M, SAME_PLACE_SHARE = 1e-9, 1e-6, 1e-5
"""A segment that starts as near to the end of the one before goes on from it; the share is of the coordinates."""
MANY_ACTIONS = 100
"""More new actions than this are copies of one, and named like it."""
OF_MANY_PICKS, OF_MANY_BLOCKS = "Key of pick", "Keys of block"
"""Their names. Blender seeks the place of each from the end of the alphabet, and blocks get theirs after the picks."""
CONSTANT, BEZIER = 0, 2  # as the interpolation of keys is numbered


@dataclass(frozen=True, eq=False)
class Keys:
    """Keyframes of a motion: times (k,) [s], positions (k, 3) [m], velocities before and after each key (k, 3) [m/s],
    and whether the motion is undefined after a key (held until the next)."""

    time_s: Array
    position: Array
    velocity_before: Array
    velocity_after: Array
    held: np.ndarray


def motion_keys(flights: Flights, which: Array, offset: Array | float = 0.0) -> Keys:
    """Keys of the consecutive motion segments `which` (k,) of one trajectory.

    offset : (3,) [m] added to the positions, from the surface to the block's centre.
    """
    which = np.asarray(which, dtype=int)
    knots = [_knots(flights, index) for index in which]
    ends = np.cumsum([len(each) for each in knots])
    clock = np.concatenate([np.zeros(0), *knots])
    states = flight_states(flights, np.repeat(which, [len(each) for each in knots]), clock)
    times, positions, before, after, held = [], [], [], [], []
    for own, position, velocity in zip(knots, *(np.split(each, ends[:-1]) for each in states), strict=True):
        joined = bool(times) and abs(times[-1] - own[0]) < SAME_TIME_S and _same_place(positions[-1], position[0])
        if joined:
            after[-1], held[-1] = velocity[0], False
        elif times:
            held[-1] = True
        new = slice(1 if joined else 0, None)
        times += own[new].tolist()
        positions += list(position[new])
        before += list(velocity[new])
        after += list(velocity[new])
        held += [False] * len(own[new])
    return Keys(
        np.array(times),
        np.array(positions).reshape(-1, 3) + offset,
        np.array(before).reshape(-1, 3),
        np.array(after).reshape(-1, 3),
        np.array(held, dtype=bool),
    )


def _knots(flights: Flights, index: int) -> Array:
    """(m,) times of the keys of one segment [s]."""
    start, end = flights.start_time_s[index], flights.end_time_s[index]
    pieces = 1 if flights.drag_per_m[index] == 0 else max(1, int(np.ceil((end - start) / DRAG_KEY_STEP_S)))
    return np.linspace(start, end, pieces + 1)


def _same_place(one: Array, other: Array) -> bool:
    """Whether two places (3,) differ by no more than rounding."""
    return bool((np.abs(one - other) <= SAME_PLACE_M + SAME_PLACE_SHARE * np.abs(other)).all())


def write_location_keys(
    obj: bpy.types.Object,
    keys: Keys,
    rate: float,
    *,
    in_place: bool = False,
    like: bpy.types.Action | None = None,
) -> bool:
    """Replace an object's location curves by these keys, at frame = time × rate.

    in_place : write only when the number of keys stays the same, so that no key is freed while a person drags keys.
    like : an action that is copied where there is none; among thousands Blender takes long for a new one.

    Returns
    -------
    Whether the keys were written.
    """
    frames = keys.time_s * rate
    same = np.flatnonzero(np.diff(frames) < JUMP_FRAMES) + 1  # a jump: two positions at one time
    frames[same] += JUMP_FRAMES
    count = len(frames)
    if in_place and [len(curve.keyframe_points) for curve in location_curves(obj)] != [count] * 3:
        return False
    co = np.empty((3, count, 2), dtype=np.float64)
    co[:, :, 0], co[:, :, 1] = frames, keys.position.T
    third = np.diff(frames) / 3
    left, right = co.copy(), co.copy()
    right[:, :-1, 0] += third
    right[:, :-1, 1] += third / rate * keys.velocity_after[:-1].T
    left[:, 1:, 0] -= third
    left[:, 1:, 1] -= third / rate * keys.velocity_before[1:].T
    co, left, right = (values.astype(np.float32).reshape(3, -1) for values in (co, left, right))  # as Blender has them
    free = np.zeros(count, dtype=np.int32)
    interpolation = np.where(keys.held, CONSTANT, BEZIER).astype(np.int32)
    bag = _channelbag(obj, like)
    for axis in range(3):
        curve = bag.fcurves.find("location", index=axis) or bag.fcurves.new("location", index=axis)
        points = curve.keyframe_points
        if len(points) != count:
            points.clear()
            points.add(count)
        points.foreach_set("co", co[axis])
        points.foreach_set("handle_left_type", free)
        points.foreach_set("handle_right_type", free)
        points.foreach_set("handle_left", left[axis])
        points.foreach_set("handle_right", right[axis])
        points.foreach_set("interpolation", interpolation)
        curve.update()
    return True


def write_visibility_keys(obj: bpy.types.Object, spans_s: Sequence[tuple[float, float]], rate: float) -> None:
    """Hide an object except from the start to the end of each span [s]; the spans follow each other."""
    bag = _channelbag(obj)
    changes = [(-1.0, 1.0)] + [change for start, end in spans_s for change in ((start, 0.0), (end, 1.0))]
    changes[0] = (min(-1.0, changes[1][0] - 1.0) if spans_s else -1.0, 1.0)
    co = (np.array(changes) * (rate, 1.0)).astype(np.float32).ravel()
    for name in ("hide_viewport", "hide_render"):
        curve = bag.fcurves.find(name) or bag.fcurves.new(name)
        points = curve.keyframe_points
        if len(points) != len(changes):
            points.clear()
            points.add(len(changes))
        points.foreach_set("co", co)
        points.foreach_set("interpolation", np.full(len(changes), CONSTANT, dtype=np.int32))
        curve.update()


def key_location_once(obj: bpy.types.Object, frame: float, like: bpy.types.Action | None = None) -> None:
    """One key at a (sub-)frame: the place and the time of a pick.

    like : see `write_location_keys`.
    """
    bag = _channelbag(obj, like)
    for axis in range(3):
        curve = bag.fcurves.find("location", index=axis) or bag.fcurves.new("location", index=axis)
        points = curve.keyframe_points
        if len(points) == 1:
            points[0].co = (frame, obj.location[axis])
        else:
            points.clear()
            points.insert(frame, obj.location[axis], options={"FAST"})
        curve.update()


def action_of(obj: bpy.types.Object) -> bpy.types.Action | None:
    """What holds the keys of an object."""
    return obj.animation_data.action if obj.animation_data is not None else None


def to_be_copied(obj: bpy.types.Object, name: str) -> bpy.types.Action:
    """The action of an object, named for all that will be copied from it."""
    action = obj.animation_data.action
    action.name = name
    return action


def location_curves(obj: bpy.types.Object) -> list[bpy.types.FCurve]:
    """The curves that move an object, as many as there are."""
    action = action_of(obj)
    if action is None or not action.layers or not action.layers[0].strips or obj.animation_data.action_slot is None:
        return []
    bag = action.layers[0].strips[0].channelbag(obj.animation_data.action_slot)
    found = [bag.fcurves.find("location", index=axis) for axis in range(3)] if bag is not None else []
    return [curve for curve in found if curve is not None]


def _channelbag(obj: bpy.types.Object, like: bpy.types.Action | None = None) -> bpy.types.ActionChannelbag:
    animation = obj.animation_data or obj.animation_data_create()
    if animation.action is None and like is not None:
        animation.action = like.copy()
    elif animation.action is None:
        name = f"{obj[store.TRAJECTORY]} pick" if obj.get(store.ROLE) == store.PICK_ROLE else obj.name  # no number
        action = bpy.data.actions.new(name)
        animation.action = action
        animation.action_slot = action.slots.new(id_type="OBJECT", name=name)
    elif animation.action.users - animation.action.use_fake_user > 1:  # of a linked duplicate
        animation.action = animation.action.copy()
    action, slot = animation.action, animation.action_slot
    if slot is None:
        slot = animation.action_slot = next(iter(action.slots), None) or action.slots.new("OBJECT", obj.name)
    layer = action.layers[0] if action.layers else action.layers.new("Layer")
    strip = layer.strips[0] if layer.strips else layer.strips.new(type="KEYFRAME")
    return strip.channelbag(slot, ensure=True)
