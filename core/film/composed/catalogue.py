# SPDX-License-Identifier: GPL-3.0-or-later
"""What draws each kind of film."""

from collections.abc import Callable, Mapping

from .canvas import Canvas
from .kinds import FilmKind
from .material import Material
from .shots import ComposedFilm, Shot
from .templates.footage import overlay, side_by_side, vertical
from .templates.moving import fly_along, turntable
from .templates.stills import contact_sheet, stroboscopic
from .templates.story import story

STILL_S = 1.0
FILMS: Mapping[str, Callable[[Material], ComposedFilm]] = {
    "story": story,
    "overlay": overlay,
    "side_by_side": side_by_side,
    "fly_along": fly_along,
    "turntable": turntable,
    "vertical": vertical,
}
PICTURES: Mapping[str, Callable[[Material], Canvas]] = {"contact_sheet": contact_sheet, "stroboscopic": stroboscopic}


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
    if not kind.is_picture:
        return FILMS[kind.name](material)
    picture = PICTURES[kind.name](material)
    height, width = picture.picture.shape[:2]
    return ComposedFilm(width, height, 1 / STILL_S, [Shot(kind.name, STILL_S, lambda _: Canvas.copied(picture))])
