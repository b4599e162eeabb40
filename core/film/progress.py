# SPDX-License-Identifier: GPL-3.0-or-later
"""How far a film is, in one line."""

import sys
import time
from typing import TextIO

QUIET_S = 5.0
"""Between two lines where a line cannot be written over (a log file)."""


def progress_line(done: int, total: int, elapsed_s: float) -> str:
    """ "frame 120/375, 0.21 s a frame, 0:54 left"."""
    each = elapsed_s / max(done, 1)
    left = round(each * (total - done))
    return f"frame {done}/{total}, {each:.2f} s a frame, {left // 60}:{left % 60:02d} left"


class Progress:
    """Reports frames as they are done: over one line on a terminal, now and then in a log."""

    def __init__(self, total: int, stream: TextIO | None = None) -> None:
        self._stream = sys.stderr if stream is None else stream
        self._total, self._done = total, 0
        self._start = self._said = time.monotonic()
        self._terminal = self._stream.isatty()

    def step(self) -> None:
        """One more frame is done."""
        self._done += 1
        now = time.monotonic()
        last = self._done == self._total
        line = progress_line(self._done, self._total, now - self._start)
        if self._terminal:
            self._stream.write(f"\r  {line}\x1b[K" + ("\n" if last else ""))
        elif last or now - self._said >= QUIET_S:
            self._stream.write(f"  {line}\n")
            self._said = now
        self._stream.flush()
