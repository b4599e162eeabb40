# SPDX-License-Identifier: GPL-3.0-or-later
"""``rockfall terrain``: any terrain file → terrain.ply, and what there is to know about it."""

import argparse

from .options import add_out, add_terrain_options
from .progress import Progress


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of the command."""
    formats = "mesh (PLY, OBJ, STL, glTF), grid (ASC, TIF) or cloud (LAS, LAZ, XYZ)"
    parser.add_argument("file", metavar="FILE", help=formats)
    add_out(parser)
    add_terrain_options(parser)


def run(arguments: argparse.Namespace) -> int:
    """Read, mesh where needed, write a binary PLY in survey coordinates."""
    from ..exchange.output import output_folder
    from ..terrain.readers import read_terrain
    from ..terrain.writers import write_ply

    with output_folder(arguments.out) as folder, Progress() as progress:
        surface = read_terrain(
            arguments.file,
            up=arguments.up,
            unit_m=arguments.unit,
            max_edge_m=arguments.max_edge,
            ground_only=arguments.ground_only,
            progress=progress,
        )
        progress("Writing terrain.ply")
        write_ply(surface, folder / "terrain.ply")
    for sentence in surface.summary:
        print(sentence)
    print(f"Written: terrain.ply in {arguments.out}")
    return 0
