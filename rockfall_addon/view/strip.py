# SPDX-License-Identifier: GPL-3.0-or-later
"""The impact strip: the picks of all trajectories along the timeline, whatever is selected; a row for each of them."""

from dataclasses import dataclass

import bpy
import gpu
import numpy as np
from mathutils import Matrix

from ...core.analysis.graph_layout import Rectangle
from ..scene import problems
from ..scene.picks import impact_marks, picks
from ..scene.picks.impact_marks import Marks
from ..scene.storage import store
from . import impact_words
from .graphs import drawing
from .graphs.look import Look, alpha, look, mixed

SCRUB, SCROLLER, ROW, LEAST_ROW = 30.0, 12.0, 20.0, 3.0  # heights at interface scale 1 [px]
REACH = 7.0
"""A mark is under the mouse within this, at interface scale 1 [px]."""
SHAPES = {
    "impact": "circle",
    "release": "down",
    "pass": "plus",
    "contact": "diamond",
    "stop": "square",
    "takeoff": "triangle",
}
WARNING = (1.0, 0.55, 0.0)
NAME_PART = 0.2
"""Of the strip's width that a name may have."""


@dataclass(frozen=True, eq=False)
class Strip:
    """Where the marks lie in a region.

    Attributes
    ----------
    marks : of the scene.
    area : of all rows [px of the region].
    rows : how many there are; trajectories share them where there is no room for one each.
    first, per_frame : scene frame at the region's left edge, pixels for a frame.
    """

    marks: Marks
    area: Rectangle
    rows: int
    first: float
    per_frame: float

    @property
    def row_height(self) -> float:
        return self.area.height / self.rows

    def row_of(self, trajectory: np.ndarray) -> np.ndarray:
        """Rows of trajectories, from the top."""
        return trajectory * self.rows // max(len(self.marks.names), 1)

    def places(self) -> np.ndarray:
        """(n, 2) the marks in the region [px]."""
        x = (self.marks.frame - self.first) * self.per_frame
        return np.column_stack([x, self.area.top - (self.row_of(self.marks.row) + 0.5) * self.row_height])

    def mark_at(self, x: float, y: float, reach: float) -> int:
        """Number of the mark under a place; −1 for none."""
        if not len(self.marks.frame) or not self.area.holds(x, y):
            return -1
        away = np.abs(self.places() - (x, y))
        distance = np.where(away[:, 1] <= max(0.5 * self.row_height, reach), np.hypot(*away.T), np.inf)
        nearest = int(np.argmin(distance))
        return nearest if distance[nearest] <= max(reach, 0.5 * self.row_height) else -1


_handles: list[object] = []
_batches: dict[tuple[Marks, int], dict[str, drawing.Points | drawing.Lines]] = {}
_pointed: dict[int, str] = {}
"""Region → id of the pick that is under the mouse in it."""


def strip_of(context: bpy.types.Context) -> Strip | None:
    """The strip of the timeline of a context; None without picks, or without room. A dope sheet has channels there."""
    region, space = context.region, context.space_data
    if region is None or space is None or space.type != "DOPESHEET_EDITOR" or region.type != "WINDOW":
        return None
    if space.mode != "TIMELINE":
        return None
    marks = impact_marks.marks(context.scene)
    scale = context.preferences.system.ui_scale
    room = region.height - (SCRUB + SCROLLER) * scale
    if not marks.names or room < LEAST_ROW * scale or region.width < 2:
        return None
    rows = min(len(marks.names), int(room / (LEAST_ROW * scale)))
    height = min(room, rows * ROW * scale)
    first, last = (region.view2d.region_to_view(x, 0)[0] for x in (0, region.width))
    area = Rectangle(0.0, region.height - SCRUB * scale - height, region.width, height)
    return Strip(marks, area, rows, first, region.width / (last - first))


def point(context: bpy.types.Context, x: float, y: float) -> str:
    """Find the pick under the mouse and show its card; its id, empty for none."""
    strip = strip_of(context)
    found = -1 if strip is None else strip.mark_at(x, y, REACH * context.preferences.system.ui_scale)
    identifier = strip.marks.identifier[found] if found >= 0 else ""
    if _pointed.get(context.region.as_pointer(), "") != identifier:
        _pointed[context.region.as_pointer()] = identifier
        context.region.tag_redraw()
    return identifier


def is_pointed() -> bool:
    """Whether a card is shown in one of the strips."""
    return any(_pointed.values())


def point_nowhere() -> None:
    """The mouse is elsewhere."""
    _pointed.clear()
    redraw()


def redraw() -> None:
    """Draw all strips again: a pick was selected or has changed."""
    manager = bpy.context.window_manager
    for window in manager.windows if manager is not None else ():
        for area in window.screen.areas:
            if area.type == "DOPESHEET_EDITOR":
                area.tag_redraw()


def forget() -> None:
    """Another file was opened."""
    _batches.clear()
    _pointed.clear()
    impact_marks.forget()


def register() -> None:
    if not bpy.app.background:
        _handles.append(bpy.types.SpaceDopeSheetEditor.draw_handler_add(_draw, (), "WINDOW", "POST_PIXEL"))


def unregister() -> None:
    while _handles:
        bpy.types.SpaceDopeSheetEditor.draw_handler_remove(_handles.pop(), "WINDOW")
    forget()


@problems.guarded
def _draw() -> None:
    context = bpy.context
    strip = strip_of(context)
    if strip is None:
        return
    seen, kept = look(context), _kept(strip)
    drawing.fill(strip.area, alpha(seen.plot, 0.9))
    _draw_rows(context, strip, seen)
    diameter = min(1.4 * seen.point, max(1.2 * strip.row_height, 0.8 * seen.point))
    frames = strip.area.width / strip.per_frame
    bounds = (strip.first, -1.0, strip.first + frames, strip.rows + 1.0)
    matrix = Matrix.Translation((-strip.first * strip.per_frame, strip.area.top - 0.5 * strip.row_height, 0.0))
    matrix @= Matrix.Diagonal((strip.per_frame, -strip.row_height, 1.0, 1.0))
    with drawing.clipped(strip.area):
        _draw_active(context, strip, seen, diameter)
        with gpu.matrix.push_pop():
            gpu.matrix.multiply_matrix(matrix)
            kept["spans"].draw(alpha(seen.faint, 0.6), seen.line, thin=True)
            kept["alarming"].draw(1.7 * diameter, bounds)
            for kind in SHAPES:
                kept[kind].draw(diameter, bounds, edge=(0.0, 0.0, 0.0), rim=seen.line)
    _draw_pointed(context, strip, seen, diameter)
    gpu.state.blend_set("NONE")


def _kept(strip: Strip) -> dict[str, drawing.Points | drawing.Lines]:
    """The batches of a strip, in frames and rows."""
    key = strip.marks, strip.rows
    if key not in _batches:
        for other in [other for other in _batches if other[0] is not strip.marks or len(_batches) > 3]:
            del _batches[other]
        marks, row = strip.marks, strip.row_of(strip.marks.row)
        places, kinds = np.column_stack([marks.frame, row]), np.array(marks.kind)
        own = strip.row_of(np.arange(len(marks.names)))
        spans = np.stack([np.column_stack([marks.start, own]), np.column_stack([marks.end, own])], axis=1)
        found: dict[str, drawing.Points | drawing.Lines] = {
            kind: drawing.Points(places[kinds == kind], picks.MARKER_COLOURS[kind], 1.0, shape)
            for kind, shape in SHAPES.items()
        }
        found["alarming"] = drawing.Points(places[marks.alarming], WARNING, 1.0, "ring")
        found["spans"] = drawing.Lines(spans)
        _batches[key] = found
    return _batches[key]


def _draw_rows(context: bpy.types.Context, strip: Strip, seen: Look) -> None:
    """Every other row shaded, that of the selected pick in its colour, and the names where there is room."""
    if strip.row_height < 0.9 * seen.text or strip.rows < len(strip.marks.names):
        return
    obj = context.object
    active = obj.get(store.TRAJECTORY, "") if obj is not None else ""
    for i, name in enumerate(strip.marks.names):
        low = strip.area.top - (i + 1) * strip.row_height
        if i % 2:
            drawing.fill(Rectangle(0.0, low, strip.area.width, strip.row_height), alpha(seen.ink, 0.05))
        size = min(seen.text, 0.85 * strip.row_height)
        colour = seen.chosen if name == active else mixed(seen.plot, seen.ink, 0.8)
        words = drawing.shortened(name, size, NAME_PART * strip.area.width)
        drawing.text(6 * seen.scale, low + strip.row_height / 2, words, size, colour, (0.0, 0.5))


def _draw_active(context: bpy.types.Context, strip: Strip, seen: Look, diameter: float) -> None:
    """A bar behind the selected pick: a ring would be taken for the ring of a flag."""
    identifier = context.object.get(store.ID, "") if context.object is not None else ""
    if identifier and identifier in strip.marks.identifier:
        x, y = strip.places()[strip.marks.identifier.index(identifier)]
        high = max(strip.row_height, 2.0 * diameter)
        drawing.fill(Rectangle(x - 1.2 * diameter, y - high / 2, 2.4 * diameter, high), alpha(seen.chosen, 0.55))


def _draw_pointed(context: bpy.types.Context, strip: Strip, seen: Look, diameter: float) -> None:
    """A ring about the pick under the mouse, and its card."""
    identifier = _pointed.get(context.region.as_pointer(), "")
    if not identifier or identifier not in strip.marks.identifier:
        return
    place = strip.places()[[strip.marks.identifier.index(identifier)]]
    region = (0.0, 0.0, strip.area.width, strip.area.top + diameter)
    drawing.Points(place, seen.ink, 1.0, "ring").draw(2.2 * diameter, region)
    pick = picks.with_id(context.scene, identifier)
    if pick is not None:
        rows = [impact_words.title(pick), "   ".join(impact_words.numbers(pick)), *impact_words.reasons(pick)]
        within = Rectangle(0.0, 0.0, strip.area.width, strip.area.top)
        drawing.card(tuple(place[0]), [row for row in rows if row], seen, within)
