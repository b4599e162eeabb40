# SPDX-License-Identifier: GPL-3.0-or-later
"""Names of the picks' objects: trajectory, kind, and the number among the trajectory's picks of that kind in time.

So "B10 impact 3" in the outliner is impact 3 of B10 in tables, cards and graphs, whatever passes lie before it.
"""

import re
from collections import Counter
from collections.abc import Sequence

import bpy

from ....core.reconstruction.picks import KINDS
from ..storage import store

LONGEST = 200  # bytes of a trajectory's name; Blender cuts names off at 255
_OURS = re.compile(rf" (\d+ ({'|'.join(KINDS)})|({'|'.join(KINDS)}) \d+)(\.\d+)?$")  # 0.1.0 counted all kinds as one


def name_of(trajectory: str, kind: str, number: int) -> str:
    """What the object of a pick is called; `number` counts from 1."""
    return f"{trajectory.encode()[:LONGEST].decode(errors='ignore')} {kind} {number}"


def word(pick: bpy.types.Object) -> str:
    """What a pick is, in a sentence."""
    return "take-off" if pick[store.KIND] == "takeoff" else pick[store.KIND]


def follow(picks: Sequence[bpy.types.Object]) -> bool:
    """Name the picks of a trajectory, all of them, anew where kinds or the order in time have changed.

    A name that a person gave stays. Where an object of another scene has the name, Blender's number behind it stays.

    Returns
    -------
    Whether a name has changed.
    """
    counts, wrong = Counter[str](), []
    for obj in sorted(picks, key=lambda one: one[store.TIME]):
        kind, held = obj[store.KIND], obj.name
        counts[kind] += 1
        name = name_of(obj[store.TRAJECTORY], kind, counts[kind])
        if held != name and _OURS.search(held) and not (_is_numbered(held, name) and name in bpy.data.objects):
            wrong.append((obj, name))
    for obj, _ in wrong:
        obj.name = "Rockfall pick"  # the names that others of them are to have become free
    for obj, name in wrong:
        obj.name = name
    if wrong:
        follow(picks)  # a copy of one of them may now lose Blender's number
    return bool(wrong)


def follow_with(pick: bpy.types.Object) -> None:
    """`follow` for the trajectory of a pick at once: the undo step of the field that changed it comes next."""
    for scene in pick.users_scene:
        follow(store.of_role(scene, store.PICK_ROLE, pick.get(store.TRAJECTORY)))


def _is_numbered(held: str, name: str) -> bool:
    """Whether a name is another one with the number that Blender puts behind a name that is taken."""
    return held.startswith(f"{name}.") and held[len(name) + 1 :].isdecimal()
