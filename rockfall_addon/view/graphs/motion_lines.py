# SPDX-License-Identifier: GPL-3.0-or-later
"""The lines of one quantity over time: batches that are kept, and which line is under the mouse.

Lines are placed along axes that hold them all; zooming and panning change a matrix, not the batches.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ....core.analysis.axes import Axis
from ....core.analysis.graph_layout import Frame
from ....core.analysis.motion_graphs import RESIDUAL, MotionCourse, Quantity
from ....core.analysis.stacked_graphs import worth_drawing
from .drawing import Lines, Points
from .look import Rgb

REACH = 8.0
"""How far from the mouse a line is still hit, at interface scale 1 [px]."""

MOST_MOMENTS = 60_000
"""Of more moments, lines have only what can be told apart on `COARSE` places along the whole time axis."""
COARSE = 300


@dataclass(eq=False)
class Bundle:
    """Lines of several trajectories, drawn alike.

    Attributes
    ----------
    courses : whose they are.
    ends : (k, 2, 2) of all pieces, along the axes, single precision.
    span : (2, k) least and greatest place of each along the time axis.
    owner : (k,) place of the trajectory among the courses.
    lines : batch.
    points : batch of single values; None for a quantity that is known at all times.
    """

    courses: tuple[MotionCourse, ...]
    ends: np.ndarray
    span: np.ndarray
    owner: np.ndarray
    lines: Lines
    points: Points | None


def bundle(courses: Sequence[MotionCourse], quantity: Quantity, x: Axis, y: Axis, colour: Rgb) -> Bundle:
    """The lines of some trajectories."""
    thinned = quantity != RESIDUAL and sum(course.time_s.size for course in courses) > MOST_MOMENTS
    pieces, owners, singles = [np.empty((0, 2, 2))], [np.empty(0, dtype=np.intp)], [np.empty((0, 2))]
    for number, course in enumerate(courses):
        time_s, values = course.series(quantity)
        places = np.stack([x.places(time_s), y.places(values)], axis=1)
        if thinned:
            places = places[worth_drawing(course, COARSE * places[:, 0])]
        ends = np.stack([places[:-1], places[1:]], axis=1)
        ends = ends[np.isfinite(ends).all(axis=(1, 2))]
        pieces.append(ends)
        owners.append(np.full(len(ends), number))
        singles.append(places)
    every = np.concatenate(pieces).astype(np.float32)
    points = Points(np.concatenate(singles), colour, 0.5) if quantity == RESIDUAL else None
    return Bundle(tuple(courses), every, span_of(every), np.concatenate(owners), Lines(every), points)


def span_of(ends: np.ndarray) -> np.ndarray:
    """(2, k) least and greatest x of pieces (k, 2, 2)."""
    return np.stack([ends[:, :, 0].min(axis=1, initial=np.inf), ends[:, :, 0].max(axis=1, initial=-np.inf)])


def nearest_line(
    found: Bundle, frame: Frame, x: Axis, y: Axis, place: tuple[float, float], reach: float
) -> tuple[float, int]:
    """Distance [px] and owner of the line nearest to a pixel; (inf, −1) when none is within reach."""
    if not len(found.ends):
        return np.inf, -1
    corners = frame.to_pixels(np.stack([x.values(np.array([0.0, 1.0])), y.values(np.array([0.0, 1.0]))], axis=1))
    low, size = corners[0], corners[1] - corners[0]
    at = (np.array(place) - low) / size
    by = reach / np.abs(size)
    near = np.flatnonzero((found.span[0] <= np.float32(at[0] + by[0])) & (found.span[1] >= np.float32(at[0] - by[0])))
    if not near.size:
        return np.inf, -1
    start, end = (found.ends[near, i] * size for i in (0, 1))
    along = end - start
    length = np.maximum((along**2).sum(axis=1), 1e-12)
    share = np.clip((((at * size) - start) * along).sum(axis=1) / length, 0.0, 1.0)
    away = np.linalg.norm(at * size - start - share[:, None] * along, axis=1)
    best = int(np.argmin(away))
    return (float(away[best]), int(found.owner[near[best]])) if away[best] <= reach else (np.inf, -1)
