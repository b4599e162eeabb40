# SPDX-License-Identifier: GPL-3.0-or-later
"""What operators share that read a chosen file: the file browser opens where the last file was."""

from pathlib import Path

import bpy
from bpy.props import StringProperty
from bpy_extras.io_utils import ImportHelper

from ... import __package__ as ADDON_ID  # noqa: N812

_now: list[Path] = []
"""Folder of the last file since Blender was started."""


class FromFile(ImportHelper):
    """Mix-in: asks for a file each time."""

    filepath: StringProperty(subtype="FILE_PATH", options={"SKIP_SAVE"})

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        if not self.filepath:
            self.filepath = last_folder(context)
            if hasattr(self, "directory"):  # of those that take several files; Blender looks at it first
                self.directory = self.filepath
        return super().invoke(context, event)

    def chosen(self, context: bpy.types.Context) -> Path:
        """The chosen file, beside which the next browser opens."""
        path = Path(bpy.path.abspath(self.filepath))
        remember_folder(context, path.parent)
        return path


def last_folder(context: bpy.types.Context) -> str:
    """Where the last file was, with a final separator; empty when that is not known or no more."""
    kept = _preferences(context)
    folder = _now[-1] if _now else Path(kept.folder) if kept is not None and kept.folder else None
    return str(folder / "_")[:-1] if folder is not None and folder.is_dir() else ""


def remember_folder(context: bpy.types.Context, folder: Path) -> None:
    """Open the next file browser there; where Blender keeps our preferences, also after it is started again."""
    folder = folder.resolve()
    if not folder.is_dir():
        return
    _now[:] = [folder]
    kept = _preferences(context)
    if kept is not None and kept.folder != str(folder):
        kept.folder = str(folder)
        context.preferences.is_dirty = True


def _preferences(context: bpy.types.Context) -> bpy.types.AddonPreferences | None:
    ours = context.preferences.addons.get(ADDON_ID)
    return None if ours is None else ours.preferences
