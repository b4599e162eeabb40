# SPDX-License-Identifier: GPL-3.0-or-later
"""The statistics of the measured impacts that the graphs show, of all and of the groups that colour them."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import bpy
import numpy as np

from ...core.analysis.columns import column_titles, find_column, passing
from ...core.analysis.group_statistics import Grouping, group_by_number, group_by_text
from ...core.analysis.statistics import ImpactStatistics, impact_statistics, statistics_by_number
from ...core.exchange.selection import joined, rows_of
from ...core.reconstruction.impact import Impacts
from . import comparison, graph_settings

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
    """

    whole: ImpactStatistics | None = None
    column: str = ""
    groups: Mapping[str, ImpactStatistics] = field(default_factory=dict)


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
    grouping = _grouping(impacts, column)
    groups = statistics_by_number(impacts, grouping.number, len(grouping.names))
    return SceneStatistics(impact_statistics(impacts), titles[column], dict(zip(grouping.names, groups, strict=True)))


def _grouping(impacts: Impacts, name: str) -> Grouping:
    column = find_column(impacts, name)
    if column.numbers is not None:
        return group_by_number(name, column.numbers, CLASSES_OF_NUMBERS)
    return group_by_text(name, np.zeros(len(impacts), dtype="U1") if column.texts is None else column.texts)
