# SPDX-License-Identifier: GPL-3.0-or-later
"""``rockfall align``: pairs of pixels and terrain points → the camera that sees them so."""

import argparse
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ..errors import InputError
from ..vectors import Array, Indices, Mask, distance_to_ray, norm
from .options import add_out, add_terrain_options, known_names, not_negative, positive, terrain_as_told, whole
from .progress import PrintedProgress

if TYPE_CHECKING:
    from ..camera.model import Camera
    from ..camera.path import CameraPath
    from ..camera.resection import Resection
    from ..exchange.cameras import Pairs
    from ..footage.video import Video
    from ..georeference import GlobalShift
    from ..terrain.surface import Surface

FREE = ("f", "fx", "fy", "c", "cx", "cy", "k1", "k2", "k3", "p1", "p2")
WORST = 3


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of the command."""
    parser.add_argument("pairs", metavar="PAIRS", help="table with u_px, v_px, x_m, y_m, z_m")
    add_out(parser)
    image = parser.add_mutually_exclusive_group(required=True)
    image.add_argument("--size", metavar="WxH", help="width and height of the image [px], such as 1920x1080")
    image.add_argument("--video", metavar="FILE", help="the video: its size, and a frame to check the camera on")
    parser.add_argument("--frame", type=whole, metavar="N", help="of the video that was picked on (default 0)")
    lens = parser.add_argument_group("the lens")
    lens.add_argument(
        "--free",
        metavar="A,B,…",
        help="what is to be found of it: f (or fx, fy), c (or cx, cy), k1, k2, k3, p1, p2; none for the pose alone "
        "(default f, none with --focal or --fov)",
    )
    known = lens.add_mutually_exclusive_group()
    known.add_argument("--focal", type=positive, metavar="PX", help="focal length [px]")
    known.add_argument("--fov", type=positive, metavar="DEG", help="horizontal angle of view [°]")
    known.add_argument("--camera", metavar="FILE", help="camera.toml with what is known, and where to begin")
    moving = parser.add_argument_group("a camera that moves")
    moving.add_argument(
        "--moving",
        choices=("rotation", "full"),
        help="follow the background through the video, for a pose of each frame: of a camera that turns at one place, "
        "or (full, needs --terrain) also moves. Frames that the column frame of PAIRS names are solved by themselves",
    )
    moving.add_argument(
        "--frames", type=whole, nargs=2, metavar=("FIRST", "LAST"), help="of the video to follow (default all)"
    )
    moving.add_argument("--terrain", metavar="MESH", help="mesh, grid or cloud; the points are checked against it")
    errors = parser.add_argument_group("errors of the pairs")
    errors.add_argument(
        "--sigma-px",
        type=positive,
        default=1.0,
        metavar="S",
        help="of a pixel's coordinates [px] (default %(default)s)",
    )
    errors.add_argument(
        "--sigma-m",
        type=not_negative,
        default=0.0,
        metavar="S",
        help="of a point's coordinates [m] (default %(default)s)",
    )
    errors.add_argument("--no-robust", action="store_true", help="keep pairs that do not fit the others")
    add_terrain_options(parser)


def run(arguments: argparse.Namespace) -> int:
    """Solve, write the camera, the residuals and the picture, print the summary."""
    from ..camera.path import fixed
    from ..exchange.cameras import read_pairs, write_camera, write_pair_residuals
    from ..exchange.output import output_folder

    if arguments.moving and not arguments.video:
        raise InputError("--moving follows the background through a video", advice="Give it with --video FILE")
    if arguments.moving == "full" and not arguments.terrain:
        raise InputError("--moving full needs the terrain", advice="Give it with --terrain MESH, or use rotation")
    with output_folder(arguments.out) as folder, PrintedProgress() as progress:
        surface = terrain_as_told(arguments, arguments.terrain, progress) if arguments.terrain else None
        progress(f"Reading {arguments.pairs}")
        pairs = read_pairs(arguments.pairs, None if surface is None else surface.shift)
        video = _video(arguments.video, progress) if arguments.video else None
        size = (video.width, video.height) if video is not None else _size(arguments.size)
        frame = _frame(arguments, pairs, video)
        progress("Solving the camera")
        solved = _solve(pairs, size, frame, arguments)
        path, motion = fixed(solved.found.camera), list[str]()
        if arguments.moving and video is not None:
            path, motion = _follow(solved, video, frame, surface, arguments, progress)
        residual_px, residual_m = _residuals(path, pairs, video, frame)
        progress("Writing the camera")
        write_camera(
            folder / "camera.toml",
            path,
            rmse_px=solved.found.rmse_px,
            sigma=solved.found.sigma,
            pose_covariance=solved.found.pose_covariance_given_lens,
        )
        write_pair_residuals(folder / "pairs_residuals.csv", pairs, residual_px, residual_m, solved.used)
        written = ["camera.toml", "pairs_residuals.csv"]
        if video is not None:
            shown = (pairs.frame < 0) | (pairs.frame == frame) | (not arguments.moving)
            _draw(folder / "align.png", video, frame, pairs, residual_px, solved.used, shown)
            written.append("align.png")
    placed = _on_terrain(pairs, surface) if surface is not None else []
    for sentence in (*_summary(solved, pairs, residual_px), *placed, *motion):
        print(sentence)
    print(f"Written: {', '.join(written)} in {arguments.out}")
    return 0


def _size(text: str) -> tuple[int, int]:
    found = re.fullmatch(r"\s*(\d+)\s*[x×X*,]\s*(\d+)\s*", text)
    if not found or not all(int(part) for part in found.groups()):
        raise InputError(f"--size {text} is no size", advice="Give the width and the height, such as 1920x1080")
    return int(found[1]), int(found[2])


def _video(file: str, progress: PrintedProgress) -> "Video":
    from ..footage.video import open_video

    return open_video(file, progress)


@dataclass(frozen=True, eq=False)
class _Solved:
    """The reference frame's camera, those of other frames, and (n,) which pairs counted."""

    found: "Resection"
    keys: "Mapping[int, Resection]"
    used: "Mask"
    notes: tuple[str, ...]


def _solve(pairs: "Pairs", size: tuple[int, int], frame: int, arguments: argparse.Namespace) -> _Solved:
    """Solve the camera; of a moving one, each frame that has enough pairs."""
    from ..camera.resection import POSE_PAIRS, resect

    told = arguments.focal is not None or arguments.fov is not None
    free = known_names(arguments.free, FREE, "--free") if arguments.free is not None else () if told else ("f",)
    here = pairs.used & ((pairs.frame < 0) | (pairs.frame == frame)) if arguments.moving else pairs.used
    if not here.any():
        where = f" in frame {frame}" if arguments.moving else ""
        raise InputError(f"No pair is to be used{where}", file=pairs.source, advice="Write 1 in the column used")
    used = np.zeros(len(pairs), dtype=np.bool_)

    def solve(rows: "Indices", free: tuple[str, ...], start: "Camera | None") -> "Resection":
        found = resect(
            pairs.pixel[rows],
            pairs.point[rows],
            *size,
            free=free,
            camera=start,
            sigma_px=np.where(np.isnan(pairs.sigma_px), arguments.sigma_px, pairs.sigma_px)[rows],
            sigma_m=np.where(np.isnan(pairs.sigma_m), arguments.sigma_m, pairs.sigma_m)[rows],
            names=pairs.name[rows].tolist(),
            robust=not arguments.no_robust,
            shift=pairs.shift,
            rows=pairs.row[rows].tolist(),
            source=str(pairs.source),
        )
        used[rows[found.used]] = True
        return found

    found = solve(np.flatnonzero(here), free, _start(arguments, size, pairs.shift))
    keys: dict[int, Resection] = {}
    notes: list[str] = []
    for other in np.unique(pairs.frame[pairs.used & ~here]).tolist():
        rows = np.flatnonzero(pairs.used & (pairs.frame == other))
        if rows.size < POSE_PAIRS:
            notes.append(f"Frame {other} has {rows.size} pairs, too few to be solved: they only check the path.")
            continue
        keys[other] = solve(rows, (), found.camera)
        notes.append(f"Frame {other}: {len(rows)} pairs fit to {keys[other].rmse_px:.2f} px.")
    return _Solved(found, keys, used, tuple(notes))


def _follow(
    solved: _Solved,
    video: "Video",
    frame: int,
    surface: "Surface | None",
    arguments: argparse.Namespace,
    progress: PrintedProgress,
) -> "tuple[CameraPath, list[str]]":
    """A pose for each frame from the background; and sentences about it."""
    from ..camera.model import vector_from_rotation
    from ..camera.motion import FeatureTracks, solve_motion
    from ..camera.path import fixed
    from ..footage.background import background_motion

    first, last = arguments.frames or (0, video.frames - 1)
    if not 0 <= first <= last < video.frames:
        raise InputError(
            f"--frames {first} {last} is no part of the video",
            file=video.path,
            advice=f"It has the frames 0 to {video.frames - 1}",
        )
    for number in (frame, *solved.keys):
        if not first <= number <= last:
            raise InputError(
                f"Pairs were picked on frame {number}, outside of --frames {first} {last}",
                advice="Widen the range, or leave these pairs out",
            )
    background, seen = background_motion(video, first=first, last=last, progress=progress)
    if background.still and not solved.keys:
        return fixed(solved.found.camera), ["The camera stands still: one pose serves all frames."]
    progress("Solving the camera of each frame")
    made = solve_motion(
        solved.found.camera,
        FeatureTracks(seen.frame - first, seen.feature, seen.pixel),
        video.time_s[first : last + 1],
        frame - first,
        mode=arguments.moving,
        points_of=None if surface is None else _points_of(surface),
        key_frames={number - first: found.camera for number, found in solved.keys.items()},
    )
    path = made.path
    turned = np.degrees(norm(vector_from_rotation(path.rotation @ path.reference.rotation.T)))
    moved = norm(path.position - path.reference.position)
    sentences = [
        f"Motion: a pose for each of {path.time_s.size} frames; it turns by up to {turned.max():.2f}°"
        + (f" and moves by up to {moved.max():.2f} m" if arguments.moving == "full" else "")
        + f". {np.median(made.features):.0f} features in a frame, {np.nanmedian(made.residual_px):.2f} px off (median)."
    ]
    sigma = path.sigma_rotation[np.isfinite(path.sigma_rotation)]
    if sigma.size:
        wide = path.reference.fx * float(sigma.max())
        sentences.append(f"Relative to the solved frame, a pose is known to {wide:.2f} px in the image or better.")
    return path, [*sentences, *map(str, made.remarks)]


def _points_of(surface: "Surface") -> "Callable[[Array, Array], Array]":
    """Where rays meet the terrain; NaN where they do not, or are none."""
    from ..terrain.raycast import cast_rays

    def meet(origins: Array, directions: Array) -> Array:
        points = np.full_like(origins, np.nan)
        good = np.isfinite(directions).all(axis=1)
        points[good] = cast_rays(surface, origins[good], directions[good]).point
        return points

    return meet


def _start(arguments: argparse.Namespace, size: tuple[int, int], shift: "GlobalShift") -> "Camera | None":
    """What is known of the camera; None when nothing is."""
    from ..camera.model import Camera
    from ..exchange.cameras import read_camera

    if arguments.camera:
        return read_camera(arguments.camera, shift).path.reference
    width, height = size
    if arguments.fov is not None and arguments.fov >= 180:
        raise InputError(f"--fov {arguments.fov:g} is no angle of view", advice="Give the horizontal angle, below 180°")
    focal = arguments.focal
    if arguments.fov is not None:
        focal = width / 2 / np.tan(np.radians(arguments.fov) / 2)
    if focal is None:
        return None
    return Camera(width, height, focal, focal, width / 2, height / 2, shift=shift)


def _residuals(path: "CameraPath", pairs: "Pairs", video: "Video | None", frame: int) -> tuple[Array, Array]:
    """Of all pairs, used or not: (n, 2) marked minus projected [px], and (n,) from the point to the ray [m]."""
    from ..camera.model import project, rays

    time_s = np.zeros(len(pairs)) if video is None else video.time_s[np.where(pairs.frame < 0, frame, pairs.frame)]
    position, rotation = path.poses_at(time_s)
    seen = project(path.reference, pairs.point, position=position, rotation=rotation)
    beam = rays(path.reference, pairs.pixel, position=position, rotation=rotation)
    return pairs.pixel - seen, distance_to_ray(pairs.point, *beam)


def _frame(arguments: argparse.Namespace, pairs: "Pairs", video: "Video | None") -> int:
    """The reference frame: as told, else the one on which most pairs were picked."""
    given = pairs.frame[pairs.frame >= 0]
    frame = arguments.frame
    if frame is None:
        frame = int(np.bincount(given).argmax()) if given.size else 0
    if video is None:
        return int(frame)
    advice = f"It has the frames 0 to {video.frames - 1}"
    for i in np.flatnonzero(pairs.frame >= video.frames):
        raise pairs.error(int(i), f"There is no frame {pairs.frame[i]} in {video.path.name}", advice)
    if frame >= video.frames:
        raise InputError(f"There is no frame {frame}", file=video.path, advice=advice)
    return int(frame)


def _on_terrain(pairs: "Pairs", surface: "Surface") -> list[str]:
    """How far the pairs' points are from the terrain."""
    from ..terrain.raycast import closest_points

    away = closest_points(surface, pairs.point).distance
    worst = int(np.argmax(away))
    return [
        f"The points lie {np.median(away):.2f} m off the terrain (median), {away[worst]:.2f} m at most "
        f"({pairs.name[worst]})."
    ]


def _draw(
    path: Path, video: "Video", frame: int, pairs: "Pairs", residual_px: Array, used: "Mask", shown: "Mask"
) -> None:
    from ..footage.pair_picture import draw_pairs, write_picture
    from ..footage.video import read_frame

    marked = pairs.pixel[shown]
    picture = draw_pairs(
        read_frame(video, frame), marked, marked - residual_px[shown], pairs.name[shown].tolist(), used[shown]
    )
    write_picture(path, picture)


def _summary(solved: _Solved, pairs: "Pairs", residual_px: Array) -> list[str]:
    from ..camera.model import full_frame_mm

    found, used = solved.found, solved.used
    camera, sigma = found.camera, found.sigma
    left_out = len(found.wrong)
    total, where = (found.used.size, " of the reference frame") if solved.notes else (len(pairs), "")
    spare = f", {found.redundancy} observations more than unknowns" if found.redundancy else ""
    sentences = [
        f"{int(found.used.sum())} of {total} pairs{where} fit to {found.rmse_px:.2f} px (root mean square){spare}."
        + (f" {left_out} left out as wrong: {', '.join(found.wrong)}." if left_out else "")
    ]
    equivalent = full_frame_mm(camera.fx, camera.size)
    sentences.append(
        f"Focal length: {camera.fx:.1f}{_plus_minus(sigma.get('fx'), 1)} px"
        + (f", {camera.fy:.1f}{_plus_minus(sigma.get('fy'), 1)} px down" if not _same(camera.fx, camera.fy) else "")
        + f" ({equivalent:.1f} mm equivalent, {_angle_deg(camera):.1f}° across)."
    )
    lens = [
        f"{name} {getattr(camera, name):.4g}{_plus_minus(sigma[name], 2, significant=True)}"
        for name in found.parameters
        if name in ("cx", "cy", "k1", "k2", "k3", "p1", "p2")
    ]
    sentences += [f"Lens: {', '.join(lens)}."] if lens else []
    place = camera.shift.to_survey(camera.position)
    deviations = [sigma.get(name, np.nan) for name in ("x", "y", "z")]
    parts = [
        f"{name} {value:.3f}{_plus_minus(sd, 3)}" for name, value, sd in zip("xyz", place, deviations, strict=True)
    ]
    sentences.append(f"Position: {', '.join(parts)} m.")
    size = norm(residual_px)
    order = [i for i in np.argsort(-np.nan_to_num(size, nan=np.inf)) if used[i]][:WORST]
    if order:
        of = [f" (frame {frame})" if solved.keys and frame >= 0 else "" for frame in pairs.frame.tolist()]
        worst = [f"{pairs.name[i]}{of[i]} {size[i]:.2f} px" for i in order]
        sentences.append(f"Largest residuals: {', '.join(worst)}.")
    if (checked := ~pairs.used).any():
        off = [f"{pairs.name[i]} {_in_view(size[i])}" for i in np.flatnonzero(checked)]
        sentences.append(f"Not used, to check: {', '.join(off)}.")
    return [*sentences, *solved.notes, *map(str, found.remarks)]


def _same(one: float, other: float) -> bool:
    return abs(one - other) <= 1e-9 * abs(one)


def _angle_deg(camera: "Camera") -> float:
    """Horizontal angle of view without the distortion."""
    left, right = camera.cx / camera.fx, (camera.width - camera.cx) / camera.fx
    return float(np.degrees(np.arctan(left) + np.arctan(right)))


def _plus_minus(sigma: float | None, digits: int, *, significant: bool = False) -> str:
    if sigma is None or np.isnan(sigma):
        return ""
    if not np.isfinite(sigma):
        return " ± ∞"
    return f" ± {sigma:.{digits}{'g' if significant else 'f'}}"


def _in_view(size: float) -> str:
    return f"{size:.2f} px" if np.isfinite(size) else "not in view"
