# SPDX-License-Identifier: GPL-3.0-or-later
"""Which part of the terrain is in which zone."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from ..remarks import Remark
from ..terrain.cloud import Cloud
from ..terrain.misplaced import unit_hint
from ..terrain.surface import Surface
from ..vectors import Array, Indices, Mask
from .coverage import check_areas
from .ground import element_places
from .polygons import Polygon

WHOLE = "terrain"
"""The zone that no other covers: the parameters of the whole."""


@dataclass(frozen=True, eq=False)
class Zones:
    """Parts of the terrain with parameters of their own.

    Attributes
    ----------
    names : the first is what no other zone covers.
    of_face : (m,) place in `names` of each of the terrain's faces, of a cloud's points.
    parameters : zone → model → parameters that differ there.
    friction : zone → μ that differs there.
    remarks : what a user should know of how they cover the terrain.
    """

    names: tuple[str, ...]
    of_face: NDArray[np.int32]
    parameters: Mapping[str, Mapping[str, Mapping[str, object]]] = field(default_factory=dict)
    friction: Mapping[str, float] = field(default_factory=dict)
    remarks: tuple[Remark, ...] = ()


@dataclass(frozen=True, eq=False)
class ZoneCover:
    """The zones of m elements of a terrain: its faces, or a cloud's points.

    Attributes
    ----------
    names : `WHOLE` first.
    of_element : (m,) place in `names`.
    remarks : what is covered twice or not at all.
    """

    names: tuple[str, ...]
    of_element: NDArray[np.int32]
    remarks: tuple[Remark, ...]


def zones_within(terrain: Surface | Cloud, polygons: Sequence[Polygon]) -> ZoneCover:
    """Zones of polygons in plan: a face is in the one that its middle is in.

    Parameters
    ----------
    polygons : those of one name are one zone. Where several overlap the face is in the first.

    Raises
    ------
    InputError : a polygon without a name, or with that of the whole; one that is wholly outside of the terrain.
    """
    _checked([polygon.name for polygon in polygons])
    outside = check_areas(terrain, polygons, "zone", "it ends there")
    middles = element_places(terrain)[:, :2]
    cover = zones_of_parts(
        terrain,
        [(polygon.name, polygon.contains(middles)) for polygon in polygons],
        unit_hint(np.concatenate([ring for polygon in polygons for ring in polygon.rings]), terrain)
        or "Check the coordinates of the polygons",
    )
    return replace(cover, remarks=(*outside, *cover.remarks))


def zones_of_parts(terrain: Surface | Cloud, parts: Sequence[tuple[str, Mask]], advice: str) -> ZoneCover:
    """Zones of elements (m,) that were chosen in some way; see `zones_within`.

    Parameters
    ----------
    advice : what to do when no element is in any of them.

    Raises
    ------
    InputError : a zone without a name, or with that of the whole; no element is in any.
    """
    names = _checked([name for name, _ in parts])
    count = len(element_places(terrain))
    zone, overlapping = np.zeros(count, np.int32), np.zeros(count, np.bool_)
    for name, inside in parts:
        number = names.index(name)
        overlapping |= inside & (zone > 0) & (zone != number)
        zone[inside & (zone == 0)] = number
    remarks = []
    if overlapping.any():
        text = f"{overlapping.sum()} of {_counted(terrain)} are in more than one zone: the first of them counts."
        remarks.append(Remark(text, "warning", "zones"))
    return _cover(terrain, names, zone, remarks, advice)


def zones_of_values(
    terrain: Surface | Cloud, values: Array, names: Sequence[str], numbers: Sequence[float]
) -> ZoneCover:
    """Zones of an attribute: an element is in the zone that has its value.

    Parameters
    ----------
    values : (m,) of the attribute at each element.
    names, numbers : of the zones, and the values that mean them.

    Raises
    ------
    InputError : a zone without a name, or with that of the whole; no element has any of the values.
    """
    every = _checked(names)
    zone = np.zeros(len(values), np.int32)
    for name, number in zip(names, numbers, strict=True):
        zone[values == number] = every.index(name)
    return _cover(terrain, every, zone, [], "Check the name of the attribute, and the values of the zones")


def face_values(terrain: Surface, vertex_values: Array) -> Array:
    """(m,) values of faces from those of vertices: what two or three of its corners have, else that of the first."""
    a, b, c = vertex_values[terrain.faces].T
    return np.where(b == c, b, a)


def nearest_values[T: np.generic](places: Array, given: Array, values: NDArray[T]) -> NDArray[T]:
    """(n,) values at places (n, 3): those of the nearest of the given (k, 3)."""
    from scipy.spatial import cKDTree

    _, row = cKDTree(given).query(places)
    at: Indices = np.asarray(row, dtype=np.intp)
    return values[at]


def _checked(names: Sequence[str]) -> list[str]:
    for name in names:
        if not name:
            raise InputError("A zone has no name", advice="Name each, since results speak of them by name")
        if name == WHOLE:
            raise InputError(f"A zone is called {WHOLE!r}, as the rest of the ground is", advice="Give it another name")
    return [WHOLE, *dict.fromkeys(names)]


def _counted(terrain: Surface | Cloud) -> str:
    return f"{len(terrain.points)} points" if isinstance(terrain, Cloud) else f"{len(terrain.faces)} faces"


def _cover(
    terrain: Surface | Cloud, names: list[str], zone: NDArray[np.int32], remarks: list[Remark], advice: str
) -> ZoneCover:
    counts = np.bincount(zone, minlength=len(names))
    if not counts[1:].any():
        raise InputError("No zone is anywhere on the terrain", advice=advice)
    for name, count in zip(names[1:], counts[1:].tolist(), strict=True):
        if not count:
            remarks.append(Remark(f"The zone {name} is nowhere on the terrain.", "warning", "zones"))
    if counts[0]:
        text = f"{counts[0]} of {_counted(terrain)} are in no zone: they have the parameters of the whole."
        remarks.append(Remark(text, "note", "zones"))
    return ZoneCover(tuple(names), zone, tuple(remarks))
