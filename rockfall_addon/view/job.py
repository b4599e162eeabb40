# SPDX-License-Identifier: GPL-3.0-or-later
"""Long work in a thread beside Blender, one at a time: where it is, how it is stopped, and where its result goes.

A person goes on meanwhile: undoes, changes the scene, opens another file. So the work knows nothing of Blender, and its
result goes to the scene in which it began, or nowhere.
"""

import time
from collections.abc import Callable, Generator, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from threading import Event, Thread
from typing import NamedTuple

import bpy

from ...core.errors import RockfallError
from ...core.progress import CancelledError, Progress, silent
from ..scene import problems
from ..scene.footage import sync
from .panel import paragraph
from .reporting import redraw, reported

type Showing = Generator[tuple[str, int, int], None, str]
"""Keeping a result bit by bit: yields its progress, and returns the sentence."""

TICK_S = 0.15
SHOWING_S = 1.0
"""So long a result is shown before Blender looks at the keys; it redraws then, which takes its time too."""
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
        that cannot be done any more. Where it takes seconds, bit by bit, so that Esc can stop it.
    keeps_part : when it is stopped, `compute` gives what is finished, which is kept.
    changes : what is computed changes the scene: an undo step.
    unchanged : what is true when it was stopped.
    """

    step: str
    compute: Callable[[Progress], object]
    keep: Callable[[bpy.types.Scene, object], str | Showing]
    keeps_part: bool = False
    changes: bool = True
    unchanged: str = "Nothing has changed."


class _Ended(NamedTuple):
    step: str
    label: str
    problem: str


class Job:
    """Work on its way: `text`, `done` and `total` are its progress."""

    def __init__(self, work: Work, label: str, scene: bpy.types.Scene) -> None:
        self.work, self.label, self._scene = work, label, scene.session_uid
        self.text, self.done, self.total = label, 0, 0
        self.problem = ""
        self.found: object = None
        self.came_to_nothing = False
        self.showing: Showing | None = None
        self.at_rest = ExitStack()
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

    def show(self) -> str | None:
        """Go on showing the result for `SHOWING_S`; the sentence when it is all there."""
        until = time.perf_counter() + SHOWING_S
        while True:
            try:
                self.text, self.done, self.total = next(self.showing)
            except StopIteration as end:
                return str(end.value)
            if time.perf_counter() >= until:
                return None

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
        self.report({"INFO"}, kept(work.keep(context.scene, work.compute(silent))))
        return {"FINISHED"}


def kept(result: str | Showing) -> str:
    """The sentence of a result, which is kept without a pause."""
    while not isinstance(result, str):
        try:
            next(result)
        except StopIteration as end:
            result = str(end.value)
    return result


class ROCKFALL_OT_show_result(bpy.types.Operator):
    """Show what was computed bit by bit; Esc takes back what is shown so far"""

    bl_idname = "rockfall.show_result"
    bl_label = "Show Result"
    bl_options = {"INTERNAL"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return any(job.showing is not None for job in _running)

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        self._timer = context.window_manager.event_timer_add(0.01, window=context.window)
        context.window_manager.modal_handler_add(self)
        return {"RUNNING_MODAL"}

    def modal(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        job = next((job for job in _running if job.showing is not None), None)
        if job is not None and event.type == "TIMER":
            _go_on_showing(job)
        elif job is not None and event.type == "ESC" and event.value == "PRESS":
            _take_back(job)
        if job is not None and job.showing is not None:
            return {"RUNNING_MODAL"}  # nothing else may change the scene
        self.cancel(context)
        return {"FINISHED"}

    def cancel(self, context: bpy.types.Context) -> None:
        context.window_manager.event_timer_remove(self._timer)


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


class ROCKFALL_OT_dismiss_problem(bpy.types.Operator):
    """Take away the message about work that came to nothing"""

    bl_idname = "rockfall.dismiss_problem"
    bl_label = "Dismiss Message"
    bl_options = {"INTERNAL"}
    looks_only = True

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return bool(_ended)

    def execute(self, context: bpy.types.Context) -> set[str]:
        _ended.clear()
        redraw(context)
        return {"FINISHED"}


_running: list[Job] = []  # the one that a person waits for
_ended: list[_Ended] = []  # what came to nothing
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
        if job.showing is not None:
            _take_back(job)
            continue
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
    if job.showing is not None:
        return TICK_S
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
    for one in _ended:
        if step in ("", one.step):
            box = layout.box()
            top = box.row()
            top.label(text=one.label, icon="ERROR")
            top.operator("rockfall.dismiss_problem", text="", icon="X", emboss=False)
            paragraph(context, box, one.problem)


def _stopped(job: Job) -> str:
    return f"{job.label} was stopped. {job.work.unchanged}"


def _busy() -> str:
    return f"{_running[0].label} is still at work: wait for its end, or stop it with Esc."


def _keep(job: Job) -> None:
    def keep() -> str | None:
        found = job.work.keep(job.scene, job.found)
        if isinstance(found, str) or not bpy.context.window_manager.windows:
            return kept(found)
        job.showing = found
        job.at_rest.enter_context(sync.at_rest())
        _in_window(lambda window: bpy.ops.rockfall.show_result("INVOKE_DEFAULT"))
        return None

    _told(job, keep)


def _go_on_showing(job: Job) -> None:
    _told(job, job.show)
    if job.showing is not None:
        _in_window(_show_progress)


def _take_back(job: Job) -> None:
    """What was shown so far goes with Blender's own undo, which brings back all that was there."""
    if not bpy.context.preferences.edit.use_global_undo:
        return
    job.showing.close()
    job.showing = None

    def undo(window: bpy.types.Window) -> None:
        bpy.ops.ed.undo_push(message=job.label)
        bpy.ops.ed.undo()

    def later() -> None:  # not while the operator that showed it is still there
        _in_window(undo)
        job.at_rest.close()
        if job in _running:
            _end(job, _stopped(job))

    bpy.app.timers.register(later, first_interval=0.0, persistent=True)


def _told(job: Job, keep: Callable[[], str | None]) -> None:
    """Keep a result, or a bit of it; when all is there, or nothing more can be, the job is over and says so."""
    try:
        words, is_problem = keep(), False
    except RockfallError as error:
        words, is_problem = str(error), True
    except Exception as error:  # noqa: BLE001 - a timer that fails is called no more
        problems.failed(job.label, error)
        words, is_problem = f"Something went wrong in Rockfall ({job.label}): {type(error).__name__}: {error}", True
    if words is None:
        return
    job.showing = None
    job.at_rest.close()
    if not is_problem and job.work.changes:
        _in_window(lambda window: bpy.ops.ed.undo_push(message=job.label))
    _end(job, words, is_problem=is_problem)


def _end(job: Job, words: str, *, is_problem: bool = False) -> None:
    _running.remove(job)
    job.showing = None
    job.at_rest.close()
    if is_problem:
        _ended.append(_Ended(job.work.step, job.label, words))
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


CLASSES = (ROCKFALL_OT_show_result, ROCKFALL_OT_stop_job, ROCKFALL_OT_dismiss_problem)
