# SPDX-License-Identifier: GPL-3.0-or-later
"""``rockfall export``: a project → its animation for other programs: glTF, USD, Alembic, through Blender."""

import argparse
from pathlib import Path

from .options import add_out, naming, positive
from .progress import PrintedProgress
from .show_options import add_show_options, show_as_asked

STEM = "animation"
DEFAULT = ("glb", "usdc", "abc")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of the command."""
    add_show_options(parser)
    add_out(parser)
    parser.add_argument(
        "--format",
        action="extend",
        nargs="+",
        default=[],
        metavar="NAME",
        help=f"glb (glTF), usdc or usda (USD), abc (Alembic); several, or given again (default {' '.join(DEFAULT)})",
    )
    parser.add_argument(
        "--rate", type=positive, default=25.0, metavar="HZ", help="frames per second (default %(default)g)"
    )
    parser.add_argument(
        "--block",
        default="rock",
        metavar="SOLID",
        help="what stands for a block: rock (default), sphere, ellipsoid, box, eota_111, eota_221",
    )


def run(arguments: argparse.Namespace) -> int:
    """Place the blocks, and let Blender write the files."""
    from ..blender_process import blender_command
    from ..outreach.animation import animate, known_format
    from ..outreach.animator import write_animation
    from ..outreach.show import open_show

    formats = dict.fromkeys(known_format(text) for text in arguments.format or DEFAULT)
    request = show_as_asked(arguments)
    command = blender_command("glTF, USD and Alembic are written")
    files = [Path(arguments.out) / f"{STEM}.{ending}" for ending in formats]
    with PrintedProgress() as progress:
        with naming(str(arguments.project)):
            show = open_show(request, progress)
        animation = animate(show, arguments.rate, arguments.block, progress)
        write_animation(animation, files, command, progress)
    for remark in show.remarks:
        print(remark)
    origin = animation.origin
    print(f"{len(animation.names)} blocks, {animation.frames} frames of 1/{animation.rate:g} s, in metres")
    print(f"Origin in survey coordinates: {origin.x:.12g}, {origin.y:.12g}, {origin.z:.12g} m {origin.crs}".rstrip())
    print(f"Written: {', '.join(file.name for file in files)} in {arguments.out}")
    return 0
