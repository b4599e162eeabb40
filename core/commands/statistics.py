# SPDX-License-Identifier: GPL-3.0-or-later
"""``rockfall statistics``: what measured impacts say by themselves → tables and figures."""

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..errors import InputError
from .options import (
    add_figure_options,
    add_out,
    add_site_option,
    add_where_option,
    figure_formats,
    impacts_as_asked,
    naming,
    seed,
    tables_as_asked,
    whole,
)
from .progress import PrintedProgress

if TYPE_CHECKING:
    from ..analysis.graphs import GraphSpec
    from ..analysis.group_statistics import Grouping, GroupStatistics
    from ..analysis.statistics import ImpactStatistics
    from ..progress import Progress
    from ..reconstruction.impact import Impacts

EPILOG = """examples:
  rockfall statistics impacts.csv --out statistics
  rockfall statistics project.toml --out statistics
  rockfall statistics impacts.csv --group material --graph normal_spread_deg rn --out statistics
  rockfall statistics gully.csv quarry.csv --group site --where 'flags!=doubtful' --out statistics

Impacts without all coefficients (first and last of a trajectory), and those flagged departing,
into_ground, below_terrain or discarded do not enter, as in compare and calibrate."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of the command."""
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.epilog = EPILOG
    parser.add_argument(
        "impacts",
        nargs="+",
        metavar="IMPACTS",
        help="impacts.csv, of one site or several; a merged package; or a project with picks (.toml, .blend)",
    )
    add_out(parser)
    parser.add_argument(
        "--group",
        metavar="COLUMN",
        help="compare the groups of impacts that a column makes: material, site, trajectory, a flag, any column",
    )
    parser.add_argument(
        "--classes", type=whole, default=0, metavar="N", help="with --group: numbers in N classes of equally many"
    )
    add_where_option(parser)
    add_site_option(parser)
    parser.add_argument(
        "--graph",
        action="append",
        nargs=2,
        default=[],
        metavar=("X", "Y"),
        help="a further figure, of any two variables; can be given again",
    )
    parser.add_argument("--seed", type=seed, default=0, metavar="S", help="of the tests by exchange (default 0)")
    add_figure_options(parser)


def run(arguments: argparse.Namespace) -> int:
    """Read, compute, write, print what it says."""
    from ..analysis.group_statistics import group_statistics
    from ..analysis.statistics import impact_statistics
    from ..exchange.selection import grouping_of
    from ..exchange.statistics_tables import write_statistics
    from ..output import output_folder

    specs = _specs(arguments.graph)
    if arguments.classes and arguments.group is None:
        raise InputError("--classes cuts numbers into groups, and there are no groups", advice="Add --group COLUMN")
    with output_folder(arguments.out) as folder, PrintedProgress() as progress, naming(arguments.impacts[0]):
        impacts, inputs, notes = _read(arguments, progress)
        grouping, groups = None, None
        if arguments.group is not None:
            grouping = grouping_of(impacts, arguments.group, arguments.classes)
        progress("Computing the statistics")
        statistics = impact_statistics(impacts)
        if not statistics.used:
            raise _nothing(impacts)
        if grouping is not None:
            groups = group_statistics(impacts, grouping, seed=arguments.seed, progress=progress)
        remarks = [*statistics.remarks(), *(() if groups is None else groups.remarks())]
        inputs |= {"where": arguments.where, "seed": arguments.seed}
        written = write_statistics(statistics, groups, folder, inputs=inputs, remarks=remarks)
        if not arguments.tables_only:
            notes += _draw(impacts, specs, grouping, folder, figure_formats(arguments), progress)
            written += ["figures"] if (folder / "figures").exists() else []
    if groups is not None and not arguments.classes and _are_numbers_apart(groups):
        notes.append(f"Most groups of {arguments.group} are too small: cut its numbers into classes, as --classes 4.")
    for line in (*notes, *_digest(statistics, groups)):
        print(line)
    print(f"Written: {', '.join(written)} in {arguments.out}")
    return 0


def _are_numbers_apart(groups: "GroupStatistics") -> bool:
    """Whether most groups are too small because each number has its own."""
    if len(groups.tests.left_out) <= len(groups.tests.tested):
        return False
    try:
        return all(float(name) == float(name) for name in groups.groups)
    except ValueError:
        return False


def _nothing(impacts: "Impacts") -> InputError:
    from ..reconstruction.impact import REFUSED

    refused = int(impacts.refused.sum())
    return InputError(
        f"None of the {len(impacts)} impacts can be used: {refused} are flagged ({', '.join(REFUSED)}), "
        f"{len(impacts) - refused} have no R_N, R_T and R",
        advice="They need v1, v2 and the terrain normal: reconstruct with a terrain, and more than two impacts each",
    )


def _specs(graphs: Sequence[Sequence[str]]) -> "list[GraphSpec]":
    from ..analysis.graphs import GraphSpec
    from ..analysis.statistics import stem
    from ..analysis.variables import find_variable

    for pair in graphs:
        for name in pair:
            find_variable(name)
    return [GraphSpec(f"{stem(y)}_{stem(x)}", x, y) for x, y in graphs]


def _read(arguments: argparse.Namespace, progress: "Progress") -> "tuple[Impacts, dict[str, Any], list[str]]":
    """The impacts, where they are from, and what is to be said of that."""
    from ..exchange.database import digest, merge
    from ..exchange.selection import matching, rows_of
    from ..exchange.statistics_tables import described
    from ..reconstruction.summary import normal_radius_in_words

    files, notes = arguments.impacts, []
    if len(files) == 1 and Path(files[0]).is_file() and Path(files[0]).suffix != ".json" and not arguments.site:
        progress(f"Reading {files[0]}", 0, 0)
        impacts = impacts_as_asked(files[0])
        inputs = [{"file": Path(files[0]).name, "sha256": digest(files[0]), "impacts": len(impacts)}]
    else:
        merged = merge(tables_as_asked(arguments, files, progress))
        impacts, inputs = merged.database.impacts, described(merged.database.sources)
        if len(merged.duplicates):
            notes.append(f"{len(merged.duplicates)} impacts were there twice; they count once.")
    if arguments.where:
        found = matching(impacts, arguments.where)
        notes.append(f"{int(found.sum())} of {len(impacts)} impacts meet --where.")
        impacts = rows_of(impacts, found)
    radius = normal_radius_in_words(impacts)
    notes += [radius] if radius else []
    if not len(impacts):
        raise InputError("No impact is left", advice="Check --where")
    return impacts, {"inputs": inputs}, notes


def _draw(
    impacts: "Impacts",
    specs: "Sequence[GraphSpec]",
    grouping: "Grouping | None",
    folder: Path,
    formats: "Sequence[str]",
    progress: "Progress",
) -> list[str]:
    """The figures, if Matplotlib is there; returns what to install otherwise."""
    from ..analysis.measured_figures import save_measured_figures
    from ..extras import FIGURES, install_command, is_there

    if not is_there(FIGURES):
        return [f"No figures without Matplotlib. Install it: {install_command(FIGURES)}"]
    progress("Drawing the figures", 0, 0)
    save_measured_figures(impacts, folder / "figures", specs, grouping, formats)
    return []


def _digest(statistics: "ImpactStatistics", groups: "GroupStatistics | None") -> list[str]:
    from ..analysis.statistics_words import MOST_GROUPS, aligned, class_rows, group_rows

    lines = [
        *map(str, statistics.remarks()),
        "",
        "R_N > 1 by incident angle:",
        *_table(aligned(class_rows(statistics))),
    ]
    if groups is not None:
        lines += ["", f"By {groups.column}, {len(groups.groups)} groups:", *_table(aligned(group_rows(groups)))]
        if len(groups.groups) > MOST_GROUPS:
            lines.append(f"  and {len(groups.groups) - MOST_GROUPS} more in groups.csv")
        lines += ["", *map(str, groups.remarks())]
    return [*lines, ""]


def _table(lines: Sequence[str]) -> list[str]:
    return [f"  {line}" for line in lines]
