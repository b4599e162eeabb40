# SPDX-License-Identifier: GPL-3.0-or-later
"""Objects that come or go after Blender has stored its undo step belong to that step.

An undo to the step before would otherwise keep collections that point to objects which are no more. Blender takes over
what its steps do not tell apart, and crashes now and then where objects or scenes have come or gone that no step knows;
scripts that undo in the background have to store their steps themselves (`bpy.ops.ed.undo_push`).
"""

import bpy

IDENTIFIER = "rockfall.extend_step"


def extend_last_step(name: str | None = None) -> None:
    """Store a step again, with what followed from it; nothing without a window.

    Parameters
    ----------
    name : of the last step; None is that of the last operator.

    Notes
    -----
    Blender joins steps of operators with the same undo group: one of the last operator's name takes its step's place.
    """
    manager = bpy.context.window_manager
    if bpy.app.background or not manager.windows:
        return
    if name is None:
        name = manager.operators[-1].name if manager.operators else "Rockfall"
    operator = type(
        "ROCKFALL_OT_extend_step",
        (bpy.types.Operator,),
        {
            "bl_idname": IDENTIFIER,
            "bl_label": name,
            "bl_options": {"INTERNAL", "UNDO_GROUPED"},
            "bl_undo_group": name,
            "execute": lambda self, context: {"FINISHED"},
        },
    )
    bpy.utils.register_class(operator)
    try:
        with bpy.context.temp_override(window=manager.windows[0]):
            bpy.ops.rockfall.extend_step("EXEC_DEFAULT", True)
    finally:
        bpy.utils.unregister_class(operator)
