# SPDX-License-Identifier: GPL-3.0-or-later
"""Opening a saved .blend without a window."""

from pathlib import Path

import bpy

from ....core.errors import InputError
from . import migration


def open_saved(file: Path, name: str = "") -> bpy.types.Scene:
    """Open a .blend; returns the scene of that name, or without one that which was open when it was saved.

    Raises
    ------
    InputError : Blender cannot open it, it has no such scene, or a newer Rockfall has saved it.
    """
    try:
        bpy.ops.wm.open_mainfile(filepath=str(file.absolute()))
    except RuntimeError as error:
        problem = str(error).removeprefix("Error: ").strip().rstrip(".")
        raise InputError(f"Blender cannot open this ({problem})", file=file, advice="Save it again") from error
    scene = bpy.data.scenes.get(name) if name else bpy.context.scene
    if scene is None:
        raise InputError(f"There is no scene {name!r} in it", file=file, advice="Save it again")
    if migration.is_left_alone(scene):
        raise InputError(migration.warning(scene), file=file)
    return scene
