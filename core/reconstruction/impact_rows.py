# SPDX-License-Identifier: GPL-3.0-or-later
"""From the motion to the rows of impacts.csv."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..vectors import Array, Indices, Mask, Names, dot
from .block import per_pick
from .impact import TAKE_OFF, DeviationForm, Impacts, apparent, make_impacts
from .intervals import ImpactErrors, impact_intervals, impact_sigmas
from .motion import Motion
from .picks import Picks
from .uncertainty import pick_covariance


def find_impacts(motion: Motion, *, site: str, eq10: DeviationForm) -> Impacts:
    """One row per `impact` pick, with the flags; see `reconstruct`."""
    picks, flights, clearance = motion.picks, motion.flights, motion.clearance
    own = np.flatnonzero(picks.kind == "impact")

    def here(column: NDArray[Any]) -> NDArray[Any]:
        return column if own.size == len(picks) else column.take(own, axis=0)

    diameter = per_pick(picks, motion.block, lambda block: block.diameter_m)
    mass = per_pick(picks, motion.block, lambda block: block.mass_kg)
    inertia = per_pick(picks, motion.block, lambda block: block.inertia_kgm2)

    leaving = here(picks.leaves_at)
    incident, restituted = here(motion.incident), motion.restituted.take(leaving)
    rolls_in, rolls_out = _value(flights.is_contact, incident, False), _value(flights.is_contact, restituted, False)
    incident, restituted = np.where(rolls_in, -1, incident), np.where(rolls_out, -1, restituted)
    v1 = _rows(flights.end_velocity, incident)
    v2 = _rows(flights.start_velocity, restituted)

    ground = motion.normals.take(own)
    normal = ground.normal
    values = apparent(v1, v2, normal, eq10)
    deep = clearance.below_terrain_m > diameter[flights.first_pick] / 2
    status = here(picks.status)
    flags = {
        "first": incident < 0,
        "last": restituted < 0,
        "below_terrain": _value(deep, incident, False) | _value(deep, restituted, False),
        "gap": motion.segments.cut_before[own] | motion.segments.cut_after[leaving],
        "contact": rolls_in | rolls_out,
        **{name: status == name for name in ("doubtful", "shattered", "discarded")},
    }

    mass = here(mass)
    sigma: dict[str, Array] = {}
    intervals: dict[str, Array] = {}
    if np.isfinite(picks.sigma_time_s).any() or np.isfinite(picks.sigma_position_m).any():
        covariance = pick_covariance(picks, flights, incident, restituted, own, leaving)
        errors = ImpactErrors(covariance, ground.by_place, ground.tilt)
        sigma = impact_sigmas(values, v1, v2, normal, mass, errors)
        intervals = impact_intervals(values, v1, v2, normal, errors)

    spin_energy = np.full(len(picks), np.nan)
    spinning = np.flatnonzero(np.isfinite(picks.angular_velocity[:, 0]))
    spin = picks.angular_velocity[spinning]
    spin_energy[spinning] = 0.5 * inertia[spinning] * dot(spin, spin)
    next_pick = _value(flights.last_pick, restituted, -1)
    return make_impacts(
        values,
        v1,
        v2,
        normal,
        site=site,
        trajectory=here(picks.trajectory),
        impact=_numbers(picks, own),
        time_s=here(picks.time_s),
        position=here(picks.position),
        normal_radius_m=ground.radius_m,
        normal_spread=ground.spread,
        diameter_m=here(diameter),
        mass_kg=mass,
        flags=flags,
        angular_velocity=here(picks.angular_velocity),
        rotational1_j=here(spin_energy),
        rotational2_j=_value(spin_energy, next_pick, np.nan),  # nothing turns a block in flight
        bounce_height_m=_value(clearance.above_terrain_m, restituted, np.nan),
        chord_height_m=_value(clearance.above_chord_m, restituted, np.nan),
        sigma=sigma,
        intervals=intervals,
        extra=_take_offs(picks, own, leaving),
        shift=picks.shift,
    )


def _take_offs(picks: Picks, own: Indices, leaving: Indices) -> dict[str, Names]:
    """The columns `TAKE_OFF` in survey coordinates, empty where the contact is a point; none where each is one."""
    elsewhere = leaving != own
    if not elsewhere.any():
        return {}
    columns = (*picks.shift.to_survey(picks.position[leaving]).T, picks.time_s[leaving])
    return {
        name: np.array([repr(value) if off else "" for value, off in zip(values.tolist(), elsewhere, strict=True)])
        for name, values in zip(TAKE_OFF, columns, strict=True)
    }


def _value[T: (Array, Indices, Mask)](values: T, which: Indices, otherwise: float) -> T:
    """values[which], and `otherwise` where the index is −1."""
    if not values.size:
        return np.full(which.size, otherwise, dtype=values.dtype)
    taken = values.take(which)
    taken[np.flatnonzero(which < 0)] = otherwise
    return taken


def _rows(vectors: Array, which: Indices) -> Array:
    """vectors[which] (n, 3), and NaN where the index is −1."""
    if not len(vectors):
        return np.full((which.size, 3), np.nan)
    rows = vectors.take(which, axis=0)
    rows[np.flatnonzero(which < 0)] = np.nan
    return rows


def _numbers(picks: Picks, own: Indices) -> Indices:
    """Number of each impact within its trajectory, from 1."""
    edges: Indices = np.searchsorted(own, np.append(picks.group_starts, len(picks)))
    return np.arange(own.size) - np.repeat(edges[:-1], np.diff(edges)) + 1
