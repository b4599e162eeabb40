# SPDX-License-Identifier: GPL-3.0-or-later
"""What the statistics of impacts write: tables of all impacts and of their groups, and summary.json."""

import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict
from importlib import import_module
from math import isfinite
from pathlib import Path
from typing import Any

from ..analysis.group_statistics import GroupStatistics
from ..analysis.statistics import ImpactStatistics
from ..formats.csv_cells import CellWriter
from ..output import output_stream, write_text
from ..remarks import Remark, to_plain
from .database import Source

STATISTICS = ("name", "value", "unit", "note")
CLASSES = ("group", "theta1_low_deg", "theta1_high_deg", "impacts", "rn_above_one", "share", "share_low", "share_high")
TESTS = ("quantity", "n", "groups", "h", "epsilon2", "p", "p_holm", "p_independent", "differs")
PAIRS = ("quantity", "first", "second", "median_first", "median_second", "cliffs_delta", "p", "p_holm", "differs")


def write_statistics(
    statistics: ImpactStatistics,
    groups: GroupStatistics | None,
    folder: Path,
    *,
    inputs: Mapping[str, Any],
    remarks: Sequence[Remark],
) -> list[str]:
    """Write the tables and summary.json; returns the names of the files.

    Parameters
    ----------
    inputs : what summary.json says of where the impacts are from.
    remarks : for summary.json.
    """
    _write(folder / "statistics.csv", STATISTICS, statistics.as_rows())
    named = {"": statistics, **({} if groups is None else groups.groups)}
    _write(folder / "angle_classes.csv", CLASSES, (row for name, one in named.items() for row in _classes(name, one)))
    written = ["statistics.csv", "angle_classes.csv"]
    if groups is not None:
        _write_groups(statistics, groups, folder / "groups.csv")
        tests = groups.tests
        _write(
            folder / "group_tests.csv",
            TESTS,
            (
                (t.quantity, t.n, t.groups, t.statistic, t.effect, t.p, t.p_holm, t.p_independent, _yes(t.differs))
                for t in tests.tests
            ),
        )
        written += ["groups.csv", "group_tests.csv"]
        if tests.pairs:
            _write(folder / "group_pairs.csv", PAIRS, ((*asdict(p).values(), _yes(p.differs)) for p in tests.pairs))
            written.append("group_pairs.csv")
    _write_summary(folder / "summary.json", statistics, groups, inputs, remarks)
    return [*written, "summary.json"]


def described(sources: Iterable[Source]) -> list[dict[str, Any]]:
    """The sources of impacts for summary.json."""
    return [{"file": one.file, "sha256": one.sha256, "impacts": one.impacts} for one in sources]


def _write_groups(statistics: ImpactStatistics, groups: GroupStatistics, path: Path) -> None:
    """One row for each group; the columns are the names of statistics.csv."""
    rows = {name: {row[0]: row[1] for row in one.as_rows()} for name, one in groups.groups.items()}
    names = dict.fromkeys(row[0] for row in statistics.as_rows())
    _write(path, ("group", *names), ((group, *(row.get(name, "") for name in names)) for group, row in rows.items()))


def _classes(group: str, statistics: ImpactStatistics) -> Iterable[Sequence[object]]:
    for one in statistics.classes:
        yield group, one.low_deg, one.high_deg, one.n, one.above_one, one.share, *one.interval


def _write_summary(
    path: Path,
    statistics: ImpactStatistics,
    groups: GroupStatistics | None,
    inputs: Mapping[str, Any],
    remarks: Sequence[Remark],
) -> None:
    content: dict[str, Any] = {
        "version": str(import_module((__package__ or "").partition(".core")[0]).__version__),
        **inputs,
        "statistics": {row[0]: _known(row[1]) for row in statistics.as_rows()},
    }
    if groups is not None:
        tests = groups.tests
        content["groups"] = {
            "column": groups.column,
            "impacts_used": {name: one.used for name, one in groups.groups.items()},
            "impacts_without": groups.undefined,
            "exchanged": tests.exchanged,
            "exchanges": tests.exchanges,
            "not_tested": list(tests.left_out),
            "tests": [{key: _known(value) for key, value in asdict(test).items()} for test in tests.tests],
        }
    content["remarks"] = to_plain(remarks)
    write_text(path, json.dumps(content, indent=2, ensure_ascii=False) + "\n")


def _write(path: Path, header: Sequence[str], rows: Iterable[Sequence[object]]) -> None:
    with output_stream(path) as stream:
        writer = CellWriter(stream)
        writer.writerow(header)
        writer.writerows([["" if cell != cell else cell for cell in row] for row in rows])


def _known(value: object) -> object:
    """For JSON, which has no NaN."""
    return value if not isinstance(value, float) or isfinite(value) else None


def _yes(value: bool) -> str:
    return "yes" if value else "no"
