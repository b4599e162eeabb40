# SPDX-License-Identifier: GPL-3.0-or-later
"""``rockfall align``: pairs of pixels and terrain points → the camera that sees them so."""

import argparse
import re
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ..errors import InputError
from ..vectors import Array, Mask, norm
from .options import (
    NO_TERRAIN,
    add_fps,
    add_out,
    add_terrain_files,
    add_terrain_options,
    known_names,
    naming,
    not_negative,
    positive,
    refuse_terrain_options,
    terrain_as_asked,
    whole,
)
from .progress import PrintedProgress

if TYPE_CHECKING:
    from ..camera.model import Camera
    from ..camera.pairs import Pairs
    from ..footage.video import Video
    from ..terrain.surface import Surface
    from ..workflow.alignment import Alignment, AlignmentOptions
    from ..workflow.following import FollowedCamera

WORST = 3


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of the command."""
    parser.add_argument("pairs", metavar="PAIRS", help="table with u_px, v_px, x_m, y_m, z_m")
    add_out(parser)
    image = parser.add_mutually_exclusive_group(required=True)
    image.add_argument("--size", metavar="WxH", help="width and height of the image [px], such as 1920x1080")
    image.add_argument("--video", metavar="FILE", help="the video: its size, and a frame to check the camera on")
    add_fps(parser)
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
    add_terrain_files(moving, "mesh, grid or cloud; the points are checked against it")
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
    from ..camera.pairs import pair_residuals
    from ..camera.path import fixed
    from ..exchange.cameras import read_pairs, write_camera, write_pair_residuals
    from ..footage.video import open_video
    from ..output import output_folder
    from ..workflow.alignment import align
    from ..workflow.following import follow_background
    from ..workflow.uprightness import turned_camera, turned_pairs

    if arguments.moving and not arguments.video:
        raise InputError("--moving follows the background through a video", advice="Give it with --video FILE")
    if arguments.moving == "full" and not arguments.terrain:
        raise InputError("--moving full needs the terrain", advice="Give it with --terrain MESH, or use rotation")
    if arguments.frames and not arguments.moving:
        raise InputError("--frames are those that a moving camera is followed through", advice="Give --moving, too")
    if not arguments.terrain:
        refuse_terrain_options(arguments, *NO_TERRAIN)
    with output_folder(arguments.out) as folder, PrintedProgress() as progress:
        surface = terrain_as_asked(arguments, arguments.terrain, progress) if arguments.terrain else None
        progress(f"Reading {arguments.pairs}")
        pairs, turned = turned_pairs(read_pairs(arguments.pairs, None if surface is None else surface.shift), surface)
        video = open_video(arguments.video, progress, rate_hz=arguments.fps) if arguments.video else None
        _check_frames(arguments, pairs, video)
        progress("Solving the camera")
        options = _options(arguments, pairs, video)
        if turned and arguments.camera and options.start is not None:
            options = replace(options, start=turned_camera(options.start))
        with naming(arguments.pairs):
            aligned = align(pairs, options)
        path, motion = fixed(aligned.found.camera), list[str]()
        if arguments.moving and video is not None:
            first, last = arguments.frames or (0, 0)
            followed = follow_background(
                video,
                aligned.solved,
                mode=arguments.moving,
                surface=surface,
                frames=(first, last) if arguments.frames else None,
                progress=progress,
            )
            path, motion = followed.path, _motion(followed, arguments.moving)
        frames = np.where(pairs.frame < 0, aligned.frame, pairs.frame)
        residual_px, residual_m = pair_residuals(
            path, pairs, np.zeros(len(pairs)) if video is None else video.time_s[frames]
        )
        progress("Writing the camera")
        write_camera(
            folder / "camera.toml",
            path,
            rmse_px=aligned.found.rmse_px,
            sigma=aligned.found.sigma,
            pose_covariance=aligned.pose_covariance,
            pose_covariance_with_lens=aligned.pose_covariance_with_lens,
            quality=aligned.found.quality,
        )
        write_pair_residuals(folder / "pairs_residuals.csv", pairs, residual_px, residual_m, aligned.used)
        written = ["camera.toml", "pairs_residuals.csv"]
        if video is not None:
            shown = (frames == aligned.frame) | (not arguments.moving)
            _draw(folder / "align.png", video, aligned.frame, pairs, residual_px, aligned.used, shown)
            written.append("align.png")
    placed = _on_terrain(pairs, surface) if surface is not None else []
    for sentence in (*turned, *_summary(aligned, pairs, residual_px), *placed, *motion):
        print(sentence)
    print(f"Written: {', '.join(written)} in {arguments.out}")
    return 0


def _options(arguments: argparse.Namespace, pairs: "Pairs", video: "Video | None") -> "AlignmentOptions":
    """What is asked for and what is known of the camera."""
    from ..camera.model import focal_of_view
    from ..camera.resection.problem import FREE_LENS
    from ..exchange.cameras import read_camera
    from ..footage.advice import uneven_pixels
    from ..plausibility import check_plausible
    from ..workflow.alignment import AlignmentOptions, with_aspect

    size = (video.width, video.height) if video is not None else _size(arguments.size)
    free: tuple[str, ...] = ("f",)
    focal, start = arguments.focal, None
    if arguments.fov is not None:
        if arguments.fov >= 180:
            advice = "Give the horizontal angle, below 180°"
            raise InputError(f"--fov {arguments.fov:g} is no angle of view", advice=advice)
        focal = focal_of_view(size[0], arguments.fov)
    aspect = 1.0 if video is None else video.pixel_aspect
    if uneven_pixels(aspect):
        start = with_aspect(size, None, aspect, pairs.shift)
    if focal is not None:
        check_plausible("fx", focal, "focal length")
        free, start = (), with_aspect(size, focal, aspect if uneven_pixels(aspect) else 1.0, pairs.shift)
    if arguments.camera:
        start = read_camera(arguments.camera, pairs.shift).path.reference
    return AlignmentOptions(
        size=size,
        free=free if arguments.free is None else known_names(arguments.free, FREE_LENS, "--free"),
        start=start,
        moves=bool(arguments.moving),
        frame=arguments.frame,
        pixel_aspect=aspect,
        robust=not arguments.no_robust,
        sigma_px=arguments.sigma_px,
        sigma_m=arguments.sigma_m,
    )


def _size(text: str) -> tuple[int, int]:
    found = re.fullmatch(r"\s*(\d+)\s*[x×X*,]\s*(\d+)\s*", text)
    if not found or not all(int(part) for part in found.groups()):
        raise InputError(f"--size {text} is no size", advice="Give the width and the height, such as 1920x1080")
    return int(found[1]), int(found[2])


def _check_frames(arguments: argparse.Namespace, pairs: "Pairs", video: "Video | None") -> None:
    """Refuse frames that the video does not have."""
    if video is None:
        return
    advice = f"It has the frames 0 to {video.frames - 1}"
    for i in np.flatnonzero(pairs.frame >= video.frames):
        raise pairs.error(int(i), f"There is no frame {pairs.frame[i]} in {video.path.name}", advice)
    if arguments.frame is not None and arguments.frame >= video.frames:
        raise InputError(f"There is no frame {arguments.frame}", file=video.path, advice=advice)


def _motion(followed: "FollowedCamera", mode: str) -> list[str]:
    """What there is to say about a camera that moves."""
    if followed.is_still:
        return ["The camera stands still: one pose serves all frames."]
    sentences = [
        f"Motion: a pose for each of {followed.path.time_s.size} frames; it turns by up to {followed.turn_deg:.2f}°"
        + (f" and moves by up to {followed.move_m:.2f} m" if mode == "full" else "")
        + f". {followed.features:.0f} features in a frame, {followed.residual_px:.2f} px off (median)."
    ]
    if (sigma := followed.sigma_px) is not None:
        sentences.append(f"Relative to the solved frame, a pose is known to {sigma:.2f} px in the image or better.")
    return [*sentences, *map(str, followed.remarks)]


def _on_terrain(pairs: "Pairs", surface: "Surface") -> list[str]:
    """How far the pairs' points are from the terrain."""
    from ..terrain.misplaced import unit_hint
    from ..terrain.raycast import closest_points

    away = closest_points(surface, pairs.point).distance
    worst = int(np.argmax(away))
    return [
        f"The points lie {np.median(away):.2f} m off the terrain (median), {away[worst]:.2f} m at most "
        f"({pairs.name[worst]}).",
        *(f"{hint}." for hint in [unit_hint(pairs.point, surface)] if hint),
    ]


def _draw(
    path: Path, video: "Video", frame: int, pairs: "Pairs", residual_px: Array, used: "Mask", shown: "Mask"
) -> None:
    from ..footage.pair_picture import draw_pairs
    from ..footage.video import read_frame
    from ..opencv import write_picture

    marked = pairs.pixel[shown]
    picture = draw_pairs(
        read_frame(video, frame), marked, marked - residual_px[shown], pairs.name[shown].tolist(), used[shown]
    )
    write_picture(path, picture)


def _summary(aligned: "Alignment", pairs: "Pairs", residual_px: Array) -> list[str]:
    from ..camera.model import full_frame_mm

    found, used = aligned.found, aligned.used
    camera, sigma = found.camera, found.sigma
    left_out = len(found.wrong)
    total, where = (found.used.size, " of the reference frame") if _other_frames(aligned) else (len(pairs), "")
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
    order = [i for i in np.argsort(-np.nan_to_num(size, nan=np.inf), kind="stable") if used[i]][:WORST]
    if order:
        of = [f" (frame {frame})" if aligned.keys and frame >= 0 else "" for frame in pairs.frame.tolist()]
        worst = [f"{pairs.name[i]}{of[i]} {size[i]:.2f} px" for i in order]
        sentences.append(f"Largest residuals: {', '.join(worst)}.")
    if (checked := ~pairs.used).any():
        off = [f"{pairs.name[i]} {_in_view(size[i])}" for i in np.flatnonzero(checked)]
        sentences.append(f"Not used, to check: {', '.join(off)}.")
    return [*sentences, *map(str, aligned.remarks), *map(str, found.remarks)]


def _other_frames(aligned: "Alignment") -> bool:
    """Whether pairs of other frames than the reference were looked at."""
    return any(remark.about.startswith("frame ") for remark in aligned.remarks)


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
