# SPDX-License-Identifier: GPL-3.0-or-later
"""Where an operator writes to: what was chosen in the file browser, or given by a script."""

from pathlib import Path

import bpy

from ...core.errors import RockfallError


def asked_file(filepath: str) -> Path:
    """The file that was asked for.

    Raises
    ------
    RockfallError : none was.
    """
    path = Path(bpy.path.abspath(filepath))
    if not path.name or path.name == ".." or path.is_dir():
        raise RockfallError("There is no name for the file. Choose one in the file browser, or give it as filepath.")
    return path


def asked_folder(directory: str) -> Path:
    """The folder that was asked for.

    Raises
    ------
    RockfallError : none was.
    """
    if not directory.strip():
        raise RockfallError("There is no folder to write to. Choose one in the file browser, or give it as directory.")
    return Path(bpy.path.abspath(directory))
