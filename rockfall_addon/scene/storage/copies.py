# SPDX-License-Identifier: GPL-3.0-or-later
"""Copies of picks, and picks that come from another scene."""

import uuid

import bpy
import numpy as np

from ..footage import timing
from ..picks import picks
from ..terrain import georeference
from . import store


def heal(scene: bpy.types.Scene, objects: list[bpy.types.Object]) -> bool:
    """Copies of picks become picks of their own; picks from another scene come to this one's origin.

    Returns
    -------
    Whether there were any.
    """
    shift = georeference.read_shift(scene).vector
    changed = False
    seen: dict[str, bpy.types.Object] = {}
    for obj in sorted(objects, key=lambda one: one.session_uid):
        identifier = obj.get(store.ID)
        if identifier is None or identifier in seen:
            obj[store.ID], changed = uuid.uuid4().hex, True
            if identifier is not None:
                _begin_copy(scene, obj, seen[identifier])
        seen[obj[store.ID]] = obj
        own = obj.get(store.PICK_SHIFT)
        if own is None:
            obj[store.PICK_SHIFT] = shift.tolist()
        elif list(own) != shift.tolist() and picks.home_of(obj, scene) is None:
            place = np.array(obj[store.POSITION]) + np.array(own) - shift
            obj[store.POSITION], obj[store.PICK_SHIFT] = place.tolist(), shift.tolist()
            obj.location, changed = place, True
    return changed


def originals(objects: list[bpy.types.Object]) -> list[bpy.types.Object]:
    """Without the copies that a person is just placing: they are picks once they are let go."""
    first: dict[str | None, bpy.types.Object] = {}
    for obj in sorted(objects, key=lambda one: one.session_uid):
        first.setdefault(obj.get(store.ID), obj)
    return list(first.values())


def _begin_copy(scene: bpy.types.Scene, copy: bpy.types.Object, original: bpy.types.Object) -> None:
    """A copy is a pick at the moment that the scene shows, when that is another one than the original's."""
    copy[store.ROW] = 0
    frame = scene.frame_current + scene.frame_subframe
    kept = original.get(store.KEY_FRAME)
    if kept is not None and abs(frame - kept) > 0.5 and copy[store.TIME] == original[store.TIME]:
        copy[store.TIME] = float(copy[store.TIME]) + (frame - kept) / timing.keyed_rate(scene)
