# SPDX-License-Identifier: GPL-3.0-or-later
"""``rockfall design``: what barriers at screens must have, with the evidence → design.html, design.pdf, screens.csv."""

import argparse
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from ..errors import InputError
from .options import (
    add_model_option,
    add_out,
    add_parameter_options,
    model_parameters,
    models_as_asked,
    not_negative,
    seed,
    share,
    whole,
)
from .progress import PrintedProgress

if TYPE_CHECKING:
    from ..hazard.screens import Screen
    from ..simulation.ground import Ground

CELL_M = 2.0
MOST_BLOCKS = 50_000


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of the command."""
    parser.add_argument(
        "project", metavar="PROJECT", help="a project (.toml, .blend); its simulation says what falls, and where"
    )
    add_out(parser)
    parser.add_argument(
        "--screen",
        action="append",
        default=[],
        metavar="FILE",
        help="lines across the slope or areas, a shapefile, KML, GeoJSON, a GeoPackage or a table; with the "
        "properties height_m and capacity_kJ a barrier that stands there (a project can state its own: "
        "[[simulation.screens]])",
    )
    parser.add_argument(
        "--factors",
        metavar="NAME|FILE",
        help="partial factors: a table that is shipped, or a TOML file of your own (default uni_11211_4_literature; a "
        "wrong name lists them)",
    )
    parser.add_argument(
        "--share",
        type=share,
        metavar="P",
        help="of the blocks that do not exceed the characteristic values, 0.95 or 0.99 (default: that of the factors)",
    )
    add_model_option(parser, "models to design with (default: the project's, else noel_2017)")
    add_parameter_options(parser)
    parser.add_argument(
        "--number",
        type=whole,
        metavar="N",
        help="blocks from each release; with --until-known at most so many (default: as many as make up --most; with "
        "--no-until-known the project's)",
    )
    parser.add_argument(
        "--most",
        type=whole,
        metavar="N",
        help=f"blocks that fall at most with each model until the values are known (default {MOST_BLOCKS})",
    )
    parser.add_argument("--seed", type=seed, metavar="S", help="of the random numbers (default: the project's)")
    parser.add_argument(
        "--cell",
        type=not_negative,
        default=CELL_M,
        metavar="M",
        help="side of the cells of maps [m], 0 for no maps (default %(default)g)",
    )
    parser.add_argument(
        "--until-known",
        action=argparse.BooleanOptionalAction,
        default=True,
        help="blocks fall until energy and height at the screens are known to 5 %%, or as well as more of them would "
        "tell (default); else those of --number, all of them",
    )
    parser.add_argument("--no-holdout", action="store_true", help="no prediction of trajectories that are left out")
    parser.add_argument("--no-pdf", action="store_true", help="no PDF")
    parser.add_argument("--threads", type=whole, metavar="N", help="threads (default: all cores)")


def run(arguments: argparse.Namespace) -> int:
    """Simulate, find what barriers must have, write the page."""
    from ..exchange.partial_factors import USUAL, open_factors
    from ..exchange.project import read_project
    from ..exchange.screens import write_screens
    from ..output import output_folder
    from ..workflow.design_page import write_design
    from ..workflow.design_sheet import design_sheet
    from ..workflow.enough import as_many_as
    from ..workflow.opening import read_project_picks, reconstruct_project
    from ..workflow.scenarios import open_simulation
    from ..workflow.simulation import ground_of

    if arguments.most is not None and (arguments.number is not None or not arguments.until_known):
        raise InputError("--most and --number both say how many blocks fall", advice="Leave out one of the two")

    factors = open_factors(arguments.factors or USUAL)
    file = Path(arguments.project)
    with output_folder(arguments.out) as folder, PrintedProgress() as progress:
        project = read_project(file)
        entry = project.stated_simulation
        releases = entry.releases
        if arguments.number is not None:
            releases = replace(releases, number=arguments.number)
        entry = replace(
            entry,
            models=models_as_asked(arguments.model, entry.models or ("noel_2017",)),
            releases=releases,
            seed=entry.seed if arguments.seed is None else arguments.seed,
        )
        project = replace(project, simulation=entry)
        scenario, inputs = open_simulation(project, file, progress)
        known = model_parameters(arguments, list(scenario.models), scenario.models)
        scenario = replace(scenario, models={name: known.get(name, {}) for name in scenario.models})
        ground = ground_of(scenario)
        screens, screen_files = _screens(arguments.screen, ground, scenario.screens)
        progress("Reconstructing what was measured", 0, 0)
        measured = None
        fixed = arguments.number is not None or not arguments.until_known
        if project.picks is not None and len(read_project_picks(project, None)[0]):
            measured = reconstruct_project(project, ground.surface)
        placed = scenario.releases(ground) if fixed else as_many_as(scenario, ground, arguments.most or MOST_BLOCKS)
        sheet = design_sheet(
            ground,
            placed,
            scenario.settings,
            screens,
            factors,
            title=project.site.name,
            share=arguments.share,
            measured=measured,
            cell_m=arguments.cell or None,
            until_known=arguments.until_known,
            holdout=not arguments.no_holdout,
            threads=arguments.threads,
            progress=progress,
        )
        videos = {f"video {video.name}": video.file for video in project.videos if video.file is not None}
        inputs = inputs | screen_files | videos
        written = write_design(sheet, folder, inputs, pdf=not arguments.no_pdf, progress=progress)
        tallies = {one.settings.model: one.tally for one in sheet.models}
        write_screens(tallies, folder / "screens.csv", {one.settings.model: one.values for one in sheet.models})
    for remark in (*sheet.remarks, *placed.remarks):
        print(remark)
    for one in sheet.models:
        for name, values in one.values.items():
            needed = "not known yet"
            if values.is_known:
                energy, height = f"{values.needed_energy_j / 1000:.3g} kJ", f"{values.needed_height_m:.2f} m"
                needed = f"{energy} (class {values.level}), {height}"
            print(f"{name}, {one.settings.model}: needed {needed}; {values.reach} of {values.blocks} blocks come.")
    print(f"Written: {', '.join([*written, 'screens.csv'])} in {arguments.out}")
    return 0


def _screens(
    files: list[str], ground: "Ground", stated: "tuple[Screen, ...]"
) -> "tuple[tuple[Screen, ...], dict[str, Path]]":
    """The screens that a project states and those of some files, and these files."""
    from ..exchange.screens import read_screens

    if not (files or stated):
        raise InputError("--screen is missing", advice="Give a file with a line across the slope, where the barrier is")
    screens = (*stated, *(screen for file in files for screen in read_screens(file, ground.shift)))
    return screens, {f"screens {Path(file).name}": Path(file) for file in files}
