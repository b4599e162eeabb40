# SPDX-License-Identifier: GPL-3.0-or-later
"""Settings of picking in the footage, of what is drawn over it, of tracking and of refinement."""

import bpy
from bpy.props import BoolProperty, EnumProperty, FloatProperty, IntProperty, StringProperty

KINDS = (
    ("impact", "Impact", "The block hits the ground"),
    ("release", "Release", "The block starts"),
    ("pass", "Block here", "The block in flight: its pixel is kept as an observation for the refinement"),
    ("contact", "Contact", "The block rolls or slides"),
    ("stop", "Stop", "The block comes to rest"),
    ("takeoff", "Take-off", "The block leaves the ground after the impact before: elsewhere, or later"),
)


def _names(self: bpy.types.PropertyGroup, context: bpy.types.Context, text: str) -> list[str]:
    from ...scene.picks import places

    return places.trajectories(self.id_data)


class PickingSettings(bpy.types.PropertyGroup):
    """How clicks become picks, and picks are refined."""

    trajectory: StringProperty(
        name="Trajectory", description="Name of the block's run that is picked; a new name begins a new trajectory",
        search=_names, search_options={"SUGGESTION"},
    )  # fmt: skip
    kind: EnumProperty(name="Kind", description="What is picked (keys 1–6)", items=KINDS, default="impact")
    aim: EnumProperty(
        name="Click on", description="What is clicked in the footage",
        items=[
            ("CENTRE", "Block", "The middle of the block: it is put so that it touches the terrain"),
            ("CONTACT", "Ground", "The place where the block touches the ground"),
        ],
        default="CENTRE",
    )  # fmt: skip
    sigma_px: FloatProperty(
        name="Click ± [px]", description="Standard deviation of a click; the error ellipse comes from it, from the "
        "camera's and from the terrain's accuracy",
        default=1.0, min=0.05, soft_max=10.0, precision=2,
    )  # fmt: skip
    show_loupe: BoolProperty(name="Loupe", description="Magnify the video under the mouse", default=True)
    loupe_zoom: IntProperty(
        name="Magnification", description="Size of a pixel of the video in the loupe", default=8, min=2, soft_max=16
    )
    show_paths: BoolProperty(
        name="Paths over the footage", default=True,
        description="Draw the blocks' flights, with the lens's distortion, over the raw footage",
    )  # fmt: skip
    show_track: BoolProperty(
        name="Tracked pixels", description="Draw where the block was seen, joined with where it should be", default=True
    )
    whole_video: BoolProperty(name="Whole video", description="Follow the block until it is lost", default=True)
    track_frames: IntProperty(
        name="Pictures", description="Follow the block for so many pictures before and after the one that is shown",
        default=60, min=2, soft_max=600,
    )  # fmt: skip
    free: EnumProperty(
        name="Also fit", description="What is fitted beside the picks' times and places",
        items=[
            ("camera", "Camera", "The pose of cameras whose deviation is known"),
            ("clock", "Clock", "The offsets of all clocks but that of the first video"),
            ("drag", "Drag", "The drag coefficient of the air"),
            ("gravity", "Gravity", "The acceleration of gravity: a check of scale and frame rate"),
        ],
        options={"ENUM_FLAG"}, default=set(),
    )  # fmt: skip
    scope: EnumProperty(
        name="Fit", description="Which trajectories are refined",
        items=[
            ("ACTIVE", "This trajectory", "That of the selected pick, or of the tool"),
            ("ALL", "All", "All trajectories with tracked pixels"),
        ],
        default="ALL",
    )  # fmt: skip


CLASSES = (PickingSettings,)


def register() -> None:
    bpy.types.Scene.rockfall_picking = bpy.props.PointerProperty(type=PickingSettings)


def unregister() -> None:
    del bpy.types.Scene.rockfall_picking
