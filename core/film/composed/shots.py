# SPDX-License-Identifier: GPL-3.0-or-later
"""A composed film: shots one after the other, each of which can draw any of its moments."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import floor

import numpy as np

from .canvas import Canvas

FADE_S = 0.4
"""Over which one shot goes into the next, through black, so that no text lies over another [s of film]."""


@dataclass(frozen=True, eq=False)
class Shot:
    """A stretch of film.

    Attributes
    ----------
    name : of its kind, for messages and tests.
    duration_s : [s of film], what fades included.
    draw : from the seconds since its beginning to its picture.
    """

    name: str
    duration_s: float
    draw: Callable[[float], Canvas]


@dataclass(frozen=True, eq=False)
class ComposedFilm:
    """Shots that fade into each other.

    Attributes
    ----------
    width, height : [px].
    fps : frames per second.
    shots : in their order.
    fade_s : shots overlap by it [s].
    """

    width: int
    height: int
    fps: float
    shots: Sequence[Shot]
    fade_s: float = FADE_S

    @property
    def begins_s(self) -> list[float]:
        """When each shot begins [s of film]."""
        begins, at = [], 0.0
        for shot in self.shots:
            begins.append(at)
            at += max(shot.duration_s - self.fade_s, 0.0)
        return begins

    @property
    def duration_s(self) -> float:
        """[s]."""
        return self.begins_s[-1] + self.shots[-1].duration_s

    @property
    def frames(self) -> int:
        """How many it has; frame k stands from k/fps on."""
        return max(floor(self.duration_s * self.fps + 1e-6), 1)

    def canvas(self, frame: int) -> Canvas:
        """A frame, drawn."""
        at, begins = frame / self.fps, self.begins_s
        current = max(i for i, begin in enumerate(begins) if begin <= at + 1e-9)
        since = at - begins[current]
        if current == 0 or since >= self.fade_s:
            return self.shots[current].draw(min(since, self.shots[current].duration_s))
        before = self.shots[current - 1]
        share = float(np.clip(since / self.fade_s, 0, 1))
        if share < 0.5:
            drawn = before.draw(min(at - begins[current - 1], before.duration_s))
        else:
            drawn = self.shots[current].draw(min(since, self.shots[current].duration_s))
        drawn.picture[...] = drawn.picture * abs(2 * share - 1) + 0.5
        return drawn
