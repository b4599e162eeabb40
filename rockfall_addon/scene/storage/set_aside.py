# SPDX-License-Identifier: GPL-3.0-or-later
"""What is stored and cannot be used is set aside and named; all else goes on, and what was corrected is used again.

A pick without its time, place, kind, status or trajectory has a role of its own, and is nobody's pick meanwhile. Any
other value goes from its key to `store.SET_ASIDE`, where it stays until a person removes it. So it costs something
when a file is opened and after an undo, and nothing whenever something is read.
"""

import json
import math
from collections.abc import Iterable, Iterator, Mapping

import bpy

from ..picks import keyframes
from . import store
from .stored_objects import BY_ROLE, incomplete
from .stored_values import BESIDE_A_PICK, OF_A_PICK, OF_KEYS, OF_THE_SCENE, Check, block_problem, count, model_problem

PARAMETERS = (store.MODEL_PARAMETERS, store.OTHER_PARAMETERS)
ASIDE = "_set_aside"
"""Behind the role of what is set aside."""
SUFFIX = " (set aside)"
"""Behind the names of the picks' objects, so that the outliner shows it."""


def look(scene: bpy.types.Scene, names: Iterable[str] | None = None) -> set[str]:
    """Set aside what cannot be used, and take up what was corrected; what depends on it is computed again soon.

    names : the trajectories that are looked at; None for all, and for the values of the scene.

    Returns
    -------
    The trajectories whose picks came or went by this.
    """
    changed: set[str] = set()
    stale: set[str] = set()
    asked = (None,) if names is None else tuple(names)
    there = bool(waiting := of_picks(scene))
    for obj in (obj for name in asked for obj in store.of_role(scene, store.PICK_ROLE, name)):
        values = dict(obj.items())  # one by one they take twice as long
        there = there or store.SET_ASIDE in values
        if wrong(values):
            obj[store.ROLE] = store.SET_ASIDE_ROLE
            obj.name = f"{obj.name.removesuffix(SUFFIX)}{SUFFIX}"
            changed.add(trajectory_of(obj))
        elif _put_away(obj, values, BESIDE_A_PICK) or _put_back(obj):
            stale.add(trajectory_of(obj))
        action = keyframes.action_of(obj)
        if action is not None and store.WRITTEN in action and count(action[store.WRITTEN]):
            _put_away(action, dict(action.items()), OF_KEYS)
            stale.add(trajectory_of(obj))
    for obj in waiting:
        values = dict(obj.items())
        if not wrong(values):
            obj[store.ROLE], obj.name = store.PICK_ROLE, obj.name.removesuffix(SUFFIX)
            _put_away(obj, values, BESIDE_A_PICK)
            changed.add(trajectory_of(obj))
    for obj in (obj for name in asked for obj in store.of_role(scene, store.BLOCK_ROLE, name)):
        action = keyframes.action_of(obj)
        if action is not None and _put_away(action, dict(action.items()), OF_KEYS):
            stale.add(trajectory_of(obj))
    if names is None:
        stale |= bad_blocks(scene).keys()
        look_at_scene(scene)
        there = _look_at_objects(scene) or there
    if changed:
        store.look_again()
    _compute_again(scene, stale)
    if (there or changed or stale or store.SET_ASIDE in scene) and not scene.get(store.HAS_SET_ASIDE):
        scene[store.HAS_SET_ASIDE] = True
    return changed - {""}


def trajectory_of(obj: bpy.types.Object) -> str:
    """The trajectory of a pick or a block, empty where it cannot be read."""
    name = obj.get(store.TRAJECTORY)
    return name if isinstance(name, str) else ""


def look_at_scene(scene: bpy.types.Scene) -> None:
    """The same for the values of the scene alone; all is computed again where some of them cannot be used."""
    if _set_aside_of(scene):
        scene.pop(store.SHOWN, None)


def _look_at_objects(scene: bpy.types.Scene) -> bool:
    """The same for the objects of other roles; whether any of them is or has something that is set aside."""
    found, roles = False, {f"{role}{ASIDE}": role for role in BY_ROLE}
    for obj in scene.objects:
        held = obj.get(store.ROLE)
        role = roles.get(held, held) if isinstance(held, str) else None
        if role not in BY_ROLE or not store.is_own(obj):
            continue
        kept, values = BY_ROLE[role], dict(obj.items())
        is_whole = not any(check(values.get(key)) for key, check in kept.needed.items())
        if is_whole != (held == role):
            obj[store.ROLE] = role if is_whole else f"{role}{ASIDE}"
            obj.name = obj.name.removesuffix(SUFFIX) + ("" if is_whole else SUFFIX)
            store.look_again()
        if is_whole and _put_away(obj, values, kept.beside):
            values = dict(obj.items())
        for key in incomplete(role, values) if is_whole else ():
            _keep(obj, key, obj[key])
            del obj[key]
        found = found or not is_whole or store.SET_ASIDE in obj
    return found


def others(scene: bpy.types.Scene) -> list[bpy.types.Object]:
    """Objects of other roles than picks that are set aside."""
    return [obj for role in BY_ROLE for obj in store.with_role(scene, f"{role}{ASIDE}")]


def of_picks(scene: bpy.types.Scene) -> list[bpy.types.Object]:
    """The picks that are set aside."""
    return store.with_role(scene, store.SET_ASIDE_ROLE)


def bad_blocks(scene: bpy.types.Scene) -> dict[str, str]:
    """Trajectory → what is wrong with its own block."""
    if OF_THE_SCENE[store.BLOCKS][0](scene.get(store.BLOCKS, "{}")):
        return {}
    own = store.read_json(scene, store.BLOCKS, {})
    return {name: problem for name, values in own.items() if (problem := block_problem(values))}


def objects_of(scene: bpy.types.Scene) -> list[bpy.types.Object]:
    """All objects that are set aside, or have a value that is."""
    having = [holder for holder in holders(scene) if isinstance(holder, bpy.types.Object)]
    return list(dict.fromkeys([*of_picks(scene), *others(scene), *having]))


def remove(scene: bpy.types.Scene) -> int:
    """Delete all that is set aside; returns how many picks and values there were."""
    apart = of_picks(scene) + others(scene)
    removed = len(apart)
    store.remove_objects(apart)
    for holder in holders(scene):
        removed += len(holder[store.SET_ASIDE])
        del holder[store.SET_ASIDE]
    return removed


def keep(holder: bpy.types.ID, key: str) -> None:
    """Keep what is under a key, if anything is, beside what is set aside already."""
    if key in holder:
        _keep(holder, key, holder[key])


def wrong(values: Mapping[str, object]) -> tuple[str, str] | None:
    """Of what a pick holds, the first key that makes it no pick, and what is wrong with it."""
    for key, check in OF_A_PICK.items():
        problem = check(values.get(key))
        if problem:
            return key, problem
    return None


def _put_away(holder: bpy.types.ID, values: Mapping[str, object], checks: Mapping[str, Check]) -> bool:
    """Move what cannot be used from its key to the others that are set aside; True where there was something.

    values : what the holder holds.
    """
    bad = [key for key, check in checks.items() if key in values and check(values[key])]
    for key in bad:
        _keep(holder, key, holder[key])
        del holder[key]
    return bool(bad)


def _keep(holder: bpy.types.ID, key: str, value: object) -> None:
    """Beside what is there already: an older one under the same key keeps it."""
    there = holder[store.SET_ASIDE].to_dict() if store.SET_ASIDE in holder else {}
    number, free = 1, key
    while free in there:
        number += 1
        free = f"{key} {number}"
    holder[store.SET_ASIDE] = there | {free: plain(value)}


def plain(value: object) -> object:
    """An ID property as it can be assigned again."""
    for way in ("to_dict", "to_list"):
        if hasattr(value, way):
            return getattr(value, way)()
    return [plain(each) for each in value] if isinstance(value, list) else value


def _put_back(obj: bpy.types.Object) -> bool:
    """A marker that is nowhere goes back to its pick's place."""
    x, y, z = obj.location
    if math.isfinite(x + y + z):
        return False
    obj.location = obj[store.POSITION]
    for curve in keyframes.location_curves(obj):
        for point in curve.keyframe_points:
            point.co[1] = obj.location[curve.array_index]
        curve.update()
    return True


def _set_aside_of(scene: bpy.types.Scene) -> bool:
    changed = _put_away(scene, dict(scene.items()), {key: check for key, (check, _) in OF_THE_SCENE.items()})
    for key in PARAMETERS:
        found = store.read_json(scene, key, {})
        bad = {name: values for name, values in found.items() if model_problem(name, values)}
        if bad:
            _keep(scene, key, json.dumps(bad))
            scene[key] = json.dumps({name: values for name, values in found.items() if name not in bad})
            changed = True
    if store.SHIFT not in scene and store.SHIFT in scene.get(store.SET_ASIDE, ()):
        there = store.of_role(scene, store.PICK_ROLE)
        sound = BESIDE_A_PICK[store.PICK_SHIFT]
        known = {tuple(shift) for obj in there if not sound(shift := obj.get(store.PICK_SHIFT))}
        if len(known) == 1:
            scene[store.SHIFT] = list(known.pop())
    return changed


def _compute_again(scene: bpy.types.Scene, names: set[str]) -> None:
    prints = store.read_json(scene, store.SHOWN, {}) if names else {}
    if names & prints.keys():
        scene[store.SHOWN] = json.dumps({name: text for name, text in prints.items() if name not in names})


def holders(scene: bpy.types.Scene) -> Iterator[bpy.types.ID]:
    """All that keeps values that are set aside."""
    roles = (store.PICK_ROLE, store.SET_ASIDE_ROLE, *BY_ROLE)
    objects = [obj for found in store.by_role(scene, *roles) for obj in found]
    for holder in (scene, *objects, *map(keyframes.action_of, objects)):
        if holder is not None and store.SET_ASIDE in holder:
            yield holder


def aside(holder: bpy.types.ID) -> list[tuple[str, object]]:
    """Keys and values that are set aside of an object, an action or the scene."""
    return list(holder[store.SET_ASIDE].items()) if store.SET_ASIDE in holder else []
