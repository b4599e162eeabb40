# SPDX-License-Identifier: GPL-3.0-or-later
"""Where the picks of all trajectories are on the timeline, and which of them need a look. Kept until they change."""

from dataclasses import dataclass

import bpy
import numpy as np

from ...core.vectors import Array
from . import fingerprints, picks, store, timing

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


_kept: dict[int, tuple[tuple, Marks]] = {}


def marks(scene: bpy.types.Scene) -> Marks:
    """The marks of a scene."""
    key = scene.get(store.SHOWN), scene.get(store.OFFSETS), timing.keyed_rate(scene)
    if scene.session_uid not in _kept or _kept[scene.session_uid][0] != key:
        _kept[scene.session_uid] = key, _make(scene)
    return _kept[scene.session_uid][1]


def forget() -> None:
    """Another file was opened."""
    _kept.clear()


def is_alarming(obj: bpy.types.Object) -> bool:
    """Whether a pick should be looked at."""
    if obj.get(store.STATUS, "ok") != "ok":
        return True
    result = obj.get(store.RESULT)
    if result is None:
        return False
    return result["r"][0] > 1.0 or any(flag in ALARMING for flag in result["flags"].split(";"))


def _make(scene: bpy.types.Scene) -> Marks:
    rate, offsets = timing.keyed_rate(scene), timing.kept_offsets(scene)
    groups = fingerprints.by_trajectory(picks.objects_of(scene))
    rows = []
    for name, members in groups.items():
        offset = offsets.get(name, 0.0)
        timed = [((picks.time_of(obj, rate) - offset) * rate, obj) for obj in members]
        rows.append((name, sorted(timed, key=lambda each: each[0])))
    rows.sort(key=lambda each: (each[1][0][0], each[0]))
    flat = [(frame, i, obj) for i, (_, timed) in enumerate(rows) for frame, obj in timed]
    return Marks(
        tuple(name for name, _ in rows),
        np.array([timed[0][0] for _, timed in rows]),
        np.array([timed[-1][0] for _, timed in rows]),
        np.array([frame for frame, _, _ in flat]),
        np.array([i for _, i, _ in flat], dtype=np.intp),
        tuple(obj[store.KIND] for _, _, obj in flat),
        np.array([is_alarming(obj) for _, _, obj in flat], dtype=bool),
        tuple(obj.get(store.ID, "") for _, _, obj in flat),
    )
