# SPDX-License-Identifier: GPL-3.0-or-later
"""Which engine is quicker here for a film, by a frame of each: Cycles works on all cores, Workbench without a graphics
card on one, and how much a frame costs depends on the terrain."""

import time

import bpy

from .engine import use_engine

RIVALS = ("cycles", "workbench")
FEWEST_FRAMES = 60
"""Of shorter films the measurement would take too large a part."""


def use_quicker(scene: bpy.types.Scene, first: int, last: int) -> str:
    """Set a film's scene up for the quicker engine; a sentence on that, empty for a film too short to measure."""
    if last - first + 1 < FEWEST_FRAMES:
        use_engine(scene, RIVALS[0])
        return ""
    took = {}
    for engine in RIVALS:
        use_engine(scene, engine)
        took[engine] = _frame_s(scene, (first + last) // 2)
    best, other = sorted(took, key=took.__getitem__)
    use_engine(scene, best)
    names = f"{best.capitalize()}, which takes {took[best]:.2f} s for a frame here"
    return f"Rendered with {names}; {other.capitalize()} takes {took[other]:.2f} s."


def _frame_s(scene: bpy.types.Scene, frame: int) -> float:
    """Seconds of a frame; the one before it, with what is made once for all, is not counted."""
    for number in (frame - 1, frame):
        begin = time.perf_counter()
        scene.frame_set(number)
        bpy.ops.render.render(scene=scene.name)
    return time.perf_counter() - begin
