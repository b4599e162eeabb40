# SPDX-License-Identifier: GPL-3.0-or-later
"""Legends over a 3-D view: a scale of colours, or swatches with names."""

from collections.abc import Sequence

import blf
import bpy
import gpu
from gpu_extras.batch import batch_for_shader

from ...core.colours import SPEED_SCALE
from ...core.errors import visible
from .workspace import free_part

WIDTH, HEIGHT, MARGIN, TEXT = 220, 12, 28, 12  # in pixels at interface scale 1

Colour = tuple[float, float, float]
EDGE: Colour = (0.1, 0.1, 0.1)
"""Around a swatch, which may be white on a light ground."""
HATCHED: Colour = (0.85, 0.85, 0.85)
"""Below the lines of a hatched swatch."""
GROUND = (0.08, 0.08, 0.09, 0.62)
"""Behind a legend, so that it can be read on footage, trails and maps."""
PAD = 7
"""Of this ground beyond what stands on it, in pixels at interface scale 1."""


def begin(scale: float) -> None:
    """Set the font; `end` sets it back."""
    blf.size(0, TEXT * scale)
    blf.color(0, 0.95, 0.95, 0.95, 1.0)
    blf.enable(0, blf.SHADOW)
    blf.shadow(0, 3, 0.0, 0.0, 0.0, 0.8)


def end() -> None:
    """What comes after has no shadow."""
    blf.disable(0, blf.SHADOW)


def swatches(
    left: float, scale: float, rows: Sequence[tuple[str, Colour | None]], title: str, above: float = 0.0
) -> None:
    """A square with a dark edge and a name for each row, from the lower margin up, and a title above.

    rows : a hatched square where there is no colour.
    above : how much higher it begins [px], where another legend is below.
    """
    size, step, bottom = HEIGHT * scale, 1.7 * HEIGHT * scale, MARGIN * scale + above
    lines = title.split("; ")
    top = bottom + (len(rows) + 0.2) * step + 1.4 * TEXT * (len(lines) - 1) * scale + TEXT * scale
    right = left + max([*map(_wide, lines), *(1.6 * size + _wide(name) for name, _ in rows)])
    _ground(left, right, bottom, top, scale)
    shader = gpu.shader.from_builtin("UNIFORM_COLOR")
    for i, (name, colour) in enumerate(reversed(rows)):
        low = bottom + i * step
        for more, shade in ((max(1.0, scale), EDGE), (0.0, colour or HATCHED)):
            a, b, c, d = left - more, left + size + more, low - more, low + size + more
            shader.uniform_float("color", (*shade, 1.0))
            batch_for_shader(shader, "TRI_STRIP", {"pos": [(a, c), (b, c), (a, d), (b, d)]}).draw(shader)
        if colour is None:
            shader.uniform_float("color", (*EDGE, 1.0))
            for x in (0.0, 0.25, 0.5):
                bar = [(x, 0.0), (x + 0.15, 0.0), (x + 0.35, 1.0), (x + 0.5, 1.0)]
                places = [(left + size * u, low + size * v) for u, v in bar]
                batch_for_shader(shader, "TRI_STRIP", {"pos": places}).draw(shader)
        text(left + 1.6 * size, low + 0.1 * size, name)
    for i, words in enumerate(reversed(lines)):
        text(left, bottom + (len(rows) + 0.2) * step + 1.4 * TEXT * i * scale, words)


def fitting(context: bpy.types.Context) -> tuple[float, float]:
    """Where a legend begins, and its scale: the interface's, less in a view that is too narrow for the bar."""
    low, _, high, _ = free_part(context.area, context.region)
    scale = min(context.preferences.system.ui_scale, (high - low) / (WIDTH + 2 * MARGIN))
    return low + MARGIN * scale, scale


def bar(left: float, scale: float, top: float, title: str) -> None:
    """The scale of colours from 0 to `top`, and a title above, a line for each part of it that a semicolon ends."""
    bottom, width, height = (MARGIN + TEXT) * scale, WIDTH * scale, HEIGHT * scale
    lines, steps = title.split("; "), len(SPEED_SCALE)
    over = bottom + height + (6 + 1.4 * TEXT * (len(lines) - 1) + TEXT) * scale
    right = left + max([width + _wide(f"{top:g}") / 2, *map(_wide, lines)])
    _ground(left, right, bottom - (TEXT + 4) * scale, over, scale)
    places, colours = [], []
    for i, colour in enumerate(SPEED_SCALE):
        x = left + width * i / (steps - 1)
        places += [(x, bottom), (x, bottom + height)]
        colours += [(*colour, 1.0)] * 2
    shader = gpu.shader.from_builtin("SMOOTH_COLOR")
    batch_for_shader(shader, "TRI_STRIP", {"pos": places, "color": colours}).draw(shader)
    for part in (0.0, 0.5, 1.0):
        words = f"{top * part:g}"
        text(left + width * part - blf.dimensions(0, words)[0] / 2, bottom - (TEXT + 4) * scale, words)
    for i, words in enumerate(reversed(lines)):
        text(left, bottom + height + (6 + 1.4 * TEXT * i) * scale, words)


def text(x: float, y: float, words: str) -> None:
    """Words at a place of the region."""
    blf.position(0, x, y, 0)
    blf.draw(0, visible(words))


def _wide(words: str) -> float:
    return float(blf.dimensions(0, words)[0])


def _ground(left: float, right: float, low: float, high: float, scale: float) -> None:
    a, b, c, d = left - PAD * scale, right + PAD * scale, low - PAD * scale, high + PAD * scale
    shader = gpu.shader.from_builtin("UNIFORM_COLOR")
    shader.uniform_float("color", GROUND)
    gpu.state.blend_set("ALPHA")
    batch_for_shader(shader, "TRI_STRIP", {"pos": [(a, c), (b, c), (a, d), (b, d)]}).draw(shader)
    gpu.state.blend_set("NONE")


def covered_left(area: bpy.types.Area) -> float:
    """Width of the toolbar, which lies over the view."""
    return next((float(r.width) for r in area.regions if r.type == "TOOLS"), 0.0)


def covered_right(area: bpy.types.Area) -> float:
    """Width of the sidebar, which lies over the view."""
    return next((float(r.width) for r in area.regions if r.type == "UI" and r.width > 1), 0.0)
