# SPDX-License-Identifier: GPL-3.0-or-later
"""Editors of graphs: types of Blender's node editor without nodes, which draw over it and have a header of their own.

What an editor shows is a `Content`, one for each type; `add` makes it known. Here are its drawing, and what the mouse
needs to know: which graph lies where, and what is under the mouse.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import bpy
import gpu
import numpy as np

from ....core.analysis.axes import Limits
from ....core.analysis.graph_layout import Frame, Rectangle
from ...scene import problems
from . import drawing
from .look import Look, alpha, look


@dataclass(frozen=True)
class Button:
    """A drawn button that calls an operator."""

    area: Rectangle
    operator: str


@dataclass(eq=False)
class Canvas:
    """One drawn editor.

    Attributes
    ----------
    room : where graphs may be drawn: what the sidebar leaves free.
    look : colours and sizes.
    frames : graph → its axes, as they were drawn last.
    buttons : likewise.
    pointer : of the mouse [px of the region]; None when it is elsewhere.
    graph, part : what is under the mouse: number of a graph, −1 for none, and `Frame.part_at`.
    hit : what the content found under the mouse.
    band : outline of what is being selected [px], (k, 2).
    printed : it becomes a picture file: nothing of the moment is shown.
    """

    room: Rectangle
    look: Look
    frames: dict[int, Frame] = field(default_factory=dict)
    buttons: list[Button] = field(default_factory=list)
    pointer: tuple[float, float] | None = None
    graph: int = -1
    part: str = ""
    hit: Any = None
    band: np.ndarray | None = None
    printed: bool = False


@dataclass(frozen=True)
class Content:
    """What a type of editor shows and does.

    Attributes
    ----------
    tree : identifier of the type.
    name : short, for the switch between the types.
    draw : draws into a canvas and fills in its frames and buttons.
    header : the layout of the header's own part.
    point : (context, canvas) → what is under the mouse in `canvas.graph`, None for nothing; kept in `canvas.hit`.
    set_limits : (scene, graph, x, y) gives axes limits; None leaves those that an axis has.
    reset : (scene, graph) gives both axes their usual limits.
    """

    tree: str
    name: str
    draw: Callable[[bpy.types.Context, Canvas], None]
    header: Callable[[bpy.types.Context, bpy.types.UILayout], None]
    point: Callable[[bpy.types.Context, Canvas], Any]
    set_limits: Callable[[bpy.types.Scene, int, Limits | None, Limits | None], None]
    reset: Callable[[bpy.types.Scene, int], None]


IMPACTS = "RockfallImpactGraphs"
"""Type of the editor that shows graphs of impacts."""
MOTION = "RockfallMotionGraphs"
"""Type of the editor that shows motion over time."""

_contents: dict[str, Content] = {}
_canvases: dict[int, Canvas] = {}  # of the regions that were drawn, by their address
_handles: list[object] = []
_header: list[Callable[..., None]] = []


def add(content: Content) -> None:
    """Make a type of editor known; its node tree must be registered."""
    if not _contents:
        _begin()
    _contents[content.tree] = content


def remove(tree: str) -> None:
    """Forget a type of editor."""
    _contents.pop(tree, None)
    if not _contents:
        _end()


def find_content(tree: str) -> Content:
    """What a type of editor shows."""
    return _contents[tree]


def content_of(context: bpy.types.Context) -> Content | None:
    """What the editor of a context shows; None in other editors."""
    space = context.space_data
    if space is None or space.type != "NODE_EDITOR":
        return None
    return _contents.get(space.tree_type)


def shows(context: bpy.types.Context, tree: str = IMPACTS) -> bool:
    """Whether the editor of a context is of this type: for the poll of its panels and operators."""
    content = content_of(context)
    return content is not None and content.tree == tree


def canvas_of(context: bpy.types.Context) -> Canvas | None:
    """The drawn graphs of a context's region."""
    region = context.region
    return None if region is None or content_of(context) is None else _canvases.get(region.as_pointer())


def point(context: bpy.types.Context, canvas: Canvas, x: float, y: float) -> bool:
    """Find what is under the mouse; whether it is something else than before."""
    content = content_of(context)
    before = canvas.graph, canvas.part, canvas.hit
    canvas.pointer = (x, y)
    canvas.graph, canvas.part = -1, ""
    for number, frame in canvas.frames.items():
        part = frame.part_at(x, y)
        if part:
            canvas.graph, canvas.part = number, part
    canvas.hit = content.point(context, canvas) if content is not None and canvas.part == "plot" else None
    return (canvas.graph, canvas.part, canvas.hit) != before


def is_pointed() -> bool:
    """Whether something is under the mouse in one of the graphs."""
    return any(canvas.pointer is not None for canvas in _canvases.values())


def point_nowhere(region: bpy.types.Region) -> bool:
    """The mouse has left a region; whether it was in it."""
    canvas = _canvases.get(region.as_pointer())
    if canvas is None or canvas.pointer is None:
        return False
    canvas.pointer, canvas.graph, canvas.part, canvas.hit = None, -1, "", None
    return True


def draw_content(context: bpy.types.Context, content: Content, canvas: Canvas) -> None:
    """Draw a content over its background."""
    canvas.frames.clear()
    canvas.buttons.clear()
    content.draw(context, canvas)
    if canvas.band is not None and len(canvas.band) > 1:
        closed = np.vstack([canvas.band, canvas.band[:1]])
        drawing.lines(closed, alpha(canvas.look.chosen), canvas.look.line)
    gpu.state.blend_set("NONE")


def button(canvas: Canvas, left: float, bottom: float, words: str, operator: str) -> Rectangle:
    """Draw a button that calls an operator, and remember it."""
    seen = canvas.look
    area = Rectangle(left, bottom, seen.measure(words) + 2.4 * seen.text, 2.2 * seen.text)
    under = canvas.pointer is not None and area.holds(*canvas.pointer)
    drawing.fill(area, alpha(seen.ink, 0.25 if under else 0.12))
    drawing.outline(area, alpha(seen.faint, 0.6), seen.line)
    drawing.text(area.left + area.width / 2, area.bottom + area.height / 2, words, seen.text, seen.ink, (0.5, 0.5))
    canvas.buttons.append(Button(area, operator))
    return area


def button_at(canvas: Canvas) -> Button | None:
    """The drawn button under the mouse."""
    if canvas.pointer is None:
        return None
    return next((one for one in canvas.buttons if one.area.holds(*canvas.pointer)), None)


@problems.guarded
def _draw() -> None:
    context = bpy.context
    content, region = content_of(context), context.region
    if content is None or region is None:
        return
    key = region.as_pointer()
    seen = look(context)
    whole = Rectangle(0, 0, region.width, region.height)
    room = _free_part(context.area, region)
    canvas = _canvases.get(key)
    if canvas is None:
        _forget_closed()
        canvas = _canvases[key] = Canvas(room, seen)
    canvas.room, canvas.look = room, seen
    drawing.fill(whole, seen.back)
    draw_content(context, content, canvas)


def _forget_closed() -> None:
    """Regions that are no more."""
    alive = {
        region.as_pointer()
        for window in bpy.context.window_manager.windows
        for area in window.screen.areas
        for region in area.regions
    }
    for gone in _canvases.keys() - alive:
        del _canvases[gone]


def _free_part(area: bpy.types.Area, region: bpy.types.Region) -> Rectangle:
    """What sidebar, toolbar and headers leave free of a region that lies below them."""
    left, bottom, right, top = 0.0, 0.0, float(region.width), float(region.height)
    for other in area.regions:
        if other.type == "WINDOW" or other.width <= 1 or other.height <= 1:
            continue
        x, y = other.x - region.x, other.y - region.y
        if x >= region.width or y >= region.height or x + other.width <= 0 or y + other.height <= 0:
            continue  # beside it
        if other.type == "TOOLS":
            left = max(left, x + other.width)
        elif other.type == "UI":
            right = min(right, x)
        elif other.type in ("HEADER", "TOOL_HEADER"):
            if y > region.height / 2:
                top = min(top, y)
            else:
                bottom = max(bottom, y + other.height)
    return Rectangle(left, bottom, max(right - left, 1.0), max(top - bottom, 1.0))


def _begin() -> None:
    if not bpy.app.background:
        _handles.append(bpy.types.SpaceNodeEditor.draw_handler_add(_draw, (), "WINDOW", "POST_PIXEL"))
    theirs = bpy.types.NODE_HT_header.draw

    def draw(self: bpy.types.Header, context: bpy.types.Context) -> None:
        content = content_of(context)
        if content is None:
            theirs(self, context)
            return
        self.layout.template_header()
        _draw_switch(context, self.layout)
        content.header(context, self.layout)

    _header.append(theirs)
    bpy.types.NODE_HT_header.draw = draw


def _draw_switch(context: bpy.types.Context, layout: bpy.types.UILayout) -> None:
    """One click from one type of graphs to the other."""
    if len(_contents) < 2:
        return
    row = layout.row(align=True)
    for tree, one in _contents.items():
        row.prop_enum(context.area, "ui_type", tree, text=one.name)


def _end() -> None:
    while _handles:
        bpy.types.SpaceNodeEditor.draw_handler_remove(_handles.pop(), "WINDOW")
    while _header:
        bpy.types.NODE_HT_header.draw = _header.pop()
    _canvases.clear()
    drawing.forget()
