# SPDX-License-Identifier: GPL-3.0-or-later
"""Where the block was seen in the videos: pixels of its centre, tracked or clicked, kept with each video's camera."""

from collections.abc import Collection
from dataclasses import dataclass

import bpy
import numpy as np

from ...core.footage.tracking import BlockTrack
from ...core.reconstruction.refinement.views import View
from ...core.reconstruction.sightings import SeenVideo, Sightings, joined
from ...core.vectors import Array, Indices
from . import camera_paths, clocks, named_rows, pictures, store, videos

COLUMNS = 6  # frame, video time, u, v, sigma, clicked by hand


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
    rows = _tables(camera).get(name, np.zeros((0, COLUMNS)))
    return Seen(rows[:, 0].astype(np.intp), rows[:, 1], rows[:, 2:4], rows[:, 4], rows[:, 5] > 0)


def click(camera: bpy.types.Object, name: str, frame: int, time_s: float, pixel: Array, sigma_px: float) -> None:
    """Keep a pixel that a person clicked on the block; another one in this picture is replaced."""
    tables = _tables(camera)
    rows = tables.get(name, np.zeros((0, COLUMNS)))
    rows = rows[rows[:, 0] != frame]
    tables[name] = np.vstack([rows, [frame, time_s, *pixel, sigma_px, 1.0]])
    _keep(camera, tables)


def keep_track(camera: bpy.types.Object, name: str, track: BlockTrack) -> None:
    """Keep a track; what was clicked by hand stays."""
    tables = _tables(camera)
    rows = tables.get(name, np.zeros((0, COLUMNS)))
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


def view_of(camera: bpy.types.Object) -> View:
    """An aligned video's camera with its clock.

    Raises
    ------
    RockfallError : it is not aligned.
    """
    quality = camera_paths.quality_of(camera)
    return View(
        camera.name,
        pictures.aligned_path(camera),
        clocks.clock_of(camera),
        videos.row_time_of(camera),
        camera_paths.pose_covariance(camera),
        None if quality is None else quality.covariance,
    )


def seen_video(camera: bpy.types.Object, names: Collection[str]) -> SeenVideo:
    """An aligned video, with what was seen of some trajectories.

    Raises
    ------
    RockfallError : it is not aligned.
    """
    tables = [(name, seen_in(camera, name)) for name in names]
    parts = [Sightings(np.full(len(t), name), t.frame, t.time_s, t.pixel, t.sigma_px) for name, t in tables]
    return SeenVideo(view_of(camera), joined(Sightings, parts))


def _tables(camera: bpy.types.Object) -> dict[str, Array]:
    """Name → (m, 6) rows: frame, video time, u, v, sigma, by hand."""
    return named_rows.tables(camera, store.TRACK_NAMES, store.TRACK_ROWS, COLUMNS)


def _keep(camera: bpy.types.Object, tables: dict[str, Array]) -> None:
    named_rows.keep(camera, store.TRACK_NAMES, store.TRACK_ROWS, tables)
