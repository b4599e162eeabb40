# SPDX-License-Identifier: GPL-3.0-or-later
"""Graphs in the picture of a film: what is drawn where, and from which moment on."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..analysis.axes import Axis, Limits
from ..analysis.comparison import Predictions
from ..analysis.graph_layout import Frame, Rectangle, frame, tiles
from ..analysis.graph_series import usual_limits
from ..analysis.graphs import PAPER_GRAPHS, Graph, GraphSpec, make_graph
from ..analysis.motion_graphs import HEIGHT, KINETIC, SPEED, MotionCourse, Quantity, shown_quantities
from ..analysis.stacked_graphs import quantity_axis, stacked, worth_drawing
from ..analysis.variables import find_variable
from ..colours import MEASURED_COLOUR, SPEED_SCALE, scale_colours
from ..impact_models.registry import find_model
from ..reconstruction.impact import Impacts
from ..vectors import Array, Indices
from .framing import Margins

Colour = tuple[float, float, float]
LINK: Colour = (0.36, 0.39, 0.43)
WIDTH = 0.37
"""Part of the picture's width that graphs take, at its right."""
EDGE, HEAD, FOOT = 0.025, 0.2, 0.135
"""Parts of the picture's height that stay free beside them, above for the time and below for the credit."""
LETTER = 0.56
"""Mean width of a letter, in parts of its height."""
FILMED = (SPEED, HEIGHT, KINETIC)


@dataclass(frozen=True, eq=False)
class Strokes:
    """k straight pieces of lines.

    Attributes
    ----------
    ends : (k, 2, 2) [px], from the lower left corner of the picture.
    since_s : (k,) display time from which on each is there [s].
    colour : (k, 3) sRGB.
    width_px : [px].
    """

    ends: Array
    since_s: Array
    colour: Array
    width_px: float


@dataclass(frozen=True, eq=False)
class Dots:
    """n points.

    Attributes
    ----------
    place : (n, 2) [px].
    since_s : (n,) display time from which on each is there [s].
    colour : sRGB.
    radius_px : [px].
    corners : 4 for a diamond, more for a disc.
    """

    place: Array
    since_s: Array
    colour: Colour
    radius_px: float
    corners: int = 12


@dataclass(frozen=True, eq=False)
class FilmGraph:
    """One graph of a film.

    Attributes
    ----------
    frame : its axes [px].
    title : above it; may be empty.
    shows_x : whether the numbers of the x axis and its label stand below it.
    strokes, dots : in the order in which they are drawn.
    """

    frame: Frame
    title: str
    shows_x: bool
    strokes: tuple[Strokes, ...]
    dots: tuple[Dots, ...] = ()


@dataclass(frozen=True, eq=False)
class FilmGraphs:
    """All graphs of a film.

    Attributes
    ----------
    room : behind them.
    text_px : height of their text.
    cursor_s : display times at the two ends of the x axis, along which a cursor goes; None without a cursor.
    note : stands above them; may be empty.
    """

    room: Rectangle
    text_px: float
    graphs: tuple[FilmGraph, ...]
    cursor_s: tuple[float, float] | None = None
    note: str = ""


def beside_graphs(margins: Margins) -> Margins:
    """Margins of a picture that leave room for graphs at the right."""
    return Margins(min(margins.left, 0.3), max(margins.right, WIDTH + 0.03), margins.bottom, margins.top)


def impact_graphs(
    impacts: Impacts,
    offsets: Mapping[str, float],
    size: tuple[int, int],
    predictions: Predictions | None = None,
    specs: Sequence[GraphSpec] = PAPER_GRAPHS,
    row: Indices | None = None,
) -> FilmGraphs:
    """The graphs of impacts, whose points appear at the moments of the impacts; fitted lines after the last one.

    Parameters
    ----------
    offsets : trajectory → what is subtracted from its clock for the time of the film [s].
    size : width and height of the picture [px].
    predictions : models whose means are shown beside what was measured, linked to it.
    row : (m,) the impacts that pass the filters; None for all. That some do not is said above the graphs.
    """
    room, text = _room(size), text_height(size)
    since = impacts.time_s - np.array([offsets[name] for name in impacts.trajectory.tolist()])
    models = ("",) if predictions is None else predictions.models
    made = []
    for spec, tile in zip(specs, tiles(room.shrunk(text / 2), len(specs)), strict=True):
        found = [make_graph(impacts, spec, predictions, model, row=row) for model in models]
        x_limits, y_limits = usual_limits(
            spec, (_whole([g.x_limits for g in found]), _whole([g.y_limits for g in found]))
        )
        shown = replace(spec, x_limits=x_limits, y_limits=y_limits)
        graphs = [make_graph(impacts, shown, predictions, model, row=row) for model in models]
        x, y = _axis(spec.x, x_limits, spec.x_log), _axis(spec.y, y_limits, spec.y_log)
        axes = frame(tile, x, y, text, lambda words: LETTER * text * len(words))
        made.append(_impact_graph(axes, graphs, since, text))
    some = row is not None and row.size < len(impacts)
    note = f"Graphs: {row.size} of {len(impacts)} impacts (filtered)" if row is not None and some else ""
    return FilmGraphs(room, text, tuple(made), note=note)


def motion_graphs(
    courses: Sequence[MotionCourse],
    offsets: Mapping[str, float],
    size: tuple[int, int],
    colour: Colour | None = None,
    speed_top_mps: float = 1.0,
    quantities: Sequence[Quantity] = FILMED,
) -> FilmGraphs:
    """The motion over the film's time, drawn up to the present, at which a cursor stands.

    Parameters
    ----------
    colour : of the lines; None colours them by speed, up to `speed_top_mps`.
    """
    room, text = _room(size), text_height(size)
    quantities = shown_quantities(courses, quantities)
    ends = [part - offsets[c.trajectory] for c in courses for part in (c.time_s[:1], c.time_s[-1:])]
    moments = np.concatenate([np.zeros(1), *ends])
    limits = float(moments.min()), float(max(moments.max(), moments.min() + 1e-3))
    x = Axis(limits, label="Time [s]")
    ys = [quantity_axis(courses, quantity) for quantity in quantities]
    frames = stacked(room.shrunk(text / 2), x, ys, text, lambda words: LETTER * text * len(words))
    made = []
    for quantity, axes in zip(quantities, frames, strict=True):
        pieces = [_line(axes, course, quantity, offsets, colour, speed_top_mps) for course in courses]
        ends, since, colours = (np.concatenate(part) for part in zip(*pieces, strict=True))
        strokes = Strokes(ends, since, colours, text / 9)
        made.append(FilmGraph(axes, quantity.label, axes is frames[-1], (strokes,)))
    return FilmGraphs(room, text, tuple(made), limits if made else None)


def text_height(size: tuple[int, int]) -> float:
    """Of the text of graphs in a picture [px]: legible in a small one, not large in a large one."""
    return max(11.0, 0.0235 * size[1] * min(1.0, (720 / size[1]) ** 0.25))


def _room(size: tuple[int, int]) -> Rectangle:
    width, height = size
    wide = WIDTH * width
    return Rectangle(
        width - EDGE * height - wide, FOOT * height, wide, (1 - HEAD - FOOT) * height
    )  # fmt: skip


def _whole(limits: Sequence[Limits]) -> Limits:
    """That hold all of these."""
    return min(low for low, _ in limits), max(high for _, high in limits)


def _axis(name: str, limits: Limits, log: bool) -> Axis:
    variable = find_variable(name)
    return Axis(limits, log, variable.label, f"{variable.symbol or variable.title} [{variable.unit or '–'}]")


def _impact_graph(axes: Frame, graphs: Sequence[Graph], since: Array, text: float) -> FilmGraph:
    strokes, dots = [], []
    radius = 0.2 * text
    first = graphs[0]
    for graph in graphs:
        if not graph.model:
            continue
        colour = find_model(graph.model).colour
        linked = graph.linked & graph.inside(graph.measured) & graph.inside(graph.modelled)
        ends = np.stack([axes.to_pixels(points[linked]) for points in (graph.measured, graph.modelled)], axis=1)
        strokes.append(_strokes(ends, since[graph.row[linked]], LINK, text / 16))
        dots.append(_dots(axes, graph, graph.modelled, since, colour, radius, corners=4))
    dots.append(_dots(axes, first, first.measured, since, MEASURED_COLOUR, radius))
    curve = first.measured_curve
    if curve is not None and curve.x.size > 1 and dots[-1].since_s.size:
        line = axes.to_pixels(np.column_stack([curve.x, curve.y]))
        ends = np.stack([line[:-1], line[1:]], axis=1)
        strokes.append(_strokes(ends, np.full(len(ends), dots[-1].since_s.max()), MEASURED_COLOUR, text / 10))
    return FilmGraph(axes, "", True, tuple(strokes), tuple(dots))


def _dots(
    axes: Frame, graph: Graph, points: Array, since: Array, colour: Colour, radius: float, corners: int = 12
) -> Dots:
    seen = graph.inside(points)
    larger = 1.2 if corners == 4 else 1.0
    return Dots(axes.to_pixels(points[seen]), since[graph.row[seen]], colour, larger * radius, corners)


def _strokes(ends: Array, since: Array, colour: Colour, width_px: float) -> Strokes:
    return Strokes(ends, since, np.tile(colour, (len(ends), 1)), width_px)


def _line(
    axes: Frame,
    course: MotionCourse,
    quantity: Quantity,
    offsets: Mapping[str, float],
    colour: Colour | None,
    speed_top_mps: float,
) -> tuple[Array, Array, Array]:
    """Ends (k, 2, 2) of the pieces of a line, when they appear (k,), and their colours (k, 3)."""
    time_s, values = course.series(quantity)
    time_s = time_s - offsets[course.trajectory]
    places = axes.to_pixels(np.column_stack([time_s, values]))
    kept = worth_drawing(course, places[:, 0])
    ends = np.stack([places[kept[:-1]], places[kept[1:]]], axis=1)
    there = np.isfinite(ends).all(axis=(1, 2))
    later = kept[1:][there]
    if colour is None:
        colours = scale_colours(course.values[SPEED.name][later], 0.0, speed_top_mps, SPEED_SCALE)
    else:
        colours = np.tile(colour, (later.size, 1))
    return ends[there], time_s[later], colours
