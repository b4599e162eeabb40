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

from ...core.errors import InputError, readable
from ...core.remarks import Remark, gravest_first
from . import keyframes, store
from .stored_objects import BY_ROLE, incomplete
from .stored_values import (
    AGAIN,
    BESIDE_A_PICK,
    OF_A_PICK,
    OF_KEYS,
    OF_THE_SCENE,
    Check,
    block_problem,
    count,
    model_problem,
)

MOST_NAMED = 4
"""Picks that are named one by one; of further ones the number is said."""
MOST_OF_VALUE, MOST_OF_NAME = 40, 60
PARAMETERS = (store.MODEL_PARAMETERS, store.OTHER_PARAMETERS)
ASIDE = "_set_aside"
"""Behind the role of what is set aside."""
SUFFIX = " (set aside)"
"""Behind the names of the picks' objects, so that the outliner shows it."""
ABOUT = "set aside"
"""What all remarks of here are about."""
WORDS = {
    store.TRAJECTORY: "trajectory",
    store.TIME: "time",
    store.POSITION: "place",
    store.KIND: "kind",
    store.STATUS: "status",
}


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
        if _wrong(values):
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
        if not _wrong(values):
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
        if role not in BY_ROLE:
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


def _others(scene: bpy.types.Scene) -> list[bpy.types.Object]:
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


def remarks(scene: bpy.types.Scene) -> list[Remark]:
    """What is set aside and why, and what to do; the gravest first."""
    if not scene.get(store.HAS_SET_ASIDE):
        return []
    apart = of_picks(scene)
    said = [Remark(_of_pick(obj), "problem", ABOUT) for obj in apart[:MOST_NAMED]]
    if len(apart) > MOST_NAMED:
        text = f"{len(apart) - MOST_NAMED} more picks are set aside: select them to see why."
        said.append(Remark(text, "problem", ABOUT))
    said += [_of_other(obj) for obj in _others(scene)[:MOST_NAMED]]
    return gravest_first([*said, *_of_values(scene), *_of_scene(scene)])


def grave(scene: bpy.types.Scene) -> list[Remark]:
    """Those of the remarks that what is exported depends on.

    Raises
    ------
    InputError : the origin of the survey coordinates is not known.
    """
    if store.SHIFT not in scene and store.SHIFT in dict(_aside(scene)):
        raise InputError(
            "The global shift of the scene cannot be read, so its survey coordinates are not known",
            advice=f"Give it again as {store.SHIFT} in Scene Properties > Custom Properties, or import all anew",
        )
    return [remark for remark in remarks(scene) if remark.severity in ("warning", "problem")]


def objects_of(scene: bpy.types.Scene) -> list[bpy.types.Object]:
    """All objects that are set aside, or have a value that is."""
    having = [holder for holder in _holders(scene) if isinstance(holder, bpy.types.Object)]
    return list(dict.fromkeys([*of_picks(scene), *_others(scene), *having]))


def remove(scene: bpy.types.Scene) -> int:
    """Delete all that is set aside; returns how many picks and values there were."""
    apart = of_picks(scene) + _others(scene)
    removed = len(apart)
    store.remove_objects(apart)
    for holder in _holders(scene):
        removed += len(holder[store.SET_ASIDE])
        del holder[store.SET_ASIDE]
    return removed


def keep(holder: bpy.types.ID, key: str) -> None:
    """Keep what is under a key, if anything is, beside what is set aside already."""
    if key in holder:
        _keep(holder, key, holder[key])


def _wrong(values: Mapping[str, object]) -> tuple[str, str] | None:
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
    holder[store.SET_ASIDE] = there | {free: _plain(value)}


def _plain(value: object) -> object:
    """An ID property as it can be assigned again."""
    for way in ("to_dict", "to_list"):
        if hasattr(value, way):
            return getattr(value, way)()
    return [_plain(each) for each in value] if isinstance(value, list) else value


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


def _holders(scene: bpy.types.Scene) -> Iterator[bpy.types.ID]:
    """All that keeps values that are set aside."""
    roles = (store.PICK_ROLE, store.SET_ASIDE_ROLE, *BY_ROLE)
    objects = [obj for found in store.by_role(scene, *roles) for obj in found]
    for holder in (scene, *objects, *map(keyframes.action_of, objects)):
        if holder is not None and store.SET_ASIDE in holder:
            yield holder


def _of_pick(obj: bpy.types.Object) -> str:
    name, (key, problem) = trajectory_of(obj), _wrong(dict(obj.items())) or ("", "")
    goes_on = f"Trajectory {readable(name, MOST_OF_NAME)} goes without it" if name else "It is of no trajectory"
    return (
        f"Set aside: the {WORDS[key]} of {readable(obj.name.removesuffix(SUFFIX), MOST_OF_NAME)} "
        f"{_said(obj.get(key), problem)}. {goes_on}: recover it from its marker, or correct its custom property {key}."
    )


def _of_other(obj: bpy.types.Object) -> Remark:
    kept = BY_ROLE[obj[store.ROLE].removesuffix(ASIDE)]
    key, problem = next((key, said) for key, check in kept.needed.items() if (said := check(obj.get(key))))
    name = readable(obj.name.removesuffix(SUFFIX), MOST_OF_NAME)
    text = f"Set aside: {name}, as its {key} {_said(obj.get(key), problem)}. {kept.do}, or correct the custom property."
    return Remark(text, kept.severity, ABOUT)


def _of_values(scene: bpy.types.Scene) -> Iterator[Remark]:
    """Of picks and keys."""
    found = [(holder, key, value) for holder in _holders(scene) if holder != scene for key, value in _aside(holder)]
    for holder, key, value in found[:MOST_NAMED]:
        name, check = key.split(" ")[0], _checks(holder)
        said = _said(value, check[name](value)) if name in check else ""
        again = name in holder
        text = f"{key} of {readable(holder.name, MOST_OF_NAME)} {said} and is set aside: "
        text += "it has another value now." if again else "it goes without."
        yield Remark(text, "note" if again else "warning", ABOUT)
    if len(found) > MOST_NAMED:
        text = f"{len(found) - MOST_NAMED} more values are set aside: see the custom properties {store.SET_ASIDE}."
        yield Remark(text, "warning", ABOUT)


def _of_scene(scene: bpy.types.Scene) -> Iterator[Remark]:
    for key, value in _aside(scene):
        name = key.split(" ")[0]
        if name not in OF_THE_SCENE:
            continue
        check, so = OF_THE_SCENE[name]
        problem = check(value)
        if not problem and name in PARAMETERS:  # single models of it
            bad = json.loads(str(value))
            problem = " ".join(model_problem(model, values) for model, values in bad.items())
            yield Remark(f"{readable(problem, 200)} The defaults of {', '.join(bad)} are used.", "warning", ABOUT)
            continue
        if name == store.SHIFT and name in scene:
            so = "it was taken from the picks"
        elif name in scene and so != AGAIN:
            so = "there is another value now"
        grave = name not in scene and so != AGAIN
        text = f"{name} of the scene {_said(value, problem)} and is set aside: {so}."
        text += " Correct it in Scene Properties > Custom Properties." if grave else ""
        yield Remark(text, "problem" if grave and name in GRAVE else "warning" if grave else "note", ABOUT)


GRAVE = (store.SHIFT, store.BLOCKS)
"""Of the scene, without which numbers or places may be wrong."""


def _checks(holder: bpy.types.ID) -> Mapping[str, Check]:
    """How the values of an object or an action are checked."""
    kept = BY_ROLE.get(holder.get(store.ROLE, ""))
    return kept.beside if kept is not None else {**OF_A_PICK, **BESIDE_A_PICK, **OF_KEYS}


def _aside(holder: bpy.types.ID) -> list[tuple[str, object]]:
    return list(holder[store.SET_ASIDE].items()) if store.SET_ASIDE in holder else []


def _said(value: object, problem: str) -> str:
    """A value in few letters, and what is wrong with it."""
    if value is None:
        return "is missing"
    return f"({readable(repr(_plain(value)), MOST_OF_VALUE)}) {problem or 'could not be used'}"
