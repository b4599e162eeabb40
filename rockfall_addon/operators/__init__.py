# SPDX-License-Identifier: GPL-3.0-or-later
"""Operators, one file per step of the workflow. They hold no logic: they call the bridge and report."""

import bpy

from . import (
    alignment,
    alignment_files,
    demo,
    film,
    impacts,
    look,
    models,
    picking,
    picks,
    refinement,
    share,
    terrain,
    tracking,
    videos,
    workspace,
)

CLASSES = (
    *terrain.CLASSES,
    *videos.CLASSES,
    *alignment.CLASSES,
    *alignment_files.CLASSES,
    *picks.CLASSES,
    *picking.CLASSES,
    *tracking.CLASSES,
    *refinement.CLASSES,
    *impacts.CLASSES,
    *look.CLASSES,
    *models.CLASSES,
    *demo.CLASSES,
    *film.CLASSES,
    *share.CLASSES,
    *workspace.CLASSES,
)

TOOLS = (*alignment.TOOLS, *picking.TOOLS)


def register() -> None:
    for cls in CLASSES:
        bpy.utils.register_class(cls)
    videos.register_keys()
    for tool in TOOLS:
        bpy.utils.register_tool(tool, after={"builtin.cursor"}, separator=tool is TOOLS[0])


def unregister() -> None:
    workspace.forget()
    videos.unregister_keys()
    for tool in reversed(TOOLS):
        bpy.utils.unregister_tool(tool)
    for cls in reversed(CLASSES):
        bpy.utils.unregister_class(cls)
