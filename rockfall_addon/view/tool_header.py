# SPDX-License-Identifier: GPL-3.0-or-later
"""Settings of a tool in its header, which is drawn over the view.

Blender draws a word that stands beside a field in the colour of the theme's text and nothing behind it: dark on dark
footage in a light theme. A word within a button has the button's own ground.
"""

from collections.abc import Iterable

import bpy


def settings(layout: bpy.types.UILayout, owner: bpy.types.bpy_struct, names: Iterable[str]) -> None:
    """Properties beside one another, each with its name within its button."""
    for name in names:
        of = owner.bl_rna.properties[name]
        if of.type == "ENUM":
            chosen = of.enum_items[getattr(owner, name)].name
            layout.prop_menu_enum(owner, name, text=f"{of.name}: {chosen}")
        elif of.type == "STRING":
            layout.prop(owner, name, text="", icon="OUTLINER_OB_CURVE")
        else:
            layout.prop(owner, name, toggle=True)
