# SPDX-License-Identifier: GPL-3.0-or-later
"""``rockfall terrain``: any terrain file, or several tiles → terrain.ply, a shaded picture, what there is to know."""

import argparse
from pathlib import Path

from ..errors import DependencyError
from .options import add_out, add_terrain_options, terrain_as_asked
from .progress import PrintedProgress


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of the command."""
    formats = "mesh (PLY, OBJ, STL, glTF), grid (ASC, TIF) or cloud (LAS, LAZ, XYZ, PTX, E57)"
    parser.add_argument("files", metavar="FILE", nargs="+", help=f"{formats}; several tiles become one surface")
    add_out(parser)
    add_terrain_options(parser)
    parser.add_argument("--no-picture", action="store_true", help="do not ask Blender for terrain.png")


def run(arguments: argparse.Namespace) -> int:
    """Read, mesh where needed, join tiles, write a binary PLY in survey coordinates, and picture it with Blender."""
    from ..output import output_folder
    from ..terrain.cloud import Cloud
    from ..terrain.writers import write_ply

    with output_folder(arguments.out) as folder, PrintedProgress() as progress:
        surface = terrain_as_asked(arguments, arguments.files, progress)
        progress("Writing terrain.ply")
        write_ply(surface, folder / "terrain.ply")
        written = ["terrain.ply"]
        if len(surface.left_out):
            write_ply(Cloud(surface.left_out, surface.shift, surface.name), folder / "left_out.ply")
            written.append("left_out.ply")
        no_picture = ""
        if not arguments.no_picture:
            progress("Shading terrain.png")
            no_picture = _picture(folder, surface.name)
            written += [] if no_picture else ["terrain.png"]
    for sentence in surface.summary:
        print(sentence)
    if no_picture:
        print(f"No picture: {no_picture}")
    print(f"Written: {', '.join(written)} in {arguments.out}")
    return 0


def _picture(folder: Path, title: str) -> str:
    """Make terrain.png of terrain.ply; returns why not, where there is no Blender to do it."""
    from ..film.job import FilmJob
    from ..film.maker import film_maker

    try:
        film_maker().film(FilmJob("terrain", folder / "terrain.ply", folder / "terrain.png", title=title))
    except DependencyError as error:
        return str(error)
    return ""
