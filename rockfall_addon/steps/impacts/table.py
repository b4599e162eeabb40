# SPDX-License-Identifier: GPL-3.0-or-later
"""The impact table: sortable, as many columns as the width has room for; a click goes to the impact."""

import math
from collections.abc import Sequence

import bpy

from ...scene.picks import impact_marks, impact_rows
from ...scene.storage import store
from ...view import impact_words
from ...view.panel import RockfallPanel, Rows, paragraph

WIDTHS = {  # of the columns in pixels at interface scale 1, in the order in which they are shown
    "trajectory": 72,
    "time_s": 62,
    "speed1_mps": 46,
    "speed2_mps": 46,
    "rn": 46,
    "rt": 46,
    "r": 46,
    "theta1_deg": 46,
    "theta_dev_deg": 50,
    "flags": 120,
}
IMPORTANCE = (
    "trajectory",
    "r",
    "time_s",
    "rn",
    "rt",
    "speed1_mps",
    "speed2_mps",
    "theta1_deg",
    "theta_dev_deg",
    "flags",
)
HEADINGS = {
    "trajectory": "Run",
    "time_s": "Time",
    "speed1_mps": "v₁",
    "speed2_mps": "v₂",
    "rn": "R_N",
    "rt": "R_T",
    "r": "R",
    "theta1_deg": "θ₁",
    "theta_dev_deg": "θ_dev",
    "flags": "Flags",
}
FORMATS = {"time_s": ".3f", "theta1_deg": ".1f", "theta_dev_deg": ".1f", "speed1_mps": ".1f", "speed2_mps": ".1f"}
MARGIN = 70  # of the list, its scroll bar and the panel, in pixels at interface scale 1


def columns_for(width: float) -> list[str]:
    """The columns that find room in a width, the more important ones first; `width` at interface scale 1 [px]."""
    room, chosen = width - MARGIN, []
    for name in IMPORTANCE:
        if room < WIDTHS[name] and chosen:
            break
        chosen.append(name)
        room -= WIDTHS[name]
    return [name for name in WIDTHS if name in chosen]


def arranged(
    rows: Sequence[bpy.types.PropertyGroup], settings: bpy.types.PropertyGroup, trajectory: str | None
) -> tuple[list[bool], list[int]]:
    """Of each row, whether it is listed, and its place; numbers that are not defined come last.

    trajectory : of the selected pick, for the filter.
    """
    name = settings.table_sort

    def key(row: bpy.types.PropertyGroup) -> tuple:
        if name in ("trajectory", "flags"):
            text = getattr(row, name)
            return (name == "flags" and not text, _natural(text), row.number)
        value = getattr(row, name)
        return (True, 0.0) if math.isnan(value) else (False, value)

    undefined = [key(row)[0] for row in rows]
    order = sorted(range(len(rows)), key=lambda i: key(rows[i])[1:], reverse=settings.table_descending)
    order.sort(key=lambda i: undefined[i])
    place = [0] * len(rows)
    for position, i in enumerate(order):
        place[i] = position
    shown = [
        (not settings.table_flagged or bool(row.flags))
        and (not settings.table_trajectory or trajectory is None or row.trajectory == trajectory)
        for row in rows
    ]
    return shown, place


def _natural(text: str) -> list[tuple[bool, str | int]]:
    """A key by which block 10 comes after block 9."""
    parts: list[tuple[bool, str | int]] = []
    number = ""
    for letter in f"{text} ":
        if letter.isdecimal():
            number += letter
            continue
        if number:
            parts.append((False, int(number)))
            number = ""
        parts.append((True, letter))
    return parts


def _text(row: bpy.types.PropertyGroup, name: str) -> str:
    if name == "trajectory":
        return f"{row.trajectory} {row.number}"
    value = getattr(row, name)
    if name == "flags":
        return value.replace(";", ", ").replace("_", " ")
    return "–" if math.isnan(value) else f"{value:{FORMATS.get(name, '.2f')}}"


def _cells(layout: bpy.types.UILayout, columns: Sequence[str]) -> list[tuple[str, bpy.types.UILayout]]:
    """One cell for each column, as wide as its share."""
    cells, rest, total = [], layout, sum(WIDTHS[name] for name in columns)
    for name in columns[:-1]:
        split = rest.split(factor=WIDTHS[name] / total, align=True)
        cells.append((name, split.row(align=True)))
        rest, total = split.row(align=True), total - WIDTHS[name]
    return [*cells, (columns[-1], rest)]


class ROCKFALL_UL_impacts(Rows, bpy.types.UIList):
    """Rows of the impact table."""

    bl_idname = "ROCKFALL_UL_impacts"

    def draw_row(self, layout: bpy.types.UILayout, item: bpy.types.PropertyGroup) -> None:
        for name, cell in _cells(layout, columns_for(float(self.list_id))):
            cell.label(text=_text(item, name), icon="ERROR" if name == "trajectory" and _alarming(item) else "NONE")

    def filter_items(self, context: bpy.types.Context, data: bpy.types.Scene, name: str) -> tuple[list[int], list[int]]:
        pick = impact_rows.selected(context)
        trajectory = pick[store.TRAJECTORY] if pick is not None else None
        shown, place = arranged(list(getattr(data, name)), context.scene.rockfall, trajectory)
        return [self.bitflag_filter_item if seen else 0 for seen in shown], place


def _alarming(row: bpy.types.PropertyGroup) -> bool:
    return row.r > 1.0 or any(flag in impact_marks.ALARMING for flag in row.flags.split(";"))


class ROCKFALL_PT_impact_table(RockfallPanel, bpy.types.Panel):
    bl_label = "Impact Table"
    bl_idname = "ROCKFALL_PT_impact_table"
    bl_options = {"DEFAULT_CLOSED"}
    needs = store.PICK_ROLE

    def draw(self, context: bpy.types.Context) -> None:
        self.draw_table(self.layout, context, context.region.width / context.preferences.system.ui_scale)
        self.layout.operator("rockfall.impact_table", text="All Columns", icon="WINDOW")

    @staticmethod
    def draw_table(layout: bpy.types.UILayout, context: bpy.types.Context, width: float) -> None:
        """The filters, the headings that sort, the rows; `width` at interface scale 1 [px]."""
        scene = context.scene
        settings = scene.rockfall
        row = layout.row(align=True)
        row.prop(settings, "table_trajectory", toggle=True, text="This run" if width < 300 else "This trajectory only")
        row.prop(settings, "table_flagged", toggle=True, text="Flagged")
        head = layout.row(align=True)
        for name, cell in _cells(head, columns_for(width)):
            sorted_here = name == settings.table_sort
            icon = ("TRIA_DOWN" if settings.table_descending else "TRIA_UP") if sorted_here else "NONE"
            cell.operator("rockfall.sort_impacts", text=HEADINGS[name], icon=icon, depress=sorted_here).column = name
        layout.template_list(
            "ROCKFALL_UL_impacts",
            f"{width:.0f}",
            scene,
            "rockfall_impacts",
            settings,
            "impact_index",
            rows=6,
            maxrows=14,
        )
        pick = impact_rows.selected(context)
        for reason in impact_words.reasons(pick) if pick is not None else ():
            paragraph(context, layout, f"{pick.name}: {reason}", "ERROR")


CLASSES = (ROCKFALL_UL_impacts, ROCKFALL_PT_impact_table)
