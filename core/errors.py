# SPDX-License-Identifier: GPL-3.0-or-later
"""Errors that a user can do something about.

The message says what is wrong, where (file, row, trajectory), and what to do. The command line prints it and
exits with status 1, the Blender operators report it and cancel.
"""

from pathlib import Path


class RockfallError(Exception):
    """Something that the user can put right."""


class InputError(RockfallError):
    """Bad input data.

    Parameters
    ----------
    problem : what is wrong, a sentence without a final full stop.
    file, row, trajectory : where. Rows count as a text editor shows them: the header is row 1.
    advice : what to do, a sentence without a final full stop.
    """

    def __init__(
        self,
        problem: str,
        *,
        file: str | Path | None = None,
        row: int | None = None,
        trajectory: str | None = None,
        advice: str | None = None,
    ) -> None:
        self.problem, self.file, self.row, self.trajectory, self.advice = problem, file, row, trajectory, advice
        place = [
            text
            for text in (
                str(file) if file is not None else "",
                f"row {row}" if row is not None else "",
                f"trajectory {trajectory}" if trajectory is not None else "",
            )
            if text
        ]
        message = f"{', '.join(place)}: {problem}" if place else problem
        super().__init__(f"{message}. {advice}." if advice else f"{message}.")


class DependencyError(RockfallError):
    """A library or system component is missing; the message names the command that installs it."""
