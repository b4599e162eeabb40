# SPDX-License-Identifier: GPL-3.0-or-later
"""How far the tracked pixels lie from the motion that was computed."""

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from ..camera.path import project_at
from ..errors import InputError
from ..vectors import Array, Indices, Names
from .block import per_pick
from .chains import find_segments
from .flight import Flights, flight_states, solve_flights
from .motion import GROUNDED, block_centres
from .placement import pick_normals
from .refinement.views import PixelObservations, View
from .trajectory import Reconstruction

if TYPE_CHECKING:
    from ..terrain.surface import Surface

AT_END_S = 1e-9


def track_residuals(
    reconstruction: Reconstruction,
    surface: "Surface | None",
    views: Sequence[View],
    observations: PixelObservations,
) -> Array:
    """(m, 2) observed less computed pixels of blocks' centres [px].

    NaN where no motion is known: before, after, in gaps, between a landing and its take-off, of trajectories without
    flights, behind the camera.

    Parameters
    ----------
    surface : gives the normals of picks that have none.
    views : in any shift.

    Notes
    -----
    What is tracked is the block's centre. Where the flights join the marked contact points, those of the centre are
    computed for the comparison; without normals on the ground, those of the contact points have to do.
    """
    flights = _flights_of_centres(reconstruction, surface)
    landed = np.append(reconstruction.picks.kind[flights.last_pick] == "takeoff", False)  # of segment −1: not
    residual = np.full((len(observations), 2), np.nan)
    for number, view in enumerate(views):
        rows = np.flatnonzero(observations.view == number)
        video_s, pixel = observations.time_s[rows], observations.pixel[rows]
        common = view.exposed_at(video_s, pixel)
        which = segments_at(flights, observations.trajectory[rows], common)
        known = np.flatnonzero((which >= 0) & ~landed[which])
        position, _ = flight_states(flights, which[known], common[known])
        path = view.in_shift(reconstruction.picks.shift).path
        residual[rows[known]] = pixel[known] - project_at(path, position, video_s[known])
    return residual


def segments_at(flights: Flights, trajectory: Names, time_s: Array) -> Indices:
    """(m,) the segment of a trajectory (m,) at a time (m,), the later one at an impact; −1 where there is none."""
    which = np.full(time_s.size, -1)
    for name in np.unique(trajectory):
        own = np.flatnonzero(flights.trajectory == name)
        rows = np.flatnonzero(trajectory == name)
        if own.size:
            place = np.searchsorted(flights.start_time_s[own], time_s[rows] + AT_END_S, side="right") - 1
            found = own[np.maximum(place, 0)]
            inside = (place >= 0) & (time_s[rows] <= flights.end_time_s[found] + AT_END_S)
            which[rows[inside]] = found[inside]
    return which


def _flights_of_centres(reconstruction: Reconstruction, surface: "Surface | None") -> Flights:
    if reconstruction.ends == "centres":
        return reconstruction.flights
    picks, block, drag = reconstruction.picks, reconstruction.block, reconstruction.drag
    normal = picks.normal.copy()
    normal[picks.kind == "impact"] = reconstruction.impacts.normal
    radius = per_pick(picks, block, lambda one: one.radius_m)
    normals = pick_normals(replace(picks, normal=normal), surface, 2 * radius, None, np.isin(picks.kind, GROUNDED))
    try:
        centres = block_centres(picks, normals, radius)
    except InputError:  # a pick on the ground has no normal
        return reconstruction.flights
    drag_per_m = None if drag is None else per_pick(picks, block, drag.per_metre)
    return solve_flights(centres, find_segments(picks), reconstruction.gravity_mps2, drag_per_m)
