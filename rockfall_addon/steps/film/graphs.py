# SPDX-License-Identifier: GPL-3.0-or-later
"""Graphs in the picture as geometry: points and lines appear at their moments, and a cursor goes along with the time.

Each kind of thing lies on a layer of its own before the camera; sizes and places are shares of the picture's height.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import pi

import bpy
import numpy as np

from ....core.analysis.columns import passing
from ....core.analysis.comparison import compare
from ....core.analysis.graph_layout import GAP, Frame, Rectangle, shown_label
from ....core.analysis.motion_graphs import motion_courses
from ....core.colours import MEASURED_COLOUR, srgb_to_linear
from ....core.errors import InputError
from ....core.film import graphs as film_graphs
from ....core.film.graphs import FilmGraphs
from ....core.film.job import GraphKind
from ....core.vectors import Array
from ...scene.footage import timing
from ...scene.models import graph_settings, models
from ...scene.picks import keyframes, reconstruction
from ...scene.storage import materials
from . import captions
from .marks import until_now_group

PANEL, PLOT, GRID, AXIS, CURSOR = (
    (0.035, 0.04, 0.048),
    (0.055, 0.063, 0.075),
    (0.13, 0.145, 0.165),
    (0.42, 0.46, 0.50),
    (0.98, 0.80, 0.25),
)
LAYER = 0.001
"""Between two layers, in parts of the picture's height."""
WEIGHT = 0.55
"""Of letters, which stand on a plain ground here."""


@dataclass
class Shape:
    """Corners and faces of one layer as they are gathered: areas, each with a colour and the moment it appears at."""

    corners: list[Array]
    faces: list[list[int]]
    colours: list[Array]
    times: list[Array]
    count: int = 0

    def add(self, corners: Array, colours: Array, since: Array) -> None:
        """k areas of c corners, (k, c, 2), with colours (k, 3) and moments (k,)."""
        k, c = corners.shape[:2]
        if not k:
            return
        self.corners.append(corners.reshape(-1, 2))
        self.colours.append(np.repeat(colours, c, axis=0))
        self.times.append(np.repeat(since, c))
        self.faces += (self.count + np.arange(k * c).reshape(k, c)).tolist()
        self.count += k * c


def graphs_of(
    scene: bpy.types.Scene, kind: GraphKind, size: tuple[int, int], speed_top_mps: float | None
) -> FilmGraphs:
    """What the graphs of a scene's film show.

    Parameters
    ----------
    speed_top_mps : at the end of the film's scale of speeds; None when it has none, as the blocks have other colours.

    Raises
    ------
    RockfallError : there is nothing to show in them.
    """
    result, _ = reconstruction.reconstruct_good(scene)  # panel 4 says what is missing
    offsets = timing.shown_offsets(scene, result.picks)
    shown = models.shown_models(scene)
    if kind == "motion":
        courses = motion_courses(result, reconstruction.ground(scene), quantities=film_graphs.FILMED)
        colour = None if speed_top_mps is not None else MEASURED_COLOUR
        made = film_graphs.motion_graphs(courses, offsets, size, colour, speed_top_mps or 1.0)
        if not made.graphs:
            raise InputError("No trajectory has a flight to show over time", advice="Make the film without graphs")
        return made
    if not len(result.impacts):
        raise InputError("There is no impact to show in graphs", advice="Make the film without graphs")
    row = np.flatnonzero(passing(result.impacts, graph_settings.filters_of(scene)))
    if not row.size:
        raise InputError(
            f"The filters of the graphs hide all {len(result.impacts)} impacts",
            advice="Clear them in Rockfall Graphs, or make the film without graphs",
        )
    own = {name: values for name, values in models.parameters_of(scene).items() if name in shown}
    predictions = compare(result.impacts, shown, own, spin=scene.rockfall_comparison.spin) if shown else None
    specs = [graph_settings.spec_of(graph_settings.graph(scene, n), n) for n in graph_settings.shown(scene)]
    return film_graphs.impact_graphs(result.impacts, offsets, size, predictions, specs, row)


def lay_out(graphs: FilmGraphs, size: tuple[int, int], rate: float) -> list[bpy.types.Object]:
    """The objects of the graphs, around the centre of the picture.

    Parameters
    ----------
    size : width and height of the picture [px].
    rate : frames for a second of the film's time.
    """
    place = _Place(size)
    ground = _areas(place, [(graphs.room, PANEL)])
    plots = _areas(place, [(graph.frame.plot, PLOT) for graph in graphs.graphs])
    objects = [
        _object("Film graphs panel", ground, 6),
        _object("Film graphs plots", plots, 5),
        _object("Film graphs grid", _grid(place, graphs), 4.5),
    ]
    for name, drawn in (("lines", _strokes(place, graphs)), ("points", _dots(place, graphs))):
        if drawn.count:
            obj = _object(f"Film graphs {name}", drawn, 3.5 if name == "lines" else 2.5, with_times=True)
            obj.modifiers.new("Up to now", "NODES").node_group = until_now_group()
            objects.append(obj)
    if graphs.cursor_s is not None:
        objects.append(_cursor(place, graphs, rate))
    return objects + _words(place, graphs)


@dataclass(frozen=True)
class _Place:
    """From pixels of the picture to shares of its height about its centre."""

    size: tuple[int, int]

    def __call__(self, pixels: Array) -> Array:
        return (np.asarray(pixels) - np.array(self.size) / 2) / self.size[1]


def _areas(place: _Place, parts: Sequence[tuple[Rectangle, tuple[float, float, float]]]) -> Shape:
    shape = Shape([], [], [], [])
    for area, colour in parts:
        corners = np.array(
            [
                (area.left, area.bottom),
                (area.right, area.bottom),
                (area.right, area.top),
                (area.left, area.top),
            ]
        )
        shape.add(place(corners)[None], np.array([colour]), np.zeros(1))
    return shape


def _grid(place: _Place, graphs: FilmGraphs) -> Shape:
    shape, thin = Shape([], [], [], []), max(graphs.text_px / 16, 0.8)
    for graph in graphs.graphs:
        axes, plot = graph.frame, graph.frame.plot
        xs, ys = _ticks(axes)
        upright = [((x, plot.bottom), (x, plot.top)) for x in xs]
        level = [((plot.left, y), (plot.right, y)) for y in ys]
        edges = [
            ((plot.left, plot.bottom), (plot.left, plot.top)),
            ((plot.left, plot.bottom), (plot.right, plot.bottom)),
        ]
        for ends, colour, width in ((upright + level, GRID, thin), (edges, AXIS, 1.3 * thin)):
            _add_strokes(shape, place, np.array(ends).reshape(-1, 2, 2), np.zeros(len(ends)), colour, width)
    return shape


def _strokes(place: _Place, graphs: FilmGraphs) -> Shape:
    shape = Shape([], [], [], [])
    for graph in graphs.graphs:
        for one in graph.strokes:
            _add_strokes(shape, place, one.ends, one.since_s, one.colour, one.width_px)
    return shape


def _add_strokes(
    shape: Shape, place: _Place, ends: Array, since: Array, colour: Array | Sequence[float], width_px: float
) -> None:
    along = ends[:, 1] - ends[:, 0]
    length = np.maximum(np.linalg.norm(along, axis=1, keepdims=True), 1e-9)
    forward = along / length * width_px / 2  # a little longer, so that a bent line has no notches
    aside = np.stack([-forward[:, 1], forward[:, 0]], axis=1)
    start, end = ends[:, 0] - 0.6 * forward, ends[:, 1] + 0.6 * forward
    corners = np.stack([start - aside, end - aside, end + aside, start + aside], axis=1)
    shape.add(place(corners), np.broadcast_to(np.asarray(colour, dtype=np.float64), (len(ends), 3)), since)


def _dots(place: _Place, graphs: FilmGraphs) -> Shape:
    shape = Shape([], [], [], [])
    for graph in graphs.graphs:
        for one in graph.dots:
            angle = 2 * pi * np.arange(one.corners) / one.corners
            ring = one.radius_px * np.column_stack([np.cos(angle), np.sin(angle)])
            corners = one.place[:, None] + ring[None]
            shape.add(place(corners), np.tile(one.colour, (len(one.place), 1)), one.since_s)
    return shape


def _cursor(place: _Place, graphs: FilmGraphs, rate: float) -> bpy.types.Object:
    """A line across all graphs that goes from the start to the end of the time axis."""
    plots = [graph.frame.plot for graph in graphs.graphs]
    wide = max(graphs.text_px / 9, 1.0)
    low, high = min(plot.bottom for plot in plots), max(plot.top for plot in plots)
    shape = _areas(place, [(Rectangle(place.size[0] / 2 - wide / 2, low, wide, high - low), CURSOR)])
    obj = _object("Film graphs cursor", shape, 3)
    ends = place(np.array([(plots[0].left, 0.0), (plots[0].right, 0.0)]))[:, 0]
    for time_s, x in zip(graphs.cursor_s or (), ends.tolist(), strict=True):
        obj.location.x = x
        obj.keyframe_insert("location", index=0, frame=time_s * rate)
    for curve in keyframes.location_curves(obj):
        for point in curve.keyframe_points:
            point.interpolation = "LINEAR"
    return obj


def _words(place: _Place, graphs: FilmGraphs) -> list[bpy.types.Object]:
    text, gap = graphs.text_px, GAP * graphs.text_px
    objects: list[bpy.types.Object] = []

    def write(
        words: str, x: float, y: float, align: str, colour: tuple[float, float, float], upright: bool = False
    ) -> None:
        share = text / place.size[1]
        spot = place(np.array([x, y]))
        obj = captions.caption(
            f"Film graphs text {len(objects)}", words, (float(spot[0]), float(spot[1])), share, align=align,
            colour=colour, weight=WEIGHT,
        )  # fmt: skip
        obj.rotation_euler.z = pi / 2 if upright else 0.0
        objects.append(obj)

    if graphs.note:
        write(graphs.note, graphs.room.right, graphs.room.top + 0.6 * text, "RIGHT", captions.BRIGHT_GREY)
    for graph in graphs.graphs:
        axes, plot = graph.frame, graph.frame.plot
        xs, ys = _ticks(axes)
        for y, words in zip(ys, axes.y_ticks.texts, strict=True):
            write(words, plot.left - gap, y - 0.36 * text, "RIGHT", captions.BRIGHT_GREY)
        if graph.title:
            write(graph.title, plot.left, plot.top + 0.45 * text, "LEFT", captions.WHITE)
        else:
            label = shown_label(axes.y, plot.height, lambda words: film_graphs.LETTER * text * len(words))
            write(
                label, axes.tile.left + gap + 0.9 * text, plot.bottom + plot.height / 2, "CENTER", captions.WHITE, True
            )
        if graph.shows_x:
            for x, words in zip(xs, axes.x_ticks.texts, strict=True):
                write(words, x, plot.bottom - gap - 0.75 * text, "CENTER", captions.BRIGHT_GREY)
            label = shown_label(axes.x, plot.width, lambda words: film_graphs.LETTER * text * len(words))
            write(label, plot.left + plot.width / 2, plot.bottom - 2 * gap - 1.8 * text, "CENTER", captions.WHITE)
    return objects


def _ticks(axes: Frame) -> tuple[list[float], list[float]]:
    """Where the numbers of the two axes stand [px]."""
    plot = axes.plot
    xs = plot.left + axes.x.places(np.array(axes.x_ticks.values)) * plot.width
    ys = plot.bottom + axes.y.places(np.array(axes.y_ticks.values)) * plot.height
    return xs.tolist(), ys.tolist()


def _object(name: str, shape: Shape, layer: float, with_times: bool = False) -> bpy.types.Object:
    mesh = bpy.data.meshes.new(name)
    flat = np.vstack(shape.corners)
    mesh.from_pydata(np.column_stack([flat, np.zeros(len(flat))]).tolist(), [], shape.faces)
    colours = srgb_to_linear(np.vstack(shape.colours))
    captions.mark_colour(mesh, np.column_stack([colours, np.ones(len(colours))]))
    if with_times:
        attribute = mesh.attributes.new(materials.TIME_ATTRIBUTE, "FLOAT", "POINT")
        attribute.data.foreach_set("value", np.concatenate(shape.times).astype(np.float32))
    mesh.materials.append(materials.emission_material("Rockfall caption", captions.COLOUR_ATTRIBUTE))
    obj = bpy.data.objects.new(name, mesh)
    obj.location.z = -layer * LAYER
    return obj
