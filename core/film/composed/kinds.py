# SPDX-License-Identifier: GPL-3.0-or-later
"""The films and pictures that can be composed, by name."""

from collections.abc import Mapping
from dataclasses import dataclass
from difflib import get_close_matches

from ...errors import InputError

CODECS: Mapping[str, str] = {"h264": "H.264", "h265": "H.265", "av1": "AV1"}


@dataclass(frozen=True)
class FilmKind:
    """A film, or a picture, that can be asked for by name.

    Attributes
    ----------
    name, title : for commands and for people.
    description : what is seen.
    needs_footage, needs_terrain : without which it cannot be made.
    is_picture : one picture, no film.
    """

    name: str
    title: str
    description: str
    needs_footage: bool = True
    needs_terrain: bool = True
    is_picture: bool = False


KINDS = (
    FilmKind("story", "Story", "Footage, path, the same impact by models, whole simulated falls, all traces"),
    FilmKind("overlay", "Overlay", "The path of the block over the footage", needs_terrain=False),
    FilmKind("side_by_side", "Side by Side", "Footage and reconstruction, seen by the same camera"),
    FilmKind("fly_along", "Fly Along", "Behind the block, down the slope", needs_footage=False),
    FilmKind("turntable", "Turntable", "Once around the site", needs_footage=False),
    FilmKind("vertical", "Vertical", "9:16 for phones: the footage follows the block, the site below"),
    FilmKind(
        "contact_sheet", "Contact Sheet", "A picture: each impact as the video shows it, with its numbers",
        needs_terrain=False, is_picture=True,
    ),
    FilmKind("stroboscopic", "Stroboscopic Picture", "A picture: the block at successive times", is_picture=True),
)  # fmt: skip
NAMES = tuple(kind.name for kind in KINDS)


def find_kind(name: str) -> FilmKind:
    """A film by its name.

    Raises
    ------
    InputError : there is none; the message names the nearest one, and all.
    """
    for kind in KINDS:
        if kind.name == name:
            return kind
    near = get_close_matches(name.lower().replace("-", "_"), NAMES, n=1, cutoff=0.5)
    meant = f"Did you mean {near[0]}? " if near else ""
    raise InputError(f"There is no film {name!r}", advice=f"{meant}Films: {', '.join(NAMES)}")
