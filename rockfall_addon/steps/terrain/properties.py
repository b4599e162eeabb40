# SPDX-License-Identifier: GPL-3.0-or-later
"""How accurate the terrain is, and how it looks. Single precision will do for both."""

import bpy
from bpy.props import BoolProperty, FloatProperty, IntProperty

from ...scene.storage.materials import TERRAIN_VALUES


def _look_changed(self: bpy.types.PropertyGroup, context: bpy.types.Context) -> None:
    from ...scene.terrain import terrain_look

    terrain_look.apply(self.id_data)


def _view_changed(self: bpy.types.PropertyGroup, context: bpy.types.Context) -> None:
    from ...scene.terrain import terrain_view

    terrain_view.follow(self.id_data)


class TerrainSettings(bpy.types.PropertyGroup):
    """Relief and detail of all tiles of a scene."""

    accuracy_m: FloatProperty(
        name="Accuracy", description="Standard deviation of the terrain's height, for clicks and the refinement: "
        "about 2 cm for a terrestrial scan, 5 cm from a drone, 20 cm for an airborne one. 0: half the point spacing, "
        "from 2 to 20 cm",
        default=0.0, min=0.0, soft_max=1.0, precision=3, unit="LENGTH",
    )  # fmt: skip
    hillshade: FloatProperty(
        name="Hillshade", description="How strongly slopes that face away from the light are darkened",
        default=TERRAIN_VALUES["hillshade"], min=0.0, max=1.0, subtype="FACTOR", update=_look_changed,
    )  # fmt: skip
    eye_dome: FloatProperty(
        name="Eye-dome", description="How strongly crevices are darkened against edges",
        default=TERRAIN_VALUES["eye_dome"], min=0.0, max=1.0, subtype="FACTOR", update=_look_changed,
    )  # fmt: skip
    thin: FloatProperty(
        name="Thin data", description="How strongly the places are marked where the surface is guessed, not measured: "
        "sparse points, long edges, borders of holes. Renders hatch them",
        default=TERRAIN_VALUES["thin"], min=0.0, max=1.0, subtype="FACTOR", update=_look_changed,
    )  # fmt: skip
    brightness: FloatProperty(
        name="Brightness", description="Of the whole terrain",
        default=TERRAIN_VALUES["brightness"], min=0.0, max=3.0, update=_look_changed,
    )  # fmt: skip
    contrast: FloatProperty(
        name="Contrast", description="Between light and shade",
        default=TERRAIN_VALUES["contrast"], min=0.0, max=3.0, update=_look_changed,
    )  # fmt: skip
    scan_colours: FloatProperty(
        name="Scan colours", description="How much the terrain has the colours that its file brought",
        default=TERRAIN_VALUES["scan_colours"], min=0.0, max=1.0, subtype="FACTOR", update=_look_changed,
    )  # fmt: skip
    footage_colours: FloatProperty(
        name="Footage colours", description="How much the terrain has the colours of the aligned videos, where these "
        "show it",
        default=TERRAIN_VALUES["footage_colours"], min=0.0, max=1.0, subtype="FACTOR", update=_look_changed,
    )  # fmt: skip
    full_resolution: BoolProperty(
        name="Show full resolution", description="Draw every triangle in the 3-D view, even where that is slow. "
        "Rays, normals and renders use every triangle in either case",
        default=False, update=_view_changed,
    )  # fmt: skip
    view_limit: IntProperty(
        name="Coarse from", description="Terrain of more triangles than this is drawn coarsely in the 3-D view, "
        "with about a third of this number",
        default=3_000_000, min=3, soft_min=100_000, soft_max=50_000_000, update=_view_changed,
    )  # fmt: skip


CLASSES = (TerrainSettings,)


def register() -> None:
    bpy.types.Scene.rockfall_terrain = bpy.props.PointerProperty(type=TerrainSettings)


def unregister() -> None:
    del bpy.types.Scene.rockfall_terrain
