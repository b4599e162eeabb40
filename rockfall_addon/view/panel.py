# SPDX-License-Identifier: GPL-3.0-or-later
"""What all panels share."""

from collections.abc import Iterable
from typing import Literal

import bpy

from ...core.remarks import Remark
from ..scene.storage import store
from .wrapping import wrapped

type State = Literal["TO_DO", "READY", "ATTENTION", "ANY_TIME"]
"""How a step stands; what has no end can be done at any time."""

MARKS: dict[State, str] = {"TO_DO": "RADIOBUT_OFF", "READY": "CHECKMARK", "ATTENTION": "ERROR", "ANY_TIME": "DOT"}


MARGIN, ICON, LEAST = 70.0, 20.0, 100.0
"""What of a sidebar is beside its text, beside an icon, too, and the width that text has at least, at interface scale 1
[px]."""
SHORT = 36
"""Characters that have room beside one another in a sidebar as wide as ours is at first."""


class RockfallPanel:
    """Mix-in: where the panels live, and the mark in the header of those that are a step."""

    bl_space_type = "VIEW_3D"
    bl_region_type = "UI"
    bl_category = "Rockfall"
    bl_order = 2  # the same for all steps, which stay in the order in which they are registered
    needs = ""
    """The role of objects without which there is no panel."""

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return not cls.needs or store.has_role(context.scene, cls.needs)

    @staticmethod
    def step_state(context: bpy.types.Context) -> State | None:
        """How this step stands, as stored; None for a panel that is no step."""
        return None

    def draw_header(self, context: bpy.types.Context) -> None:
        state_mark(self.layout, self.step_state(context))


class Rows:
    """Mix-in of a list: `draw_row` draws an item."""

    use_filter_show = False

    def draw_item(
        self,
        context: bpy.types.Context,
        layout: bpy.types.UILayout,
        data: object,
        item: bpy.types.PropertyGroup,
        icon: int,
        active_data: object,
        active_property: str,
        index: int = 0,
        flt_flag: int = 0,
    ) -> None:
        self.draw_row(layout, item)


def state_mark(layout: bpy.types.UILayout, state: State | None) -> None:
    """The mark of a step: to do, done, needs attention, or for any time."""
    if state is not None:
        layout.label(text="", icon=MARKS[state])


def advise(context: bpy.types.Context, layout: bpy.types.UILayout, ready: bool, sentence: str) -> None:
    """How this step stands and what to do next, in as many lines as the sidebar's width asks for."""
    paragraph(context, layout, sentence, "CHECKMARK" if ready else "RIGHTARROW_THIN")


def paragraph(context: bpy.types.Context, layout: bpy.types.UILayout, sentence: str, icon: str = "NONE") -> None:
    """Text broken to the width of the region."""
    scale, style = context.preferences.system.ui_scale, context.preferences.ui_styles[0]
    room = context.region.width - (MARGIN if icon == "NONE" else MARGIN + ICON) * scale
    column = layout.column(align=True)
    below = "NONE" if icon == "NONE" else "BLANK1"
    for number, line in enumerate(wrapped(sentence, max(room, LEAST * scale), style.widget.points * scale)):
        column.label(text=line, icon=icon if number == 0 else below)


def show_remarks(context: bpy.types.Context, layout: bpy.types.UILayout, remarks: Iterable[Remark]) -> None:
    """What the core has to say about a result."""
    for remark in remarks:
        paragraph(context, layout, remark.text, "ERROR" if is_grave(remark) else "INFO")


def is_grave(remark: Remark) -> bool:
    """Whether a remark is more than a note: what has one is marked with ⚠."""
    return remark.severity in ("warning", "problem")


def fields(layout: bpy.types.UILayout, owner: bpy.types.bpy_struct, names: Iterable[str]) -> None:
    """Properties below one another, half of the width for each name: Blender's own split cuts the longer ones off."""
    for name in names:
        of = owner.bl_rna.properties[name]
        if of.type == "BOOLEAN":
            field(layout, "").prop(owner, name)
        else:
            field(layout, of.name).prop(owner, name, text="")


def field(layout: bpy.types.UILayout, name: str) -> bpy.types.UILayout:
    """A row for what belongs to a name, which is to the left of it."""
    row = layout.split(factor=0.45)
    before = row.row()
    before.alignment = "RIGHT"
    before.label(text=name)
    return row.row(align=True)


def numbers(layout: bpy.types.UILayout, name: str, values: Iterable[str], part: float) -> None:
    """Numbers to the right of a name, which has this part of the width; a name that is longer stands above them."""
    if len(name) > SHORT * part:
        layout.label(text=name)
        name = ""
    row = layout.split(factor=part)
    row.label(text=name)
    cells = row.row()
    for text in values:
        cell = cells.row()
        cell.alignment = "RIGHT"
        cell.label(text=text)


def kilograms(mass_kg: float) -> str:
    """A mass to three digits."""
    return f"{mass_kg:,.0f} kg".replace(",", "\N{NO-BREAK SPACE}") if mass_kg >= 100 else f"{mass_kg:.3g} kg"


def facts(layout: bpy.types.UILayout, rows: list[tuple[str, str]]) -> None:
    """A small table: names to the left, values to the right, with room for the longest of both."""
    column = layout.column(align=True)
    names, values = (max((len(row[i]) for row in rows), default=1) for i in (0, 1))
    part = min(max(names / (names + values), 0.42), 0.55)
    for name, value in rows:
        row = column.split(factor=part)
        row.label(text=name)
        row.label(text=value)
