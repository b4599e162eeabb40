# SPDX-License-Identifier: GPL-3.0-or-later
"""The random walk of tests/blender in a window, where timers, handlers and drawing come between the steps.

More steps, or another walk: ROCKFALL_WALK_STEPS=1000 ROCKFALL_WALK_SEED=7.
"""

import os
import sys
import tempfile
from pathlib import Path

sys.path.append(str(Path(__file__).parents[1] / "blender"))

import random_walk

STEPS, SEED = 15, 3
DRAWN, BREATH_S = 4, 0.02
"""After every so many steps Blender draws the window, which takes longer than most of them."""
LEAST_KINDS = 8


def case_random_walk(window):
    """Whatever is done, no pick is lost, and Blender lives."""
    steps, seed = (
        int(os.environ.get(f"ROCKFALL_WALK_{key}", value)) for key, value in (("STEPS", STEPS), ("SEED", SEED))
    )
    walk = random_walk.Walk(seed, Path(tempfile.mkdtemp()), window.part, first_the_step=True)
    with window.override():
        walk.begin()
    yield 1.0
    undo = window.part("rockfall_addon.scene.storage.undo")
    extend = undo.extend_last_step
    undo.extend_last_step = lambda _name=None: extend(walk.pushed)  # the walk stores the steps, not operators
    try:
        for number in range(steps):
            with window.override():
                print(f"{number:4d} {walk.step()}", flush=True)
            with window.override():  # another one where a file was loaded
                walk.check()
            if number % DRAWN == 0:
                yield BREATH_S
    finally:
        undo.extend_last_step = extend
    window.screenshot("1-end")
    assert len({name.split()[0].split("(")[0] for name in walk.done}) >= LEAST_KINDS
