# SPDX-License-Identifier: GPL-3.0-or-later
"""The button that opens the last film."""

import bpy

from . import beside


def draw_written(layout: bpy.types.UILayout, scene: bpy.types.Scene) -> None:
    """Nothing before there is one."""
    path = beside.written.get(scene.session_uid)
    if path is not None:
        layout.operator("wm.path_open", text=f"Open {path.name}", icon="PLAY").filepath = str(path)
