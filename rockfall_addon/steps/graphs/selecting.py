# SPDX-License-Identifier: GPL-3.0-or-later
"""Selecting all, none or the other impacts of the graphs."""

import bpy
from bpy.props import EnumProperty

from ...scene.models import graph_settings
from ...view.graphs import editor, impact_sheet, selection
from ...view.reporting import redraw


class ROCKFALL_OT_select_in_graphs(bpy.types.Operator):
    """Select the impacts that the graphs show, with their objects in the scene"""

    bl_idname = "rockfall.select_in_graphs"
    bl_label = "Select Impacts"
    bl_options = {"UNDO"}

    what: EnumProperty(
        name="What",
        items=[
            ("ALL", "All", "All impacts that a graph shows"),
            ("NONE", "None", "No impact"),
            ("INVERT", "Invert", "Those of the graphs that are not selected"),
            ("BEYOND", "Beyond the Axes", "Those that lie outside of the axes of a graph"),
        ],
    )

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return editor.shows(context)

    def execute(self, context: bpy.types.Context) -> set[str]:
        scene, before = context.scene, selection.selected(context)
        graphs = [(n, impact_sheet.drawn_graph(scene, n)) for n in graph_settings.shown(scene)]
        every = frozenset().union(*(graph.all_impacts() for _, graph in graphs if graph is not None))
        if self.what == "BEYOND":
            chosen = frozenset().union(*(_beyond(scene, n, graph) for n, graph in graphs if graph is not None))
        else:
            chosen = {"ALL": every, "NONE": frozenset(), "INVERT": every - before}[self.what]
        selection.select(context, chosen)
        redraw(context)
        return {"FINISHED"}


def _beyond(scene: bpy.types.Scene, number: int, graph: object) -> selection.Chosen:
    spec = graph_settings.spec_of(graph_settings.graph(scene, number), number)
    return frozenset((source, row) for _, source, row in graph.beyond(*graph.axes(spec)))


CLASSES = (ROCKFALL_OT_select_in_graphs,)
