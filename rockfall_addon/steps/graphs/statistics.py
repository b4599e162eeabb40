# SPDX-License-Identifier: GPL-3.0-or-later
"""The sidebar of the graphs: what the measured impacts say by themselves."""

from collections.abc import Sequence

import bpy

from ....core.analysis.group_statistics import group_statistics
from ....core.analysis.statistics_words import class_rows, group_cells, summary_rows
from ....core.errors import RockfallError
from ....core.progress import Progress
from ...scene.models import graph_settings
from ...scene.picks import statistics
from ...view import job
from ...view.graphs.panel import GraphPanel
from ...view.job import InBackground, Work
from ...view.panel import paragraph, show_remarks
from ...view.reporting import possible

MOST_GROUPS = 12


class ROCKFALL_PT_graph_statistics(GraphPanel, bpy.types.Panel):
    """Fits and counts of the measured impacts that are shown, of all and of the groups that colour them."""

    bl_label = "Statistics"
    bl_idname = "ROCKFALL_PT_graph_statistics"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context: bpy.types.Context) -> None:
        layout, found = self.layout, statistics.statistics_of(context.scene)
        if found.whole is None:
            layout.label(text="No measured impact is shown", icon="INFO")
            return
        _table(layout, summary_rows(found.whole))
        layout.label(text="Rɴ > 1 by incident angle")
        _table(layout, [(angle, f"{above} of {n}") for angle, n, above, _ in class_rows(found.whole)[1:]])
        if not found.groups:
            layout.label(text="Colour the points by a column to see its groups", icon="INFO")
            return
        header, body = layout.panel("ROCKFALL_graph_statistics_groups")
        header.label(text=f"By {found.column}")
        if body is not None:
            rows = group_cells(found.groups, MOST_GROUPS)
            _table(body, rows)
            if len(found.groups) > MOST_GROUPS:
                body.label(text=f"and {len(found.groups) - MOST_GROUPS} more")
            _draw_tests(context, body, found)


def _draw_tests(context: bpy.types.Context, layout: bpy.types.UILayout, found: statistics.SceneStatistics) -> None:
    """Whether the groups differ, or how to find out."""
    job.draw(context, layout, "graphs")
    if found.tests is None:
        layout.operator("rockfall.test_groups", icon="VIEWZOOM")
        return
    show_remarks(context, layout, found.tests.remarks())
    paragraph(context, layout, f"As {found.command} tells of these impacts.", "INFO")


class ROCKFALL_OT_test_groups(InBackground, bpy.types.Operator):
    """Test whether the groups that colour the points differ, and which pairs of them, in the background"""

    bl_idname = "rockfall.test_groups"
    bl_label = "Test Whether Groups Differ"
    bl_options = {"REGISTER"}
    looks_only = True

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        there = len(statistics.statistics_of(context.scene).groups) > 1
        return possible(cls, there, "Colour the points by a column with several groups first") and job.is_free(cls)

    def prepare(self, context: bpy.types.Context) -> Work:
        asked = statistics.statistics_of(context.scene)

        def compute(progress: Progress) -> object:
            return group_statistics(asked.impacts, asked.grouping, progress=progress)

        def keep(scene: bpy.types.Scene, found: object) -> str:
            if not statistics.keep_tests(scene, asked, found):
                raise RockfallError("Impacts, filters or colours have changed meanwhile: test the groups again.")
            graph_settings.redraw()
            return f"{found.remarks()[0].text}"

        return Work("graphs", compute, keep)


def _table(layout: bpy.types.UILayout, rows: Sequence[Sequence[str]]) -> None:
    """Columns of text, the first to the left, the others to the right."""
    first, *others = zip(*rows, strict=True)
    split = layout.box().split(factor=0.55 if len(others) == 1 else 0.4)
    _column(split, first, "LEFT")
    row = split.row()
    for cells in others:
        _column(row, cells, "RIGHT")


def _column(layout: bpy.types.UILayout, cells: Sequence[str], side: str) -> None:
    column = layout.column(align=True)
    column.alignment = side
    for cell in cells:
        column.label(text=cell)


CLASSES = (ROCKFALL_OT_test_groups, ROCKFALL_PT_graph_statistics)
