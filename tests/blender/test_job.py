# SPDX-License-Identifier: GPL-3.0-or-later
"""Long work beside Blender: one at a time, its result to the scene in which it began, nothing after another file."""

import threading

import bpy
import pytest


@pytest.fixture
def job(part):
    found = part("rockfall_addon.view.job")
    yield found
    found.cancel()
    found._ended.clear()


class Waiting:
    """Work that goes on until it is let go."""

    def __init__(self, job, result="found") -> None:
        self.go, self.begun, self.kept = threading.Event(), threading.Event(), []
        self.result = result
        self.work = job.Work("alignment", self.compute, self.keep)

    def compute(self, progress):
        for done in range(1000):
            progress("Waiting", done, 1000)
            self.begun.set()
            if self.go.wait(0.01):
                if isinstance(self.result, Exception):
                    raise self.result
                return self.result
        return None

    def keep(self, scene, found):
        self.kept.append((scene.name, found))
        return "Done."

    def end(self, job) -> None:
        self.go.set()
        (now,) = job._running
        now._thread.join(5.0)
        job.tick()


def test_the_result_goes_to_the_scene_in_which_the_work_began(job) -> None:
    scene, other = bpy.context.scene, bpy.data.scenes.new("Other")
    waiting = Waiting(job)
    job.begin(waiting.work, "Wait", scene)
    assert waiting.begun.wait(5.0)
    scene.name = "Renamed"
    bpy.context.window_manager.windows[0].scene = other
    assert job.tick(), "called again while it works"
    assert "Waiting: " in job._running[0].line
    waiting.end(job)
    assert waiting.kept == [("Renamed", "found")]
    assert not job.is_running()


def test_one_at_a_time(job, part) -> None:
    waiting = Waiting(job)
    job.begin(waiting.work, "Wait", bpy.context.scene)
    with pytest.raises(part("core.errors").RockfallError, match="Wait is still at work"):
        job.begin(waiting.work, "Another", bpy.context.scene)
    waiting.end(job)
    assert len(waiting.kept) == 1


def test_stopped(job) -> None:
    waiting = Waiting(job)
    job.begin(waiting.work, "Wait", bpy.context.scene)
    thread = job._running[0]._thread
    assert bpy.ops.rockfall.stop_job() == {"FINISHED"}
    assert not job.is_running()
    thread.join(5.0)
    assert not thread.is_alive()
    assert job.tick() is None
    assert waiting.kept == []
    assert not bpy.ops.rockfall.stop_job.poll()


def test_another_file_leaves_no_lock(job) -> None:
    waiting = Waiting(job)
    job.begin(waiting.work, "Wait", bpy.context.scene)
    bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=True, load_ui=False)
    assert not job.is_running()
    assert "another file" in job._ended[0].problem
    again = Waiting(job)
    job.begin(again.work, "Wait", bpy.context.scene)
    again.end(job)
    assert (len(waiting.kept), len(again.kept)) == (0, 1)


def test_a_scene_that_is_gone(job) -> None:
    other, waiting = bpy.data.scenes.new("Other"), Waiting(job)
    job.begin(waiting.work, "Wait", other)
    bpy.data.scenes.remove(other)
    waiting.end(job)
    assert waiting.kept == []
    assert "its scene was deleted" in job._ended[0].problem


def test_what_goes_wrong_is_said(job, part) -> None:
    for result, words in (
        (part("core.errors").RockfallError("Bad luck."), "Bad luck."),
        (ValueError("x"), "ValueError"),
    ):
        waiting = Waiting(job, result)
        job.begin(waiting.work, "Wait", bpy.context.scene)
        waiting.end(job)
        assert words in job._ended[0].problem
        assert waiting.kept == []
        assert not job.is_running()
        assert bpy.ops.rockfall.dismiss_problem() == {"FINISHED"}
        assert not job._ended
        assert not bpy.ops.rockfall.dismiss_problem.poll()
    part("rockfall_addon.scene.problems").forget()
