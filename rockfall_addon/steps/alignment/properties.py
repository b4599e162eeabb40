# SPDX-License-Identifier: GPL-3.0-or-later
"""What the alignment panel shows and edits of a camera. Pairs and solutions are doubles, see `scene`."""

import bpy
from bpy.props import BoolProperty, CollectionProperty, EnumProperty, FloatProperty, IntProperty, StringProperty

from ...scene.footage import alignment, footage_blend
from ...scene.storage import store
from . import marking, solving


def _scene_of(camera: bpy.types.Object) -> bpy.types.Scene:
    return next(iter(camera.users_scene), bpy.context.scene)


def _row_edited(self: bpy.types.PropertyGroup, context: bpy.types.Context) -> None:
    if self.pair:
        camera = self.id_data
        marking.edit(_scene_of(camera), camera, self.pair, name=self.name, enabled=self.enabled)


def _solve(self: bpy.types.PropertyGroup, context: bpy.types.Context) -> None:
    solving.solve(_scene_of(self.id_data), self.id_data)


def _focal_locked(self: bpy.types.PropertyGroup, context: bpy.types.Context) -> None:
    if not self.free_focal:
        solving.lock_focal(self.id_data)
    solving.solve(_scene_of(self.id_data), self.id_data)


def _get_focal(self: bpy.types.PropertyGroup) -> float:
    return alignment.focal_px(self.id_data)


def _set_focal(self: bpy.types.PropertyGroup, value: float) -> None:
    solving.set_focal(_scene_of(self.id_data), self.id_data, store.double(value))


def _get_focal_mm(self: bpy.types.PropertyGroup) -> float:
    return alignment.focal_mm(self.id_data, alignment.focal_px(self.id_data))


def _set_focal_mm(self: bpy.types.PropertyGroup, value: float) -> None:
    camera = self.id_data
    solving.set_focal(_scene_of(camera), camera, store.double(value) / alignment.focal_mm(camera, 1.0))


def _get_blend(self: bpy.types.PropertyGroup) -> float:
    return footage_blend.blend_of(self.id_data)


def _set_blend(self: bpy.types.PropertyGroup, value: float) -> None:
    footage_blend.set_blend(self.id_data, value)


def _wiped(self: bpy.types.PropertyGroup, context: bpy.types.Context) -> None:
    footage_blend.follow_wipe(self.id_data)


class PairRow(bpy.types.PropertyGroup):
    """One row of the list of pairs."""

    pair: StringProperty()
    name: StringProperty(name="Name", description="Of the pair", update=_row_edited)
    enabled: BoolProperty(
        name="Use", description="The camera is solved with this pair; otherwise the pair only checks it",
        default=True, update=_row_edited,
    )  # fmt: skip
    colour: IntProperty()
    frame: IntProperty()
    missing: StringProperty()
    is_wrong: BoolProperty()
    agreed: BoolProperty()
    residual_px: FloatProperty()
    residual_m: FloatProperty()


class AlignmentSettings(bpy.types.PropertyGroup):
    """How a camera is aligned."""

    rows: CollectionProperty(type=PairRow)
    active: IntProperty(name="Pair", description="Row of the list of pairs", options=set())
    motion: EnumProperty(
        name="Camera",
        description="How the camera moved while it filmed",
        items=[
            ("FIXED", "Tripod", "It stood still: one pose serves all frames, and pairs of all frames count"),
            ("ROTATION", "Hand-held", "It was held from one place and turned: a pose for each frame"),
            ("FULL", "Walking", "It also moved from its place: a pose for each frame, from the terrain"),
        ],
        default="FIXED", update=_solve,
    )  # fmt: skip
    free_focal: BoolProperty(
        name="Focal length", description="Find the focal length from the pairs. Switch off to keep it as it is",
        default=True, update=_focal_locked,
    )  # fmt: skip
    free_centre: BoolProperty(
        name="Centre", description="Find the principal point. It needs many pairs, at many distances; "
        "switched off it is the middle of the picture, or that of an imported lens",
        default=False, update=_solve,
    )  # fmt: skip
    free_k1: BoolProperty(
        name="Distortion k1", description="Find the first coefficient of the lens's distortion: "
        "for wide angles, with pairs out to the corners",
        default=False, update=_solve,
    )  # fmt: skip
    free_k2: BoolProperty(name="k2", description="Find the second coefficient too", default=False, update=_solve)
    free_k3: BoolProperty(name="k3", description="Find the third coefficient too", default=False, update=_solve)
    free_p1: BoolProperty(name="p1", description="Find the first tangential coefficient", default=False, update=_solve)
    free_p2: BoolProperty(name="p2", description="Find the second tangential coefficient", default=False, update=_solve)
    focal_px: FloatProperty(
        name="Focal length [px]", description="In pixels of the video", min=1.0, soft_max=20000.0, precision=1,
        get=_get_focal, set=_set_focal,
    )  # fmt: skip
    focal_mm: FloatProperty(
        name="Equivalent [mm]", description="What the focal length is on a camera of full frame, by the diagonal: "
        "26 for a phone, 14 for an action camera",
        min=1.0, soft_max=2000.0, precision=1, get=_get_focal_mm, set=_set_focal_mm,
    )  # fmt: skip
    show_pairs: BoolProperty(name="Show marks", description="Draw the pairs over the 3-D views", default=True)
    magnify: BoolProperty(
        name="Residuals × 10", description="Draw the residuals ten times as long as they are", default=False
    )
    blend: FloatProperty(
        name="Footage", description="How much of the footage covers the terrain: 0 shows the terrain, 1 the footage",
        min=0.0, max=1.0, subtype="FACTOR", get=_get_blend, set=_set_blend,
    )  # fmt: skip
    use_wipe: BoolProperty(
        name="Wipe", description="Footage to the left of a line, terrain to the right of it",
        default=False, update=_wiped,
    )  # fmt: skip
    wipe: FloatProperty(
        name="Line", description="Where the line is, from the picture's left to its right",
        default=0.5, min=0.0, max=1.0, subtype="FACTOR",
    )  # fmt: skip
    show_advanced: BoolProperty(name="More of the lens", default=False, options=set())


CLASSES = (PairRow, AlignmentSettings)


def register() -> None:
    bpy.types.Object.rockfall_alignment = bpy.props.PointerProperty(type=AlignmentSettings)


def unregister() -> None:
    del bpy.types.Object.rockfall_alignment
