# SPDX-License-Identifier: GPL-3.0-or-later
"""The films and pictures that Rockfall composes, by name."""

from collections.abc import Callable
from dataclasses import dataclass
from difflib import get_close_matches

from ...errors import InputError
from .canvas import Canvas
from .material import Material
from .shots import ComposedFilm, Shot
from .templates.footage import overlay, side_by_side, vertical
from .templates.moving import fly_along, turntable
from .templates.stills import contact_sheet, stroboscopic
from .templates.story import story

STILL_S = 1.0


@dataclass(frozen=True)
class FilmKind:
    """A film, or a picture, that can be asked for by name.

    Attributes
    ----------
    name, title : for commands and for people.
    description : what is seen, one sentence.
    needs_footage, needs_terrain : without which it cannot be made.
    compose : makes the film; None for a picture.
    draw : makes the picture; None for a film.
    """

    name: str
    title: str
    description: str
    needs_footage: bool = True
    needs_terrain: bool = True
    compose: Callable[[Material], ComposedFilm] | None = None
    draw: Callable[[Material], Canvas] | None = None

    @property
    def is_picture(self) -> bool:
        """Whether it is one picture."""
        return self.draw is not None


FILMS = (
    FilmKind("story", "Story", "Footage, path, the same impact by models, whole falls, all traces",
             compose=story),
    FilmKind("overlay", "Overlay", "The path of the block over the footage", needs_terrain=False, compose=overlay),
    FilmKind("side_by_side", "Side by Side", "Footage and reconstruction, seen by the same camera",
             compose=side_by_side),
    FilmKind("fly_along", "Fly Along", "Behind the block, down the slope", needs_footage=False, compose=fly_along),
    FilmKind("turntable", "Turntable", "Once around the site", needs_footage=False, compose=turntable),
    FilmKind("vertical", "Vertical", "9:16 for phones: the footage follows the block, the site below",
             compose=vertical),
    FilmKind("contact_sheet", "Contact Sheet", "A picture: each impact as the video shows it, with its numbers",
             needs_terrain=False, draw=contact_sheet),
    FilmKind("stroboscopic", "Stroboscopic Picture", "A picture: the block at successive times", draw=stroboscopic),
)  # fmt: skip
NAMES = tuple(kind.name for kind in FILMS)


def find_film(name: str) -> FilmKind:
    """A film by its name.

    Raises
    ------
    InputError : there is none; the message names the nearest one, and all.
    """
    for kind in FILMS:
        if kind.name == name:
            return kind
    near = get_close_matches(name.lower().replace("-", "_"), NAMES, n=1, cutoff=0.5)
    meant = f"Did you mean {near[0]}? " if near else ""
    raise InputError(f"There is no film {name!r}", advice=f"{meant}Films: {', '.join(NAMES)}")


def compose(kind: FilmKind, material: Material) -> ComposedFilm:
    """The film of a kind; a picture as a film of one frame.

    Raises
    ------
    InputError : the project lacks footage or a terrain that it needs.
    """
    if kind.needs_footage:
        _ = material.filmed
    if kind.needs_terrain:
        _ = material.terrain
    if kind.compose is not None:
        return kind.compose(material)
    assert kind.draw is not None
    picture = kind.draw(material)
    height, width = picture.picture.shape[:2]
    return ComposedFilm(width, height, 1 / STILL_S, [Shot(kind.name, STILL_S, lambda _: Canvas.copied(picture))])
