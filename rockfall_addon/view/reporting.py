# SPDX-License-Identifier: GPL-3.0-or-later
"""How an operator ends: an error in words, and nothing is changed; or done, and every view shows it."""

import functools
from collections.abc import Callable

import bpy

from ...core.errors import RockfallError


def reported(execute: Callable[..., set[str]]) -> Callable[..., set[str]]:
    """Turn a RockfallError of an operator's method into a report, and cancel; else draw everything again."""

    @functools.wraps(execute)
    def wrapper(self: bpy.types.Operator, context: bpy.types.Context) -> set[str]:  # Blender counts the arguments
        try:
            ended = execute(self, context)
        except RockfallError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        _redraw(context)
        return ended

    return wrapper


def _redraw(context: bpy.types.Context) -> None:
    """Draw all views and panels again: Blender does not know who shows what the scene stores."""
    for window in context.window_manager.windows:
        for area in window.screen.areas:
            area.tag_redraw()
