# SPDX-License-Identifier: GPL-3.0-or-later
"""The trajectories follow their picks: whatever changes a pick, its trajectory, and no other, is computed again.

Nothing is told by whoever changes a pick. `sync` compares fingerprints of the picks with those of what is shown; the
handlers only say where to look, and a timer does the work, since data must not be changed while Blender evaluates them.
While a person drags, picks are read where they are dragged to; what was done is absorbed when the mouse is released.
"""

import uuid
from collections.abc import Iterable
from dataclasses import dataclass

import bpy
import numpy as np

from ...core.errors import RockfallError
from . import (
    impact_rows,
    migration,
    picks,
    problems,
    reconstruction,
    shown,
    state,
    timing,
    trails,
    trajectories,
    twins,
)

DRAGGING = ("TRANSFORM_OT_", "ROCKFALL_OT_drag")
REACH_RADII = 1.0
"""A pick nearer to the terrain than this many radii of its block lies on it, and stays on it when it is moved."""
LEAST_REACH_M = 0.1
POLL_S = 0.04

_waiting: dict[int, set[str] | None] = {}  # session_uid of a scene → trajectories to look at, None for all


@dataclass
class Done:
    """What a `sync` has done: trajectories that were computed again, or could not be."""

    rebuilt: list[str]
    failed: list[str]


def touch(scene: bpy.types.Scene, names: Iterable[str] | None = None) -> None:
    """Something may have changed in these trajectories (None: anywhere): look soon, in background at once."""
    key, asked = scene.session_uid, None if names is None else set(names)
    before = _waiting.get(key, set())
    _waiting[key] = None if asked is None or before is None else before | asked
    if bpy.app.background:
        work()
    elif not bpy.app.timers.is_registered(work):
        bpy.app.timers.register(work, first_interval=0.0)


def notice(scene: bpy.types.Scene, depsgraph: bpy.types.Depsgraph) -> None:
    """From Blender's list of updates, find what to look at."""
    if state.KEYED_RATE_KEY not in scene and migration.version(scene) is None:
        return
    names: set[str] | None = set()
    for update in depsgraph.updates:  # a scene is in it at every selection; then nothing of it is updated
        thing = update.id
        if isinstance(thing, bpy.types.Object):
            role = thing.get(state.ROLE_KEY)
            if role == state.PICK_ROLE and picks.TRAJECTORY_KEY in thing:
                names.add(thing[picks.TRAJECTORY_KEY])
            elif role == state.TERRAIN_ROLE:
                names = None
        elif isinstance(thing, bpy.types.Collection) or (
            isinstance(thing, bpy.types.Scene) and (update.is_updated_transform or update.is_updated_geometry)
        ):
            names = None
        if names is None:
            break
    if names is None or names:
        touch(scene, names)


@problems.guarded
def work() -> float | None:
    """Do what is waiting; as a timer, come again while a person still drags."""
    waiting = dict(_waiting)
    _waiting.clear()
    dragging = is_dragging()
    for scene in bpy.data.scenes:
        if scene.session_uid in waiting:
            names = waiting[scene.session_uid]
            sync(scene, names, dragging=dragging)
            if dragging:
                _waiting[scene.session_uid] = names
    return POLL_S if dragging else None


def is_dragging() -> bool:
    """Whether a person is just moving something."""
    if bpy.app.background or bpy.context.window_manager is None:
        return False
    return any(
        operator.bl_idname.startswith(DRAGGING)
        for window in bpy.context.window_manager.windows
        for operator in window.modal_operators
    )


def sync(
    scene: bpy.types.Scene,
    names: Iterable[str] | None = None,
    *,
    dragging: bool = False,
    again: bool = False,
) -> Done:
    """Bring what is shown of some trajectories (None: of all) in line with their picks.

    dragging : the picks are only read, not written: a person holds them.
    again : compute them even where nothing has changed.
    """
    done = Done([], [])
    if migration.is_newer(scene):
        return done
    things = picks.things_of(scene, names)
    if not things and shown.SHOWN_KEY not in scene:
        return done
    if dragging:
        things = _originals(things)
    else:
        _heal(scene, things)
    again = again or (not dragging and _ground_changed(scene))
    if again and names is not None:
        names, things = None, picks.things_of(scene)
    groups = shown.by_trajectory(things)
    prints, rate = shown.remembered(scene), timing.keyed_rate(scene)
    parts = trajectories.parts_of(scene, None if names is None else list(groups))
    gone = [name for name in prints if name not in groups and (names is None or name in set(names))]
    said = problems.of_trajectories(scene)
    for name in gone:
        _forget(scene, name, parts)
        prints.pop(name), said.pop(name, None)
    for name, members in groups.items():
        edited = not dragging and any(picks.moved(one) or picks.frames_moved(one) for one in members)
        before = prints.get(name, "")
        same = before.rstrip(shown.COMPLETE) == shown.fingerprint(members, rate)
        if same and not (again or edited or (before.endswith(shown.COMPLETE) and not _complete(name, parts))):
            continue
        mark = ""
        try:
            said[name] = _rebuild(scene, name, members, parts, dragging)
            done.rebuilt.append(name)
            parts = parts | trajectories.parts_of(scene, [name])
            mark = shown.COMPLETE if _complete(name, parts) else ""
        except RockfallError as error:
            said[name] = [str(error)]
            _grey(scene, name, parts)
            done.failed.append(name)
        prints[name] = shown.fingerprint(members, rate) + mark
    shown.remember(scene, prints)
    problems.keep_trajectories(scene, said)
    if not dragging:
        _finish(scene, bool(done.rebuilt or gone))
    problems.tell(scene)
    return done


def retime(thing: bpy.types.Object, text: str) -> None:
    """Give a pick the time that a person has typed; what is no number is not taken."""
    try:
        time = float(text.strip().removesuffix("s").replace(",", "."))
    except ValueError:
        return
    if np.isfinite(time):
        thing[picks.TIME_KEY] = time
        for scene in thing.users_scene:
            touch(scene, [thing[picks.TRAJECTORY_KEY]])


def nudge(scene: bpy.types.Scene, thing: bpy.types.Object, frames: float) -> None:
    """Move a pick in time by (parts of) a frame of the scene."""
    thing[picks.TIME_KEY] = float(thing[picks.TIME_KEY]) + frames / timing.frame_rate(scene)
    sync(scene, [thing[picks.TRAJECTORY_KEY]])


def _rebuild(
    scene: bpy.types.Scene,
    name: str,
    members: list[bpy.types.Object],
    parts: trajectories.Parts,
    dragging: bool,
) -> list[str]:
    """Compute one trajectory and show it; returns what there is to say about it."""
    surface = reconstruction.ground(scene)
    block = reconstruction.blocks_of(scene, {name})[name]
    reach = max(LEAST_REACH_M, REACH_RADII * block.radius_m)
    if not dragging:
        for thing in members:
            picks.absorb(scene, thing, surface, reach)
    members = picks.ordered(scene, members)
    result = reconstruction.reconstruct_scene(scene, picks.read(scene, members, surface, reach))
    offset = timing.offset_of(scene, name, float(result.picks.time_s[0]))
    trajectories.store_results(members, result)
    if not dragging:
        _pose(scene, members, result, offset)
    trajectories.show_trajectory(scene, name, result, offset, surface, parts, in_place=dragging)
    impact_rows.fill(scene, name)
    return problems.of_result(scene, result)[name]


def _pose(scene: bpy.types.Scene, members: list[bpy.types.Object], result: object, offset: float) -> None:
    rate, radius = timing.frame_rate(scene), scene.rockfall.marker_radius_m
    if state.KEYED_RATE_KEY not in scene:
        scene[state.KEYED_RATE_KEY] = rate
    for thing, normal in zip(members, trajectories.normals_of(result), strict=True):
        picks.pose(thing, normal, (float(thing[picks.TIME_KEY]) - offset) * timing.keyed_rate(scene), radius)


def _complete(name: str, parts: trajectories.Parts) -> bool:
    """Whether a trajectory has its flights and its block; a person may delete them."""
    return (state.FLIGHTS_ROLE, name) in parts and (state.BLOCK_ROLE, name) in parts


def _grey(scene: bpy.types.Scene, name: str, parts: trajectories.Parts) -> None:
    """The last good flights stay, in grey."""
    trail = parts.get((state.FLIGHTS_ROLE, name))
    if trail is not None:
        trail[trails.STALE_KEY] = True
        trails.paint_observed(scene, [trail])


def _forget(scene: bpy.types.Scene, name: str, parts: trajectories.Parts) -> None:
    """All picks of a trajectory are gone, so is what was made of them."""
    roles = (state.FLIGHTS_ROLE, state.BLOCK_ROLE)
    found = trajectories.parts_of(scene, [name]) | {key: thing for key, thing in parts.items() if key[1] == name}
    state.remove_objects([found[role, name] for role in roles if (role, name) in found])
    offsets = timing.kept_offsets(scene)
    if offsets.pop(name, None) is not None:
        timing.keep_offsets(scene, offsets)
    impact_rows.fill(scene, name)


def _finish(scene: bpy.types.Scene, changed: bool) -> None:
    """What concerns all trajectories, once nothing moves: colour scales, end of the animation, twins of the models."""
    if not changed:
        return
    scene[migration.SCHEMA_KEY] = migration.SCHEMA
    if trails.set_tops(scene):
        trails.paint_observed(scene)
    if twins.shown_models(scene):
        try:
            twins.follow(scene, reconstruction.reconstruct_scene(scene))
        except RockfallError as error:
            problems.keep_trajectories(scene, problems.of_trajectories(scene) | {"": [str(error)]})


def _ground_changed(scene: bpy.types.Scene) -> bool:
    """Whether there is another terrain than the trajectories were computed with; one that is gone changes nothing."""
    now = shown.ground(scene)
    if not now or now == scene.get(shown.GROUND_KEY, ""):
        return False
    scene[shown.GROUND_KEY] = now
    return True


def _heal(scene: bpy.types.Scene, things: list[bpy.types.Object]) -> None:
    """Copies of picks become picks of their own; picks from another scene come to this one's origin."""
    shift = state.read_shift(scene).vector
    seen: dict[str, bpy.types.Object] = {}
    for thing in sorted(things, key=lambda one: one.session_uid):
        identifier = thing.get(picks.ID_KEY)
        if identifier is None or identifier in seen:
            thing[picks.ID_KEY] = uuid.uuid4().hex
            if identifier is not None:
                _begin_copy(scene, thing, seen[identifier])
        seen[thing[picks.ID_KEY]] = thing
        own = thing.get(picks.PICK_SHIFT_KEY)
        if own is None:
            thing[picks.PICK_SHIFT_KEY] = shift.tolist()
        elif list(own) != shift.tolist():
            place = np.array(thing[picks.POSITION_KEY]) + np.array(own) - shift
            thing[picks.POSITION_KEY], thing[picks.PICK_SHIFT_KEY] = place.tolist(), shift.tolist()
            thing.location = place


def _originals(things: list[bpy.types.Object]) -> list[bpy.types.Object]:
    """Without the copies that a person is just placing: they are picks once they are let go."""
    first: dict[str | None, bpy.types.Object] = {}
    for thing in sorted(things, key=lambda one: one.session_uid):
        first.setdefault(thing.get(picks.ID_KEY), thing)
    return list(first.values())


def _begin_copy(scene: bpy.types.Scene, copy: bpy.types.Object, original: bpy.types.Object) -> None:
    """A copy is a pick at the moment that the scene shows, when that is another one than the original's."""
    copy[picks.ROW_KEY] = 0
    frame = scene.frame_current + scene.frame_subframe
    kept = original.get(picks.KEY_FRAME_KEY)
    if kept is not None and abs(frame - kept) > 0.5 and copy[picks.TIME_KEY] == original[picks.TIME_KEY]:
        copy[picks.TIME_KEY] = float(copy[picks.TIME_KEY]) + (frame - kept) / timing.keyed_rate(scene)
