# SPDX-License-Identifier: GPL-3.0-or-later
"""A terrain whose file has y up is turned; what was made with it in the same program has to be turned too."""

from dataclasses import replace

import numpy as np

from ..camera.model import Camera, project
from ..camera.pairs import Pairs
from ..camera.path import CameraPath
from ..georeference import Z_UP, GlobalShift, z_up
from ..reconstruction.picks import Picks
from ..terrain.coordinate_step import coarse_places_sentence
from ..terrain.raycast import closest_points
from ..terrain.surface import Surface
from ..vectors import Array

MUCH_NEARER = 4.0
"""Places belong to the terrain in the way in which they are so many times nearer to it."""
LOOKED_AT = 2000
"""So many points of the terrain tell whether a camera sees it."""


def turned_picks(picks: Picks, surface: Surface | None) -> tuple[Picks, tuple[str, ...]]:
    """Picks as they lie on the terrain: turned from Y up to Z up as it was, if only so they do; with what to say, also
    of places that are stored coarsely.
    """
    coarse = _coarse(picks.shift, picks.position)
    if surface is None or not _only_turned(surface, picks.shift, picks.position):
        return picks, coarse
    turned = replace(
        picks,
        position=_turned(picks.position, picks.shift, surface.shift),
        normal=z_up(picks.normal),
        angular_velocity=z_up(picks.angular_velocity),
        shift=surface.shift,
    )
    return turned, ("The picks were turned from Y up to Z up with the terrain: only so they lie on it.", *coarse)


def turned_pairs(pairs: Pairs, surface: Surface | None) -> tuple[Pairs, tuple[str, ...]]:
    """The same of the pairs of a camera."""
    coarse = _coarse(pairs.shift, pairs.point)
    if surface is None or not _only_turned(surface, pairs.shift, pairs.point):
        return pairs, coarse
    turned = replace(pairs, point=_turned(pairs.point, pairs.shift, surface.shift), shift=surface.shift)
    return turned, ("The pairs were turned from Y up to Z up with the terrain: only so they lie on it.", *coarse)


def _coarse(shift: GlobalShift, places: Array) -> tuple[str, ...]:
    return tuple(filter(None, [coarse_places_sentence(shift.to_survey(places))]))


def turned_camera(camera: Camera) -> Camera:
    """A camera whose place and rotation have y up."""
    position = _turned(camera.position, camera.shift, camera.shift)
    return replace(camera, position=position, rotation=camera.rotation @ Z_UP.T)


def turned_path(path: CameraPath, surface: Surface | None) -> tuple[CameraPath, tuple[str, ...]]:
    """The same of a camera, which is turned if only so the terrain is in its picture."""
    if surface is None or not surface.turned or _sees(path.reference, surface):
        return path, ()
    shift = path.reference.shift
    turned = replace(
        path,
        reference=turned_camera(path.reference),
        position=_turned(path.position, shift, shift),
        rotation=path.rotation @ Z_UP.T,
    )
    if not _sees(turned.reference, surface):
        return path, ()
    return turned, ("The camera was turned from Y up to Z up with the terrain: only so it sees it.",)


def _sees(camera: Camera, surface: Surface) -> bool:
    some = surface.vertices[:: 1 + len(surface.vertices) // LOOKED_AT]
    pixel = project(camera, camera.shift.to_local(surface.shift.to_survey(some)))
    return bool(((pixel >= 0) & (pixel < (camera.width, camera.height))).all(axis=1).any())


def _only_turned(surface: Surface, shift: GlobalShift, places: Array) -> bool:
    if not surface.turned or not len(places):
        return False
    as_read = surface.shift.to_local(shift.to_survey(places))
    way, turned = (
        float(np.median(closest_points(surface, each).distance))
        for each in (as_read, _turned(places, shift, surface.shift))
    )
    return MUCH_NEARER * turned < way


def _turned(places: Array, shift: GlobalShift, new: GlobalShift) -> Array:
    return new.to_local(z_up(shift.to_survey(places)))
