# SPDX-License-Identifier: GPL-3.0-or-later
"""Graphs over one time axis, one above the other: their places, and what of a line is worth drawing."""

from collections.abc import Callable, Sequence

import numpy as np

from ..vectors import Array, Indices
from .axes import Axis, ticks
from .graph_layout import GAP, Frame, Rectangle
from .graphs import axis_limits
from .motion_graphs import MotionCourse, Quantity, time_limits

TITLE = 1.7
"""Room for a title above each graph, in heights of the text."""
BELOW = 2 + 3 * GAP
"""Room for numbers and label of the time axis, likewise."""
LEAST = 3.0
"""A graph that is lower shows nothing, in heights of the text."""
DENSEST_PX = 1.0
"""Two moments of a line are not nearer than this along the axis, but where it jumps."""


def fitting(count: int, height: float, text: float, above: float = 0.0) -> int:
    """How many of so many graphs have room one above the other in a height [px]; at least one. For the rest see
    `stacked`."""
    return max(1, min(count, int((height - BELOW * text - above) // ((TITLE + LEAST) * text))))


def stacked(
    room: Rectangle, x: Axis, ys: Sequence[Axis], text: float, measure: Callable[[str], float], above: float = 0.0
) -> list[Frame]:
    """Equal graphs from the top down with the axis `x` in common, whose numbers stand below the lowest one.

    Parameters
    ----------
    text : height of the text [px].
    measure : text → its width [px].
    above : room to be left above all [px].
    """
    gap, n = GAP * text, len(ys)
    below = BELOW * text
    whole = max((room.height - below - above) / max(n, 1), TITLE * text + 1.0)
    height = max(whole - TITLE * text, 1.0)
    y_ticks = [ticks(y, int(height / (1.8 * text))) for y in ys]
    wide = max((measure(one) for found in y_ticks for one in found.texts), default=0.0)
    left = 2 * gap + wide
    width = max(room.width - left - 2 * gap, 1.0)
    x_ticks = ticks(x, int(width / (4.5 * text)))
    frames = []
    for i, (y, marks) in enumerate(zip(ys, y_ticks, strict=True)):
        bottom = room.top - above - (i + 1) * whole
        low = room.bottom if i == n - 1 else bottom
        tile = Rectangle(room.left, low, room.width, bottom + whole - low)
        frames.append(Frame(tile, Rectangle(room.left + left, bottom, width, height), x, y, x_ticks, marks))
    return frames


def time_axis(courses: Sequence[MotionCourse], label: str = "Time [s]") -> Axis:
    """From the first to the last moment."""
    return Axis(time_limits(courses), label=label)


def quantity_axis(courses: Sequence[MotionCourse], quantity: Quantity) -> Axis:
    """That holds all values."""
    values = np.concatenate([np.zeros(0), *(course.series(quantity)[1] for course in courses)])
    return Axis(axis_limits(values), label=quantity.label)


def worth_drawing(course: MotionCourse, places: Array) -> Indices:
    """The moments of a course that a line needs, at places (q,) along the axis [px]: not two at one pixel, but both
    sides of jumps and gaps."""
    if not places.size:
        return np.empty(0, np.intp)
    flight = course.flight
    edge = np.r_[True, flight[1:] != flight[:-1]]
    edge |= np.r_[edge[1:], True]
    with np.errstate(invalid="ignore"):
        pixel = np.floor(places / DENSEST_PX)
    return np.flatnonzero(edge | np.r_[True, pixel[1:] != pixel[:-1]])
