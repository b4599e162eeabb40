# SPDX-License-Identifier: GPL-3.0-or-later
"""Mouse and keys over motion graphs; what moves axes is shared with the other graphs."""

import bpy

KEYS = (
    ("rockfall.press_in_motion", "LEFTMOUSE", "PRESS", {}),
    ("rockfall.press_in_motion", "LEFTMOUSE", "PRESS", {"shift": True}),
    ("rockfall.press_in_motion", "RIGHTMOUSE", "PRESS", {}),
)
"""Operator, key, value, modifiers."""

_items: list[tuple[bpy.types.KeyMap, bpy.types.KeyMapItem]] = []


def register() -> None:
    config = bpy.context.window_manager.keyconfigs.addon if bpy.context.window_manager else None
    if config is None:  # in the background
        return
    keymap = config.keymaps.new("Node Editor", space_type="NODE_EDITOR", region_type="WINDOW")
    for operator, key, value, modifiers in KEYS:
        _items.append((keymap, keymap.keymap_items.new(operator, key, value, head=True, **modifiers)))


def unregister() -> None:
    while _items:
        keymap, item = _items.pop()
        keymap.keymap_items.remove(item)
