# SPDX-License-Identifier: GPL-3.0-or-later
"""Long work beside a live page: in a thread, with progress, and it can be cancelled."""

from collections.abc import Callable
from html import escape
from threading import Event, Thread
from typing import Any

from ..errors import RockfallError


class Job:
    """One piece of work at a time; what it reports is handed to the page between its own events."""

    def __init__(self, document: Any, say: Callable[[str], None]) -> None:
        self._document, self._say = document, say
        self._stop = Event()
        self._thread: Thread | None = None

    @property
    def is_running(self) -> bool:
        """Whether work is going on."""
        return self._thread is not None

    def begin[T](
        self, work: Callable[[Callable[[str], None], Callable[[], bool]], T], done: Callable[[T | None], None]
    ) -> None:
        """Start ``work(progress, cancelled)``; `done` gets its result, or None when it was cancelled or refused."""
        self._stop.clear()

        def run() -> None:
            try:
                result: T | None = work(
                    lambda what: self._later(lambda: self._say(f"{escape(what)} …")), self._stop.is_set
                )
                text = ""
            except RockfallError as error:
                result, text = None, escape(str(error))
            self._later(lambda: self._end(done, result, text))

        self._thread = Thread(target=run, daemon=True)
        self._thread.start()

    def cancel(self) -> None:
        """Ask the work to stop."""
        self._stop.set()

    def _end[T](self, done: Callable[[T | None], None], result: T | None, text: str) -> None:
        self._thread = None
        self._say(text)
        done(result)

    def _later(self, what: Callable[[], None]) -> None:
        self._document.add_next_tick_callback(what)
