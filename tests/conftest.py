# SPDX-License-Identifier: GPL-3.0-or-later
"""No test waits for ever: one that takes too long ends the run, and what it was doing is printed."""

import faulthandler
import os
import signal
from collections.abc import Iterator

import pytest

try:
    from hypothesis import HealthCheck, settings
except ImportError:  # Blender's own Python
    pass
else:  # how quickly examples are made says nothing on a machine that does something else, too
    settings.register_profile("busy", deadline=None, suppress_health_check=[HealthCheck.too_slow])
    settings.load_profile("busy")

LIMIT_S = 480
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # before numpy: waiting threads cost more than small matrices
STDERR = pytest.StashKey[int]()


def pytest_configure(config: pytest.Config) -> None:
    for number in (signal.SIGINT, signal.SIGTERM):  # ignored where a shell began the tests behind itself
        if signal.getsignal(number) is signal.SIG_IGN:
            signal.signal(number, signal.default_int_handler)
    config.stash[STDERR] = os.dup(2)  # what a test prints is captured, and lost when the process ends


def pytest_unconfigure(config: pytest.Config) -> None:
    os.close(config.stash[STDERR])


@pytest.hookimpl(wrapper=True, tryfirst=True)
def limited(item: pytest.Item) -> Iterator[None]:
    """Unlike pytest's own limit, also for the fixtures of a test that has failed."""
    faulthandler.dump_traceback_later(LIMIT_S, exit=True, file=item.config.stash[STDERR])
    try:
        return (yield)
    finally:
        faulthandler.cancel_dump_traceback_later()


pytest_runtest_setup = pytest_runtest_call = pytest_runtest_teardown = limited
