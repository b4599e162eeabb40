# SPDX-License-Identifier: GPL-3.0-or-later
"""Objects that several scenes show: one of these scenes writes their keys, the others only show them.

Frame rate and time offset are those of a scene: two that both wrote would each take the other's keys for edits.
"""

from collections import Counter

import bpy

from ..terrain import georeference
from . import store

KEYED = (store.PICK_ROLE, store.BLOCK_ROLE, store.FLIGHTS_ROLE, store.MODEL_BLOCK_ROLE)
Elsewhere = dict[bpy.types.Object, bpy.types.Scene]
"""What another scene keeps, and which."""


def kept_elsewhere(scene: bpy.types.Scene) -> Elsewhere:
    """What a scene shows and another one keeps: that with the pick's origin and with most picks of the trajectory."""
    if len(bpy.data.scenes) == 1:
        return {}
    showing = [
        (each, georeference.read_shift(each).vector.tolist(), set(each.objects), _counts(each))
        for each in bpy.data.scenes
        if store.is_own(each)
    ]
    found = {}
    for obj in (one for one in scene.objects if one.get(store.ROLE) in KEYED and store.is_own(one)):
        own, name = list(obj.get(store.PICK_SHIFT, ())), obj.get(store.TRAJECTORY)
        among = [(shift == own, counts[name], each) for each, shift, there, counts in showing if obj in there]
        keeper = max(among, key=lambda row: row[:2])[2]  # the first of several
        if keeper != scene:
            found[obj] = keeper
    return found


def _counts(scene: bpy.types.Scene) -> Counter[str]:
    """How many picks of each trajectory a scene shows."""
    return Counter(obj.get(store.TRAJECTORY) for obj in store.of_role(scene, store.PICK_ROLE))
