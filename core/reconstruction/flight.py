# SPDX-License-Identifier: GPL-3.0-or-later
"""Flights: the motion between two picks, or fitted to more observations."""

from dataclasses import dataclass

import numpy as np

from ..vectors import Array, Indices, Mask, Names, norm
from .chains import Segments
from .drag import fit_with_drag
from .free_flight import fly, incident_velocity, parabola, restituted_velocity
from .observations import fit_parabolas, observe
from .picks import Picks


@dataclass(frozen=True, eq=False)
class Flights:
    """k motion segments; a pass belongs to its flight and does not end it.

    Attributes
    ----------
    trajectory : (k,) name.
    chain : (k,) number of the chain, through all trajectories, from 0.
    kind : (k,) "flight", or "contact" (rolling or sliding: straight, at the mean velocity of the segment).
    first_pick, last_pick : (k,) indices into the picks.
    start_time_s, end_time_s : (k,) [s].
    start_position, start_velocity, end_position, end_velocity : (k, 3) local [m], [m/s]. A flight through passes is the
        best fit to all its observations, so that its ends may lie a residual away from the picks.
    drag_per_m : (k,) ½ρC_D·A/m [1/m]; 0 without drag.
    residual_m : (k,) root mean square distance of the observations from the fit; NaN where two picks determine the
        flight exactly.
    gravity_mps2 : [m/s²].
    """

    trajectory: Names
    chain: Indices
    kind: Names
    first_pick: Indices
    last_pick: Indices
    start_time_s: Array
    end_time_s: Array
    start_position: Array
    start_velocity: Array
    end_position: Array
    end_velocity: Array
    drag_per_m: Array
    residual_m: Array
    gravity_mps2: float

    def __len__(self) -> int:
        return self.start_time_s.size

    @property
    def duration_s(self) -> Array:
        """(k,) [s]."""
        return self.end_time_s - self.start_time_s

    @property
    def is_contact(self) -> Mask:
        """(k,)."""
        return self.kind == "contact"


def solve_flights(picks: Picks, segments: Segments, gravity_mps2: float, drag_per_m: Array | None) -> Flights:
    """The motion in every segment.

    Parameters
    ----------
    drag_per_m : (n,) ½ρC_D·A/m of the block of each pick [1/m], or None without drag.

    Raises
    ------
    RockfallError : no flight with this drag joins the picks.

    Notes
    -----
    A flight with passes minimises the squared distances of *all* its observations, the two ends included, from the
    parabola (Noël et al. use two picks and no passes). Observations are weighted by 1/sigma_position_m² when every one
    of the flight has a positive one, and equally otherwise; times are taken as exact.
    """
    first, last = segments.first_pick, segments.last_pick
    start_time, end_time = picks.time_s[first], picks.time_s[last]
    start, end = picks.position.take(first, axis=0), picks.position.take(last, axis=0)
    duration = end_time - start_time
    start_velocity = restituted_velocity(end - start, duration, gravity_mps2)
    end_velocity = incident_velocity(start_velocity, duration, gravity_mps2)
    residual = np.full(first.size, np.nan)

    contact = segments.contact
    if contact.any():
        start_velocity[contact] = end_velocity[contact] = (end - start)[contact] / duration[contact, None]

    fitted = np.flatnonzero(last - first > 1)
    if fitted.size:
        obs = observe(picks, first[fitted], last[fitted])
        position, velocity = fit_parabolas(obs, gravity_mps2)
        start[fitted], start_velocity[fitted] = position, velocity
        end[fitted], end_velocity[fitted] = parabola(position, velocity, duration[fitted], gravity_mps2)

    drag = np.zeros(first.size)
    if drag_per_m is not None:
        drag = np.where(contact, 0.0, drag_per_m[first])
    flying = np.flatnonzero(drag > 0)
    if flying.size:
        obs = observe(picks, first[flying], last[flying])
        start[flying], start_velocity[flying] = fit_with_drag(
            obs,
            start[flying],
            start_velocity[flying],
            gravity_mps2,
            drag[flying],
            lambda i: _name(picks, first[flying[i]]),
        )
        end[flying], end_velocity[flying] = fly(
            start[flying], start_velocity[flying], duration[flying], gravity_mps2, drag[flying]
        )

    kind = np.full(first.size, "contact")
    kind[~contact] = "flight"
    flights = Flights(
        trajectory=picks.trajectory[first],
        chain=segments.chain[first],
        kind=kind,
        first_pick=first,
        last_pick=last,
        start_time_s=start_time,
        end_time_s=end_time,
        start_position=start,
        start_velocity=start_velocity,
        end_position=end,
        end_velocity=end_velocity,
        drag_per_m=drag,
        residual_m=residual,
        gravity_mps2=gravity_mps2,
    )
    if fitted.size:
        obs = observe(picks, first[fitted], last[fitted])
        modelled, _ = flight_states(flights, fitted[obs.flight], obs.time_s + start_time[fitted][obs.flight])
        squares = norm(obs.position - modelled) ** 2
        residual[fitted] = np.sqrt(np.bincount(obs.flight, squares) / np.bincount(obs.flight))
    return flights


def flight_states(flights: Flights, which: Indices, time_s: Array) -> tuple[Array, Array]:
    """Positions and velocities of segments at given times.

    Parameters
    ----------
    which : (q,) index of the segment.
    time_s : (q,) on the common clock [s]; may lie outside the segment, whose motion is then continued.

    Returns
    -------
    position : (q, 3) local [m].
    velocity : (q, 3) [m/s].

    Notes
    -----
    Exact: the closed form without drag, the equation of motion integrated to 1e-10 m with drag.
    """
    which = np.asarray(which, dtype=np.intp)
    elapsed = np.asarray(time_s, dtype=np.float64) - flights.start_time_s[which]
    gravity = np.where(flights.is_contact[which], 0.0, flights.gravity_mps2)
    return fly(
        flights.start_position[which], flights.start_velocity[which], elapsed, gravity, flights.drag_per_m[which]
    )


def _name(picks: Picks, pick: int) -> str:
    return f"trajectory {picks.trajectory[pick]}, the flight that starts at {picks.time_s[pick]:.3f} s"
