# SPDX-License-Identifier: GPL-3.0-or-later
"""How long work says where it is, and how it is stopped.

A function that may take more than a second has a parameter ``progress: Progress = silent`` and calls it often. Whoever
wants the work to end raises `CancelledError` in it: nothing is half-done, and no function needs a second parameter.
"""

from collections.abc import Callable

type Progress = Callable[[str, int, int], None]
"""``progress(text, done, total)``: what is being done, and how much of it; ``total`` 0 where that is not known."""


class CancelledError(Exception):
    """A person has asked for the work to end. No `RockfallError`: nothing is wrong."""


def silent(text: str, done: int = 0, total: int = 0) -> None:
    """Progress that nobody listens to."""


def part(progress: Progress, done: int, total: int) -> Progress:
    """The steps of one part of the work, as progress through all `total` parts of which `done` are done."""

    def of_all(text: str, _step: int = 0, _most: int = 0) -> None:
        progress(text, done, total)

    return of_all
