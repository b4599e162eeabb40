# SPDX-License-Identifier: GPL-3.0-or-later
"""``rockfall simulate``: blocks that fall down the terrain → tables of runs, impacts, motion, hits; maps."""

import argparse
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from ..constants import GRAVITY_MPS2
from ..interrupts import Interrupt
from .options import (
    add_model_option,
    add_motion_options,
    add_observed_option,
    add_out,
    add_parameter_options,
    add_terrain_files,
    add_terrain_options,
    positive,
    seed,
    share,
    whole,
    whole_range,
)
from .progress import PrintedProgress, stopped_by_interrupt
from .release_options import add_release_options
from .simulation_work import Work, work_as_asked
from .tree_options import add_tree_options
from .worker_options import Done, add_worker_options, forget_chunks, several_workers, simulate_on_workers

if TYPE_CHECKING:
    from ..remarks import Remark
    from ..workflow.maps import Mapped


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of the command."""
    parser.add_argument(
        "releases",
        metavar="RELEASES",
        nargs="?",
        help="releases.csv: x_m, y_m and, if not on the terrain, z_m; or a project (.toml, .blend) with all that is "
        "needed; else one of the sources below",
    )
    add_out(parser)
    add_terrain_files(parser, "mesh, grid or cloud; a project names its own")
    add_model_option(parser, "impact models, each of which gets the same blocks")
    add_parameter_options(parser)
    add_observed_option(parser, "needed by that model; a project can give its own")
    parser.add_argument(
        "--posterior",
        action="extend",
        nargs="+",
        default=[],
        metavar="FILE",
        help="posterior.csv of a back-analysis: each block draws its parameters, so results show what is not known",
    )
    parser.add_argument("--seed", type=seed, metavar="S", help="of the random numbers (default 0)")
    add_release_options(parser)
    add_tree_options(parser)
    motion = parser.add_argument_group("motion")
    add_motion_options(motion)
    motion.add_argument("--gravity", type=positive, metavar="G", help=f"[m/s²] (default {GRAVITY_MPS2:g})")
    motion.add_argument(
        "--structure",
        action="append",
        default=[],
        metavar="NAME=FILE",
        help="a wall, a road, a house: a mesh, or a cloud, whose points blocks meet",
    )
    motion.add_argument(
        "--screen",
        action="append",
        default=[],
        metavar="FILE",
        help="lines across the slope or areas, a shapefile, KML, GeoJSON, a GeoPackage or a table: what passes "
        "there; with the properties height_m and capacity_kJ a barrier, and what it holds",
    )
    motion.add_argument(
        "--contact",
        choices=("mesh", "points"),
        help="what of the terrain blocks meet: a surface (default; clouds and grids are meshed), or points alone, "
        "those of a cloud, of a mesh its vertices",
    )
    parser.add_argument(
        "--record",
        metavar="A,B",
        help="tables beside runs.csv: impacts, trajectories, or none (default both; impacts alone from 20000 blocks "
        "on, none from a million)",
    )
    parser.add_argument(
        "--cell",
        type=positive,
        metavar="M",
        help="side of the cells of maps [m]: reach probability, passages, deposits, speed, energy, height → "
        "maps/NAME.tif (default: no maps)",
    )
    parser.add_argument(
        "--faces",
        action="store_true",
        help="maps of the faces of the mesh as well, for cliffs and overhangs: contacts, speed, energy → "
        "maps/faces.gpkg, maps/faces.csv",
    )
    parser.add_argument(
        "--geopackage",
        action="store_true",
        help="also simulation.gpkg for a GIS: releases, stops, screens, what --record names as impacts and paths in "
        "space, and what a project has measured",
    )
    parser.add_argument(
        "--until-known",
        type=share,
        metavar="P",
        help="end as soon as the energy and height that this share of the blocks at a screen does not exceed are known "
        "to 5 %%, 0.95 for example; --number is then the most",
    )
    parser.add_argument(
        "--runs",
        type=whole_range,
        metavar="FIRST-LAST",
        help="only these of all blocks, as a part of the same simulation (default all)",
    )
    parser.add_argument(
        "--check-mesh",
        action="store_true",
        help="also tell how much the run-out depends on the triangles: some of the blocks fall once more, on a mesh "
        "whose triangles are divided until their edges are half a diameter, at least once",
    )
    parser.add_argument("--threads", type=whole, metavar="N", help="default: all cores; the result is the same")
    add_worker_options(parser)
    add_terrain_options(parser)


def run(arguments: argparse.Namespace) -> int:
    """Simulate, write the tables, print the summary."""
    from ..output import output_folder

    simulate = simulate_on_workers if several_workers(arguments) else _simulate_here
    with output_folder(arguments.out) as folder, PrintedProgress() as progress:
        work = work_as_asked(arguments, progress)
        if arguments.check_mesh:
            work = _with_checked_mesh(work, progress)
        done = simulate(arguments, work, folder, progress)
    forget_chunks(done.kept)
    for sentence in (*work.scenario.terrain.summary, *done.remarks):
        print(sentence)
    print(f"Written: {', '.join(done.written)} in {arguments.out}")
    if done.asked:
        raise Interrupt(done.asked, f"what was finished is written in {arguments.out}")
    return 0


def _with_checked_mesh(work: Work, progress: PrintedProgress) -> Work:
    """The same, with what a finer mesh changes."""
    from ..workflow.mesh_check import change_remarks, mesh_changes

    with stopped_by_interrupt(progress) as counted:
        changes = mesh_changes(work.scenario, work.ground, work.releases, progress=counted)
    return replace(work, mesh_remarks=tuple(change_remarks(changes)))


def _simulate_here(arguments: argparse.Namespace, work: Work, folder: Path, progress: PrintedProgress) -> Done:
    """Simulate in this process, and write the tables into the folder."""
    from ..exchange.simulation_geopackage import GEOPACKAGE, write_simulation_geopackage
    from ..remarks import gravest_first
    from ..workflow.simulation_output import write_simulations

    mapped, asked = _fallen(arguments, work, progress)
    remarks = gravest_first(_remarks(mapped, work))
    written = write_simulations(
        mapped.simulations, folder, record=work.record, inputs=work.inputs, mapped=mapped, remarks=remarks,
        progress=progress,
    )  # fmt: skip
    if arguments.geopackage:
        write_simulation_geopackage(
            mapped.simulations, folder / GEOPACKAGE, measured=work.measured, screens=work.screens, progress=progress
        )
        written.append(GEOPACKAGE)
    return Done(written, remarks, asked=asked)


def _fallen(arguments: argparse.Namespace, work: Work, progress: PrintedProgress) -> "tuple[Mapped, int]":
    """The runs of all models, with their maps and what passed at screens; what is finished at an interrupt, and the
    number of its signal."""
    from ..workflow.maps import Mapped, map_models
    from ..workflow.simulation import run_models
    from ..workflow.simulation_output import recorded_for

    scenario, record = work.scenario, recorded_for(work.record, bool(work.scenario.structures))
    with stopped_by_interrupt(progress, keeps=True) as counted:
        if work.cell_m is None and not work.faces and not work.screens:
            simulations = run_models(
                work.ground, work.releases, scenario.settings,
                record=record, first_run=work.first_run, threads=arguments.threads, progress=counted,
            )  # fmt: skip
            return Mapped(simulations, {}), counted.asked
        mapped = map_models(
            work.ground, work.releases, scenario.settings, work.cell_m, work.screens, faces=work.faces,
            until_known=work.until_known, record=record, first_run=work.first_run, threads=arguments.threads,
            progress=counted,
        )  # fmt: skip
        return mapped, counted.asked


def _remarks(mapped: "Mapped", work: Work) -> "list[Remark]":
    """What there is to say of them."""
    from ..workflow.enough import enough_remarks
    from ..workflow.maps import map_remarks
    from ..workflow.screens import outside_remarks, screen_remarks
    from ..workflow.simulation import remarks_of

    said = [
        *remarks_of(mapped.simulations, list(work.scenario.models)),
        *work.mesh_remarks,
        *map_remarks(mapped.cells),
        *outside_remarks(work.screens, work.ground),
        *screen_remarks(mapped.screens),
    ]
    if work.until_known is not None:
        for model, tally in mapped.screens.items():
            said += enough_remarks(model, tally, work.until_known)
    return said
