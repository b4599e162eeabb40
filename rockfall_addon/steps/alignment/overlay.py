# SPDX-License-Identifier: GPL-3.0-or-later
"""The pairs over the views: marks, where the camera sees their points, what is left between, and what comes next."""

import itertools
import math
from collections.abc import Sequence

import blf
import bpy
import gpu
import numpy as np
from bpy_extras.view3d_utils import location_3d_to_region_2d
from gpu_extras.batch import batch_for_shader
from mathutils import Vector

from ....core.errors import visible
from ...scene import problems
from ...scene.footage import alignment, camera_paths, clocks, pairs, video_files, videos
from ...scene.next_step import ALIGN_TOOL
from ...scene.storage import store
from ...view import image_view
from ...view.wrapping import wrapped
from . import marking

RING, CROSS, TEXT, HINT, GAP = 8.0, 6.0, 14.0, 14.0, 12.0  # in pixels at interface scale 1
SEGMENTS, OUTLINE = 32, 6
SHADE = (0.0, 0.0, 0.0, 0.65)
BOX = (0.05, 0.06, 0.08, 0.85)
WRONG = (1.0, 0.55, 0.0)

type Colour = tuple[float, float, float, float]
type Line = Sequence[tuple[float, float]]

_handles: list[object] = []
_textures: dict[tuple[str, int], gpu.types.GPUTexture] = {}  # the picture of the wipe


def register() -> None:
    if not bpy.app.background:
        _handles.append(bpy.types.SpaceView3D.draw_handler_add(_draw, (), "WINDOW", "POST_PIXEL"))


def unregister() -> None:
    while _handles:
        bpy.types.SpaceView3D.draw_handler_remove(_handles.pop(), "WINDOW")
    _textures.clear()


@problems.guarded
def _draw() -> None:
    context = bpy.context
    scene, region, view = context.scene, context.region, context.region_data
    camera = videos.active_camera(scene)
    if camera is None or view is None:
        return
    settings = camera.rockfall_alignment
    rectangle = image_view.image_rectangle(region, view, scene, camera)
    gpu.state.blend_set("ALPHA")
    if rectangle is not None and settings.use_wipe:
        _draw_wipe(context, camera, rectangle)
    aligning = _aligning(context)
    if settings.show_pairs and context.space_data.overlay.show_overlays and (aligning or not _other_tool(context)):
        if rectangle is not None:
            _draw_in_picture(context, camera, rectangle)
        elif view.view_perspective != "CAMERA":
            _draw_on_terrain(context, camera)
    if aligning and context.space_data.overlay.show_overlays:
        _draw_hint(context, camera, rectangle is not None)
    gpu.state.blend_set("NONE")


def _aligning(context: bpy.types.Context) -> bool:
    return _tool(context) == ALIGN_TOOL


def _other_tool(context: bpy.types.Context) -> bool:
    """Another tool of ours, which draws for itself."""
    return _tool(context).startswith("rockfall.")


def _tool(context: bpy.types.Context) -> str:
    tool = context.workspace.tools.from_space_view3d_mode(context.mode, create=False)
    return tool.idname if tool is not None else ""


def _draw_in_picture(context: bpy.types.Context, camera: bpy.types.Object, rectangle: image_view.Rectangle) -> None:
    """Marks (rings), where the camera sees their points (crosses), and the residuals between them."""
    scene, settings = context.scene, camera.rockfall_alignment
    scale, size = context.preferences.system.ui_scale, videos.size_of(camera)
    frame, marked = clocks.true_frame(scene, camera), pairs.pairs_of(camera)
    solution, chosen = alignment.solution_of(camera), pairs.active_pair(camera)
    moves, solved = alignment.moves(camera), camera_paths.is_solved(camera)
    seen = marking.reprojections(camera, marked, frame if moves else None) if solved and marked else None
    for number, pair in enumerate(marked):
        here = pair.pixel is not None and (not moves or pair.frame == frame)
        colour = _colour(pair, solution)
        cross = None
        if seen is not None and np.isfinite(seen[number]).all() and pair.proposed != pairs.PIXEL:
            cross = _inside(image_view.to_region(rectangle, size, seen[number]), rectangle)
        if not here:
            if cross is not None and pair.is_complete:
                _cross(cross, CROSS * scale, (*colour[:3], 0.7), scale)
            continue
        place = _spot(image_view.to_region(rectangle, size, pair.pixel))
        if cross is not None:
            if settings.magnify:
                cross = tuple(place[i] + 10 * (cross[i] - place[i]) for i in range(2))
            _lines([[place, cross]], colour, 1.5 * scale)
            _cross(cross, CROSS * scale, colour, scale)
        _mark(place, pair, colour, scale, dashed=pair.proposed == pairs.PIXEL, chosen=chosen == pair)


def _draw_on_terrain(context: bpy.types.Context, camera: bpy.types.Object) -> None:
    scale = context.preferences.system.ui_scale
    solution, chosen = alignment.solution_of(camera), pairs.active_pair(camera)
    drawn: set[tuple[float, float, float]] = set()
    for pair in pairs.pairs_of(camera):
        if pair.point is None or pair.point in drawn:
            continue
        drawn.add(pair.point)
        place = location_3d_to_region_2d(context.region, context.region_data, Vector(pair.point))
        if place is not None:
            colour = _colour(pair, solution)
            _mark(_spot(place), pair, colour, scale, dashed=pair.proposed == pairs.POINT, chosen=chosen == pair)


def _mark(place: tuple[float, float], pair: pairs.Pair, colour: Colour, scale: float, *, dashed: bool, chosen: bool):
    radius = RING * scale
    if chosen:
        _lines(_ring(place, radius + 4 * scale), (1.0, 1.0, 1.0, 0.9), 1.5 * scale)
    _lines(_ring(place, radius, dashed=dashed), colour, 2.0 * scale)
    _lines([[(place[0] - 1.2 * scale, place[1]), (place[0] + 1.2 * scale, place[1])]], colour, 2.4 * scale)
    _text(place[0] + GAP * scale, place[1] + 0.5 * GAP * scale, pair.name, colour, TEXT * scale)


def _colour(pair: pairs.Pair, solution: alignment.Solution) -> Colour:
    if pair.id in solution.wrong:
        return (*WRONG, 1.0)
    return (*palette(pair.colour), 1.0 if pair.counts else 0.4)


def palette(number: int) -> tuple[float, float, float]:
    """The colour of a pair, as the theme's collections have them, which the panel shows as icons."""
    colours = bpy.context.preferences.themes[0].collection_color
    red, green, blue = colours[pairs.FIRST_COLOUR + number % pairs.COLOURS].color
    return tuple(0.7 * value + 0.3 for value in (red, green, blue))  # lighter, to be read on any picture


def _draw_hint(context: bpy.types.Context, camera: bpy.types.Object, through: bool) -> None:
    """What to do next; the view that waits for a click has a frame in the pair's colour."""
    scene, region = context.scene, context.region
    said, pair = alignment.hint(scene, camera), pairs.open_pair(camera)
    if pair is None and alignment.placement(camera) == alignment.BY_PAIRS:
        return  # the panel and the header say what could be better
    scale = context.preferences.system.ui_scale
    colour = (1.0, 1.0, 1.0, 1.0)
    here = True
    if pair is not None:
        here = (pair.missing == pairs.PIXEL) == through
        colour = (*palette(pair.colour), 1.0)
        if here:
            low, high = 2 * scale, (region.width - 2 * scale, region.height - 2 * scale)
            _lines([[(low, low), (high[0], low), high, (low, high[1]), (low, low)]], colour, 3 * scale)
    elif not pairs.pairs_of(camera):
        here = through or not _sees(context, camera)
    if not said or not here:
        return
    _paragraph(context, said, colour, HINT * scale, scale)


def _paragraph(context: bpy.types.Context, said: str, colour: Colour, size: float, scale: float) -> None:
    """Text in a box at the top, between what lies over the view."""
    left, right = _free_span(context.area, context.region)
    lines = wrapped(said, max(right - left - 40 * scale, 80 * scale), size)
    widths = [blf.dimensions(0, line)[0] for line in lines]
    step, middle = 1.45 * size, (left + right) / 2
    top = context.region.height - _covered_top(context.area) - 10 * scale
    height = len(lines) * step + 10 * scale
    _box(middle - max(widths) / 2 - 10 * scale, top - height, max(widths) + 20 * scale, height, BOX)
    for number, (line, width) in enumerate(zip(lines, widths, strict=True)):
        _text(middle - width / 2, top - (number + 1) * step, line, colour, size)


def _free_span(area: bpy.types.Area, region: bpy.types.Region) -> tuple[float, float]:
    """Left and right end of what the toolbar and the sidebar leave free of a view."""
    left, right = 0.0, float(region.width)
    for other in area.regions:
        if other.type in ("TOOLS", "UI") and other.width > 1:
            if other.x <= region.x + 1:
                left = max(left, float(other.x - region.x + other.width))
            else:
                right = min(right, float(other.x - region.x))
    return (left, right) if right > left else (0.0, float(region.width))


def _sees(context: bpy.types.Context, camera: bpy.types.Object) -> bool:
    """Whether a view of the window looks through the camera."""
    views = (area.spaces.active.region_3d for area in context.screen.areas if area.type == "VIEW_3D")
    return context.scene.camera == camera and any(view.view_perspective == "CAMERA" for view in views)


def _covered_top(area: bpy.types.Area) -> float:
    """Height of the headers, which lie over the view."""
    return sum(float(r.height) for r in area.regions if r.type in ("HEADER", "TOOL_HEADER") and r.height > 1)


def _draw_wipe(context: bpy.types.Context, camera: bpy.types.Object, rectangle: image_view.Rectangle) -> None:
    """The footage, drawn by us, to the left of the line."""
    share, scale = camera.rockfall_alignment.wipe, context.preferences.system.ui_scale
    frame = clocks.true_frame(context.scene, camera)
    key = (camera[store.ID], frame)
    if key not in _textures:
        _textures.clear()
        picture = video_files.picture(camera, frame)[::-1].astype(np.float32) / 255.0
        height, width = picture.shape[:2]
        full = np.ones((height, width, 4), dtype=np.float32)
        full[:, :, :3] = picture
        buffer = gpu.types.Buffer("FLOAT", full.size, full.ravel())
        _textures[key] = gpu.types.GPUTexture((width, height), format="RGBA8", data=buffer)
    left, low = rectangle.left, rectangle.bottom
    right, high = left + share * rectangle.width, low + rectangle.height
    shader = gpu.shader.from_builtin("IMAGE")
    batch = batch_for_shader(
        shader,
        "TRI_STRIP",
        {
            "pos": [(left, low), (right, low), (left, high), (right, high)],
            "texCoord": [(0, 0), (share, 0), (0, 1), (share, 1)],
        },
    )
    shader.bind()
    shader.uniform_sampler("image", _textures[key])
    batch.draw(shader)
    _lines([[(right, low), (right, high)]], (1.0, 1.0, 1.0, 0.9), 1.5 * scale)


def _spot(place: Sequence[float]) -> tuple[float, float]:
    return float(place[0]), float(place[1])


def _inside(place: Sequence[float], rectangle: image_view.Rectangle) -> tuple[float, float] | None:
    """The place, unless it is outside of the picture."""
    x, y = _spot(place)
    inside = 0 <= x - rectangle.left <= rectangle.width and 0 <= y - rectangle.bottom <= rectangle.height
    return (x, y) if inside else None


def _ring(place: tuple[float, float], radius: float, *, dashed: bool = False) -> list[Line]:
    angles = [2 * math.pi * i / SEGMENTS for i in range(SEGMENTS + 1)]
    points = [(place[0] + radius * math.cos(a), place[1] + radius * math.sin(a)) for a in angles]
    return [points[i : i + 3] for i in range(0, SEGMENTS, 4)] if dashed else [points]


def _cross(place: tuple[float, float], reach: float, colour: Colour, scale: float) -> None:
    x, y = place
    _lines([[(x - reach, y), (x + reach, y)], [(x, y - reach), (x, y + reach)]], colour, 1.5 * scale)


def _lines(lines: Sequence[Line], colour: Colour, width: float) -> None:
    """Lines with a dark edge, so that they are seen on any picture."""
    pieces = [point for line in lines for pair in itertools.pairwise(line) for point in pair]
    shader = gpu.shader.from_builtin("POLYLINE_UNIFORM_COLOR")
    batch = batch_for_shader(shader, "LINES", {"pos": [(x, y, 0.0) for x, y in pieces]})
    shader.bind()
    shader.uniform_float("viewportSize", gpu.state.viewport_get()[2:])
    for tint, wide in (((*SHADE[:3], SHADE[3] * colour[3]), width + 2.0), (colour, width)):
        shader.uniform_float("lineWidth", wide)
        shader.uniform_float("color", tint)
        batch.draw(shader)


def _box(x: float, y: float, width: float, height: float, colour: Colour) -> None:
    shader = gpu.shader.from_builtin("UNIFORM_COLOR")
    corners = [(x, y), (x + width, y), (x, y + height), (x + width, y + height)]
    shader.bind()
    shader.uniform_float("color", colour)
    batch_for_shader(shader, "TRI_STRIP", {"pos": corners}).draw(shader)


def _text(x: float, y: float, text: str, colour: Colour, size: float) -> None:
    blf.size(0, size)
    blf.enable(0, blf.SHADOW)
    blf.shadow(0, OUTLINE, 0.0, 0.0, 0.0, 0.9)
    blf.color(0, *colour)
    blf.position(0, x, y, 0)
    blf.draw(0, visible(text))
    blf.disable(0, blf.SHADOW)
