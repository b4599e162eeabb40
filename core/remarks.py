# SPDX-License-Identifier: GPL-3.0-or-later
"""What a user should know about a result, as data: sentences that nobody has to take apart again."""

from dataclasses import dataclass
from typing import Literal

type Severity = Literal["note", "advice", "warning", "problem"]
"""A fact; something to do; a result that may be wrong; no result."""

SEVERITIES: tuple[Severity, ...] = ("note", "advice", "warning", "problem")


@dataclass(frozen=True)
class Remark:
    """A sentence about a result.

    Attributes
    ----------
    text : one or more whole sentences.
    severity : how grave it is.
    about : what it is about, in one lower-case word or name ("focal", "pair T06", "block 3"), or empty.
    """

    text: str
    severity: Severity = "note"
    about: str = ""

    def __str__(self) -> str:
        return self.text


def gravest_first(remarks: list[Remark]) -> list[Remark]:
    """The same remarks, the gravest first, otherwise in their order."""
    return sorted(remarks, key=lambda remark: -SEVERITIES.index(remark.severity))
