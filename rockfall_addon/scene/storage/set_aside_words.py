# SPDX-License-Identifier: GPL-3.0-or-later
"""What is said of all that is set aside: what it is, why, what goes on without it, and what to do."""

import json
from collections.abc import Iterator, Mapping

import bpy

from ....core.errors import InputError, readable
from ....core.remarks import Remark, gravest_first
from . import store
from .set_aside import ASIDE, PARAMETERS, SUFFIX, aside, holders, of_picks, others, plain, trajectory_of, wrong
from .stored_objects import BY_ROLE
from .stored_values import AGAIN, BESIDE_A_PICK, OF_A_PICK, OF_KEYS, OF_THE_SCENE, Check, model_problem

MOST_NAMED = 4
"""Picks that are named one by one; of further ones the number is said."""
MOST_OF_VALUE, MOST_OF_NAME = 40, 60
GRAVE = (store.SHIFT, store.BLOCKS)
"""Of the scene, without which numbers or places may be wrong."""
ABOUT = "set aside"
"""What all remarks of here are about."""
WORDS = {
    store.TRAJECTORY: "trajectory",
    store.TIME: "time",
    store.POSITION: "place",
    store.KIND: "kind",
    store.STATUS: "status",
}


def remarks(scene: bpy.types.Scene) -> list[Remark]:
    """What is set aside and why, and what to do; the gravest first."""
    if not scene.get(store.HAS_SET_ASIDE):
        return []
    apart = of_picks(scene)
    said = [Remark(_of_pick(obj), "problem", ABOUT) for obj in apart[:MOST_NAMED]]
    if len(apart) > MOST_NAMED:
        text = f"{len(apart) - MOST_NAMED} more picks are set aside: select them to see why."
        said.append(Remark(text, "problem", ABOUT))
    said += [_of_other(obj) for obj in others(scene)[:MOST_NAMED]]
    return gravest_first([*said, *_of_values(scene), *_of_scene(scene)])


def grave(scene: bpy.types.Scene) -> list[Remark]:
    """Those of the remarks that what is exported depends on.

    Raises
    ------
    InputError : the origin of the survey coordinates is not known.
    """
    if store.SHIFT not in scene and store.SHIFT in dict(aside(scene)):
        raise InputError(
            "The global shift of the scene cannot be read, so its survey coordinates are not known",
            advice=f"Give it again as {store.SHIFT} in Scene Properties > Custom Properties, or import all anew",
        )
    return [remark for remark in remarks(scene) if remark.severity in ("warning", "problem")]


def _of_pick(obj: bpy.types.Object) -> str:
    name, (key, problem) = trajectory_of(obj), wrong(dict(obj.items())) or ("", "")
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
    found = [(holder, key, value) for holder in holders(scene) if holder != scene for key, value in aside(holder)]
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
    for key, value in aside(scene):
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


def _checks(holder: bpy.types.ID) -> Mapping[str, Check]:
    """How the values of an object or an action are checked."""
    kept = BY_ROLE.get(holder.get(store.ROLE, ""))
    return kept.beside if kept is not None else {**OF_A_PICK, **BESIDE_A_PICK, **OF_KEYS}


def _said(value: object, problem: str) -> str:
    """A value in few letters, and what is wrong with it."""
    if value is None:
        return "is missing"
    return f"({readable(repr(plain(value)), MOST_OF_VALUE)}) {problem or 'could not be used'}"
