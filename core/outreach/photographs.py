# SPDX-License-Identifier: GPL-3.0-or-later
"""Pictures of the slope from a project's aligned videos, in whose colours its terrain is shown."""

from dataclasses import replace

import numpy as np

from ..camera.path import camera_at
from ..errors import RockfallError
from ..exchange.opening import read_project_camera
from ..exchange.project import Project, VideoEntry
from ..film.composed.ground import Photograph
from ..footage.video import open_video, read_frame
from ..progress import Progress, silent
from ..terrain.surface import Surface
from ..vectors import Array

FRAMES = 5
"""Of a video; what moves in it is gone in their median."""
MOST_VIDEOS = 4


def photographs_of(
    project: Project, surface: Surface | None, centre: Array, progress: Progress = silent
) -> tuple[tuple[Photograph, ...], tuple[str, ...]]:
    """Frames of the videos that have a file and a camera, and sentences on those that cannot be used.

    Parameters
    ----------
    centre : (3,) local coordinates of the origin about which the cameras are to stand [m].
    """
    found: list[Photograph] = []
    said = []
    entries = [video for video in project.videos if video.file is not None and video.camera is not None]
    for entry in entries[:MOST_VIDEOS]:
        try:
            found += _frames(entry, surface, centre, progress)
        except RockfallError as error:
            said.append(f"The terrain is shown without the colours of the video {entry.name}: {error}")
    return tuple(found), tuple(said)


def _frames(entry: VideoEntry, surface: Surface | None, centre: Array, progress: Progress) -> list[Photograph]:
    assert entry.file is not None
    assert entry.camera is not None
    path = read_project_camera(entry.camera, surface)[0].path
    video = open_video(entry.file, progress)
    size = path.reference.width, path.reference.height
    if size != (video.width, video.height):
        raise RockfallError(
            f"its camera is of a picture of {size[0]} × {size[1]} pixels, and it has {video.width} × {video.height}."
        )
    photographs: list[Photograph] = []
    for frame in np.unique(np.linspace(0, video.frames - 1, FRAMES).astype(np.intp)).tolist():
        progress(f"Reading {entry.name}", len(photographs), FRAMES)
        camera = camera_at(path, float(video.time_s[frame]))
        near = replace(camera, position=camera.position - centre)
        photographs.append(Photograph(read_frame(video, frame), near))
    return photographs
