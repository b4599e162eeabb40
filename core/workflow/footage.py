# SPDX-License-Identifier: GPL-3.0-or-later
"""From the files of a project's videos to what was seen in them: views with their clocks, pixels of blocks, events."""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from ..errors import InputError, RockfallError
from ..exchange.cameras import CameraFile
from ..exchange.footage_tables import EventTable, Track, read_events, read_track
from ..exchange.project import Project, VideoEntry
from ..exchange.spin_tables import SPIN_MARKS_ADVICE, read_spin_marks
from ..footage.advice import capture_rate_sentence
from ..footage.clock import Clock
from ..footage.file_facts import file_facts
from ..footage.sequences import is_there
from ..footage.video import Video, open_video
from ..georeference import GlobalShift
from ..progress import Progress, silent
from ..reconstruction.picks import Picks
from ..reconstruction.refinement.views import View
from ..reconstruction.sightings import NO_EVENTS, NO_SIGHTINGS, SeenVideo
from ..reconstruction.spin_marks import MarkedVideo
from ..reconstruction.trajectory import Reconstruction
from ..remarks import Remark
from ..terrain.surface import Surface
from ..vectors import Array, Indices
from .first_picks import first_picks
from .opening import block_of, read_project_camera, reconstruct_project

MARGIN = 0.1
"""A tracked block may leave the image by this part of its size."""

UNREFINED = "The project has no picks: its paths join the impacts seen in the videos, and are not refined."
EXAMPLE = 'name = "left", camera = "camera.toml", track = "track.csv", offset_s = 0.0'


@dataclass(frozen=True, eq=False)
class ReadVideo:
    """One video of a project, with what is in its files; the track or the events may be missing."""

    entry: VideoEntry
    camera: CameraFile
    track: Track | None
    events: EventTable | None
    clock: Clock

    @property
    def seen(self) -> SeenVideo:
        """What was seen in it."""
        camera, quality = self.camera, self.camera.quality
        view = View(
            self.entry.name,
            camera.path,
            self.clock,
            self.entry.row_time_s,
            camera.pose_covariance,
            None if quality is None else quality.covariance,
        )
        track = NO_SIGHTINGS if self.track is None else self.track
        return SeenVideo(view, track, NO_EVENTS if self.events is None else self.events)


@dataclass(frozen=True, eq=False)
class Footage:
    """The videos of a project that have a camera and a track; notes are sentences about what was left out."""

    videos: tuple[ReadVideo, ...]
    notes: tuple[str, ...] = ()

    @property
    def seen(self) -> tuple[SeenVideo, ...]:
        """What was seen in them."""
        return tuple(video.seen for video in self.videos)

    @property
    def shift(self) -> GlobalShift:
        """Of the local frame of the cameras."""
        return self.videos[0].camera.path.reference.shift


def open_footage(
    project: Project, surface: Surface | None = None, shift: GlobalShift | None = None, name: str = ""
) -> Footage:
    """Read the cameras and tracks of a project.

    Parameters
    ----------
    surface : the project's terrain, in whose frame the cameras are.
    shift : of the local frame where there is no terrain; None takes the one proposed for the first camera.
    name : of the trajectory, for tracks that name none.

    Raises
    ------
    RockfallError : no video has both a camera and a track, or one of the files is bad.
    """
    entries = [video for video in project.videos if video.camera is not None and video.track is not None]
    if not entries:
        raise RockfallError(_nothing_to_see(project))
    notes = tuple(
        f"Video {video.name} is not used: it has no {'camera' if video.camera is None else 'track'}."
        for video in project.videos
        if video not in entries and (video.camera or video.track)
    )
    videos: list[ReadVideo] = []
    for entry in entries:
        notes += capture_rate_notes(entry)
        video, turned = _read(entry, surface, shift, name, with_events=False)
        videos.append(video)
        notes += turned
        shift = videos[0].camera.path.reference.shift
    return Footage(tuple(videos), notes)


def open_entry(entry: VideoEntry, progress: Progress = silent, *, thorough: bool = False) -> Video:
    """The video of a project's entry, or its sequence of pictures.

    Raises
    ------
    InputError : the entry names no file; see `open_video`.
    """
    if entry.file is None:
        raise InputError(f"Video {entry.name} names no file", advice='Add file = "…" to it in the project')
    return open_video(entry.file, progress, thorough=thorough, rate_hz=entry.rate_hz)


def capture_rate_notes(entry: VideoEntry) -> tuple[str, ...]:
    """A sentence where a video's file names a capture rate, and the project none."""
    if entry.file is None or entry.capture_rate_hz is not None or not entry.file.is_file():
        return ()
    facts = file_facts(entry.file)
    if not facts.streams:
        return ()
    rate = facts.streams[facts.used].rate_hz
    how = f"If so, add capture_rate_hz = {facts.capture_rate_hz:.6g} to the project's video; else {rate:.6g}"
    said = capture_rate_sentence(facts, rate, f"{how}, the rate of the file.")
    return (f"{entry.name}: {said}",) if said else ()


def name_trajectory(footage: Footage, picks: Picks) -> Footage:
    """Pixels without a trajectory belong to the only one that there is.

    Raises
    ------
    InputError : there are several.
    """
    names = list(dict.fromkeys(picks.trajectory.tolist()))
    videos = []
    for video in footage.videos:
        track = video.track
        if track is not None and (nameless := track.trajectory == "").any():
            if len(names) != 1:
                raise track.error(
                    int(np.argmax(nameless)),
                    f"The track does not name the trajectory, but there are picks of {len(names)}",
                    f"Add a column trajectory, with {', '.join(names[:5])}",
                )
            track = replace(track, trajectory=np.where(nameless, names[0], track.trajectory))
        videos.append(replace(video, track=track))
    return replace(footage, videos=tuple(videos))


def picks_from_footage(project: Project, surface: Surface | None, *, name: str = "") -> Picks:
    """First picks, from the events of a project's videos, or from where its tracked blocks change their velocity.

    Parameters
    ----------
    surface : the terrain; without one the distance of the block is not known.
    name : of the trajectory, for events and tracks that name none.

    Raises
    ------
    RockfallError : no video has a camera and events or a track, there is no terrain, or nothing happens in the tracks.
    InputError : the ray of an event misses the terrain, with the row.
    """
    entries = [video for video in project.videos if video.camera is not None and (video.events or video.track)]
    if not entries:
        raise RockfallError(
            'The project has no picks, and no video with events to make them from: add [picks] file = "picks.csv", or '
            'events = "events.csv" to its [[videos]].'
        )
    if surface is None:
        raise RockfallError('Picks can be made from events on a terrain only: add [terrain] file = "…" to the project.')
    videos = [_read(entry, surface, None, name, with_events=True)[0] for entry in entries]
    tables = [table for video in videos for table in (video.track, video.events) if table is not None]
    names = {one for table in tables for one in table.trajectory.tolist()}
    found = first_picks(
        [video.seen for video in videos],
        surface,
        {one: block_of(project, one) for one in names},
        gravity_mps2=project.reconstruction.gravity_mps2,
        normal_radius_m=project.reconstruction.normal_radius_m,
    )
    for video, missed in zip(videos, found.missed, strict=True):
        if video.events is not None and missed.size:
            i = int(missed[0])
            u, v = video.events.pixel[i]
            raise video.events.error(
                i,
                f"The ray through the pixel ({u:.1f}, {v:.1f}) of {video.entry.name} misses the terrain",
                "Check the camera and the event, or give a larger terrain",
            )
    if not len(found.picks):
        raise RockfallError(
            "The project has no picks, no video with events to make them from, and the tracked blocks change their "
            'velocity nowhere: add [picks] file = "picks.csv", or events = "events.csv" to its [[videos]].'
        )
    return found.picks


def measured_in(project: Project, surface: Surface | None) -> Reconstruction:
    """As `reconstruct_project`; where there are no picks, from the impacts seen in the videos, which a remark says.

    Raises
    ------
    RockfallError : see `reconstruct_project` and `picks_from_footage`.
    """
    if project.picks is not None or all(video.events is None for video in project.videos):
        return reconstruct_project(project, surface)
    made = reconstruct_project(project, surface, picks_from_footage(project, surface))
    return replace(made, remarks=(Remark(UNREFINED, about="picks"), *made.remarks))


def read_marked_videos(
    project: Project, surface: Surface | None, shift: GlobalShift | None = None
) -> tuple[tuple[MarkedVideo, ...], tuple[str, ...]]:
    """The videos of a project in which spins were marked, and sentences on what was done to their cameras.

    Parameters
    ----------
    surface : the project's terrain, in whose frame the cameras are.
    shift : of the local frame where there is no terrain (the picks').

    Raises
    ------
    InputError : none has a camera and marks, or one of the files is bad.
    """
    found, notes = [], []
    for entry in project.videos:
        if entry.spin_marks is None:
            continue
        if entry.camera is None:
            raise InputError(
                f"Video {entry.name} has marks of spins, but no camera", advice='Align it, and name its camera = "…"'
            )
        camera, turned = read_project_camera(entry.camera, surface, shift)
        notes += [f"{entry.name}: {note}" for note in turned]
        marks = read_spin_marks(entry.spin_marks)
        clock = clock_of(entry, marks.frame, marks.time_s)
        found.append(MarkedVideo(View(entry.name, camera.path, clock, entry.row_time_s, camera.pose_covariance), marks))
    if not found:
        raise InputError("No video of the project has marks of spins", advice=SPIN_MARKS_ADVICE)
    return tuple(found), tuple(notes)


def clock_of(entry: VideoEntry, frame: Indices, time_s: Array) -> Clock:
    """The clock of a video; the rate of the file comes from the file itself, else from the frames (n,) of a table.

    Raises
    ------
    InputError : a capture rate is given, but neither gives the rate of the file.
    """
    rate = 1.0
    if entry.capture_rate_hz is not None:
        rate = _file_rate(entry, frame, time_s) / entry.capture_rate_hz
    return Clock(entry.offset_s, entry.drift, entry.origin_s, rate, entry.gaps)


def _read(
    entry: VideoEntry, surface: Surface | None, shift: GlobalShift | None, name: str, *, with_events: bool
) -> tuple[ReadVideo, tuple[str, ...]]:
    """The files of a video that has a camera, and a track or events; and sentences on what was done to them."""
    camera, turned = read_project_camera(Path(str(entry.camera)), surface, shift)
    track = None if entry.track is None else read_track(entry.track)
    events = read_events(entry.events) if with_events and entry.events is not None else None
    if track is not None:
        _check_inside(track, camera, entry)
        track = replace(track, trajectory=np.where(track.trajectory == "", name, track.trajectory))
    if events is not None:
        events = replace(events, trajectory=np.where(events.trajectory == "", name, events.trajectory))
    timed = next(table for table in (track, events) if table is not None)
    read = ReadVideo(entry, camera, track, events, clock_of(entry, timed.frame, timed.time_s))
    return read, tuple(f"{entry.name}: {note}" for note in turned)


def _file_rate(entry: VideoEntry, frame: Indices, time_s: Array) -> float:
    """Frames per second of the file."""
    if entry.file is not None and is_there(entry.file):
        return open_entry(entry).rate_hz
    known = np.flatnonzero(frame >= 0)
    if known.size > 1 and np.ptp(frame[known]) > 0:
        return 1.0 / float(np.polyfit(frame[known], time_s[known], 1)[0])
    raise InputError(
        f"Video {entry.name} has a capture rate, but nothing tells the rate of its file",
        file=entry.file,
        advice="Correct the path of the video in the project, or give the column frame in its track",
    )


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
