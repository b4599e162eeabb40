# SPDX-License-Identifier: GPL-3.0-or-later
"""Pictures of the slope from aligned videos, in whose colours its terrain is shown."""

from collections.abc import Iterable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from ..camera.path import CameraPath, camera_at
from ..errors import RockfallError
from ..exchange.project import Project
from ..film.composed.photographs import Photograph
from ..footage.video import open_video, read_frame
from ..progress import Progress, silent
from ..terrain.surface import Surface
from ..vectors import Array
from ..workflow.opening import read_project_camera

FRAMES = 5
"""Of a video; what moves in it is gone in their median."""
MOST_VIDEOS = 4


@dataclass(frozen=True, eq=False)
class Filmed:
    """A video of the slope, or pictures of a rate, and its camera, in the terrain's local coordinates."""

    name: str
    file: Path
    path: CameraPath
    rate_hz: float | None = None


def project_videos(project: Project, surface: Surface | None) -> tuple[tuple[Filmed, ...], tuple[str, ...]]:
    """The videos of a project that have a file and a camera, and sentences on those that cannot be used."""
    found, said = [], []
    for entry in project.videos:
        if entry.file is None or entry.camera is None:
            continue
        try:
            found.append(Filmed(entry.name, entry.file, _path_of(entry.camera, surface), entry.rate_hz))
        except RockfallError as error:
            said.append(_without(entry.name, error))
    return tuple(found), tuple(said)


def photographs_of(
    videos: Iterable[Filmed], centre: Array | None = None, progress: Progress = silent
) -> tuple[tuple[Photograph, ...], tuple[str, ...]]:
    """Frames of videos, of the first ones if there are many, and sentences on those that cannot be used.

    Parameters
    ----------
    centre : (3,) local coordinates of the origin about which the cameras are to stand [m].
    """
    found: list[Photograph] = []
    said = []
    for filmed in tuple(videos)[:MOST_VIDEOS]:
        try:
            found += _frames(filmed, np.zeros(3) if centre is None else centre, progress)
        except RockfallError as error:
            said.append(_without(filmed.name, error))
    return tuple(found), tuple(said)


def _path_of(camera: Path, surface: Surface | None) -> CameraPath:
    return read_project_camera(camera, surface)[0].path


def _without(name: str, error: RockfallError) -> str:
    return f"The terrain is shown without the colours of the video {name}: {error}"


def _frames(filmed: Filmed, centre: Array, progress: Progress) -> list[Photograph]:
    path = filmed.path
    video = open_video(filmed.file, progress, rate_hz=filmed.rate_hz)
    size = path.reference.width, path.reference.height
    if size != (video.width, video.height):
        raise RockfallError(
            f"its camera is of a picture of {size[0]} × {size[1]} pixels, and it has {video.width} × {video.height}."
        )
    photographs: list[Photograph] = []
    for frame in np.unique(np.linspace(0, video.frames - 1, FRAMES).astype(np.intp)).tolist():
        progress(f"Reading {filmed.name}", len(photographs), FRAMES)
        camera = camera_at(path, float(video.time_s[frame]))
        near = replace(camera, position=camera.position - centre)
        photographs.append(Photograph(read_frame(video, frame), near))
    return photographs
