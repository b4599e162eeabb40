# SPDX-License-Identifier: GPL-3.0-or-later
"""What runs by itself: keys follow the frame rate, caches are dropped when another file is loaded."""

import bpy
from bpy.app.handlers import persistent

from .bridge import terrain, timing

_owner = object()


@persistent
def _follow_rate(scene: bpy.types.Scene, _depsgraph: bpy.types.Depsgraph | None = None) -> None:
    timing.follow_frame_rate(scene)


@persistent
def _loaded(_path: str) -> None:
    terrain.forget_surfaces()
    _listen()  # subscriptions do not survive loading


@persistent
def _restored(scene: bpy.types.Scene, _unused: object = None) -> None:
    terrain.forget_surfaces()
    timing.follow_frame_rate(scene)


def _rate_changed() -> None:
    for scene in bpy.data.scenes:
        timing.follow_frame_rate(scene)


def _listen() -> None:
    for name in ("fps", "fps_base"):
        bpy.msgbus.subscribe_rna(key=(bpy.types.RenderSettings, name), owner=_owner, args=(), notify=_rate_changed)


HANDLERS = (
    ("frame_change_pre", _follow_rate),
    ("depsgraph_update_post", _follow_rate),
    ("render_init", _follow_rate),
    ("load_post", _loaded),
    ("undo_post", _restored),
    ("redo_post", _restored),
)


def register() -> None:
    for name, function in HANDLERS:
        getattr(bpy.app.handlers, name).append(function)
    _listen()


def unregister() -> None:
    bpy.msgbus.clear_by_owner(_owner)
    for name, function in HANDLERS:
        getattr(bpy.app.handlers, name).remove(function)
