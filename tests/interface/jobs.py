# SPDX-License-Identifier: GPL-3.0-or-later
"""Long work beside Blender: a person undoes, opens another file, and goes on."""

import sys
from pathlib import Path

import bpy

sys.path.append(str(Path(__file__).parent))

import alignment as aligning

FOOTAGE = aligning.FOOTAGE


def begin(window):
    """Follow the background of the demo's footage."""
    with window.override():
        assert bpy.ops.rockfall.import_pairs(filepath=str(FOOTAGE / "pairs.csv")) == {"FINISHED"}
        aligning.the_camera(window).rockfall_alignment.motion = "ROTATION"
        bpy.ops.ed.undo_push(message="pairs")
        bpy.ops.rockfall.follow_background("INVOKE_DEFAULT")
    yield 2.0


def case_job_and_undo(window):
    """Undo while it runs does not disturb it; its result is an undo step of its own."""
    yield from aligning.start(window)
    job = window.part("rockfall_addon.view.job")
    yield from begin(window)
    window.screenshot("1-running")
    camera = aligning.the_camera(window)
    camera.rockfall_alignment.show_pairs = False
    with window.override():
        bpy.ops.ed.undo_push(message="hide")
        bpy.ops.ed.undo()
    yield 0.5
    assert aligning.the_camera(window).rockfall_alignment.show_pairs
    assert job.is_running()
    yield from window.wait_for(lambda: not job.is_running(), 150, "followed")
    yield 0.5
    window.screenshot("2-followed")
    assert len(aligning.the_camera(window)["rockfall_pose_times_s"]) == 300
    with window.override():
        bpy.ops.ed.undo()
    yield 0.5
    assert len(aligning.the_camera(window)["rockfall_pose_times_s"]) == 1
    yield 9.0
    window.screenshot("3-undone")


def case_job_and_another_file(window):
    """Another file ends it; afterwards it can begin again."""
    yield from aligning.start(window)
    yield from begin(window)
    with window.override():
        bpy.ops.wm.read_homefile(use_empty=False)
    yield 2.0
    yield from window.show_sidebar()
    yield 1.0
    window.screenshot("1-another-file")
    yield from aligning.start(window)
    with window.override():
        bpy.ops.rockfall.import_pairs(filepath=str(FOOTAGE / "pairs.csv"))
        aligning.the_camera(window).rockfall_alignment.motion = "ROTATION"
        assert bpy.ops.rockfall.follow_background.poll()
        bpy.ops.rockfall.follow_background("INVOKE_DEFAULT")
    yield from window.wait_for(
        lambda: len(aligning.the_camera(window)["rockfall_pose_times_s"]) == 300, 150, "followed"
    )
