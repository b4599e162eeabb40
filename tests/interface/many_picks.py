# SPDX-License-Identifier: GPL-3.0-or-later
"""A large table of picks: its trajectories are computed beside Blender, and Esc changes nothing."""

import csv
import tempfile
from pathlib import Path

import bpy

TRAJECTORIES = 15


def write_table(path):
    """Falls of nine impacts each, down a plane."""
    with path.open("w", newline="") as file:
        table = csv.writer(file)
        table.writerow(("trajectory", "time_s", "x_m", "y_m", "z_m", "kind"))
        for run in range(TRAJECTORIES):
            for i in range(9):
                table.writerow((f"run {run}", 30.0 * run + 1.1 * i, 12.0 * i, float(run), 80.0 - 9.0 * i, "impact"))


def case_many_picks(window):
    """Stopped by Esc it changes nothing; not stopped it shows them all, as one undo step."""
    path = Path(tempfile.mkdtemp()) / "picks.csv"
    write_table(path)
    job, store = (window.part(name) for name in ("rockfall_addon.view.job", "rockfall_addon.scene.storage.store"))
    window.part("rockfall_addon.steps.picking.table_operators").MANY_PICKS = 100
    scene = bpy.context.scene
    with window.override():
        bpy.ops.ed.undo_push(message="before")
        assert bpy.ops.rockfall.import_picks(filepath=str(path)) == {"INTERFACE"}
        assert job.is_running()
        job.cancel()
    yield 1.0
    assert not store.has_role(scene, store.PICK_ROLE)
    assert store.SHOWN not in scene
    yield from stopped_while_shown(window, path)
    with window.override():
        assert bpy.ops.rockfall.import_picks(filepath=str(path)) == {"INTERFACE"}
    yield from window.wait_for(lambda: not job.is_running(), 60, "imported")
    yield 1.0
    scene = bpy.context.scene
    assert len(store.of_role(scene, store.PICK_ROLE)) == 9 * TRAJECTORIES
    assert len(store.of_role(scene, store.FLIGHTS_ROLE)) == TRAJECTORIES
    window.screenshot("1-imported")
    with window.override():
        bpy.ops.ed.undo()
    yield 0.5
    assert not store.has_role(bpy.context.scene, store.PICK_ROLE)


def stopped_while_shown(window, path):
    """Esc while the trajectories are shown takes back those that are there already."""
    job, store = (window.part(name) for name in ("rockfall_addon.view.job", "rockfall_addon.scene.storage.store"))
    job.SHOWING_S = 0.0
    with window.override():
        assert bpy.ops.rockfall.import_picks(filepath=str(path)) == {"INTERFACE"}
    shown = lambda: store.has_role(bpy.context.scene, store.PICK_ROLE)  # noqa: E731
    yield from window.wait_for(shown, 60, "shown")
    yield from window.press("ESC", *window.centre())
    yield from window.wait_for(lambda: not job.is_running(), 20, "stopped")
    yield 1.0
    assert not shown()
    assert not any(obj.name.startswith("run ") for obj in bpy.data.objects)
    assert store.SHOWN not in bpy.context.scene
    job.SHOWING_S = 1.0
