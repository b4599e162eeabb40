# SPDX-License-Identifier: GPL-3.0-or-later
"""The simulated paths over the 3-D view, the selected run, and what their colours mean."""

import blf
import bpy
import gpu
import numpy as np
from gpu_extras.batch import batch_for_shader

from ....core.colours import MEASURED_COLOUR
from ....core.impact_models.registry import MODELS
from ...scene import problems
from ...scene.simulation import simulated_paths, simulation
from ...scene.storage import store
from ...view import legend

WIDTH_PX, SELECTED_PX = 1.4, 4.0
FAINTEST, ALONE, MANY = 0.1, 0.9, 5000
"""How opaque paths are: few, and as many as this or more."""
NEARER = 2e-5
"""Lines are drawn so much nearer, in depth, that the ground that they lie on does not speckle them."""
LEGEND_WIDTH = 250
CARD_WIDTH, CARD_BELOW = 330, 110
"""The card of the selected run, and how far below the upper edge it is [px at interface scale 1]."""

_handles: list[object] = []
_batches: dict[str, tuple[tuple, gpu.types.GPUBatch]] = {}  # by model: what it was made of


def register() -> None:
    if bpy.app.background:
        return
    for draw, when in ((_draw_paths, "POST_VIEW"), (_draw_legend, "POST_PIXEL")):
        _handles.append(bpy.types.SpaceView3D.draw_handler_add(draw, (), "WINDOW", when))


def unregister() -> None:
    _batches.clear()
    while _handles:
        bpy.types.SpaceView3D.draw_handler_remove(_handles.pop(), "WINDOW")


def _shown(context: bpy.types.Context) -> bool:
    settings = context.scene.rockfall_simulation
    return settings.show_paths and context.space_data.overlay.show_overlays


@problems.guarded
def _draw_paths() -> None:
    context = bpy.context
    if not _shown(context):
        return
    scene, scale = context.scene, context.preferences.system.ui_scale
    objects = simulation.paths_of(scene)
    for model in _batches.keys() - {simulation.model_of(obj) for obj in objects}:
        del _batches[model]
    if not objects:
        return
    gpu.state.blend_set("ALPHA")
    gpu.state.depth_test_set("LESS_EQUAL")
    gpu.state.depth_mask_set(False)
    with gpu.matrix.push_pop_projection():
        matrix = gpu.matrix.get_projection_matrix()
        matrix[2] -= NEARER * matrix[3]
        gpu.matrix.load_projection_matrix(matrix)
        for obj in objects:
            _polylines(_batch_of(scene, obj), WIDTH_PX * scale)
    chosen = simulation.selected_line(scene)
    if chosen is not None:
        _draw_selected(chosen, scale)
    gpu.state.depth_test_set("NONE")
    gpu.state.blend_set("NONE")


def _polylines(batch: gpu.types.GPUBatch, width: float) -> None:
    shader = gpu.shader.from_builtin("POLYLINE_SMOOTH_COLOR")
    shader.uniform_float("lineWidth", width)
    shader.uniform_float("viewportSize", gpu.state.viewport_get()[2:])
    batch.draw(shader)


def _batch_of(scene: bpy.types.Scene, obj: bpy.types.Object) -> gpu.types.GPUBatch:
    """The lines of one model, made once until their places or colours change."""
    settings, tops = scene.rockfall_simulation, simulation.scale_tops(scene)
    model = simulation.model_of(obj)
    key = obj.data.session_uid, len(obj.data.points), settings.colour_by, tops
    known = _batches.get(model)
    if known is None or known[0] != key:
        lines = simulated_paths.lines_of(obj)
        known = _batches[model] = key, _batch(lines, simulated_paths.colours_of(lines, settings.colour_by, *tops))
    return known[1]


def _batch(lines: simulated_paths.Lines, colours: np.ndarray) -> gpu.types.GPUBatch:
    begins = np.ones(len(lines.position), dtype=bool)
    begins[lines.first[1:] - 1] = False
    start = np.flatnonzero(begins)
    opacity = np.interp(np.log(len(lines.first) - 1), np.log([50, MANY]), [ALONE, FAINTEST])
    shader = gpu.shader.from_builtin("POLYLINE_SMOOTH_COLOR")
    values = {
        "pos": np.ascontiguousarray(lines.position, dtype=np.float32),
        "color": np.ascontiguousarray(np.column_stack([colours, np.full(len(colours), opacity)]), dtype=np.float32),
    }
    return batch_for_shader(shader, "LINES", values, indices=np.column_stack([start, start + 1]).astype(np.int32))


def _draw_selected(points: np.ndarray, scale: float) -> None:
    """In the colour of what is active, on black, also where the terrain hides it, then fainter."""
    active = tuple(bpy.context.preferences.themes[0].view_3d.object_active[:3])
    shader = gpu.shader.from_builtin("POLYLINE_UNIFORM_COLOR")
    batch = batch_for_shader(shader, "LINE_STRIP", {"pos": np.ascontiguousarray(points, dtype=np.float32)})
    for test, opacity in (("NONE", 0.35), ("LESS_EQUAL", 1.0)):
        gpu.state.depth_test_set(test)
        for width, colour in ((SELECTED_PX + 2.5, (0.0, 0.0, 0.0)), (SELECTED_PX, active)):
            shader.uniform_float("lineWidth", width * scale)
            shader.uniform_float("viewportSize", gpu.state.viewport_get()[2:])
            shader.uniform_float("color", (*colour, opacity))
            batch.draw(shader)


def _draw_numbers(context: bpy.types.Context, rows: list[tuple[str, str]]) -> None:
    """What is known of the selected run, on a card in the upper left corner."""
    scale, theme = context.preferences.system.ui_scale, context.preferences.themes[0].user_interface
    step, width = 1.5 * legend.TEXT * scale, CARD_WIDTH * scale
    left = legend.MARGIN * scale + legend.covered_left(context.area)
    top = context.region.height - CARD_BELOW * scale
    bottom = top - (len(rows) + 0.6) * step
    shader = gpu.shader.from_builtin("UNIFORM_COLOR")
    gpu.state.blend_set("ALPHA")
    shader.uniform_float("color", (*theme.panel_back[:3], 0.9))
    corners = [(left, bottom), (left + width, bottom), (left, top), (left + width, top)]
    batch_for_shader(shader, "TRI_STRIP", {"pos": corners}).draw(shader)
    blf.size(0, legend.TEXT * scale)
    blf.color(0, *theme.panel_text[:3], 1.0)
    for i, (name, value) in enumerate(rows):
        y = round(top - (i + 1.1) * step)
        legend.text(round(left + 0.5 * step), y, name)
        legend.text(round(left + 0.5 * width), y, value)
    gpu.state.blend_set("NONE")


@problems.guarded
def _draw_legend() -> None:
    context = bpy.context
    scene = context.scene
    objects = simulation.paths_of(scene)
    rows = simulation.selected_run(scene)
    if rows is not None and _shown(context):
        _draw_numbers(context, rows)
    if not objects or not scene.rockfall.show_legend or not context.space_data.overlay.show_overlays:
        return
    settings, scale = scene.rockfall_simulation, context.preferences.system.ui_scale
    left = context.region.width - legend.covered_right(context.area) - (LEGEND_WIDTH + legend.MARGIN) * scale
    left = max(left, legend.covered_left(context.area) + legend.MARGIN * scale)
    speed_top, energy_top = simulation.scale_tops(scene)
    legend.begin(scale)
    if settings.colour_by == "MODEL" or not settings.show_paths:
        models = [(MODELS[simulation.model_of(obj)], len(obj.data.curves)) for obj in objects]
        rows = [(f"{model.title}: {count}", model.colour) for model, count in models]
        measured = store.has_role(scene, store.BLOCK_ROLE)
        if measured:
            rows.insert(0, ("measured", MEASURED_COLOUR))
        legend.swatches(left, scale, rows, f"{'Measured and simulated' if measured else 'Simulated'} blocks")
    elif settings.colour_by == "SPEED":
        legend.bar(left, scale, speed_top, "Simulated: speed [m/s]")
    else:
        legend.bar(left, scale, energy_top, "Simulated: kinetic energy [kJ]")
    legend.end()
