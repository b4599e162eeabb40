# SPDX-License-Identifier: GPL-3.0-or-later
"""Picks that are set aside, from what shows them: the marker's place, its key, its look, and its collection."""

import bpy
import numpy as np

from ....core.reconstruction.picks import KINDS
from ..footage import timing
from ..picks import keyframes
from . import set_aside, store
from .stored_values import OF_A_PICK

RECOVERED = "doubtful"
"""What a recovered pick is: its place and time are single precision, and nobody has looked at it."""


def recover(scene: bpy.types.Scene) -> tuple[int, list[str]]:
    """Give the picks that are set aside what their markers show; what they had stays among what is set aside.

    Returns
    -------
    How many are picks again, and the names of those that are not.
    """
    asked = set_aside.of_picks(scene)
    for obj in asked:
        _recover(scene, obj)
    set_aside.look(scene, [])
    left = [obj.name for obj in set_aside.of_picks(scene)]
    return len(asked) - len(left), left


def _recover(scene: bpy.types.Scene, obj: bpy.types.Object) -> None:
    bad = [key for key, check in OF_A_PICK.items() if check(obj.get(key))]
    for key in bad:
        value = _shown(scene, obj, key)
        if value is not None:
            set_aside.keep(obj, key)
            obj[key] = value
    if bad != [store.TRAJECTORY] and obj.get(store.STATUS) == "ok":
        obj[store.STATUS] = RECOVERED


def _shown(scene: bpy.types.Scene, obj: bpy.types.Object, key: str) -> object | None:
    """The value of a key as the marker shows it; None where it does not."""
    if key == store.TRAJECTORY:
        return next(filter(None, (folder.get(store.COLLECTION_NAME) for folder in obj.users_collection)), None)
    if key == store.TIME:
        return _time(scene, obj)
    if key == store.POSITION:
        return [float(value) for value in obj.location] if np.isfinite(obj.location).all() else None
    if key == store.KIND:
        words = obj.data.name.split(".")[0].split() if obj.data is not None else []
        return words[-1] if words and words[-1] in KINDS else None
    return RECOVERED


def _time(scene: bpy.types.Scene, obj: bpy.types.Object) -> float | None:
    """The clock time of its key [s]."""
    points = next((curve.keyframe_points for curve in keyframes.location_curves(obj)), ())
    offset = timing.kept_offsets(scene).get(str(obj.get(store.TRAJECTORY)))
    if not len(points) or offset is None or not np.isfinite(points[0].co[0]):
        return None
    return points[0].co[0] / timing.keyed_rate(scene) + offset
