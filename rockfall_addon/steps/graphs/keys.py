# SPDX-License-Identifier: GPL-3.0-or-later
"""Mouse and keys over graphs. Each operator's poll leaves other editors alone."""

import bpy

NODES = ("Node Editor", "NODE_EDITOR", "WINDOW")
VIEWS = ("View2D", "EMPTY", "WINDOW")
"""Blender looks here before the node editor's own keys for the wheel and the middle button."""
WINDOW = ("Window", "EMPTY", "WINDOW")

Key = tuple[tuple[str, str, str], str, str, str, dict[str, bool], dict[str, object]]

KEYS: tuple[Key, ...] = (
    (NODES, "rockfall.point_in_graph", "MOUSEMOVE", "ANY", {"any": True}, {}),
    (WINDOW, "rockfall.leave_graphs", "MOUSEMOVE", "ANY", {"any": True}, {}),
    (NODES, "rockfall.press_in_graph", "LEFTMOUSE", "PRESS", {}, {}),
    (NODES, "rockfall.press_in_graph", "LEFTMOUSE", "PRESS", {"shift": True}, {"how": "ADD"}),
    (NODES, "rockfall.press_in_graph", "LEFTMOUSE", "PRESS", {"ctrl": True}, {"how": "SUBTRACT"}),
    (NODES, "rockfall.maximise_graph", "LEFTMOUSE", "DOUBLE_CLICK", {}, {}),
    (NODES, "rockfall.graph_menu", "RIGHTMOUSE", "PRESS", {}, {}),
    (NODES, "rockfall.select_in_graphs", "A", "PRESS", {}, {"what": "ALL"}),
    (NODES, "rockfall.select_in_graphs", "A", "PRESS", {"alt": True}, {"what": "NONE"}),
    (NODES, "rockfall.select_in_graphs", "I", "PRESS", {"ctrl": True}, {"what": "INVERT"}),
    (NODES, "rockfall.reset_graphs", "HOME", "PRESS", {}, {}),
    (VIEWS, "rockfall.zoom_graph", "WHEELUPMOUSE", "PRESS", {"any": True}, {"closer": True}),
    (VIEWS, "rockfall.zoom_graph", "WHEELDOWNMOUSE", "PRESS", {"any": True}, {"closer": False}),
    (VIEWS, "rockfall.zoom_graph", "NUMPAD_PLUS", "PRESS", {}, {"closer": True}),
    (VIEWS, "rockfall.zoom_graph", "NUMPAD_MINUS", "PRESS", {}, {"closer": False}),
    (VIEWS, "rockfall.pan_graph", "MIDDLEMOUSE", "PRESS", {}, {}),
    (VIEWS, "rockfall.pan_graph", "TRACKPADPAN", "ANY", {}, {}),
    (VIEWS, "rockfall.zoom_graph", "TRACKPADZOOM", "ANY", {}, {}),
)
"""Keymap, operator, key, value, modifiers, properties."""

_items: list[tuple[bpy.types.KeyMap, bpy.types.KeyMapItem]] = []


def register() -> None:
    config = bpy.context.window_manager.keyconfigs.addon if bpy.context.window_manager else None
    if config is None:  # in the background
        return
    for (name, space, region), operator, key, value, modifiers, properties in KEYS:
        keymap = config.keymaps.new(name, space_type=space, region_type=region)
        item = keymap.keymap_items.new(operator, key, value, head=True, **modifiers)
        for attribute, given in properties.items():
            setattr(item.properties, attribute, given)
        _items.append((keymap, item))


def unregister() -> None:
    while _items:
        keymap, item = _items.pop()
        keymap.keymap_items.remove(item)
