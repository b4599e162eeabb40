# SPDX-License-Identifier: GPL-3.0-or-later
"""What was seen of the blocks in a video, and with which camera and clock."""

from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np

from ..camera.model import SIGMA_PX
from ..vectors import Array, Indices, Mask, Names
from .refinement.views import View


@dataclass(frozen=True, eq=False)
class Sightings:
    """The centres of blocks in pictures of one video, tracked or clicked, m times; times ascend within a trajectory.

    Attributes
    ----------
    trajectory : (m,) empty where not given.
    frame : (m,) −1 where not given.
    time_s : (m,) video time [s].
    pixel : (m, 2) [px].
    sigma_px : (m,) standard deviation of a coordinate; NaN where not given.
    """

    trajectory: Names
    frame: Indices
    time_s: Array
    pixel: Array
    sigma_px: Array

    def __len__(self) -> int:
        return len(self.pixel)

    @property
    def known_sigma_px(self) -> Array:
        """(m,) standard deviation of a coordinate, the usual one where it is not given."""
        return np.where(np.isnan(self.sigma_px), SIGMA_PX, self.sigma_px)


@dataclass(frozen=True, eq=False)
class Events:
    """What happened to blocks as seen in one video: n impacts and other events.

    Attributes
    ----------
    trajectory : (n,) empty where not given.
    frame : (n,) −1 where not given.
    time_s : (n,) video time [s].
    pixel : (n, 2) of the block's centre [px].
    sigma_time_s : (n,) NaN where not given.
    kind : (n,) as of picks.
    """

    trajectory: Names
    frame: Indices
    time_s: Array
    pixel: Array
    sigma_time_s: Array
    kind: Names

    def __len__(self) -> int:
        return len(self.pixel)


NO_SIGHTINGS = Sightings(np.empty(0, np.str_), np.empty(0, np.intp), np.empty(0), np.empty((0, 2)), np.empty(0))
NO_EVENTS = Events(
    np.empty(0, np.str_), np.empty(0, np.intp), np.empty(0), np.empty((0, 2)), np.empty(0), np.empty(0, np.str_)
)


@dataclass(frozen=True, eq=False)
class SeenVideo:
    """One video: its view, where blocks were seen in it, and what happened to them if that was marked."""

    view: View
    sightings: Sightings = NO_SIGHTINGS
    events: Events = NO_EVENTS

    @property
    def usual_step_s(self) -> float:
        """Usual time between two pictures with sightings [s]; NaN where there are not two."""
        times = np.unique(self.sightings.time_s)
        return float(np.median(np.diff(times))) if times.size > 1 else np.nan


def some[T: Sightings | Events](kind: type[T], table: T, rows: Indices | Mask) -> T:
    """Some rows of sightings or events; further columns that a table may have are left out."""
    return kind(*(getattr(table, column.name)[rows] for column in fields(kind)))


def joined[T: Sightings | Events](kind: type[T], tables: Sequence[T]) -> T:
    """The rows of several tables, one after the other."""
    return kind(*(np.concatenate([getattr(table, column.name) for table in tables]) for column in fields(kind)))
