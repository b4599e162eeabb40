# SPDX-License-Identifier: GPL-3.0-or-later
"""From a project's videos to numbers: views with their clocks, the block's pixels, and first picks from seen events."""

from collections.abc import Collection
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from ..camera.model import SIGMA_PX, rays
from ..errors import InputError, RockfallError
from ..footage.clock import Clock
from ..georeference import GlobalShift
from ..reconstruction.picks import Picks, make_picks
from ..reconstruction.ray_flight import flight_through_rays
from ..reconstruction.refinement.views import PixelObservations, View
from ..reconstruction.triangulation import contact_points
from ..terrain.surface import Surface
from ..vectors import Array, Indices, Mask, Names
from .cameras import CameraFile, read_camera
from .footage_tables import Events, Track, read_events, read_track
from .opening import block_of
from .project import Project, VideoEntry

"""Of a tracked pixel without a standard deviation of its own."""
MARGIN = 0.1
"""A tracked block may leave the image by this part of its size."""
END_FRAMES = 6
"""Pixels before the first event, or after the last one, that make a flight."""
END_MISS_PX, END_MISS_SIGMAS = 2.0, 4.0
"""Pixels that miss a free flight by more than the larger of these, root mean square, are not of a flight."""
SIGMA_END_S = 1e-4
"""Of a pass at a tracked pixel: it is where the block was in that frame."""

Columns = dict[str, Names | Array]

EXAMPLE = 'name = "left", camera = "camera.toml", track = "track.csv", offset_s = 0.0'


@dataclass(frozen=True, eq=False)
class Footage:
    """What a project's videos tell: v views and m pixels.

    Attributes
    ----------
    entries, cameras, views : (v,) the videos that have a camera and a track, what is in their files, and as views.
    observations : the block's pixels in all of them.
    frame, row : (m,) of the tracks; −1 where the frame is not given.
    notes : sentences about what was left out.
    """

    entries: tuple[VideoEntry, ...]
    cameras: tuple[CameraFile, ...]
    views: tuple[View, ...]
    observations: PixelObservations
    frame: Indices
    row: Indices
    notes: tuple[str, ...] = ()


def open_footage(project: Project, shift: GlobalShift | None = None, name: str = "") -> Footage:
    """Read the cameras and tracks of a project.

    Parameters
    ----------
    shift : of the local frame (the terrain's); None takes the one proposed for the first camera.
    name : of the trajectory, for tracks that name none.

    Raises
    ------
    RockfallError : no video has both a camera and a track, or one of the files is bad.
    """
    files = [(video, video.camera, video.track) for video in project.videos]
    used = [(video, camera, track) for video, camera, track in files if camera is not None and track is not None]
    entries = tuple(video for video, _, _ in used)
    if not entries:
        raise RockfallError(_nothing_to_see(project))
    notes = tuple(
        f"Video {video.name} is not used: it has no {'camera' if video.camera is None else 'track'}."
        for video in project.videos
        if video not in entries and (video.camera or video.track)
    )
    cameras: list[CameraFile] = []
    views: list[View] = []
    tracks: list[Track] = []
    for entry, camera_file, track_file in used:
        camera, track = read_camera(camera_file, shift), read_track(track_file)
        shift = camera.path.reference.shift
        _check_inside(track, camera, entry)
        clock = clock_of(entry, track.frame, track.time_s)
        cameras.append(camera)
        tracks.append(track)
        views.append(View(entry.name, camera.path, clock, entry.row_time_s, camera.pose_covariance))
    names = np.concatenate([np.where(track.trajectory == "", name, track.trajectory) for track in tracks])
    sigma = np.concatenate([track.sigma_px for track in tracks])
    observations = PixelObservations(
        view=np.repeat(np.arange(len(tracks)), [len(track) for track in tracks]),
        trajectory=names,
        time_s=np.concatenate([track.time_s for track in tracks]),
        pixel=np.concatenate([track.pixel for track in tracks]),
        sigma_px=np.where(np.isnan(sigma), SIGMA_PX, sigma),
    )
    frame = np.concatenate([track.frame for track in tracks])
    row = np.concatenate([track.row for track in tracks])
    posed = np.concatenate([_has_pose(camera, track.time_s) for camera, track in zip(cameras, tracks, strict=True)])
    if not posed.all():
        notes += (f"{int((~posed).sum())} pixels are not used: the pose of the camera is not known in their frames.",)
    return Footage(entries, tuple(cameras), tuple(views), observations.take(posed), frame[posed], row[posed], notes)


def take_trajectories(footage: Footage, names: Collection[str]) -> Footage:
    """The footage with the pixels of some trajectories only."""
    rows = np.isin(footage.observations.trajectory, list(names))
    return replace(
        footage, observations=footage.observations.take(rows), frame=footage.frame[rows], row=footage.row[rows]
    )


def clock_of(entry: VideoEntry, frame: Indices, time_s: Array) -> Clock:
    """The clock of a video; the rate of the file comes from the file itself, else from the frames (n,) of a table.

    Raises
    ------
    InputError : a capture rate is given, but neither tells the rate of the file.
    """
    rate = 1.0
    if entry.capture_rate_hz is not None:
        rate = _file_rate(entry, frame, time_s) / entry.capture_rate_hz
    return Clock(entry.offset_s, entry.drift, entry.origin_s, rate)


def picks_from_events(project: Project, surface: Surface | None, *, name: str = "") -> Picks:
    """First picks, where the rays of the events of a project's videos meet the terrain.

    Parameters
    ----------
    surface : the terrain; without one nothing tells the distance.
    name : of the trajectory, for events that name none.

    Raises
    ------
    RockfallError : no video has a camera and events, or there is no terrain.
    InputError : a ray misses the terrain, with the row.

    Notes
    -----
    Events are pixels of the block's centre. A trajectory is taken from the video that has most events of it. Where the
    block was tracked in free flight before its first event or after its last one, a pass closes that flight.
    """
    entries = [video for video in project.videos if video.camera is not None and video.events is not None]
    if not entries:
        raise RockfallError(
            'The project has no picks, and no video with events to make them from: add [picks] file = "picks.csv", or '
            'events = "events.csv" to its [[videos]].'
        )
    if surface is None:
        raise RockfallError('Picks can be made from events on a terrain only: add [terrain] file = "…" to the project.')
    found = [(entry, read_events(Path(str(entry.events)))) for entry in entries]
    parts = []
    for (entry, events), rows in zip(found, _best_views([events for _, events in found]), strict=True):
        if rows.any():
            marked, normals = _event_picks(project, entry, events, rows, surface, name)
            parts += [marked, *_open_ends(project, entry, marked, normals, surface, name)]
    columns = {key: np.concatenate([part[key] for part in parts]) for key in parts[0]}
    return make_picks(
        columns["trajectory"],
        columns["time_s"],
        columns["position"],
        kind=columns["kind"],
        sigma_time_s=columns["sigma_time_s"],
        extra={key: columns[key] for key in ("video", "frame", "u_px", "v_px")},
        shift=surface.shift,
        sort=True,
    )


def _event_picks(
    project: Project,
    entry: VideoEntry,
    events: Events,
    rows: Mask,
    surface: Surface,
    name: str,
) -> tuple[Columns, Array]:
    """Columns of the picks, and the normals (n, 3) there."""
    chosen = np.flatnonzero(rows)
    path = read_camera(Path(str(entry.camera)), surface.shift).path
    clock = clock_of(entry, events.frame, events.time_s)
    names = np.where(events.trajectory == "", name, events.trajectory)[chosen]
    position, rotation = path.poses_at(events.time_s[chosen])
    pixel = events.pixel[chosen]
    origins, directions = rays(path.reference, pixel, position=position, rotation=rotation)
    sizes = {one: block_of(project, one).diameter_m for one in set(names.tolist())}
    diameter = np.array([sizes[one] for one in names.tolist()])
    seen = np.isfinite(directions).all(axis=1)
    point, normal = np.full((chosen.size, 3), np.nan), np.full((chosen.size, 3), np.nan)
    point[seen], normal[seen] = contact_points(
        surface, origins[seen], directions[seen], diameter[seen], project.reconstruction.normal_radius_m
    )
    for i in np.flatnonzero(np.isnan(point[:, 0])):
        raise events.error(
            int(chosen[i]),
            f"The ray through the pixel ({pixel[i, 0]:.1f}, {pixel[i, 1]:.1f}) of {entry.name} misses the terrain",
            "Check the camera and the event, or give a larger terrain",
        )
    late = entry.row_time_s * (pixel[:, 1] - path.reference.height / 2)
    columns: Columns = {
        "trajectory": names,
        "time_s": clock.to_common(events.time_s[chosen]) + late,
        "position": point,
        "kind": events.kind[chosen],
        "sigma_time_s": events.sigma_time_s[chosen] * clock.rate,
        **_seen_at(entry, events.frame[chosen], pixel),
    }
    return columns, normal


def _seen_at(entry: VideoEntry, frame: Indices, pixel: Array) -> Columns:
    """Columns that tell where in the video a pick was seen."""
    return {
        "video": np.full(frame.size, entry.name),
        "frame": np.array([str(number) if number >= 0 else "" for number in frame.tolist()], dtype=np.str_),
        "u_px": np.array(list(map(repr, pixel[:, 0].tolist())), dtype=np.str_),
        "v_px": np.array(list(map(repr, pixel[:, 1].tolist())), dtype=np.str_),
    }


def _open_ends(
    project: Project, entry: VideoEntry, marked: Columns, normals: Array, surface: Surface, name: str
) -> list[Columns]:
    """Passes that close the flights before the first and after the last event of each trajectory, if there are any."""
    if entry.track is None:
        return []
    track, path = read_track(entry.track), read_camera(Path(str(entry.camera)), surface.shift).path
    clock = clock_of(entry, track.frame, track.time_s)
    names = np.where(track.trajectory == "", name, track.trajectory)
    row_s = entry.row_time_s * (track.pixel[:, 1] - path.reference.height / 2)
    times = np.asarray(clock.to_common(track.time_s)) + row_s
    sigma = np.where(np.isnan(track.sigma_px), SIGMA_PX, track.sigma_px)
    ends = []
    for one in dict.fromkeys(marked["trajectory"].tolist()):
        picks = np.flatnonzero(marked["trajectory"] == one)
        order = picks[np.argsort(marked["time_s"][picks])]
        radius = block_of(project, one).radius_m
        for pick, before in ((order[0], True), (order[-1], False)):
            moment = float(marked["time_s"][pick])
            beyond = times < moment if before else times > moment
            rows = np.flatnonzero((names == one) & beyond)
            if rows.size < END_FRAMES:
                continue
            position, rotation = path.poses_at(track.time_s[rows])
            origins, directions = rays(path.reference, track.pixel[rows], position=position, rotation=rotation)
            if not np.isfinite(directions).all():
                continue
            centre = marked["position"][pick] + radius * normals[pick]
            flight = flight_through_rays(
                centre, moment, origins, directions, times[rows], project.reconstruction.gravity_mps2
            )
            miss_px = path.reference.fx * np.sqrt(np.mean(flight.miss**2))
            if not miss_px <= max(END_MISS_PX, END_MISS_SIGMAS * float(np.median(sigma[rows]))):
                continue
            i = int(np.argmin(times[rows]) if before else np.argmax(times[rows]))
            row = rows[i : i + 1]
            ends.append(
                {
                    "trajectory": np.array([one]),
                    "time_s": times[row],
                    "position": flight.position[i : i + 1],
                    "kind": np.array(["pass"]),
                    "sigma_time_s": np.array([SIGMA_END_S]),
                    **_seen_at(entry, track.frame[row], track.pixel[row]),
                }
            )
    return ends


def _best_views(tables: list[Events]) -> list[Mask]:
    """For each table, the rows (n,) of the trajectories of which it has most events; the first one on a tie."""
    most: dict[str, tuple[int, int]] = {}
    for number, events in enumerate(tables):
        names, counts = np.unique(events.trajectory, return_counts=True)
        for one, count in zip(names.tolist(), counts.tolist(), strict=True):
            if count > most.get(one, (0, 0))[0]:
                most[one] = count, number
    return [
        np.array([most[one][1] == number for one in events.trajectory.tolist()], dtype=np.bool_)
        for number, events in enumerate(tables)
    ]


def _file_rate(entry: VideoEntry, frame: Indices, time_s: Array) -> float:
    """Frames per second of the file."""
    if entry.file is not None and entry.file.is_file():
        from ..footage.video import open_video

        return open_video(entry.file).rate_hz
    known = np.flatnonzero(frame >= 0)
    if known.size > 1 and np.ptp(frame[known]) > 0:
        return 1.0 / float(np.polyfit(frame[known], time_s[known], 1)[0])
    raise InputError(
        f"Video {entry.name} has a capture rate, but nothing tells the rate of its file",
        file=entry.file,
        advice="Correct the path of the video in the project, or give the column frame in its track",
    )


def _has_pose(camera: CameraFile, time_s: Array) -> Mask:
    """(m,) the frame was recognised: its pose has a standard deviation."""
    path = camera.path
    near = np.clip(np.searchsorted(path.time_s, time_s), 0, path.time_s.size - 1)
    before = np.maximum(near - 1, 0)
    near = np.where(np.abs(path.time_s[before] - time_s) < np.abs(path.time_s[near] - time_s), before, near)
    return np.isfinite(path.sigma_position_m[near]) & np.isfinite(path.sigma_rotation[near])


def _check_inside(track: Track, camera: CameraFile, entry: VideoEntry) -> None:
    one = camera.path.reference
    size = np.array(one.size)
    outside = (track.pixel < -MARGIN * size) | (track.pixel > (1 + MARGIN) * size)
    for i in np.flatnonzero(outside.any(axis=1)):
        raise track.error(
            int(i),
            f"The pixel ({track.pixel[i, 0]:g}, {track.pixel[i, 1]:g}) lies far outside the image of camera "
            f"{Path(str(entry.camera)).name}, {one.width} × {one.height} px",
            "Track and camera must belong to one video, in one size",
        )


def _nothing_to_see(project: Project) -> str:
    if not project.videos:
        problem = "The project has no videos"
    else:
        lacking = [f"{video.name} has no {_lack(video)}" for video in project.videos]
        problem = f"No video of the project has both a camera and a track: {'; '.join(lacking)}"
    return (
        f"{problem}. Solve the camera with rockfall align, track the block, and add a section [[videos]] to the "
        f"project, with a line for each of: {EXAMPLE}."
    )


def _lack(video: VideoEntry) -> str:
    missing = [word for word, path in (("camera", video.camera), ("track", video.track)) if path is None]
    return " and no ".join(missing)
