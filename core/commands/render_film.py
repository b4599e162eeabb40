# SPDX-License-Identifier: GPL-3.0-or-later
"""``rockfall render PROJECT --film NAME``: a film that is composed of footage, reconstruction and models."""

import argparse
from math import nan
from pathlib import Path
from typing import TYPE_CHECKING

from ..errors import InputError
from .options import add_terrain_colours, model_parameters, models_as_asked, naming, not_negative, positive, whole
from .progress import PrintedProgress

if TYPE_CHECKING:
    from ..film.composed.request import FilmRequest

OWN = (
    "language", "rate", "slow_at", "freeze", "video", "trajectory", "block", "sun", "terrain_colours", "dust", "codec",
    "images",
)  # fmt: skip
DEFAULT_PRESET = "720p"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of composed films."""
    group = parser.add_argument_group("films of footage, reconstruction and models (--film)")
    group.add_argument(
        "--film",
        metavar="NAME",
        help="story, overlay, side_by_side, fly_along, turntable, vertical, or a picture: contact_sheet, stroboscopic; "
        "drawn without Blender, which only encodes them (default preset: 720p)",
    )
    group.add_argument("--language", metavar="LANG", help="of the texts: en (the default), fr or de")
    group.add_argument(
        "--rate", type=positive, metavar="R", help="seconds of the fall in a second of film (0.25: four times slower)"
    )
    group.add_argument(
        "--slow-at",
        type=_impacts,
        metavar="N,N",
        help='impacts at which the film slows down and stands still; "none" for none',
    )
    group.add_argument(
        "--freeze", type=not_negative, metavar="S", help="how long it stands still there [s] (default 0.5)"
    )
    group.add_argument("--video", metavar="NAME", help="of the project (default: the first with a camera)")
    group.add_argument("--trajectory", action="append", metavar="NAME", help="show only this one; may be repeated")
    group.add_argument(
        "--block",
        metavar="SOLID",
        help="what stands for the block: rock (the default), sphere, ellipsoid, box, eota_111, eota_221, "
        "or the file of a scanned one",
    )
    group.add_argument(
        "--sun", type=_sun, metavar="AZ,EL", help="azimuth from north and elevation of the sun [°] (default 315,50)"
    )
    add_terrain_colours(group)
    group.add_argument("--dust", action="store_true", help="impacts raise dust: drawn, not measured")
    group.add_argument("--codec", metavar="CODEC", help="h264 (the default), h265 or av1, where this Blender writes it")
    group.add_argument(
        "--images", action="store_true", help="keep the frames as pictures, in a folder, instead of a film"
    )


def refuse_without_film(arguments: argparse.Namespace) -> None:
    """Refuse options that only composed films know.

    Raises
    ------
    InputError : one is given.
    """
    for name in OWN:
        if getattr(arguments, name) not in (None, False):
            raise InputError(
                f"--{name.replace('_', '-')} is of composed films", advice="Add --film and a name, as --film overlay"
            )


def run(arguments: argparse.Namespace) -> int:
    """Make the film or picture."""
    from ..film.composed.making import make_film

    for name in ("simulate", "slope", "engine"):
        if getattr(arguments, name):
            raise InputError(
                f"--{name} is not of composed films", advice="Leave it out; --model names the models of --film"
            )
    request = _request(arguments)
    with PrintedProgress() as progress:
        made = make_film(
            request, Path(arguments.out), frames=arguments.frames, still=arguments.still, images=arguments.images,
            codec=arguments.codec or "h264", progress=progress,
        )  # fmt: skip
    for remark in made.remarks:
        print(remark)
    if made.kept:
        print(f"{made.kept} of {made.frames} frames were there from an earlier run")
    print(
        f"{made.size[0]}×{made.size[1]}"
        + (f", {made.frames} frames, {made.frames / request.fps:.1f} s" if made.frames > 1 else "")
    )
    print(f"Written: {made.file}")
    return 0


def _request(arguments: argparse.Namespace) -> "FilmRequest":
    from ..exchange.parameters import checked_parameters
    from ..exchange.project import read_project
    from ..film.composed.ground import check_terrain_colours
    from ..film.composed.kinds import find_kind
    from ..film.composed.request import SUN_DEG, FilmRequest
    from ..film.presets import find_preset
    from ..film.simulated import NUMBER

    find_kind(arguments.film)
    project = read_project(arguments.project)
    with naming(str(arguments.project)):
        preset = find_preset(project, arguments.preset or DEFAULT_PRESET)
    models = models_as_asked(arguments.model)
    known = checked_parameters(project.extra["models"], arguments.project) if "models" in project.extra else None
    if preset.time_scale != 1.0 and arguments.rate is None:
        arguments.rate = preset.time_scale
    return FilmRequest(
        arguments.film,
        arguments.project,
        preset.width,
        preset.height,
        preset.fps,
        arguments.language or "en",
        arguments.rate,
        arguments.slow_at,
        0.5 if arguments.freeze is None else arguments.freeze,
        arguments.video or "",
        tuple(arguments.trajectory or ()),
        models,
        NUMBER if arguments.number is None else arguments.number,
        arguments.seed or 0,
        model_parameters(arguments, models, known) if models else known or {},
        arguments.graphs or "",
        arguments.block or "rock",
        arguments.sun or SUN_DEG,
        arguments.dust,
        check_terrain_colours(arguments.terrain_colours or "auto"),
    )


def _impacts(text: str) -> tuple[int, ...]:
    try:
        return () if text == "none" else tuple(whole(part) for part in text.split(","))
    except argparse.ArgumentTypeError as error:
        raise argparse.ArgumentTypeError(f"{text} are not the numbers of impacts, such as 2,5, or none") from error


def _sun(text: str) -> tuple[float, float]:
    try:
        azimuth, elevation = (float(part) for part in text.split(","))
    except ValueError:
        azimuth = elevation = nan
    if not (0 <= azimuth <= 360 and 0 < elevation <= 90):
        raise argparse.ArgumentTypeError(
            f"{text} is no place of the sun: azimuth 0 to 360 and elevation above 0 to 90, such as 315,50"
        )
    return azimuth, elevation
