# SPDX-License-Identifier: GPL-3.0-or-later
"""``rockfall compare``: what the impact models make of measured impacts → tables, figures and a page."""

import argparse
from collections import Counter
from pathlib import Path
from typing import TYPE_CHECKING

from ..constants import GRAVITY_MPS2
from ..errors import InputError
from .options import (
    NO_TERRAIN,
    add_figure_options,
    add_incident_options,
    add_model_option,
    add_observed_option,
    add_out,
    add_parameter_options,
    add_terrain_files,
    add_terrain_options,
    figure_formats,
    impacts_as_asked,
    measured_as_asked,
    model_parameters,
    models_as_asked,
    naming,
    not_negative,
    refuse_terrain_options,
    terrain_as_asked,
    whole,
)
from .progress import PrintedProgress

if TYPE_CHECKING:
    from ..analysis.comparison import Predictions
    from ..analysis.predicted_flights import PredictedFlights
    from ..analysis.scores import Score
    from ..reconstruction.impact import Impacts

FILES = ("predictions.csv", "scores.csv", "comparison.toml", "predicted_flights.csv", "figures", "report.html")
SHOWN = (("rn", "R_N"), ("rt", "R_T"), ("r", "R"), ("theta_dev_deg", "θ_dev [°]"))


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of the command."""
    parser.add_argument("impacts", metavar="IMPACTS", help="impacts.csv, or a project with picks (.toml, .blend)")
    add_out(parser)
    add_model_option(parser, "models to compare (default: the six of Noël et al. 2018)")
    add_parameter_options(parser)
    add_observed_option(parser, "default: IMPACTS; a trajectory's impacts are always drawn from those of the others")
    parser.add_argument(
        "--replicates",
        type=whole,
        default=1,
        metavar="N",
        help="draws for each impact, besides the mean (default 1, which the figures show; 0: the mean alone)",
    )
    add_incident_options(parser)
    add_figure_options(parser, without="neither figures nor the page")
    parser.add_argument("--title", default="", metavar="TEXT", help="heading of the page")
    group = parser.add_argument_group(
        "predicted flights: the blocks that leave each impact as a model says, and where they land"
    )
    add_terrain_files(group, "the terrain on which they land → predicted_flights.csv")
    group.add_argument(
        "--gravity", type=not_negative, default=GRAVITY_MPS2, metavar="G", help="[m/s²] (default %(default)s)"
    )
    group.add_argument("--drag", action="store_true", help="fly with the drag of air")
    add_terrain_options(parser)


def run(arguments: argparse.Namespace) -> int:
    """Compare, write the tables, print the summary."""
    from ..analysis.comparison import compare
    from ..analysis.scores import scores
    from ..exchange.comparison_tables import write_predictions, write_scores, write_settings
    from ..exchange.predicted_flight_tables import write_predicted_flights
    from ..impact_models.registry import COMPARED
    from ..output import output_folder

    if not arguments.terrain:
        refuse_terrain_options(arguments, *NO_TERRAIN)
        if arguments.drag:
            raise InputError("--drag is of flights over the terrain, and there is none", advice="Give --terrain, too")
    models = models_as_asked(arguments.model, COMPARED)
    parameters = model_parameters(arguments, models)
    measured = measured_as_asked(arguments, models)
    with output_folder(arguments.out) as folder, PrintedProgress() as progress, naming(arguments.impacts):
        progress(f"Reading {arguments.impacts}")
        impacts = impacts_as_asked(arguments.impacts)
        progress("Comparing")
        predictions = compare(
            impacts,
            models,
            parameters,
            replicates=arguments.replicates,
            seed=arguments.seed,
            spin=arguments.spin,
            radius_m=arguments.radius,
            measured=measured,
        )
        marks = scores(impacts, predictions)
        flights = _fly(arguments, impacts, predictions, progress) if arguments.terrain else None
        progress("Writing the tables")
        write_predictions(predictions, folder / "predictions.csv")
        write_scores(marks, folder / "scores.csv")
        write_settings(predictions, folder / "comparison.toml")
        if flights is not None:
            write_predicted_flights(flights, folder / "predicted_flights.csv")
        notes = [] if arguments.tables_only else _draw(arguments, impacts, predictions, marks, folder, progress)
        written = [name for name in FILES if (folder / name).exists()]
    for line in (*_counts(predictions, len(impacts)), *_table(marks), *_landings(flights), *notes):
        print(line)
    print(f"Written: {', '.join(written)} in {arguments.out}")
    return 0


def _fly(
    arguments: argparse.Namespace, impacts: "Impacts", predictions: "Predictions", progress: PrintedProgress
) -> "PredictedFlights":
    from ..analysis.predicted_flights import fly_predictions
    from ..reconstruction.drag import Drag

    surface = terrain_as_asked(arguments, arguments.terrain, progress)
    progress("Flying the predictions")
    drag = Drag() if arguments.drag else None
    return fly_predictions(impacts, predictions, surface, gravity_mps2=arguments.gravity, drag=drag, runs=None)


def _landings(flights: "PredictedFlights | None") -> list[str]:
    """Where the flights of each model's mean land, seen from the real blocks."""
    from ..analysis.predicted_flights import score_landings

    marks = () if flights is None else score_landings(flights)
    lines = ["Landings with each model's mean, and how far they are from the real ones:"] if marks else []
    for mark in marks:
        text = f"median {mark.median_offset_m:.2f} m, 90 % within {mark.p90_offset_m:.1f} m of {mark.n} flights"
        lost = f"; {mark.left_terrain} left the terrain" if mark.left_terrain else ""
        lines.append(f"{mark.model:<24}{text if mark.n else 'no flight is measured'}{lost}")
    return lines


def _draw(
    arguments: argparse.Namespace,
    impacts: "Impacts",
    predictions: "Predictions",
    marks: "tuple[Score, ...]",
    folder: Path,
    progress: PrintedProgress,
) -> list[str]:
    """The figures and the page, as far as their libraries are there; returns what to install for the others."""
    from ..analysis.figures import save_figures
    from ..analysis.graphs import make_sheet
    from ..analysis.report import write_report
    from ..extras import FIGURES, PAGES, install_command, is_there

    notes = []
    if is_there(FIGURES):
        progress("Drawing the figures")
        save_figures(make_sheet(impacts, predictions), folder / "figures", figure_formats(arguments), progress)
    else:
        notes.append(f"No figures without Matplotlib. Install it: {install_command(FIGURES)}")
    if is_there(PAGES):
        progress("Writing the page")
        origin = Path(arguments.impacts).name
        write_report(impacts, predictions, marks, folder / "report.html", origin, arguments.title)
    else:
        notes.append(f"No report.html without Bokeh. Install it: {install_command(PAGES)}")
    return notes


def _counts(predictions: "Predictions", impacts: int) -> list[str]:
    from ..analysis.measured_rebounds import beyond_sentence, measured_sentence

    n, replicates = predictions.row.size, predictions.replicates
    draws = "one draw" if replicates == 1 else f"{replicates} replicates"
    chance = f" and {draws} with seed {predictions.seed}" if replicates else ""
    lines = [f"{n} of {impacts} impacts compared: the mean{chance} of {len(predictions.models)} models."]
    skipped = Counter(reason for _, reason in predictions.skipped)
    lines += [f"Skipped: {number} with {reason}." for reason, number in skipped.items()]
    if predictions.measured is not None and predictions.beyond is not None:
        lines += [measured_sentence(predictions.measured), beyond_sentence(predictions.beyond)]
    return lines


def _table(marks: "tuple[Score, ...]") -> list[str]:
    """Bias and RMSE of each model, in columns."""
    by = {(score.model, score.quantity): score for score in marks}
    head = f"{'bias ± RMSE':<24}" + "".join(f"{name:>17}" for _, name in SHOWN)
    lines = [head.rstrip()]
    for model in dict.fromkeys(score.model for score in marks):
        cells = [by[model, quantity] for quantity, _ in SHOWN]
        texts = [f"{cell.bias:+.2f} ± {cell.rmse:.2f}" if cell.n else "–" for cell in cells]
        lines.append(f"{model:<24}" + "".join(f"{text:>17}" for text in texts))
    return lines
