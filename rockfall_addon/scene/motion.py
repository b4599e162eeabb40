# SPDX-License-Identifier: GPL-3.0-or-later
"""The motion of the scene's blocks over the time that the scene plays, as the motion graphs show it.

Computed when asked for, from what the scene stores, so it is right after an undo, too. Kept of each trajectory until
something of that changes: while a person drags a pick, one trajectory is computed again.
"""

import json
import zlib
from collections.abc import Iterable
from dataclasses import dataclass, field
from itertools import count

import bpy
import numpy as np

from ...core.analysis.motion_graphs import QUANTITIES, MotionCourse, delayed, motion_courses
from ...core.errors import RockfallError
from ...core.reconstruction.sightings import SeenVideo
from ...core.workflow.refinement import pixels_of
from . import fingerprints, own_impacts, picks, reconstruction, sightings, store, sync, timing, videos


@dataclass(frozen=True, eq=False)
class SceneMotion:
    """What the motion graphs show.

    Attributes
    ----------
    version : another one whenever anything in here is another.
    courses : in the order of the scene, on the display time: second 0 is scene frame 0. One that has not changed is the
        same object as before.
    problems : sentences about what is not shown, and why.
    """

    version: int = 0
    courses: tuple[MotionCourse, ...] = ()
    problems: tuple[str, ...] = ()


@dataclass(eq=False)
class _Kept:
    """What was found for a scene, and what for."""

    keys: dict[str, object] = field(default_factory=dict)
    courses: dict[str, MotionCourse] = field(default_factory=dict)
    problems: dict[str, str] = field(default_factory=dict)
    found: SceneMotion = field(default_factory=SceneMotion)


_kept: dict[int, _Kept] = {}  # session_uid of a scene
_versions = count(1)

OF_A_TRACK = (
    store.TRACK_NAMES, store.TRACK_ROWS, store.CLOCK, store.ROW_TIME, store.CAMERA, store.POSE_TIMES, store.POSES,
    store.CAMERA_SHIFT,
)  # fmt: skip
"""What the residuals of a video's tracks depend on, of its camera."""


def motion_of(scene: bpy.types.Scene) -> SceneMotion:
    """The motion of a scene's blocks as it is now."""
    if scene.session_uid not in _kept:
        for gone in _kept.keys() - {one.session_uid for one in bpy.data.scenes}:
            del _kept[gone]
        _kept[scene.session_uid] = _Kept()
    kept = _kept[scene.session_uid]
    keys = _keys(scene)
    changed = [name for name, key in keys.items() if kept.keys.get(name) != key]
    if changed or keys.keys() != kept.keys.keys():
        kept.keys = keys
        for name in [name for name in kept.courses if name not in keys]:
            del kept.courses[name]
        for name in changed:
            kept.courses.pop(name, None), kept.problems.pop(name, None)
        _compute(scene, kept, changed)
        courses = tuple(kept.courses[name] for name in keys if name in kept.courses)
        problems = tuple(dict.fromkeys(text for name, text in kept.problems.items() if name in keys))
        kept.found = SceneMotion(next(_versions), courses, problems)
    return kept.found


def forget() -> None:
    """Another file was opened."""
    _kept.clear()


def _keys(scene: bpy.types.Scene) -> dict[str, object]:
    """Trajectory → all that its motion depends on."""
    common = (own_impacts.settings_key(scene), tuple(_track_key(one) for one in videos.cameras(scene)))
    offsets = timing.kept_offsets(scene)
    return {
        name: (text, offsets.get(name), common)
        for name, text in fingerprints.remembered(scene).items()
    }  # fmt: skip


def _track_key(camera: bpy.types.Object) -> tuple[object, ...]:
    return (camera.name, *(_print(camera.get(key)) for key in OF_A_TRACK))


def _print(value: object) -> object:
    """Of a stored value: itself, or a checksum of numbers."""
    if value is None or isinstance(value, (str, float, int)):
        return value
    if hasattr(value, "to_dict"):
        return json.dumps(value.to_dict(), default=list, sort_keys=True)
    return zlib.crc32(np.asarray(value, dtype=np.float64).tobytes())


def _compute(scene: bpy.types.Scene, kept: _Kept, names: list[str]) -> None:
    """All together; where one of them has a problem, one by one."""
    groups = fingerprints.by_trajectory(picks.ordered(scene, picks.objects_of(scene, names)))
    seen, surface = _seen(scene, names), reconstruction.ground(scene)
    offsets = timing.kept_offsets(scene)

    def add(members: Iterable[bpy.types.Object], name: str = "") -> None:
        if name:
            result = sync.reconstruct_trajectory(scene, name, list(members), surface)
        else:
            result = reconstruction.reconstruct_scene(scene, picks.read(scene, list(members)), surface)
        pixels = pixels_of(seen)[0] if seen else None
        views = [video.view for video in seen]
        if pixels is not None:
            pixels = pixels.take(np.isin(pixels.trajectory, np.unique(result.picks.trajectory)))
        for course in motion_courses(result, surface, views, pixels, QUANTITIES):
            kept.courses[course.trajectory] = delayed(course, -offsets.get(course.trajectory, 0.0))

    try:
        if len(groups) > 1:
            add(obj for members in groups.values() for obj in members)
            return
    except RockfallError:  # one of them has a problem
        kept.courses = {name: one for name, one in kept.courses.items() if name not in groups}
    for name, members in groups.items():
        try:
            add(members, name)
        except RockfallError as error:
            kept.problems[name] = str(error)


def _seen(scene: bpy.types.Scene, names: list[str]) -> list[SeenVideo]:
    """What was tracked of trajectories, in the videos that are aligned."""
    found = []
    for camera in videos.cameras(scene):
        there = [name for name in sightings.names_in(camera) if name in names]
        try:
            if there:
                found.append(sightings.seen_video(camera, there))
        except RockfallError:  # not aligned: nothing is known of the pixels
            continue
    return found
