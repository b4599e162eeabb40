# SPDX-License-Identifier: GPL-3.0-or-later
"""Ctrl+C, or SIGTERM, asks work to end, so that it keeps what is finished; a second one ends it."""

import signal
from collections.abc import Callable
from threading import Thread

import pytest
from rockfall.core.commands.progress import stopped_by_interrupt
from rockfall.core.progress import CancelledError


def interrupt() -> None:
    signal.raise_signal(signal.SIGINT)


def interrupted_work(then: Callable[[], None]) -> None:
    with stopped_by_interrupt(lambda *what: None) as progress:
        interrupt()
        then()
        progress("Simulating", 0, 4)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_the_first_interrupt_is_told_where_the_work_asks(number: signal.Signals) -> None:
    before, told = signal.getsignal(number), []
    with stopped_by_interrupt(lambda *what: told.append(what)) as progress:
        progress("Simulating", 1, 4)
        signal.raise_signal(number)
        kept = False
        try:
            progress("Simulating", 2, 4)
        except CancelledError:
            kept = True
    assert kept
    assert told == [("Simulating", 1, 4)]
    assert signal.getsignal(number) == before


def test_the_second_interrupt_ends_at_once() -> None:
    before = signal.getsignal(signal.SIGINT)
    with pytest.raises(KeyboardInterrupt):
        interrupted_work(interrupt)
    assert signal.getsignal(signal.SIGINT) == before


def test_work_that_kept_nothing_is_interrupted() -> None:
    with pytest.raises(KeyboardInterrupt):
        interrupted_work(lambda: None)


def test_beside_the_main_thread_nothing_is_changed() -> None:
    before, found = signal.getsignal(signal.SIGINT), []

    def work() -> None:
        with stopped_by_interrupt(lambda *what: found.append(what)) as progress:
            progress("Simulating", 1, 2)

    thread = Thread(target=work)
    thread.start()
    thread.join()
    assert found == [("Simulating", 1, 2)]
    assert signal.getsignal(signal.SIGINT) == before
