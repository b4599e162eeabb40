# SPDX-License-Identifier: GPL-3.0-or-later
"""Picks: one object each, placed on the terrain and keyed at its time.

The doubles are kept as ID properties, beside the frame at which the key was written. A person edits a pick by moving
its object (its place differs from the kept one) or its key (the frame differs); `read` sees the edit at once, `absorb`
makes it the pick's state.
"""

import uuid
from collections import Counter
from collections.abc import Generator, Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import bpy
import numpy as np
from mathutils import Quaternion, Vector

from ....core.reconstruction.picks import Picks, make_picks
from ....core.terrain.raycast import closest_point
from ....core.terrain.surface import Surface
from ....core.vectors import Array
from ..footage import timing
from ..storage import materials, store
from ..terrain import georeference
from . import block_keys, keyframes, pick_names
from .block_keys import Change

CONFIDENCE_SIGMA_M = {1: 0.50, 2: 0.20, 3: 0.05}
"""Standard deviation that a person's confidence in a place stands for, where the pick has none of its own [m]."""

MARKER_COLOURS = {  # sRGB, after Okabe & Ito 2008; those in flight are paler than any model's colour
    "impact": (0.95, 0.95, 0.95),
    "release": (0.00, 0.62, 0.45),
    "pass": (0.62, 0.70, 0.78),
    "contact": (0.00, 0.45, 0.70),
    "stop": (0.94, 0.89, 0.26),
    "takeoff": (0.84, 0.74, 0.90),
}
MARKER_LIFT = 0.15  # of the radius, so that the disc is not swallowed by the rough surface


Held = Mapping[str, Change]
"""What a person is just doing to the keys of blocks, by the picks' ids."""
NOTHING_HELD: Held = {}
UNCHANGED = Change()


def objects_of(scene: bpy.types.Scene, trajectories: Iterable[str] | None = None) -> list[bpy.types.Object]:
    """The objects of the picks, all or those of some trajectories, in no order."""
    names = (None,) if trajectories is None else set(trajectories)
    with store.looking(scene):
        return [
            obj
            for name in names
            for obj in store.of_role(scene, store.PICK_ROLE, name)
            if store.TRAJECTORY in obj and store.TIME in obj and store.POSITION in obj
        ]


def with_id(scene: bpy.types.Scene, identifier: str) -> bpy.types.Object | None:
    """The pick with an id."""
    return next((obj for obj in objects_of(scene) if obj.get(store.ID) == identifier), None)


def show_picks(
    scene: bpy.types.Scene, picks: Picks, normals: np.ndarray, offsets: dict[str, float], radius_m: float
) -> Generator[tuple[str, int, int], None, list[bpy.types.Object]]:
    """Bring the picks' objects in line; a pick that is there already (by trajectory and time) keeps its object and id.

    normals : (n, 3) directions of the discs, NaN rows lie flat.
    offsets : from `timing.offsets_of`.

    Yields
    ------
    Its progress: what it does, done, total.

    Returns
    -------
    The object of each pick.
    """
    written = (*store.of_role(scene, store.PICK_ROLE), *store.of_role(scene, store.BLOCK_ROLE))
    rate, version, shown = timing.keyed_rate(scene), next_version(written), []
    there = {(o[store.TRAJECTORY], time_of(o, rate)): o for o in objects_of(scene)}
    folders = store.collections(scene, "Trajectories", dict.fromkeys(picks.trajectory.tolist()))
    numbers, like = Counter[tuple[str, str]](), None
    for i in range(len(picks.time_s)):
        yield "Showing picks", i, len(picks.time_s)
        trajectory, kind, time = str(picks.trajectory[i]), str(picks.kind[i]), float(picks.time_s[i])
        numbers[trajectory, kind] += 1
        obj = there.pop((trajectory, time), None)
        if obj is None:
            obj = _new(folders[trajectory], trajectory, kind, numbers[trajectory, kind])
        obj[store.TRAJECTORY], obj[store.TIME] = trajectory, time
        obj[store.POSITION] = picks.position[i].tolist()
        obj[store.KIND], obj[store.STATUS] = kind, str(picks.status[i])
        obj[store.ROW] = int(picks.row[i])
        for key, value in (
            (store.NORMAL, picks.normal[i]),
            (store.SPIN, picks.angular_velocity[i]),
            (store.SIGMA_TIME, picks.sigma_time_s[i : i + 1]),
            (store.SIGMA_POSITION, picks.sigma_position_m[i : i + 1]),
        ):
            if np.isfinite(value).all() and not (key == store.SIGMA_POSITION and _of_confidence(picks, i)):
                obj[key] = value.tolist()
            elif key in obj:
                del obj[key]
        extra = {name: str(values[i]) for name, values in picks.extra.items()}
        if store.EXTRA not in obj or obj[store.EXTRA].to_dict() != extra:
            obj[store.EXTRA] = extra
        obj[store.PICK_SHIFT] = picks.shift.vector.tolist()
        pose(obj, normals[i], (time - offsets[trajectory]) * rate, radius_m, version, like)
        if len(folders) > keyframes.MANY_ACTIONS and like is None:
            like = keyframes.to_be_copied(obj, keyframes.OF_MANY_PICKS)
        shown.append(obj)
    store.remove_objects(list(there.values()))
    of: dict[str, list[bpy.types.Object]] = {}
    for obj in shown:
        of.setdefault(obj[store.TRAJECTORY], []).append(obj)
    for members in of.values():
        pick_names.follow(members)
    scene[store.PICKS_SOURCE] = picks.source
    return shown


def add_pick(
    scene: bpy.types.Scene,
    trajectory: str,
    time_s: float,
    position_m: Sequence[float] | Array,
    *,
    kind: str = "impact",
    status: str = "ok",
    extra: Mapping[str, str] | None = None,
) -> bpy.types.Object:
    """A new pick at a local place; `live.sync` then makes the trajectory follow."""
    number = 1 + sum(other[store.KIND] == kind for other in objects_of(scene, [trajectory]))
    obj = _new(store.collection(scene, "Trajectories", trajectory), trajectory, kind, number)
    obj[store.TRAJECTORY], obj[store.TIME], obj[store.ROW] = trajectory, float(time_s), 0
    obj[store.POSITION] = _writable(scene, position_m)
    obj[store.KIND], obj[store.STATUS] = kind, status
    obj[store.EXTRA] = dict(extra or {})
    obj[store.PICK_SHIFT] = georeference.read_shift(scene).vector.tolist()
    offset = timing.offset_of(scene, trajectory, float(time_s))
    frame = (float(time_s) - offset) * timing.keyed_rate(scene)
    pose(obj, np.full(3, np.nan), frame, scene.rockfall.marker_radius_m, 0)
    return obj


def next_version(objects: Iterable[bpy.types.Object]) -> int:
    """A number above all with which something of these picks and blocks was written."""
    return 1 + max((max(versions(obj)) for obj in objects), default=0)


def versions(obj: bpy.types.Object) -> tuple[int, int]:
    """With which version an object and its action were written; 0 for neither, and for an action that is missing.

    Both are written together. Blender's undo brings back only what the undone step has changed, and not what followed
    from it later: then they differ, the older one is what was brought back, and it is right.
    """
    action, own = keyframes.action_of(obj), int(obj.get(store.WRITTEN, 0))
    return own, own if action is None else int(action.get(store.WRITTEN, 0))


def pose(
    obj: bpy.types.Object,
    normal: Array,
    frame: float,
    radius_m: float,
    version: int,
    like: bpy.types.Action | None = None,
) -> None:
    """Put a pick's object where its state says: marker, direction, size, place, one key. Unchanged values stay.

    like : see `keyframes.key_location_once`.
    """
    marker = _marker(obj[store.KIND])
    if obj.data is not marker and obj.type == "MESH":  # one whose mesh somebody deleted is an empty, and takes none
        obj.data = marker
    up = Vector(normal) if np.isfinite(normal).all() else Vector((0.0, 0.0, 1.0))
    turn = up.to_track_quat("Z", "Y")
    if obj.rotation_mode != "QUATERNION":
        obj.rotation_mode = "QUATERNION"
    if (Quaternion(obj.rotation_quaternion) - turn).magnitude > 1e-6:
        obj.rotation_quaternion = turn
    if (obj.scale - Vector((radius_m,) * 3)).length > 1e-6 * radius_m:
        obj.scale = (radius_m,) * 3
    key(obj, frame, version, like)


def key(obj: bpy.types.Object, frame: float, version: int, like: bpy.types.Action | None = None) -> None:
    """Put a pick's object, and its one key, where its state says.

    A key that rounding alone separates from the frame stays: its time has followed it exactly, and follows it back.
    """
    place = list(obj[store.POSITION])
    if not _same_place(obj.location, place):
        obj.location = place
    if not _keyed_at(obj, frame):
        keyframes.key_location_once(obj, frame, like)
    obj[store.KEY_FRAME] = float(keyframes.location_curves(obj)[0].keyframe_points[0].co[0])
    obj[store.WRITTEN] = keyframes.action_of(obj)[store.WRITTEN] = version


def picks_of(scene: bpy.types.Scene) -> Picks:
    """The picks as they stand in the scene: trajectories in the order of their starts.

    Raises
    ------
    InputError : two picks of a trajectory at one time, and whatever else `make_picks` refuses.
    """
    return read(scene, ordered(scene, objects_of(scene)))


def ordered(
    scene: bpy.types.Scene, objects: Iterable[bpy.types.Object], held: Held = NOTHING_HELD
) -> list[bpy.types.Object]:
    """Trajectories in the order of their starts, the picks of each in the order of time."""
    rate = timing.keyed_rate(scene)
    rows = [(obj[store.TRAJECTORY], time_of(obj, rate, held), obj) for obj in objects]
    started: dict[str, float] = {}
    for name, time, _ in rows:
        started[name] = min(time, started.get(name, time))
    rows.sort(key=lambda row: (started[row[0]], row[0], row[1]))
    return [obj for _, _, obj in rows]


def read(
    scene: bpy.types.Scene,
    objects: Sequence[bpy.types.Object],
    surface: Surface | None = None,
    reach_m: float = 0.0,
    held: Held = NOTHING_HELD,
) -> Picks:
    """The picks of these objects, which are in order, with what a person is just doing to them.

    surface, reach_m : see `resting_place`; without a surface a moved pick is where its object is.
    held : what the person is doing to the keys of blocks.
    """
    rate = timing.keyed_rate(scene)
    extras = [obj[store.EXTRA].to_dict() if store.EXTRA in obj else {} for obj in objects]
    names = list(dict.fromkeys(name for extra in extras for name in extra))
    return make_picks(
        [obj[store.TRAJECTORY] for obj in objects],
        [time_of(obj, rate, held) for obj in objects],
        [resting_place(obj, surface, reach_m, held) for obj in objects],
        kind=[obj[store.KIND] for obj in objects],
        status=[obj[store.STATUS] for obj in objects],
        normal=[
            [np.nan] * 3
            if store.NORMAL not in obj or (surface is not None and moved(obj, held))
            else list(obj[store.NORMAL])
            for obj in objects
        ],
        sigma_time_s=_doubles(objects, store.SIGMA_TIME, 1),
        sigma_position_m=_doubles(objects, store.SIGMA_POSITION, 1),
        angular_velocity=_doubles(objects, store.SPIN, 3),
        row=[obj.get(store.ROW, 0) for obj in objects],
        extra={name: np.array([str(extra.get(name, "")) for extra in extras], dtype=np.str_) for name in names},
        source=Path(str(scene.get(store.PICKS_SOURCE, ""))).name,  # its folder would fill the panel
        shift=georeference.read_shift(scene),
        sort=True,
    )


def home_of(obj: bpy.types.Object, scene: bpy.types.Scene) -> bpy.types.Scene | None:
    """Another scene that shows this pick, too, and whose origin is the pick's; None where this scene may move it.

    Without this the pick would go from one origin to the other at every look at one of the scenes.
    """
    own = list(obj.get(store.PICK_SHIFT, ()))
    if obj.users == 1 or own == georeference.read_shift(scene).vector.tolist():
        return None
    others = (each for each in obj.users_scene if each != scene)
    return next((each for each in others if georeference.read_shift(each).vector.tolist() == own), None)


def moved(obj: bpy.types.Object, held: Held = NOTHING_HELD) -> bool:
    """Whether the object, or the key of its block, is elsewhere than the pick."""
    return not _same_place(obj.location, obj[store.POSITION]) or any(_held(obj, held).way)


def frames_moved(obj: bpy.types.Object) -> float:
    """How far the key was moved in time since it was written [frames]; keys that were added do not count."""
    kept, (own, of_action) = obj.get(store.KEY_FRAME), versions(obj)
    if kept is None or of_action > own:
        return 0.0
    for curve in keyframes.location_curves(obj):
        frames = [point.co[0] for point in curve.keyframe_points]
        if frames and np.isfinite(frames).all():
            nearest = min((frame - kept for frame in frames), key=abs)
            if not block_keys.same_frame(nearest + kept, kept):
                return nearest
    return 0.0


def keyed_elsewhere(obj: bpy.types.Object) -> bool:
    """Whether an object that is where its pick is has keys elsewhere: an undo has brought back the object alone."""
    return not moved(obj) and any(
        point.co[1] != obj.location[curve.array_index]
        for curve in keyframes.location_curves(obj)
        for point in curve.keyframe_points
    )


def time_of(obj: bpy.types.Object, rate: float, held: Held = NOTHING_HELD) -> float:
    """The pick's time on the common clock [s], with the edit of its key. `rate` is the one that the keys have."""
    shift = frames_moved(obj) or _held(obj, held).frames
    return float(obj[store.TIME]) + (shift / rate if shift else 0.0)


def resting_place(obj: bpy.types.Object, surface: Surface | None, reach_m: float, held: Held = NOTHING_HELD) -> Array:
    """(3,) where the pick is, with the edit of its object, or of the place that a key of its block has.

    A pick that was on the terrain, that is nearer to it than `reach_m`, stays on it: it is moved along the terrain, to
    the point closest to its object. A pass is a point in the air and goes where it is put.
    """
    stored = np.array(obj[store.POSITION])
    if not moved(obj, held):
        return stored
    place = np.array(obj.location, dtype=np.float64)
    if not moved(obj):
        place = stored + _held(obj, held).way
    if surface is None or obj[store.KIND] == "pass":
        return place
    if closest_point(surface, stored, reach_m) is None:
        return place
    found = closest_point(surface, place)
    return place if found is None else found.point


def take_edits(scene: bpy.types.Scene, objects: Iterable[bpy.types.Object], edits: block_keys.Edits) -> None:
    """Do to the picks what a person did to the keys of their block; an edit of the pick itself goes before.

    A copy has all that its pick has, but the row of a table and what was clicked for it, which are of another moment.
    """
    of, rate = {obj[store.ID]: obj for obj in objects}, timing.keyed_rate(scene)
    for identifier, frames in edits.copied:
        if identifier in of:
            copy = of[identifier].copy()
            copy.animation_data_clear()
            copy[store.ID], copy[store.ROW] = uuid.uuid4().hex, 0
            copy[store.TIME] = float(copy[store.TIME]) + frames / rate
            for key in (store.KEY_FRAME, store.SEEN):
                copy.pop(key, None)
            for collection in of[identifier].users_collection:
                store.link(collection, copy)
    for identifier, change in edits.changes.items():
        obj = of.get(identifier)
        if obj is None:
            continue
        if change.frames and not frames_moved(obj):
            obj[store.TIME] = float(obj[store.TIME]) + change.frames / rate
        if any(change.way) and not moved(obj):
            obj.location = np.array(obj[store.POSITION]) + change.way
    store.remove_objects([of[identifier] for identifier in edits.deleted if identifier in of])


def bring_back(obj: bpy.types.Object, state: Mapping[str, object]) -> None:
    """Make the pick what it was when its block's keys were written: an undo has brought back the keys alone."""
    for key in block_keys.STATE:
        if key in state:
            obj[key] = state[key]
        elif key in obj:
            del obj[key]
    obj.location = obj[store.POSITION]
    for curve in keyframes.location_curves(obj)[:1]:
        obj[store.KEY_FRAME] = float(curve.keyframe_points[0].co[0])  # an edit of its key, if any, is no edit now


def absorb(scene: bpy.types.Scene, obj: bpy.types.Object, surface: Surface | None, reach_m: float) -> bool:
    """Make what a person did to the object the state of the pick; True when there was something.

    On another place the terrain has another normal: one that came with the pick is dropped where there is a terrain.
    """
    changed = False
    frames = frames_moved(obj)
    if frames:
        obj[store.TIME] = float(obj[store.TIME]) + frames / timing.keyed_rate(scene)
        obj[store.KEY_FRAME] = float(obj[store.KEY_FRAME]) + frames
        changed = True
    if moved(obj):
        obj[store.POSITION] = _writable(scene, resting_place(obj, surface, reach_m))
        if surface is not None and store.NORMAL in obj:
            del obj[store.NORMAL]
        changed = True
    return changed


def trusted(picks: Picks) -> Picks:
    """The picks with the standard deviation that their confidence stands for, where they have none of their own."""
    if "confidence" not in picks.extra:
        return picks
    sigma = picks.sigma_position_m.copy()
    for i, text in enumerate(picks.extra["confidence"].tolist()):
        if np.isnan(sigma[i]) and text.isdecimal():
            sigma[i] = CONFIDENCE_SIGMA_M.get(int(text), np.nan)
    return replace(picks, sigma_position_m=sigma)


def _writable(scene: bpy.types.Scene, place: Sequence[float] | Array) -> list[float]:
    """A place whose survey coordinates are doubles, so that a table gives it back to the last bit."""
    shift = georeference.read_shift(scene)
    return shift.to_local(shift.to_survey(np.asarray(place, dtype=np.float64))).tolist()


def _of_confidence(picks: Picks, i: int) -> bool:
    """Whether a pick's standard deviation is no more than what its confidence says."""
    text = str(picks.extra["confidence"][i]) if "confidence" in picks.extra else ""
    return text.isdecimal() and CONFIDENCE_SIGMA_M.get(int(text)) == picks.sigma_position_m[i]


def set_extra(obj: bpy.types.Object, name: str, text: str) -> None:
    """Keep a further column of the pick, such as its note; an empty one is dropped."""
    extra = obj[store.EXTRA].to_dict() if store.EXTRA in obj else {}
    extra.pop(name, None)
    obj[store.EXTRA] = extra | ({name: text} if text else {})


def extra_of(obj: bpy.types.Object, name: str) -> str:
    """A further column of the pick as text."""
    return str(obj[store.EXTRA].get(name, "")) if store.EXTRA in obj else ""


def _new(folder: bpy.types.Collection, trajectory: str, kind: str, number: int) -> bpy.types.Object:
    obj = bpy.data.objects.new(pick_names.name_of(trajectory, kind, number), _marker(kind))
    obj[store.ROLE], obj[store.ID] = store.PICK_ROLE, uuid.uuid4().hex
    store.link(folder, obj)
    return obj


def _same_place(location: Vector, stored: Sequence[float]) -> bool:
    """Whether a single-precision place is that of these doubles."""
    return Vector(stored) == location if len(location) == 3 else False


def _keyed_at(obj: bpy.types.Object, frame: float) -> bool:
    """Whether the object has the one key that it should have."""
    curves = keyframes.location_curves(obj)
    return len(curves) == 3 and all(
        len(curve.keyframe_points) == 1
        and curve.keyframe_points[0].co[0] == curves[0].keyframe_points[0].co[0]
        and block_keys.same_frame(curve.keyframe_points[0].co[0], frame)
        and curve.keyframe_points[0].co[1] == obj.location[curve.array_index]
        for curve in curves
    )


def _held(obj: bpy.types.Object, held: Held) -> Change:
    return held.get(obj.get(store.ID, ""), UNCHANGED)


def _doubles(objects: Sequence[bpy.types.Object], key: str, width: int) -> np.ndarray:
    rows = [list(o[key]) if key in o else [np.nan] * width for o in objects]
    return np.array(rows, dtype=np.float64).reshape(-1, width)


def _marker(kind: str) -> bpy.types.Mesh:
    """A ring with a spot in it, of radius 1, shared by all picks of a kind."""
    name = f"Rockfall {kind}"
    existing = bpy.data.meshes.get((name, None))
    if existing is not None:
        return existing
    angles = np.linspace(0, 2 * np.pi, 24, endpoint=False)
    circle = np.column_stack([np.cos(angles), np.sin(angles), np.zeros(24)])
    rings = [radius * circle for radius in (1.0, 0.72, 0.30)]
    vertices = np.vstack(rings) + np.array([0.0, 0.0, MARKER_LIFT])
    following = (np.arange(24) + 1) % 24
    ring = np.column_stack([np.arange(24), following, 24 + following, 24 + np.arange(24)])
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata(vertices.tolist(), [], [*ring.tolist(), (48 + np.arange(24)).tolist()])
    colour = mesh.attributes.new("colour", "FLOAT_COLOR", "POINT")
    colour.data.foreach_set(
        "color", np.tile(materials.linear_colour(MARKER_COLOURS[kind]), len(vertices)).astype(np.float32)
    )
    mesh.attributes.active_color_name = mesh.attributes.default_color_name = "colour"
    mesh.materials.append(materials.emission_material("Rockfall marker", "colour"))
    return mesh
