# SPDX-License-Identifier: GPL-3.0-or-later
"""Pairs and cameras as files: pairs.csv, camera.toml, pairs_residuals.csv; in the files are survey coordinates."""

import uuid
from pathlib import Path

import bpy
import numpy as np

from ....core.camera.model import project, rays
from ....core.camera.pairs import Pairs
from ....core.errors import InputError
from ....core.exchange.cameras import read_camera, read_pairs, write_camera, write_pair_residuals
from ....core.exchange.tables import POSITION, vector_columns, write_columns
from ....core.vectors import distance_to_ray
from ...scene import alignment, georeference, store, videos


def import_pairs(scene: bpy.types.Scene, camera: bpy.types.Object, path: str | Path) -> int:
    """Add the pairs of a table; those without a frame belong to the one that is shown. Returns how many came.

    Raises
    ------
    RockfallError : the table is bad, or a pixel is outside of the video's picture. Nothing has changed.
    """
    table = read_pairs(path, georeference.read_shift(scene) if georeference.has_shift(scene) else None)
    (width, height), shown = videos.size_of(camera), videos.true_frame(scene, camera)
    frames = len(camera[store.VIDEO_TIMES])
    pairs, added = alignment.pairs_of(camera), []
    for i, pixel in enumerate(table.pixel):
        if not (0 <= pixel[0] <= width and 0 <= pixel[1] <= height):
            raise table.error(
                i,
                f"The pixel ({pixel[0]:g}, {pixel[1]:g}) is outside of the video's {width} × {height} px",
                "Is the table of another video, or of another size of it?",
            )
        if table.frame[i] >= frames:
            raise table.error(i, f"There is no frame {table.frame[i]}", f"The video has the frames 0 to {frames - 1}")
        added.append(
            alignment.Pair(
                id=uuid.uuid4().hex,
                name=str(table.name[i]),
                pixel=tuple(pixel.tolist()),
                point=tuple(table.point[i].tolist()),
                frame=int(table.frame[i]) if table.frame[i] >= 0 else shown,
                enabled=bool(table.used[i]),
                colour=(len(pairs) + i) % alignment.COLOURS,
                sigma_px=float(table.sigma_px[i]),
                sigma_m=float(table.sigma_m[i]),
            )
        )
    if not georeference.has_shift(scene):
        georeference.write_shift(scene, table.shift)
    alignment.keep_pairs(camera, [*pairs, *added])
    alignment.solve(scene, camera)
    return len(added)


def export_pairs(scene: bpy.types.Scene, camera: bpy.types.Object, path: str | Path) -> int:
    """Write the complete pairs as pairs.csv; returns how many."""
    table = _table(scene, camera, Path(path))
    write_columns(
        path,
        vector_columns(("u_px", "v_px"), table.pixel)
        | vector_columns(POSITION, table.shift.to_survey(table.point))
        | {"name": table.name, "frame": [str(frame) for frame in table.frame.tolist()]}
        | {"sigma_px": table.sigma_px, "sigma_m": table.sigma_m}
        | {"used": ["1" if used else "0" for used in table.used.tolist()]},
    )
    return len(table)


def import_camera(scene: bpy.types.Scene, camera: bpy.types.Object, path: str | Path, *, lens_only: bool) -> None:
    """Take a camera from camera.toml, or its lens alone.

    Raises
    ------
    RockfallError : the file is bad, or of another size of picture.
    """
    file = read_camera(path, georeference.read_shift(scene) if georeference.has_shift(scene) else None)
    one, settings = file.path.reference, camera.rockfall_alignment
    if one.size != videos.size_of(camera):
        width, height = videos.size_of(camera)
        raise InputError(
            f"The camera is of {one.width} × {one.height} px pictures, the video has {width} × {height} px",
            file=path,
            advice="Take the camera of this video, or solve it from pairs",
        )
    alignment.lock_lens(camera)
    alignment.keep_lens(camera, one.intrinsics)
    if lens_only:
        alignment.set_lens(scene, camera, one.intrinsics)
        return
    if not georeference.has_shift(scene):
        georeference.write_shift(scene, one.shift)
    if not file.path.is_fixed and settings.motion == "FIXED":
        settings.motion = "ROTATION"
    videos.set_camera_path(scene, camera, file.path, rmse_px=file.rmse_px, pose_covariance=file.pose_covariance)
    camera[store.PLACED] = alignment.FROM_FILE
    alignment.keep_check(camera, alignment.Solution(rmse_px=_number(file.rmse_px), sigma=dict(file.sigma)))


def export_camera(scene: bpy.types.Scene, camera: bpy.types.Object, path: str | Path) -> list[str]:
    """Write camera.toml and, when there are pairs, pairs_residuals.csv beside it. Returns the names of the files."""
    path, solution, moving = Path(path), alignment.solution_of(camera), videos.camera_path(camera)
    write_camera(
        path,
        moving,
        rmse_px=solution.rmse_px,
        sigma=solution.sigma,
        pose_covariance=videos.pose_covariance(camera),
    )
    table = _table(scene, camera, path)
    if not len(table):
        return [path.name]
    position, rotation = moving.poses_at(videos.times_of(camera)[table.frame])
    seen = project(moving.reference, table.point, position=position, rotation=rotation)
    away = distance_to_ray(table.point, *rays(moving.reference, table.pixel, position=position, rotation=rotation))
    complete = [pair for pair in alignment.pairs_of(camera) if pair.is_complete]
    used = np.array([pair.enabled and pair.id not in solution.wrong for pair in complete])
    beside = path.with_name("pairs_residuals.csv")
    write_pair_residuals(beside, table, table.pixel - seen, away, used)
    return [path.name, beside.name]


def _table(scene: bpy.types.Scene, camera: bpy.types.Object, path: Path) -> Pairs:
    complete = [pair for pair in alignment.pairs_of(camera) if pair.is_complete]
    n = len(complete)
    return Pairs(
        pixel=np.array([pair.pixel for pair in complete]).reshape(-1, 2),
        point=np.array([pair.point for pair in complete]).reshape(-1, 3),
        name=np.array([pair.name for pair in complete], dtype=np.str_),
        frame=np.array([pair.frame for pair in complete], dtype=np.intp),
        sigma_px=np.array([pair.sigma_px for pair in complete]),
        sigma_m=np.array([pair.sigma_m for pair in complete]),
        used=np.array([pair.enabled for pair in complete], dtype=np.bool_),
        row=np.arange(2, n + 2),
        source=path,
        shift=georeference.read_shift(scene),
    )


def _number(value: float | None) -> float:
    return float("nan") if value is None else float(value)
