# SPDX-License-Identifier: GPL-3.0-or-later
"""First picks from what was seen in videos: events, or kinks of a track → places on the terrain."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..camera.model import project, rays
from ..footage.kinks import find_kinks
from ..footage.repeats import repeat_sigma_s, rhythm
from ..reconstruction.block import Block, per_pick
from ..reconstruction.motion import GROUNDED
from ..reconstruction.picks import Picks, make_picks, take
from ..reconstruction.placement import pick_normals
from ..reconstruction.ray_flight import flight_through_rays
from ..reconstruction.refinement.ground_errors import normal_variance
from ..reconstruction.refinement.setup import default_accuracy
from ..reconstruction.refinement.views import View
from ..reconstruction.sightings import NO_EVENTS, Events, SeenVideo, Sightings, joined, some
from ..reconstruction.triangulation import SpacePoints, TerrainPicks, contact_points, pick_on_terrain, triangulate
from ..terrain.raycast import cast_rays, closest_point
from ..terrain.surface import Surface
from ..vectors import Array, Indices, Mask, Names, norm

FAR_M = 100.0
"""Distance at which pixels are taken to be that meet no terrain; only for a swaying camera does it matter."""
SAME_MOMENT_FRAMES = 2.0
"""An event that is nearer to a marked pick than this is that pick."""
END_FRAMES = 6
"""Pixels before the first pick, or after the last one, that make a flight."""
END_MISS_PX, END_MISS_SIGMAS = 2.0, 4.0
"""Pixels that miss a free flight by more than the larger of these, root mean square, are not of a flight."""
SIGMA_END_S = 1e-4
"""Of a pass at a tracked pixel: it is where the block was in that frame."""

NOT_FOUND = "The camera was not found in this picture: how well the place is known cannot be said."

Columns = dict[str, Names | Array]


@dataclass(frozen=True, eq=False)
class FirstPicks:
    """New picks.

    Attributes
    ----------
    picks : in the terrain's frame; `extra` names the video, frame and pixel of each.
    missed : for each video, which of its marked events have no place: their rays miss the terrain.
    """

    picks: Picks
    missed: tuple[Indices, ...]


@dataclass(frozen=True, eq=False)
class _Ends:
    """n picks at which flights may begin or end: the block's centre (n, 3) there, NaN where none does."""

    trajectory: Names
    time_s: Array
    centre: Array


def first_picks(
    videos: Sequence[SeenVideo],
    surface: Surface,
    block: Mapping[str, Block],
    *,
    gravity_mps2: float,
    normal_radius_m: float | None = None,
    marked: Picks | None = None,
) -> FirstPicks:
    """Picks where the rays of events meet the terrain, and passes that close the flights before and after them.

    Parameters
    ----------
    block : of each trajectory that was seen.
    marked : picks that are there already: they stay, and no others are made at their moments.

    Notes
    -----
    Events are those marked in a video; of a trajectory without any, the kinks of its tracks. A trajectory is taken from
    the video that has most events of it. Where the block was tracked in free flight before its first pick or after its
    last one, a pass closes that flight.
    """
    videos = [replace(video, view=video.view.in_shift(surface.shift)) for video in videos]
    marked = make_picks([], [], []) if marked is None else marked
    marked = marked.in_shift(surface.shift)
    given = {name for video in videos for name in video.events.trajectory.tolist()}
    tables = [_with_kinks(video, given, surface) for video in videos]
    owner = _owners(videos, tables)
    ends = _marked_ends(marked, surface, block, normal_radius_m)
    parts, missed = [_columns(NO_EVENTS, np.empty(0), np.empty((0, 3)), "")], []
    for number, (video, events) in enumerate(zip(videos, tables, strict=True)):
        own = [name for name, its_video in owner.items() if its_video == number]
        time = video.view.exposed_at(events.time_s, events.pixel)
        rows = np.flatnonzero(np.isin(events.trajectory, own) & ~_is_marked(video, events, time, marked))
        point, normal = _contacts(video.view, events, rows, surface, block, normal_radius_m)
        met = np.isfinite(point[:, 0])
        missed.append(rows[~met & (rows < len(video.events))])
        rows, point, normal = rows[met], point[met], normal[met]
        found = some(Events, events, rows)
        found = replace(found, sigma_time_s=found.sigma_time_s * video.view.clock.speed)
        parts.append(_columns(found, time[rows], point, video.view.name))
        radius = np.array([block[name].radius_m for name in found.trajectory.tolist()])
        ends = _Ends(
            np.r_[ends.trajectory, found.trajectory],
            np.r_[ends.time_s, time[rows]],
            np.concatenate([ends.centre, point + radius[:, None] * normal]),
        )
        for name in own:
            parts += _closing_passes(video, name, ends, gravity_mps2)
    columns = {key: np.concatenate([part[key] for part in parts]) for key in parts[0]}
    picks = make_picks(
        columns["trajectory"],
        columns["time_s"],
        columns["position"],
        kind=columns["kind"],
        sigma_time_s=columns["sigma_time_s"],
        extra={key: columns[key] for key in ("video", "frame", "u_px", "v_px")},
        shift=surface.shift,
        sort=True,
    )
    return FirstPicks(picks, tuple(missed))


def place_clicked(
    view: View,
    video_s: float,
    pixel: Array,
    sigma_px: float,
    surface: Surface,
    *,
    centre_of: Block | None = None,
    sigma_terrain_m: float | None = None,
    normal_radius_m: float | None = None,
) -> TerrainPicks:
    """Where a block touches the terrain that was clicked in a picture, (1, 3), and how well that is known.

    The covariance holds what the click, the camera's pose and the terrain are off; it is infinite where the camera was
    not found in this picture.

    Parameters
    ----------
    video_s : video time of the picture [s].
    pixel, sigma_px : (2,) and its standard deviation [px].
    centre_of : the block, when its centre was clicked; None when its contact was.
    sigma_terrain_m : accuracy of the terrain [m]; None is what is usual for its point spacing.
    """
    position, rotation = view.path.poses_at([video_s])
    camera = replace(view.path.reference, position=position[0], rotation=rotation[0])
    touching, seen = np.full(3, np.nan), np.asarray(pixel, dtype=np.float64)
    if centre_of is not None:
        origin, direction = rays(camera, seen[None])
        if np.isfinite(direction).all():
            diameter = np.array([centre_of.diameter_m])
            touching = contact_points(surface, origin, direction, diameter, normal_radius_m)[0][0]
        if np.isfinite(touching).all():
            seen = project(camera, touching)[0]
    about = touching if np.isfinite(touching).all() else pick_on_terrain(camera, seen[None], surface).point[0]
    distance = float(norm(about - camera.position)) if np.isfinite(about).all() else FAR_M
    sigma_terrain = default_accuracy(surface) if sigma_terrain_m is None else sigma_terrain_m
    pose = view.ray_covariance_at(video_s, distance)
    known = bool(np.isfinite(pose).all())
    found = pick_on_terrain(
        camera, seen[None], surface, sigma_px, pose_covariance=pose if known else None, sigma_terrain_m=sigma_terrain
    )
    if not known and np.isfinite(found.point).all():
        found = replace(found, covariance=np.full((1, 3, 3), np.inf), warning=(NOT_FOUND,))
    return replace(found, point=touching[None]) if np.isfinite(touching).all() else found


def point_clicked(
    views: Sequence[View], video_s: Sequence[float], pixels: Array, sigma_px: Sequence[float]
) -> SpacePoints:
    """The point in space that was clicked in pictures of two videos or more at one moment, with its covariance, which
    is infinite where a camera was not found in its picture.

    Parameters
    ----------
    video_s : of each picture, in the time of its own video [s].
    pixels, sigma_px : (v, 2) and (v,) their standard deviations [px].

    Raises
    ------
    InputError : there are fewer than two views.
    """
    poses = [view.path.poses_at([time]) for view, time in zip(views, video_s, strict=True)]
    cameras = [
        replace(view.path.reference, position=position[0], rotation=rotation[0])
        for view, (position, rotation) in zip(views, poses, strict=True)
    ]
    pixel, sigma = np.asarray(pixels, dtype=np.float64)[:, None], np.asarray(sigma_px, dtype=np.float64)[:, None]
    about = triangulate(cameras, pixel, sigma).point[0]
    distances = [float(np.nan_to_num(norm(about - camera.position), nan=FAR_M)) for camera in cameras]
    covariances = [view.ray_covariance_at(time, far) for view, time, far in zip(views, video_s, distances, strict=True)]
    if not all(np.isfinite(covariance).all() for covariance in covariances):
        return replace(triangulate(cameras, pixel, sigma), covariance=np.full((1, 3, 3), np.inf))
    return triangulate(cameras, pixel, sigma, pose_covariances=covariances)


def brought_to_terrain(
    surface: Surface, point: Array, covariance: Array, sigma_terrain_m: float | None = None
) -> tuple[Array, Array]:
    """The place of the terrain that is closest to a point (3,), and its covariance (3, 3); the point itself where there
    is none.

    Along the terrain it is known as the point is, across it as the terrain is.

    sigma_terrain_m : as of `place_clicked`.
    """
    near = closest_point(surface, point)
    if near is None:
        return point, covariance
    normal = surface.face_normals[near.face]
    if not np.isfinite(covariance).all():
        return near.point, covariance
    along = np.eye(3) - np.outer(normal, normal)
    sigma = default_accuracy(surface) if sigma_terrain_m is None else sigma_terrain_m
    across = normal_variance(sigma, normal[None])[0] * np.outer(normal, normal)
    return near.point, along @ covariance @ along + across


def coordinate_sigma(covariance: Array) -> float:
    """Standard deviation of a coordinate of a place with a covariance (3, 3): the root mean square of the three [m]."""
    return float(np.sqrt(np.trace(covariance) / 3))


def find_events(view: View, sightings: Sightings, surface: Surface) -> Events:
    """Impacts of one tracked block: where its velocity changes at once.

    Notes
    -----
    The track is brought into the picture of its first frame by the camera's own poses, so that a hand that turns it
    makes no kinks.
    """
    path = view.path
    sightings = some(Sightings, sightings, path.known_at(sightings.time_s))
    if not len(sightings):
        return NO_EVENTS
    place, turn = path.poses_at(sightings.time_s)
    steady = replace(path.reference, position=place[0], rotation=turn[0])
    origin, direction = rays(steady, sightings.pixel, position=place, rotation=turn)
    seen = np.flatnonzero(np.isfinite(direction).all(axis=1))
    reach = cast_rays(surface, origin[seen], direction[seen]).distance
    reach = np.where(np.isfinite(reach), reach, FAR_M)
    stable = project(steady, origin[seen] + reach[:, None] * direction[seen])
    inside = np.isfinite(stable).all(axis=1)
    seen, reach = seen[inside], reach[inside]
    time = sightings.time_s[seen]
    kinks = find_kinks(time, stable[inside], sightings.known_sigma_px[seen])
    if not len(kinks):
        return NO_EVENTS
    at, away = rays(steady, kinks.pixel)
    place, turn = path.poses_at(kinks.time_s)
    far = np.interp(kinks.time_s, time, reach)[:, None]
    frame = np.interp(kinks.time_s, time, sightings.frame[seen]).round().astype(np.intp)
    return Events(
        trajectory=np.full(len(kinks), sightings.trajectory[0]),
        frame=np.where(sightings.frame.min() < 0, -1, frame),
        time_s=kinks.time_s,
        pixel=project(steady, at + far * away, position=place, rotation=turn),
        sigma_time_s=np.hypot(kinks.sigma_time_s, _late_s(sightings)),
        kind=np.full(len(kinks), "impact"),
    )


def _late_s(sightings: Sightings) -> float:
    """What the error of times gets more where a track leaves out frames in a rhythm: repeated pictures [s]."""
    frame = sightings.frame
    if frame.size < 2 or frame.min() < 0:
        return 0.0
    left_out = np.setdiff1d(np.arange(frame.min(), frame.max() + 1), frame)
    if not any(rhythm(left_out)):
        return 0.0
    return repeat_sigma_s(float(np.ptp(sightings.time_s)) / float(np.ptp(frame)))


def _with_kinks(video: SeenVideo, given: set[str], surface: Surface) -> Events:
    """The video's events, and after them the kinks of its trajectories that no video has events of."""
    names = dict.fromkeys(video.sightings.trajectory.tolist())
    found = [
        find_events(video.view, some(Sightings, video.sightings, video.sightings.trajectory == name), surface)
        for name in names
        if name not in given
    ]
    return joined(Events, [video.events, *found])


def _owners(videos: Sequence[SeenVideo], tables: Sequence[Events]) -> dict[str, int]:
    """Trajectory → the video that has most events of it, or pixels where there are no events; the first on a tie."""
    most: dict[str, tuple[int, int]] = {}
    owner: dict[str, int] = {}
    for number, (video, events) in enumerate(zip(videos, tables, strict=True)):
        for name in dict.fromkeys([*events.trajectory.tolist(), *video.sightings.trajectory.tolist()]):
            count = int((events.trajectory == name).sum())
            rank = (count, 0 if count else int((video.sightings.trajectory == name).sum()))
            if rank > most.get(name, (0, 0)):
                most[name], owner[name] = rank, number
    return owner


def _marked_ends(marked: Picks, surface: Surface, block: Mapping[str, Block], normal_radius_m: float | None) -> _Ends:
    """No flight begins at a pass, which closes one, or where the block was shattered."""
    picks = take(marked, np.isin(marked.trajectory, list(block)) & (marked.status != "discarded"))
    radius = per_pick(picks, block, lambda one: one.radius_m)
    flies = np.isin(picks.kind, GROUNDED) & (picks.status != "shattered")
    normal = pick_normals(picks, surface, 2 * radius, normal_radius_m, flies).normal
    centre = picks.position + radius[:, None] * np.where(flies[:, None], normal, np.nan)
    return _Ends(picks.trajectory, picks.time_s, centre)


def _is_marked(video: SeenVideo, events: Events, time_s: Array, marked: Picks) -> Mask:
    """(n,) the event, at a common time, is one of the marked picks."""
    near = SAME_MOMENT_FRAMES * video.usual_step_s * video.view.clock.speed
    same = marked.trajectory[None] == events.trajectory[:, None]
    return np.asarray((same & (np.abs(marked.time_s[None] - time_s[:, None]) < near)).any(axis=1))


def _contacts(
    view: View,
    events: Events,
    rows: Indices,
    surface: Surface,
    block: Mapping[str, Block],
    normal_radius_m: float | None,
) -> tuple[Array, Array]:
    """Where blocks touch the terrain at some events, (n, 3), and the normals (n, 3) there; NaN where the ray misses."""
    position, rotation = view.path.poses_at(events.time_s[rows])
    origin, direction = rays(view.path.reference, events.pixel[rows], position=position, rotation=rotation)
    diameter = np.array([block[name].diameter_m for name in events.trajectory[rows].tolist()])
    point, normal = np.full((rows.size, 3), np.nan), np.full((rows.size, 3), np.nan)
    seen = np.isfinite(direction).all(axis=1)
    point[seen], normal[seen] = contact_points(surface, origin[seen], direction[seen], diameter[seen], normal_radius_m)
    return point, normal


def _closing_passes(video: SeenVideo, name: str, ends: _Ends, gravity_mps2: float) -> list[Columns]:
    """Passes that close the flights before the first and after the last pick of a trajectory, if there are any."""
    view, seen = video.view, video.sightings
    mine = np.flatnonzero(ends.trajectory == name)
    if not mine.size:
        return []
    seen = some(Sightings, seen, (seen.trajectory == name) & view.path.known_at(seen.time_s))
    times, sigma = view.exposed_at(seen.time_s, seen.pixel), seen.known_sigma_px
    found = []
    for pick, before in ((mine[np.argmin(ends.time_s[mine])], True), (mine[np.argmax(ends.time_s[mine])], False)):
        moment = float(ends.time_s[pick])
        rows = np.flatnonzero(times < moment if before else times > moment)
        if rows.size < END_FRAMES or np.isnan(ends.centre[pick, 0]):
            continue
        position, rotation = view.path.poses_at(seen.time_s[rows])
        origin, direction = rays(view.path.reference, seen.pixel[rows], position=position, rotation=rotation)
        if not np.isfinite(direction).all():
            continue
        flight = flight_through_rays(ends.centre[pick], moment, origin, direction, times[rows], gravity_mps2)
        miss_px = view.path.reference.fx * np.sqrt(np.mean(flight.miss**2))
        if not miss_px <= max(END_MISS_PX, END_MISS_SIGMAS * float(np.median(sigma[rows]))):
            continue
        i = int(np.argmin(times[rows]) if before else np.argmax(times[rows]))
        end = some(Sightings, seen, rows[i : i + 1])
        closed = Events(end.trajectory, end.frame, end.time_s, end.pixel, np.array([SIGMA_END_S]), np.array(["pass"]))
        found.append(_columns(closed, times[rows[i : i + 1]], flight.position[i : i + 1], view.name))
    return found


def _columns(events: Events, time_s: Array, position: Array, video: str) -> Columns:
    """Columns of picks, at common times; the events have the standard deviations of these."""
    return {
        "trajectory": events.trajectory,
        "time_s": time_s,
        "position": position,
        "kind": events.kind,
        "sigma_time_s": events.sigma_time_s,
        "video": np.full(len(events), video),
        "frame": np.array([str(number) if number >= 0 else "" for number in events.frame.tolist()], dtype=np.str_),
        "u_px": np.array(list(map(repr, events.pixel[:, 0].tolist())), dtype=np.str_),
        "v_px": np.array(list(map(repr, events.pixel[:, 1].tolist())), dtype=np.str_),
    }
