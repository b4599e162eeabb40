# SPDX-License-Identifier: GPL-3.0-or-later
"""``rockfall equivalent``: parameters with which one model behaves like another → equivalent.csv, parameters.toml."""

import argparse
from typing import TYPE_CHECKING

from .fitting_options import add_fit_arguments, fit_options, parameter_names, parameter_values, remarks_of, table_of
from .options import add_out, naming
from .progress import PrintedProgress

if TYPE_CHECKING:
    from ..analysis.equivalence import Equivalence


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of the command."""
    parser.add_argument("impacts", metavar="IMPACTS", help="impacts.csv; only the state before each impact is used")
    add_out(parser)
    parser.add_argument("--from", dest="source", required=True, metavar="NAME", help="the model to be imitated")
    parser.add_argument("--to", dest="target", required=True, metavar="NAME", help="the model that is to imitate it")
    add_fit_arguments(
        parser,
        resamples=100,
        metavar="[NAME.]PARAMETER=VALUE",
        setting="a parameter that is not to have its default, of the model to be imitated unless NAME says otherwise",
    )


def run(arguments: argparse.Namespace) -> int:
    """Find the parameters, write the tables, print the summary."""
    from ..analysis.equivalence import equivalent
    from ..exchange.calibration_tables import write_estimates
    from ..exchange.parameters import write_parameters
    from ..exchange.tables import read_impacts
    from ..impact_models.registry import find_model
    from ..output import output_folder

    a, b = find_model(arguments.source), find_model(arguments.target)
    names = parameter_names(b, arguments.fit)
    of_b = [text for text in arguments.set if text.startswith(f"{b.name}.") and a is not b]
    given = parameter_values(a, [text for text in arguments.set if text not in of_b])
    fixed = parameter_values(b, of_b)
    with output_folder(arguments.out) as folder, PrintedProgress() as progress, naming(arguments.impacts):
        progress(f"Reading {arguments.impacts}")
        impacts, options = read_impacts(arguments.impacts), fit_options(arguments)
        result = equivalent(impacts, a.name, given, b.name, names, fixed, options, progress=progress)
        write_estimates(b.name, result.estimates, folder / "equivalent.csv")
        write_parameters({a.name: result.source_settings, b.name: result.settings}, folder / "parameters.toml")
    for line in _summary(result):
        print(line)
    print(f"Written: equivalent.csv, parameters.toml in {arguments.out}")
    return 0


def _summary(result: "Equivalence") -> list[str]:
    return [
        f"{result.model} made like {result.source}, on {result.impacts} impacts of {result.trajectories} trajectories.",
        *table_of(result.estimates),
        f"Energy distance (0 is the same): {result.default_distance:.3f} before, {result.distance:.3f} fitted.",
        *remarks_of(result),
    ]
