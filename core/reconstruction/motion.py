# SPDX-License-Identifier: GPL-3.0-or-later
"""The motion between the picks: chains, segments and their heights."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from ..vectors import Array, Indices
from .block import Block, per_pick
from .chains import Segments, find_segments
from .choices import FlightEnds
from .clearance import Clearance, clearances
from .drag import Drag
from .flight import Flights, solve_flights
from .picks import Picks
from .placement import GroundNormals, pick_normals

if TYPE_CHECKING:
    from ..terrain.surface import Surface

GROUNDED = ("release", "impact", "contact", "stop", "takeoff")


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
    normals : at the impacts, and at every pick on the ground when the flights join centres.
    incident, restituted : (n,) index of the segment that ends or starts at a pick, −1 without one.
    """

    picks: Picks
    block: Block | Mapping[str, Block]
    segments: Segments
    flights: Flights
    clearance: Clearance
    normals: GroundNormals
    incident: Indices
    restituted: Indices


def solve_motion(
    picks: Picks,
    block: Block | Mapping[str, Block],
    gravity_mps2: float,
    drag: Drag | None,
    surface: "Surface | None",
    normal_radius_m: float | None,
    ends: FlightEnds,
) -> Motion:
    """Join the picks, solve every segment, measure its heights.

    Raises
    ------
    RockfallError : no flight with this drag joins two picks; centres are asked for and a pick has no normal.
    """
    segments = find_segments(picks)
    centres = ends == "centres"
    radius = per_pick(picks, block, lambda one: one.radius_m)
    wanted = np.isin(picks.kind, GROUNDED if centres else ("impact",))
    normals = pick_normals(picks, surface, 2 * radius, normal_radius_m, wanted)
    drag_per_m = None if drag is None else per_pick(picks, block, drag.per_metre)
    flights = solve_flights(
        block_centres(picks, normals, radius) if centres else picks, segments, gravity_mps2, drag_per_m
    )
    incident, restituted = np.full(len(picks), -1), np.full(len(picks), -1)
    incident[flights.last_pick] = np.arange(len(flights))
    restituted[flights.first_pick] = np.arange(len(flights))
    heights = clearances(flights, surface, radius[segments.first_pick] if centres else None)
    return Motion(picks, block, segments, flights, heights, normals, incident, restituted)


def block_centres(picks: Picks, normals: GroundNormals, radius_m: Array) -> Picks:
    """The picks on the ground moved to the block's centre there; those in the air mark it already.

    Parameters
    ----------
    radius_m : (n,) of the block [m].

    Raises
    ------
    InputError : a pick on the ground has no normal.
    """
    grounded = np.isin(picks.kind, GROUNDED) & (np.isfinite(normals.normal[:, 0]) | (picks.kind != "release"))
    bare = np.flatnonzero(grounded & np.isnan(normals.normal[:, 0]) & (picks.status != "discarded"))
    if bare.size:
        raise picks.error(
            int(bare[0]),
            "The block's centre cannot be told: this pick has no terrain normal",
            "Give a terrain, or nx, ny, nz; or let the flights join the contact points",
        )
    return replace(
        picks, position=np.where(grounded[:, None], picks.position + radius_m[:, None] * normals.normal, picks.position)
    )
