# SPDX-License-Identifier: GPL-3.0-or-later
"""Blender's own projection against the core's."""

from collections.abc import Callable
from itertools import product
from types import ModuleType

import bpy
import numpy as np
import pytest
from bpy_extras.object_utils import world_to_camera_view
from mathutils import Matrix, Vector

SIZES = ((1920, 1080), (1080, 1920), (640, 640))


@pytest.fixture
def camera_object() -> bpy.types.Object:
    data = bpy.data.cameras.new("c")
    obj = bpy.data.objects.new("c", data)
    bpy.context.scene.collection.objects.link(obj)
    return obj


def set_lens(obj: bpy.types.Object, lens: object, width: int, height: int) -> None:
    data, render = obj.data, bpy.context.scene.render
    data.sensor_fit, data.lens = lens.sensor_fit, lens.lens_mm
    data.sensor_width, data.sensor_height = lens.sensor_width_mm, lens.sensor_height_mm
    data.shift_x, data.shift_y = lens.shift_x, lens.shift_y
    render.resolution_x, render.resolution_y, render.resolution_percentage = width, height, 100
    render.pixel_aspect_x, render.pixel_aspect_y = lens.aspect_x, lens.aspect_y


def test_projection_matrix(part: Callable[[str], ModuleType], camera_object: bpy.types.Object) -> None:
    lens_part, model = part("core.camera.blender_lens"), part("core.camera.model")
    seen = np.random.default_rng(1).uniform((-1, -1, 3), (1, 1, 9), (20, 3))
    for fit, (width, height), shift, aspect in product(
        ("AUTO", "HORIZONTAL", "VERTICAL"), SIZES, ((0, 0), (0.1, -0.07)), ((1, 1), (1, 1.5), (2, 1))
    ):
        lens = lens_part.BlenderLens(35.0, 36.0, 20.0, fit, *shift, *aspect)
        set_lens(camera_object, lens, width, height)
        bpy.context.view_layer.update()
        matrix = np.array(
            camera_object.calc_matrix_camera(
                bpy.context.evaluated_depsgraph_get(), x=width, y=height, scale_x=aspect[0], scale_y=aspect[1]
            )
        )
        camera = lens_part.from_blender_lens(lens, width, height)
        world = seen * [1, 1, -1]  # in front of a Blender camera at the origin
        clip = np.column_stack([world, np.ones(len(world))]) @ matrix.T
        view = clip[:, :2] / clip[:, 3:]
        theirs = np.column_stack([(view[:, 0] + 1) / 2 * width, (1 - view[:, 1]) / 2 * height])
        np.testing.assert_allclose(model.project(camera, world), theirs, atol=2e-3, err_msg=str(lens))


def test_camera_view(part: Callable[[str], ModuleType], camera_object: bpy.types.Object) -> None:
    lens_part, model = part("core.camera.blender_lens"), part("core.camera.model")
    camera = model.look_at(1920, 1080, (3, -7, 12), (40, 60, -5), fov_deg=40)
    camera = model.with_intrinsics(camera, [1500, 1500, 990, 520, 0, 0, 0, 0, 0])
    set_lens(camera_object, lens_part.to_blender_lens(camera), 1920, 1080)
    matrix = lens_part.pose_to_blender(camera.position, camera.rotation)
    camera_object.matrix_world = Matrix(matrix.tolist())
    bpy.context.view_layer.update()
    points = np.random.default_rng(2).uniform((20, 20, -10), (60, 90, 10), (30, 3))
    views = [world_to_camera_view(bpy.context.scene, camera_object, Vector(point)) for point in points.tolist()]
    theirs = np.array([(view.x * 1920, (1 - view.y) * 1080) for view in views])
    np.testing.assert_allclose(model.project(camera, points), theirs, atol=5e-3)
