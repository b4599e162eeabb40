# SPDX-License-Identifier: GPL-3.0-or-later
"""Cameras there and back through Blender's lens; Blender itself judges in tests/blender/test_camera_lens.py."""

from dataclasses import replace

import numpy as np
import pytest
from rockfall.core.camera.blender_lens import (
    BlenderLens,
    from_blender_lens,
    pose_from_blender,
    pose_to_blender,
    to_blender_lens,
)
from rockfall.core.camera.model import Camera, look_at
from rockfall.core.errors import InputError


@pytest.mark.parametrize(("width", "height"), [(1920, 1080), (1080, 1920), (3000, 3000)])
@pytest.mark.parametrize(("fx", "fy"), [(1500, 1500), (1500, 1400), (1400, 1500)])
def test_cameras_come_back(width: int, height: int, fx: float, fy: float) -> None:
    camera = Camera(width, height, fx, fy, width / 2 + 31.0, height / 2 - 17.5)
    back = from_blender_lens(to_blender_lens(camera, 23.5), width, height)
    np.testing.assert_allclose(back.intrinsics, camera.intrinsics, rtol=1e-14)


@pytest.mark.parametrize("fit", ["AUTO", "HORIZONTAL", "VERTICAL"])
@pytest.mark.parametrize(("width", "height"), [(1920, 1080), (1080, 1920)])
@pytest.mark.parametrize(("aspect_x", "aspect_y"), [(1.0, 1.0), (1.0, 1.5), (2.0, 1.0)])
def test_every_fit_has_the_same_camera_fitted_to_the_width(
    fit: str, width: int, height: int, aspect_x: float, aspect_y: float
) -> None:
    lens = BlenderLens(35.0, 36.0, 24.0, fit, 0.05, -0.08, aspect_x, aspect_y)
    camera = from_blender_lens(lens, width, height)
    again = from_blender_lens(to_blender_lens(camera), width, height)
    np.testing.assert_allclose(again.intrinsics, camera.intrinsics, rtol=1e-13)


def test_a_50_mm_lens_on_36_mm() -> None:
    camera = from_blender_lens(BlenderLens(50.0), 3600, 2400)
    np.testing.assert_allclose(camera.intrinsics[:4], [5000, 5000, 1800, 1200])
    np.testing.assert_array_equal(camera.rotation @ [0, 0, -1], [0, 0, 1])


def test_square_pixels_keep_the_horizontal_focal_length() -> None:
    camera = Camera(1920, 1080, 1500, 1450, 960, 500)
    back = from_blender_lens(to_blender_lens(camera, square_pixels=True), 1920, 1080)
    np.testing.assert_allclose(back.intrinsics[:4], [1500, 1500, 960, 500])


def test_poses_come_back() -> None:
    camera = look_at(1920, 1080, (3, -7, 12), (40, 60, -5), fov_deg=40)
    matrix = pose_to_blender(camera.position, camera.rotation)
    np.testing.assert_allclose(matrix[:3, :3] @ [0, 0, -1], camera.rotation[2], atol=1e-15)
    single = (matrix @ np.diag([2.0, 2.0, 2.0, 1.0])).astype(np.float32)
    position, rotation = pose_from_blender(single)
    np.testing.assert_allclose(position, camera.position, atol=1e-6)
    np.testing.assert_allclose(rotation, camera.rotation, atol=1e-6)
    replace(camera, rotation=rotation)
    stack = pose_to_blender(np.stack([camera.position] * 4), np.stack([camera.rotation] * 4))
    np.testing.assert_array_equal(stack[2], matrix)


def test_nonsense_is_refused() -> None:
    with pytest.raises(InputError, match="sensor fit"):
        from_blender_lens(BlenderLens(50.0, sensor_fit="DIAGONAL"), 100, 100)
    with pytest.raises(InputError, match="without length"):
        pose_from_blender(np.diag([1.0, 0.0, 1.0, 1.0]))
