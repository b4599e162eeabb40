# SPDX-License-Identifier: GPL-3.0-or-later
"""The colour scale of the flights, in the lower left corner of the 3-D view."""

import blf
import bpy
import gpu
from gpu_extras.batch import batch_for_shader

from ...core.colours import SPEED_SCALE
from ..bridge import state

_handles: list[object] = []

WIDTH, HEIGHT, MARGIN, TEXT = 220, 12, 28, 12  # in pixels at interface scale 1


def register() -> None:
    if not bpy.app.background:
        _handles.append(bpy.types.SpaceView3D.draw_handler_add(_draw, (), "WINDOW", "POST_PIXEL"))


def unregister() -> None:
    while _handles:
        bpy.types.SpaceView3D.draw_handler_remove(_handles.pop(), "WINDOW")


def _draw() -> None:
    context = bpy.context
    scene = context.scene
    settings = scene.rockfall
    if not (settings.show_legend and context.space_data.overlay.show_overlays):
        return
    if not state.with_role(scene, state.FLIGHTS_ROLE):
        return
    scale = context.preferences.system.ui_scale
    left = MARGIN * scale + _covered_left(context.area)
    bottom, width, height = (MARGIN + TEXT) * scale, WIDTH * scale, HEIGHT * scale
    steps = len(SPEED_SCALE)
    places, colours = [], []
    for i, colour in enumerate(SPEED_SCALE):
        x = left + width * i / (steps - 1)
        places += [(x, bottom), (x, bottom + height)]
        colours += [(*colour, 1.0)] * 2
    shader = gpu.shader.from_builtin("SMOOTH_COLOR")
    batch_for_shader(shader, "TRI_STRIP", {"pos": places, "color": colours}).draw(shader)
    blf.size(0, TEXT * scale)
    blf.color(0, 0.95, 0.95, 0.95, 1.0)
    blf.enable(0, blf.SHADOW)
    blf.shadow(0, 3, 0.0, 0.0, 0.0, 0.8)
    top = settings.speed_top_mps
    for part in (0.0, 0.5, 1.0):
        text = f"{top * part:g}"
        _text(left + width * part - blf.dimensions(0, text)[0] / 2, bottom - (TEXT + 4) * scale, text)
    size = f", blocks drawn {settings.block_scale:g}× their size" if settings.block_scale != 1 else ""
    _text(left, bottom + height + 6 * scale, f"Block speed [m/s]{size}")
    blf.disable(0, blf.SHADOW)


def _text(x: float, y: float, text: str) -> None:
    blf.position(0, x, y, 0)
    blf.draw(0, text)


def _covered_left(area: bpy.types.Area) -> float:
    """Width of the toolbar, which lies over the view."""
    return next((float(r.width) for r in area.regions if r.type == "TOOLS"), 0.0)
