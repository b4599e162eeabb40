# SPDX-License-Identifier: GPL-3.0-or-later
"""What is wrong, as remarks that the panels show: problems of trajectories, of the scene, and of ourselves."""

import json
from collections.abc import Callable
from dataclasses import replace
from functools import wraps
from pathlib import Path

import bpy
import numpy as np

from ...core.camera.quality import remarks_on_quality
from ...core.reconstruction.trajectory import Reconstruction
from ...core.remarks import Remark, from_plain, from_text, gravest_first, to_plain, to_text
from ...core.workflow.noticed import impossible_sizes
from . import camera_paths, fingerprints, migration, picks, set_aside_words, store, timing

MOST = 6
BACKSIDE = -0.17  # vertical part of a normal that points 10° or more below the horizon
CAMERA_ROLE = "camera"

_troubles: list[Remark] = []  # our own errors, each once


def keep_trajectories(scene: bpy.types.Scene, remarks: dict[str, list[Remark]]) -> None:
    """Store what there is to say about the trajectories."""
    text = json.dumps({name: to_plain(said) for name, said in remarks.items() if said})
    if scene.get(store.TRAJECTORY_PROBLEMS, "{}") != text:
        scene[store.TRAJECTORY_PROBLEMS] = text


def of_trajectories(scene: bpy.types.Scene) -> dict[str, list[Remark]]:
    """Trajectory → remarks."""
    kept = store.read_json(scene, store.TRAJECTORY_PROBLEMS, {})
    return {name: list(from_plain(values, "warning")) for name, values in kept.items()}


def of_result(scene: bpy.types.Scene, result: Reconstruction) -> dict[str, list[Remark]]:
    """Trajectory → what deserves a look in its reconstruction."""
    names = list(dict.fromkeys(result.picks.trajectory.tolist()))
    said: dict[str, list[Remark]] = {name: [] for name in names}
    for remark in (*result.remarks, *impossible_sizes(result)):
        for name in (remark.about,) if remark.about in said else names[:1]:  # what is of all stands with the first
            said[name].append(remark)
    impacts = result.impacts
    for i in np.flatnonzero(impacts.normal[:, 2] < BACKSIDE):
        name = str(impacts.trajectory[i])
        text = (
            f"Trajectory {name}, {impacts.time_s[i]:.3f} s: the pick is on the back of the terrain, "
            "whose normal points down there. Move it to the upper side, or turn the terrain's faces round."
        )
        said[name].append(Remark(text, "warning", name))
    start = first_instant(scene)
    if start is not None:
        early = np.flatnonzero(result.picks.time_s < start - 1e-6)
        for i in early[:1]:
            name, more = str(result.picks.trajectory[i]), f" and {early.size - 1} more" if early.size > 1 else ""
            text = (
                f"Trajectory {name}, {result.picks.time_s[i]:.3f} s{more}: the pick is before the start, at "
                f"{start:.3f} s. Move its key, or correct the time origin."
            )
            said[name].append(Remark(text, "warning", name))
    return said


def first_instant(scene: bpy.types.Scene) -> float | None:
    """Common time of the first picture, or the time origin when the scene plays as filmed; None when neither is set."""
    starts = []
    for obj in store.of_role(scene, CAMERA_ROLE):
        if store.VIDEO_TIMES in obj and store.CLOCK in obj:
            times = obj[store.VIDEO_TIMES]
            offset, drift, origin, rate, *_ = obj[store.CLOCK]
            if len(times):
                starts.append(offset + (1 + drift) * rate * (times[0] - origin))
    if starts:
        return min(starts)
    return timing.origin_s(scene) if scene.rockfall.playback == "REAL" else None


def update(scene: bpy.types.Scene) -> None:
    """Bring what the panel shows in line: the scene's problems and those of its trajectories, the gravest first."""
    said = _of_scene(scene)
    for one in of_trajectories(scene).values():
        said += one
    said = gravest_first(said)
    if len(said) > MOST:
        said = [*said[: MOST - 1], Remark(f"… and {len(said) - MOST + 1} more.")]
    text = to_text(said)
    if scene.get(store.PROBLEM, "") != text:
        scene[store.PROBLEM] = text


def remarks(scene: bpy.types.Scene) -> list[Remark]:
    """What the panels show."""
    newer = [Remark(migration.warning(scene), "problem", "version")] if migration.is_left_alone(scene) else []
    return [*newer, *_troubles, *from_text(str(scene.get(store.PROBLEM, "")), "warning")]


def of_cameras(scene: bpy.types.Scene) -> list[Remark]:
    """What is to be known of solved cameras that few pairs determine, for all that is measured with them."""
    cameras = store.of_role(scene, CAMERA_ROLE)
    return [said for camera in cameras for said in remarks_on_quality(camera_paths.quality_of(camera), camera.name)]


def guarded[**P, T](function: Callable[P, T]) -> Callable[P, T | None]:
    """For what Blender calls: an error is caught, printed in one line and shown on the panel, each text once."""

    @wraps(function)
    def call(*arguments: P.args, **named: P.kwargs) -> T | None:
        try:
            return function(*arguments, **named)
        except Exception as error:  # noqa: BLE001 - whatever it is, Blender would print it at every event
            failed(function.__name__, error)
            return None

    return call


def failed(where: str, error: Exception) -> None:
    """Remember an error of ours and print it, unless it is known already."""
    text = f"Something went wrong in Rockfall ({where}): {type(error).__name__}: {error}"
    trouble = Remark(text, "problem", where)
    if trouble not in _troubles:
        _troubles.append(trouble)
        print(f"Rockfall: {where}: {type(error).__name__}: {error}")


def forget() -> None:
    """Another file, another start: errors of ours may be told again."""
    _troubles.clear()


def _of_scene(scene: bpy.types.Scene) -> list[Remark]:
    said = set_aside_words.remarks(scene)
    if not said and store.HAS_SET_ASIDE in scene:
        del scene[store.HAS_SET_ASIDE]
    # Advice beside the picks, since they may be the only pairs there are: nothing else has to wait for it.
    said += [replace(one, severity="advice") for one in of_cameras(scene)]
    for path, count in store.linked_files(scene).items():
        many = f"{count} objects of Rockfall are" if count > 1 else "An object of Rockfall is"
        text = (
            f"{many} linked from {Path(path.replace(chr(92), '/')).name or 'another file'}, and not used: Blender does "
            "not save changes of these. Select them and choose Object > Relations > Make Local > All, or append."
        )
        said.append(Remark(text, "warning", "linked"))
    scale = scene.unit_settings.scale_length
    if scene.unit_settings.system != "NONE" and abs(scale - 1.0) > 1e-6 and picks.objects_of(scene):
        text = (
            f"The scene's unit scale is {scale:g}. Rockfall counts one unit as one metre, so the lengths that Blender "
            "shows are not those of the slope: set Scene Properties > Units > Unit Scale to 1."
        )
        said.append(Remark(text, "warning", "units"))
    shared = picks.objects_of(scene) if len(bpy.data.scenes) > 1 else []
    homes = {home.name for obj in shared if (home := picks.home_of(obj, scene)) is not None}
    if homes:
        text = (
            f"Some picks are shared with the scene {min(homes)}, which has another origin, and stay where that scene "
            "has them. Work on them there, or make them this scene's own: Object > Relations > Make Single User."
        )
        said.append(Remark(text, "problem", "origin"))
    if scene.get(store.GROUND) and not fingerprints.ground(scene):
        text = (
            "The terrain is gone. What was computed stays; edited trajectories have no terrain normals and heights. "
            "Undo, or import the terrain again."
        )
        said.append(Remark(text, "problem", "terrain"))
    return said
