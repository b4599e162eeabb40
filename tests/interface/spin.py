# SPDX-License-Identifier: GPL-3.0-or-later
"""A person marks one point of the block in pictures of a flight, looks at its spin, says what was counted, undoes."""

import sys
from pathlib import Path

import bpy
import numpy as np

sys.path.append(str(Path(__file__).parent))

from picking import camera_of, no_trouble, on_screen, open_site, pick_impacts, picks, rows

NAME = "B10"
RADIUS = 0.195


def pixel_of(window, frame, turns):
    """A point of the near side of the true block that has made some turns about the axis of rolling."""
    pictures, project = window.part("rockfall_addon.scene.footage.pictures"), window.part("core.camera.model").project
    block = {int(row["frame"]): row for row in rows("block.csv")}
    lens = pictures.posed(camera_of(window), frame / 30)
    centre = np.array([float(block[frame][f"{axis}_m"]) for axis in "xyz"]) - (988400.0, 6375600.0, 1500.0)
    axis = np.array([0.69, -0.72, 0.0]) / np.hypot(0.69, 0.72)
    away = (lens.position - centre) / np.linalg.norm(lens.position - centre)
    across = away - (away @ axis) * axis
    across /= np.linalg.norm(across)
    angle = 2 * np.pi * turns
    way = 0.9 * (np.cos(angle) * across + np.sin(angle) * np.cross(axis, across)) + 0.43 * axis
    return project(lens, (centre + RADIUS * way)[None])[0]


def zoom_on(window, pixel):
    """Enlarge the picture, with a pixel near the middle of the view."""
    view, region = window.area().spaces.active.region_3d, window.region()
    view.view_camera_zoom, view.view_camera_offset = 100.0, (0.0, 0.0)
    yield 0.5
    at = np.array(on_screen(window, pixel))
    view.view_camera_offset = (0.1, 0.1)
    yield 0.5
    step = (np.array(on_screen(window, pixel)) - at) / 0.1
    assert (np.abs(step) > 1).all(), "the picture follows its offset"
    middle = np.array([region.x + region.width / 2 - 120, region.y + region.height / 2])
    view.view_camera_offset = (middle - at) / step
    yield 0.5


def case_mark_the_spin_of_a_flight(window):
    yield from open_site(window)
    scene = bpy.context.scene
    spins = window.part("rockfall_addon.scene.picks.spins")
    _, impacts = yield from pick_impacts(window, 2)
    assert len(picks()) == 2
    with window.override():
        bpy.ops.wm.tool_set_by_id(name="rockfall.spin_tool")
    scene.rockfall_picking.sigma_px = 0.3
    first = round(float(impacts[0]["time_s"]) * 30) + 6
    yield from zoom_on(window, pixel_of(window, first, 0))
    for i in range(3):
        scene.frame_set(first + i)
        yield 0.3
        yield from window.click(*on_screen(window, pixel_of(window, first + i, 0.11 * (i - 1))))
    (pick,) = [obj for obj in picks() if spins.of(obj) is not None]
    assert spins.of(pick).marks == 3
    window.screenshot("marked")
    with window.override():
        bpy.ops.ed.undo()
    yield 0.5
    (pick,) = [obj for obj in picks() if spins.of(obj) is not None]
    assert spins.of(pick).marks == 2, "each mark is one step"
    with window.override():
        bpy.ops.ed.redo()
    yield 0.5
    (pick,) = [obj for obj in picks() if spins.of(obj) is not None]
    one = spins.of(pick)
    assert one.marks == 3
    assert one.is_known, one
    assert abs(one.rate - 2 * np.pi * 3.3) < 2 * one.sigma_rate, one
    with window.override():
        window.part("rockfall_addon.view.pointing").select(bpy.context, pick)
    yield from window.open_panel("ROCKFALL_PT_picks")
    window.screenshot("panel")
    yield from window.press("X", *on_screen(window, pixel_of(window, first + 2, 0.11)))
    (pick,) = [obj for obj in picks() if spins.of(obj) is not None]
    assert spins.of(pick).marks == 2
    no_trouble(window)
