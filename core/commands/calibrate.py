# SPDX-License-Identifier: GPL-3.0-or-later
"""``rockfall calibrate``: parameters that fit measured impacts → calibration.csv, parameters.toml."""

import argparse
from typing import TYPE_CHECKING

from .fitting_options import (
    add_fit_arguments,
    fit_options,
    parameter_names,
    parameter_values,
    remarks_of,
    table_of,
    wrapped,
)
from .options import add_out, impacts_as_asked, naming
from .progress import PrintedProgress

if TYPE_CHECKING:
    from ..analysis.calibration import Calibration


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of the command."""
    parser.add_argument("impacts", metavar="IMPACTS", help="impacts.csv, or a project with picks (.toml, .blend)")
    add_out(parser)
    parser.add_argument("--model", required=True, metavar="NAME", help="of the model (`rockfall models` lists them)")
    add_fit_arguments(
        parser,
        resamples=200,
        metavar="PARAMETER=VALUE",
        setting="a parameter that is not fitted and is not to have its default",
    )
    parser.add_argument(
        "--no-holdout", action="store_true", help="do not predict each fifth of the trajectories from the others"
    )


def run(arguments: argparse.Namespace) -> int:
    """Fit, write the tables, print the summary."""
    from ..analysis.calibration import calibrate
    from ..exchange.calibration_tables import write_estimates, write_folds
    from ..exchange.parameters import write_parameters
    from ..impact_models.registry import find_model
    from ..output import output_folder

    model = find_model(arguments.model)
    names, fixed = parameter_names(model, arguments.fit), parameter_values(model, arguments.set)
    with output_folder(arguments.out) as folder, PrintedProgress() as progress, naming(arguments.impacts):
        progress(f"Reading {arguments.impacts}")
        impacts, options = impacts_as_asked(arguments.impacts), fit_options(arguments)
        result = calibrate(
            impacts, model.name, names, fixed, options, holdout=not arguments.no_holdout, progress=progress
        )
        write_estimates(model.name, result.estimates, folder / "calibration.csv")
        write_parameters({model.name: result.settings}, folder / "parameters.toml")
        if result.folds:
            write_folds(result.folds, folder / "holdout.csv")
    for line in _summary(result):
        print(line)
    written = "calibration.csv, parameters.toml" + (", holdout.csv" if result.folds else "")
    print(f"Written: {written} in {arguments.out}")
    return 0


def _summary(result: "Calibration") -> list[str]:
    held = f", {result.held_out_score:.3f} on trajectories held out" if result.folds else ""
    return [
        f"{result.model} fitted to {result.impacts} impacts of {result.trajectories} trajectories.",
        *table_of(result.estimates),
        f"Score (0 is perfect): {result.default_score:.3f} before, {result.fitted_score:.3f} fitted{held}.",
        *wrapped(f"It is the {result.objective}."),
        *remarks_of(result),
    ]
