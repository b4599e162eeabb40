# SPDX-License-Identifier: GPL-3.0-or-later
"""Over the footage: paths, outlines, picks and sightings. In free views: the selected pick's ball and ellipse."""

import blf
import bpy
import gpu
import numpy as np

from ....core.errors import visible
from ...scene import problems
from ...scene.footage import clicks, videos
from ...scene.picks import picks, places, proposal
from ...scene.storage import store
from ...view import drawing, footage_view, image_view, pointing
from ...view.drawn import Drawing, Mark

_handles: list[object] = []

TEXT, BESIDE = 12, 18
ROUND = np.linspace(0.0, 2 * np.pi, 33)


def register() -> None:
    if bpy.app.background:
        return
    for function, when in ((_draw_pixels, "POST_PIXEL"), (_draw_view, "POST_VIEW")):
        _handles.append(bpy.types.SpaceView3D.draw_handler_add(function, (), "WINDOW", when))


def unregister() -> None:
    while _handles:
        bpy.types.SpaceView3D.draw_handler_remove(_handles.pop(), "WINDOW")
    footage_view.forget()


@problems.guarded
def _draw_pixels() -> None:
    context = bpy.context
    camera = pointing.solved_camera_of(context)
    if camera is None or not context.space_data.overlay.show_overlays:
        return
    rectangle = image_view.image_rectangle(context.region, context.region_data, context.scene, camera)
    if rectangle is None:
        return
    drawn = footage_view.draw(context.scene, camera, pointing.active_pick(context))
    show(drawn, rectangle, videos.size_of(camera), context.preferences.system.ui_scale)


def show(drawn: Drawing, rectangle: image_view.Rectangle, size: tuple[int, int], scale: float) -> None:
    """Draw in the region, in pixels; the picture lies in the rectangle."""
    gpu.state.blend_set("ALPHA")
    for line in drawn.lines:
        drawing.segments(image_view.to_region(rectangle, size, line.segments), line.colour, line.width * scale)
    for pixels, colours, width in drawn.dots:
        drawing.dots(image_view.to_region(rectangle, size, pixels), colours, width * scale)
    for mark in drawn.marks:
        _mark(mark, image_view.to_region(rectangle, size, mark.pixel), scale)
    gpu.state.blend_set("NONE")


@problems.guarded
def _draw_view() -> None:
    """The selected pick's ball, disc and ellipse, and the proposed flights, in space."""
    context = bpy.context
    scene = context.scene
    if not context.space_data.overlay.show_overlays or pointing.solved_camera_of(context) is not None:
        return
    scale = context.preferences.system.ui_scale
    gpu.state.blend_set("ALPHA")
    gpu.state.depth_test_set("LESS_EQUAL")
    proposed = proposal.path(scene)
    if proposed is not None:
        place, colour, joined = proposed
        first = np.flatnonzero(joined[:-1])
        pairs = np.stack([first, first + 1], axis=1)
        drawing.segments(place[pairs], np.c_[colour, np.ones(len(colour))][pairs], 2 * scale)
    obj = pointing.active_pick(context)
    if obj is not None:
        for points, colour in _solid(scene, obj):
            segments = np.stack([points[:-1], points[1:]], axis=1)
            drawing.segments(segments, np.broadcast_to([*colour, 0.9], (*segments.shape[:2], 4)), 1.5 * scale)
    gpu.state.depth_test_set("NONE")
    gpu.state.blend_set("NONE")


def _solid(scene: bpy.types.Scene, obj: bpy.types.Object) -> list[tuple[np.ndarray, tuple[float, float, float]]]:
    place = np.array(obj.location if picks.moved(obj) else obj[store.POSITION], dtype=np.float64)
    normal = np.array(obj.matrix_world.col[2].xyz, dtype=np.float64)
    normal /= np.linalg.norm(normal)
    radius = places.block_of(scene, obj[store.TRAJECTORY]).radius_m
    found = []
    if obj[store.KIND] != "pass":
        for axis in np.eye(3):  # the block's ball, tangent to the terrain
            found.append((footage_view.around(place + radius * normal, axis, radius), footage_view.OUTLINE))
    for seen in clicks.of(obj).values():
        circle = footage_view.CIRCLE[:, None]
        ellipse = place + 0.02 * normal + np.cos(circle) * seen.ellipse[0] + np.sin(circle) * seen.ellipse[1]
        found.append((ellipse, footage_view.EPIPOLAR))
    return found


def _mark(mark: Mark, at: np.ndarray, scale: float) -> None:
    size = mark.size * scale
    angles = np.linspace(0, 2 * np.pi, 5) if mark.shape == "diamond" else ROUND
    points = at + size * np.column_stack([np.cos(angles), np.sin(angles)])
    segments = np.stack([points[:-1], points[1:]], axis=1)
    for width, colour in ((4.0, (0.0, 0.0, 0.0, 0.5 * mark.colour[3])), (2.0, mark.colour)):
        drawing.segments(segments, np.broadcast_to(colour, (*segments.shape[:2], 4)), width * scale)
    if mark.text:
        blf.size(0, TEXT * scale)
        blf.color(0, 1.0, 1.0, 1.0, 1.0)
        blf.enable(0, blf.SHADOW)
        blf.shadow(0, 5, 0.0, 0.0, 0.0, 1.0)
        blf.position(0, float(at[0]) + BESIDE * scale, float(at[1]) - 4 * scale, 0)
        blf.draw(0, visible(mark.text))
        blf.disable(0, blf.SHADOW)
