# SPDX-License-Identifier: GPL-3.0-or-later
"""How high flights pass above the terrain and above their chords."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ..vectors import Array, dot, norm
from .flight import Flights, flight_states

if TYPE_CHECKING:
    from ..terrain.surface import Surface

SAMPLES = 48
"""Instants per flight at which heights are taken; a parabola's peak between two of them is missed by under 0.05 %."""


@dataclass(frozen=True, eq=False)
class Clearance:
    """Extreme heights of k segments.

    Attributes
    ----------
    above_terrain_m : (k,) greatest vertical height above the terrain [m]; NaN without terrain.
    below_terrain_m : (k,) greatest vertical depth under the terrain, 0 when never under it [m]; NaN without terrain.
    above_chord_m : (k,) greatest distance from the straight line between the ends, at right angles to it in its
        vertical plane [m]: the jump height that is measured normal to a uniform slope. A vertical chord has none (0).
    """

    above_terrain_m: Array
    below_terrain_m: Array
    above_chord_m: Array


def clearances(flights: Flights, surface: "Surface | None", radius_m: Array | None = None) -> Clearance:
    """Heights of all segments above the terrain (where a ray up or down meets it) and above their chords.

    Parameters
    ----------
    radius_m : (k,) of the block [m] where the flights are those of its centre; heights are those of its underside.
    """
    k = len(flights)
    above, below = np.full(k, np.nan), np.full(k, np.nan)
    chord = _above_chord(flights)
    if surface is not None and k:
        from ..terrain.raycast import heights_above

        height = heights_above(surface, _samples(flights, np.arange(k)).reshape(-1, 3)).reshape(k, SAMPLES)
        if radius_m is not None:
            height = height - radius_m[:, None]
        over = np.isfinite(height).any(axis=1)
        above[over] = np.nanmax(height[over], axis=1)
        below[over] = np.maximum(0.0, -np.nanmin(height[over], axis=1))
    return Clearance(above_terrain_m=above, below_terrain_m=below, above_chord_m=chord)


def _samples(flights: Flights, which: np.ndarray) -> Array:
    """(len(which), SAMPLES, 3) positions at equal times from end to end."""
    fraction = np.linspace(0.0, 1.0, SAMPLES)
    times = flights.start_time_s[which, None] + fraction * flights.duration_s[which, None]
    position, _ = flight_states(flights, np.repeat(which, SAMPLES), times.ravel())
    return position.reshape(-1, SAMPLES, 3)


def _above_chord(flights: Flights) -> Array:
    """Closed form gT²/8·cos(inclination) without drag, sampled with it."""
    chord = flights.end_position - flights.start_position
    length, level = norm(chord), norm(chord[:, :2])
    cosine = np.divide(level, length, out=np.zeros_like(length), where=length > 0)
    height = flights.gravity_mps2 * flights.duration_s**2 / 8 * cosine
    height[flights.is_contact] = 0.0
    dragged = np.flatnonzero((flights.drag_per_m > 0) & (level > 0))
    if dragged.size:
        along = chord[dragged] / length[dragged, None]
        upward = np.array([0.0, 0.0, 1.0]) - along * along[:, 2:]
        upward /= norm(upward)[:, None]
        offset = _samples(flights, dragged) - flights.start_position[dragged, None]
        height[dragged] = dot(offset, upward[:, None]).max(axis=1)
    return height
