# SPDX-License-Identifier: GPL-3.0-or-later
"""How an operator begins and ends: what the scenes store is checked; an error is reported in words."""

import functools
import re
from collections.abc import Callable
from pathlib import Path

import bpy

from ...core.errors import RockfallError, readable
from ..scene import problems
from ..scene.storage import migration, set_aside

_answered: list[str] = []
"""The operator that is answering; one that it calls need not check again."""
MOST_OF_NAME = 60
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


def answer_in_words(cls: type) -> None:
    """Make an operator that is to be registered answer in words, whatever it is called with and the scenes store.

    What is stored is checked before it is read: another add-on, a script or an append may have left anything. An error
    that is not foreseen is reported in one line, as those of handlers are.
    """
    if not issubclass(cls, bpy.types.Operator):
        return
    for name in ("execute", "invoke"):
        given = next((one.__dict__[name] for one in cls.__mro__ if name in one.__dict__), None)
        if given is not None and not hasattr(given, "answers"):
            setattr(cls, name, _answering(given, checks=not getattr(cls, "looks_only", False)))


def _answering(method: Callable[..., set[str]], *, checks: bool) -> Callable[..., set[str]]:
    def answer(self: bpy.types.Operator, context: bpy.types.Context, *event: bpy.types.Event) -> set[str]:
        try:
            if checks and not _answered:
                _answered.append(self.bl_idname)
                try:
                    check_stored()
                    return method(self, context, *event)
                finally:
                    _answered.clear()
            return method(self, context, *event)
        except RockfallError as error:
            self.report({"ERROR"}, str(error))
        except OSError as error:
            name = Path(str(error.filename or "")).name
            self.report({"ERROR"}, f"{readable(name, MOST_OF_NAME) or 'The file'}: {error.strerror or error}.")
        except Exception as error:  # noqa: BLE001 - Blender would show a traceback
            problems.failed(self.bl_label, error)
            self.report({"ERROR"}, f"Something went wrong in {self.bl_label}: {type(error).__name__}: {error}")
        return {"CANCELLED"}

    if method.__code__.co_argcount == 2:  # Blender counts the arguments

        @functools.wraps(method)
        def execute(self: bpy.types.Operator, context: bpy.types.Context) -> set[str]:
            return answer(self, context)

        execute.answers = True
        return execute

    @functools.wraps(method)
    def invoke(self: bpy.types.Operator, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        return answer(self, context, event)

    invoke.answers = True
    return invoke


def check_stored() -> None:
    """Set aside what the scenes store and cannot be used, before it is read."""
    for scene in bpy.data.scenes:
        if not migration.is_left_alone(scene):
            set_aside.look(scene)


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
        if migration.is_left_alone(context.scene):
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
        if migration.is_left_alone(context.scene):
            self.layout.enabled = False
        draw(self, context)

    greying.greys = True
    return greying


def redraw(context: bpy.types.Context) -> None:
    """Draw all views and panels again: Blender does not know who shows what the scene stores."""
    for window in context.window_manager.windows:
        for area in window.screen.areas:
            area.tag_redraw()
