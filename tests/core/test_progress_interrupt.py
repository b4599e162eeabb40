# SPDX-License-Identifier: GPL-3.0-or-later
"""Ctrl+C, or SIGTERM, asks work to end, so that it keeps what is finished; a second one ends it."""

import ctypes
import signal
import sys
import time
from collections.abc import Callable
from threading import Thread

import pytest
from rockfall.core.cli import main
from rockfall.core.commands.progress import stopped_by_interrupt
from rockfall.core.interrupts import Interrupt
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
    with stopped_by_interrupt(lambda *what: told.append(what), keeps=True) as progress:
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


def test_a_signal_that_the_work_has_not_seen_ends_it_none_the_less() -> None:
    """It came after the last time that the work asked."""
    with pytest.raises(Interrupt) as ended, stopped_by_interrupt(lambda *what: None):
        signal.raise_signal(signal.SIGTERM)
    assert ended.value.number == signal.SIGTERM
    with stopped_by_interrupt(lambda *what: None, keeps=True) as kept:
        signal.raise_signal(signal.SIGTERM)
    assert kept.asked == signal.SIGTERM


def drop_in_a_destructor() -> None:
    class Dropped:
        def __del__(self) -> None:
            signal.raise_signal(signal.SIGTERM)

    Dropped()


def drop_in_a_callback() -> None:
    ctypes.CFUNCTYPE(None)(lambda: signal.raise_signal(signal.SIGTERM))()


@pytest.mark.parametrize("drop", [drop_in_a_destructor, drop_in_a_callback])
def test_a_signal_whose_error_python_drops_is_not_lost(monkeypatch, capfd, drop) -> None:
    def run(arguments: object) -> int:
        drop()
        time.sleep(20)
        return 0

    before = sys.unraisablehook
    monkeypatch.setattr("rockfall.core.commands.models.run", run)
    assert main(["models"]) == 128 + signal.SIGTERM
    assert capfd.readouterr().err == "rockfall: interrupted, nothing was written.\n"
    assert sys.unraisablehook == before


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
