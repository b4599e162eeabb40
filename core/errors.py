# SPDX-License-Identifier: GPL-3.0-or-later
"""Errors that a user can do something about.

The message says what is wrong, where (file, row, trajectory), and what to do. The command line prints it and
exits with status 1, the Blender operators report it and cancel.
"""

import re
from pathlib import Path

MOST_LETTERS = 390
"""A message is no longer, so that it is read."""
MOST_OF_PATH, MOST_OF_ADVICE, LEAST_OF_PROBLEM = 150, 220, 60
UNSEEN = re.compile("[\x00-\x1f\x7f-\x9f\u200b-\u200f\u2028-\u202e\u2060-\u2069\ud800-\udfff\ufeff]")
"""Characters that a terminal would obey instead of showing them."""


HIDDEN = re.compile("[\x00-\x08\x0b\x0c\x0e-\x1f\x7f-\x9f\u200b-\u200f\u2028-\u202e\u2060-\u2069\ud800-\udfff\ufeff]")
"""The same without tab and the ends of lines: what of a text nobody sees, or what turns its letters round (U+202E)."""


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
                readable(str(file), MOST_OF_PATH) if file is not None else "",
                f"row {row}" if row is not None else "",
                f"trajectory {readable(trajectory, LEAST_OF_PROBLEM)}" if trajectory is not None else "",
            )
            if text
        ]
        where = f"{', '.join(place)}: " if place else ""
        what_to_do = f" {_ended(readable(advice, MOST_OF_ADVICE))}" if advice else ""
        room = max(MOST_LETTERS - len(where) - len(what_to_do), LEAST_OF_PROBLEM)
        super().__init__(f"{where}{readable(problem, room)}.{what_to_do}")


def _ended(text: str) -> str:
    """A sentence with its full stop; a question has its own mark."""
    return text if text.endswith("?") else f"{text}."


class DependencyError(RockfallError):
    """A library or system component is missing; the message names the command that installs it."""


def visible(text: str) -> str:
    """A text to be shown, without characters that hide, or change the order of the others."""
    return HIDDEN.sub("", text) if HIDDEN.search(text) else text


def readable(text: str, most: int) -> str:
    """A text on one line, of so many letters at most: control characters are escaped, and its middle is left out."""
    text = UNSEEN.sub(lambda found: found[0].encode("unicode_escape").decode("ascii"), " ".join(text.split("\n")))
    if len(text) <= most:
        return text
    return f"{text[: (most - 1) // 2]}…{text[len(text) - most // 2 :]}"
