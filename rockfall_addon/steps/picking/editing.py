# SPDX-License-Identifier: GPL-3.0-or-later
"""Picks as a person makes, moves and removes them: what a click becomes."""

import bpy
import numpy as np

from ....core.errors import RockfallError
from ....core.reconstruction.triangulation import GRAZING_DEG
from ....core.workflow.first_picks import brought_to_terrain, coordinate_sigma
from ...scene.footage import clicks, pictures, sync, timing, videos
from ...scene.picks import pick_names, picks, places, reconstruction
from ...scene.picks.places import Place
from ...scene.storage import store
from ...scene.terrain import terrain

_VECTORS = (store.POSITION, store.NORMAL, store.SIGMA_POSITION, store.SIGMA_TIME)


def make_or_move(
    scene: bpy.types.Scene, camera: bpy.types.Object | None, place: Place, name: str, kind: str
) -> tuple[bpy.types.Object, bool]:
    """A pick at a place: the one that the trajectory has in this picture is moved there, else there is a new one.

    Returns
    -------
    The pick, and whether it is new.
    """
    obj = pictures.of_this_picture(scene, camera, name, place.time_s)
    if obj is not None:
        if camera is not None and clicks.elsewhere(obj, camera):
            clicks.keep(scene, obj, camera, place)  # the same event in a second video: the place stays
        else:
            move(scene, obj, camera, place)
        return obj, False
    if not videos.cameras(scene) and name not in timing.kept_offsets(scene):
        _begin_clock(scene, name)
    obj = picks.add_pick(scene, name, place.time_s, place.position, kind=kind)
    if np.isfinite(place.sigma_time_s):
        obj[store.SIGMA_TIME] = [place.sigma_time_s]
    move(scene, obj, camera, place)
    return obj, True


def move(scene: bpy.types.Scene, obj: bpy.types.Object, camera: bpy.types.Object | None, place: Place) -> None:
    """Move a pick along the terrain; its time stays. A click in its own picture also gives its deviation."""
    obj[store.POSITION] = place.position.tolist()
    obj.location = place.position
    for key in (store.NORMAL, store.SEEN):
        if key in obj:
            del obj[key]
    if camera is None:
        return
    _, video_s = pictures.picture_time(scene, camera)
    away = abs(obj[store.TIME] - pictures.common_time(camera, video_s))
    if away <= pictures.SAME_PICTURE * pictures.frame_step_s(camera):
        _keep_sigma(obj, place.sigma_m)
        clicks.keep(scene, obj, camera, place)
        for column, text in (
            ("video", camera.name),
            ("frame", str(place.frame)),
            ("u_px", repr(float(place.pixel[0]))),
            ("v_px", repr(float(place.pixel[1]))),
        ):
            picks.set_extra(obj, column, text)


def finish(scene: bpy.types.Scene, obj: bpy.types.Object) -> None:
    """The person has let go: the trajectory follows."""
    sync.sync(scene, [obj[store.TRAJECTORY]])


def remove(scene: bpy.types.Scene, obj: bpy.types.Object) -> None:
    """Remove a pick; its trajectory follows."""
    name = obj[store.TRAJECTORY]
    store.remove_objects([obj])
    sync.sync(scene, [name])


def set_kind(scene: bpy.types.Scene, obj: bpy.types.Object, kind: str) -> None:
    """Make a pick one of another kind; its trajectory follows."""
    obj[store.KIND] = kind
    sync.sync(scene, [obj[store.TRAJECTORY]])


def use_triangulated(scene: bpy.types.Scene, obj: bpy.types.Object) -> float:
    """Move a pick to where its rays from several videos meet; returns by how much they miss each other [m].

    Raises
    ------
    RockfallError : it was not clicked in two aligned videos.
    """
    found = clicks.triangulated(scene, obj)
    if found is None or not np.isfinite(found.point).all():
        raise RockfallError("Click the same event in a second aligned video first, while this pick is selected.")
    point, covariance, seen = found.point[0], found.covariance[0], obj[store.SEEN].to_dict()
    if obj[store.KIND] != "pass" and any(click.centre for click in clicks.of(obj).values()):
        point, covariance = brought_to_terrain(places.surface_of(scene), point, covariance, terrain.accuracy_m(scene))
    obj[store.POSITION], obj.location = point.tolist(), point
    _keep_sigma(obj, coordinate_sigma(covariance))
    obj[store.SEEN] = seen | {"position": point.tolist()}
    if store.NORMAL in obj and reconstruction.ground(scene) is not None:
        del obj[store.NORMAL]  # it was that of the old place
    finish(scene, obj)
    return float(found.miss_distance[0])


def second_view(scene: bpy.types.Scene, obj: bpy.types.Object) -> str:
    """What a second video says about a pick, in a sentence."""
    found = clicks.triangulated(scene, obj)
    if found is None or not np.isfinite(found.point).all():
        return "Kept as this event's pixel in a second video."
    away = float(np.linalg.norm(found.point[0] - np.array(obj[store.POSITION])))
    return (
        f"Seen in a second video: the rays miss each other by {100 * found.miss_distance[0]:.1f} cm, {away:.2f} m from "
        "the pick. The pick stays; Use Triangulated Point moves it there."
    )


def grazing_warning(obj: bpy.types.Object) -> str:
    """A sentence on a pick whose ray grazes the terrain; empty where all is well."""
    for seen in clicks.of(obj).values():
        if seen.grazing_deg < GRAZING_DEG:
            reach = float(np.linalg.norm(seen.ellipse[0]))
            return (
                f"The ray grazes the terrain at {seen.grazing_deg:.1f}°: along it the place is known to {reach:.1f} m "
                "only. Prefer another view, or refine with the flights beside it."
            )
    return ""


def described(obj: bpy.types.Object) -> str:
    """A pick in a sentence."""
    sigma = obj.get(store.SIGMA_POSITION)
    known = "" if sigma is None else f", its place known to {100 * sigma[0]:.0f} cm"
    return f"{obj[store.TRAJECTORY]}: {pick_names.word(obj)} at {obj[store.TIME]:.3f} s{known}."


def snapshot(obj: bpy.types.Object) -> dict[str, object]:
    """What a click changes of a pick, as plain values."""
    kept = {key: list(obj[key]) for key in _VECTORS if key in obj}
    for key in (store.SEEN, store.EXTRA):
        if key in obj:
            kept[key] = obj[key].to_dict()
    return kept


def restore(obj: bpy.types.Object, kept: dict[str, object]) -> None:
    """Take back what was changed since the snapshot."""
    for key in (*_VECTORS, store.SEEN, store.EXTRA):
        if key in kept:
            obj[key] = kept[key]
        elif key in obj:
            del obj[key]
    obj.location = kept[store.POSITION]


def _keep_sigma(obj: bpy.types.Object, sigma_m: float) -> None:
    """The standard deviation of a pick's place; none where the camera was not found in its picture."""
    if np.isfinite(sigma_m):
        obj[store.SIGMA_POSITION] = [sigma_m]
    elif store.SIGMA_POSITION in obj:
        del obj[store.SIGMA_POSITION]


def _begin_clock(scene: bpy.types.Scene, name: str) -> None:
    """Without videos, the first trajectory of a scene lives on the scene's own clock: frame 0 is 0 s."""
    if not picks.objects_of(scene):
        scene[store.TIME_ORIGIN] = 0.0
        scene.rockfall.playback = "REAL"
    elif timing.origin_s(scene) is None or scene.rockfall.playback != "REAL":
        timing.keep_offsets(scene, timing.kept_offsets(scene) | {name: 0.0})
