# SPDX-License-Identifier: GPL-3.0-or-later
"""What files of lines and polygons have in common: features with coordinates as they are in the file."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

from ..vectors import Array

type Kind = Literal["line", "polygon"]

MOST_POINTS = 5_000_000
"""Of all features of a file; a map of a slope has thousands."""


@dataclass(frozen=True, eq=False)
class Feature:
    """A line, or a polygon with its holes; one of several parts is several.

    Attributes
    ----------
    kind : line or polygon; empty for what is neither.
    type : what the file calls it ("MultiPolygon").
    number : of the feature in the file, from 1.
    parts : a line's points (k, 3), or a polygon's rings, the coordinates as in the file; NaN for missing heights.
    properties : what else the file says of it.
    """

    kind: Kind | Literal[""]
    type: str
    number: int
    parts: tuple[Array, ...] = ()
    properties: Mapping[str, object] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class Features:
    """What is in a file of lines and polygons.

    Attributes
    ----------
    crs : the code that the file gives, "EPSG:2056", or empty.
    wkt : the well-known text of its system, or empty.
    """

    features: tuple[Feature, ...]
    crs: str = ""
    wkt: str = ""
