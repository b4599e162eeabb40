# SPDX-License-Identifier: GPL-3.0-or-later
"""Blender, or Blender as a module, in a process of its own: writes an animation that the core has computed, or the
project that a saved .blend holds.

What the parent process reads from our standard output is as in `steps/film/__main__.py`.
"""

import json
import os
import sys
from pathlib import Path
from typing import NoReturn

from ....core.blender_process import OURS
from ....core.children import end_with_parent
from ....core.errors import InputError, RockfallError


def main(text: str) -> NoReturn:
    end_with_parent()
    parent = os.fdopen(os.dup(1), "w", encoding="utf-8", buffering=1)
    os.dup2(2, 1)

    def say(line: str) -> None:
        try:
            parent.write(f"{OURS}{line}\n")
        except BrokenPipeError:  # nobody waits for this any more
            os._exit(1)

    status = 0
    try:
        job = json.loads(text)
        if "blend" in job:
            for remark in _save_project(Path(job["blend"]), Path(job["folder"])):
                say(f"remark {remark}".replace("\n", " "))
        else:
            from .animation import write

            write(
                Path(job["source"]),
                [Path(file) for file in job["files"]],
                lambda what, done=0, total=0: say(f"progress {done} {total} {what}"),
            )
    except RockfallError as error:
        say(f"error {error}".replace("\n", " "))
        status = 1
    parent.close()
    sys.stderr.flush()
    os._exit(status)


def _save_project(blend: Path, folder: Path) -> list[str]:
    """Write the project of a .blend; returns what a user should know of it."""
    import bpy

    from .... import rockfall_addon

    if not bpy.app.binary_path:  # Blender as a module; Blender itself has Rockfall enabled
        bpy.ops.wm.read_factory_settings(use_empty=True)
        rockfall_addon.register()
    from ...scene import project
    from ...scene.storage.saved import open_saved

    try:
        _, left_out = project.save_project(open_saved(blend), folder)
    except InputError as error:
        if error.file == blend:  # which the parent process names as it was typed
            raise InputError(error.problem, advice=error.advice) from error
        raise
    return [remark.text for remark in left_out]


if __name__ == "__main__":
    main(sys.argv[1])
