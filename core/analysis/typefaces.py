# SPDX-License-Identifier: GPL-3.0-or-later
"""Which fonts figures and pages are lettered in: letter by letter, by what the installed fonts have.

A letter is taken from the first font of the style that has it. The last one, DejaVu Sans, comes with Matplotlib and has
all letters and symbols of our own words; Liberation Sans and Arial lack some, such as the small capital of R_N. Names
of users may be in any script: for those another installed font is looked for when the figure is drawn.
"""

import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from functools import lru_cache
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from matplotlib.font_manager import FontEntry

FAMILIES = ("sans-serif", "DejaVu Sans")
LAST_RESORT = "LastResort"
"""Part of the names of fonts that have a box for every letter there is."""


@contextmanager
def lettered(figure: "Figure") -> Iterator[None]:
    """Around what draws a figure: its texts get fonts for those of their letters that the style's fonts lack.

    A letter that no installed font has is a box, and Matplotlib's warnings of it are not passed on.
    """
    from matplotlib.text import Text

    for text in figure.findobj(Text):
        more = families_for(text.get_text())
        own = text.get_fontfamily()
        if not set(more) <= set(own):
            text.set_fontfamily([*own, *(family for family in more if family not in own)])
    with quiet():
        yield


@contextmanager
def quiet() -> Iterator[None]:
    """Matplotlib does not warn of letters that its fonts lack."""
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", r"Glyph \d+ .* missing from font", UserWarning)
        yield


def families_for(text: str) -> tuple[str, ...]:
    """Installed fonts with the letters of a text that `FAMILIES` lack, as far as there are any."""
    return () if text.isascii() else _families_with(frozenset(filter(str.isprintable, text)) - _letters())


@lru_cache(maxsize=256)
def _families_with(lacking: frozenset[str]) -> tuple[str, ...]:
    """As few as are needed: each has the most of the letters that are still lacking."""
    found: list[str] = []
    while lacking:
        family, has = max(
            ((family, lacking & _letters_of(file, place)) for family, file, place in _installed()),
            key=lambda one: len(one[1]),
            default=("", frozenset[str]()),
        )
        if not has:
            break
        found.append(family)
        lacking -= has
    return tuple(found)


@lru_cache(maxsize=1)
def _letters() -> frozenset[str]:
    """All that the fonts of `FAMILIES` have."""
    from matplotlib.font_manager import FontProperties, findfont, fontManager

    files = {str(findfont(FontProperties(family=[family]))) for family in FAMILIES}
    places = {(entry.fname, _place(entry)) for entry in fontManager.ttflist if entry.fname in files}
    return frozenset().union(*(_letters_of(file, place) for file, place in places))


@lru_cache(maxsize=1)
def _installed() -> tuple[tuple[str, str, int], ...]:
    """Family, file and place in the file of each upright font of usual weight, in the order of their names."""
    from matplotlib.font_manager import fontManager

    return tuple(sorted({
        (entry.name, entry.fname, _place(entry))
        for entry in fontManager.ttflist
        if entry.style == "normal" and str(entry.weight) in ("400", "normal", "book", "regular")
        and LAST_RESORT not in entry.name.replace(" ", "")
    }))  # fmt: skip


def _place(entry: "FontEntry") -> int:
    """In a file of several fonts, which Matplotlib knows from 3.11 on."""
    return int(getattr(entry, "index", 0))


@lru_cache(maxsize=1024)
def _letters_of(file: str, place: int) -> frozenset[str]:
    """The letters of a font; none of one that cannot be read."""
    from matplotlib.ft2font import FT2Font

    try:
        font = FT2Font(file, face_index=place) if place else FT2Font(file)
        return frozenset(map(chr, font.get_charmap()))
    except (RuntimeError, OSError):
        return frozenset()
