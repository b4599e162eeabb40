# SPDX-License-Identifier: GPL-3.0-or-later
"""The trajectories follow their picks: whatever changes a pick, its trajectory, and no other, is computed again.

Nothing is told by whoever changes a pick. `sync` compares fingerprints of the picks with those of what is shown; the
handlers only say where to look, and a timer does the work, since data must not be changed while Blender evaluates them.
While a person drags, picks are read where they are dragged to; what was done is absorbed when the mouse is released.
"""

from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass

import bpy
import numpy as np

from ....core.errors import RockfallError
from ....core.reconstruction.block import Block
from ....core.reconstruction.trajectory import Reconstruction
from ....core.remarks import Remark
from ....core.terrain.surface import Surface
from .. import problems
from ..models import models
from ..picks import block_keys, impact_rows, keyframes, pick_names, picks, reconstruction, spins, trails, trajectories
from ..simulation import simulation
from ..storage import copies, fingerprints, folders, keepers, migration, set_aside, store, undo
from ..terrain import terrain_mesh, terrain_view
from . import timing

DRAGGING = ("TRANSFORM_OT_", "_OT_duplicate_move", "ROCKFALL_OT_drag", "ROCKFALL_OT_mark_pair")
"""Parts of the names of operators in which a person holds something; that of a macro is not that of its last step."""
REACH_RADII = 1.0
"""A pick nearer to the terrain than this many radii of its block lies on it, and stays on it when it is moved."""
LEAST_REACH_M = 0.1
POLL_S = 0.015

_waiting: dict[int, set[str] | None] = {}  # session_uid of a scene → trajectories to look at, None for all

_owing = [False]
"""Whether the step that Blender has stored for undo is to be extended, which waits until nobody drags: what is half
done belongs to no step."""
_field = [""]
"""The panel's field that was edited last, and not looked at since."""
_resting: list[bool] = []
_recomputing: set[int] = set()  # session_uid of scenes
_busy: list[int] = []
"""session_uid of scenes that are looked at just now, one because of another."""


@dataclass
class Done:
    """What a `sync` has done: trajectories it computed again or could not; whether picks followed their block's keys or
    have new names, and objects came or went: the step that Blender has stored for undo has to know of these.
    """

    rebuilt: list[str]
    failed: list[str]
    step_changed: bool = False


def touch(scene: bpy.types.Scene, names: Iterable[str] | None = None, field: str = "") -> None:
    """Something may have changed in these trajectories (None: anywhere): look soon, in background at once.

    field : of a panel, which has changed it: Blender's step for undo has its name, not an operator's.
    """
    _field[0] = field or _field[0]
    key, asked = scene.session_uid, None if names is None else set(names)
    before = _waiting.get(key, set())
    _waiting[key] = None if asked is None or before is None else before | asked
    if bpy.app.background:
        work()
    elif not bpy.app.timers.is_registered(work):
        bpy.app.timers.register(work, first_interval=0.0)


def notice(scene: bpy.types.Scene, depsgraph: bpy.types.Depsgraph) -> None:
    """From Blender's list of updates, find what to look at.

    Nothing is asked of an update's `original`: after a scene was deleted it may be no more, and Blender crashes.
    """
    names: set[str] = set()
    actions: set[str] = set()
    anywhere = False
    for update in depsgraph.updates:  # a scene is in it at every selection; then nothing of it is updated
        obj = update.id
        if isinstance(obj, bpy.types.Action):  # a key that was inserted or deleted moves no object at this frame
            actions.add(obj.name)
        elif isinstance(obj, bpy.types.Object):
            role = obj.get(store.ROLE)
            name = obj.get(store.TRAJECTORY)
            if role in (store.PICK_ROLE, store.BLOCK_ROLE) and isinstance(name, str):
                names.add(name)
            elif role in (store.PICK_ROLE, store.SET_ASIDE_ROLE):
                anywhere = True  # what it belongs to is known once it was looked at
            elif role == store.TERRAIN_ROLE:
                anywhere = True
                if update.is_updated_geometry:
                    terrain_mesh.mistrust()
            elif role == store.STRUCTURE_ROLE and update.is_updated_geometry:
                terrain_mesh.mistrust()
        elif isinstance(obj, bpy.types.Collection) or (
            isinstance(obj, bpy.types.Scene) and (update.is_updated_transform or update.is_updated_geometry)
        ):
            anywhere = True
    names |= _moved_by(scene, actions) if actions else set()
    if names or (anywhere and migration.version(scene) is not None):
        touch(scene, None if anywhere else names)


def _moved_by(scene: bpy.types.Scene, actions: set[str]) -> set[str]:
    """The trajectories whose block has one of these actions."""
    blocks = ((obj, keyframes.action_of(obj)) for obj in store.of_role(scene, store.BLOCK_ROLE))
    return {
        obj[store.TRAJECTORY]
        for obj, action in blocks
        if action is not None and action.name in actions and store.TRAJECTORY in obj
    }


@contextmanager
def at_rest() -> Iterator[None]:
    """While a reconstruction is shown bit by bit: what changes is looked at afterwards."""
    _resting.append(True)
    try:
        yield
    finally:
        _resting.pop()


@problems.guarded
def work() -> float | None:
    """Do what is waiting; as a timer, come again while a person still drags."""
    if _resting:
        return POLL_S
    waiting = dict(_waiting)
    _waiting.clear()
    dragging = is_dragging()
    for scene in bpy.data.scenes:
        if scene.session_uid in waiting:
            names = waiting[scene.session_uid]
            _owing[0] = sync(scene, names, dragging=dragging).step_changed or _owing[0]
            if dragging:
                _waiting[scene.session_uid] = names
    if dragging:
        return POLL_S
    field, _field[0] = _field[0], ""
    if _owing[0]:
        _owing[0] = False
        undo.extend_last_step(field or None)
    return None


def is_dragging() -> bool:
    """Whether a person is just moving something."""
    if bpy.app.background or bpy.context.window_manager is None:
        return False
    return any(
        part in operator.bl_idname
        for window in bpy.context.window_manager.windows
        for operator in window.modal_operators
        for part in DRAGGING
    )


def sync(
    scene: bpy.types.Scene,
    names: Iterable[str] | None = None,
    *,
    dragging: bool = False,
    again: bool = False,
    undone: bool = False,
) -> Done:
    """Bring what is shown of some trajectories (None: of all) in line with their picks.

    dragging : the picks are only read, not written: a person holds them.
    undone : an undo or redo has just brought something back: no objects come or go.
    again : compute them even where nothing has changed.
    """
    if migration.is_left_alone(scene):
        return Done([], [])
    if dragging:
        with store.looking(scene):
            return _sync(scene, names, dragging, again, undone, {})
    _busy.append(scene.session_uid)
    try:
        done = _sync_with_keepers(scene, names, again, undone)
    finally:
        _busy.pop()
    if names is None:  # where collections were moved, all is looked at
        done.step_changed = folders.remember() or done.step_changed
    return done


def _sync_with_keepers(scene: bpy.types.Scene, names: Iterable[str] | None, again: bool, undone: bool) -> Done:
    """A scene whose picks another one keeps: what was done to them is absorbed there, and written there afterwards."""
    first = _ask_keepers(scene, names, undone)
    with store.looking(scene):
        done = _sync(scene, names, False, again, undone, keepers.kept_elsewhere(scene))
    after = _ask_keepers(scene, [*done.rebuilt, *done.failed], undone)
    done.step_changed = done.step_changed or first or after
    return done


def _ask_keepers(scene: bpy.types.Scene, names: Iterable[str] | None, undone: bool) -> bool:
    """Look at these trajectories in the scenes that keep them; whether picks have changed."""
    asked: dict[bpy.types.Scene, set[str]] = {}
    for obj, keeper in keepers.kept_elsewhere(scene).items():
        name = obj.get(store.TRAJECTORY)
        if isinstance(name, str) and (names is None or name in names) and keeper.session_uid not in _busy:
            asked.setdefault(keeper, set()).add(name)
    changed = False
    for keeper, which in asked.items():
        changed = sync(keeper, which, undone=undone).step_changed or changed
    return changed


def _sync(
    scene: bpy.types.Scene,
    names: Iterable[str] | None,
    dragging: bool,
    again: bool,
    undone: bool,
    elsewhere: keepers.Elsewhere,
) -> Done:
    done, before = Done([], []), store.comings()
    wanted = None if names is None else set(names)
    if not dragging:
        came = set_aside.look(scene, wanted)
        wanted = None if wanted is None else wanted | came
    timing.follow_frame_rate(scene)  # what is waiting may be done before Blender says that the rate has changed
    if not dragging:
        terrain_view.follow_edits(scene)
    objects = picks.objects_of(scene, wanted)
    if not objects and store.SHOWN not in scene:
        if not dragging:
            problems.update(scene)
        return done
    parts = trajectories.parts_of(scene, wanted)
    edited: dict[str, str] = {}
    if dragging:
        objects, resample = copies.originals(objects), False
    else:
        done.step_changed = copies.heal(scene, objects)
        again, resample = again or _ground_changed(scene), _rate_changed(scene)
        if (again or resample) and wanted is not None:
            wanted, objects, parts = None, picks.objects_of(scene), trajectories.parts_of(scene)
        edited = _take_edits_of_blocks(scene, objects, parts, undone, elsewhere, done)
        objects = picks.objects_of(scene, wanted)
    groups = fingerprints.by_trajectory(objects)
    prints, said = fingerprints.remembered(scene), problems.of_trajectories(scene)
    there = groups if wanted is None else store.trajectories_of(scene, store.PICK_ROLE)
    gone = [name for name in prints if name not in there]
    apart = {set_aside.trajectory_of(obj) for obj in set_aside.of_picks(scene)}
    for name in gone:
        if name in apart:  # its last flights wait for its picks
            _grey(scene, name, trajectories.parts_of(scene, [name]))
        else:
            _forget(scene, name)
        prints.pop(name), said.pop(name, None)
    altered, blocks = again or bool(gone), {} if dragging else _blocks_of(scene, groups)
    for name, members in groups.items():
        held = _held(name, parts) if dragging else picks.NOTHING_HELD
        changed = _has_changed(
            name, members, prints.get(name, ""), parts, timing.keyed_rate(scene), dragging, held, elsewhere
        )
        changed = changed or (undone and any(picks.keyed_elsewhere(one) for one in members))
        changed = changed or (name in blocks and _has_other_block(parts.get((store.FLIGHTS_ROLE, name)), blocks[name]))
        if changed or again or resample or name in edited:
            altered = altered or changed or name in edited
            prints[name], said[name] = _try_rebuild(scene, name, members, parts, dragging, held, elsewhere, done)
            if edited.get(name):
                said[name].append(Remark(edited[name], "warning", name))
    if not dragging:
        for members in groups.values():
            if not any(one in elsewhere for one in members):
                done.step_changed = pick_names.follow(members) or done.step_changed
    fingerprints.remember(scene, prints)
    problems.keep_trajectories(scene, said)
    if altered and not dragging:
        _finish(scene, done.rebuilt)
    problems.update(scene)
    done.step_changed = done.step_changed or store.comings() != before
    return done


def reach_of(block: Block) -> float:
    """How near to the terrain a pick of a block lies on it [m]."""
    return max(LEAST_REACH_M, REACH_RADII * block.radius_m)


def reconstruct_trajectory(
    scene: bpy.types.Scene, name: str, members: Sequence[bpy.types.Object], surface: Surface | None
) -> Reconstruction:
    """One trajectory as it is shown, also while a person drags its picks or its block's keys.

    Raises
    ------
    RockfallError : whatever the core refuses.
    """
    held = _held(name, trajectories.parts_of(scene, [name])) if is_dragging() else picks.NOTHING_HELD
    reach = reach_of(reconstruction.blocks_of(scene, {name})[name])
    found = picks.read(scene, picks.ordered(scene, members, held), surface, reach, held)
    return reconstruction.reconstruct_scene(scene, found, surface)


def recompute(scene: bpy.types.Scene) -> None:
    """Reconstruct everything anew, after a setting has changed; the panel shows what cannot be computed.

    When one trajectory has a problem, the others still follow.
    """
    if migration.is_left_alone(scene) or scene.session_uid in _recomputing:
        return
    set_aside.look(scene)
    _recomputing.add(scene.session_uid)  # showing what has no flights yet sets sizes, which are settings
    try:
        reconstruction.refresh(scene)
        follow_spins(scene)
    except RockfallError:
        sync(scene, again=True)
    finally:
        _recomputing.discard(scene.session_uid)
    simulation.follow(scene)


def follow_spins(scene: bpy.types.Scene) -> None:
    """Everything was shown anew: spins are measured on these flights; where one has changed, its trajectory follows."""
    names = spins.names(scene)
    if names:
        spins.measure_all(scene)
        sync(scene, names)


def retime(obj: bpy.types.Object, text: str) -> None:
    """Give a pick the time that a person has typed; what is no number is not taken."""
    try:
        time = float(text.strip().removesuffix("s").replace(",", "."))
    except ValueError:
        return
    if np.isfinite(time):
        obj[store.TIME] = time
        for scene in obj.users_scene:
            touch(scene, [obj[store.TRAJECTORY]])


def nudge(scene: bpy.types.Scene, obj: bpy.types.Object, frames: float) -> None:
    """Move a pick in time by (parts of) a frame of the scene."""
    obj[store.TIME] = float(obj[store.TIME]) + frames / timing.frame_rate(scene)
    sync(scene, [obj[store.TRAJECTORY]])


def _take_edits_of_blocks(
    scene: bpy.types.Scene,
    objects: list[bpy.types.Object],
    parts: trajectories.Parts,
    undone: bool,
    elsewhere: keepers.Elsewhere,
    done: Done,
) -> dict[str, str]:
    """Do to the picks what a person, or an undo, did to their blocks' keys.

    Returns
    -------
    The trajectories whose block was edited → why keys of it come back, empty when they do not.
    """
    edited = {}
    for name, members in fingerprints.by_trajectory(objects).items():
        block = parts.get((store.BLOCK_ROLE, name))
        if block is None or block in elsewhere:
            continue
        action, states = keyframes.action_of(block), block_keys.states_of(block)
        if action is not None and not states:
            block_keys.remember_by_frame(block, members)
            states = block_keys.states_of(block)
        written = int(action.get(store.WRITTEN, 0)) if action is not None else 0
        older = [one for one in members if one.get(store.WRITTEN, 0) < written]
        for obj in members:
            if obj.get(store.WRITTEN, 0) > written and obj[store.ID] in states and obj not in elsewhere:
                picks.bring_back(obj, states[obj[store.ID]])
        edits = block_keys.edits_of(block)
        if not edits or older:
            continue
        edited[name] = edits.put_back
        if edits.put_back or (undone and edits.is_of_objects):
            continue
        picks.take_edits(scene, members, edits)
        block_keys.remember(block, [picks.with_id(scene, one) for one in edits.identifiers])
        done.step_changed = True
    return edited


def _held(name: str, parts: trajectories.Parts) -> picks.Held:
    """What a person is just doing to the keys of a trajectory's block."""
    block = parts.get((store.BLOCK_ROLE, name))
    return picks.NOTHING_HELD if block is None else block_keys.edits_of(block).changes


def _has_changed(
    name: str,
    members: list[bpy.types.Object],
    before: str,
    parts: trajectories.Parts,
    rate: float,
    dragging: bool,
    held: picks.Held,
    elsewhere: keepers.Elsewhere,
) -> bool:
    """Whether the picks differ from what is shown, hold an edit to be absorbed, or what is shown is damaged."""
    if not dragging and any(
        picks.moved(one) or picks.frames_moved(one) or keyframes.action_of(one) is None for one in members
    ):
        return True
    now = fingerprints.fingerprint(members, rate, held)
    if before.endswith(fingerprints.COMPLETE):
        trail, block = (parts.get((role, name)) for role in (store.FLIGHTS_ROLE, store.BLOCK_ROLE))
        if trail is None or block is None:
            return True
        asked = not dragging and block not in elsewhere
        if asked and not (fingerprints.is_marked(trail, block, now) and _of_one_version(members, block)):
            return True
    return before.rstrip(fingerprints.COMPLETE) != now


def _blocks_of(scene: bpy.types.Scene, names: Iterable[str]) -> dict[str, Block]:
    """The block of each trajectory; none where one of them cannot be: its trajectory says so."""
    try:
        return reconstruction.blocks_of(scene, set(names))
    except RockfallError:
        return {}


def _has_other_block(trail: bpy.types.Object | None, block: Block) -> bool:
    """Whether what is shown was computed with another block: it was edited, or an undo has brought one back."""
    return trail is not None and trail.get(store.BLOCK_SHOWN, repr(block)) != repr(block)


def _of_one_version(members: list[bpy.types.Object], block: bpy.types.Object) -> bool:
    """Whether picks, their keys and those of the block were written together; an undo may bring back some of them."""
    found = {version for obj in members for version in picks.versions(obj)}
    return found == {picks.versions(block)[1]}


def _try_rebuild(
    scene: bpy.types.Scene,
    name: str,
    members: list[bpy.types.Object],
    parts: trajectories.Parts,
    dragging: bool,
    held: picks.Held,
    elsewhere: keepers.Elsewhere,
    done: Done,
) -> tuple[str, list[Remark]]:
    """Compute one trajectory and show it, or keep the last good flights; its fingerprint, and what there is to say."""
    try:
        said = _rebuild(scene, name, members, parts, dragging, held, elsewhere)
    except RockfallError as error:
        _grey(scene, name, parts)
        if not dragging:
            _keep_keys(scene, name, [obj for obj in members if obj not in elsewhere])
        done.failed.append(name)
        return fingerprints.fingerprint(members, timing.keyed_rate(scene), held), [Remark(str(error), "problem", name)]
    done.rebuilt.append(name)
    text = fingerprints.fingerprint(members, timing.keyed_rate(scene), held)
    shown = trajectories.parts_of(scene, [name])
    trail, block = (shown.get((role, name)) for role in (store.FLIGHTS_ROLE, store.BLOCK_ROLE))
    fingerprints.mark(trail, block, text)
    return text + (fingerprints.COMPLETE if trail is not None and block is not None else ""), said


def _rebuild(
    scene: bpy.types.Scene,
    name: str,
    members: list[bpy.types.Object],
    parts: trajectories.Parts,
    dragging: bool,
    held: picks.Held,
    elsewhere: keepers.Elsewhere,
) -> list[Remark]:
    """Compute one trajectory and show it; returns what there is to say about it."""
    surface = reconstruction.ground(scene)
    block = reconstruction.blocks_of(scene, {name})[name]
    reach = reach_of(block)
    if not dragging:
        for obj in members:
            picks.absorb(scene, obj, surface, reach)
    members = picks.ordered(scene, members, held)
    result = reconstruction.reconstruct_scene(scene, picks.read(scene, members, surface, reach, held))
    if not dragging:
        result = spins.follow(scene, members, result)
    offset = timing.offset_of(scene, name, float(result.picks.time_s[0]))
    trajectories.store_results(members, result, elsewhere)
    if not dragging:
        _pose(scene, members, result, offset, parts.get((store.BLOCK_ROLE, name)), elsewhere)
    if parts.get((store.BLOCK_ROLE, name)) in elsewhere:
        impact_rows.fill(scene, name)
        return problems.of_result(scene, result)[name]
    trail = trajectories.show_trajectory(scene, name, result, members, offset, surface, parts, held=dragging)
    if trail is not None:
        trails.paint_observed(scene, [trail])
    impact_rows.fill(scene, name)
    return problems.of_result(scene, result)[name]


def _pose(
    scene: bpy.types.Scene,
    members: list[bpy.types.Object],
    result: object,
    offset: float,
    block: bpy.types.Object | None,
    elsewhere: keepers.Elsewhere,
) -> None:
    rate, radius = timing.keyed_rate(scene), scene.rockfall.marker_radius_m
    version = picks.next_version(members if block is None else [*members, block])
    scene[store.KEYED_RATE] = rate
    for obj, normal in zip(members, trajectories.normals_of(result), strict=True):
        if obj in elsewhere:
            continue
        frame = (float(obj[store.TIME]) - offset) * rate
        picks.pose(obj, normal, frame, radius, version)


def _keep_keys(scene: bpy.types.Scene, name: str, members: list[bpy.types.Object]) -> None:
    """An edit with which the trajectory cannot be computed stays an edit: at the next frame the key would undo it."""
    if not members:
        return
    rate = timing.keyed_rate(scene)
    offset = timing.offset_of(scene, name, min(float(obj[store.TIME]) for obj in members))
    for obj in members:
        picks.key(obj, (float(obj[store.TIME]) - offset) * rate, int(obj.get(store.WRITTEN, 0)))


def _grey(scene: bpy.types.Scene, name: str, parts: trajectories.Parts) -> None:
    """The last good flights stay, in grey."""
    trail = parts.get((store.FLIGHTS_ROLE, name))
    if trail is not None:
        trail[store.STALE] = True
        trails.paint_observed(scene, [trail])


def _forget(scene: bpy.types.Scene, name: str) -> None:
    """All picks of a trajectory are gone, so is what was made of them."""
    store.remove_objects(list(trajectories.parts_of(scene, [name]).values()))
    offsets = timing.kept_offsets(scene)
    if offsets.pop(name, None) is not None:
        timing.keep_offsets(scene, offsets)
    impact_rows.fill(scene, name)


def _finish(scene: bpy.types.Scene, rebuilt: list[str]) -> None:
    """What concerns all trajectories, once nothing moves: the ends of the colour scales, the twins of the models."""
    scene[store.SCHEMA] = migration.SCHEMA
    last = max((float(obj.get(store.KEY_FRAME, 0.0)) for obj in picks.objects_of(scene, rebuilt)), default=0.0)
    if last > scene.frame_end:
        scene.frame_end = int(np.ceil(last + timing.frame_rate(scene)))
    if trails.set_tops(scene):
        trails.paint_observed(scene)
    simulation.follow(scene)
    if models.shown_models(scene):
        try:
            models.follow(scene, reconstruction.reconstruct_good(scene)[0])
        except RockfallError as error:
            problems.keep_trajectories(
                scene, problems.of_trajectories(scene) | {"": [Remark(str(error), "problem", "models")]}
            )


def _ground_changed(scene: bpy.types.Scene) -> bool:
    """Whether there is another terrain than the trajectories were computed with; one that is gone changes nothing."""
    now = fingerprints.ground(scene), fingerprints.ground_contents(scene)
    before = scene.get(store.GROUND, ""), scene.get(store.GROUND_CONTENTS, now[1])
    if not now[0]:
        return False
    if now != before or store.GROUND_CONTENTS not in scene:
        scene[store.GROUND], scene[store.GROUND_CONTENTS] = now
    return now != before


def _rate_changed(scene: bpy.types.Scene) -> bool:
    """Whether the flights have their ticks at another frame rate than the scene's."""
    rate = timing.frame_rate(scene)
    if scene.get(store.TICK_RATE) == rate:
        return False
    scene[store.TICK_RATE] = rate
    return True
