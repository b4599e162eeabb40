# SPDX-License-Identifier: GPL-3.0-or-later
"""Load the large libraries and compile the kernels in the background, so that the first steps do not wait for them.

It begins when the window stands: nothing of it belongs to Blender's start.
"""

import threading

import bpy

from ..core.errors import DependencyError
from . import preferences
from .scene.models import models
from .scene.picks import preparation

AFTER_S = 0.5


def register() -> None:
    if not bpy.app.background:
        preparation.begin(models.ORDER)
        bpy.app.timers.register(_begin, first_interval=AFTER_S, persistent=True)


def unregister() -> None:
    """A running compilation ends by itself."""
    if bpy.app.timers.is_registered(_begin):
        bpy.app.timers.unregister(_begin)
        preparation.end()


def _begin() -> None:
    threading.Thread(target=_prepare, name="rockfall kernels", daemon=True).start()


def _prepare() -> None:
    try:
        from ..core.commands.prepare import prepare

        prepare(models.ORDER, preparation.done)
    except ImportError as error:
        preferences.problem = f"A library cannot be loaded: {error}"
    except DependencyError as error:
        preferences.problem = str(error)
    finally:
        preparation.end()
