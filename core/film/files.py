# SPDX-License-Identifier: GPL-3.0-or-later
"""Where a film goes: always a file with a name, never the folder itself or the one above it."""

import os
from pathlib import Path

SUFFIX = ".mp4"
NAME = f"rockfall{SUFFIX}"


def film_file(asked: str, suggested: Path) -> Path:
    """The file of a film.

    Parameters
    ----------
    asked : as a person gives it: a file, with or without .mp4; a folder; empty.
    suggested : the file where nothing is asked for; its name where a folder is, its folder where none is.
    """
    asked = asked.strip()
    if not asked:
        return suggested
    path = suggested.parent / asked
    if asked.endswith(("/", os.sep)) or not path.name or path.name == ".." or path.is_dir():
        return path / suggested.name
    return path if path.suffix.lower() == SUFFIX else path.with_name(path.name + SUFFIX)
