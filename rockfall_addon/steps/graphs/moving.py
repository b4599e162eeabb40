# SPDX-License-Identifier: GPL-3.0-or-later
"""Zooming, panning and resetting the axes of graphs; one graph alone."""

from collections.abc import Iterator

import bpy
from bpy.props import BoolProperty, IntProperty

from ...scene.models import graph_settings
from ...view.graphs import editor, impact_sheet
from ...view.reporting import redraw

STEP = 1.2
"""Of one notch of the wheel."""


class _OverGraph:
    """Mix-in: works on the graphs of the editor under the mouse, of any kind."""

    looks_only = True

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return editor.canvas_of(context) is not None


class ROCKFALL_OT_zoom_graph(_OverGraph, bpy.types.Operator):
    """Zoom the graph under the mouse about the mouse; over an axis, that axis alone"""

    bl_idname = "rockfall.zoom_graph"
    bl_label = "Zoom Graph"
    bl_options = {"INTERNAL"}

    closer: BoolProperty(name="Closer", default=True)

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        canvas, content = editor.canvas_of(context), editor.content_of(context)
        editor.point(context, canvas, event.mouse_region_x, event.mouse_region_y)
        if canvas.graph < 0:
            return {"CANCELLED"}
        factor = 1 / STEP if self.closer else STEP
        if event.type == "TRACKPADZOOM":
            factor = STEP ** (0.05 * (event.mouse_prev_x - event.mouse_x + event.mouse_prev_y - event.mouse_y))
        frame = canvas.frames[canvas.graph]
        along = (event.mouse_region_x - frame.plot.left) / frame.plot.width
        across = (event.mouse_region_y - frame.plot.bottom) / frame.plot.height
        x = frame.x.zoomed(factor, along).limits if canvas.part != "y" and not event.ctrl else None
        y = frame.y.zoomed(factor, across).limits if canvas.part != "x" and not event.shift else None
        content.set_limits(context.scene, canvas.graph, x, y)
        context.area.tag_redraw()
        return {"FINISHED"}


class ROCKFALL_OT_pan_graph(_OverGraph, bpy.types.Operator):
    """Move the axes of the graph under the mouse; over an axis, that axis alone"""

    bl_idname = "rockfall.pan_graph"
    bl_label = "Pan Graph"
    bl_options = {"INTERNAL"}

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        canvas = editor.canvas_of(context)
        editor.point(context, canvas, event.mouse_region_x, event.mouse_region_y)
        if canvas.graph < 0:
            return {"CANCELLED"}
        self.graph, self.part, self.frame = canvas.graph, canvas.part, canvas.frames[canvas.graph]
        self.content, self.start = editor.content_of(context), canvas.pointer
        if event.type == "TRACKPADPAN":
            self._move(context, event.mouse_x - event.mouse_prev_x, event.mouse_y - event.mouse_prev_y)
            return {"FINISHED"}
        context.window_manager.modal_handler_add(self)
        return {"RUNNING_MODAL"}

    def modal(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        x, y = event.mouse_region_x - self.start[0], event.mouse_region_y - self.start[1]
        if event.type in ("ESC", "RIGHTMOUSE") and event.value == "PRESS":
            self._move(context, 0, 0)
            return {"CANCELLED"}
        if event.type == "MOUSEMOVE":
            self._move(context, x, y)
        elif event.type == "MIDDLEMOUSE" and event.value == "RELEASE":
            return {"FINISHED"}
        return {"RUNNING_MODAL"}

    def _move(self, context: bpy.types.Context, by_x: float, by_y: float) -> None:
        plot = self.frame.plot
        x = self.frame.x.panned(-by_x / plot.width).limits if self.part != "y" else None
        y = self.frame.y.panned(-by_y / plot.height).limits if self.part != "x" else None
        self.content.set_limits(context.scene, self.graph, x, y)
        context.area.tag_redraw()


class ROCKFALL_OT_reset_graphs(_OverGraph, bpy.types.Operator):
    """Give the axes the limits that suit their points again"""

    bl_idname = "rockfall.reset_graphs"
    bl_label = "Reset Axes"
    bl_options = {"UNDO"}

    graph: IntProperty(name="Graph", description="Its number; 0 for all", min=0, options={"SKIP_SAVE"})

    def execute(self, context: bpy.types.Context) -> set[str]:
        canvas, content = editor.canvas_of(context), editor.content_of(context)
        for number in [self.graph - 1] if self.graph else list(canvas.frames):
            content.reset(context.scene, number)
        redraw(context)
        return {"FINISHED"}


class ROCKFALL_OT_show_all_points(bpy.types.Operator):
    """Give the axes limits that hold all points, those beyond the usual ones, too"""

    bl_idname = "rockfall.show_all_points"
    bl_label = "Show All Points"
    bl_options = {"UNDO"}
    looks_only = True

    graph: IntProperty(name="Graph", description="Its number; 0 for all", min=0, options={"SKIP_SAVE"})

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return editor.shows(context)

    def execute(self, context: bpy.types.Context) -> set[str]:
        for number in _graphs(context, self.graph):
            drawn = impact_sheet.drawn_graph(context.scene, number)
            if drawn is not None:
                graph_settings.set_limits(context.scene, number, drawn.x.limits, drawn.y.limits)
        return {"FINISHED"}


class ROCKFALL_OT_maximise_graph(bpy.types.Operator):
    """Show the graph under the mouse alone; again for all graphs"""

    bl_idname = "rockfall.maximise_graph"
    bl_label = "Maximise Graph"
    bl_options = {"UNDO"}
    looks_only = True

    graph: IntProperty(name="Graph", description="Its number; 0 for the one under the mouse", options={"SKIP_SAVE"})

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return editor.shows(context) and editor.canvas_of(context) is not None

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        if not self.graph:
            canvas = editor.canvas_of(context)
            editor.point(context, canvas, event.mouse_region_x, event.mouse_region_y)
            if canvas.part not in ("plot", "title"):
                return {"PASS_THROUGH"}
            self.graph = canvas.graph + 1
        return self.execute(context)

    def execute(self, context: bpy.types.Context) -> set[str]:
        settings = context.scene.rockfall_graphs
        settings.maximised = 0 if settings.maximised else self.graph
        return {"FINISHED"}


def _graphs(context: bpy.types.Context, number: int) -> Iterator[int]:
    return iter([number - 1] if number else graph_settings.shown(context.scene))


CLASSES = (
    ROCKFALL_OT_zoom_graph,
    ROCKFALL_OT_pan_graph,
    ROCKFALL_OT_reset_graphs,
    ROCKFALL_OT_show_all_points,
    ROCKFALL_OT_maximise_graph,
)
