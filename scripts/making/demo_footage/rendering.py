# SPDX-License-Identifier: GPL-3.0-or-later
"""The scene becomes pictures: a still of all that stands, the frames painted with it, and the film."""

from pathlib import Path

import bpy
import cv2
import numpy as np
from bpy_extras.object_utils import world_to_camera_view
from mathutils import Matrix, Vector
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from . import materials, scene, shot

Array = NDArray[np.float64]

PATCH_SAMPLES = 16
STILL_SAMPLES = 16
STILL_FOCAL_PX = 1.5 * shot.FOCAL_PX
STILL_MARGIN_PX = 90.0
"""The still that all frames are painted with: sharper than a frame, and wider than all that they see, by a margin."""

PATCH_PX = 64
NOISE_LEVELS = 1.2
QUALITY = "MEDIUM"


def render_still(stage: bpy.types.Scene, take: shot.Shot, path: Path) -> None:
    """All that stands still, once, with sun, shadows and skylight, as seen from the middle of the camera's path."""
    rotation, (left, right, top, bottom) = _still_view(take)
    lens = bpy.data.cameras.new("Still")
    eye = bpy.data.objects.new("Still", lens)
    stage.collection.objects.link(eye)
    eye.matrix_world = _pose(take.local(np.array(shot.EYE_GULLY)), rotation)
    width, height = round(right - left), round(bottom - top)
    lens.sensor_fit, lens.sensor_width = "HORIZONTAL", 36.0
    lens.lens = STILL_FOCAL_PX * 36.0 / width
    lens.shift_x, lens.shift_y = (left + right) / 2.0 / width, -(top + bottom) / 2.0 / width
    moving = [each for each in stage.objects if each.name.split(".")[0] in ("Block", "Dust")]
    for each in moving:
        each.hide_render = True
    render, before = stage.render, (stage.render.resolution_x, stage.render.resolution_y, stage.camera)
    render.resolution_x, render.resolution_y, stage.camera = width, height, eye
    render.use_motion_blur, stage.cycles.samples = False, STILL_SAMPLES
    render.image_settings.color_depth, render.filepath = "16", str(path)
    bpy.ops.render.render(write_still=True)
    render.resolution_x, render.resolution_y, stage.camera = before
    render.use_motion_blur, stage.cycles.samples, render.image_settings.color_depth = True, scene.SAMPLES, "8"
    for each in moving:
        each.hide_render = False
    bpy.data.objects.remove(eye)


def paint(stage: bpy.types.Scene, take: shot.Shot, still: Path) -> None:
    """Give all that stands still the colours of the still, from where it was taken: no light has to be traced again."""
    rotation, bounds = _still_view(take)
    eye = bpy.data.objects.new("Still eye", None)
    stage.collection.objects.link(eye)
    eye.matrix_world = _pose(take.local(np.array(shot.EYE_GULLY)), rotation)
    painted = materials.painted(eye, _shadow_axis(stage, take), bounds, STILL_FOCAL_PX, still, take.radius)
    for name in ("Terrain", "Around", "Scrub", "Stones"):
        bpy.data.objects[name].data.materials[0] = painted


def render_frame(stage: bpy.types.Scene, frame: int, path: Path, pixel: Array) -> None:
    """One frame as a PNG: the whole with few samples, what is near the block with more, and a sensor's noise."""
    image = _rendered(stage, frame, path, scene.SAMPLES)
    left, top = (int(value) - PATCH_PX for value in pixel)
    right, bottom = min(left + 2 * PATCH_PX, shot.WIDTH), min(top + 2 * PATCH_PX, shot.HEIGHT)
    left, top = max(left, 0), max(top, 0)
    if right - left > 8 and bottom - top > 8:
        render = stage.render
        render.use_border = render.use_crop_to_border = True
        # a hair inside the pixel, or rounding may take the one before
        render.border_min_x, render.border_max_x = (left + 0.01) / shot.WIDTH, (right + 0.01) / shot.WIDTH
        render.border_min_y = (shot.HEIGHT - bottom + 0.01) / shot.HEIGHT
        render.border_max_y = (shot.HEIGHT - top + 0.01) / shot.HEIGHT
        patch = _rendered(stage, frame, path, PATCH_SAMPLES)
        render.use_border = render.use_crop_to_border = False
        image[top:bottom, left:right] = patch
    noise = np.random.default_rng([shot.SEED, frame]).normal(0.0, NOISE_LEVELS, image.shape)
    cv2.imwrite(str(path), np.clip(np.rint(image + noise), 0, 255).astype(np.uint8))


def encode(frames: Path, out: Path) -> None:
    """The frames as H.264 in MP4, by Blender's sequencer."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    stage = bpy.context.scene
    render, strips = stage.render, stage.sequence_editor_create().strips
    names = [f"{frame:04d}.png" for frame in range(shot.FRAMES)]
    strip = strips.new_image("Frames", str(frames / names[0]), channel=1, frame_start=1)
    for name in names[1:]:
        strip.elements.append(name)
    stage.frame_start, stage.frame_end = 1, shot.FRAMES
    render.fps, render.fps_base = shot.FPS, 1.0
    render.resolution_x, render.resolution_y, render.resolution_percentage = shot.WIDTH, shot.HEIGHT, 100
    stage.view_settings.view_transform, stage.view_settings.look = "Standard", "None"
    render.filepath, render.use_file_extension = str(out), True
    render.image_settings.media_type = "VIDEO"
    movie = render.ffmpeg
    movie.format, movie.codec, movie.audio_codec = "MPEG4", "H264", "NONE"
    movie.constant_rate_factor, movie.ffmpeg_preset, movie.gopsize = QUALITY, "GOOD", shot.FPS
    bpy.ops.render.render(animation=True)


def check_projection(stage: bpy.types.Scene, take: shot.Shot, points: Array) -> float:
    """The largest difference [px] between this script's projection and Blender's, over points and some frames."""
    worst = 0.0
    for frame in range(0, shot.FRAMES, 23):
        stage.frame_set(frame)
        position, rotation = (one[0] for one in shot.camera_path(take, np.array([frame / shot.FPS])))
        centre = shot.block_centre(take, np.array([frame / shot.FPS]))
        own = shot.projected(np.concatenate([points, centre]), position, rotation)
        block = np.array(bpy.data.objects["Block"].matrix_world.translation)
        seen = [world_to_camera_view(stage, stage.camera, Vector(point)) for point in [*points, block]]
        theirs = np.array([[one.x * shot.WIDTH, (1.0 - one.y) * shot.HEIGHT] for one in seen])
        worst = max(worst, float(np.abs(own - theirs).max()))
    return worst


def _still_view(take: shot.Shot) -> tuple[Array, tuple[float, float, float, float]]:
    """Rotation of the still's camera, and its bounds (left, right, top, bottom) about the axis in its pixels."""
    _, rotations = shot.camera_path(take, np.arange(shot.FRAMES) / shot.FPS)
    middle = Rotation.from_matrix(rotations).mean().as_matrix()
    corners = np.array([[u, v, shot.FOCAL_PX] for u in (-1, 1) for v in (-1, 1)], float)
    corners[:, :2] *= np.array([shot.WIDTH, shot.HEIGHT]) / 2.0
    seen = np.einsum("ij,fkj,ck->fci", middle, rotations, corners).reshape(-1, 3)
    pixels = STILL_FOCAL_PX * seen[:, :2] / seen[:, 2:]
    low = np.floor(pixels.min(axis=0) - STILL_MARGIN_PX)
    high = np.ceil(pixels.max(axis=0) + STILL_MARGIN_PX)
    return middle, (low[0], high[0], low[1], high[1])


def _pose(position: Array, rotation: Array) -> Matrix:
    """Blender's matrix of a camera, which looks along -z with y up."""
    matrix = np.eye(4)
    matrix[:3, :3] = rotation.T @ np.diag([1.0, -1.0, -1.0])
    matrix[:3, 3] = position
    return Matrix(matrix.tolist())


def _shadow_axis(stage: bpy.types.Scene, take: shot.Shot) -> bpy.types.Object:
    """An empty that goes with the block, its z towards the sun."""
    axis = bpy.data.objects.new("Shadow", None)
    stage.collection.objects.link(axis)
    axis.rotation_euler = Vector(take.turned(np.array(scene.SUN_GULLY))).to_track_quat("Z", "Y").to_euler()
    times, frames = scene.exposures()
    scene.set_keys(axis, "location", frames, shot.block_centre(take, times))
    return axis


def _rendered(stage: bpy.types.Scene, frame: int, path: Path, samples: int) -> NDArray[np.uint8]:
    stage.frame_set(frame)
    stage.cycles.samples, stage.cycles.seed = samples, frame
    stage.render.filepath = str(path.with_name("rendering.png"))
    bpy.ops.render.render(write_still=True)
    return cv2.imread(stage.render.filepath)
