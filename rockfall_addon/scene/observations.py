# SPDX-License-Identifier: GPL-3.0-or-later
"""Where the block was seen in the videos: pixels of its centre, tracked or clicked, kept with each video's camera."""

import json
from dataclasses import dataclass

import bpy
import numpy as np

from ...core.camera.model import project, rays
from ...core.errors import RockfallError
from ...core.footage.kinks import find_kinks
from ...core.footage.tracking import BlockTrack
from ...core.reconstruction.triangulation import contact_points
from ...core.terrain.raycast import cast_rays
from ...core.vectors import Array, Indices
from . import picking, picks, store, sync, videos

COLUMNS = 7  # number of the name, frame, video time, u, v, sigma, clicked by hand
FAR_M = 100.0
"""Distance at which pixels are taken to be that meet no terrain; only a swaying camera tells the difference."""
SAME_MOMENT_FRAMES = 2.0
"""A proposed impact nearer than this to a pick is that pick."""


@dataclass(frozen=True, eq=False)
class Seen:
    """m sightings of one block in one video: see `BlockTrack`; by_hand (m,) for those that were clicked."""

    frame: Indices
    time_s: Array
    pixel: Array
    sigma_px: Array
    by_hand: Array

    def __len__(self) -> int:
        return self.frame.size


def names_in(camera: bpy.types.Object) -> list[str]:
    """The trajectories that were seen in a video."""
    return [name for name, rows in _tables(camera).items() if len(rows)]


def seen_in(camera: bpy.types.Object, name: str) -> Seen:
    """What was seen of a trajectory in a video, in the order of time."""
    rows = _tables(camera).get(name, np.zeros((0, COLUMNS - 1)))
    return Seen(rows[:, 0].astype(np.intp), rows[:, 1], rows[:, 2:4], rows[:, 4], rows[:, 5] > 0)


def click(camera: bpy.types.Object, name: str, frame: int, time_s: float, pixel: Array, sigma_px: float) -> None:
    """Keep a pixel that a person clicked on the block; another one in this picture is replaced."""
    tables = _tables(camera)
    rows = tables.get(name, np.zeros((0, COLUMNS - 1)))
    rows = rows[rows[:, 0] != frame]
    tables[name] = np.vstack([rows, [frame, time_s, *pixel, sigma_px, 1.0]])
    _keep(camera, tables)


def keep_track(camera: bpy.types.Object, name: str, track: BlockTrack) -> None:
    """Keep a track; what was clicked by hand stays."""
    tables = _tables(camera)
    rows = tables.get(name, np.zeros((0, COLUMNS - 1)))
    clicked = rows[rows[:, 5] > 0]
    new = np.column_stack([track.frame, track.time_s, track.pixel, track.sigma_px, np.zeros(track.frame.size)])
    tables[name] = np.vstack([clicked, new[~np.isin(new[:, 0], clicked[:, 0])]])
    _keep(camera, tables)


def clear(camera: bpy.types.Object, name: str) -> int:
    """Forget what was seen of a trajectory in a video; returns how many pixels that were."""
    tables = _tables(camera)
    count = len(tables.pop(name, ()))
    _keep(camera, tables)
    return count


def clicks_for(scene: bpy.types.Scene, camera: bpy.types.Object, name: str) -> list[tuple[int, float, float]]:
    """Frames and pixels on the block, to begin a track with: clicked by hand, and those of the picks.

    Raises
    ------
    RockfallError : there are none.
    """
    seen = seen_in(camera, name)
    clicked = zip(seen.frame[seen.by_hand].tolist(), seen.pixel[seen.by_hand].tolist(), strict=True)
    found = {frame: (u, v) for frame, (u, v) in clicked}
    for thing in picks.things_of(scene, [name]):
        sighting = picking.sightings(thing).get(camera[store.ID])
        if sighting is not None and sighting.centre:
            found.setdefault(sighting.frame, (float(sighting.pixel[0]), float(sighting.pixel[1])))
    if not found:
        raise RockfallError(
            f"Nothing tells where the block of {name} is in {camera.name}. Choose the tool Pick Impacts, and the kind "
            "“Block here”, and click the block where it flies, best in two or three pictures."
        )
    return sorted((frame, u, v) for frame, (u, v) in found.items())


def propose(scene: bpy.types.Scene, camera: bpy.types.Object, name: str) -> list[bpy.types.Object]:
    """New picks where the tracked block's velocity changes at once; those that are there already stay.

    Raises
    ------
    RockfallError : no track, a camera that is not aligned, no terrain.

    Notes
    -----
    The track is brought into the picture of its first frame by the camera's own poses, so that a hand that turns it
    makes no kinks.
    """
    seen = seen_in(camera, name)
    if len(seen) < 8:
        raise RockfallError(f"The block of {name} is not tracked in {camera.name}. Track it first.")
    surface = picking.surface_of(scene)
    lens = picking.posed(camera, float(seen.time_s[0]))
    path = videos.camera_path(camera)
    place, turn = path.poses_at(seen.time_s)
    origin, direction = rays(lens, seen.pixel, position=place, rotation=turn)
    good = np.isfinite(direction).all(axis=1)
    reach = cast_rays(surface, origin[good], direction[good]).distance
    reach = np.where(np.isfinite(reach), reach, FAR_M)
    stable = project(lens, origin[good] + reach[:, None] * direction[good])
    inside = np.isfinite(stable).all(axis=1)
    times = seen.time_s[good][inside]
    kinks = find_kinks(times, stable[inside], seen.sigma_px[good][inside])
    if not len(kinks):
        return []
    at, away = rays(lens, kinks.pixel)
    far = np.interp(kinks.time_s, times, reach[inside])
    position, rotation = path.poses_at(kinks.time_s)
    pixels = project(lens, at + far[:, None] * away, position=position, rotation=rotation)
    origin, direction = rays(lens, pixels, position=position, rotation=rotation)
    diameter = np.full(len(kinks), picking.block_of(scene, name).diameter_m)
    points, _ = contact_points(surface, origin, direction, diameter, picking.normal_radius(scene))
    clock, step = videos.clock_of(camera), picking.frame_step_s(camera)
    there = [float(thing[store.TIME]) for thing in picks.things_of(scene, [name])]
    made = []
    for i in range(len(kinks)):
        moment = picking.common_time(camera, float(kinks.time_s[i]), float(pixels[i, 1]))
        if np.isnan(points[i]).any() or any(abs(moment - other) < SAME_MOMENT_FRAMES * step for other in there):
            continue
        frame = int(np.argmin(np.abs(videos.times_of(camera) - kinks.time_s[i])))
        extra = {
            "video": camera.name,
            "frame": str(frame),
            "u_px": repr(float(pixels[i, 0])),
            "v_px": repr(float(pixels[i, 1])),
            "note": "proposed from the track",
        }
        thing = picks.add_pick(scene, name, moment, points[i], extra=extra)
        thing[store.SIGMA_TIME] = [float(kinks.sigma_time_s[i]) * clock.speed]
        made.append(thing)
    sync.sync(scene, [name])
    return made


def _tables(camera: bpy.types.Object) -> dict[str, Array]:
    """Name → (m, 6) rows: frame, video time, u, v, sigma, by hand."""
    names = json.loads(camera.get(store.TRACK_NAMES, "[]"))
    rows = np.array(camera.get(store.TRACK_ROWS, ()), dtype=np.float64).reshape(-1, COLUMNS)
    return {name: rows[rows[:, 0] == i, 1:] for i, name in enumerate(names)}


def _keep(camera: bpy.types.Object, tables: dict[str, Array]) -> None:
    tables = {name: rows for name, rows in tables.items() if len(rows)}
    if not tables:
        for key in (store.TRACK_NAMES, store.TRACK_ROWS):
            if key in camera:
                del camera[key]
        return
    blocks = [
        np.c_[np.full(len(rows), i), rows[np.argsort(rows[:, 0], kind="stable")]]
        for i, rows in enumerate(tables.values())
    ]
    camera[store.TRACK_NAMES] = json.dumps(list(tables))
    camera[store.TRACK_ROWS] = np.vstack(blocks).ravel().tolist()
