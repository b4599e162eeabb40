# SPDX-License-Identifier: GPL-3.0-or-later
"""Picks from clicks: a pixel of the footage, or a ray of a free view → the terrain → a pick.

What was seen is kept beside the pick, by the id of the video: frame, pixel, the ellipse of its error on the terrain.
It holds as long as the pick stays where that click put it.
"""

from dataclasses import dataclass, replace

import bpy
import numpy as np

from ...core.camera.model import Camera, project, rays
from ...core.errors import RockfallError
from ...core.footage.advice import time_sigma_s
from ...core.reconstruction.block import Block
from ...core.reconstruction.triangulation import (
    GRAZING_DEG,
    SpacePoints,
    contact_points,
    epipolar_curve,
    pick_on_terrain,
    triangulate,
)
from ...core.terrain.raycast import cast_rays, closest_points
from ...core.terrain.surface import Surface
from ...core.vectors import Array
from . import picks, reconstruction, store, sync, timing, videos

SAME_PICTURE = 0.6
"""A pick that is nearer in time than this belongs to the picture [frames]."""
FIRST_NAME = "B01"
NEAR_M, FAR_M = 1.0, 5000.0
_VECTORS = (store.POSITION, store.NORMAL, store.SIGMA_POSITION, store.SIGMA_TIME)


@dataclass(frozen=True, eq=False)
class Place:
    """Where a click lies on the terrain.

    Attributes
    ----------
    position, normal : (3,) local [m], where the block touches the terrain; the normal of the face there.
    time_s : on the common clock [s].
    sigma_time_s, sigma_m : standard deviations of the time and of a coordinate; NaN in a free view.
    frame, pixel, sigma_px : of the picture, and the (2,) click in it; −1 and NaN in a free view.
    ellipse : (2, 3) half axes of one standard deviation on the terrain [m].
    grazing_deg : angle between the ray and the terrain.
    warning : a sentence, empty where all is well.
    """

    position: Array
    normal: Array
    time_s: float
    sigma_time_s: float = np.nan
    sigma_m: float = np.nan
    frame: int = -1
    pixel: Array | None = None
    sigma_px: float = np.nan
    ellipse: Array | None = None
    grazing_deg: float = np.nan
    warning: str = ""


@dataclass(frozen=True, eq=False)
class Sighting:
    """What was clicked for a pick in one video: see `Place`. `centre`: the block's centre, else its contact."""

    frame: int
    pixel: Array
    sigma_px: float
    ellipse: Array
    grazing_deg: float
    centre: bool


def surface_of(scene: bpy.types.Scene) -> Surface:
    """The terrain that is picked on.

    Raises
    ------
    RockfallError : there is none.
    """
    surface = reconstruction.ground(scene)
    if surface is None:
        raise RockfallError("There is no terrain to pick on. Import it first, in the panel Terrain.")
    return surface


def block_of(scene: bpy.types.Scene, name: str) -> Block:
    """The block of a trajectory, also of one that has no picks yet."""
    return reconstruction.blocks_of(scene, {name})[name]


def trajectory(scene: bpy.types.Scene) -> str:
    """The trajectory that is picked: the one chosen in the tool, else that of the first pick, else a first name."""
    chosen = scene.rockfall_picking.trajectory.strip()
    if chosen:
        return chosen
    names = trajectories(scene)
    return names[0] if names else FIRST_NAME


def trajectories(scene: bpy.types.Scene) -> list[str]:
    """Names of the trajectories that have picks, in the order of their names."""
    return sorted({thing[store.TRAJECTORY] for thing in picks.things_of(scene)})


def picture_time(scene: bpy.types.Scene, camera: bpy.types.Object) -> tuple[int, float]:
    """Frame of the picture that is shown, and its true video time [s]."""
    frame = videos.true_frame(scene, camera)
    return frame, float(videos.times_of(camera)[frame])


def common_time(camera: bpy.types.Object, video_s: float, v_px: float | None = None) -> float:
    """Common time of a picture [s]; of one of its rows where the shutter rolls."""
    late = 0.0
    if v_px is not None:
        late = videos.row_time_of(camera) * (v_px - videos.size_of(camera)[1] / 2)
    return float(videos.clock_of(camera).to_common(video_s)) + late


def frame_step_s(camera: bpy.types.Object) -> float:
    """Usual time between two pictures, on the common clock [s]."""
    times = videos.times_of(camera)
    return float(np.median(np.diff(times))) * videos.clock_of(camera).speed if times.size > 1 else 0.04


def posed(camera: bpy.types.Object, video_s: float) -> Camera:
    """The core's camera at the pose that it has at a video time.

    Raises
    ------
    RockfallError : its pose is not known.
    """
    if not videos.is_solved(camera):
        raise RockfallError(
            f"The camera of {camera.name} is not aligned, so its pixels have no place on the terrain. Align it first, "
            "or pick on the terrain in a free view."
        )
    path = videos.camera_path(camera)
    position, rotation = path.poses_at([video_s])
    return replace(path.reference, position=position[0], rotation=rotation[0])


def in_picture(
    scene: bpy.types.Scene, camera: bpy.types.Object, pixel: Array, name: str, *, centre: bool | None = None
) -> Place:
    """Where a click in the shown picture puts the block of a trajectory.

    centre : whether the pixel is that of the block's centre, else that of its contact; None as the tool says.

    Raises
    ------
    RockfallError : no terrain, a camera that is not aligned, a ray that misses the terrain.
    """
    settings = scene.rockfall_picking
    surface = surface_of(scene)
    frame, video_s = picture_time(scene, camera)
    pixel = np.asarray(pixel, dtype=np.float64)
    lens, sigma_px = posed(camera, video_s), store.double(settings.sigma_px)
    of_centre = settings.aim == "CENTRE" if centre is None else centre
    ground_pixel, touching = pixel, None
    if of_centre:
        origin, direction = rays(lens, pixel[None])
        if np.isfinite(direction).all():
            diameter = np.array([block_of(scene, name).diameter_m])
            point, _ = contact_points(surface, origin, direction, diameter, normal_radius(scene))
            if np.isfinite(point).all():
                touching, ground_pixel = point[0], project(lens, point)[0]
    found = pick_on_terrain(lens, ground_pixel[None], surface, sigma_px)
    if np.isnan(found.point[0, 0]):
        raise RockfallError("The ray through this pixel misses the terrain. Click on the surveyed slope.")
    step = frame_step_s(camera)
    return Place(
        position=found.point[0] if touching is None else touching,
        normal=found.normal[0],
        time_s=common_time(camera, video_s, float(pixel[1])),
        sigma_time_s=time_sigma_s(1 / step),
        sigma_m=float(np.sqrt(np.trace(found.covariance[0]) / 3)),
        frame=frame,
        pixel=pixel,
        sigma_px=sigma_px,
        ellipse=found.ellipse[0],
        grazing_deg=float(np.degrees(found.grazing[0])),
        warning=found.warning[0],
    )


def on_ray(scene: bpy.types.Scene, origin: Array, direction: Array, name: str) -> Place:
    """Where a ray of a free view meets the terrain, at the moment that the scene shows.

    Raises
    ------
    RockfallError : no terrain, or the ray misses it.
    """
    surface = surface_of(scene)
    hits = cast_rays(surface, np.asarray(origin, dtype=np.float64), np.asarray(direction, dtype=np.float64))
    if hits.face[0] < 0:
        raise RockfallError("There is no terrain under the mouse.")
    return Place(hits.point[0], surface.face_normals[hits.face[0]], now(scene, name))


def now(scene: bpy.types.Scene, name: str) -> float:
    """Common time that the scene shows, for a trajectory [s].

    A scene without videos plays trajectories one after the other, each with its own offset.
    """
    if videos.cameras(scene) or (scene.rockfall.playback == "REAL" and timing.origin_s(scene) is not None):
        return videos.common_time(scene)
    shown = (scene.frame_current + scene.frame_subframe) / timing.frame_rate(scene)
    return shown + timing.kept_offsets(scene).get(name, 0.0)


def in_this_picture(
    scene: bpy.types.Scene, camera: bpy.types.Object | None, name: str | None = None
) -> list[bpy.types.Object]:
    """The picks that belong to the picture, or moment, that is shown: of one trajectory, or of all."""
    things = picks.things_of(scene, None if name is None else [name])
    if camera is not None:
        _, video_s = picture_time(scene, camera)
        moment, step = common_time(camera, video_s), frame_step_s(camera)
        times = dict.fromkeys(things, moment)
    else:
        step = 1 / timing.frame_rate(scene)
        times = {thing: now(scene, thing[store.TRAJECTORY]) for thing in things}
    return [thing for thing in things if abs(thing[store.TIME] - times[thing]) <= SAME_PICTURE * step]


def of_this_picture(
    scene: bpy.types.Scene, camera: bpy.types.Object | None, name: str, time_s: float
) -> bpy.types.Object | None:
    """The pick that a trajectory has in the picture, or moment, that is shown: the one nearest to a common time."""
    near = in_this_picture(scene, camera, name)
    return min(near, key=lambda one: abs(one[store.TIME] - time_s), default=None)


def put(
    scene: bpy.types.Scene, camera: bpy.types.Object | None, place: Place, name: str, kind: str
) -> tuple[bpy.types.Object, bool]:
    """A pick at a place: the one that the trajectory has in this picture is moved there, else there is a new one.

    Returns
    -------
    The pick, and whether it is new.
    """
    thing = of_this_picture(scene, camera, name, place.time_s)
    if thing is not None:
        if camera is not None and elsewhere(thing, camera):
            keep_sighting(scene, thing, camera, place)  # the same event in a second video: the place stays
        else:
            move(scene, thing, camera, place)
        return thing, False
    if not videos.cameras(scene) and name not in timing.kept_offsets(scene):
        _begin_clock(scene, name)
    thing = picks.add_pick(scene, name, place.time_s, place.position, kind=kind)
    if np.isfinite(place.sigma_time_s):
        thing[store.SIGMA_TIME] = [place.sigma_time_s]
    move(scene, thing, camera, place)
    return thing, True


def move(scene: bpy.types.Scene, thing: bpy.types.Object, camera: bpy.types.Object | None, place: Place) -> None:
    """Put a pick elsewhere on the terrain; its time stays. A click of its own picture tells its deviation too."""
    thing[store.POSITION] = place.position.tolist()
    thing.location = place.position
    for key in (store.NORMAL, store.SEEN):
        if key in thing:
            del thing[key]
    if camera is None:
        return
    _, video_s = picture_time(scene, camera)
    if abs(thing[store.TIME] - common_time(camera, video_s)) <= SAME_PICTURE * frame_step_s(camera):
        thing[store.SIGMA_POSITION] = [place.sigma_m]
        keep_sighting(scene, thing, camera, place)
        for column, text in (
            ("video", camera.name),
            ("frame", str(place.frame)),
            ("u_px", repr(float(place.pixel[0]))),
            ("v_px", repr(float(place.pixel[1]))),
        ):
            picks.set_extra(thing, column, text)


def finish(scene: bpy.types.Scene, thing: bpy.types.Object) -> None:
    """The person has let go: the trajectory follows."""
    sync.sync(scene, [thing[store.TRAJECTORY]])


def remove(scene: bpy.types.Scene, thing: bpy.types.Object) -> None:
    """Remove a pick; its trajectory follows."""
    name = thing[store.TRAJECTORY]
    store.remove_objects([thing])
    sync.sync(scene, [name])


def set_kind(scene: bpy.types.Scene, thing: bpy.types.Object, kind: str) -> None:
    """Make a pick one of another kind; its trajectory follows."""
    thing[store.KIND] = kind
    sync.sync(scene, [thing[store.TRAJECTORY]])


def normal_radius(scene: bpy.types.Scene) -> float | None:
    """Radius in which terrain normals are fitted [m]; None: that of the block."""
    return reconstruction.project_settings(scene, []).reconstruction.normal_radius_m


def keep_sighting(scene: bpy.types.Scene, thing: bpy.types.Object, camera: bpy.types.Object, place: Place) -> None:
    """Remember what was clicked in a video for a pick."""
    seen = thing[store.SEEN].to_dict() if store.SEEN in thing and _holds(thing) else {}
    seen["position"] = list(thing[store.POSITION])
    seen[camera[store.ID]] = {
        "frame": int(place.frame),
        "pixel": place.pixel.tolist(),
        "sigma_px": float(place.sigma_px),
        "ellipse": place.ellipse.ravel().tolist(),
        "grazing_deg": float(place.grazing_deg),
        "centre": int(scene.rockfall_picking.aim == "CENTRE"),
    }
    thing[store.SEEN] = seen


def sightings(thing: bpy.types.Object) -> dict[str, Sighting]:
    """Id of a video → what was clicked in it for a pick that is still there."""
    if store.SEEN not in thing or not _holds(thing):
        return {}
    return {
        identifier: Sighting(
            int(seen["frame"]),
            np.array(seen["pixel"]),
            float(seen["sigma_px"]),
            np.array(seen["ellipse"]).reshape(2, 3),
            float(seen["grazing_deg"]),
            bool(seen["centre"]),
        )
        for identifier, seen in thing[store.SEEN].items()
        if identifier != "position"
    }


def elsewhere(thing: bpy.types.Object, camera: bpy.types.Object) -> bool:
    """Whether a pick was clicked in another video, and not in this one."""
    seen = sightings(thing)
    return bool(seen) and camera[store.ID] not in seen


def grazing_warning(thing: bpy.types.Object) -> str:
    """A sentence on a pick whose ray grazes the terrain; empty where all is well."""
    for seen in sightings(thing).values():
        if seen.grazing_deg < GRAZING_DEG:
            reach = float(np.linalg.norm(seen.ellipse[0]))
            return (
                f"The ray grazes the terrain at {seen.grazing_deg:.1f}°: along it the place is known to {reach:.1f} m "
                "only. Prefer another view, or refine with the flights beside it."
            )
    return ""


def epipolar(scene: bpy.types.Scene, thing: bpy.types.Object, camera: bpy.types.Object) -> Array | None:
    """(k, 2) pixels in a video on which a pick must lie that was clicked in another one; None when it was not."""
    for identifier, seen in sightings(thing).items():
        other = videos.by_id(scene, identifier)
        if other is None or other == camera or not videos.is_solved(other):
            continue
        video_s = _time_of(other, seen.frame)
        here = float(videos.clock_of(camera).to_video(common_time(other, video_s, float(seen.pixel[1]))))
        surface = reconstruction.ground(scene)
        return epipolar_curve(posed(other, video_s), seen.pixel, posed(camera, here), NEAR_M, FAR_M, surface)
    return None


def triangulated(scene: bpy.types.Scene, thing: bpy.types.Object) -> SpacePoints | None:
    """The point in space of a pick that was clicked in two videos or more; None otherwise."""
    lenses, pixels, sigmas = [], [], []
    for identifier, seen in sightings(thing).items():
        camera = videos.by_id(scene, identifier)
        if camera is not None and videos.is_solved(camera):
            lenses.append(posed(camera, _time_of(camera, seen.frame)))
            pixels.append(seen.pixel[None])
            sigmas.append([seen.sigma_px])
    return triangulate(lenses, np.array(pixels), np.array(sigmas)) if len(lenses) > 1 else None


def second_view(scene: bpy.types.Scene, thing: bpy.types.Object) -> str:
    """What a second video says about a pick, in a sentence."""
    found = triangulated(scene, thing)
    if found is None or not np.isfinite(found.point).all():
        return "Kept as this event's pixel in a second video."
    away = float(np.linalg.norm(found.point[0] - np.array(thing[store.POSITION])))
    return (
        f"Seen in a second video: the rays miss each other by {100 * found.miss_distance[0]:.1f} cm, {away:.2f} m from "
        "the pick. The pick stays; Use Triangulated Point moves it there."
    )


def use_triangulated(scene: bpy.types.Scene, thing: bpy.types.Object) -> float:
    """Move a pick to where its rays from several videos meet; returns by how much they miss each other [m].

    Raises
    ------
    RockfallError : it was not clicked in two aligned videos.
    """
    found = triangulated(scene, thing)
    if found is None or not np.isfinite(found.point).all():
        raise RockfallError("Click the same event in a second aligned video first, while this pick is selected.")
    point, seen = found.point[0], thing[store.SEEN].to_dict()
    if thing[store.KIND] != "pass" and any(one.centre for one in sightings(thing).values()):
        point = closest_points(surface_of(scene), point).point[0]
    thing[store.POSITION], thing.location = point.tolist(), point
    thing[store.SIGMA_POSITION] = [float(np.sqrt(np.trace(found.covariance[0]) / 3))]
    thing[store.SEEN] = seen | {"position": point.tolist()}
    finish(scene, thing)
    return float(found.miss_distance[0])


def _holds(thing: bpy.types.Object) -> bool:
    return list(thing[store.SEEN].get("position", ())) == list(thing[store.POSITION])


def _time_of(camera: bpy.types.Object, frame: int) -> float:
    """Video time of a frame [s]."""
    times = videos.times_of(camera)
    return float(times[min(frame, times.size - 1)])


def _begin_clock(scene: bpy.types.Scene, name: str) -> None:
    """Without videos, the first trajectory of a scene lives on the scene's own clock: frame 0 is 0 s."""
    if not picks.things_of(scene):
        scene[store.TIME_ORIGIN] = 0.0
        scene.rockfall.playback = "REAL"
    elif timing.origin_s(scene) is None or scene.rockfall.playback != "REAL":
        timing.keep_offsets(scene, timing.kept_offsets(scene) | {name: 0.0})


def snapshot(thing: bpy.types.Object) -> dict[str, object]:
    """What a click changes of a pick, as plain values."""
    kept = {key: list(thing[key]) for key in _VECTORS if key in thing}
    for key in (store.SEEN, store.EXTRA):
        if key in thing:
            kept[key] = thing[key].to_dict()
    return kept


def restore(thing: bpy.types.Object, kept: dict[str, object]) -> None:
    """Take back what was changed since the snapshot."""
    for key in (*_VECTORS, store.SEEN, store.EXTRA):
        if key in kept:
            thing[key] = kept[key]
        elif key in thing:
            del thing[key]
    thing.location = kept[store.POSITION]


def described(thing: bpy.types.Object) -> str:
    """A pick in a sentence."""
    sigma = thing.get(store.SIGMA_POSITION)
    known = "" if sigma is None else f", its place known to {100 * sigma[0]:.0f} cm"
    return f"{thing[store.TRAJECTORY]}: {thing[store.KIND]} at {thing[store.TIME]:.3f} s{known}."
