# SPDX-License-Identifier: GPL-3.0-or-later
"""Our tools in the toolbar of the 3-D view: a group of their own, below the cursor, and only those that can be used.

Blender's own toolbars do the same: an entry of the list of tools may be a function of the context.
"""

from collections.abc import Callable, Iterator

import bpy
from bl_ui.space_toolsystem_common import ToolSelectPanelHelper

AFTER = "builtin.cursor"

_registered: list[type[bpy.types.WorkSpaceTool]] = []


def register(tools: list[type[bpy.types.WorkSpaceTool]]) -> None:
    """Add tools; the ``is_needed(context)`` of each says whether it is offered."""
    listed = _list()
    for tool in tools:
        bpy.utils.register_tool(tool)  # at the end of the list
        del listed[listed.index(tool._bl_tool)]
        _registered.append(tool)
    place = next(i for i, each in enumerate(listed) if getattr(each, "idname", "") == AFTER)
    listed.insert(place + 1, _offered)


def unregister() -> None:
    """Take all of them away."""
    listed = _list()
    if _offered in listed:
        listed.remove(_offered)
    while _registered:
        tool = _registered.pop()
        listed.append(tool._bl_tool)  # where Blender looks for it
        bpy.utils.unregister_tool(tool)


def is_offered(context: bpy.types.Context, identifier: str) -> bool:
    """Whether one of our tools can be used now."""
    return any(tool.bl_idname == identifier and tool.is_needed(context) for tool in _registered)


def _offered(context: bpy.types.Context | None) -> Iterator[object]:
    """The tools for a context, all without one, after a line."""
    there = [tool for tool in _registered if context is None or tool.is_needed(context)]
    if there:
        yield None
    yield from (tool._bl_tool for tool in there)


def _list() -> list[object | Callable[..., object]]:
    return ToolSelectPanelHelper._tool_class_from_space_type("VIEW_3D")._tools["OBJECT"]
