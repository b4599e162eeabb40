# SPDX-License-Identifier: GPL-3.0-or-later
"""Blender, or Blender as a module, in a process of its own: writes an animation that the core has computed.

What the parent process reads from our standard output is as in `steps/film/__main__.py`.
"""

import json
import os
import sys
from pathlib import Path
from typing import NoReturn

from ....core.children import end_with_parent
from ....core.errors import RockfallError
from ....core.film.maker import OURS


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
        from .animation import write

        job = json.loads(text)
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


if __name__ == "__main__":
    main(sys.argv[1])
