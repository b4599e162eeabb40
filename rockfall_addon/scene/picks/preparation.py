# SPDX-License-Identifier: GPL-3.0-or-later
"""Models whose code is still being compiled, or read from the disk, in the background: graphs go on without them.

The thread that compiles says what is done; graphs that wait for a model are drawn again when it is.
"""

from collections.abc import Iterable

import bpy

from .. import problems
from ..models import graph_settings

LOOK_AGAIN_S = 0.2

_pending: set[str] = set()
_drawn = [0]
"""Of how many models the graphs were drawn last that they are not ready."""


def begin(models: Iterable[str]) -> None:
    """These models will be prepared: `done` for each, and `end` in any case."""
    _pending.update(models)


def done(model: str) -> None:
    """A model is ready."""
    _pending.discard(model)


def end() -> None:
    """Nothing more is prepared: what is not ready will be when it is asked for."""
    _pending.clear()


def pending(models: Iterable[str]) -> tuple[str, ...]:
    """Those of the models that are not ready; graphs are drawn again when one of them is."""
    found = tuple(name for name in models if name in _pending)
    if found and not bpy.app.timers.is_registered(_look):
        _drawn[0] = len(_pending)
        bpy.app.timers.register(_look, first_interval=LOOK_AGAIN_S)
    return found


@problems.guarded
def _look() -> float | None:
    if len(_pending) != _drawn[0]:
        _drawn[0] = len(_pending)
        graph_settings.redraw()
    return LOOK_AGAIN_S if _pending else None
