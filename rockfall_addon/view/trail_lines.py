# SPDX-License-Identifier: GPL-3.0-or-later
"""The flights in the 3-D view as lines of the same width on the screen at every distance, faint where they are hidden.

The tubes of geometry, which renders show, are thinner than a pixel from afar. What was read of a mesh is kept until
Blender says that it has changed, batches until any of the lines has.
"""

from dataclasses import dataclass, field
from functools import cached_property

import bpy
import gpu
import numpy as np
from gpu_extras.batch import batch_for_shader

from ...core.vectors import Array
from ..scene import problems
from ..scene.storage import materials, store
from . import pointing

WIDTH, FAINT = 2.5, 0.35  # [px at interface scale 1]; opacity of what the terrain hides
NEARER = 2e-3
"""Lines are drawn so much nearer, in parts of the view's near limit, that the ground they lie on does not cut them."""


@dataclass(frozen=True, eq=False)
class Trail:
    """Of the flights in a mesh: points (n, 3), their sRGB colours (n, 4), display times (n,) [s], segments (k, 2)."""

    mesh: str
    position: Array
    colour: Array
    time_s: Array
    segment: np.ndarray


@dataclass(frozen=True, eq=False)
class Trails:
    """All flights of a scene that are seen, as one trail."""

    parts: tuple[Trail, ...]
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


_read: dict[str, Trail] = {}
"""By the object's name, while neither it nor its mesh changes."""
_kept: dict[int, Trails] = {}
_looked: set[int] = set()
"""Scenes in which nothing at all has happened since."""
_handles: list[object] = []


def forget() -> None:
    """Anything may have changed: flights are read again when they are drawn next."""
    _read.clear()
    _kept.clear()
    _looked.clear()


def notice(depsgraph: bpy.types.Depsgraph) -> None:
    """From Blender's list of updates, find which flights are to be read again."""
    changed = {
        update.id.name
        for update in depsgraph.updates
        if isinstance(update.id, bpy.types.Mesh)
        or (isinstance(update.id, bpy.types.Object) and update.is_updated_geometry)
    }
    for name in [name for name, trail in _read.items() if name in changed or trail.mesh in changed]:
        del _read[name]
    _looked.clear()


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
    trails = trails_of(scene)
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


def trails_of(scene: bpy.types.Scene) -> Trails:
    """What is shown of the flights of blocks and of models."""
    key = scene.session_uid
    if key in _looked:
        return _kept[key]
    found = store.by_role(scene, store.FLIGHTS_ROLE, store.MODEL_FLIGHTS_ROLE)
    shown = [obj for each in found for obj in sorted(each, key=lambda one: one.name) if obj.visible_get()]
    parts = tuple(trail for obj in shown if (trail := _trail(obj)) is not None)
    if key not in _kept or _kept[key].parts != parts:
        _kept[key] = _joined(parts)
    _looked.add(key)
    return _kept[key]


def _trail(obj: bpy.types.Object) -> Trail | None:
    """The flights in an object's mesh; None when they have no times or colours yet."""
    mesh = obj.data
    if not {materials.SPEED_COLOUR, materials.TIME_ATTRIBUTE} <= set(mesh.attributes.keys()):
        return None
    kept = _read.get(obj.name)
    if kept is not None and kept.mesh == mesh.name:
        return kept
    points, edges = len(mesh.vertices), len(mesh.edges)
    position, colour = np.empty(3 * points, dtype=np.float32), np.empty(4 * points, dtype=np.float32)
    time, segment = np.empty(points, dtype=np.float32), np.empty(2 * edges, dtype=np.int32)
    mesh.vertices.foreach_get("co", position)
    mesh.attributes[materials.SPEED_COLOUR].data.foreach_get("color_srgb", colour)
    mesh.attributes[materials.TIME_ATTRIBUTE].data.foreach_get("value", time)
    mesh.edges.foreach_get("vertices", segment)
    _read[obj.name] = Trail(mesh.name, position.reshape(-1, 3), colour.reshape(-1, 4), time, segment.reshape(-1, 2))
    return _read[obj.name]


def _joined(parts: tuple[Trail, ...]) -> Trails:
    if not parts:
        nothing = np.zeros((0, 4), dtype=np.float32)
        return Trails((), nothing[:, :3], nothing, nothing[:, 0], np.zeros((0, 2), dtype=np.int32))
    starts = np.cumsum([0, *(len(part.time_s) for part in parts)])
    return Trails(
        parts,
        np.concatenate([part.position for part in parts]),
        np.concatenate([part.colour for part in parts]),
        np.concatenate([part.time_s for part in parts]),
        np.concatenate([part.segment + start for part, start in zip(parts, starts, strict=False)]).astype(np.int32),
    )
