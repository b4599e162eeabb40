# SPDX-License-Identifier: GPL-3.0-or-later
"""What of a project is shown to others: options of `web` and `export`."""

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from ..errors import InputError
from .options import (
    add_model_option,
    add_parameter_options,
    add_terrain_colours,
    model_parameters,
    models_as_asked,
    seed,
    whole,
)

if TYPE_CHECKING:
    from ..outreach.show import ShowRequest


def add_show_options(parser: argparse.ArgumentParser) -> None:
    """The project, and which blocks beside the measured ones."""
    from ..film.simulated import NUMBER

    parser.add_argument("project", metavar="PROJECT", type=Path, help="project.toml or a .blend")
    add_model_option(
        parser,
        "let blocks of impact models fall beside the real ones, from the same starts to their ends",
        "--simulate",
    )
    parser.add_argument(
        "--number", type=whole, metavar="N", help=f"simulated blocks for each real one and model (default {NUMBER})"
    )
    parser.add_argument("--seed", type=seed, metavar="S", help="of the simulation's random numbers (default 0)")
    add_parameter_options(parser)
    parser.add_argument(
        "--as-observed",
        action="store_true",
        help="blocks start when they did, one after the other (default: all at the same moment)",
    )
    add_terrain_colours(parser)


def show_as_asked(arguments: argparse.Namespace) -> "ShowRequest":
    """What the options ask for.

    Raises
    ------
    InputError : they contradict each other, or name what there is not.
    """
    from ..exchange.parameters import checked_parameters
    from ..exchange.project import read_project
    from ..film.composed.ground import check_terrain_colours
    from ..film.simulated import NUMBER, check_number
    from ..outreach.show import ShowRequest

    simulate = models_as_asked(arguments.simulate, flag="--simulate")
    if not simulate and (arguments.number is not None or arguments.seed is not None):
        raise InputError("--number and --seed are of simulated blocks", advice="Add --simulate and a model")
    number = NUMBER if arguments.number is None else arguments.number
    check_number(number, len(simulate))
    project = read_project(arguments.project)
    known = checked_parameters(project.extra["models"], arguments.project) if "models" in project.extra else None
    parameters = model_parameters(arguments, simulate, known)
    return ShowRequest(
        arguments.project,
        simulate,
        number,
        arguments.seed or 0,
        parameters,
        not arguments.as_observed,
        check_terrain_colours(arguments.terrain_colours or "auto"),
    )
