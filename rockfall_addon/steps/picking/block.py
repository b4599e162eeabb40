# SPDX-License-Identifier: GPL-3.0-or-later
"""The block of the trajectory in hand: what it is, to be edited, and its mass."""

from collections.abc import Callable
from dataclasses import replace

import bpy
from bpy.props import BoolProperty, EnumProperty, FloatProperty

from ....core.reconstruction.block import SHAPES, Block
from ...scene.footage import sync
from ...scene.picks import impact_rows, own_blocks, places
from ...scene.storage import store
from ...scene.storage.settings import BLOCK_SHAPES, DENSITIES, DIAMETERS
from ...view.panel import RockfallPanel, facts, fields, kilograms, paragraph


def trajectory_in_hand(scene: bpy.types.Scene) -> str:
    """That of the selected pick, else the one that is picked."""
    pick = impact_rows.selected(bpy.context)
    return places.trajectory(scene) if pick is None else str(pick[store.TRAJECTORY])


def _block(settings: bpy.types.PropertyGroup) -> Block:
    return places.block_of(settings.id_data, trajectory_in_hand(settings.id_data))


def _number(name: str, span: dict[str, float]) -> dict[str, Callable | float]:
    """How a property reads and writes one number of the block, and its range; the others keep all their digits."""
    least, most = span["min"], span["max"]

    def read(self: bpy.types.PropertyGroup) -> float:
        return getattr(_block(self), name)

    def write(self: bpy.types.PropertyGroup, value: float) -> None:
        scene, value = self.id_data, min(most, max(least, value))  # Blender keeps to the range in its fields alone
        own_blocks.give(scene, trajectory_in_hand(scene), replace(_block(self), **{name: store.double(value)}))

    return {"get": read, "set": write, "update": _changed, **span}


def _changed(self: bpy.types.PropertyGroup, context: bpy.types.Context) -> None:
    sync.sync(self.id_data, [trajectory_in_hand(self.id_data)])


def _get_own(self: bpy.types.PropertyGroup) -> bool:
    return own_blocks.has(self.id_data, trajectory_in_hand(self.id_data))


def _set_own(self: bpy.types.PropertyGroup, value: bool) -> None:
    scene = self.id_data
    name = trajectory_in_hand(scene)
    if value:
        own_blocks.give(scene, name, _block(self))
    else:
        own_blocks.take(scene, name)


def _get_shape(self: bpy.types.PropertyGroup) -> int:
    return SHAPES.index(_block(self).shape)


def _set_shape(self: bpy.types.PropertyGroup, value: int) -> None:
    scene = self.id_data
    own_blocks.give(scene, trajectory_in_hand(scene), replace(_block(self), shape=SHAPES[value]))


class BlockProperties(bpy.types.PropertyGroup):
    """Windows on the block of the trajectory in hand."""

    own: BoolProperty(
        name="A block of its own", description="Else it is that of the settings, which all trajectories share",
        get=_get_own, set=_set_own, update=_changed,
    )  # fmt: skip
    d1: FloatProperty(
        name="Diameter 1", description="Of the three diameters at right angles to each other",
        unit="LENGTH", precision=3, **_number("d1", DIAMETERS),
    )  # fmt: skip
    d2: FloatProperty(
        name="Diameter 2", description="Of the three diameters at right angles to each other",
        unit="LENGTH", precision=3, **_number("d2", DIAMETERS),
    )  # fmt: skip
    d3: FloatProperty(
        name="Diameter 3", description="Of the three diameters at right angles to each other",
        unit="LENGTH", precision=3, **_number("d3", DIAMETERS),
    )  # fmt: skip
    density: FloatProperty(
        name="Density [kg/m³]", description="Of the rock; mass and energies come from it",
        precision=0, **_number("density", DENSITIES),
    )  # fmt: skip
    shape: EnumProperty(
        name="Shape", description="Volume, mass and inertia come from it", items=BLOCK_SHAPES,
        get=_get_shape, set=_set_shape, update=_changed,
    )  # fmt: skip


class ROCKFALL_PT_block(RockfallPanel, bpy.types.Panel):
    bl_label = "Block"
    bl_idname = "ROCKFALL_PT_block"
    bl_parent_id = "ROCKFALL_PT_picks"
    needs = store.PICK_ROLE

    def draw(self, context: bpy.types.Context) -> None:
        layout, scene = self.layout, context.scene
        settings, name = scene.rockfall_block, trajectory_in_hand(scene)
        block = places.block_of(scene, name)
        layout.prop(settings, "own", text=f"{name} has a block of its own")
        if problem := own_blocks.problem_of(scene, name):
            paragraph(context, layout, f"{problem} Switch it off, and on again to give another one.", "ERROR")
            return
        if settings.own:
            fields(layout.column(align=True), settings, ("d1", "d2", "d3", "density", "shape"))
        facts(layout, [("Mean diameter", f"{block.diameter_m:.3g} m"), ("Mass", kilograms(block.mass_kg))])


CLASSES = (BlockProperties, ROCKFALL_PT_block)


def register() -> None:
    bpy.types.Scene.rockfall_block = bpy.props.PointerProperty(type=BlockProperties)


def unregister() -> None:
    del bpy.types.Scene.rockfall_block
