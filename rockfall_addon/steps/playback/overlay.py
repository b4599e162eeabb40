# SPDX-License-Identifier: GPL-3.0-or-later
"""What the colours of the flights mean, in the lower left corner of the 3-D view: speeds, or whose block it is."""

import bpy

from ....core.colours import MEASURED_COLOUR
from ....core.impact_models.registry import MODELS
from ...scene import problems
from ...scene.models import models
from ...scene.picks import trails
from ...scene.storage import store
from ...view import legend

_handles: list[object] = []


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
    if not store.has_role(scene, store.FLIGHTS_ROLE):
        return
    left, scale = legend.fitting(context)
    legend.begin(scale)
    shown = models.shown_models(scene)
    if shown:
        rows = [("measured", MEASURED_COLOUR), *((MODELS[name].title, MODELS[name].colour) for name in shown)]
        legend.swatches(left, scale, rows, "Measured, and where models send the blocks from the same impacts")
    elif not trails.beside_models(scene):
        _draw_speeds(settings, left, scale)
    legend.end()


def _draw_speeds(settings: bpy.types.PropertyGroup, left: float, scale: float) -> None:
    top, title = {
        "SPEED": (settings.speed_top_mps, "Block speed [m/s]"),
        "ENERGY": (settings.energy_top_kj, "Kinetic energy [kJ]"),
        "DOUBT": (100 * trails.DOUBTFUL_SIGMA, "Standard deviation of the speed [%], or flagged"),
    }[settings.colour_by]
    size = f", blocks drawn {settings.block_scale:g}× their size" if settings.block_scale != 1 else ""
    legend.bar(left, scale, top, f"{title}{size}; red: below the terrain")
