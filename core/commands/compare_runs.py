# SPDX-License-Identifier: GPL-3.0-or-later
"""``rockfall compare-runs``: whole runs of observed blocks beside simulated ones → tables and figures."""

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from .observed_run_options import add_observed_arguments, case_as_asked, sections_as_asked
from .options import add_model_option, figure_formats, whole
from .progress import PrintedProgress, stopped_by_interrupt

if TYPE_CHECKING:
    from ..analysis.whole_runs import WholeRuns
    from ..simulation.ground import Ground

NUMBER = 100


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of the command."""
    add_observed_arguments(parser)
    add_model_option(parser, "models to simulate with (default: the project's, else the six of Noël et al. 2018)")
    parser.add_argument(
        "--number",
        type=whole,
        default=NUMBER,
        metavar="N",
        help="blocks for each observed one and model (default %(default)s)",
    )


def run(arguments: argparse.Namespace) -> int:
    """Simulate, compare, write the tables, print the summary."""
    from ..analysis.whole_runs import whole_run_remarks
    from ..exchange.simulation_tables import summary, write_runs, write_summary
    from ..exchange.whole_run_tables import write_whole_runs, write_whole_values
    from ..output import output_folder
    from ..workflow.whole_runs import compare_whole_runs

    with output_folder(arguments.out) as folder, PrintedProgress() as progress:
        case = case_as_asked(arguments, arguments.model, arguments.number, progress)
        sections = sections_as_asked(arguments, case.ground)
        with stopped_by_interrupt(progress) as counted:
            done = compare_whole_runs(
                case.ground,
                case.observed,
                case.releases,
                case.scenario.settings,
                sections,
                completeness=case.completeness,
                seed=case.scenario.seed,
                threads=arguments.threads,
                progress=counted,
            )
        remarks = (*done.remarks, *whole_run_remarks(done.comparison))
        progress("Writing the tables")
        write_whole_runs(done.comparison, folder / "whole_runs.csv")
        write_whole_values(done.comparison, folder / "whole_values.csv")
        write_runs(done.simulations, folder / "runs.csv")
        write_summary(summary(done.simulations, case.inputs, remarks), folder / "summary.json")
        notes = [] if arguments.tables_only else _draw(arguments, done.comparison, case.ground, folder, progress)
        names = ("whole_runs.csv", "whole_values.csv", "runs.csv", "summary.json", "figures")
        written = [name for name in names if (folder / name).exists()]
    for line in (*remarks, *notes):
        print(line)
    print(f"Written: {', '.join(written)} in {arguments.out}")
    return 0


def _draw(
    arguments: argparse.Namespace, comparison: "WholeRuns", ground: "Ground", folder: Path, progress: PrintedProgress
) -> list[str]:
    """The figures, if their library is there; else what to install."""
    from ..analysis.whole_run_figures import save_whole_run_figures
    from ..extras import FIGURES, install_command, is_there

    if not is_there(FIGURES):
        return [f"No figures without Matplotlib. Install it: {install_command(FIGURES)}"]
    progress("Drawing the figures")
    save_whole_run_figures(comparison, ground, folder / "figures", figure_formats(arguments))
    return []
