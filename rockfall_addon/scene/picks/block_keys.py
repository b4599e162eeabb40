# SPDX-License-Identifier: GPL-3.0-or-later
"""The keys of a block, which show all impacts of a run in one row: what a person does to them is done to the picks.

Beside the keys, in the same action, is what was last written: frame, place and pick of each. Where the keys differ from
that, a person has moved, deleted or copied them.
"""

import json
from collections.abc import Sequence
from dataclasses import dataclass, field

import bpy
import numpy as np

from ....core.vectors import Array
from ..storage import store
from . import keyframes

SAME_FRAME = 1e-3
"""Keys nearer than this have not been moved [frames]; late ones are kept in single precision."""
STATE = (store.TIME, store.POSITION, store.NORMAL)
"""What of a pick follows from a key of its block."""
GONE = "The keys of {block} were put back. To delete the run, delete its picks."
SINGLE = "The keys of {block} were put back: of one axis alone they cannot be deleted or copied."
MERGED = (
    "The keys of {block} were put back: one was moved to the time of another, which Blender then deletes. Two picks of "
    "a run are never at one time."
)
NOWHERE = "The keys of {block} were put back: one had no finite time or place."
BETWEEN = (
    "The keys of {block} were put back: only those at its picks can be edited. For a new pick, duplicate a key, or use "
    "the tool Pick Impacts."
)


@dataclass(frozen=True)
class Change:
    """What was done to the keys of one pick: moved in time [frames] and in space [m]."""

    frames: float = 0.0
    way: tuple[float, float, float] = (0.0, 0.0, 0.0)


@dataclass(frozen=True)
class Edits:
    """What was done to a block's keys since they were written.

    Attributes
    ----------
    changes : by the pick's id.
    deleted : ids of picks.
    copied : ids of picks and how much later their copies are [frames].
    put_back : why keys come back that mean nothing; empty where all mean something.
    identifiers : of the pick of each key as the keys are now, empty for none; those of copies are missing.
    """

    changes: dict[str, Change] = field(default_factory=dict)
    deleted: tuple[str, ...] = ()
    copied: tuple[tuple[str, float], ...] = ()
    put_back: str = ""
    identifiers: tuple[str, ...] = ()

    @property
    def is_of_objects(self) -> bool:
        """Whether picks come or go."""
        return bool(self.deleted or self.copied)

    def __bool__(self) -> bool:
        return bool(self.changes or self.deleted or self.copied or self.put_back)


@dataclass(frozen=True, eq=False)
class _Rows:
    """Keys in the order of time: frames (n,), places (n, 3), and of each its pick's id and `STATE`."""

    frame: Array
    place: Array
    identifiers: tuple[str, ...] = ()
    states: tuple[dict[str, object], ...] = ()


def remember(block: bpy.types.Object, objects: Sequence[bpy.types.Object | None]) -> None:
    """What the keys are now is what was written.

    objects : of each key its pick, None for a key between the picks.
    """
    action, found = keyframes.action_of(block), _read(block)
    if found is None or len(found.frame) != len(objects):
        action.pop(store.BLOCK_KEYS, None)
        return
    rows = [
        [frame, *place, obj[store.ID] if obj else "", _state(obj) if obj else {}]
        for frame, place, obj in zip(found.frame.tolist(), found.place.tolist(), objects, strict=True)
    ]
    text = json.dumps(rows)
    if action.get(store.BLOCK_KEYS) != text:
        action[store.BLOCK_KEYS] = text


def remember_by_frame(block: bpy.types.Object, objects: Sequence[bpy.types.Object]) -> None:
    """The same for a block of a file that does not say which pick a key is of: the one whose own key is there."""
    found = _read(block)
    there = [(float(obj[store.KEY_FRAME]), obj) for obj in objects if store.KEY_FRAME in obj]
    if found is not None and there:
        near = [min(there, key=lambda pair: abs(pair[0] - frame)) for frame in found.frame.tolist()]
        of = [obj if same_frame(at, frame) else None for (at, obj), frame in zip(near, found.frame, strict=True)]
        remember(block, of)


def stretch(block: bpy.types.Object, factor: float) -> None:
    """The keys were moved to another frame rate."""
    action = keyframes.action_of(block)
    if action is not None and store.BLOCK_KEYS in action:
        rows = store.read_json(action, store.BLOCK_KEYS, [])
        action[store.BLOCK_KEYS] = json.dumps([[row[0] * factor, *row[1:]] for row in rows])


def states_of(block: bpy.types.Object) -> dict[str, dict[str, object]]:
    """Id of each pick → its `STATE` when the keys were written."""
    kept = _kept(block)
    return {} if kept is None else {one: state for one, state in zip(kept.identifiers, kept.states, strict=True) if one}


def edits_of(block: bpy.types.Object) -> Edits:
    """What a person did to the keys of a block since they were written."""
    if not any(len(curve.keyframe_points) for curve in keyframes.location_curves(block)):
        return Edits(put_back=GONE.format(block=block.name))
    kept = _kept(block)
    if kept is None:
        return Edits()
    now = _read(block, len(kept.frame))
    if now is None:
        return Edits(put_back=SINGLE.format(block=block.name))
    if not (np.isfinite(now.frame).all() and np.isfinite(now.place).all()):
        return Edits(put_back=NOWHERE.format(block=block.name))
    of = _matched(kept, now)
    return _edits(block.name, kept, now, of)


def _edits(name: str, kept: _Rows, now: _Rows, of: list[int]) -> Edits:
    """of : for each key that is there, which of those that were written it is; −1 for a new one."""
    changes: dict[str, Change] = {}
    idle = False  # something was done to keys that are no pick's
    for i, k in enumerate(of):
        if k < 0:
            continue
        frames = 0.0 if same_frame(now.frame[i], kept.frame[k]) else float(now.frame[i] - kept.frame[k])
        change = Change(frames, tuple((now.place[i] - kept.place[k]).tolist()))
        if change == Change():
            continue
        if kept.identifiers[k]:
            changes[kept.identifiers[k]] = change
        else:
            idle = True
    there = {kept.identifiers[k] for k in of if k >= 0}
    deleted = tuple(dict.fromkeys(one for one in kept.identifiers if one and one not in there))
    if _merged(kept, now, of, deleted):
        return Edits(put_back=MERGED.format(block=name))
    lost = [k for k in range(len(kept.frame)) if k not in of and kept.identifiers[k] not in deleted]
    copied = []
    for i in (i for i, k in enumerate(of) if k < 0):
        same = [k for k in range(len(kept.frame)) if kept.identifiers[k] and (kept.place[k] == now.place[i]).all()]
        if same:
            copied.append((kept.identifiers[same[0]], float(now.frame[i] - kept.frame[same[0]])))
        else:
            idle = True
    means = bool(changes or deleted or copied)
    put_back = BETWEEN.format(block=name) if (idle or lost) and not means else ""
    identifiers = tuple(kept.identifiers[k] if k >= 0 else "" for k in of)
    return Edits(changes, deleted, tuple(copied), put_back, identifiers)


def _merged(kept: _Rows, now: _Rows, of: list[int], deleted: tuple[str, ...]) -> bool:
    """Whether a key that was moved in time is now where one was that is gone: nobody has deleted that one."""
    gone = [kept.frame[k] for k, one in enumerate(kept.identifiers) if one in deleted]
    moved = [now.frame[i] for i, k in enumerate(of) if k >= 0 and not same_frame(now.frame[i], kept.frame[k])]
    return any(same_frame(frame, other) for frame in moved for other in gone)


def _matched(kept: _Rows, now: _Rows) -> list[int]:
    """For each key that is there, which of those that were written it is; −1 for none.

    A key that was moved in time keeps its place, and one that was moved in space its time. The order does not tell:
    keys may pass each other, and while they are dragged Blender does not sort them.
    """
    of = [-1] * len(now.frame)
    left = list(range(len(kept.frame)))

    def match(fits: np.ndarray) -> None:
        """fits : (now, kept) whether two may be the same; the nearest in time are matched first."""
        away = np.abs(now.frame[:, None] - kept.frame)
        for i, k in sorted(np.argwhere(fits).tolist(), key=lambda pair: away[pair[0], pair[1]]):
            if of[i] < 0 and k in left:
                of[i] = k
                left.remove(k)

    same_place = (now.place[:, None] == kept.place).all(axis=2)
    same_time = same_frame(now.frame[:, None], kept.frame)
    match(same_place & same_time)
    match(same_place)
    match(same_time)
    if of.count(-1) == len(left):  # moved in time and in space; else keys were inserted or deleted
        match(np.ones_like(same_place))
    return of


def _read(block: bpy.types.Object, count: int = -1) -> _Rows | None:
    """The keys as they are; None where the axes have different ones.

    count : where each axis has this many keys, their times may differ: the one that differs most tells.
    """
    curves = keyframes.location_curves(block)
    if len(curves) != 3:
        return None
    axes = []
    for curve in curves:
        values = np.empty(2 * len(curve.keyframe_points), dtype=np.float32)
        curve.keyframe_points.foreach_get("co", values)
        axes.append(values.reshape(-1, 2).astype(np.float64))
    if len({len(axis) for axis in axes}) > 1:
        return None
    frames = np.column_stack([axis[:, 0] for axis in axes])
    if not same_frame(frames, frames[:, :1]).all():
        kept = _kept(block)
        if kept is None or len(frames) != count:
            return None
        frames = np.take_along_axis(frames, np.abs(frames - kept.frame[:, None]).argmax(axis=1)[:, None], axis=1)
    return _Rows(frames[:, 0], np.column_stack([axis[:, 1] for axis in axes]))


def _kept(block: bpy.types.Object) -> _Rows | None:
    """What was written last; None where that is not known."""
    action = keyframes.action_of(block)
    rows = store.read_json(action, store.BLOCK_KEYS, []) if action is not None else []
    if not rows:
        return None
    numbers = np.array([row[:4] for row in rows], dtype=np.float64)
    return _Rows(numbers[:, 0], numbers[:, 1:], tuple(row[4] for row in rows), tuple(row[5] for row in rows))


def _state(obj: bpy.types.Object) -> dict[str, object]:
    return {key: list(value) if hasattr(value := obj[key], "to_list") else value for key in STATE if key in obj}


def same_frame(frame: Array | float, other: Array | float) -> Array:
    """Whether keys have not been moved in time."""
    return np.abs(frame - other) <= np.maximum(SAME_FRAME, 4e-7 * np.abs(other))
