# SPDX-License-Identifier: GPL-3.0-or-later
"""Build assets/workspace.blend: the workspace "Rockfall", as a person would arrange it with the mouse.

Needs a window, in which nobody moves the mouse, and the extension, for the name of its tab in the sidebar:

    blender --factory-startup --enable-event-simulate --window-geometry 0 0 1600 1000 \\
        --addons bl_ext.user_default.rockfall --python scripts/making/workspace.py

Blender keeps the shares of the areas, not their pixels, so that the workspace fits into any window at any interface
scale. Two 3-D views: the camera's to the left with the tab Rockfall open, a free one to the right, the timeline below.
"""

import os
import sys
import traceback
from collections.abc import Generator
from pathlib import Path

import bpy

OUT = Path(__file__).resolve().parents[2] / "assets" / "workspace.blend"
NAME, KEY = "Rockfall", "rockfall_workspace"  # as rockfall_addon/view/workspace.py knows them
CAMERA_SHARE, TIMELINE_SHARE = 0.66, 0.18
SIDEBAR = 300  # width at interface scale 1 [px]
SETTLE_S = 0.4


def areas(kind: str) -> list[bpy.types.Area]:
    """The areas of one type, from left to right."""
    found = [area for area in screen().areas if area.type == kind]
    return sorted(found, key=lambda area: area.x)


def screen() -> bpy.types.Screen:
    return bpy.context.window_manager.windows[0].screen


def override(area: bpy.types.Area) -> object:
    region = next(region for region in area.regions if region.type == "WINDOW")
    return bpy.context.temp_override(window=bpy.context.window_manager.windows[0], area=area, region=region)


def build() -> Generator[float]:
    """Arrange the window, one step after each pause."""
    window = bpy.context.window_manager.windows[0]
    bpy.context.preferences.view.show_splash = False
    with bpy.context.temp_override(window=window):
        bpy.ops.workspace.duplicate()
    yield SETTLE_S
    workspace = window.workspace
    workspace.name = NAME
    for kind in ("OUTLINER", "PROPERTIES", "DOPESHEET_EDITOR"):
        for area in areas(kind):
            with override(area):
                bpy.ops.screen.area_close()
            yield SETTLE_S
    with override(areas("VIEW_3D")[0]):
        bpy.ops.screen.area_split(direction="HORIZONTAL", factor=TIMELINE_SHARE)
    yield SETTLE_S
    below = min(areas("VIEW_3D"), key=lambda area: area.y)
    below.type = "DOPESHEET_EDITOR"
    below.ui_type = "TIMELINE"
    below.spaces.active.show_seconds = True
    yield SETTLE_S
    with override(areas("VIEW_3D")[0]):
        bpy.ops.screen.area_split(direction="VERTICAL", factor=CAMERA_SHARE)
    yield SETTLE_S
    for area in areas("VIEW_3D"):
        dress(area.spaces.active)
    seen, free = (area.spaces.active for area in areas("VIEW_3D"))
    seen.region_3d.view_perspective, free.region_3d.view_perspective = "CAMERA", "PERSP"
    seen.show_region_ui, free.show_region_ui, free.show_region_toolbar = True, False, False
    yield SETTLE_S
    sidebar = next(region for region in areas("VIEW_3D")[0].regions if region.type == "UI")
    sidebar.active_panel_category = NAME
    yield SETTLE_S
    yield from drag_edge(window, sidebar)
    workspace[KEY] = True
    bpy.data.libraries.write(str(OUT), {workspace}, compress=True)
    kinds = [(area.ui_type, area.width, area.height) for area in screen().areas]
    print(f"{OUT.name}: {OUT.stat().st_size / 1e3:.0f} kB, {kinds}, sidebar {sidebar.width} px", flush=True)


def dress(space: bpy.types.SpaceView3D) -> None:
    """Nothing in the picture that is not the slope."""
    overlay = space.overlay
    overlay.show_floor = overlay.show_axis_x = overlay.show_axis_y = overlay.show_cursor = False
    overlay.show_relationship_lines = False
    space.clip_start, space.clip_end = 0.1, 20_000.0


def drag_edge(window: bpy.types.Window, sidebar: bpy.types.Region) -> Generator[float]:
    """Give the sidebar its width as a mouse does: no property sets it."""
    scale = bpy.context.preferences.system.ui_scale
    x, y = sidebar.x, sidebar.y + sidebar.height // 2
    to = x + sidebar.width - round(SIDEBAR * scale)
    for kind, value, place in (
        ("MOUSEMOVE", "NOTHING", x + 30),
        ("MOUSEMOVE", "NOTHING", x),
        ("LEFTMOUSE", "PRESS", x),
        ("MOUSEMOVE", "NOTHING", (x + to) // 2),
        ("MOUSEMOVE", "NOTHING", to),
        ("LEFTMOUSE", "RELEASE", to),
    ):
        window.event_simulate(type=kind, value=value, x=place, y=y)
        yield SETTLE_S


def main() -> None:
    steps = build()

    def step() -> float | None:
        code = 0
        try:
            return next(steps)
        except StopIteration:
            pass
        except Exception:  # noqa: BLE001 - told, and this Blender ends
            traceback.print_exc()
            code = 1
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(code)  # a regular exit asks whether to save

    bpy.app.timers.register(step, first_interval=1.0)


if __name__ == "__main__":
    main()
