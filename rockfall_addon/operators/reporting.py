# SPDX-License-Identifier: GPL-3.0-or-later
"""How an operator tells what went wrong: in words, and nothing is changed."""

import functools
from collections.abc import Callable

import bpy

from ...core.errors import RockfallError


def reported(execute: Callable[..., set[str]]) -> Callable[..., set[str]]:
    """Turn a RockfallError of an operator's method into a report, and cancel."""

    @functools.wraps(execute)
    def wrapper(self: bpy.types.Operator, context: bpy.types.Context) -> set[str]:  # Blender counts the arguments
        try:
            return execute(self, context)
        except RockfallError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}

    return wrapper
