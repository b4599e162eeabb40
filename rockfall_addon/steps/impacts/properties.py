# SPDX-License-Identifier: GPL-3.0-or-later
"""What panels show and edit of the picks: one selected pick, and the rows of the impact table.

The pick's properties are windows on its doubles (`scene.picks`); the rows are mirrored by `scene.impact_rows`.
"""

import bpy
from bpy.props import EnumProperty, FloatProperty, IntProperty, StringProperty

from ....core.reconstruction.picks import KINDS, STATUSES
from ...scene.storage import store

CONFIDENCES = ("", "1", "2", "3")


def _edited(pick: bpy.types.PropertyGroup, field: str) -> None:
    from ...scene.footage import sync

    for scene in pick.id_data.users_scene:
        sync.touch(scene, field=pick.bl_rna.properties[field].name)


def _get_kind(self: bpy.types.PropertyGroup) -> int:
    kind = self.id_data.get(store.KIND, "impact")
    return KINDS.index(kind) if kind in KINDS else 0


def _set_kind(self: bpy.types.PropertyGroup, value: int) -> None:
    from ...scene.picks import pick_names

    self.id_data[store.KIND] = KINDS[value]
    pick_names.follow_with(self.id_data)
    _edited(self, "kind")


def _get_status(self: bpy.types.PropertyGroup) -> int:
    status = self.id_data.get(store.STATUS, "ok")
    return STATUSES.index(status) if status in STATUSES else 0


def _set_status(self: bpy.types.PropertyGroup, value: int) -> None:
    self.id_data[store.STATUS] = STATUSES[value]
    _edited(self, "status")


def _get_confidence(self: bpy.types.PropertyGroup) -> int:
    from ...scene.picks import picks

    text = picks.extra_of(self.id_data, "confidence")
    return CONFIDENCES.index(text) if text in CONFIDENCES else 0


def _set_confidence(self: bpy.types.PropertyGroup, value: int) -> None:
    from ...scene.picks import picks

    picks.set_extra(self.id_data, "confidence", CONFIDENCES[value])
    _edited(self, "confidence")


def _get_note(self: bpy.types.PropertyGroup) -> str:
    from ...scene.picks import picks

    return picks.extra_of(self.id_data, "note")


def _set_note(self: bpy.types.PropertyGroup, value: str) -> None:
    from ...scene.picks import picks

    picks.set_extra(self.id_data, "note", value)


def _get_time(self: bpy.types.PropertyGroup) -> str:
    """To 0.1 ms, which the field has room for; an exact time that looks like this one is not changed to it."""
    time = self.id_data.get(store.TIME, 0.0)
    return f"{time:.4f}" if isinstance(time, (int, float)) else repr(time)


def _set_time(self: bpy.types.PropertyGroup, value: str) -> None:
    from ...scene.footage import sync
    from ...scene.picks import pick_names

    if value.strip() != _get_time(self):
        sync.retime(self.id_data, value)
        pick_names.follow_with(self.id_data)


class PickProperties(bpy.types.PropertyGroup):
    """The selected pick, to be edited; the time is text, as Blender's numbers are single precision."""

    kind: EnumProperty(
        name="Kind",
        items=[
            ("impact", "Impact", "The block hits the ground"),
            ("release", "Release", "The block starts"),
            ("pass", "Pass", "A point of the flight, in the air"),
            ("contact", "Contact", "The block rolls or slides"),
            ("stop", "Stop", "The block comes to rest"),
            ("takeoff", "Take-off", "The block leaves the ground after the impact before: elsewhere, or later"),
        ],
        get=_get_kind, set=_set_kind,
    )  # fmt: skip
    status: EnumProperty(
        name="Status",
        items=[
            ("ok", "Ok", "As it should be"),
            ("doubtful", "Doubtful", "Used, and flagged"),
            ("shattered", "Shattered", "The block breaks here: nothing is computed across"),
            ("discarded", "Discarded", "Not used: nothing is computed across"),
        ],
        get=_get_status, set=_set_status,
    )  # fmt: skip
    confidence: EnumProperty(
        name="Confidence",
        description="How sure the place is. It stands for a standard deviation where the pick has none of its own",
        items=[
            ("NONE", "Not given", "No standard deviation"),
            ("1", "1  Unsure", "0.50 m"),
            ("2", "2  Fair", "0.20 m"),
            ("3", "3  Sure", "0.05 m"),
        ],
        get=_get_confidence, set=_set_confidence,
    )  # fmt: skip
    note: StringProperty(name="Note", get=_get_note, set=_set_note)
    time_s: StringProperty(
        name="Time [s]",
        description="On the common clock, shown to 0.1 ms; all digits that are typed are kept",
        get=_get_time,
        set=_set_time,
    )


class ImpactRow(bpy.types.PropertyGroup):
    """One row of the impact table."""

    pick: StringProperty()
    trajectory: StringProperty()
    trajectory_number: IntProperty(description="Stands for the name, 0 where a file has none")
    number: IntProperty()
    time_s: FloatProperty()
    speed1_mps: FloatProperty()
    speed2_mps: FloatProperty()
    rn: FloatProperty()
    rt: FloatProperty()
    r: FloatProperty()
    theta1_deg: FloatProperty()
    theta_dev_deg: FloatProperty()
    flags: StringProperty()


CLASSES = (ImpactRow, PickProperties)


def register() -> None:
    bpy.types.Scene.rockfall_impacts = bpy.props.CollectionProperty(type=ImpactRow)
    bpy.types.Object.rockfall_pick = bpy.props.PointerProperty(type=PickProperties)


def unregister() -> None:
    del bpy.types.Object.rockfall_pick
    del bpy.types.Scene.rockfall_impacts
