# SPDX-License-Identifier: GPL-3.0-or-later
"""A camera as Blender describes it: lens, sensor, shift and pixel aspect. Exact both ways, without Blender.

Blender's camera looks along −z with y up, and has no distortion: that stays with the core.
"""

from dataclasses import dataclass

import numpy as np

from ..errors import InputError
from ..georeference import GlobalShift
from ..vectors import Array
from .model import Camera

BLENDER_AXES = np.diag([1.0, -1.0, -1.0])
"""From Blender's camera axes (x right, y up, z back) to ours (x right, y down, z forward)."""


@dataclass(frozen=True)
class BlenderLens:
    """The lens of a Blender camera, with the render settings that belong to it.

    Attributes
    ----------
    lens_mm, sensor_width_mm, sensor_height_mm : [mm].
    sensor_fit : "AUTO", "HORIZONTAL" or "VERTICAL".
    shift_x, shift_y : in widths of the side that the sensor fits.
    aspect_x, aspect_y : of the pixels, `render.pixel_aspect_x` and `_y`.
    """

    lens_mm: float
    sensor_width_mm: float = 36.0
    sensor_height_mm: float = 24.0
    sensor_fit: str = "HORIZONTAL"
    shift_x: float = 0.0
    shift_y: float = 0.0
    aspect_x: float = 1.0
    aspect_y: float = 1.0


def to_blender_lens(camera: Camera, sensor_width_mm: float = 36.0, *, square_pixels: bool = False) -> BlenderLens:
    """The lens of a camera, fitted to the width of the image.

    Parameters
    ----------
    square_pixels : keep the aspect of the pixels at 1, which a scene with several cameras needs; fy is then fx.
    """
    aspect = 1.0 if square_pixels else camera.fx / camera.fy
    # Blender wants no aspect below 1.
    aspect_x, aspect_y = (1.0, aspect) if aspect >= 1 else (1.0 / aspect, 1.0)
    return BlenderLens(
        lens_mm=camera.fx * sensor_width_mm / camera.width,
        sensor_width_mm=sensor_width_mm,
        sensor_height_mm=sensor_width_mm * camera.height / camera.width * aspect_y / aspect_x,
        sensor_fit="HORIZONTAL",
        shift_x=(camera.width / 2 - camera.cx) / camera.width,
        shift_y=(camera.cy - camera.height / 2) / camera.width * aspect_y / aspect_x,
        aspect_x=aspect_x,
        aspect_y=aspect_y,
    )


def from_blender_lens(
    lens: BlenderLens,
    width: int,
    height: int,
    *,
    matrix: Array | None = None,
    shift: GlobalShift | None = None,
) -> Camera:
    """The camera of a Blender lens and image size.

    Parameters
    ----------
    matrix : (4, 4) `matrix_world` of the camera; its scale is ignored, as Blender does.
    shift : of the scene.

    Raises
    ------
    InputError : there is no such sensor fit.
    """
    if lens.sensor_fit not in ("AUTO", "HORIZONTAL", "VERTICAL"):
        raise InputError(f"“{lens.sensor_fit}” is no sensor fit", advice="Use AUTO, HORIZONTAL or VERTICAL")
    horizontal = lens.sensor_fit == "HORIZONTAL" or (
        lens.sensor_fit == "AUTO" and width * lens.aspect_x >= height * lens.aspect_y
    )
    sensor = lens.sensor_height_mm if lens.sensor_fit == "VERTICAL" else lens.sensor_width_mm
    span = width if horizontal else height * lens.aspect_y / lens.aspect_x
    aspect = lens.aspect_x / lens.aspect_y
    focal = lens.lens_mm / sensor * span
    position, rotation = (np.zeros(3), BLENDER_AXES) if matrix is None else pose_from_blender(matrix)
    return Camera(
        width=width,
        height=height,
        fx=focal,
        fy=focal * aspect,
        cx=width / 2 - lens.shift_x * span,
        cy=height / 2 + lens.shift_y * span * aspect,
        position=position,
        rotation=rotation,
        shift=shift if shift is not None else GlobalShift(),
    )


def pose_to_blender(position: Array, rotation: Array) -> Array:
    """`matrix_world` of poses: (..., 3) local [m] and (..., 3, 3) from the world to the camera → (..., 4, 4)."""
    matrix = np.zeros((*np.shape(position)[:-1], 4, 4))
    matrix[..., :3, :3] = np.swapaxes(rotation, -1, -2) @ BLENDER_AXES
    matrix[..., :3, 3] = position
    matrix[..., 3, 3] = 1.0
    return matrix


def pose_from_blender(matrix: Array) -> tuple[Array, Array]:
    """Position (3,) local [m] and rotation (3, 3) of a `matrix_world`, (4, 4); single precision is made orthogonal.

    Raises
    ------
    InputError : the matrix turns nothing: an axis has no length.
    """
    world = np.asarray(matrix, dtype=np.float64)
    length = np.sqrt((world[:3, :3] ** 2).sum(axis=0))
    if not (length > 0).all():
        raise InputError("The camera's matrix has an axis without length", advice="Clear the scale of the camera")
    left, _, right = np.linalg.svd(world[:3, :3] / length)
    turn = left @ np.diag([1.0, 1.0, np.linalg.det(left @ right)]) @ right
    return world[:3, 3].copy(), BLENDER_AXES @ turn.T
