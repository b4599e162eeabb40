# SPDX-License-Identifier: GPL-3.0-or-later
"""The flights in the 3-D view as lines of the same width on the screen at every distance, faint where they are hidden.

The tubes of geometry, which renders show, are thinner than a pixel from afar. Batches are kept until something changes.
"""

from dataclasses import dataclass, field
from functools import cached_property

import bpy
import gpu
import numpy as np
from gpu_extras.batch import batch_for_shader

from ...core.vectors import Array
from ..scene import materials, problems, store
from . import pointing

WIDTH, FAINT = 2.5, 0.35  # [px at interface scale 1]; opacity of what the terrain hides
NEARER = 2e-3
"""Lines are drawn so much nearer, in parts of the view's near limit, that the ground they lie on does not cut them."""


@dataclass(frozen=True, eq=False)
class Trails:
    """The points of all flights (n, 3), their sRGB colours (n, 4), display times (n,) [s], and segments (k, 2)."""

    position: Array
    colour: Array
    time_s: Array
    segment: np.ndarray
    batches: dict[float, tuple[gpu.types.GPUBatch, gpu.types.GPUBatch]] = field(default_factory=dict)

    @cached_property
    def faint(self) -> Array:
        return self.colour * np.array([1.0, 1.0, 1.0, FAINT], dtype=np.float32)

    def until(self, now_s: float) -> tuple[gpu.types.GPUBatch, gpu.types.GPUBatch]:
        """Batches of what is hidden and of what is seen, up to a time."""
        if now_s not in self.batches:
            self.batches.clear()
            shown = self.segment[self.time_s[self.segment[:, 1]] <= now_s]
            shader = gpu.shader.from_builtin("POLYLINE_SMOOTH_COLOR")
            self.batches[now_s] = tuple(
                batch_for_shader(shader, "LINES", {"pos": self.position, "color": colour}, indices=shown)
                for colour in (self.faint, self.colour)
            )
        return self.batches[now_s]


_kept: dict[int, Trails] = {}
_handles: list[object] = []


def forget() -> None:
    """Something may have changed: flights are read again when they are drawn next."""
    _kept.clear()


def register() -> None:
    if not bpy.app.background:
        _handles.append(bpy.types.SpaceView3D.draw_handler_add(_draw, (), "WINDOW", "POST_VIEW"))


def unregister() -> None:
    while _handles:
        bpy.types.SpaceView3D.draw_handler_remove(_handles.pop(), "WINDOW")
    forget()


@problems.guarded
def _draw() -> None:
    context = bpy.context
    scene, space = context.scene, context.space_data
    if not space.overlay.show_overlays or pointing.solved_camera_of(context) is not None:
        return  # over footage they are drawn in its pixels
    if scene.session_uid not in _kept:
        _kept[scene.session_uid] = _read(scene)
    trails = _kept[scene.session_uid]
    if not len(trails.segment):
        return
    now_s = np.inf
    if scene.rockfall.trail_until_now:
        now_s = (scene.frame_current + scene.frame_subframe) * scene.render.fps_base / scene.render.fps
    projection = gpu.matrix.get_projection_matrix()
    projection[2] -= NEARER * space.clip_start * projection[3]
    shader = gpu.shader.from_builtin("POLYLINE_SMOOTH_COLOR")
    shader.bind()
    shader.uniform_float("lineWidth", WIDTH * context.preferences.system.ui_scale)
    shader.uniform_float("viewportSize", gpu.state.viewport_get()[2:])
    gpu.state.blend_set("ALPHA")
    gpu.state.depth_mask_set(False)
    with gpu.matrix.push_pop_projection():
        gpu.matrix.load_projection_matrix(projection)
        for batch, test in zip(trails.until(now_s), ("NONE", "LESS_EQUAL"), strict=True):
            gpu.state.depth_test_set(test)
            batch.draw(shader)
    gpu.state.depth_test_set("NONE")
    gpu.state.blend_set("NONE")


def _read(scene: bpy.types.Scene) -> Trails:
    """What is shown of the flights of blocks and of models."""
    parts, count = [], 0
    needed = {materials.SPEED_COLOUR, materials.TIME_ATTRIBUTE}
    roles = (store.FLIGHTS_ROLE, store.MODEL_FLIGHTS_ROLE)
    for obj in (obj for role in roles for obj in store.with_role(scene, role)):
        mesh = obj.data
        if not obj.visible_get() or not needed <= set(mesh.attributes.keys()):
            continue
        points, edges = len(mesh.vertices), len(mesh.edges)
        position, colour = np.empty(3 * points, dtype=np.float32), np.empty(4 * points, dtype=np.float32)
        time, segment = np.empty(points, dtype=np.float32), np.empty(2 * edges, dtype=np.int32)
        mesh.vertices.foreach_get("co", position)
        mesh.attributes[materials.SPEED_COLOUR].data.foreach_get("color_srgb", colour)
        mesh.attributes[materials.TIME_ATTRIBUTE].data.foreach_get("value", time)
        mesh.edges.foreach_get("vertices", segment)
        parts.append((position.reshape(-1, 3), colour.reshape(-1, 4), time, segment.reshape(-1, 2) + count))
        count += points
    if not parts:
        nothing = np.zeros((0, 4), dtype=np.float32)
        return Trails(nothing[:, :3], nothing, nothing[:, 0], np.zeros((0, 2), dtype=np.int32))
    position, colour, time, segment = (np.concatenate(each) for each in zip(*parts, strict=True))
    return Trails(position, colour, time, np.ascontiguousarray(segment, dtype=np.int32))
