# SPDX-License-Identifier: GPL-3.0-or-later
"""Texts in the cells of comma-separated files that spreadsheets open.

A spreadsheet computes a cell that begins with one of = + - @ and is no number, whoever wrote it (CSV injection, OWASP).
An apostrophe before it makes it a text there. Reading takes that apostrophe away, so that every name comes back as it
was: what begins with apostrophes and such a sign gets, and loses, one more.
"""

import csv
import re
from collections.abc import Iterable
from typing import IO, Any

GUARD = "'"
FORMULA = re.compile(r"'*[=+\-@\t\r\uff1d\uff0b\uff0d\uff20]")
NUMBER = re.compile(r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?|[-+]?(?:inf|nan)", re.IGNORECASE)


def guarded(text: str) -> str:
    """A text as it is written."""
    return GUARD + text if FORMULA.match(text) and not NUMBER.fullmatch(text) else text


def unguarded(text: str) -> str:
    """A text as it was before it was written."""
    return text[1:] if text.startswith(GUARD) and FORMULA.match(text) else text


class CellWriter:
    """A writer of rows whose texts are guarded."""

    def __init__(self, stream: IO[Any]) -> None:
        self.writer = csv.writer(stream, lineterminator="\n")

    def writerow(self, row: Iterable[object]) -> None:
        """Write one row."""
        self.writer.writerow([guarded(cell) if isinstance(cell, str) else cell for cell in row])

    def writerows(self, rows: Iterable[Iterable[object]]) -> None:
        """Write several rows."""
        for row in rows:
            self.writerow(row)
