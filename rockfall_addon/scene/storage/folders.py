# SPDX-License-Identifier: GPL-3.0-or-later
"""Collections of ours that an undo of Blender has left outside of all scenes come back to where they hung.

Now and then (Blender 5.2, also without Rockfall), the undo of a deleted collection brings it back with all that is in
it, but not into what it hung in. Probably because Blender reads that again, for a while, to where the deleted one
lay, and takes what points there for a reference to itself.
"""

from collections.abc import Iterator

import bpy

from . import store


def remember() -> bool:
    """Write into each collection of ours in what it hangs; whether that is not what was written there."""
    hangs_in: dict[bpy.types.Collection, list[int]] = {}
    for parent in _parents():
        for child in parent.children:
            hangs_in.setdefault(child, []).append(parent.session_uid)
    changed = False
    for folder in filter(store.is_own, bpy.data.collections):
        now = hangs_in.get(folder, [])
        if store.COLLECTION_NAME not in folder or _hung_in(folder) == now:
            continue
        changed = True
        if now:
            folder[store.HANGS_IN] = now
        else:
            folder.pop(store.HANGS_IN, None)
    return changed


def put_back() -> None:
    """After an undo or redo: link what hangs nowhere, but did when that step was stored."""
    lost = [each for each in filter(store.is_own, bpy.data.collections) if _hung_in(each) and not _users(each)]
    parents = {parent.session_uid: parent for parent in _parents()} if lost else {}
    for folder in lost:
        for identifier in _hung_in(folder):
            if identifier in parents:
                parents[identifier].children.link(folder)
                store.look_again()


def _parents() -> Iterator[bpy.types.Collection]:
    """All collections in which others can hang."""
    yield from (scene.collection for scene in bpy.data.scenes if store.is_own(scene))
    yield from filter(store.is_own, bpy.data.collections)


def _hung_in(folder: bpy.types.Collection) -> list[int]:
    """What is written in a collection; nothing where that is no list of numbers."""
    kept = folder.get(store.HANGS_IN)
    return kept.to_list() if getattr(kept, "typecode", "") == "i" else []


def _users(folder: bpy.types.Collection) -> int:
    return folder.users - folder.use_fake_user
