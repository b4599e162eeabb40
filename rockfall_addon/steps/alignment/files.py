# SPDX-License-Identifier: GPL-3.0-or-later
"""Pairs and cameras as files: pairs.csv, camera.toml, pairs_residuals.csv; in the files are survey coordinates."""

import uuid
from pathlib import Path

import bpy
import numpy as np

from ....core.camera.pairs import pair_residuals
from ....core.camera.resection.problem import EXCHANGED, are_exchanged
from ....core.errors import InputError
from ....core.exchange.cameras import read_camera, read_pairs, write_camera, write_pair_residuals
from ....core.exchange.tables import POSITION, vector_columns, write_columns
from ....core.output import output_folder
from ....core.workflow.uprightness import turned_pairs
from ...scene.footage import alignment, camera_paths, clocks, pairs, videos
from ...scene.storage import store
from ...scene.terrain import georeference, terrain
from . import solving

OTHER_VIDEO = "Choose the table of this video, in pixels of this size"
RESIDUALS = "pairs_residuals.csv"
"""Beside a camera: what is left of its pairs."""


def import_pairs(scene: bpy.types.Scene, camera: bpy.types.Object, path: str | Path) -> tuple[str, ...]:
    """Add the pairs of a table; those without a frame belong to the one that is shown. Returns what was done.

    Raises
    ------
    RockfallError : the table is bad, or a pixel is outside of the video's picture. Nothing has changed.
    """
    shift = georeference.read_shift(scene) if georeference.has_shift(scene) else None
    table, turned = turned_pairs(read_pairs(path, shift), terrain.surface_of_scene(scene))
    (width, height), shown = videos.size_of(camera), clocks.true_frame(scene, camera)
    frames = len(camera[store.VIDEO_TIMES])
    marked, added = pairs.pairs_of(camera), []
    for i, pixel in enumerate(table.pixel):
        if not (0 <= pixel[0] <= width and 0 <= pixel[1] <= height):
            raise table.error(
                i,
                f"The pixel ({pixel[0]:g}, {pixel[1]:g}) is outside of the video's {width} × {height} px",
                EXCHANGED if are_exchanged(table.pixel, width, height) else OTHER_VIDEO,
            )
        if table.frame[i] >= frames:
            raise table.error(i, f"There is no frame {table.frame[i]}", f"The video has the frames 0 to {frames - 1}")
        added.append(
            pairs.Pair(
                id=uuid.uuid4().hex,
                name=str(table.name[i]),
                pixel=tuple(pixel.tolist()),
                point=tuple(table.point[i].tolist()),
                frame=int(table.frame[i]) if table.frame[i] >= 0 else shown,
                enabled=bool(table.used[i]),
                colour=(len(marked) + i) % pairs.COLOURS,
                sigma_px=float(table.sigma_px[i]),
                sigma_m=float(table.sigma_m[i]),
            )
        )
    if not georeference.has_shift(scene):
        georeference.write_shift(scene, table.shift)
    pairs.keep_pairs(camera, [*marked, *added])
    solving.solve(scene, camera)
    return (*turned, f"{len(added)} pairs.")


def export_pairs(scene: bpy.types.Scene, camera: bpy.types.Object, path: str | Path) -> int:
    """Write the complete pairs as pairs.csv; returns how many."""
    table = pairs.table(pairs.complete_of(camera), georeference.read_shift(scene))
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
    solving.lock_lens(camera)
    alignment.keep_lens(camera, one.intrinsics)
    if lens_only:
        solving.set_lens(scene, camera, one.intrinsics)
        return
    if not georeference.has_shift(scene):
        georeference.write_shift(scene, one.shift)
    if not file.path.is_fixed and settings.motion == "FIXED":
        settings.motion = "ROTATION"
    camera_paths.set_camera_path(
        scene,
        camera,
        file.path,
        rmse_px=file.rmse_px,
        pose_covariance=file.pose_covariance,
        quality=file.quality,
    )
    camera[store.PLACED] = alignment.FROM_FILE
    solving.check(scene, camera, alignment.Solution(rmse_px=_number(file.rmse_px), sigma=dict(file.sigma)))


def export_camera(scene: bpy.types.Scene, camera: bpy.types.Object, file: str | Path) -> list[str]:
    """Write a camera and, when there are pairs, what is left of them beside it: both files, or neither.

    Returns the names of the files: NAME.toml and NAME_pairs_residuals.csv; beside camera.toml pairs_residuals.csv, as
    `rockfall align` writes it.

    Raises
    ------
    RockfallError : one of them cannot be written; older ones are as they were.
    """
    file, solution, path = Path(file).absolute(), alignment.solution_of(camera), camera_paths.camera_path(camera)
    covariance, complete = camera_paths.pose_covariance(camera), pairs.complete_of(camera)
    beside = RESIDUALS if file.stem == "camera" else f"{file.stem}_{RESIDUALS}"
    with output_folder(file.parent) as folder:
        known = {"rmse_px": solution.rmse_px, "sigma": solution.sigma, "pose_covariance": covariance}
        known["quality"] = camera_paths.quality_of(camera)
        write_camera(folder / file.name, path, **known)
        if complete:
            table = pairs.table(complete, georeference.read_shift(scene))
            left, away = pair_residuals(path, table, pairs.times_of(camera, table.frame))
            used = np.array([pair.counts and pair.id not in solution.wrong for pair in complete])
            write_pair_residuals(folder / beside, table, left, away, used)
    return [file.name, beside] if complete else [file.name]


def _number(value: float | None) -> float:
    return float("nan") if value is None else float(value)
