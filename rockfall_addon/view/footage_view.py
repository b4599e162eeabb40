# SPDX-License-Identifier: GPL-3.0-or-later
"""What is drawn over the footage: paths of the blocks' centres, outlines, picks, sightings, in pixels of the video.

All is projected by the core, with the lens's distortion and the pose of the picture that is shown. What does not depend
on the picture is kept until the picks change.
"""

import zlib

import bpy
import numpy as np

from ...core.camera.model import Camera, project
from ...core.camera.path import rays_at
from ...core.colours import MEASURED_COLOUR, scale_colours
from ...core.errors import RockfallError
from ...core.reconstruction.drag import Drag
from ...core.reconstruction.flight import flight_states
from ...core.reconstruction.trajectory import Reconstruction, reconstruct
from ...core.terrain.raycast import cast_rays, heights_above
from ...core.vectors import Array, cross, norm, perpendicular, unit
from ...core.workflow.first_picks import FAR_M
from ..scene.footage import camera_paths, clicks, clocks, pictures, sightings, sync, videos
from ..scene.picks import picks, places, proposal, reconstruction, spins, trails, trajectories
from ..scene.storage import fingerprints, store
from . import spin_marks
from .drawn import Drawing, Line, Mark, Path

BELOW = (1.0, 0.0, 0.0)
PROPOSED = (0.2, 0.9, 1.0)
OUTLINE = (1.0, 1.0, 0.35)
EPIPOLAR = (1.0, 0.55, 0.95)
SEEN, SEEN_SIZE = (0.35, 1.0, 0.45), 2.5
CIRCLE = np.linspace(0.0, 2 * np.pi, 49)

_paths: dict[tuple[int, str], tuple[object, Path | None]] = {}
_seen: dict[tuple[int, str, str], tuple[object, tuple[Array, Array]]] = {}


def draw(scene: bpy.types.Scene, camera: bpy.types.Object, active: bpy.types.Object | None) -> Drawing:
    """What is drawn over the picture of an aligned camera.

    active : the selected pick.
    """
    settings, found = scene.rockfall_picking, Drawing()
    _, video_s = pictures.picture_time(scene, camera)
    lens, moment = pictures.posed(camera, video_s), pictures.common_time(camera, video_s)
    times = clocks.clock_of(camera).to_common(videos.times_of(camera))
    step = pictures.frame_step_s(camera)
    objects = fingerprints.by_trajectory(picks.objects_of(scene))
    filmed = {name: path for name in objects if (path := path_of(scene, name, times)) is not None}
    filmed = {n: p for n, p in filmed.items() if p.time_s[-1] > times[0] - step and p.time_s[0] < times[-1] + step}
    if settings.show_paths:
        for path in filmed.values():
            _add_path(found, lens, path)
            _add_outline(found, lens, path, moment, step)
        proposed = proposal.path(scene)
        if proposed is not None:
            _add_polyline(found, lens, *proposed)
    if settings.show_track:
        for name in sightings.names_in(camera):
            _add_seen(found, scene, camera, lens, name, filmed.get(name), video_s)
    for name in spins.names_in(camera):
        if name in filmed:
            spin_marks.add(found, scene, camera, lens, name, filmed[name], video_s)
    for members in objects.values():
        for obj in members:
            near = abs(obj[store.TIME] - moment) <= pictures.SAME_PICTURE * step
            if near or obj == active or times[0] - step <= obj[store.TIME] <= times[-1] + step:
                _add_pick(found, lens, obj, near, obj == active)
    if active is not None:
        _add_active(found, scene, camera, lens, active)
    return found


def path_of(scene: bpy.types.Scene, name: str, frames_s: Array | None = None) -> Path | None:
    """The path of a block's centre; None without flights. It is computed when its picks have changed.

    frames_s : (f,) common times of frames, at which there are ticks.
    """
    how = reconstruction.project_settings(scene, [])
    key = (
        fingerprints.remembered(scene).get(name), scene.get(store.GROUND, ""), how.reconstruction, how.block,
        scene.rockfall.speed_top_mps, scene.get(store.BLOCKS, ""),
        None if frames_s is None else zlib.crc32(np.ascontiguousarray(frames_s)), trails.are_plain(scene),
    )  # fmt: skip
    place = (scene.session_uid, name)
    if place not in _paths or _paths[place][0] != key:
        _paths[place] = key, _path(scene, name, frames_s)
    return _paths[place][1]


def forget() -> None:
    """Another file was opened."""
    _paths.clear()
    _seen.clear()


def sample(
    result: Reconstruction,
    frames_s: Array | None,
    speed_top_mps: float,
    surface: object | None = None,
    *,
    plain: bool = False,
) -> Path | None:
    """The path of the only trajectory of a reconstruction.

    plain : in the colour of measured blocks, not by speed.
    """
    flights = result.flights
    radius = next(iter(result.block.values())).radius_m if isinstance(result.block, dict) else result.block.radius_m
    pieces, which, ticks, joined = [], [], [], []
    for i in range(len(flights.start_time_s)):
        start, end = float(flights.start_time_s[i]), float(flights.end_time_s[i])
        clock, tick = _with_frames(trails.moments(start, end), frames_s)
        pieces.append(clock)
        ticks.append(tick)
        which.append(np.full(len(clock), i))
        joined.append(np.arange(len(clock)) < len(clock) - 1)
    if not pieces:
        return None
    time, owner = np.concatenate(pieces), np.concatenate(which)
    position, velocity = flight_states(flights, owner, time)
    colour = np.tile(MEASURED_COLOUR, (len(time), 1)) if plain else scale_colours(norm(velocity), 0.0, speed_top_mps)
    if surface is not None:
        under = radius if result.ends == "centres" else 0.0
        with np.errstate(invalid="ignore"):
            deep = heights_above(surface, position) - under < -trajectories.BELOW_RADII * radius
        colour[deep] = BELOW
    return Path(time, position, colour, np.concatenate(joined), np.concatenate(ticks), radius, plain)


def _path(scene: bpy.types.Scene, name: str, frames_s: Array | None) -> Path | None:
    objects = picks.ordered(scene, picks.objects_of(scene, [name]))
    surface, block = reconstruction.ground(scene), places.block_of(scene, name)
    how = reconstruction.project_settings(scene, []).reconstruction
    reach = max(sync.LEAST_REACH_M, sync.REACH_RADII * block.radius_m)
    drag = Drag(how.air_density_kgpm3, how.drag_coefficient) if how.drag else None
    for ends in dict.fromkeys(("centres" if surface is not None else how.flights, how.flights)):
        try:
            result = reconstruct(
                picks.trusted(picks.read(scene, objects, surface, reach)), surface=surface, block={name: block},
                gravity_mps2=how.gravity_mps2, drag=drag, normal_radius_m=how.normal_radius_m, flights=ends,
            )  # fmt: skip
        except RockfallError:
            continue  # the panel tells it
        return sample(result, frames_s, scene.rockfall.speed_top_mps, surface, plain=trails.are_plain(scene))
    return None


def _with_frames(even: Array, frames_s: Array | None) -> tuple[Array, np.ndarray]:
    if frames_s is None:
        return even, np.zeros(len(even), dtype=bool)
    frames = frames_s[(frames_s > even[0]) & (frames_s < even[-1])]
    clock = np.concatenate([even, frames])
    order = np.argsort(clock, kind="stable")
    return clock[order], (np.arange(len(clock)) >= len(even))[order]


def _add_path(found: Drawing, lens: Camera, path: Path) -> None:
    if path.edged:
        _add_polyline(found, lens, path.position, np.zeros_like(path.colour), path.joined, 4.5, 0.65)
    _add_polyline(found, lens, path.position, path.colour, path.joined)
    pixels = project(lens, path.position[path.tick])
    good = np.isfinite(pixels[:, 0])
    colours = np.column_stack([0.4 + 0.6 * path.colour[path.tick], np.ones(path.tick.sum())])
    found.dots.append((pixels[good], colours[good], 4.0))


def _add_polyline(
    found: Drawing,
    lens: Camera,
    position: Array,
    colour: Array,
    joined: np.ndarray,
    width: float = 2.0,
    opacity: float = 1.0,
) -> None:
    pixels = project(lens, position)
    first = np.flatnonzero(joined[:-1] & np.isfinite(pixels[:-1, 0]) & np.isfinite(pixels[1:, 0]))
    colours = np.column_stack([colour, np.full(len(colour), opacity)])
    pairs = np.stack([first, first + 1], axis=1)
    found.lines.append(Line(pixels[pairs], colours[pairs], width))


def _add_outline(found: Drawing, lens: Camera, path: Path, moment: float, step: float) -> None:
    """The block as a ball, where it is in the picture."""
    if not path.time_s[0] - step / 2 <= moment <= path.time_s[-1] + step / 2:
        return
    centre = np.array([np.interp(moment, path.time_s, path.position[:, i]) for i in range(3)])
    found.lines.append(_closed(ball(lens, centre, path.radius_m), OUTLINE, 1.5))


def ball(lens: Camera, centre: Array, radius_m: float) -> Array:
    """(49, 2) outline of a ball in pixels, NaN where it is not seen."""
    away = centre - lens.position
    distance = float(norm(away))
    if distance <= radius_m:
        return np.full((CIRCLE.size, 2), np.nan)
    sight = away / distance
    right = unit(cross(sight, lens.rotation[1]))
    up = cross(right, sight)
    reach = radius_m * np.sqrt(1 - (radius_m / distance) ** 2)  # the horizon circle of the ball
    middle = centre - radius_m**2 / distance * sight
    return project(lens, middle + reach * (np.cos(CIRCLE)[:, None] * right + np.sin(CIRCLE)[:, None] * up))


def _closed(pixels: Array, colour: tuple[float, float, float], width: float, alpha: float = 1.0) -> Line:
    good = np.isfinite(pixels[:-1, 0]) & np.isfinite(pixels[1:, 0])
    segments = np.stack([pixels[:-1], pixels[1:]], axis=1)[good]
    return Line(segments, np.broadcast_to(np.array([*colour, alpha]), (*segments.shape[:2], 4)), width)


def _add_seen(
    found: Drawing,
    scene: bpy.types.Scene,
    camera: bpy.types.Object,
    lens: Camera,
    name: str,
    path: Path | None,
    video_s: float,
) -> None:
    """Sightings of all pictures, brought into this one, joined with where the path is at their times."""
    seen = sightings.seen_in(camera, name)
    place, where = _sightings(scene, camera, name, seen, path)
    pixels, expected = project(lens, place), project(lens, where)
    good = np.isfinite(pixels[:, 0])
    colours = np.tile([*SEEN, 0.55], (len(pixels), 1))
    now = np.abs(seen.time_s - video_s) < 1e-6
    colours[now] = (1.0, 1.0, 1.0, 1.0)
    found.dots.append((pixels[good], colours[good], SEEN_SIZE))
    both = good & np.isfinite(expected[:, 0])
    segments = np.stack([pixels[both], expected[both]], axis=1)
    found.lines.append(Line(segments, np.broadcast_to([*SEEN, 0.8], (*segments.shape[:2], 4)), 1.0))
    for i in np.flatnonzero(now & good):
        found.marks.append(Mark(pixels[i], "ring", (*SEEN, 1.0), 4.0))


def _sightings(
    scene: bpy.types.Scene, camera: bpy.types.Object, name: str, seen: sightings.Seen, path: Path | None
) -> tuple[Array, Array]:
    """Points in space of sightings (m, 3), as deep as the path is then, and of the path (m, 3), NaN where it is not."""
    rows = np.array(camera[store.TRACK_ROWS], dtype=np.float64)
    poses = np.array(camera[store.POSES], dtype=np.float64)
    key = (zlib.crc32(rows), zlib.crc32(poses), list(camera[store.CLOCK]), id(path))
    place = (scene.session_uid, camera[store.ID], name)
    if place in _seen and _seen[place][0] == key:
        return _seen[place][1]
    origin, direction = rays_at(camera_paths.camera_path(camera), seen.pixel, seen.time_s)
    clock, late = clocks.clock_of(camera), videos.row_time_of(camera) or 0.0
    common = clock.to_common(seen.time_s) + late * (seen.pixel[:, 1] - videos.size_of(camera)[1] / 2)
    where = np.full((len(seen), 3), np.nan)
    if path is not None:
        inside = (common >= path.time_s[0]) & (common <= path.time_s[-1])
        for i in range(3):
            where[inside, i] = np.interp(common[inside], path.time_s, path.position[:, i])
    depth = np.einsum("ni,ni->n", where - origin, direction)
    lacking = np.isnan(depth) & np.isfinite(direction[:, 0])
    surface = reconstruction.ground(scene)
    if lacking.any():
        depth[lacking] = FAR_M
        if surface is not None:
            met = cast_rays(surface, origin[lacking], direction[lacking]).distance
            depth[lacking] = np.where(np.isfinite(met), met, FAR_M)
    _seen[place] = key, (origin + depth[:, None] * direction, where)
    return _seen[place][1]


def _add_pick(found: Drawing, lens: Camera, obj: bpy.types.Object, near: bool, active: bool) -> None:
    place = obj.location if picks.moved(obj) else obj[store.POSITION]
    pixel = project(lens, [list(place)])[0]
    if np.isnan(pixel[0]):
        return
    colour = picks.MARKER_COLOURS.get(obj[store.KIND], (1.0, 1.0, 1.0))
    found.marks.append(Mark(pixel, "ring", (*colour, 1.0 if near else 0.6), 8.0 if near else 5.0))
    if active:
        found.marks.append(Mark(pixel, "ring", (1.0, 0.65, 0.1, 1.0), 12.0))


def _add_active(
    found: Drawing, scene: bpy.types.Scene, camera: bpy.types.Object, lens: Camera, obj: bpy.types.Object
) -> None:
    """Disc, ellipse and second view of the selected pick."""
    place = np.array(obj.location if picks.moved(obj) else obj[store.POSITION], dtype=np.float64)
    radius = places.block_of(scene, obj[store.TRAJECTORY]).radius_m
    disc = around(place, np.array(obj.matrix_world.col[2].xyz), radius)
    found.lines.append(_closed(project(lens, disc), (1.0, 0.65, 0.1), 1.0, 0.9))
    clicked = clicks.of(obj)
    for click in clicked.values():
        axes = click.ellipse
        points = place + np.cos(CIRCLE)[:, None] * axes[0] + np.sin(CIRCLE)[:, None] * axes[1]
        found.lines.append(_closed(project(lens, points), EPIPOLAR, 1.5))
    curve = clicks.epipolar(scene, obj, camera)
    if curve is not None and len(curve) > 1:
        found.lines.append(_closed(curve, EPIPOLAR, 1.5))
    met = clicks.triangulated(scene, obj) if len(clicked) > 1 else None
    if met is not None and np.isfinite(met.point).all():
        pixel = project(lens, met.point)[0]
        if np.isfinite(pixel[0]):
            text = f"the rays miss each other by {100 * met.miss_distance[0]:.1f} cm"
            found.marks.append(Mark(pixel, "diamond", (*EPIPOLAR, 1.0), 7.0, text))


def around(place: Array, normal: Array, radius_m: float) -> Array:
    """(49, 3) a circle about a place, across a normal."""
    first, second = perpendicular(normal)
    return place + radius_m * (np.cos(CIRCLE)[:, None] * first + np.sin(CIRCLE)[:, None] * second)
