# SPDX-License-Identifier: GPL-3.0-or-later
"""Blender, or Blender as a module, in a process of its own: one job, given as JSON.

Blender prints a lot, so its standard output goes to the error stream. What the parent process reads from our standard
output are lines "rockfall progress DONE TOTAL TEXT", "rockfall remark TEXT", and "rockfall error TEXT" for what the
user can put right.
"""

import os
import sys
from typing import NoReturn

import bpy

from .... import rockfall_addon
from ....core.blender_process import OURS
from ....core.children import end_with_parent
from ....core.errors import RockfallError
from ....core.film.job import FilmJob
from .render import make


def main(text: str) -> NoReturn:
    end_with_parent()
    parent = os.fdopen(os.dup(1), "w", encoding="utf-8", buffering=1)
    os.dup2(2, 1)

    def say(line: str) -> None:
        try:
            parent.write(f"{OURS}{line}\n")
        except BrokenPipeError:  # nobody waits for this film any more
            os._exit(1)

    status = 0
    try:
        if not bpy.app.binary_path:  # Blender as a module; Blender itself has Rockfall enabled
            bpy.ops.wm.read_factory_settings(use_empty=True)
            rockfall_addon.register()
        for remark in make(
            FilmJob.from_json(text), lambda what, done=0, total=0: say(f"progress {done} {total} {what}")
        ):
            say(f"remark {remark}".replace("\n", " "))
    except RockfallError as error:
        say(f"error {error}".replace("\n", " "))
        status = 1
    parent.close()
    sys.stderr.flush()
    os._exit(status)  # after work on the graphics card, Blender may crash when it leaves by itself


if __name__ == "__main__":
    main(sys.argv[1])
