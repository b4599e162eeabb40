# SPDX-License-Identifier: GPL-3.0-or-later
"""The Blender shell around the core: the only place that knows Blender."""

import gc
import importlib

from ..core.dependencies import missing_packages
from . import preferences

MODULES = ("steps", "menus", "handlers", "commands", "warm_up")
"""What registers besides the preferences, in this order; each has ``register()`` and ``unregister()``."""

_registered: list = []


def register() -> None:
    """Register everything, or, when a library is missing, only the panel that says so."""
    collects = gc.isenabled()
    gc.disable()  # what modules are made of stays: looking for garbage in it is an eighth of the time
    try:
        _register()
    finally:
        if collects:
            gc.enable()


def _register() -> None:
    try:
        absent = missing_packages()
        modules = [] if absent else [importlib.import_module(f".{name}", __name__) for name in MODULES]
        problem = f"Missing Python packages: {', '.join(absent)}" if absent else ""
    except ImportError as error:
        modules, problem = [], f"A library cannot be loaded: {error}"
    preferences.problem = problem
    try:
        for module in (preferences, *modules):
            module.register()
            _registered.append(module)
    except BaseException:
        unregister()
        raise


def unregister() -> None:
    while _registered:
        _registered.pop().unregister()
