# SPDX-License-Identifier: GPL-3.0-or-later
"""What all panels share."""

import bpy


class RockfallPanel:
    """Mix-in: where the panels live."""

    bl_space_type = "VIEW_3D"
    bl_region_type = "UI"
    bl_category = "Rockfall"


def advise(layout: bpy.types.UILayout, ready: bool, sentence: str) -> None:
    """One line that says how this step stands and what to do next."""
    layout.label(text=sentence, icon="CHECKMARK" if ready else "RIGHTARROW_THIN")


def facts(layout: bpy.types.UILayout, rows: list[tuple[str, str]]) -> None:
    """A small table: names to the left, values to the right."""
    column = layout.column(align=True)
    for name, value in rows:
        row = column.split(factor=0.55)
        row.label(text=name)
        row.label(text=value)
