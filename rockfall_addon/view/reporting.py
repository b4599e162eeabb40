# SPDX-License-Identifier: GPL-3.0-or-later
"""How an operator begins and ends: a scene of a newer version is refused; an error is reported in words."""

import functools
import re
from collections.abc import Callable

import bpy

from ...core.errors import RockfallError
from ..scene import migration

TRACEBACK = "Traceback (most recent call last)"


def reported(execute: Callable[..., set[str]]) -> Callable[..., set[str]]:
    """Turn a RockfallError of an operator's method into a report, and cancel; else draw everything again."""

    @functools.wraps(execute)
    def wrapper(self: bpy.types.Operator, context: bpy.types.Context) -> set[str]:  # Blender counts the arguments
        try:
            ended = execute(self, context)
        except RockfallError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        redraw(context)
        return ended

    return wrapper


def told(error: Exception) -> str:
    """What one of Blender's own operators says, without a full stop: of a traceback the error at its end."""
    text = str(error).removeprefix("Error: ").strip()
    if TRACEBACK in text:
        ends = re.findall(r"^[A-Za-z_][\w.]*(?:Error|Exception)\b.*$", text, flags=re.MULTILINE)
        text = ends[-1] if ends else text.partition(TRACEBACK)[0].strip(" :") or "its exporter failed"
    return " ".join(text.split()).rstrip(".")


def possible(cls: type[bpy.types.Operator], can: object, otherwise: str) -> bool:
    """For an operator's poll: whether it can run; if not, its tooltip says what to do."""
    if not can:
        cls.poll_message_set(otherwise)
    return bool(can)


class InWindow:
    """Mix-in of operators that arrange a window, and change nothing of the scene."""

    bl_options = {"REGISTER"}
    looks_only = True

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return possible(cls, context.window is not None and not bpy.app.background, "There is no window")


def leave_newer_alone(cls: type) -> None:
    """Make a class that is to be registered leave a scene of a newer version as it is.

    An operator refuses it before anything else, unless its ``looks_only`` is true; a panel is drawn in grey.
    """
    if issubclass(cls, bpy.types.Operator) and not getattr(cls, "looks_only", False):
        cls.poll = classmethod(_refusing(cls.poll.__func__ if hasattr(cls, "poll") else None))
    elif issubclass(cls, bpy.types.Panel):
        cls.draw = _grey(cls.draw)


def _refusing(poll: Callable[..., bool] | None) -> Callable[..., bool]:
    if hasattr(poll, "refuses"):
        return poll

    def refusing(cls: type[bpy.types.Operator], context: bpy.types.Context) -> bool:
        if migration.is_newer(context.scene):
            cls.poll_message_set(migration.warning(context.scene))
            return False
        return poll is None or poll(cls, context)

    refusing.refuses = True
    return refusing


def _grey(draw: Callable[..., None]) -> Callable[..., None]:
    if hasattr(draw, "greys"):
        return draw

    @functools.wraps(draw)
    def greying(self: bpy.types.Panel, context: bpy.types.Context) -> None:
        if migration.is_newer(context.scene):
            self.layout.enabled = False
        draw(self, context)

    greying.greys = True
    return greying


def redraw(context: bpy.types.Context) -> None:
    """Draw all views and panels again: Blender does not know who shows what the scene stores."""
    for window in context.window_manager.windows:
        for area in window.screen.areas:
            area.tag_redraw()
