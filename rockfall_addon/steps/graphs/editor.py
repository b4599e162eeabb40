# SPDX-License-Identifier: GPL-3.0-or-later
"""The type of editor that shows graphs of impacts."""

import bpy

from ...scene.models import graph_settings
from ...view.graphs import editor, impact_sheet, selection
from . import menus


class RockfallImpactGraphs(bpy.types.NodeTree):
    """Graphs of measured impacts and of what models make of them"""

    bl_idname = editor.IMPACTS
    bl_label = "Rockfall Graphs"
    bl_icon = "GRAPH"


CLASSES = (RockfallImpactGraphs,)


def register() -> None:
    editor.add(
        editor.Content(
            editor.IMPACTS,
            "Impacts",
            impact_sheet.draw,
            menus.draw_header,
            impact_sheet.point,
            graph_settings.set_limits,
            graph_settings.reset,
        )
    )


def unregister() -> None:
    editor.remove(editor.IMPACTS)
    impact_sheet.forget()
    selection.forget()
