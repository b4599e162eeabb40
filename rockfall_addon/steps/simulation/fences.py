# SPDX-License-Identifier: GPL-3.0-or-later
"""Screens and barriers over the 3-D view: fences of their height, from the terrain up."""

import bpy
import gpu
import numpy as np
from gpu_extras.batch import batch_for_shader

from ....core.errors import RockfallError
from ....core.vectors import Array
from ...scene import problems
from ...scene.simulation import screens, simulation_setup
from ...scene.storage import fingerprints, store

MEASURES, HOLDS = (0.88, 0.89, 0.92), (1.0, 0.36, 0.78)
"""Colours of a screen, and of a barrier of which nothing is known; no model has them."""
JUDGED = {"enough": (0.25, 0.8, 0.4), "not_enough": (0.95, 0.25, 0.2), "not_known": HOLDS}
"""Green is a barrier that is enough, red one that is not."""
FILL, FAINT = 0.25, 0.3
"""Opacity of the area; of the lines where the terrain hides them."""
WIDTH_PX, POST_M = 2.2, 5.0
NEARER = 2e-5
"""Lines are drawn so much nearer, in depth, that the ground that they lie on does not speckle them."""

_handles: list[object] = []
_feet: dict[str, tuple[object, Array]] = {}  # by a screen's id: what its foot was looked up for, the foot


def register() -> None:
    if not bpy.app.background:
        _handles.append(bpy.types.SpaceView3D.draw_handler_add(_draw, (), "WINDOW", "POST_VIEW"))


def unregister() -> None:
    _feet.clear()
    while _handles:
        bpy.types.SpaceView3D.draw_handler_remove(_handles.pop(), "WINDOW")


@problems.guarded
def _draw() -> None:
    context = bpy.context
    scene = context.scene
    if not context.space_data.overlay.show_overlays or not store.has_role(scene, store.SCREEN_ROLE):
        return
    results = simulation_setup.screen_results(scene)
    shown = [obj for obj in screens.objects_of(scene) if obj.visible_get()]
    for key in _feet.keys() - {obj[store.ID] for obj in shown}:
        del _feet[key]
    scale = context.preferences.system.ui_scale
    gpu.state.blend_set("ALPHA")
    gpu.state.depth_mask_set(False)
    with gpu.matrix.push_pop_projection():
        matrix = gpu.matrix.get_projection_matrix()
        matrix[2] -= NEARER * matrix[3]
        gpu.matrix.load_projection_matrix(matrix)
        for obj in shown:
            foot = _foot(scene, obj)
            if len(foot) > 1:
                _draw_fence(foot, obj.rockfall_screen.height_m, _colour(obj, results), scale)
    gpu.state.depth_test_set("NONE")
    gpu.state.blend_set("NONE")


def _foot(scene: bpy.types.Scene, obj: bpy.types.Object) -> Array:
    """(q, 3) the foot of a screen, looked up again when its line or the terrain changes; none where it is no line."""
    try:
        line = screens.line_of(obj)
        key = (line.tobytes(), fingerprints.ground(scene))
        known = _feet.get(obj[store.ID])
        if known is None or known[0] != key:
            known = _feet[obj[store.ID]] = key, screens.fence(scene, obj)
        return known[1]
    except RockfallError:
        return np.zeros((0, 3))


def _colour(obj: bpy.types.Object, results: list[dict[str, object]]) -> tuple[float, float, float]:
    """Of a screen or barrier: green only where the barrier as it stands was found to be enough."""
    if not obj.rockfall_screen.holds:
        return MEASURES
    return JUDGED.get(screens.verdict_of(results, screens.screen_of(obj)), HOLDS)


def _draw_fence(foot: Array, height_m: float, colour: tuple[float, float, float], scale: float) -> None:
    """The area from the foot up, its two edges, and posts."""
    there = np.isfinite(foot).all(axis=1)
    top = foot + np.array([0.0, 0.0, height_m])
    pairs = np.flatnonzero(there[:-1] & there[1:])
    if not pairs.size:
        return
    along = np.r_[0.0, np.cumsum(np.hypot(*np.diff(foot[:, :2], axis=0).T))]
    count = max(round(along[-1] / POST_M), 1)
    posts = np.unique(np.searchsorted(along, np.linspace(0.0, along[-1], count + 1)).clip(max=len(foot) - 1))
    posts = posts[there[posts]]
    quads = np.stack([foot[pairs], foot[pairs + 1], top[pairs + 1], foot[pairs], top[pairs + 1], top[pairs]], axis=1)
    lines = np.concatenate(
        [
            np.stack([foot[pairs], foot[pairs + 1]], axis=1),
            np.stack([top[pairs], top[pairs + 1]], axis=1),
            np.stack([foot[posts], top[posts]], axis=1),
        ]
    )
    gpu.state.depth_test_set("LESS_EQUAL")
    shader = gpu.shader.from_builtin("UNIFORM_COLOR")
    shader.uniform_float("color", (*colour, FILL))
    batch_for_shader(shader, "TRIS", {"pos": quads.reshape(-1, 3).astype(np.float32)}).draw(shader)
    shader = gpu.shader.from_builtin("POLYLINE_UNIFORM_COLOR")
    batch = batch_for_shader(shader, "LINES", {"pos": lines.reshape(-1, 3).astype(np.float32)})
    for test, opacity in (("NONE", FAINT), ("LESS_EQUAL", 1.0)):
        gpu.state.depth_test_set(test)
        shader.uniform_float("lineWidth", WIDTH_PX * scale)
        shader.uniform_float("viewportSize", gpu.state.viewport_get()[2:])
        shader.uniform_float("color", (*colour, opacity))
        batch.draw(shader)
