# SPDX-License-Identifier: GPL-3.0-or-later
"""The motion between nodes of known place and time, with its derivatives by both."""

from dataclasses import dataclass

import numpy as np

from ..vectors import Array, Indices, Mask
from .free_flight import fall, incident_velocity, parabola, restituted_velocity


@dataclass(frozen=True, eq=False)
class NodeMotion:
    """k segments, each between two nodes; solved by `join_nodes`.

    Attributes
    ----------
    start, displacement : (k, 3) [m].
    start_time_s, duration_s : (k,) [s].
    gravity, drag_per_m : (k,) [m/s²], [1/m]; zero where the block rolls.
    start_velocity, end_velocity : (k, 3) [m/s].
    inverse : (k, 3, 3) derivative of the start velocity by the displacement [1/s].
    end_by_displacement : (k, 3, 3) the same of the end velocity.
    end_acceleration : (k, 3) [m/s²].
    end_by_law, end_velocity_by_law : (k, 3, 2) derivatives of the end and its velocity by k and by g, with the start
        velocity held.
    dragged : (k,) drag is not zero.
    """

    start: Array
    displacement: Array
    start_time_s: Array
    duration_s: Array
    gravity: Array
    drag_per_m: Array
    start_velocity: Array
    end_velocity: Array
    inverse: Array
    end_by_displacement: Array
    end_acceleration: Array
    end_by_law: Array
    end_velocity_by_law: Array
    dragged: Mask

    @property
    def start_by_law(self) -> Array:
        """(k, 3, 2) derivatives of the start velocity by k and by g, between fixed nodes."""
        return -self.inverse @ self.end_by_law

    @property
    def end_between_by_law(self) -> Array:
        """(k, 3, 2) the same of the end velocity."""
        return self.end_velocity_by_law - self.end_by_displacement @ self.end_by_law


@dataclass(frozen=True, eq=False)
class Places:
    """q places on segments.

    Attributes
    ----------
    position, velocity : (q, 3) [m], [m/s]; the velocity is also the derivative by the time.
    by_end : (q, 3, 3) derivative by the end node's place; by the start node's it is 1 − by_end.
    by_times : (q, 3, 2) by the times of the start and the end node.
    by_law : (q, 3, 2) by k and by g.
    """

    position: Array
    velocity: Array
    by_end: Array
    by_times: Array
    by_law: Array


def join_nodes(
    start: Array, end: Array, start_time_s: Array, end_time_s: Array, gravity: Array, drag: Array
) -> NodeMotion:
    """Solve the segments; where a flight with drag is not found, NaN.

    Notes
    -----
    Without drag x(s) = Δ·s/T + ½g(sT − s²)ẑ from the start node. With drag, Newton's method over the start velocity on
    the equation of motion and its variational equations; the derivatives follow from the implicit function theorem.
    """
    displacement, duration = end - start, end_time_s - start_time_s
    k = duration.size
    identity = np.broadcast_to(np.eye(3), (k, 3, 3))
    velocity = restituted_velocity(displacement, duration, gravity)
    end_velocity = incident_velocity(velocity, duration, gravity)
    acceleration = np.zeros((k, 3))
    acceleration[:, 2] = -gravity
    inverse = identity / duration[:, None, None]
    end_by_displacement = inverse.copy()
    by_law, velocity_by_law = np.zeros((k, 3, 2)), np.zeros((k, 3, 2))
    flies = gravity != 0
    by_law[:, 2, 1] = np.where(flies, fall(duration, 1.0)[:, 2], 0.0)
    velocity_by_law[:, 2, 1] = np.where(flies, -duration, 0.0)

    dragged = drag != 0
    rows = np.flatnonzero(dragged)
    if rows.size:
        from . import drag_kernels

        guess, ends = velocity[rows], np.empty((rows.size, drag_kernels.STATE))
        drag_kernels.join_ends(displacement[rows], duration[rows], drag[rows], gravity[rows], guess, ends)
        velocity[rows], end_velocity[rows] = guess, ends[:, 3:6]
        speed = np.sqrt((ends[:, 3:6] ** 2).sum(axis=1))
        acceleration[rows] -= (drag[rows] * speed)[:, None] * ends[:, 3:6]
        place, pace = ends[:, 6:21].reshape(-1, 3, 5), ends[:, 21:].reshape(-1, 3, 5)
        good = np.isfinite(speed)
        solved = np.full((rows.size, 3, 3), np.nan)
        solved[good] = np.linalg.inv(place[good, :, :3])
        inverse[rows] = solved
        end_by_displacement[rows] = pace[:, :, :3] @ solved
        by_law[rows], velocity_by_law[rows] = place[:, :, 3:], pace[:, :, 3:]
    return NodeMotion(
        start=start,
        displacement=displacement,
        start_time_s=start_time_s,
        duration_s=duration,
        gravity=gravity,
        drag_per_m=drag,
        start_velocity=velocity,
        end_velocity=end_velocity,
        inverse=inverse,
        end_by_displacement=end_by_displacement,
        end_acceleration=acceleration,
        end_by_law=by_law,
        end_velocity_by_law=velocity_by_law,
        dragged=dragged,
    )


def places_at(motion: NodeMotion, which: Indices, time_s: Array) -> Places:
    """Where the segments `which` (q,) are at the times (q,); outside of a segment its motion is continued."""
    elapsed = time_s - motion.start_time_s[which]
    position, velocity, by_start_velocity, direct = _from_start(motion, which, elapsed)
    by_end = by_start_velocity @ motion.inverse[which]
    through = (by_end @ motion.end_velocity[which][:, :, None])[:, :, 0]
    by_times = np.stack([through - velocity, -through], axis=2)
    return Places(
        motion.start[which] + position, velocity, by_end, by_times, direct - by_end @ motion.end_by_law[which]
    )


def _from_start(motion: NodeMotion, which: Indices, elapsed: Array) -> tuple[Array, Array, Array, Array]:
    """Displacement, velocity, and the derivatives of the displacement by start velocity (q, 3, 3) and law (q, 3, 2)."""
    q, gravity = which.size, motion.gravity[which]
    position, velocity = parabola(np.zeros((q, 3)), motion.start_velocity[which], elapsed, gravity)
    by_start = elapsed[:, None, None] * np.broadcast_to(np.eye(3), (q, 3, 3))
    direct = np.zeros((q, 3, 2))
    direct[:, 2, 1] = np.where(gravity != 0, fall(elapsed, 1.0)[:, 2], 0.0)
    rows = np.flatnonzero(motion.dragged[which])
    if rows.size:
        from . import drag_kernels

        rows = rows[np.lexsort((elapsed[rows], which[rows]))]
        states = np.empty((rows.size, drag_kernels.STATE))
        drag_kernels.states_along(
            which[rows], elapsed[rows], motion.start_velocity, motion.drag_per_m, motion.gravity, states
        )
        place = states[:, 6:21].reshape(-1, 3, 5)
        position[rows], velocity[rows] = states[:, :3], states[:, 3:6]
        by_start[rows], direct[rows] = place[:, :, :3], place[:, :, 3:]
    return position, velocity, by_start, direct
