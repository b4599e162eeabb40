# SPDX-License-Identifier: GPL-3.0-or-later
"""The statistics of the measured impacts that the graphs show, of all and of the groups that colour them."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import bpy

from ....core.analysis.columns import column_titles, find_column, passing
from ....core.analysis.group_statistics import Grouping, GroupStatistics
from ....core.analysis.statistics import ImpactStatistics, impact_statistics, statistics_by_number
from ....core.exchange.selection import grouping_of, joined, rows_of
from ....core.reconstruction.impact import Impacts
from ..models import comparison, graph_settings

CLASSES_OF_NUMBERS = 3
"""So many groups does a column of numbers make."""


@dataclass(frozen=True, eq=False)
class SceneStatistics:
    """What the measured impacts say.

    Attributes
    ----------
    whole : of all; None without an impact that passes the filters.
    column : title of the column that makes the groups; empty for none.
    groups : name → statistics.
    impacts, grouping : what the groups are of, and which impact is in which; None without groups.
    tests : whether the groups differ, once that was asked for.
    """

    whole: ImpactStatistics | None = None
    column: str = ""
    groups: Mapping[str, ImpactStatistics] = field(default_factory=dict)
    impacts: Impacts | None = None
    grouping: Grouping | None = None
    tests: GroupStatistics | None = None

    @property
    def command(self) -> str:
        """What says the same on the command line."""
        name = "" if self.grouping is None else self.grouping.column
        numbers = self.impacts is not None and find_column(self.impacts, name).numbers is not None
        return f"rockfall statistics --group {name}{f' --classes {CLASSES_OF_NUMBERS}' if numbers else ''}"


_kept: dict[int, tuple[object, SceneStatistics]] = {}  # session_uid of a scene → what for, and what was found


def statistics_of(scene: bpy.types.Scene) -> SceneStatistics:
    """The statistics of what passes the filters, kept until something of it changes."""
    compared = comparison.comparison_of(scene)
    column = scene.rockfall_graphs.colour_by
    key = (compared.measured, compared.others, graph_settings.filters_of(scene), column)
    if scene.session_uid not in _kept or _kept[scene.session_uid][0] != key:
        for gone in _kept.keys() - {one.session_uid for one in bpy.data.scenes}:
            del _kept[gone]
        _kept[scene.session_uid] = key, _find(scene, compared, column)
    return _kept[scene.session_uid][1]


def keep_tests(scene: bpy.types.Scene, asked: SceneStatistics, tests: GroupStatistics) -> bool:
    """Show beside the statistics whether their groups differ; whether they are still those that were asked about."""
    if statistics_of(scene) is not asked:
        return False
    _kept[scene.session_uid] = _kept[scene.session_uid][0], replace(asked, tests=tests)
    return True


def _find(scene: bpy.types.Scene, compared: comparison.SceneComparison, column: str) -> SceneStatistics:
    tables = [one for one in (compared.impacts, *(other.impacts for other in compared.others)) if one is not None]
    filters = graph_settings.filters_of(scene)
    shown = [rows_of(table, passing(table, filters)) for table in tables]
    shown = [table for table in shown if len(table)]
    if not shown:
        return SceneStatistics()
    impacts = shown[0] if len(shown) == 1 else joined(shown)
    titles = column_titles([impacts])
    if column not in titles:
        return SceneStatistics(impact_statistics(impacts))
    numbers = find_column(impacts, column).numbers is not None
    grouping = grouping_of(impacts, column, CLASSES_OF_NUMBERS if numbers else 0)
    groups = dict(zip(grouping.names, statistics_by_number(impacts, grouping.number, len(grouping.names)), strict=True))
    return SceneStatistics(impact_statistics(impacts), titles[column], groups, impacts, grouping)
