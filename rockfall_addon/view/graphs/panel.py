# SPDX-License-Identifier: GPL-3.0-or-later
"""Where the panels beside the graphs of impacts are."""

import bpy

from . import editor


class GraphPanel:
    """Mix-in: a panel beside the graphs of impacts."""

    bl_space_type = "NODE_EDITOR"
    bl_region_type = "UI"
    bl_category = "Rockfall"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return editor.shows(context)
