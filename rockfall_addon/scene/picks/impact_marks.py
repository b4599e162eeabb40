# SPDX-License-Identifier: GPL-3.0-or-later
"""Where the picks of all trajectories are on the timeline, and which of them need a look. Kept until they change."""

from collections.abc import Iterable
from dataclasses import dataclass

import bpy
import numpy as np

from ....core.vectors import Array
from ..footage import timing
from ..storage import fingerprints, store
from . import impact_numbers, picks

ALARMING = ("departing", "into_ground", "below_terrain", "doubtful", "shattered", "discarded")
"""Flags of an impact that a person should look at; the others only say where in its chain it is."""


@dataclass(frozen=True, eq=False)
class Marks:
    """All picks: trajectories in the order of their starts, the picks of each in the order of time.

    Attributes
    ----------
    names : of the trajectories.
    start, end : (k,) scene frames of the first and the last pick of each.
    frame : (n,) scene frames of the picks.
    row : (n,) number of the trajectory.
    kind : of each pick.
    alarming : (n,) whether it should be looked at.
    identifier : of each pick.
    """

    names: tuple[str, ...]
    start: Array
    end: Array
    frame: Array
    row: np.ndarray
    kind: tuple[str, ...]
    alarming: np.ndarray
    identifier: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class _Row:
    """The marks of one trajectory, as in `Marks`."""

    frame: Array
    kind: tuple[str, ...]
    alarming: np.ndarray
    identifier: tuple[str, ...]


_kept: dict[int, tuple[tuple, Marks]] = {}
_rows: dict[tuple[int, str], tuple[tuple, _Row]] = {}
_written: list[int] = [0]
"""How often results were written: they may change where no pick does."""


def marks(scene: bpy.types.Scene) -> Marks:
    """The marks of a scene; only trajectories that have changed are read again."""
    key = scene.get(store.SHOWN), scene.get(store.OFFSETS), timing.keyed_rate(scene), _written[0]
    if scene.session_uid not in _kept or _kept[scene.session_uid][0] != key:
        _kept[scene.session_uid] = key, _make(scene)
    return _kept[scene.session_uid][1]


def forget() -> None:
    """Another file was opened, or an undo has brought back other results."""
    _kept.clear()
    _rows.clear()


def results_written(names: Iterable[str]) -> None:
    """The impacts of these trajectories have new results."""
    _written[0] += 1
    gone = set(names)
    for key in [key for key in _rows if key[1] in gone]:
        del _rows[key]


def is_alarming(obj: bpy.types.Object) -> bool:
    """Whether a pick should be looked at."""
    if obj.get(store.STATUS, "ok") != "ok":
        return True
    return impact_numbers.one(obj, "r") > 1.0 or any(flag in ALARMING for flag in impact_numbers.flags(obj))


def _make(scene: bpy.types.Scene) -> Marks:
    rate, offsets, prints = timing.keyed_rate(scene), timing.kept_offsets(scene), fingerprints.remembered(scene)
    keys = {name: (prints[name], offsets.get(name, 0.0), rate) for name in prints}
    changed = [name for name, key in keys.items() if _rows.get((scene.session_uid, name), ((),))[0] != key]
    groups = fingerprints.by_trajectory(picks.objects_of(scene, changed)) if changed else {}
    for name in changed:
        _rows[scene.session_uid, name] = keys[name], _read(groups.get(name, []), keys[name][1], rate)
    found = [(name, _rows[scene.session_uid, name][1]) for name in keys]
    found = sorted(((name, row) for name, row in found if len(row.frame)), key=lambda each: (each[1].frame[0], each[0]))
    frames = [row.frame for _, row in found] or [np.zeros(0)]
    return Marks(
        tuple(name for name, _ in found),
        np.array([row.frame[0] for _, row in found]),
        np.array([row.frame[-1] for _, row in found]),
        np.concatenate(frames),
        np.repeat(np.arange(len(found)), [len(row.frame) for _, row in found]),
        tuple(kind for _, row in found for kind in row.kind),
        np.concatenate([row.alarming for _, row in found] or [np.zeros(0, dtype=bool)]),
        tuple(identifier for _, row in found for identifier in row.identifier),
    )


def _read(members: list[bpy.types.Object], offset: float, rate: float) -> _Row:
    """The picks of a trajectory in the order of time."""
    timed = sorted(((picks.time_of(obj, rate), obj) for obj in members), key=lambda each: each[0])
    return _Row(
        np.array([(time - offset) * rate for time, _ in timed]),
        tuple(obj[store.KIND] for _, obj in timed),
        np.array([is_alarming(obj) for _, obj in timed], dtype=bool),
        tuple(obj.get(store.ID, "") for _, obj in timed),
    )
