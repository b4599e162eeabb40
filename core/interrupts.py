# SPDX-License-Identifier: GPL-3.0-or-later
"""Signals that ask the process to end: all are a KeyboardInterrupt, like Ctrl+C, so that everything is cleared away."""

import signal
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from threading import Timer, current_thread, main_thread
from types import FrameType
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from sys import UnraisableHookArgs

NAMES = ("SIGINT", "SIGTERM", "SIGHUP", "SIGBREAK")
"""Ctrl+C, a polite end, a closed terminal, Ctrl+Break; each system has some of them."""
ENDING = tuple(signal.Signals[name] for name in NAMES if name in signal.Signals.__members__)
AGAIN_S = 0.05


class Interrupt(KeyboardInterrupt):
    """The process is asked to end by a signal.

    Parameters
    ----------
    number : of the signal.
    said : what is true nevertheless.
    """

    def __init__(self, number: int = signal.SIGINT, said: str = "") -> None:
        super().__init__(*([said] if said else []))
        self.number = number


def interrupt(number: int, frame: FrameType | None = None) -> None:
    """Handle a signal as an `Interrupt`."""
    raise Interrupt(number)


@contextmanager
def handled(handler: Callable[[int, FrameType | None], None]) -> Iterator[None]:
    """Meanwhile `handler` has the signals that ask the process to end, but for those that are ignored.

    Beside the main thread, which alone can do that, nothing changes.
    """
    if current_thread() is not main_thread():
        yield
        return
    before = {number: signal.getsignal(number) for number in ENDING}
    ours = {number: old for number, old in before.items() if old not in (None, signal.SIG_IGN)}
    try:
        for number in ours:
            signal.signal(number, handler)
        yield
    finally:
        for number, old in ours.items():
            signal.signal(number, old)


@contextmanager
def uninterrupted(said: str = "") -> Iterator[None]:
    """The block is not interrupted; a signal that comes meanwhile is an `Interrupt` after it, with the message."""
    came: list[int] = []
    with handled(lambda number, frame: came.append(number)):
        yield
    if came:
        raise Interrupt(came[0], said)


@contextmanager
def never_lost() -> Iterator[None]:
    """An `Interrupt` raised where Python drops exceptions comes again a moment later.

    Python drops them in destructors, in what is called when garbage is collected, and in callbacks of compiled code, as
    of the compiler that numba uses; a signal may come at any time, there too.
    """
    before = sys.unraisablehook

    def again(dropped: "UnraisableHookArgs") -> None:
        if not isinstance(dropped.exc_value, Interrupt):
            before(dropped)
            return
        timer = Timer(AGAIN_S, signal.raise_signal, (dropped.exc_value.number,))
        timer.daemon = True
        timer.start()

    sys.unraisablehook = again
    try:
        yield
    finally:
        sys.unraisablehook = before
