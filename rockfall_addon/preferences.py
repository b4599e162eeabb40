# SPDX-License-Identifier: GPL-3.0-or-later
"""The preferences, and the panel that says whether everything Rockfall needs is there."""

import os
import sys
import textwrap

import bpy

from .. import __package__ as ADDON_ID  # noqa: N812
from .. import __version__
from ..core.constants import ROCK_DENSITY_KGPM3
from .scene.storage.settings import BLOCK_SHAPES, COLOURINGS, DENSITIES, DIAMETERS

problem = ""
"""Why nothing but this module is registered; empty when all is well. Set by the add-on's `register`."""

ADVICE = (
    "The libraries travel inside the extension's zip. Install the zip for your system (Linux, Windows or macOS on "
    "Apple silicon) with Preferences > Get Extensions > Install from Disk, then restart Blender. "
    "A checkout of the sources has no libraries: run scripts/build_extension.py there."
)


def draw_state(layout: bpy.types.UILayout, width: int) -> None:
    """The version, and what is wrong with the installation if anything is."""
    python = f"Python {sys.version_info.major}.{sys.version_info.minor}"
    column = layout.column(align=True)
    column.label(text=f"Rockfall {__version__}, {python}, {sys.platform}", icon="ERROR" if problem else "CHECKMARK")
    if problem:
        for paragraph in (problem, ADVICE):
            column.separator()
            for line in textwrap.wrap(paragraph, width):
                column.label(text=line)


class InstallationPanel(bpy.types.Panel):
    """Version and state of the installation; open when something is missing."""

    bl_idname = "ROCKFALL_PT_installation"
    bl_label = "Installation"
    bl_space_type = "VIEW_3D"
    bl_region_type = "UI"
    bl_category = "Rockfall"
    bl_order = 1000
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context: bpy.types.Context) -> None:
        draw_state(self.layout, width=max(20, int(context.region.width / context.preferences.system.ui_scale / 7)))


def _changed(self: bpy.types.AddonPreferences, context: bpy.types.Context) -> None:
    if problem:
        return
    from .scene.storage import defaults

    for scene in bpy.data.scenes:
        defaults.begin(scene)


class RockfallPreferences(bpy.types.AddonPreferences):
    bl_idname = ADDON_ID

    folder: bpy.props.StringProperty(
        name="Folder", description="Where the next file browser opens: beside the file that was read last",
        subtype="DIR_PATH",
    )  # fmt: skip
    block_diameter_m: bpy.props.FloatProperty(
        name="Block diameter", description="Of the blocks of new projects",
        default=0.35, **DIAMETERS, unit="LENGTH", precision=3, update=_changed,
    )  # fmt: skip
    density_kgpm3: bpy.props.FloatProperty(
        name="Density [kg/m³]", description="Of the rock of new projects",
        default=ROCK_DENSITY_KGPM3, **DENSITIES, precision=0, update=_changed,
    )  # fmt: skip
    block_shape: bpy.props.EnumProperty(
        name="Block shape", description="Of the blocks of new projects", items=BLOCK_SHAPES, update=_changed
    )
    colour_by: bpy.props.EnumProperty(
        name="Colour by", description="What the colours of the flights mean in new projects", items=COLOURINGS,
        default="SPEED", update=_changed,
    )  # fmt: skip
    sigma_px: bpy.props.FloatProperty(
        name="Click ± [px]", description="Standard deviation of a click in the footage, in new projects",
        default=1.0, min=0.05, soft_max=10.0, precision=2, update=_changed,
    )  # fmt: skip

    def draw(self, context: bpy.types.Context) -> None:
        draw_state(self.layout, width=90)
        if problem:
            return
        layout = self.layout.column()
        layout.use_property_split = True
        layout.prop(self, "folder")
        layout.label(text="New projects begin with")
        for name in ("block_diameter_m", "density_kgpm3", "block_shape", "sigma_px", "colour_by"):
            layout.prop(self, name)


CLASSES = (InstallationPanel, RockfallPreferences)


def register() -> None:
    InstallationPanel.bl_options = set() if problem else {"DEFAULT_CLOSED"}
    for each in CLASSES:
        bpy.utils.register_class(each)
    _keep_kernels_in_user_directory()


def unregister() -> None:
    for each in reversed(CLASSES):
        bpy.utils.unregister_class(each)


def _keep_kernels_in_user_directory() -> None:
    """The extension's own directory may be read-only, and is replaced when it is updated."""
    if not ADDON_ID.startswith("bl_ext."):
        return
    directory = bpy.utils.extension_path_user(ADDON_ID, path="kernels", create=True)
    os.environ.setdefault("NUMBA_CACHE_DIR", directory)
    if "numba" in sys.modules:  # another add-on was first: it has read the environment already
        sys.modules["numba"].config.CACHE_DIR = os.environ["NUMBA_CACHE_DIR"]
