# SPDX-License-Identifier: GPL-3.0-or-later
"""Graphs in a composed film: those of `core.film.graphs`, drawn up to the present."""

from dataclasses import dataclass

import numpy as np

from ...analysis.axes import Axis
from ...vectors import Array
from ..graphs import FilmGraph, FilmGraphs
from .canvas import Box, Canvas, text_width
from .look import PAPER, QUIET, Colour
from .texts import Texts

CURSOR: Colour = (1.0, 0.82, 0.25)
GRID: Colour = (0.45, 0.48, 0.52)
GRID_OPACITY = 0.35
DIAMOND = 4


@dataclass(frozen=True, eq=False)
class Inset:
    """Graphs that stand in a picture.

    Attributes
    ----------
    graphs : in pixels of a picture of their own, counted from its lower left corner.
    height : of that picture [px].
    left, top : where the upper left corner of that picture lies in the film [px].
    words : in whose language the labels are; None for English.
    """

    graphs: FilmGraphs
    height: float
    left: float = 0.0
    top: float = 0.0
    words: Texts | None = None

    def _said(self, label: str) -> str:
        """A label in the film's language, its unit kept."""
        name, bracket, unit = label.partition(" [")
        return label if self.words is None else self.words.words.get(f"axis {name}", name) + bracket + unit

    def places(self, points: Array) -> Array:
        """(…, 2) of the graphs' picture → of the film."""
        return np.stack([points[..., 0] + self.left, self.height - points[..., 1] + self.top], axis=-1)

    def draw(self, canvas: Canvas, moment_s: float) -> None:
        """As they are at a moment of the fall [s]."""
        room = self.graphs.room
        corners = self.places(np.array([[room.left, room.top], [room.right, room.bottom]]))
        low, high = corners.min(axis=0), corners.max(axis=0)
        canvas.panel(Box(low[0], low[1], high[0], high[1]), opacity=0.72)
        for graph in self.graphs.graphs:
            self._axes(canvas, graph)
            self._content(canvas, graph, moment_s)
        if self.graphs.note:
            canvas.text(self.graphs.note, low[0], low[1] - canvas.look.gap, canvas.look.small, QUIET)

    def _axes(self, canvas: Canvas, graph: FilmGraph) -> None:
        axes, size = graph.frame, max(round(self.graphs.text_px), 9)
        plot = axes.plot
        (left, bottom), (right, top) = self.places(np.array([[plot.left, plot.bottom], [plot.right, plot.top]]))
        low = (axes.x.limits[0], axes.y.limits[0])
        for value, words in zip(axes.x_ticks.values, axes.x_ticks.texts, strict=True):
            x = float(self.places(axes.to_pixels(np.array([[value, low[1]]])))[0, 0])
            canvas.lines([np.array([[x, bottom], [x, top]])], GRID, 1, GRID_OPACITY)
            if graph.shows_x:
                canvas.text(words, x, bottom + 1.15 * size, size, QUIET, anchor="middle")
        for value, words in zip(axes.y_ticks.values, axes.y_ticks.texts, strict=True):
            y = float(self.places(axes.to_pixels(np.array([[low[0], value]])))[0, 1])
            canvas.lines([np.array([[left, y], [right, y]])], GRID, 1, GRID_OPACITY)
            canvas.text(words, left - 0.4 * size, y + 0.35 * size, size, QUIET, anchor="right")
        canvas.lines([np.array([[left, top], [left, bottom], [right, bottom]])], QUIET, 1, 0.8)
        canvas.text(self._fitting(axes.y, right - left, size), left, top - 0.45 * size, size, PAPER)
        if graph.shows_x:
            label = self._fitting(axes.x, right - left, size)
            canvas.text(label, right, bottom + 2.4 * size, size, PAPER, anchor="right")

    def _fitting(self, axis: Axis, width: float, size: int) -> str:
        """What an axis is of: its name, or its symbol where there is no room for that."""
        label = self._said(axis.label)
        return label if text_width(label, size) <= width or not axis.symbol else axis.symbol

    def _content(self, canvas: Canvas, graph: FilmGraph, moment_s: float) -> None:
        for strokes in graph.strokes:
            there = strokes.since_s <= moment_s + 1e-9
            ends, colours = self.places(strokes.ends[there]), strokes.colour[there]
            width = max(round(strokes.width_px), 1)
            for colour in np.unique(colours.round(3), axis=0):
                same = (np.abs(colours - colour) < 1e-3).all(axis=1)
                canvas.lines(list(ends[same]), (float(colour[0]), float(colour[1]), float(colour[2])), width)
        for dots in graph.dots:
            for place in self.places(dots.place[dots.since_s <= moment_s + 1e-9]):
                r = max(dots.radius_px, 2.0)
                if dots.corners == DIAMOND:
                    canvas.area([place + r * np.array([[1, 0], [0, 1], [-1, 0], [0, -1]])], dots.colour)
                else:
                    canvas.disc(place, r, dots.colour)
        if self.graphs.cursor_s is not None:
            low, high = self.graphs.cursor_s
            plot = graph.frame.plot
            share = float(np.clip((moment_s - low) / (high - low), 0, 1))
            x = plot.left + share * plot.width
            canvas.lines([self.places(np.array([[x, plot.bottom], [x, plot.top]]))], CURSOR, 1, 0.9)
