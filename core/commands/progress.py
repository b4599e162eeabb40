# SPDX-License-Identifier: GPL-3.0-or-later
"""Progress on standard error, for work that takes more than a second."""

import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from threading import Timer
from types import FrameType, TracebackType
from typing import TextIO

from ..interrupts import Interrupt, handled, interrupt
from ..progress import CancelledError, Progress

QUIET_S = 1.0
"""Before the first line."""
BETWEEN_S = 5.0
"""Between two lines about the same work where a line cannot be written over (a log file)."""
REDRAW_S = 0.1


def progress_line(text: str, done: int, total: int, elapsed_s: float) -> str:
    """ "Rendering: 32 %, 120 of 375, 0:54 left"."""
    if not total or not done:
        return f"{text} …"
    left = round(elapsed_s / done * (total - done))
    return f"{text}: {100 * done // total} %, {done} of {total}, {left // 60}:{left % 60:02d} left …"


class PrintedProgress:
    """Say what is going on, once the work has lasted a second: over one line on a terminal, now and then in a log.

    Used as ``with PrintedProgress() as progress: progress("Reading the terrain")``.
    """

    def __init__(self, stream: TextIO | None = None, quiet_s: float = QUIET_S) -> None:
        self._stream = sys.stderr if stream is None else stream
        self._terminal = self._stream.isatty()
        self._text = self._line = self._said = ""
        self._since = self._printed = 0.0
        self._is_loud = self._is_open = False
        self._timer = Timer(quiet_s, self._wake)
        self._timer.daemon = True

    def __enter__(self) -> "PrintedProgress":
        self._timer.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._timer.cancel()
        self._end_line()

    def __call__(self, text: str, done: int = 0, total: int = 0) -> None:
        """Now doing `text`."""
        now, is_new, is_last = time.monotonic(), text != self._text, 0 < total == done
        if is_new:
            self._text, self._since = text, now
            self._end_line()
        self._line = progress_line(text, done, total, now - self._since)
        is_due = is_new or is_last or now - self._printed >= (REDRAW_S if self._terminal else BETWEEN_S)
        if self._is_loud and is_due and self._line != self._said:
            self._print(now)

    def _wake(self) -> None:
        self._is_loud = True
        if self._line:
            self._print(time.monotonic())

    def _print(self, now: float) -> None:
        self._printed, self._is_open, self._said = now, self._terminal, self._line
        print(f"\r{self._line}\x1b[K" if self._terminal else self._line, end="" if self._terminal else "\n",
              file=self._stream, flush=True)  # fmt: skip

    def _end_line(self) -> None:
        if self._is_open:
            print(file=self._stream, flush=True)
        self._is_open = False


class Stoppable:
    """Progress in which the work ends when a signal has asked for it.

    Attributes
    ----------
    asked : the number of that signal; 0 before any.
    """

    def __init__(self, progress: Progress) -> None:
        self._progress, self.asked = progress, 0

    def ask(self, number: int, frame: FrameType | None = None) -> None:
        """Handle a signal: the first asks the work to end, a second one ends it."""
        if self.asked:
            interrupt(number)
        self.asked = number

    def __call__(self, text: str, done: int = 0, total: int = 0) -> None:
        """Now doing `text`."""
        if self.asked:
            raise CancelledError
        self._progress(text, done, total)


@contextmanager
def stopped_by_interrupt(progress: Progress, *, keeps: bool = False) -> Iterator[Stoppable]:
    """Progress in which Ctrl+C, or SIGTERM, asks the work to end, so that it can keep what is finished; a second one
    ends it.

    Parameters
    ----------
    keeps : whether what the work has kept is used: who asks for it looks at `Stoppable.asked`, and interrupts later.

    Raises
    ------
    Interrupt : the work was asked to end, whether or not it has done so.
    """
    stoppable = Stoppable(progress)
    with handled(stoppable.ask):
        try:
            yield stoppable
        except CancelledError as error:
            raise Interrupt(stoppable.asked) from error
    if stoppable.asked and not keeps:
        raise Interrupt(stoppable.asked)
