# SPDX-License-Identifier: GPL-3.0-or-later
"""The steps of the workflow, a folder each: its properties, operators, panel and overlay. No step imports another."""

from importlib import import_module
from types import ModuleType

import bpy

from .. import view
from ..scene.models import comparison_settings, graph_settings, model_parameters, motion_settings
from ..scene.storage import settings
from ..view import toolbar
from ..view.reporting import answer_in_words, leave_newer_alone

STEPS = (
    "start",
    "terrain",
    "videos",
    "alignment",
    "picking",
    "spin",
    "impacts",
    "strip",
    "refinement",
    "models",
    "comparison",
    "graphs",
    "motion",
    "simulation",
    "playback",
    "film",
    "share",
)
"""In the order of the sidebar."""

_registered: list[ModuleType] = []


def parts() -> list[ModuleType]:
    """All modules that register something: first the properties, which the rest reads; then step by step.

    Last come those with `OVER_ALL`: what Blender is asked to draw later lies over the rest.
    """
    first = [settings, model_parameters, comparison_settings, graph_settings, motion_settings]
    found = [*first, *view.PARTS]
    for name in STEPS:
        found += import_module(f".{name}", __name__).PARTS

    def turn(part: ModuleType) -> tuple[bool, bool]:
        return part not in first and not part.__name__.endswith(".properties"), getattr(part, "OVER_ALL", False)

    return sorted(found, key=turn)


def classes() -> list[type]:
    """Panels, operators and lists of all parts."""
    return [cls for part in parts() for cls in getattr(part, "CLASSES", ())]


def tools() -> list[type]:
    """The tools of all parts."""
    return [tool for part in parts() for tool in getattr(part, "TOOLS", ())]


def register() -> None:
    """Register what each part lists in ``CLASSES`` and what it does itself; then all tools.

    The keys of a tool set properties of operators, which may belong to another step: these must be there before.
    """
    for part in parts():
        _registered.append(part)
        for cls in getattr(part, "CLASSES", ()):
            leave_newer_alone(cls)
            answer_in_words(cls)
            bpy.utils.register_class(cls)
        if hasattr(part, "register"):
            part.register()
    toolbar.register(tools())


def unregister() -> None:
    """The same backwards."""
    toolbar.unregister()
    while _registered:
        part = _registered.pop()
        if hasattr(part, "unregister"):
            part.unregister()
        for cls in reversed(getattr(part, "CLASSES", ())):
            bpy.utils.unregister_class(cls)
