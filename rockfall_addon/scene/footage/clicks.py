# SPDX-License-Identifier: GPL-3.0-or-later
"""What was clicked for a pick in the videos, and what follows from several of them.

It is kept beside the pick, by the id of the video: frame, pixel, the ellipse of its error on the terrain. It holds as
long as the pick stays at that place.
"""

from dataclasses import dataclass

import bpy
import numpy as np

from ....core.reconstruction.triangulation import SpacePoints, epipolar_curve
from ....core.vectors import Array
from ....core.workflow.first_picks import point_clicked
from ..picks import reconstruction
from ..picks.places import Place
from ..storage import store
from . import camera_paths, clocks, pictures, sightings, videos

NEAR_M, FAR_M = 1.0, 5000.0


@dataclass(frozen=True, eq=False)
class Click:
    """What was clicked for a pick in one video: see `Place`; `centre`: the block's centre, else its contact."""

    frame: int
    pixel: Array
    sigma_px: float
    ellipse: Array
    grazing_deg: float
    centre: bool


def keep(scene: bpy.types.Scene, obj: bpy.types.Object, camera: bpy.types.Object, place: Place) -> None:
    """Remember what was clicked in a video for a pick."""
    seen = obj[store.SEEN].to_dict() if store.SEEN in obj and _holds(obj) else {}
    seen["position"] = list(obj[store.POSITION])
    seen[camera[store.ID]] = {
        "frame": int(place.frame),
        "pixel": place.pixel.tolist(),
        "sigma_px": float(place.sigma_px),
        "ellipse": place.ellipse.ravel().tolist(),
        "grazing_deg": float(place.grazing_deg),
        "centre": int(scene.rockfall_picking.aim == "CENTRE"),
    }
    obj[store.SEEN] = seen


def of(obj: bpy.types.Object) -> dict[str, Click]:
    """Id of a video → what was clicked in it for a pick that is still there."""
    if store.SEEN not in obj or not _holds(obj):
        return {}
    return {
        identifier: Click(
            int(seen["frame"]),
            np.array(seen["pixel"]),
            float(seen["sigma_px"]),
            np.array(seen["ellipse"]).reshape(2, 3),
            float(seen["grazing_deg"]),
            bool(seen["centre"]),
        )
        for identifier, seen in obj[store.SEEN].items()
        if identifier != "position"
    }


def elsewhere(obj: bpy.types.Object, camera: bpy.types.Object) -> bool:
    """Whether a pick was clicked in another video, and not in this one."""
    seen = of(obj)
    return bool(seen) and camera[store.ID] not in seen


def epipolar(scene: bpy.types.Scene, obj: bpy.types.Object, camera: bpy.types.Object) -> Array | None:
    """(k, 2) pixels in a video on which a pick must lie that was clicked in another one; None when it was not."""
    for identifier, seen in of(obj).items():
        other = videos.by_id(scene, identifier)
        if other is None or other == camera or not camera_paths.is_solved(other):
            continue
        video_s = _time_of(other, seen.frame)
        here = float(clocks.clock_of(camera).to_video(pictures.common_time(other, video_s, float(seen.pixel[1]))))
        surface = reconstruction.ground(scene)
        lenses = pictures.posed(other, video_s), pictures.posed(camera, here)
        return epipolar_curve(lenses[0], seen.pixel, lenses[1], NEAR_M, FAR_M, surface)
    return None


def triangulated(scene: bpy.types.Scene, obj: bpy.types.Object) -> SpacePoints | None:
    """The point in space of a pick that was clicked in two videos or more; None otherwise."""
    views, times, pixels, sigmas = [], [], [], []
    for identifier, seen in of(obj).items():
        camera = videos.by_id(scene, identifier)
        if camera is not None and camera_paths.is_solved(camera):
            views.append(sightings.view_of(camera))
            times.append(_time_of(camera, seen.frame))
            pixels.append(seen.pixel)
            sigmas.append(seen.sigma_px)
    return point_clicked(views, times, np.array(pixels), sigmas) if len(views) > 1 else None


def _holds(obj: bpy.types.Object) -> bool:
    return list(obj[store.SEEN].get("position", ())) == list(obj[store.POSITION])


def _time_of(camera: bpy.types.Object, frame: int) -> float:
    """Video time of a frame [s]."""
    times = videos.times_of(camera)
    return float(times[min(frame, times.size - 1)])
