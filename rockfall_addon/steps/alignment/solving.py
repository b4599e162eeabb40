# SPDX-License-Identifier: GPL-3.0-or-later
"""Solving a camera from its pairs, at every change of them and of what is known of its lens; or placing it by eye."""

import math
from dataclasses import replace

import bpy
import numpy as np

from ....core.camera.model import Camera, with_intrinsics
from ....core.camera.pairs import pair_residuals
from ....core.camera.path import CameraPath, bent_through, fixed
from ....core.camera.resection.problem import needed_pairs
from ....core.errors import RockfallError
from ....core.vectors import Array
from ....core.workflow.alignment import AlignmentOptions, SolvedFrames, align
from ...scene.footage import alignment, camera_paths, pairs, videos
from ...scene.footage.alignment import Solution
from ...scene.storage import store
from ...scene.terrain import georeference


def solve(scene: bpy.types.Scene, camera: bpy.types.Object) -> bool:
    """Solve the camera from its pairs and put it in its place; without enough pairs it stays where it is.

    Whether there is a solution; why not is in `alignment.solution_of`.
    """
    complete = pairs.complete_of(camera)
    try:
        aligned = align(pairs.table(complete, georeference.read_shift(scene)), _options(scene, camera))
    except RockfallError as error:
        enough = alignment.ready_pairs(scene, camera) >= needed_pairs(alignment.free_of(camera))
        check(scene, camera, Solution(problem=str(error) if enough else ""))  # too few is how everybody begins
        return False
    camera[store.PLACED] = alignment.BY_PAIRS
    camera_paths.set_camera_path(
        scene,
        camera,
        _path(camera, aligned.solved),
        rmse_px=aligned.found.rmse_px,
        pose_covariance=aligned.pose_covariance,
        quality=aligned.found.quality,
    )
    solution = Solution(
        rmse_px=aligned.found.rmse_px,
        wrong=tuple(complete[i].id for i in np.flatnonzero(aligned.wrong)),
        sigma=aligned.found.sigma,
        remarks=aligned.found.remarks,
        reference=aligned.frame,
        keys=tuple(sorted(aligned.keys)),
    )
    check(scene, camera, solution)
    return True


def _options(scene: bpy.types.Scene, camera: bpy.types.Object) -> AlignmentOptions:
    now = camera_paths.camera_path(camera).reference
    lens, free = alignment.known_lens(camera), alignment.free_of(camera)
    if "f" in free:
        lens[:2] = now.intrinsics[:2]
    start = with_intrinsics(replace(now, shift=georeference.read_shift(scene)), lens)
    return AlignmentOptions(
        size=videos.size_of(camera),
        free=free,
        start=start,
        moves=alignment.moves(camera),
        pixel_aspect=float(videos.facts_of(camera).get("pixel_aspect", 1.0)),
    )


def _path(camera: bpy.types.Object, solved: SolvedFrames) -> CameraPath:
    """The path that the camera had, bent so that it passes through the frames that are solved."""
    path = camera_paths.camera_path(camera)
    if not alignment.moves(camera) or path.is_fixed:
        return fixed(solved.camera)
    cameras = {solved.frame: solved.camera, **solved.keys}
    times = pairs.times_of(camera, cameras).tolist()
    return replace(bent_through(path, dict(zip(times, cameras.values(), strict=True))), reference=solved.camera)


def check(scene: bpy.types.Scene, camera: bpy.types.Object, solution: Solution) -> None:
    """Store a solution with the residuals of all complete pairs, counted or not, against the camera as it is now."""
    complete = pairs.complete_of(camera)
    if complete and camera_paths.is_solved(camera):
        table = pairs.table(complete, georeference.read_shift(scene))
        left, away = pair_residuals(camera_paths.camera_path(camera), table, pairs.times_of(camera, table.frame))
        names = [pair.id for pair in complete]
        solution = replace(
            solution,
            residual=dict(zip(names, map(tuple, left.tolist()), strict=True)),
            residual_m=dict(zip(names, away.tolist(), strict=True)),
        )
    alignment.keep_solution(camera, solution)
    fill_rows(camera)


def fill_rows(camera: bpy.types.Object) -> None:
    """Bring the rows that the panel lists in line with the pairs and the solution."""
    rows, marked, solution = camera.rockfall_alignment.rows, pairs.pairs_of(camera), alignment.solution_of(camera)
    while len(rows) > len(marked):
        rows.remove(len(rows) - 1)
    while len(rows) < len(marked):
        rows.add()
    for row, pair in zip(rows, marked, strict=True):
        row.pair = ""  # while it is empty the row does not answer
        row.name, row.enabled, row.colour = pair.name, pair.enabled, pair.colour
        row.frame, row.missing, row.is_wrong = pair.frame, pair.missing, pair.id in solution.wrong
        row.agreed = bool(pair.agreed)
        residual = (solution.residual or {}).get(pair.id)
        row.residual_px = math.hypot(*residual) if residual is not None else math.nan
        row.residual_m = (solution.residual_m or {}).get(pair.id, math.nan)
        row.pair = pair.id


def set_focal(scene: bpy.types.Scene, camera: bpy.types.Object, focal: float) -> None:
    """The focal length is known [px]: keep it, and solve with it."""
    lens, now = alignment.known_lens(camera), alignment.lens_of(camera)
    lens[:2] = now[:2] = focal, focal * now[1] / now[0]
    alignment.keep_lens(camera, lens)
    set_lens(scene, camera, now)


def set_lens(scene: bpy.types.Scene, camera: bpy.types.Object, values: Array) -> None:
    """Solve the camera with what is known of its lens; where it cannot be solved, show it with (9,) this lens."""
    if solve(scene, camera):
        return
    path = camera_paths.camera_path(camera)
    changed = with_intrinsics(path.reference, values)
    if camera_paths.is_solved(camera):
        camera_paths.set_camera_path(scene, camera, replace(path, reference=changed))
    else:
        camera_paths.write_lens(camera, changed)


def lock_focal(camera: bpy.types.Object) -> None:
    """Keep the focal length that was found."""
    lens = alignment.known_lens(camera)
    lens[:2] = alignment.lens_of(camera)[:2]
    alignment.keep_lens(camera, lens)


def lock_lens(camera: bpy.types.Object) -> None:
    """The whole lens is known; what is known must be kept after this."""
    for box in alignment.LENS_BOXES.values():
        setattr(camera.rockfall_alignment, box, False)


def place_by_eye(scene: bpy.types.Scene, camera: bpy.types.Object, placed: Camera) -> None:
    """Put the camera where a person says that it stood."""
    camera_paths.set_camera_path(scene, camera, fixed(placed))
    camera[store.PLACED] = alignment.BY_EYE
    camera.pop(store.FOLLOWED, None)
    alignment.keep_lens(camera, placed.intrinsics)
    check(scene, camera, Solution())
