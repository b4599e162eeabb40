# SPDX-License-Identifier: GPL-3.0-or-later
"""Long work beside a live page: in a thread, with progress, and it can be cancelled."""

import time
from collections.abc import Callable
from html import escape
from threading import Event, Thread
from typing import Any

from ..errors import RockfallError
from ..progress import CancelledError, Progress

BETWEEN_S = 0.5
"""Between two reports about the same work."""


class Job:
    """One piece of work at a time; what it reports is handed to the page between its own events."""

    def __init__(self, document: Any, say: Callable[[str], None]) -> None:
        self._document, self._say = document, say
        self._stop, self._closed = Event(), Event()
        self._thread: Thread | None = None
        self._said, self._said_at = "", 0.0

    @property
    def is_running(self) -> bool:
        """Whether work is going on."""
        return self._thread is not None

    def begin[T](self, work: Callable[[Progress], T], done: Callable[[T | None], None]) -> None:
        """Start ``work(progress)``; `done` gets its result, or None when it was cancelled or refused."""
        self._stop.clear()

        def run() -> None:
            result, text = None, ""
            try:
                result = work(self._progress)
            except CancelledError:
                text = "Cancelled; nothing was kept."
            except RockfallError as error:
                text = escape(str(error))
            except Exception as error:  # noqa: BLE001 the page would wait for ever for work that has ended
                text = escape(f"Something is wrong in Rockfall itself ({type(error).__name__}: {error}).")
            self._later(lambda: self._end(done, result, text))

        self._thread = Thread(target=run, daemon=True)
        self._thread.start()

    def cancel(self) -> None:
        """Ask the work to stop."""
        self._stop.set()

    def close(self) -> None:
        """The page is gone: ask the work to stop, and say nothing any more."""
        self._closed.set()
        self._stop.set()

    def _progress(self, text: str, done: int, total: int) -> None:
        if self._stop.is_set():
            raise CancelledError
        now = time.monotonic()
        if text != self._said or now - self._said_at >= BETWEEN_S:
            self._said, self._said_at = text, now
            line = f"{text}: {done} of {total}" if total > 1 else f"{text} …"
            self._later(lambda: self._say(escape(line)))

    def _end[T](self, done: Callable[[T | None], None], result: T | None, text: str) -> None:
        self._thread, self._said = None, ""
        self._say(text)
        done(result)

    def _later(self, what: Callable[[], None]) -> None:
        if self._closed.is_set():
            return
        try:
            self._document.add_next_tick_callback(what)
        except (AttributeError, RuntimeError):  # its document is taken apart, or the server is about to end
            self.close()
