# SPDX-License-Identifier: GPL-3.0-or-later
"""What was appended from another file: it gets ids of its own, and what belongs together in it stays together.

Picks know the cameras that they were clicked in, and blocks the picks of their keys, by ids; flights and blocks know
their picks by the name of the trajectory. Another file may have the same ids, as a copy of this one has, and the same
names.
"""

import ast
import json
import uuid
from collections.abc import Collection, Mapping, Sequence

import bpy

from ....core.errors import RockfallError
from ....core.reconstruction.block import Block
from ..footage import camera_paths, videos
from ..picks import keyframes, own_blocks, reconstruction
from ..terrain import georeference
from . import migration, store

OF_A_RUN = (store.FLIGHTS_ROLE, store.BLOCK_ROLE)


def take_in(scene: bpy.types.Scene, appended: Collection[bpy.types.ID]) -> bool:
    """Make what was appended into a scene a part of it; whether there was anything of ours.

    appended : all that came from the other file.
    """
    there, new = [], []
    for obj in scene.objects:
        if isinstance(obj.get(store.ROLE), str) and store.is_own(obj):
            (new if obj in appended else there).append(obj)
    if not new or scene in appended or migration.is_left_alone(scene):
        return False
    if not there and not georeference.has_shift(scene):
        _take_origin(scene, new)
    _give_ids(there, new)
    _give_names(there, new)
    _keep_blocks(scene, new)
    for obj in new:
        if videos.is_video(obj) and camera_paths.is_solved(obj):
            camera_paths.write_keys(scene, obj)  # its place is one from this scene's origin, its keys are of its clock
    return True


def _take_origin(scene: bpy.types.Scene, new: Sequence[bpy.types.Object]) -> None:
    """A scene without an origin has that of what comes into it, when it has one."""
    found = {
        tuple(kept.to_list())
        for obj in new
        for key in (store.PICK_SHIFT, store.CAMERA_SHIFT)
        if getattr(kept := obj.get(key), "typecode", "") == "d" and len(kept) == 3
    }
    if len(found) == 1:
        scene[store.SHIFT] = list(found.pop())


def _give_ids(there: Sequence[bpy.types.Object], new: Sequence[bpy.types.Object]) -> None:
    taken = {obj.get(store.ID) for obj in there if isinstance(obj.get(store.ID), str)}
    given: dict[str, str] = {}
    for obj in new:
        identifier = obj.get(store.ID)
        if identifier in taken:
            obj[store.ID] = given[identifier] = uuid.uuid4().hex
    if not given:
        return
    for obj in new:
        for key in (store.SEEN, store.FOOTAGE_OF):
            if hasattr(obj.get(key), "to_dict"):
                obj[key] = {given.get(name, name): value for name, value in obj[key].to_dict().items()}
        action = keyframes.action_of(obj)
        if action is not None and isinstance(action.get(store.BLOCK_KEYS), str):
            action[store.BLOCK_KEYS] = _with_ids(action[store.BLOCK_KEYS], given)


def _with_ids(text: str, given: Mapping[str, str]) -> str:
    """The keys of a block with other ids of picks; as they are where they cannot be read, which is said later."""
    try:
        rows = json.loads(text)
        for row in rows:
            row[4] = given.get(row[4], row[4])
    except (ValueError, TypeError, IndexError, RecursionError):
        return text
    return json.dumps(rows)


def _give_names(there: Sequence[bpy.types.Object], new: Sequence[bpy.types.Object]) -> None:
    """A whole run whose name is taken gets a free one; picks alone join the run of their name."""
    taken = {name for obj in there if isinstance(name := obj.get(store.TRAJECTORY), str)}
    runs = {obj.get(store.TRAJECTORY) for obj in new if obj[store.ROLE] in OF_A_RUN}
    for name in sorted(each for each in runs if isinstance(each, str) and each in taken):
        number = 2
        while (free := f"{name} ({number})") in taken or free in runs:
            number += 1
        taken.add(free)
        for obj in new:
            if obj.get(store.TRAJECTORY) == name:
                obj[store.TRAJECTORY] = free


def _keep_blocks(scene: bpy.types.Scene, new: Sequence[bpy.types.Object]) -> None:
    """A run keeps the block that its flights were computed with, where that is not the one of the panel."""
    default = reconstruction.default_block(scene)
    own = store.read_json(scene, store.BLOCKS, {})
    for obj in new:
        name, shown = obj.get(store.TRAJECTORY), _block_of(obj.get(store.BLOCK_SHOWN))
        is_run = obj[store.ROLE] == store.FLIGHTS_ROLE and isinstance(name, str) and name not in own
        if is_run and shown is not None and shown != default:
            own_blocks.give(scene, name, shown)


def _block_of(text: object) -> Block | None:
    """The block that was written down as Python shows it; None where that cannot be read."""
    try:
        call = ast.parse(str(text), mode="eval").body
        return Block(**{each.arg: ast.literal_eval(each.value) for each in call.keywords})
    except (SyntaxError, ValueError, TypeError, AttributeError, RockfallError, RecursionError, MemoryError):
        return None
