# SPDX-License-Identifier: GPL-3.0-or-later
"""Progress on standard error, for work that takes more than a second."""

import sys
from threading import Timer
from types import TracebackType

QUIET_S = 1.0


class Progress:
    """Say what is going on, once the work has lasted a second.

    Used as ``with Progress() as progress: progress("reading the terrain")``.
    """

    def __init__(self) -> None:
        self._latest = ""
        self._loud = False
        self._timer = Timer(QUIET_S, self._wake)
        self._timer.daemon = True

    def __enter__(self) -> "Progress":
        self._timer.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._timer.cancel()

    def __call__(self, what: str) -> None:
        """Now doing `what`."""
        self._latest = what
        if self._loud:
            self._say(what)

    def _wake(self) -> None:
        self._loud = True
        if self._latest:
            self._say(self._latest)

    @staticmethod
    def _say(what: str) -> None:
        print(f"{what} …", file=sys.stderr, flush=True)
