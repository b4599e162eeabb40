# SPDX-License-Identifier: GPL-3.0-or-later
"""Axes on the screen: background, grid, numbers, labels."""

import numpy as np

from ....core.analysis.graph_layout import GAP, Frame, shown_label
from . import drawing
from .look import Look, alpha


def draw_axes(frame: Frame, look: Look, pointed: str = "") -> None:
    """Background, grid and numbers of a graph.

    pointed : the part under the mouse, of `Frame.part_at`: the label of an axis shows that it can be clicked.
    """
    plot, gap = frame.plot, GAP * look.text
    drawing.fill(plot, look.plot)
    at_x = plot.left + frame.x.places(np.array(frame.x_ticks.values)) * plot.width
    at_y = plot.bottom + frame.y.places(np.array(frame.y_ticks.values)) * plot.height
    minor_x = plot.left + frame.x.places(np.array(frame.x_ticks.minor)) * plot.width
    minor_y = plot.bottom + frame.y.places(np.array(frame.y_ticks.minor)) * plot.height
    for xs, ys, strength in ((minor_x, minor_y, 0.5), (at_x, at_y, 1.0)):
        upright = [((round(x), plot.bottom), (round(x), plot.top)) for x in xs]
        level = [((plot.left, round(y)), (plot.right, round(y))) for y in ys]
        if upright or level:
            drawing.lines(np.array(upright + level), alpha(look.grid, strength), look.line)
    corner = np.array([(plot.left, plot.top), (plot.left, plot.bottom), (plot.right, plot.bottom)])
    drawing.lines(corner, alpha(look.faint), look.line)
    for x, words in zip(at_x, frame.x_ticks.texts, strict=True):
        drawing.text(x, plot.bottom - gap, words, look.text, look.faint, (0.5, 1.0))
    for y, words in zip(at_y, frame.y_ticks.texts, strict=True):
        drawing.text(plot.left - gap, y, words, look.text, look.faint, (1.0, 0.5))
    label = shown_label(frame.x, plot.width, look.measure)
    drawing.text(
        plot.left + plot.width / 2,
        plot.bottom - 2 * gap - look.text,
        label,
        look.text,
        look.chosen if pointed == "x" else look.ink,
        (0.5, 1.0),
    )
    label = shown_label(frame.y, plot.height, look.measure)
    drawing.text(
        frame.tile.left + gap + look.text / 2,
        plot.bottom + plot.height / 2,
        label,
        look.text,
        look.chosen if pointed == "y" else look.ink,
        (0.5, 0.5),
        upright=True,
    )
