# SPDX-License-Identifier: GPL-3.0-or-later
"""Draw by clicks on the terrain: points, a line, an area, from which blocks start, or which they cross."""

import bpy
import numpy as np
from bpy.props import EnumProperty

from ....core.errors import RockfallError
from ....core.vectors import Array
from ...scene import problems
from ...scene.simulation import drawn_releases
from ...scene.terrain import terrain
from ...view import drawing, pointing
from ...view.reporting import possible, redraw

HELP = {
    "points": "Click where blocks start",
    "line": "Click along the line that blocks start from",
    "polygon": "Click around the area that blocks start from",
}
ENDING = "Enter ends · Backspace takes back the last · Esc leaves without a drawing"
YELLOW = (1.0, 0.85, 0.2, 1.0)
PASSED_ON = {
    "MIDDLEMOUSE", "WHEELUPMOUSE", "WHEELDOWNMOUSE", "TRACKPADPAN", "TRACKPADZOOM", "NDOF_MOTION", "HOME",
    "NUMPAD_1", "NUMPAD_3", "NUMPAD_7", "NUMPAD_5", "NUMPAD_PERIOD",
}  # fmt: skip
"""The view can be turned while one draws."""


class Drawing:
    """Mix-in of operators that draw by clicks: `kind` is one of points, line, polygon; `made` keeps the `points`."""

    help = ""
    """What to click, for the status bar."""

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return possible(cls, terrain.tiles(context.scene), "Import the terrain first")

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        place = _largest_view(context)
        if place is None:
            self.report({"ERROR"}, "Open a 3-D view first.")
            return {"CANCELLED"}
        self.points: list[Array] = []
        self.mouse: Array | None = None
        self.handle = bpy.types.SpaceView3D.draw_handler_add(self.draw_points, (), "WINDOW", "POST_PIXEL")
        context.workspace.status_text_set(f"{self.help or HELP[self.kind]}.   {ENDING}")
        context.window.cursor_modal_set("CROSSHAIR")
        context.window_manager.modal_handler_add(self)
        redraw(context)
        return {"RUNNING_MODAL"}

    def modal(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        if event.type in PASSED_ON:
            return {"PASS_THROUGH"}
        if event.type in ("ESC", "RIGHTMOUSE") and event.value == "PRESS":
            self.end(context)
            return {"CANCELLED"}
        if event.type in ("RET", "NUMPAD_ENTER") and event.value == "PRESS":
            return self.finish(context)
        if event.type == "BACK_SPACE" and event.value == "PRESS":
            del self.points[-1:]
        elif event.type in ("LEFTMOUSE", "MOUSEMOVE"):
            view = pointing.view_under(context, event.mouse_x, event.mouse_y)
            if view is None:
                self.mouse = None
                return {"PASS_THROUGH"}
            area, region, xy = view
            with context.temp_override(area=area, region=region, region_data=area.spaces.active.region_3d):
                try:
                    place = pointing.place_at(bpy.context, xy, "")
                except RockfallError as error:
                    self.mouse = None
                    if event.type == "LEFTMOUSE" and event.value == "PRESS":
                        self.report({"WARNING"}, str(error))
                else:
                    self.mouse = place.position
                    if event.type == "LEFTMOUSE" and event.value == "PRESS":
                        self.points.append(place.position)
        redraw(context)
        return {"RUNNING_MODAL"}

    def finish(self, context: bpy.types.Context) -> set[str]:
        """Make the object; too few points are told, and drawing goes on."""
        try:
            self.made(context)
        except RockfallError as error:
            self.report({"WARNING"}, str(error))
            return {"RUNNING_MODAL"}
        self.end(context)
        return {"FINISHED"}

    def cancel(self, context: bpy.types.Context) -> None:
        """Another file was opened meanwhile."""
        self.end(context)

    def end(self, context: bpy.types.Context) -> None:
        bpy.types.SpaceView3D.draw_handler_remove(self.handle, "WINDOW")
        context.workspace.status_text_set(None)
        context.window.cursor_modal_restore()
        redraw(context)

    @problems.guarded
    def draw_points(self) -> None:
        """The points so far, and the line to the mouse."""
        context = bpy.context
        places = [*self.points, *([self.mouse] if self.mouse is not None else [])]
        if not places:
            return
        scale = context.preferences.system.ui_scale
        spots = pointing.on_screen(context, np.array(places))
        if self.kind != "points" and len(spots) > 1:
            ring = np.vstack([spots, spots[:1]]) if self.kind == "polygon" and len(spots) > 2 else spots
            segments = np.stack([ring[:-1], ring[1:]], axis=1)
            good = np.isfinite(segments).all(axis=(1, 2))
            colours = np.broadcast_to(YELLOW, (int(good.sum()), 2, 4))
            drawing.segments(segments[good], colours, 2 * scale)
        good = np.isfinite(spots).all(axis=1)
        drawing.dots(spots[good], np.tile(YELLOW, (int(good.sum()), 1)), 8 * scale)


class ROCKFALL_OT_draw_release(Drawing, bpy.types.Operator):
    """Click on the terrain where blocks start; Enter ends, Esc leaves"""

    bl_idname = "rockfall.draw_release"
    bl_label = "Draw Release"
    bl_options = {"REGISTER", "UNDO"}

    kind: EnumProperty(
        name="Kind",
        items=[
            ("line", "Line", "Blocks start anywhere on a line"),
            ("polygon", "Area", "Blocks start anywhere in an area, as many on each square metre of the terrain"),
            ("points", "Points", "Blocks start at each point"),
        ],
    )

    def made(self, context: bpy.types.Context) -> None:
        settings = context.scene.rockfall_simulation
        settings.drawn = drawn_releases.make(context.scene, self.kind, self.points)
        settings.source = "DRAWN"


def _largest_view(context: bpy.types.Context) -> bpy.types.Area | None:
    areas = [area for area in context.window.screen.areas if area.type == "VIEW_3D"] if context.window else []
    return max(areas, key=lambda area: area.width * area.height, default=None)


CLASSES = (ROCKFALL_OT_draw_release,)
