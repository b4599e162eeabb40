# SPDX-License-Identifier: GPL-3.0-or-later
"""The tables beside the film: survey targets and clicks as measured in it, and the truth."""

from pathlib import Path

import cv2
import numpy as np
from mathutils.bvhtree import BVHTree
from numpy.typing import NDArray

from ..demo_site.make import TRUTH_COLUMNS, write_csv
from . import shot, sight

Array = NDArray[np.float64]

REFERENCE_FRAMES = {"pairs.csv": 0, "pairs_middle.csv": 90}
"""The frame that each table of ground control is measured in."""

EDGE_PX = 20.0
SURVEY_NOISE_M = 0.01
CLICK_NOISE_PX = 1.2
CLICK_FRAMES = (54, 75)


def write(take: shot.Shot, tree: BVHTree, targets: Array, film: Path, shift: tuple[float, float, float]) -> None:
    """All tables, into the film's folder and ``truth`` in it."""
    folder, truth = film.parent, film.parent / "truth"
    truth.mkdir(exist_ok=True)
    for name, frame in REFERENCE_FRAMES.items():
        write_pairs(folder / name, take, targets, film, frame, shift)
    write_clicks(folder / "clicks.csv", take)
    write_camera(truth / "camera.csv", take, shift)
    write_block(truth / "block.csv", take, tree, shift)
    write_impacts(truth / "impacts.csv", take, shift)


def block_pixels(take: shot.Shot) -> Array:
    """Where the block's centre is in each frame (FRAMES, 2)."""
    times = shot.frame_times()
    return shot.projected(shot.block_centre(take, times), *shot.camera_path(take, times))


def write_pairs(
    path: Path, take: shot.Shot, targets: Array, film: Path, frame: int, shift: tuple[float, float, float]
) -> None:
    """Survey coordinates to the centimetre; pixels are the centres of the orange blobs in the film's own picture."""
    rng = np.random.default_rng([shot.SEED, 1])  # the same survey for each frame
    image = decoded(film, frame).astype(float)
    position, rotation = (one[0] for one in shot.camera_path(take, np.array([frame / shot.FPS])))
    true = shot.projected(targets, position, rotation)
    surveyed = targets + SURVEY_NOISE_M * rng.standard_normal(targets.shape) + np.array(shift)
    rows = []
    for number, (pixel, place) in enumerate(zip(true, surveyed, strict=True), 1):
        if not np.all((pixel > EDGE_PX) & (pixel < np.array([shot.WIDTH, shot.HEIGHT]) - EDGE_PX)):
            continue
        click = np.rint(pixel + rng.uniform(-4.0, 4.0, 2))
        u, v = orange_centre(image, click)
        rows.append([f"{u:.2f}", f"{v:.2f}", *(f"{value:.2f}" for value in place), f"T{number:02d}"])
    write_csv(path, ("u_px", "v_px", "x_m", "y_m", "z_m", "name"), rows)


def orange_centre(image: Array, click: Array, reach: int = 13) -> Array:
    """Centre (2,) of the orange blob near a click: the mean pixel, weighted by how much more red than blue there is."""
    left, top = (int(value) - reach for value in click)
    window = image[top : top + 2 * reach + 1, left : left + 2 * reach + 1]
    weight = np.clip(window[..., 2] - window[..., 0] - 60.0, 0.0, 60.0)
    rows, columns = np.indices(weight.shape)
    centre = [(weight * columns).sum() / weight.sum(), (weight * rows).sum() / weight.sum()]
    return np.array([left, top]) + np.array(centre) + 0.5


def write_clicks(path: Path, take: shot.Shot) -> None:
    """Rough clicks on the block: the truth, moved by about a pixel, rounded to whole pixels."""
    rng = np.random.default_rng([shot.SEED, 2])
    pixels = block_pixels(take)
    rows = []
    for frame in CLICK_FRAMES:
        noise = np.clip(rng.normal(0.0, CLICK_NOISE_PX, 2), -2.0, 2.0)
        u, v = np.rint(pixels[frame] + noise).astype(int)
        rows.append([shot.BLOCK, str(frame), str(u), str(v)])
    write_csv(path, ("trajectory", "frame", "u_px", "v_px"), rows)


def write_camera(path: Path, take: shot.Shot, shift: tuple[float, float, float]) -> None:
    """Pose and intrinsics of every frame."""
    times = shot.frame_times()
    positions, rotations = shot.camera_path(take, times)
    lens = [f"{shot.FOCAL_PX:g}"] * 2 + [f"{shot.WIDTH / 2:g}", f"{shot.HEIGHT / 2:g}"]
    rows = [
        [
            *(str(frame), f"{time:.9f}"),
            *(f"{value:.6f}" for value in position + np.array(shift)),
            *(f"{value:.12f}" for value in rotation.ravel()),
            *lens,
        ]
        for frame, (time, position, rotation) in enumerate(zip(times, positions, rotations, strict=True))
    ]
    matrix = tuple(f"r{i}{j}" for i in range(1, 4) for j in range(1, 4))
    write_csv(path, ("frame", "time_s", "x_m", "y_m", "z_m", *matrix, "fx_px", "fy_px", "cx_px", "cy_px"), rows)


def write_block(path: Path, take: shot.Shot, tree: BVHTree, shift: tuple[float, float, float]) -> None:
    """The block's centre in every frame, in space and in the picture, and whether it can be seen."""
    times = shot.frame_times()
    centres = shot.block_centre(take, times)
    positions, _ = shot.camera_path(take, times)
    rows = []
    for frame, (centre, eye, pixel) in enumerate(zip(centres, positions, block_pixels(take), strict=True)):
        inside = bool(np.all((pixel > 0) & (pixel < (shot.WIDTH, shot.HEIGHT))))
        seen = inside and sight.is_clear(tree, eye, centre, 1.2 * take.radius)
        place = (f"{value:.6f}" for value in centre + np.array(shift))
        rows.append([str(frame), f"{times[frame]:.9f}", *(f"{value:.4f}" for value in pixel), *place, str(int(seen))])
    write_csv(path, ("frame", "time_s", "u_px", "v_px", "x_m", "y_m", "z_m", "visible"), rows)


def write_impacts(path: Path, take: shot.Shot, shift: tuple[float, float, float]) -> None:
    """The impacts while the camera ran, as in the demo site's truth.csv but with times on the video's clock."""

    def place(gully: Array) -> list[str]:
        return [f"{value:.6f}" for value in take.local(gully) + np.array(shift)]

    def vector(gully: Array) -> list[str]:
        return [f"{value:.9f}" for value in take.turned(gully)]

    rows = [
        [
            *(shot.BLOCK, str(number), f"{impact.time - shot.START_S:.9f}"),
            *(*place(impact.centre), *place(impact.contact), *vector(impact.normal)),
            *(*vector(impact.v1), *vector(impact.v2), *vector(impact.omega1), *vector(impact.omega2)),
            *vector(impact.effective_normal),
            *(str(impact.contacts), f"{impact.leave_time - shot.START_S:.9f}", *place(impact.leave_centre)),
            *(f"{2.0 * take.radius:.6f}", "ok", str(known) if known else ""),
        ]
        for number, (impact, known) in enumerate(zip(take.impacts, take.known, strict=True), 1)
    ]
    write_csv(path, (*TRUTH_COLUMNS, "campaign_impact"), rows)


def decoded(film: Path, frame: int) -> NDArray[np.uint8]:
    """One frame of the film (height, width, 3), blue first."""
    video = cv2.VideoCapture(str(film))
    for _ in range(frame + 1):
        good, image = video.read()
        if not good:
            raise RuntimeError(f"{film.name} has no frame {frame}")
    video.release()
    return image
