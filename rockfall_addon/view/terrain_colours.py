# SPDX-License-Identifier: GPL-3.0-or-later
"""Where a terrain that is shown to others has its colours from, as a choice in dialogs and panels."""

from typing import Any

from bpy.props import EnumProperty

ITEMS = [
    ("auto", "Footage and Scan", "Of the aligned videos where these show it, else of the scan, else rock"),
    ("footage", "Footage", "Of the aligned videos where these show it, else rock"),
    ("scan", "Scan", "That its file brought"),
    ("none", "None", "Rock in light and shade"),
]


def terrain_colours() -> Any:
    """The property."""
    return EnumProperty(name="Terrain Colours", description="Where the terrain has its colours from", items=ITEMS)
