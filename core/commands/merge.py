# SPDX-License-Identifier: GPL-3.0-or-later
"""``rockfall merge``: impact tables of several sites → one table with its sources."""

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from ..errors import InputError
from ..formats.csv_cells import CellWriter
from ..output import output_stream
from .options import add_out, add_site_option, add_where_option, for_each, tables_as_asked
from .progress import PrintedProgress

if TYPE_CHECKING:
    from ..exchange.database import Database, Merged


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of the command."""
    parser.add_argument(
        "tables", nargs="+", metavar="TABLE", help="impacts.csv, or the folder of a package that was merged before"
    )
    add_out(parser)
    add_site_option(parser)
    parser.add_argument(
        "--licence",
        action="extend",
        nargs="+",
        default=[],
        metavar="NAME",
        help="of each table, or one for all, for example CC-BY-4.0",
    )
    parser.add_argument(
        "--duplicates",
        choices=("drop", "keep", "refuse"),
        default="drop",
        help="impacts that are there twice: keep the first (default), keep all, or refuse",
    )
    add_where_option(parser)
    parser.add_argument(
        "--group", nargs="+", default=[], metavar="COLUMN", help="medians for each value of these columns → groups.csv"
    )


def run(arguments: argparse.Namespace) -> int:
    """Read, merge, filter, write, print the summary."""
    from ..exchange.database import merge
    from ..exchange.datapackage import write_package
    from ..exchange.selection import column_of, group_medians, matching
    from ..output import output_folder

    licences = for_each(arguments.licence, arguments.tables, "--licence")
    with output_folder(arguments.out) as folder, PrintedProgress() as progress:
        parts = tables_as_asked(arguments, arguments.tables, progress, licences)
        progress("Looking for duplicates")
        merged = merge(parts, arguments.duplicates)
        database = merged.database
        if arguments.where:
            database = database.rows(matching(database.impacts, arguments.where))
        if not len(database):
            raise InputError("No impact is left", advice="Check --where")
        for name in arguments.group:
            column_of(database.impacts, name)
        progress("Writing the table")
        write_package(database, folder)
        written = ["impacts.csv", "datapackage.json"]
        if len(merged.duplicates):
            _write_duplicates(merged, folder / "duplicates.csv")
            written.append("duplicates.csv")
        if arguments.group:
            _write_rows(group_medians(database.impacts, arguments.group), folder / "groups.csv")
            written.append("groups.csv")
    for line in _summary(merged, database, arguments.duplicates):
        print(line)
    print(f"Written: {', '.join(written)} in {arguments.out}")
    return 0


def _write_duplicates(merged: "Merged", path: Path) -> None:
    everything, found = merged.everything, merged.duplicates
    impacts = everything.impacts
    rows = []
    for row, first, renamed in zip(found.row.tolist(), found.first.tolist(), found.renamed.tolist(), strict=True):
        entry: dict[str, object] = {}
        for prefix, i in (("", row), ("same_as_", first)):
            entry[f"{prefix}file"] = everything.sources[int(everything.source[i])].file
            for name in ("site", "trajectory", "impact"):
                entry[f"{prefix}{name}"] = getattr(impacts, name)[i]
        rows.append({**entry, "other_name": "yes" if renamed else "no"})
    _write_rows(rows, path)


def _write_rows(rows: list[dict[str, object]], path: Path) -> None:
    with output_stream(path) as stream:
        writer = CellWriter(stream)
        writer.writerow(rows[0])
        writer.writerows(row.values() for row in rows)


def _summary(merged: "Merged", database: "Database", duplicates: str) -> list[str]:
    found, everything = merged.duplicates, merged.everything
    lines = [f"{len(database)} impacts of {len(everything)} that were read, from {len(everything.sources)} tables:"]
    for source in database.sources:
        licence = source.licence or "no licence stated"
        lines.append(f"  {source.file}: {source.impacts} impacts, {', '.join(source.sites)} ({licence})")
        lines += [f"    Doubtful: {doubt}" for doubt in source.doubts]
    if len(found):
        what = {"drop": "left out", "keep": "kept"}[duplicates]
        renamed = int(found.renamed.sum())
        lines.append(f"{len(found)} impacts were there twice, {renamed} of them under another name; they are {what}.")
    if not all(source.licence for source in everything.sources):
        lines.append("Without a licence others may not use the data: give --licence.")
    return lines
