# SPDX-License-Identifier: GPL-3.0-or-later
"""What the mouse does over a graph: shows what is under it, selects, opens the list of an axis, presses a button."""

from math import hypot

import bpy
import numpy as np
from bpy.props import EnumProperty

from ...scene.models import graph_settings
from ...view.graphs import editor, impact_sheet, selection
from ...view.reporting import redraw

STILL = 4.0
"""The mouse may move this far while a button is clicked, at interface scale 1 [px]."""
HOW = [
    ("SET", "Set", "Select these and no others"),
    ("ADD", "Add", "Select these, too"),
    ("SUBTRACT", "Subtract", "These are selected no more"),
]


class ROCKFALL_OT_point_in_graph(bpy.types.Operator):
    """Show what is under the mouse"""

    bl_idname = "rockfall.point_in_graph"
    bl_label = "Point in Graph"
    bl_options = {"INTERNAL"}
    looks_only = True

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return editor.content_of(context) is not None

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        canvas = editor.canvas_of(context)
        if canvas is not None:
            on_button = editor.button_at(canvas)
            changed = editor.point(context, canvas, event.mouse_region_x, event.mouse_region_y)
            if changed or editor.button_at(canvas) is not on_button:
                context.region.tag_redraw()
        return {"PASS_THROUGH"}


class ROCKFALL_OT_leave_graphs(bpy.types.Operator):
    """The mouse is over no graph: its card is taken away"""

    bl_idname = "rockfall.leave_graphs"
    bl_label = "Leave Graphs"
    bl_options = {"INTERNAL"}
    looks_only = True

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return editor.is_pointed()

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        for area in context.screen.areas if context.screen else ():
            if area.type != "NODE_EDITOR":
                continue
            region = next(one for one in area.regions if one.type == "WINDOW")
            inside = 0 <= event.mouse_x - region.x < region.width and 0 <= event.mouse_y - region.y < region.height
            if not inside and editor.point_nowhere(region):
                region.tag_redraw()
        return {"PASS_THROUGH"}


class ROCKFALL_OT_press_in_graph(bpy.types.Operator):
    """Select the impact under the mouse and go to its moment, or, dragging, all in a box or an outline. On an axis:
    choose its variable"""

    bl_idname = "rockfall.press_in_graph"
    bl_label = "Select in Graph"
    bl_options = {"UNDO"}

    how: EnumProperty(name="How", items=HOW, options={"SKIP_SAVE"})

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return editor.shows(context) and editor.canvas_of(context) is not None

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        canvas = editor.canvas_of(context)
        editor.point(context, canvas, event.mouse_region_x, event.mouse_region_y)
        button = editor.button_at(canvas)
        if button is not None:
            module, name = button.operator.split(".")
            getattr(getattr(bpy.ops, module), name)("INVOKE_DEFAULT")
            return {"CANCELLED"}
        if canvas.part in ("x", "y"):
            _choose_variable(context, canvas.graph, canvas.part)
            return {"CANCELLED"}
        if canvas.part != "plot":
            return {"PASS_THROUGH"}
        self.graph, self.canvas = canvas.graph, canvas
        self.path = [canvas.pointer]
        self.dragged = False
        context.window_manager.modal_handler_add(self)
        return {"RUNNING_MODAL"}

    def modal(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        canvas = self.canvas
        if event.type in ("ESC", "RIGHTMOUSE") and event.value == "PRESS":
            return self._ended(context, {"CANCELLED"})
        if event.type == "MOUSEMOVE":
            x, y = event.mouse_region_x, event.mouse_region_y
            start = self.path[0]
            self.dragged |= hypot(x - start[0], y - start[1]) > STILL * context.preferences.system.ui_scale
            self.path.append((x, y))
            if self.dragged:
                canvas.band = _band(context, self.path)
                canvas.hit = None
                context.region.tag_redraw()
        elif event.type == "LEFTMOUSE" and event.value == "RELEASE":
            return self._ended(context, self._drop(context) if self.dragged else self._click(context))
        return {"RUNNING_MODAL"}

    def cancel(self, context: bpy.types.Context) -> None:
        self._ended(context, {"CANCELLED"})

    def _click(self, context: bpy.types.Context) -> set[str]:
        hit, before = self.canvas.hit, selection.selected(context)
        if hit is None:
            if self.how != "SET" or not before:
                return {"CANCELLED"}
            selection.select(context, frozenset())
            return {"FINISHED"}
        one = hit.source, hit.row
        if self.how == "SET":
            chosen = frozenset({one})
        elif self.how == "ADD" and one not in before:
            chosen = before | {one}
        else:
            chosen = before - {one}
        selection.select(context, chosen, one if one in chosen else None)
        if hit.source == 0 and one in chosen:
            selection.go_to(context, hit.row)
        return {"FINISHED"}

    def _drop(self, context: bpy.types.Context) -> set[str]:
        graph, frame = impact_sheet.drawn_graph(context.scene, self.graph), self.canvas.frames.get(self.graph)
        if graph is None or frame is None:
            return {"CANCELLED"}
        lasso = context.scene.rockfall_graphs.drag_selects == "LASSO"
        found = graph.within(frame, np.array(self.path if lasso else (self.path[0], self.path[-1])), lasso)
        before = selection.selected(context)
        chosen = {"SET": found, "ADD": before | found, "SUBTRACT": before - found}[self.how]
        if chosen == before:
            return {"CANCELLED"}
        own = sorted(row for source, row in chosen if source == 0)
        selection.select(context, chosen, (0, own[0]) if own else None)
        return {"FINISHED"}

    def _ended(self, context: bpy.types.Context, how: set[str]) -> set[str]:
        self.canvas.band = None
        redraw(context)
        return how


class ROCKFALL_OT_graph_menu(bpy.types.Operator):
    """What can be done with the graph under the mouse"""

    bl_idname = "rockfall.graph_menu"
    bl_label = "Graph"
    bl_options = {"INTERNAL"}
    looks_only = True

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return editor.shows(context) and editor.canvas_of(context) is not None

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        canvas = editor.canvas_of(context)
        editor.point(context, canvas, event.mouse_region_x, event.mouse_region_y)
        if canvas.graph < 0:
            return {"CANCELLED"}
        number, graph = canvas.graph, graph_settings.graph(context.scene, canvas.graph)

        def draw(menu: bpy.types.Menu, context: bpy.types.Context) -> None:
            layout = menu.layout
            for axis in ("x", "y"):
                layout.prop_menu_enum(graph, axis, text=f"{axis} Axis: Variable")
                layout.prop(graph, f"{axis}_log", text=f"{axis} Axis Logarithmic")
            layout.prop_menu_enum(graph, "trend", text="Fit")
            layout.separator()
            for operator, icon in (
                ("rockfall.reset_graphs", "HOME"),
                ("rockfall.show_all_points", "ZOOM_ALL"),
                ("rockfall.maximise_graph", "FULLSCREEN_ENTER"),
            ):
                layout.operator(operator, icon=icon).graph = number + 1

        context.window_manager.popup_menu(draw, title=f"Graph {number + 1}")
        return {"FINISHED"}


def _choose_variable(context: bpy.types.Context, number: int, axis: str) -> None:
    """The list of the variables, with the axis' scale."""
    graph = graph_settings.graph(context.scene, number)

    def draw(menu: bpy.types.Menu, context: bpy.types.Context) -> None:
        layout = menu.layout
        layout.prop(graph, f"{axis}_log")
        layout.separator()
        for name in impact_sheet.variables_of(context.scene):
            layout.prop_enum(graph, axis, name)

    context.window_manager.popup_menu(draw, title=f"{axis} Axis")


def _band(context: bpy.types.Context, path: list[tuple[float, float]]) -> np.ndarray:
    if context.scene.rockfall_graphs.drag_selects == "LASSO":
        return np.array(path)
    (x0, y0), (x1, y1) = path[0], path[-1]
    return np.array([(x0, y0), (x1, y0), (x1, y1), (x0, y1)])


CLASSES = (
    ROCKFALL_OT_point_in_graph,
    ROCKFALL_OT_leave_graphs,
    ROCKFALL_OT_press_in_graph,
    ROCKFALL_OT_graph_menu,
)
