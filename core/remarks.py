# SPDX-License-Identifier: GPL-3.0-or-later
"""What a user should know about a result, as data: sentences that nobody has to take apart again."""

import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any, Literal

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


def to_plain(remarks: Iterable[Remark]) -> list[dict[str, str]]:
    """Remarks for JSON."""
    return [asdict(remark) for remark in remarks]


def from_plain(values: Iterable[Mapping[str, Any] | str], bare: Severity = "advice") -> tuple[Remark, ...]:
    """Remarks from JSON; version 0.1.0 kept sentences alone, which are as grave as `bare` says."""
    return tuple(Remark(value, bare) if isinstance(value, str) else Remark(**value) for value in values)


def to_text(remarks: Sequence[Remark]) -> str:
    """Remarks as one text to be stored; empty without any."""
    return json.dumps(to_plain(remarks), ensure_ascii=False) if remarks else ""


def from_text(text: str, bare: Severity = "advice") -> tuple[Remark, ...]:
    """Remarks from a stored text; version 0.1.0 kept one sentence in a line, which is as grave as `bare` says."""
    return from_plain(json.loads(text) if text.startswith("[") else filter(None, text.split("\n")), bare)


def gravest_first(remarks: list[Remark]) -> list[Remark]:
    """The same remarks, the gravest first, otherwise in their order."""
    return sorted(remarks, key=lambda remark: -SEVERITIES.index(remark.severity))
