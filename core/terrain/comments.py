# SPDX-License-Identifier: GPL-3.0-or-later
"""Offsets, scales and units that programs write into comments, where a format has no place for them."""

import re
from collections.abc import Iterable

NUMBERS_CHANGED = re.compile(
    r"\b(?:global[ _]?)?(?:offset|shift|origin|translation|scale|scaling)\w*\b.*\d", re.IGNORECASE
)
UNIT = re.compile(r"\bunits?\s*[:=]?\s*[A-Za-z]{1,12}\b", re.IGNORECASE)
MOST = 3


def comment_sentences(comments: Iterable[str]) -> tuple[str, ...]:
    """What to say of comments that seem to change what the numbers mean: they are not applied."""
    found = [line.strip() for line in comments if NUMBERS_CHANGED.search(line) or UNIT.search(line)]
    shown = ", ".join(f'"{line[:60]}"' for line in found[:MOST]) + (" …" if len(found) > MOST else "")
    return (f"Comments in the file are not applied: {shown}. Check shift, scale and unit.",) if found else ()
