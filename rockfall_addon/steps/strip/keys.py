# SPDX-License-Identifier: GPL-3.0-or-later
"""The mouse over the impact strip; what it does not hit is Blender's."""

import bpy

KEYS = (
    ("Dopesheet", "DOPESHEET_EDITOR", "WINDOW", "rockfall.press_in_strip", "LEFTMOUSE", "PRESS", {}),
    ("Dopesheet", "DOPESHEET_EDITOR", "WINDOW", "rockfall.press_in_strip", "LEFTMOUSE", "PRESS", {"shift": True}),
    ("Dopesheet", "DOPESHEET_EDITOR", "WINDOW", "rockfall.point_in_strip", "MOUSEMOVE", "ANY", {"any": True}),
    ("Window", "EMPTY", "WINDOW", "rockfall.leave_strip", "MOUSEMOVE", "ANY", {"any": True}),
)
"""Key map, its space and region, operator, key, value, modifiers."""

_items: list[tuple[bpy.types.KeyMap, bpy.types.KeyMapItem]] = []


def register() -> None:
    config = bpy.context.window_manager.keyconfigs.addon if bpy.context.window_manager else None
    if config is None:  # in the background
        return
    for name, space, region, operator, key, value, modifiers in KEYS:
        keymap = config.keymaps.new(name, space_type=space, region_type=region)
        _items.append((keymap, keymap.keymap_items.new(operator, key, value, head=True, **modifiers)))


def unregister() -> None:
    while _items:
        keymap, item = _items.pop()
        keymap.keymap_items.remove(item)
