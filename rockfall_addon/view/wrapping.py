# SPDX-License-Identifier: GPL-3.0-or-later
"""Sentences in lines that fill a width, measured in the font in which they are drawn."""

from collections.abc import Callable

import blf

FONT = 0
"""The interface's."""


def wrapped(sentence: str, room: float, size: float) -> list[str]:
    """A sentence in lines that are no wider than `room` [px] in the interface's font of some size [px]."""
    blf.size(FONT, size)
    return broken(sentence, room, lambda words: float(blf.dimensions(FONT, words)[0]))


def broken(sentence: str, room: float, width_of: Callable[[str], float]) -> list[str]:
    """A sentence in lines as full as their words allow; a word that is wider than the room is broken, too."""
    lines: list[str] = []
    line = ""
    for word in sentence.split():
        longer = f"{line} {word}".lstrip()
        if width_of(longer) <= room:
            line = longer
            continue
        if line:
            lines.append(line)
        line = word
        while width_of(line) > room and len(line) > 1:
            fits = next((n for n in range(len(line) - 1, 1, -1) if width_of(line[:n]) <= room), 1)
            lines.append(line[:fits])
            line = line[fits:]
    return [*lines, line] if line else lines
