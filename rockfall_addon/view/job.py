# SPDX-License-Identifier: GPL-3.0-or-later
"""Long work in a thread beside Blender, one at a time: where it is, how it is stopped, and where its result goes.

A person goes on meanwhile: undoes, changes the scene, opens another file. So the work knows nothing of Blender, and its
result goes to the scene in which it began, or nowhere.
"""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from threading import Event, Thread

import bpy

from ...core.errors import RockfallError
from ...core.progress import CancelledError, Progress, silent
from ..scene import problems, sync
from .panel import paragraph
from .reporting import redraw, reported

TICK_S = 0.15
LINGER_S = 8.0
"""How long the status bar says what came out."""


@dataclass(frozen=True)
class Work:
    """What an operator has prepared.

    Attributes
    ----------
    step : folder of the step whose panel shows it.
    compute : runs in a thread, without Blender; CancelledError raised in its progress ends it.
    keep : stores what was computed in the scene in which the work began, and says so in a sentence; RockfallError where
        that cannot be done any more.
    keeps_part : when it is stopped, `compute` gives what is finished, which is kept.
    changes : what is computed changes the scene: an undo step.
    unchanged : what is true when it was stopped.
    """

    step: str
    compute: Callable[[Progress], object]
    keep: Callable[[bpy.types.Scene, object], str]
    keeps_part: bool = False
    changes: bool = True
    unchanged: str = "Nothing has changed."


class Job:
    """Work on its way: `text`, `done` and `total` are its progress."""

    def __init__(self, work: Work, label: str, scene: bpy.types.Scene) -> None:
        self.work, self.label, self._scene = work, label, scene.session_uid
        self.text, self.done, self.total = label, 0, 0
        self.problem = ""
        self.found: object = None
        self.came_to_nothing = False
        self._stop = Event()
        self._thread = Thread(target=self._run, name=f"rockfall {work.step}", daemon=True)
        self._thread.start()

    @property
    def scene(self) -> bpy.types.Scene | None:
        """The scene in which the work began; None when it is gone."""
        return next((scene for scene in bpy.data.scenes if scene.session_uid == self._scene), None)

    @property
    def is_done(self) -> bool:
        """Whether the thread has ended."""
        return not self._thread.is_alive()

    @property
    def line(self) -> str:
        """Where the work is."""
        if self._stop.is_set():
            return "Stopping: what is finished is kept …"
        return f"{self.text}: {self.done} of {self.total}." if self.total else f"{self.text} …"

    @property
    def share(self) -> float:
        """How much of the present part of the work is done."""
        return self.done / self.total if self.total else 0.0

    @property
    def percent(self) -> str:
        """The same in words."""
        return f"{100 * self.share:.0f} %" if self.total else ""

    def stop(self) -> None:
        """End at the next word of progress."""
        self._stop.set()

    def _run(self) -> None:
        try:
            self.found = self.work.compute(self._progress)
        except CancelledError:
            self.came_to_nothing = True
        except RockfallError as error:
            self.problem = str(error)
        except Exception as error:  # noqa: BLE001 - whatever it is, it must not be lost in the thread
            problems.failed(self.label, error)
            self.problem = f"Something went wrong in Rockfall ({self.label}): {type(error).__name__}: {error}"

    def _progress(self, text: str, done: int, total: int) -> None:
        if self._stop.is_set():
            raise CancelledError
        self.text, self.done, self.total = text, done, total


class InBackground:
    """Mix-in of operators whose work takes long: beside Blender where there is a window, otherwise at once."""

    bl_options = {"REGISTER", "UNDO"}

    def prepare(self, context: bpy.types.Context) -> Work:
        """What is to be done; RockfallError when it cannot be."""
        raise NotImplementedError

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        return self.execute(context) if bpy.app.background else self._begin(context)

    @reported
    def _begin(self, context: bpy.types.Context) -> set[str]:
        begin(self.prepare(context), self.bl_label, context.scene)
        return {"INTERFACE"}  # the result is an undo step of its own

    @reported
    def execute(self, context: bpy.types.Context) -> set[str]:
        work = self.prepare(context)
        self.report({"INFO"}, work.keep(context.scene, work.compute(silent)))
        return {"FINISHED"}


class ROCKFALL_OT_stop_job(bpy.types.Operator):
    """Stop what Rockfall computes in the background; what is not finished changes nothing"""

    bl_idname = "rockfall.stop_job"
    bl_label = "Stop Background Work"
    bl_options = {"INTERNAL"}
    looks_only = True

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return is_running()

    def execute(self, context: bpy.types.Context) -> set[str]:
        cancel()
        return {"FINISHED"}


_running: list[Job] = []  # the one that a person waits for
_ended: list[tuple[str, str]] = []  # step and words of one that came to nothing
_keys: list[tuple[bpy.types.KeyMap, bpy.types.KeyMapItem]] = []


def is_running() -> bool:
    """Whether work is going on."""
    return bool(_running)


def is_free(cls: type[bpy.types.Operator]) -> bool:
    """For an operator's poll: whether work can begin; if not, what to do."""
    if _running:
        cls.poll_message_set(_busy())
    return not _running


def begin(work: Work, label: str, scene: bpy.types.Scene) -> None:
    """Begin work for a scene; `label` is its name for people and for undo.

    Raises
    ------
    RockfallError : other work is going on.
    """
    if _running:
        raise RockfallError(_busy())
    _ended.clear()
    _running.append(Job(work, label, scene))
    if bpy.app.timers.is_registered(_clear_status):
        bpy.app.timers.unregister(_clear_status)
    bpy.app.timers.register(tick, first_interval=TICK_S, persistent=True)


def cancel() -> None:
    """Stop the work; nothing changes, or what is finished is kept as soon as it has stopped."""
    for job in tuple(_running):
        job.stop()
        if not job.work.keeps_part:
            _end(job, _stopped(job))


def forget() -> None:
    """Another file was opened: the scene in which the work began is gone."""
    _ended.clear()
    for job in tuple(_running):
        job.stop()
        _end(job, f"{job.label} was stopped, because another file was opened.", is_problem=True)


def tick() -> float | None:
    """Show where the work is; when it has ended, store what came out. Blender calls it again and again."""
    if not _running:
        return None
    job = _running[0]
    if job.scene is None:
        job.stop()
        _end(job, f"{job.label} was stopped, because its scene was deleted.", is_problem=True)
    elif not job.is_done:
        _in_window(_show_progress)
    elif job.problem:
        _end(job, job.problem, is_problem=True)
    elif job.came_to_nothing:
        _end(job, _stopped(job))
    elif not sync.is_dragging():  # a person's drag is a step of its own
        _keep(job)
    return TICK_S if _running else None


@contextmanager
def at_the_cursor() -> Iterator[Progress]:
    """For what keeps Blender busy: the share that is done, at the mouse, in per cent."""
    manager, shown = bpy.context.window_manager, [-1]

    def progress(text: str, done: int, total: int) -> None:
        percent = 100 * done // total if total else 0
        if percent != shown[0]:  # to set the cursor takes longer than a step
            shown[0] = percent
            manager.progress_update(percent)

    manager.progress_begin(0, 100)
    try:
        yield progress
    finally:
        manager.progress_end()


@contextmanager
def in_window_of(scene: bpy.types.Scene) -> Iterator[bpy.types.Context]:
    """For what arranges views when the work is kept: a window that shows the scene, if there is one."""
    windows = [window for window in bpy.context.window_manager.windows if window.scene == scene]
    with bpy.context.temp_override(window=bpy.context.window or next(iter(windows), None)):
        yield bpy.context


def draw(context: bpy.types.Context, layout: bpy.types.UILayout, step: str = "") -> None:
    """In a step's panel: where its work is and how to stop it, or why it came to nothing. Without a step of any."""
    for job in _running:
        if step in ("", job.work.step):
            box = layout.box()
            box.progress(factor=job.share, text=job.percent)
            paragraph(context, box, f"{job.line}  Esc stops it.", "TIME")
            box.operator("rockfall.stop_job", text="Stop", icon="CANCEL")
    for other, words in _ended:
        if step in ("", other):
            paragraph(context, layout, words, "ERROR")


def _stopped(job: Job) -> str:
    return f"{job.label} was stopped. {job.work.unchanged}"


def _busy() -> str:
    return f"{_running[0].label} is still at work: wait for its end, or stop it with Esc."


def _keep(job: Job) -> None:
    try:
        words, is_problem = job.work.keep(job.scene, job.found), False
    except RockfallError as error:
        words, is_problem = str(error), True
    except Exception as error:  # noqa: BLE001 - a timer that fails is called no more
        problems.failed(job.label, error)
        words, is_problem = f"Something went wrong in Rockfall ({job.label}): {type(error).__name__}: {error}", True
    if not is_problem and job.work.changes:
        _in_window(lambda window: bpy.ops.ed.undo_push(message=job.label))
    _end(job, words, is_problem=is_problem)


def _end(job: Job, words: str, *, is_problem: bool = False) -> None:
    _running.remove(job)
    if is_problem:
        _ended.append((job.work.step, words))
        print(f"Rockfall: {words}")
    _in_window(lambda window: _say(window, words))
    bpy.app.timers.register(_clear_status, first_interval=LINGER_S, persistent=True)


def _say(window: bpy.types.Window, words: str) -> None:
    window.workspace.status_text_set(words)
    redraw(bpy.context)


def _show_progress(window: bpy.types.Window) -> None:
    window.workspace.status_text_set(_draw_status)
    for each in window.id_data.windows:
        for area in each.screen.areas:
            for region in area.regions:
                if region.type == "UI":
                    region.tag_redraw()


def _draw_status(header: bpy.types.Header, context: bpy.types.Context) -> None:
    for job in _running:
        bar = header.layout.row()
        bar.ui_units_x = 8
        bar.progress(factor=job.share, text=job.percent)
        header.layout.operator("rockfall.stop_job", text="", icon="CANCEL", emboss=False)
        header.layout.label(text=f"{job.line}  Esc stops it.")


def _clear_status() -> None:
    if not _running:
        _in_window(lambda window: window.workspace.status_text_set(None))


def _in_window(action: Callable[[bpy.types.Window], object]) -> None:
    """Do something in a window, if there is one: in a timer Blender has none in its context, and would crash."""
    manager = bpy.context.window_manager
    if bpy.app.background or manager is None or not manager.windows:
        return
    with bpy.context.temp_override(window=manager.windows[0]):
        action(manager.windows[0])


def register() -> None:
    """Esc, where there is a window."""
    config = bpy.context.window_manager.keyconfigs.addon if bpy.context.window_manager else None
    if config is not None:
        keymap = config.keymaps.new(name="Window")
        _keys.append((keymap, keymap.keymap_items.new("rockfall.stop_job", "ESC", "PRESS", head=True)))


def unregister() -> None:
    """Stop the work, and take the key back."""
    for job in _running:
        job.stop()
    _running.clear()
    for timer in (tick, _clear_status):
        if bpy.app.timers.is_registered(timer):
            bpy.app.timers.unregister(timer)
    _clear_status()
    while _keys:
        keymap, item = _keys.pop()
        keymap.keymap_items.remove(item)


CLASSES = (ROCKFALL_OT_stop_job,)
