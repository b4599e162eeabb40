# SPDX-License-Identifier: GPL-3.0-or-later
"""The videos of a project file: their cameras, clocks and tracks, into the scene and out again."""

import re
import shutil
from dataclasses import dataclass, replace
from pathlib import Path

import bpy
import numpy as np

from ...core.camera.model import SIGMA_PX
from ...core.exchange.cameras import CameraFile, write_camera
from ...core.exchange.footage_tables import Track, read_track, write_track
from ...core.exchange.project import Project, VideoEntry
from ...core.exchange.spin_tables import read_spin_marks, write_spin_marks
from ...core.footage.clock import Clock, clock_for
from ...core.footage.sequences import is_there
from ...core.footage.video import Video
from ...core.georeference import GlobalShift
from ...core.reconstruction.spin_marks import SpinMarks
from ...core.terrain.surface import Surface
from ...core.workflow.footage import open_entry
from ...core.workflow.opening import read_project_camera
from . import (
    camera_paths,
    clocks,
    footage,
    georeference,
    new_videos,
    sightings,
    spins,
    store,
    video_files,
    video_times,
    videos,
)


@dataclass(frozen=True, eq=False)
class ReadVideo:
    """A video of a project, read."""

    entry: VideoEntry
    video: Video
    camera: CameraFile | None
    track: Track | None
    clock: Clock
    spin_marks: SpinMarks | None = None


def read_videos(project: Project, surface: Surface | None, shift: GlobalShift | None) -> list[ReadVideo]:
    """Read all that belongs to a project's videos; those whose frames nothing tells are left out.

    Parameters
    ----------
    surface : the terrain. shift : of the picks where there is none; None takes that of the first camera.

    Raises
    ------
    RockfallError : one of the files is bad.
    """
    found = []
    for entry in project.videos:
        camera = None if entry.camera is None else read_project_camera(entry.camera, surface, shift)[0]
        shift = camera.path.reference.shift if camera is not None and shift is None else shift
        track = None if entry.track is None else read_track(entry.track)
        video = _video(entry, camera, track)
        if video is None:
            continue
        clock = clock_for(
            video, entry.capture_rate_hz, offset_s=entry.offset_s, drift=entry.drift, origin_s=entry.origin_s
        )
        clock = replace(clock, gaps=entry.gaps)
        marks = None if entry.spin_marks is None else read_spin_marks(entry.spin_marks)
        found.append(ReadVideo(entry, video, camera, track, clock, marks))
    return found


def show_videos(scene: bpy.types.Scene, found: list[ReadVideo], name: str = "") -> list[bpy.types.Object]:
    """Make the cameras; a video that is there already, by its file, takes the project's numbers.

    The first one gives the scene its rate, and frame 0 is its first picture.

    Parameters
    ----------
    name : of the trajectory, for tracks that name none.
    """
    objects = []
    for read in found:
        first = not videos.cameras(scene)
        there = (c for c in videos.cameras(scene) if video_files.file_of(c) == read.video.path.resolve())
        camera = next(there, None) or new_videos.add_camera(scene, read.video)
        camera.name = read.entry.name
        clocks.set_clock(camera, read.clock)
        camera[store.CAPTURE_RATE] = read.entry.capture_rate_hz or 0.0
        if read.entry.row_time_s is not None:
            camera[store.ROW_TIME] = read.entry.row_time_s
        elif store.ROW_TIME in camera:
            del camera[store.ROW_TIME]
        if read.entry.events is not None:
            camera[store.EVENTS_FILE] = str(read.entry.events.resolve())
        if first:
            scene[store.TIME_ORIGIN] = float(read.clock.to_common(float(read.video.time_s[0])))
            clocks.begin_with(scene, camera)
        if read.camera is not None and read.camera.path.reference.size == videos.size_of(camera):
            camera_paths.set_camera_path(
                scene,
                camera,
                read.camera.path,
                rmse_px=read.camera.rmse_px,
                pose_covariance=read.camera.pose_covariance,
                quality=read.camera.quality,
            )
        if read.track is not None:
            _keep_track(camera, read.track, name)
        if read.spin_marks is not None:
            spins.keep_marks(camera, _of_frames(camera, read.spin_marks))
        objects.append(camera)
    if objects:
        video_times.fit_range(scene)
        footage.follow(scene)
    return objects


def write_videos(scene: bpy.types.Scene, folder: Path) -> tuple[VideoEntry, ...]:
    """Write the cameras and tracks into a folder, and tell how the project names them."""
    entries = []
    for camera in videos.cameras(scene):
        stem = re.sub(r"[^\w.-]+", "_", camera.name)
        files: dict[str, Path | None] = {"camera": None, "track": None, "events": None, "spin_marks": None}
        if camera_paths.is_solved(camera):
            files["camera"] = folder / f"{stem}_camera.toml"
            rmse = camera.get(store.RMSE)
            write_camera(
                files["camera"],
                camera_paths.camera_path(camera),
                rmse_px=None if rmse is None else float(rmse),
                crs=georeference.read_shift(scene).crs,
                pose_covariance=camera_paths.pose_covariance(camera),
                quality=camera_paths.quality_of(camera),
            )
        track = _track_of(camera)
        if track is not None:
            files["track"] = folder / f"{stem}_track.csv"
            write_track(track, files["track"])
        events = Path(str(camera.get(store.EVENTS_FILE, "")))
        if events.is_file():
            files["events"] = folder / f"{stem}_events.csv"
            shutil.copyfile(events, files["events"])
        marks = spins.all_marks(camera)
        if marks is not None:
            files["spin_marks"] = folder / f"{stem}_spin_marks.csv"
            write_spin_marks(marks, files["spin_marks"])
        clock = clocks.clock_of(camera)
        entries.append(
            VideoEntry(
                name=camera.name,
                file=video_files.file_of(camera),
                offset_s=clock.offset_s,
                drift=clock.drift,
                origin_s=clock.origin_s,
                gaps=clock.gaps,
                capture_rate_hz=videos.capture_rate_of(camera),
                rate_hz=video_files.sequence_rate_of(camera),
                row_time_s=videos.row_time_of(camera),
                **files,
            )
        )
    return tuple(entries)


def _video(entry: VideoEntry, camera: CameraFile | None, track: Track | None) -> Video | None:
    """The file, or, where it has moved, what the camera and the track tell of it; None when that is nothing."""
    if entry.file is not None and is_there(entry.file):
        return open_entry(entry)
    times = camera.path.time_s if camera is not None and not camera.path.is_fixed else None
    if times is None and track is not None and len(track):
        times = np.unique(track.time_s)
    if entry.file is None or camera is None or times is None:
        return None
    width, height = camera.path.reference.size
    rate = 1 / float(np.median(np.diff(times))) if times.size > 1 else np.nan
    return Video(entry.file, width, height, 0, "", "", rate, 0, times, np.empty(0))


def _keep_track(camera: bpy.types.Object, track: Track, name: str) -> None:
    times = videos.times_of(camera)
    names = np.where(track.trajectory == "", name or camera.name, track.trajectory)
    nearest = np.abs(times[:, None] - track.time_s).argmin(axis=0)
    frame = np.where(track.frame >= 0, track.frame, nearest)
    sigma = np.where(np.isnan(track.sigma_px), SIGMA_PX, track.sigma_px)
    for each in dict.fromkeys(names.tolist()):
        rows = names == each
        by_hand = np.zeros(int(rows.sum()))
        seen = sightings.Seen(frame[rows], track.time_s[rows], track.pixel[rows], sigma[rows], by_hand)
        sightings.keep_track(camera, each, seen)


def _of_frames(camera: bpy.types.Object, marks: SpinMarks) -> SpinMarks:
    """The marks with the frames and standard deviations that the table does not give."""
    nearest = np.abs(videos.times_of(camera)[:, None] - marks.time_s).argmin(axis=0)
    frame = np.where(marks.frame >= 0, marks.frame, nearest)
    return replace(marks, frame=frame, sigma_px=np.where(np.isnan(marks.sigma_px), SIGMA_PX, marks.sigma_px))


def _track_of(camera: bpy.types.Object) -> Track | None:
    parts = [(name, sightings.seen_in(camera, name)) for name in sightings.names_in(camera)]
    if not parts:
        return None
    count = sum(len(seen) for _, seen in parts)
    return Track(
        trajectory=np.concatenate([np.full(len(seen), name, dtype=object) for name, seen in parts]).astype(str),
        frame=np.concatenate([seen.frame for _, seen in parts]),
        time_s=np.concatenate([seen.time_s for _, seen in parts]),
        pixel=np.concatenate([seen.pixel for _, seen in parts]),
        sigma_px=np.concatenate([seen.sigma_px for _, seen in parts]),
        score=np.full(count, np.nan),
        row=np.arange(count),
    )
