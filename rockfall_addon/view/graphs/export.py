# SPDX-License-Identifier: GPL-3.0-or-later
"""Graphs as files: a picture of what an editor draws, as SVG or PNG in its own size; the numbers as CSV."""

from pathlib import Path

import bpy
import gpu
import numpy as np
from mathutils import Matrix

from ....core.analysis.graph_layout import Rectangle
from ....core.analysis.motion_graphs import FrameScale, delayed
from ....core.analysis.svg import Svg
from ....core.errors import InputError, RockfallError
from ....core.exchange.graph_tables import GraphPoints, write_graph_points
from ....core.exchange.motion_tables import write_motion
from ....core.opencv import write_picture
from ....core.output import write_text
from ...scene.footage import clocks, timing, videos
from ...scene.models import comparison, graph_settings
from . import drawing, editor, impact_sheet, motion_sheet
from .editor import Canvas
from .look import Look, dressed, look

FORMATS = ("svg", "png", "csv")
PAPER = (1.0, 1.0, 1.0)
TEXT = 12.0
"""Height of the text at a scale of 1 [px]."""


def write(
    context: bpy.types.Context, tree: str, path: Path, size: tuple[int, int], scale: float, *, dark: bool
) -> None:
    """Write the graphs of a type of editor; the ending of the file says the format.

    Parameters
    ----------
    size : width and height of the picture at a scale of 1 [px].
    scale : of a PNG: 2 has twice as many pixels each way, with text and lines twice as large.
    dark : in the colours of the screen instead of black on white.

    Raises
    ------
    RockfallError : there is nothing to show, an unknown ending, no graphics card for a PNG.
    """
    kind = path.suffix.lower().removeprefix(".")
    if kind not in FORMATS:
        raise InputError(f"Graphs are written as {', '.join(FORMATS)}, not as {path.suffix or 'a file without ending'}")
    if kind == "csv":
        _write_table(context, tree, path)
    elif kind == "svg":
        width, height = size
        svg = Svg(width, height)
        with drawing.onto(svg):
            _draw(context, tree, (width, height), _look(context, 1.0, dark))
        write_text(path, svg.document())
    else:
        _write_png(context, tree, path, (round(size[0] * scale), round(size[1] * scale)), _look(context, scale, dark))


def _look(context: bpy.types.Context, scale: float, dark: bool) -> Look:
    return dressed(scale, TEXT * scale, look(context).back if dark else PAPER)


def _draw(context: bpy.types.Context, tree: str, size: tuple[int, int], seen: Look) -> None:
    room = Rectangle(0.0, 0.0, float(size[0]), float(size[1]))
    canvas = Canvas(room, seen, printed=True)
    drawing.fill(room, seen.back)
    editor.find_content(tree).draw(context, canvas)
    if not canvas.frames:
        raise InputError("There is nothing in the graphs to write", advice="Pick impacts, or clear the filters, first")


def _write_png(context: bpy.types.Context, tree: str, path: Path, size: tuple[int, int], seen: Look) -> None:
    width, height = size
    try:
        sheet = gpu.types.GPUOffScreen(width, height)
    except SystemError as error:
        raise RockfallError("A PNG of the graphs needs a graphics card; write an SVG instead.") from error
    try:
        with sheet.bind(), gpu.matrix.push_pop(), gpu.matrix.push_pop_projection():
            gpu.state.active_framebuffer_get().clear(color=(*seen.back, 1.0))
            gpu.matrix.load_matrix(Matrix.Identity(4))
            gpu.matrix.load_projection_matrix(
                Matrix(((2 / width, 0, 0, -1), (0, 2 / height, 0, -1), (0, 0, -1, 0), (0, 0, 0, 1)))
            )
            _draw(context, tree, size, seen)
            gpu.state.blend_set("NONE")
            pixels = gpu.state.active_framebuffer_get().read_color(0, 0, width, height, 4, 0, "UBYTE")
    finally:
        sheet.free()
    pixels.dimensions = width * height * 4
    picture = np.array(pixels, dtype=np.uint8).reshape(height, width, 4)[::-1, :, 2::-1]
    write_picture(path, np.ascontiguousarray(picture))


def _write_table(context: bpy.types.Context, tree: str, path: Path) -> None:
    if tree == editor.MOTION:
        _write_motion(context, path)
    else:
        _write_points(context, path)


def _write_motion(context: bpy.types.Context, path: Path) -> None:
    """The trajectories that are shown, on the common clock, as `rockfall motion` writes them."""
    scene, offsets = context.scene, timing.kept_offsets(context.scene)
    courses = motion_sheet.shown_courses(context)
    if not any(course.time_s.size for course in courses):
        raise InputError("There is no motion to write", advice="Pick two impacts of a block first")
    camera = videos.active_camera(scene)
    scale = None
    if camera is not None and videos.times_of(camera).size > 1:
        times = videos.times_of(camera)
        scale = FrameScale(camera.name, clocks.clock_of(camera), times, np.arange(times.size, dtype=np.float64))
    write_motion([delayed(one, offsets.get(one.trajectory, 0.0)) for one in courses], path, scale)


def _write_points(context: bpy.types.Context, path: Path) -> None:
    """Each point of each graph, those beyond its axes, too."""
    scene = context.scene
    compared, seen = comparison.comparison_of(scene), _look(context, 1.0, dark=False)
    tables = {0: compared.impacts} | {i + 1: other.impacts for i, other in enumerate(compared.others)}
    found = []
    for number in graph_settings.shown(scene):
        graph = impact_sheet.graph_of(scene, number, compared, seen)
        for one in graph.drawn:
            series, impacts = one.series, tables[one.series.source]
            if impacts is None:
                continue
            found.append(
                GraphPoints(
                    number + 1,
                    series.title,
                    impacts.site[series.row],
                    impacts.trajectory[series.row],
                    impacts.impact[series.row],
                    graph.spec.x,
                    graph.spec.y,
                    series.points,
                )
            )
    if not any(len(one.points) for one in found):
        raise InputError("There is no impact to write", advice="Pick impacts, or clear the filters, first")
    write_graph_points(found, path)
