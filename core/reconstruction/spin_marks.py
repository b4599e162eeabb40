# SPDX-License-Identifier: GPL-3.0-or-later
"""One point of a block as it was marked in pictures of videos: what its spin is measured from."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np

from ..camera.model import SIGMA_PX
from ..camera.path import rays_at
from ..errors import InputError
from ..georeference import GlobalShift
from ..vectors import Array, Indices, Names
from .refinement.views import View
from .sightings import Sightings

Axis = Literal["rolling", "sight"]
AXES: tuple[Axis, ...] = get_args(Axis)
AXIS_WORDS: dict[Axis, str] = {
    "rolling": "horizontal, across the flight: the block rolls forwards (assumed)",
    "sight": "the line of sight: the point turns in the picture's plane (assumed)",
}


@dataclass(frozen=True, eq=False)
class SpinMarks(Sightings):
    """One point of each block as marked in pictures of one video; in one flight it is the same point.

    Attributes
    ----------
    axis : (m,) of `AXES`, what is assumed of the axis; that of a flight's first mark holds.
    about : (m,) turns per second as counted by eye, negative for backwards; the flight's last one holds, NaN says
        nothing.
    """

    axis: Names
    about: Array


@dataclass(frozen=True, eq=False)
class MarkedVideo:
    """One video with the marks in it."""

    view: View
    marks: SpinMarks


@dataclass(frozen=True, eq=False)
class Marks:
    """m marks of all videos; origin, ray : (m, 3). right, down : (m, 3) of the picture.

    aside : (m, 4, 3) rays a standard deviation to either side, in u and in v.
    step_s : (m,) between two pictures of the video [s]; NaN where the frames do not tell it.
    """

    trajectory: Names
    time_s: Array
    origin: Array
    ray: Array
    aside: Array
    right: Array
    down: Array
    axis: Names
    about: Array
    step_s: Array


def joined(videos: Sequence[MarkedVideo], shift: GlobalShift) -> Marks | None:
    """All marks in the order of their times on the common clock, in a local frame; None where there are none."""
    parts = []
    for video in videos:
        marks, view = video.marks, video.view.in_shift(shift)
        unknown = sorted(set(marks.axis.tolist()) - set(AXES))
        if unknown:
            raise InputError(f"Unknown axis of spin {unknown[0]!r}", advice=f"Use one of {', '.join(AXES)}")
        if not len(marks):
            continue
        sigma = np.where(np.isfinite(marks.sigma_px), marks.sigma_px, SIGMA_PX)
        origin, ray = rays_at(view.path, marks.pixel, marks.time_s)
        aside = [
            rays_at(view.path, marks.pixel + sigma[:, None] * way, marks.time_s)[1]
            for way in np.array([[1.0, 0.0], [-1.0, 0.0], [0.0, 1.0], [0.0, -1.0]])
        ]
        turn, time = view.path.poses_at(marks.time_s)[1], view.exposed_at(marks.time_s, marks.pixel)
        parts.append(
            (
                marks.trajectory, time, origin, ray, np.stack(aside, axis=1),
                turn[:, 0], turn[:, 1], marks.axis, marks.about,
                np.full(len(marks), _step(marks, view)),
            )
        )  # fmt: skip
    if not parts:
        return None
    found = Marks(*(np.concatenate(column) for column in zip(*parts, strict=True)))
    return some(found, np.argsort(found.time_s, kind="stable"))


def _step(marks: SpinMarks, view: View) -> float:
    """Time between two pictures of a video on the common clock [s]; NaN where two marks with frames do not tell it."""
    known = np.flatnonzero(marks.frame >= 0)
    frame, time = marks.frame[known], view.clock.to_common(marks.time_s[known])
    return float(np.ptp(time) / np.ptp(frame)) if known.size and np.ptp(frame) else np.nan


def some(marks: Marks, rows: Indices) -> Marks:
    """These of the marks."""
    return Marks(*(column[rows] for column in vars(marks).values()))
