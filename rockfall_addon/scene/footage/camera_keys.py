# SPDX-License-Identifier: GPL-3.0-or-later
"""The path of a camera as keyframes of its object."""

import bpy
import numpy as np
from bpy_extras import anim_utils
from mathutils import Matrix

from ....core.vectors import Array

LINEAR = 1
"""As the interpolation of keys is numbered."""


def write(camera: bpy.types.Object, frames: Array, matrices: Array) -> None:
    """Place a camera: matrices (k, 4, 4) of the world, keyed at the scene's frames (k,) when there are several."""
    clear_keys(camera)
    camera.rotation_mode = "QUATERNION"
    camera.matrix_world = Matrix(matrices[0].tolist())
    if len(matrices) < 2:
        return
    turns = np.array([Matrix(matrix.tolist()).to_quaternion() for matrix in matrices])
    for i in range(1, len(turns)):  # q and −q are the same rotation, but not on the way between two
        if turns[i] @ turns[i - 1] < 0:
            turns[i] *= -1
    action = bpy.data.actions.new(camera.name)
    data = camera.animation_data_create()
    data.action = action
    slot = action.slots.new(id_type="OBJECT", name=camera.name)
    data.action_slot = slot
    bag = anim_utils.action_ensure_channelbag_for_slot(action, slot)
    for path, values in (("location", matrices[:, :3, 3]), ("rotation_quaternion", turns)):
        for index in range(values.shape[1]):
            curve = bag.fcurves.new(path, index=index)
            points = curve.keyframe_points
            points.add(len(frames))
            points.foreach_set("co", np.column_stack([frames, values[:, index]]).astype(np.float32).ravel())
            points.foreach_set("interpolation", np.full(len(frames), LINEAR, np.int32))
            curve.update()


def clear_keys(camera: bpy.types.Object) -> None:
    """Remove the keys, and their action when nothing else uses it."""
    data = camera.animation_data
    if data is None or data.action is None:
        return
    action = data.action
    data.action = None
    if not action.users:
        bpy.data.actions.remove(action)
