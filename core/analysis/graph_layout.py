# SPDX-License-Identifier: GPL-3.0-or-later
"""Where graphs lie on a screen or a picture: tiles, the axes within a tile, and between data and pixels."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ..vectors import Array, Mask
from .axes import Axis, Ticks, ticks

SHAPE = 1.35
"""Width of a graph divided by its height, which the tiles come near to."""
BESIDE, BELOW = 5.0, 6.0
"""What numbers and labels take of a tile's width and height, in heights of the text."""
GAP = 0.6
"""Between numbers, ticks and labels, in heights of the text."""
FULL_LABEL = 0.95
"""A label in words may take this part of its axis."""


@dataclass(frozen=True)
class Rectangle:
    """A part of the screen [px], y up."""

    left: float
    bottom: float
    width: float
    height: float

    @property
    def right(self) -> float:
        return self.left + self.width

    @property
    def top(self) -> float:
        return self.bottom + self.height

    def holds(self, x: float, y: float) -> bool:
        return self.left <= x <= self.right and self.bottom <= y <= self.top

    def shrunk(self, by: float) -> "Rectangle":
        """Smaller by so many pixels on each side."""
        return Rectangle(self.left + by, self.bottom + by, max(self.width - 2 * by, 1), max(self.height - 2 * by, 1))


@dataclass(frozen=True)
class Frame:
    """The axes of one graph on the screen.

    Attributes
    ----------
    tile : all that belongs to the graph.
    plot : between the axes.
    x, y : the axes.
    x_ticks, y_ticks : of them.
    """

    tile: Rectangle
    plot: Rectangle
    x: Axis
    y: Axis
    x_ticks: Ticks
    y_ticks: Ticks

    def to_pixels(self, points: Array) -> Array:
        """(n, 2) data → (n, 2) pixels; NaN where a logarithmic axis has no place."""
        points = np.asarray(points, dtype=np.float64)
        places = np.stack([self.x.places(points[:, 0]), self.y.places(points[:, 1])], axis=1)
        return places * (self.plot.width, self.plot.height) + (self.plot.left, self.plot.bottom)

    def to_data(self, pixels: Array) -> Array:
        """(n, 2) pixels → (n, 2) data."""
        pixels = np.asarray(pixels, dtype=np.float64)
        places = (pixels - (self.plot.left, self.plot.bottom)) / (self.plot.width, self.plot.height)
        return np.stack([self.x.values(places[:, 0]), self.y.values(places[:, 1])], axis=1)

    def part_at(self, x: float, y: float) -> str:
        """What of the graph is at a pixel: "plot", "x" or "y" for an axis with its label, "title" above; else ""."""
        if not self.tile.holds(x, y):
            return ""
        if self.plot.holds(x, y):
            return "plot"
        if y < self.plot.bottom:
            return "x" if x >= self.plot.left else ""
        return "y" if x < self.plot.left else "title" if y > self.plot.top else ""


def tiles(room: Rectangle, count: int, gap: float = 0.0, text: float = 0.0) -> list[Rectangle]:
    """`count` equal tiles that fill a room row by row, in as many columns as make their plots largest.

    text : height of the text [px], for the room that numbers and labels take of each tile.
    """

    def size(columns: int) -> float:
        rows = -(-count // columns)
        return min((room.width / columns - BESIDE * text) / SHAPE, room.height / rows - BELOW * text)

    columns = max(range(1, count + 1), key=lambda n: (round(size(n), 6), -n))
    rows = -(-count // columns)
    width, height = (room.width - gap * (columns - 1)) / columns, (room.height - gap * (rows - 1)) / rows
    return [
        Rectangle(
            room.left + (i % columns) * (width + gap),
            room.top - (i // columns) * (height + gap) - height,
            max(width, 1.0),
            max(height, 1.0),
        )
        for i in range(count)
    ]


def frame(tile: Rectangle, x: Axis, y: Axis, text: float, measure: Callable[[str], float], top: float = 0.0) -> Frame:
    """The axes within a tile, with room for numbers and labels.

    Parameters
    ----------
    text : height of the text [px].
    measure : text → its width [px].
    top : room to be left above the plot [px].
    """
    gap = GAP * text
    bottom, top = 2 * text + 3 * gap, max(top, gap + text / 2)
    height = max(tile.height - bottom - top, 1.0)
    y_ticks = ticks(y, int(height / (2.2 * text)))
    wide = max((measure(one) for one in y_ticks.texts), default=0.0)
    left = text + 3 * gap + wide
    x_most = int((tile.width - left) / (4 * text))
    x_ticks = ticks(x, x_most)
    last = measure(x_ticks.texts[-1]) / 2 if x_ticks.texts else 0.0
    width = max(tile.width - left - max(last, gap) - gap, 1.0)
    widest = max((measure(one) for one in x_ticks.texts), default=0.0)
    x_ticks = ticks(x, min(x_most, int(width / (widest + 1.5 * text))))
    return Frame(tile, Rectangle(tile.left + left, tile.bottom + bottom, width, height), x, y, x_ticks, y_ticks)


def shown_label(axis: Axis, length: float, measure: Callable[[str], float]) -> str:
    """An axis' label in words, or its symbol where there is no room for them."""
    return axis.label if measure(axis.label) <= FULL_LABEL * length or not axis.symbol else axis.symbol


def nearest_place(places: Array, x: float, y: float, reach: float) -> int:
    """Index of the one of (n, 2) places that is nearest to a pixel, of equal ones the last, which is on top; −1 when
    none is within `reach`."""
    if not len(places):
        return -1
    with np.errstate(invalid="ignore"):
        near = np.flatnonzero((np.abs(places[:, 0] - x) <= reach) & (np.abs(places[:, 1] - y) <= reach))
    if not near.size:
        return -1
    away = np.hypot(places[near, 0] - x, places[near, 1] - y)
    best = int(near.size - 1 - np.argmin(away[::-1]))
    return int(near[best]) if away[best] <= reach else -1


def in_box(places: Array, corner: tuple[float, float], other: tuple[float, float]) -> Mask:
    """(n,) which of (n, 2) places are in a box, its corners in any order."""
    low, high = np.minimum(corner, other), np.maximum(corner, other)
    with np.errstate(invalid="ignore"):
        return np.asarray(((places >= low) & (places <= high)).all(axis=1))


def in_lasso(places: Array, outline: Array) -> Mask:
    """(n,) which of (n, 2) places are within a closed outline (k, 2), by the even-odd rule."""
    inside = np.zeros(len(places), dtype=np.bool_)
    outline = np.asarray(outline, dtype=np.float64)
    if len(outline) < 3:
        return inside
    near = np.flatnonzero(in_box(places, tuple(outline.min(axis=0)), tuple(outline.max(axis=0))))
    x, y = places[near].T
    odd = np.zeros(near.size, dtype=np.bool_)
    for (x0, y0), (x1, y1) in zip(outline, np.roll(outline, -1, axis=0), strict=True):
        if y0 == y1:
            continue
        crossed = (y0 <= y) != (y1 <= y)
        odd ^= crossed & (x < x0 + (y - y0) / (y1 - y0) * (x1 - x0))
    inside[near] = odd
    return inside
