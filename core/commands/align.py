# SPDX-License-Identifier: GPL-3.0-or-later
"""``rockfall align``: pairs of pixels and terrain points → the camera that sees them so."""

import argparse
import re
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ..errors import InputError
from ..vectors import Array, norm
from .options import add_out, known_names, not_negative, positive, whole
from .progress import Progress

if TYPE_CHECKING:
    from ..camera.model import Camera
    from ..camera.resection import Resection
    from ..exchange.cameras import Pairs
    from ..footage.video import Video
    from ..georeference import GlobalShift
    from ..reconstruction.picks import Mask

FREE = ("f", "fx", "fy", "c", "cx", "cy", "k1", "k2", "k3", "p1", "p2")
FILM_DIAGONAL_MM = 43.2666
"""Of the 36 × 24 mm frame, by which cameras state their equivalent focal length."""
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


def run(arguments: argparse.Namespace) -> int:
    """Solve, write the camera, the residuals and the picture, print the summary."""
    from ..camera.motion import fixed
    from ..exchange.cameras import read_pairs, write_camera, write_pair_residuals
    from ..exchange.output import output_folder

    with output_folder(arguments.out) as folder, Progress() as progress:
        progress(f"Reading {arguments.pairs}")
        pairs = read_pairs(arguments.pairs)
        video = _video(arguments.video, progress) if arguments.video else None
        size = (video.width, video.height) if video is not None else _size(arguments.size)
        progress("Solving the camera")
        found, used = _solve(pairs, size, arguments)
        residual_px, residual_m = _residuals(found.camera, pairs)
        progress("Writing the camera")
        write_camera(
            folder / "camera.toml",
            fixed(found.camera),
            rmse_px=found.rmse_px,
            sigma=found.sigma,
            pose_covariance=found.pose_covariance,
        )
        write_pair_residuals(folder / "pairs_residuals.csv", pairs, residual_px, residual_m, used)
        written = ["camera.toml", "pairs_residuals.csv"]
        if video is not None:
            _draw(folder / "align.png", video, _frame(arguments, pairs, video), pairs, residual_px, used)
            written.append("align.png")
    for sentence in _summary(found, pairs, residual_px, used):
        print(sentence)
    print(f"Written: {', '.join(written)} in {arguments.out}")
    return 0


def _size(text: str) -> tuple[int, int]:
    found = re.fullmatch(r"\s*(\d+)\s*[x×X*,]\s*(\d+)\s*", text)
    if not found or not all(int(part) for part in found.groups()):
        raise InputError(f"--size {text} is no size", advice="Give the width and the height, such as 1920x1080")
    return int(found[1]), int(found[2])


def _video(file: str, progress: Progress) -> "Video":
    from ..footage.video import open_video

    return open_video(file, progress)


def _solve(pairs: "Pairs", size: tuple[int, int], arguments: argparse.Namespace) -> "tuple[Resection, Mask]":
    """The camera from the pairs that are to be used; and (n,) which of all of them were."""
    from ..camera.resection import resect

    told = arguments.focal is not None or arguments.fov is not None
    free = known_names(arguments.free, FREE, "--free") if arguments.free is not None else () if told else ("f",)
    rows = np.flatnonzero(pairs.used)
    if not rows.size:
        raise InputError("No pair is to be used", file=pairs.source, advice="Write 1 in the column used")
    found = resect(
        pairs.pixel[rows],
        pairs.point[rows],
        *size,
        free=free,
        camera=_start(arguments, size, pairs.shift),
        sigma_px=np.where(np.isnan(pairs.sigma_px), arguments.sigma_px, pairs.sigma_px)[rows],
        sigma_m=np.where(np.isnan(pairs.sigma_m), arguments.sigma_m, pairs.sigma_m)[rows],
        names=pairs.name[rows].tolist(),
        robust=not arguments.no_robust,
        shift=pairs.shift,
        rows=pairs.row[rows].tolist(),
        source=str(pairs.source),
    )
    used = np.zeros(len(pairs), dtype=np.bool_)
    used[rows[found.used]] = True
    return found, used


def _start(arguments: argparse.Namespace, size: tuple[int, int], shift: "GlobalShift") -> "Camera | None":
    """What is known of the camera; None when nothing is."""
    from ..camera.model import Camera
    from ..exchange.cameras import read_camera

    if arguments.camera:
        return read_camera(arguments.camera, shift).camera.camera
    width, height = size
    if arguments.fov is not None and arguments.fov >= 180:
        raise InputError(f"--fov {arguments.fov:g} is no angle of view", advice="Give the horizontal angle, below 180°")
    focal = arguments.focal
    if arguments.fov is not None:
        focal = width / 2 / np.tan(np.radians(arguments.fov) / 2)
    if focal is None:
        return None
    return Camera(width, height, focal, focal, width / 2, height / 2, shift=shift)


def _residuals(camera: "Camera", pairs: "Pairs") -> tuple[Array, Array]:
    """Of all pairs, used or not: (n, 2) marked minus projected [px], and (n,) from the point to the ray [m]."""
    from ..camera.model import project, rays

    origins, directions = rays(camera, pairs.pixel)
    away = pairs.point - origins
    return pairs.pixel - project(camera, pairs.point), norm(np.cross(away, directions))


def _frame(arguments: argparse.Namespace, pairs: "Pairs", video: "Video") -> int:
    """The frame of the check picture: as told, else the one on which most pairs were picked."""
    given = pairs.frame[pairs.frame >= 0]
    frame = arguments.frame
    if frame is None:
        frame = int(np.bincount(given).argmax()) if given.size else 0
    if frame >= video.frames:
        raise InputError(
            f"There is no frame {frame}", file=video.path, advice=f"It has the frames 0 to {video.frames - 1}"
        )
    return frame


def _draw(path: Path, video: "Video", frame: int, pairs: "Pairs", residual_px: Array, used: "Mask") -> None:
    from ..footage.pair_picture import draw_pairs, write_picture
    from ..footage.video import read_frame

    shown = (pairs.frame < 0) | (pairs.frame == frame)
    marked = pairs.pixel[shown]
    picture = draw_pairs(
        read_frame(video, frame), marked, marked - residual_px[shown], pairs.name[shown].tolist(), used[shown]
    )
    write_picture(path, picture)


def _summary(found: "Resection", pairs: "Pairs", residual_px: Array, used: "Mask") -> list[str]:
    camera, sigma = found.camera, found.sigma
    left_out = int(pairs.used.sum()) - int(used.sum())
    spare = f", {found.redundancy} observations more than unknowns" if found.redundancy else ""
    sentences = [
        f"{int(used.sum())} of {len(pairs)} pairs fit to {found.rmse_px:.2f} px (root mean square){spare}."
        + (f" {left_out} left out as wrong: {', '.join(found.wrong)}." if left_out else "")
    ]
    equivalent = FILM_DIAGONAL_MM * camera.fx / float(np.hypot(*camera.size))
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
        worst = [f"{pairs.name[i]} {size[i]:.2f} px" for i in order]
        sentences.append(f"Largest residuals: {', '.join(worst)}.")
    if (checked := ~pairs.used).any():
        off = [f"{pairs.name[i]} {_in_view(size[i])}" for i in np.flatnonzero(checked)]
        sentences.append(f"Not used, to check: {', '.join(off)}.")
    return [*sentences, *found.advice]


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
