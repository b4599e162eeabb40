# SPDX-License-Identifier: GPL-3.0-or-later
"""The motion between the picks: chains, segments and their heights."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from .block import Block, per_pick
from .chains import Segments, find_segments
from .clearance import Clearance, clearances
from .drag import Drag
from .flight import Flights, solve_flights
from .picks import Indices, Picks

if TYPE_CHECKING:
    from ..terrain.surface import Surface


@dataclass(frozen=True, eq=False)
class Motion:
    """What moved where.

    Attributes
    ----------
    picks : n picks.
    block : of all trajectories, or by trajectory name.
    segments : how the picks are joined.
    flights : k motion segments.
    clearance : their heights.
    incident, restituted : (n,) index of the segment that ends or starts at a pick, −1 without one.
    """

    picks: Picks
    block: Block | Mapping[str, Block]
    segments: Segments
    flights: Flights
    clearance: Clearance
    incident: Indices
    restituted: Indices


def solve_motion(
    picks: Picks,
    block: Block | Mapping[str, Block],
    gravity_mps2: float,
    drag: Drag | None,
    surface: "Surface | None",
) -> Motion:
    """Join the picks, solve every segment, measure its heights.

    Raises
    ------
    RockfallError : no flight with this drag joins two picks.
    """
    segments = find_segments(picks)
    drag_per_m = None if drag is None else per_pick(picks, block, drag.per_metre)
    flights = solve_flights(picks, segments, gravity_mps2, drag_per_m)
    incident, restituted = np.full(len(picks), -1), np.full(len(picks), -1)
    incident[flights.last_pick] = np.arange(len(flights))
    restituted[flights.first_pick] = np.arange(len(flights))
    return Motion(picks, block, segments, flights, clearances(flights, surface), incident, restituted)
