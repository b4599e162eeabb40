# SPDX-License-Identifier: GPL-3.0-or-later
"""What the colours of the flights mean, in the lower left corner of the 3-D view: speeds, or whose block it is."""

import blf
import bpy
import gpu
from gpu_extras.batch import batch_for_shader

from ....core.colours import OBSERVED_COLOUR, SPEED_SCALE
from ....core.impact_models.registry import MODELS
from ...scene import models, problems, store, trails

_handles: list[object] = []

WIDTH, HEIGHT, MARGIN, TEXT = 220, 12, 28, 12  # in pixels at interface scale 1


def register() -> None:
    if not bpy.app.background:
        _handles.append(bpy.types.SpaceView3D.draw_handler_add(_draw, (), "WINDOW", "POST_PIXEL"))


def unregister() -> None:
    while _handles:
        bpy.types.SpaceView3D.draw_handler_remove(_handles.pop(), "WINDOW")


@problems.guarded
def _draw() -> None:
    context = bpy.context
    scene = context.scene
    settings = scene.rockfall
    if not (settings.show_legend and context.space_data.overlay.show_overlays):
        return
    if not store.with_role(scene, store.FLIGHTS_ROLE):
        return
    scale = context.preferences.system.ui_scale
    left = MARGIN * scale + _covered_left(context.area)
    blf.size(0, TEXT * scale)
    blf.color(0, 0.95, 0.95, 0.95, 1.0)
    blf.enable(0, blf.SHADOW)
    blf.shadow(0, 3, 0.0, 0.0, 0.0, 0.8)
    shown = models.shown_models(scene)
    if shown:
        _draw_models(shown, left, scale)
    else:
        _draw_speeds(settings, left, scale)
    blf.disable(0, blf.SHADOW)


def _draw_models(shown: tuple[str, ...], left: float, scale: float) -> None:
    """A swatch and a name for the real blocks, and for each model."""
    rows = [("observed", OBSERVED_COLOUR), *((MODELS[name].title, MODELS[name].colour) for name in shown)]
    size, step, bottom = HEIGHT * scale, 1.7 * HEIGHT * scale, MARGIN * scale
    shader = gpu.shader.from_builtin("UNIFORM_COLOR")
    for i, (name, colour) in enumerate(reversed(rows)):
        low = bottom + i * step
        corners = [(left, low), (left + size, low), (left, low + size), (left + size, low + size)]
        shader.uniform_float("color", (*colour, 1.0))
        batch_for_shader(shader, "TRI_STRIP", {"pos": corners}).draw(shader)
        _text(left + 1.6 * size, low + 0.1 * size, name)
    _text(left, bottom + (len(rows) + 0.2) * step, "Real blocks, and where models send them from the same impacts")


def _draw_speeds(settings: bpy.types.PropertyGroup, left: float, scale: float) -> None:
    bottom, width, height = (MARGIN + TEXT) * scale, WIDTH * scale, HEIGHT * scale
    steps = len(SPEED_SCALE)
    places, colours = [], []
    for i, colour in enumerate(SPEED_SCALE):
        x = left + width * i / (steps - 1)
        places += [(x, bottom), (x, bottom + height)]
        colours += [(*colour, 1.0)] * 2
    shader = gpu.shader.from_builtin("SMOOTH_COLOR")
    batch_for_shader(shader, "TRI_STRIP", {"pos": places, "color": colours}).draw(shader)
    top, title = {
        "SPEED": (settings.speed_top_mps, "Block speed [m/s]"),
        "ENERGY": (settings.energy_top_kj, "Kinetic energy [kJ]"),
        "DOUBT": (100 * trails.DOUBTFUL_SIGMA, "Standard deviation of the speed [%], or flagged"),
    }[settings.colour_by]
    for part in (0.0, 0.5, 1.0):
        text = f"{top * part:g}"
        _text(left + width * part - blf.dimensions(0, text)[0] / 2, bottom - (TEXT + 4) * scale, text)
    size = f", blocks drawn {settings.block_scale:g}× their size" if settings.block_scale != 1 else ""
    _text(left, bottom + height + 6 * scale, f"{title}{size}; red: below the terrain")


def _text(x: float, y: float, text: str) -> None:
    blf.position(0, x, y, 0)
    blf.draw(0, text)


def _covered_left(area: bpy.types.Area) -> float:
    """Width of the toolbar, which lies over the view."""
    return next((float(r.width) for r in area.regions if r.type == "TOOLS"), 0.0)
