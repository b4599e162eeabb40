# SPDX-License-Identifier: GPL-3.0-or-later
"""Progress on standard error: nothing for quick work, one line on a terminal, few lines in a log."""

import io
import time

from rockfall.core.commands.progress import PrintedProgress, progress_line


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


def test_a_line() -> None:
    assert progress_line("Rendering", 120, 375, 25.2) == "Rendering: 32 %, 120 of 375, 0:54 left …"
    assert progress_line("Rendering", 0, 375, 0.0) == "Rendering …"
    assert progress_line("Reading", 0, 0, 3.0) == "Reading …"


def test_quick_work_is_quiet() -> None:
    log = io.StringIO()
    with PrintedProgress(log) as progress:
        progress("Reading")
    assert log.getvalue() == ""


def loud(stream: io.StringIO) -> str:
    with PrintedProgress(stream, quiet_s=0.0) as progress:
        progress("Reading")
        while not stream.getvalue():
            time.sleep(0.001)
        for done in range(1000):
            progress("Rendering", done + 1, 1000)
        progress("Writing")
    return stream.getvalue()


def test_a_log_has_a_line_for_each_piece_of_work() -> None:
    assert loud(io.StringIO()) == (
        "Reading …\nRendering: 0 %, 1 of 1000, 0:00 left …\nRendering: 100 %, 1000 of 1000, 0:00 left …\nWriting …\n"
    )


def test_a_terminal_has_one_line_written_over() -> None:
    said = loud(Terminal())
    assert said.startswith("\rReading …\x1b[K\n\rRendering: 0 %, 1 of 1000, 0:00 left …\x1b[K")
    assert said.endswith("\n\rWriting …\x1b[K\n")
    assert said.count("\n") == 3
