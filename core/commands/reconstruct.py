# SPDX-License-Identifier: GPL-3.0-or-later
"""``rockfall reconstruct``: timed picks → impacts.csv and trajectories.csv."""

import argparse
from typing import TYPE_CHECKING

from ..constants import AIR_DENSITY_KGPM3, DRAG_COEFFICIENT, GRAVITY_MPS2, ROCK_DENSITY_KGPM3
from ..errors import InputError
from ..extras import PARQUET, demand
from ..reconstruction.sampling import STEP_S
from .options import (
    NO_TERRAIN,
    add_out,
    add_terrain_files,
    add_terrain_options,
    naming,
    not_negative,
    positive,
    refuse_terrain_options,
    terrain_as_asked,
)
from .progress import PrintedProgress

if TYPE_CHECKING:
    from ..reconstruction.block import Block
    from ..reconstruction.trajectory import Reconstruction
    from ..terrain.surface import Surface

DEFAULT_DIAMETER_M = 0.35


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of the command."""
    parser.add_argument(
        "picks", metavar="PICKS", help="picks.csv; or a project (.toml, .blend), which says the rest itself"
    )
    add_out(parser)
    add_terrain_files(parser, "mesh, grid or cloud; not needed with nx, ny, nz")
    parser.add_argument(
        "--normal-radius",
        type=positive,
        metavar="M",
        help="radius of the terrain normal [m] (default: the block's diameter, at least 3 point spacings)",
    )
    parser.add_argument(
        "--gravity", type=not_negative, default=GRAVITY_MPS2, metavar="G", help="[m/s²] (default %(default)s)"
    )
    parser.add_argument("--site", default="", metavar="NAME", help="name of the site, written to the table")
    parser.add_argument(
        "--step",
        type=positive,
        default=STEP_S,
        metavar="S",
        help="time step of trajectories.csv [s] (default %(default)s)",
    )
    parser.add_argument(
        "--parquet", action="store_true", help="also impacts.parquet, with the columns of impacts.csv (needs pyarrow)"
    )
    parser.add_argument(
        "--eq10",
        choices=("signed", "as_printed"),
        default="signed",
        help="deviation angle: 0–180° (default), or 0–90° as eq. 10 of Noël et al. 2018 is printed",
    )
    parser.add_argument(
        "--flights",
        choices=("contacts", "centres"),
        default="contacts",
        help="what the flights join: the marked contact points (default), or the block's centre at each contact",
    )
    block = parser.add_argument_group("the block")
    size = block.add_mutually_exclusive_group()
    size.add_argument(
        "--diameter", type=positive, metavar="M", help=f"diameter of a round block [m] (default {DEFAULT_DIAMETER_M})"
    )
    size.add_argument(
        "--diameters", type=positive, nargs=3, metavar=("D1", "D2", "D3"), help="the three diameters of the block [m]"
    )
    block.add_argument("--shape", choices=("ellipsoid", "box"), default="ellipsoid", help="for its volume and inertia")
    weight = block.add_mutually_exclusive_group()
    weight.add_argument(
        "--density",
        type=positive,
        default=ROCK_DENSITY_KGPM3,
        metavar="RHO",
        help="[kg/m³] (default %(default)s)",
    )
    weight.add_argument("--mass", type=positive, metavar="KG", help="weighed mass [kg], instead of the density")
    drag = parser.add_argument_group("air drag")
    drag.add_argument("--drag", action="store_true", help="flights with the drag ½ρC_D·A|v|v instead of parabolas")
    drag.add_argument(
        "--drag-coefficient", type=positive, default=DRAG_COEFFICIENT, metavar="CD", help="(default %(default)s)"
    )
    drag.add_argument(
        "--air-density", type=positive, default=AIR_DENSITY_KGPM3, metavar="RHO", help="[kg/m³] (default %(default)s)"
    )
    add_terrain_options(parser)


def run(arguments: argparse.Namespace) -> int:
    """Reconstruct, write the tables, print the summary."""
    from ..exchange.saved_blend import is_project
    from ..exchange.tables import write_impacts, write_trajectories
    from ..output import output_folder
    from ..reconstruction.sampling import sample_trajectories
    from ..reconstruction.summary import summarise

    if arguments.parquet:
        demand(PARQUET)
    names = ["impacts.csv", "trajectories.csv", *(["impacts.parquet"] if arguments.parquet else [])]
    with output_folder(arguments.out) as folder, PrintedProgress() as progress:
        progress(f"Reading {arguments.picks}")
        made = _of_project if is_project(arguments.picks) else _of_table
        surface, reconstruction, turned = made(arguments, progress)
        progress("Writing the tables")
        for name in names[:1] + names[2:]:
            write_impacts(reconstruction.impacts, folder / name)
        write_trajectories(sample_trajectories(reconstruction, arguments.step, surface), folder / "trajectories.csv")
    for sentence in (*(surface.summary if surface else ()), *turned, *summarise(reconstruction)):
        print(sentence)
    print(f"Written: {', '.join(names)} in {arguments.out}")
    return 0


type _Made = tuple["Surface | None", "Reconstruction", tuple[str, ...]]


def _of_table(arguments: argparse.Namespace, progress: PrintedProgress) -> _Made:
    """As the options say."""
    from ..exchange.tables import read_picks
    from ..plausibility import check_plausible
    from ..reconstruction.drag import Drag
    from ..reconstruction.trajectory import reconstruct
    from ..workflow.uprightness import turned_picks

    if not arguments.terrain:
        refuse_terrain_options(arguments, *NO_TERRAIN)
    picks = read_picks(arguments.picks)
    surface = terrain_as_asked(arguments, arguments.terrain, progress) if arguments.terrain else None
    picks, turned = turned_picks(picks, surface)
    block = _block(arguments)
    check_plausible("air_density_kgpm3", arguments.air_density, "density of the air")
    check_plausible("drag_coefficient", arguments.drag_coefficient, "drag coefficient")
    drag = Drag(arguments.air_density, arguments.drag_coefficient) if arguments.drag else None
    progress("Reconstructing")
    with naming(arguments.picks):
        reconstruction = reconstruct(
            picks,
            surface=surface,
            block=block,
            gravity_mps2=arguments.gravity,
            drag=drag,
            normal_radius_m=arguments.normal_radius,
            site=arguments.site,
            eq10=arguments.eq10,
            flights=arguments.flights,
        )
    return surface, reconstruction, turned


def _of_project(arguments: argparse.Namespace, progress: PrintedProgress) -> _Made:
    """As a project says."""
    from ..exchange.project import read_project
    from ..workflow.opening import open_project

    parser = argparse.ArgumentParser()
    add_arguments(parser)
    plain = vars(parser.parse_args([arguments.picks, "--out", arguments.out]))
    for action in parser._actions:
        given = getattr(arguments, action.dest, None) != plain.get(action.dest)
        if given and action.dest not in ("out", "step", "parquet"):
            raise InputError(
                f"{action.option_strings[0]} is what a project says itself", advice="Write it into the project"
            )
    project = read_project(arguments.picks)
    progress("Reconstructing")
    with naming(arguments.picks):
        return *open_project(project), ()


def _block(arguments: argparse.Namespace) -> "Block":
    from ..reconstruction.block import Block

    d1, d2, d3 = arguments.diameters or [arguments.diameter or DEFAULT_DIAMETER_M] * 3
    block = Block(d1, d2, d3, arguments.density, arguments.shape)
    if arguments.mass:
        block = Block(d1, d2, d3, arguments.mass / block.volume_m3, arguments.shape)
    return block
