# SPDX-License-Identifier: GPL-3.0-or-later
"""What is drawn over a picture of the footage, as data: lines, dots and marks in pixels of the video."""

from dataclasses import dataclass, field

import numpy as np

from ...core.vectors import Array


@dataclass(frozen=True, eq=False)
class Path:
    """The path of one block's centre: n points in the order of time, those of a flight together.

    Attributes
    ----------
    time_s, position : (n,) common time, (n, 3) local [m].
    colour : (n, 3) sRGB: by speed, red below the terrain.
    joined : (n,) whether a point is joined with the next one.
    tick : (n,) points at the frames of the video.
    radius_m : of the block.
    edged : with a dark edge, so that a white path shows on bright ground.
    """

    time_s: Array
    position: Array
    colour: Array
    joined: np.ndarray
    tick: np.ndarray
    radius_m: float
    edged: bool = False


@dataclass(frozen=True, eq=False)
class Line:
    """Segments (k, 2, 2) in pixels of the video, with colours (k, 2, 4); width in pixels at interface scale 1."""

    segments: Array
    colour: Array
    width: float


@dataclass(frozen=True, eq=False)
class Mark:
    """Something of a fixed size on the screen, at a pixel: "dot", "ring" or "diamond"; its text beside it."""

    pixel: Array
    shape: str
    colour: tuple[float, float, float, float]
    size: float
    text: str = ""


@dataclass(eq=False)
class Drawing:
    """All that is drawn over a picture."""

    lines: list[Line] = field(default_factory=list)
    dots: list[tuple[Array, Array, float]] = field(default_factory=list)
    """(k, 2) pixels, (k, 4) colours, size."""
    marks: list[Mark] = field(default_factory=list)
