# SPDX-License-Identifier: GPL-3.0-or-later
"""The least-squares problem of refinement: its unknowns, and its residuals with their derivatives."""

from dataclasses import dataclass, replace

import numpy as np

from ...camera.model import project_with_derivatives, rotation_from_vector
from ...terrain.raycast import closest_points
from ...terrain.surface import Surface
from ...vectors import Array, Indices, Mask, dot
from ..node_motion import NodeMotion, Places, join_nodes, places_at
from .ground_errors import GroundErrors
from .views import View

NODE = 4
"""Unknowns of a node: x, y, z of the block's centre [m] and the time [s]."""
DRAG_COLUMN, LAW_COLUMN, POSE_COLUMNS, CLOCK_COLUMN = 8, 9, slice(10, 16), 16
"""Of the pixels' derivatives: by the drag coefficient, gravity, the view's pose and its clock's offset, there even when
these are held."""
SHORTEST_S = 1e-4
"""A segment does not become shorter than this."""


@dataclass(frozen=True, eq=False)
class Unknowns:
    """The state of n nodes and v views.

    Attributes
    ----------
    centre, time_s : (n, 3), (n,) of the nodes.
    turn, move : (v, 3) rotation vector, about the axes of the solved frame's camera [rad], and displacement [m] of each
        camera path.
    offset_s, drift : (v,) added to the clocks.
    aim : (v, t, 2) where the spot that was tracked lies off the block's centre in the image (u, v), for each view and
        trajectory, in parts of the block's diameter.
    coefficient : of drag [-], relative to what each block's drag per metre is for 1.
    gravity : [m/s²].
    readout_s : (v,) from the first row of an image to the last (rolling shutter).
    """

    centre: Array
    time_s: Array
    turn: Array
    move: Array
    offset_s: Array
    drift: Array
    aim: Array
    coefficient: float
    gravity: float
    readout_s: Array


@dataclass(frozen=True, eq=False)
class Columns:
    """Where the unknowns stand in the vector of those that are free; −1 for what is held.

    Attributes
    ----------
    pose : (v, 6), clock : (v, 2) offset and drift, law : (2,) drag coefficient and gravity, aim : (v, t, 2),
    readout : (v,), push : (k, 3) accelerations of the segments beside gravity, after all others (see `accelerations`).
    size : number of free unknowns.
    """

    pose: Indices
    clock: Indices
    law: Indices
    aim: Indices
    readout: Indices
    push: Indices
    size: int

    @property
    def width(self) -> int:
        """Number of columns with those of the accelerations."""
        return self.size + int((self.push >= 0).sum())


@dataclass(frozen=True, eq=False)
class Problem:
    """Everything that does not change while the unknowns are sought.

    Attributes
    ----------
    views : v views, with their prior poses and clocks.
    first, last : (k,) nodes at the ends of the segments; those of a trajectory together and in time order.
    contact : (k,) the block rolls.
    reference_drag : (k,) drag per metre for a coefficient of 1 [1/m].
    group, chain : (k,) the trajectory and the chain of the segments, ascending.
    columns : of the unknowns.
    view, obs_group : (m,) of the pixels: the view, the trajectory.
    video_s : (m,) video time [s]; row (m,) how far the pixel's row is from the middle one, in parts of the height.
    pixel : (m, 2); sigma_px (m,) [px].
    block_px : (m,) how large the block appears [px], from the marked motion.
    sigma_aim : standard deviation of the aim, in parts of the block's diameter.
    position, rotation : (m, 3), (m, 3, 3) prior pose of the camera when each pixel was taken.
    time_s, sigma_time_s : (n,) prior times of the nodes.
    centre, centre_whitening : (n, 3), (n, 3, 3) prior places, and roots of the inverse of their covariance.
    grounded : (g,) nodes on the ground; radius_m (g,) of the block, ground : errors of their distance from it.
    surface : the terrain.
    pass_segment, pass_time_s, pass_position, pass_sigma_m : (p,), (p,), (p, 3), (p,) places marked in flight.
    pose_whitening : (v, 6, 6) inverse of the Cholesky factor of the poses' covariance, of held ones too.
    readout_s : prior of the readout where it is not known [s], sigma_readout_s its standard deviation.
    """

    views: tuple[View, ...]
    first: Indices
    last: Indices
    contact: Mask
    reference_drag: Array
    group: Indices
    chain: Indices
    columns: Columns
    view: Indices
    obs_group: Indices
    video_s: Array
    row: Array
    pixel: Array
    sigma_px: Array
    block_px: Array
    sigma_aim: float
    position: Array
    rotation: Array
    time_s: Array
    sigma_time_s: Array
    centre: Array
    centre_whitening: Array
    grounded: Indices
    radius_m: Array
    ground: GroundErrors
    surface: Surface | None
    pass_segment: Indices
    pass_time_s: Array
    pass_position: Array
    pass_sigma_m: Array
    pose_whitening: Array
    readout_s: float
    sigma_readout_s: float


@dataclass(frozen=True, eq=False)
class Rows:
    """r residuals of d numbers each, divided by their standard deviations.

    Attributes
    ----------
    residual : (r, d).
    jacobian : (r, d, q) by q unknowns each.
    columns : (r, q) which; −1 for none.
    """

    residual: Array
    jacobian: Array
    columns: Indices


@dataclass(frozen=True, eq=False)
class Evaluation:
    """The problem at one state.

    Attributes
    ----------
    pixels : the residuals of the m pixels.
    others : all the rest.
    segment : (m,) the segment that each pixel was counted to, −1 for none.
    valid : every residual is a number.
    motion : of the segments.
    """

    pixels: Rows
    others: tuple[Rows, ...]
    segment: Indices
    valid: bool
    motion: NodeMotion


def free_columns(
    nodes: int, segments: int, free: frozenset[str], posed: Mask, timed: Mask, aimed: Mask, unread: Mask
) -> Columns:
    """Number the free unknowns: nodes first, then what trajectories share.

    Parameters
    ----------
    free : of "clock", "clock_drift", "drag", "gravity".
    posed : (v,) the view's pose is sought; timed (v,) its clock can be told.
    aimed : (v, t) the aim at a trajectory is sought in this view.
    unread : (v,) the readout is sought.
    """
    size, views = NODE * nodes, posed.size
    pose, clock, law = np.full((views, 6), -1), np.full((views, 2), -1), np.full(2, -1)
    pose[posed] = size + np.arange(6 * posed.sum()).reshape(-1, 6)
    size += 6 * int(posed.sum())
    for column, name in enumerate(("clock", "clock_drift")):
        if name in free:
            clock[timed, column] = size + np.arange(timed.sum())
            size += int(timed.sum())
    for row, name in enumerate(("drag", "gravity")):
        if name in free:
            law[row] = size
            size += 1
    aim = np.full((*aimed.shape, 2), -1)
    aim[aimed] = size + np.arange(2 * aimed.sum()).reshape(-1, 2)
    size += 2 * int(aimed.sum())
    readout = np.full(views, -1)
    readout[unread] = size + np.arange(unread.sum())
    return Columns(pose, clock, law, aim, readout, np.full((segments, 3), -1), size + int(unread.sum()))


def moved(problem: Problem, state: Unknowns, step: Array) -> Unknowns:
    """The state after a step of the free unknowns, (size,)."""
    columns, n = problem.columns, len(state.time_s)
    padded = np.append(step, 0.0)
    nodes = step[: NODE * n].reshape(n, NODE)
    pose, clock, law = padded[columns.pose], padded[columns.clock], padded[columns.law]
    return Unknowns(
        centre=state.centre + nodes[:, :3],
        time_s=state.time_s + nodes[:, 3],
        turn=state.turn + pose[:, :3],
        move=state.move + pose[:, 3:],
        offset_s=state.offset_s + clock[:, 0],
        drift=state.drift + clock[:, 1],
        aim=state.aim + padded[columns.aim],
        coefficient=state.coefficient + float(law[0]),
        gravity=state.gravity + float(law[1]),
        readout_s=state.readout_s + padded[columns.readout],
    )


def solve_segments(problem: Problem, state: Unknowns) -> NodeMotion:
    """The motion that the nodes of a state define."""
    return join_nodes(
        state.centre[problem.first],
        state.centre[problem.last],
        state.time_s[problem.first],
        state.time_s[problem.last],
        np.where(problem.contact, 0.0, state.gravity),
        np.where(problem.contact, 0.0, state.coefficient * problem.reference_drag),
    )


def common_times(problem: Problem, state: Unknowns) -> Array:
    """(m,) when the pixels were exposed, on the common clock [s]."""
    elapsed = _clock_times(problem)
    offset = np.array([view.clock.offset_s for view in problem.views]) + state.offset_s
    drift = np.array([view.clock.drift for view in problem.views]) + state.drift
    return offset[problem.view] + (1 + drift[problem.view]) * elapsed + _row_delays(problem, state)


def _row_delays(problem: Problem, state: Unknowns) -> Array:
    """(m,) by how much the pixels' rows were exposed after the middle one [s]."""
    return np.asarray(state.readout_s[problem.view] * problem.row)


def _clock_times(problem: Problem) -> Array:
    """(m,) time since the origin of the clocks at their nominal rates [s]."""
    origin = np.array([view.clock.origin_s for view in problem.views])
    rate = np.array([view.clock.rate for view in problem.views])
    filmed = problem.video_s
    if any(view.clock.gaps for view in problem.views):
        filmed = filmed.copy()
        for number, view in enumerate(problem.views):
            mine = problem.view == number
            filmed[mine] = view.clock.filmed(filmed[mine])
    return np.asarray(rate[problem.view] * (filmed - origin[problem.view]))


def chains_at(problem: Problem, state: Unknowns) -> Indices:
    """(m,) the chain in which each pixel was taken, −1 where its trajectory has none at that time."""
    segment = segments_at(problem, state, common_times(problem, state), problem.obs_group)
    return np.where(segment >= 0, problem.chain[segment], -1)


def segments_at(problem: Problem, state: Unknowns, time_s: Array, group: Indices) -> Indices:
    """(q,) the segments of trajectories `group` (q,) at common times (q,), −1 where they have none."""
    start, end = state.time_s[problem.first], state.time_s[problem.last]
    found = np.full(time_s.size, -1)
    for one in np.unique(group):
        rows = np.flatnonzero(group == one)
        low, high = np.searchsorted(problem.group, [one, one + 1])
        place = np.searchsorted(start[low:high], time_s[rows], side="right") - 1 + low
        inside = (place >= low) & (time_s[rows] <= end[np.maximum(place, 0)])
        found[rows] = np.where(inside, place, -1)
    return found


def _segments_in(problem: Problem, state: Unknowns, chain: Indices, time: Array) -> Indices:
    """(m,) the segment of a chain that holds a time; the first or the last one holds what is before or after."""
    start = state.time_s[problem.first]
    found = np.full(time.size, -1)
    for one in np.unique(chain[chain >= 0]):
        rows = np.flatnonzero(chain == one)
        low, high = np.searchsorted(problem.chain, [one, one + 1])
        found[rows] = low + np.maximum(np.searchsorted(start[low:high], time[rows], side="right") - 1, 0)
    return found


def evaluate(problem: Problem, state: Unknowns, chain: Indices | None = None) -> Evaluation:
    """Residuals and derivatives.

    Parameters
    ----------
    chain : (m,) to which the pixels belong, −1 for those that are not used; None finds it by the times. As long as it
        stays, costs can be compared: they are continuous where a pixel passes from one flight to the next.
    """
    nothing = Rows(np.zeros((0, 1)), np.zeros((0, 1, 1)), np.zeros((0, 1), dtype=np.intp))
    time = common_times(problem, state)
    if chain is None:
        chain = chains_at(problem, state)
    segment = _segments_in(problem, state, chain, time)
    durations = state.time_s[problem.last] - state.time_s[problem.first]
    if not (np.isfinite(durations).all() and (durations > SHORTEST_S).all()):
        return Evaluation(nothing, (), segment, False, solve_segments(problem, replace(state, time_s=problem.time_s)))
    motion = solve_segments(problem, state)
    if not np.isfinite(motion.inverse).all():
        return Evaluation(nothing, (), segment, False, motion)
    pixels = _pixel_rows(problem, state, motion, segment, time)
    others = [_time_rows(problem, state), _centre_rows(problem, state)]
    if problem.surface is not None and problem.grounded.size:
        others.append(ground_rows(problem, state))
    if problem.pass_segment.size:
        others.append(_pass_rows(problem, motion))
    if (problem.columns.pose >= 0).any():
        others.append(_pose_rows(problem, state))
    if (problem.columns.aim >= 0).any():
        others.append(_aim_rows(problem, state))
    if (problem.columns.readout >= 0).any():
        others.append(_readout_rows(problem, state))
    valid = all(bool(np.isfinite(rows.residual).all()) for rows in (pixels, *others))
    return Evaluation(pixels, tuple(others), segment, valid, motion)


def _by_nodes(places: Places, motion: NodeMotion, problem: Problem, segment: Indices) -> tuple[Array, Indices]:
    """Derivatives (q, 3, 10) of places by their nodes, the drag coefficient and gravity, and the columns (q, 10)."""
    q = segment.size
    derivative = np.empty((q, 3, 10))
    derivative[:, :, 0:3] = np.eye(3) - places.by_end
    derivative[:, :, 3] = places.by_times[:, :, 0]
    derivative[:, :, 4:7] = places.by_end
    derivative[:, :, 7] = places.by_times[:, :, 1]
    derivative[:, :, 8] = places.by_law[:, :, 0] * np.where(problem.contact, 0.0, problem.reference_drag)[segment, None]
    derivative[:, :, 9] = places.by_law[:, :, 1]
    columns = np.empty((q, 10), dtype=np.intp)
    columns[:, :4] = NODE * problem.first[segment, None] + np.arange(4)
    columns[:, 4:8] = NODE * problem.last[segment, None] + np.arange(4)
    columns[:, 8:] = problem.columns.law
    return derivative, columns


def _pixel_rows(problem: Problem, state: Unknowns, motion: NodeMotion, segment: Indices, time: Array) -> Rows:
    m = segment.size
    residual, jacobian = np.zeros((m, 2)), np.zeros((m, 2, 21))
    columns = np.full((m, 21), -1)
    rows = np.flatnonzero(segment >= 0)
    places = places_at(motion, segment[rows], time[rows])
    by_nodes, columns[rows, :10] = _by_nodes(places, motion, problem, segment[rows])
    columns[:, 10:16] = problem.columns.pose[problem.view]
    columns[:, 16:18] = problem.columns.clock[problem.view]
    columns[:, 18:20] = problem.columns.aim[problem.view, problem.obs_group]
    columns[:, 20] = problem.columns.readout[problem.view]
    aim = state.aim[problem.view, problem.obs_group] * problem.block_px[:, None]
    elapsed = _clock_times(problem)
    for number, view in enumerate(problem.views):
        mine = np.flatnonzero(problem.view[rows] == number)
        if not mine.size:
            continue
        here = rows[mine]
        reference = view.path.reference.rotation
        to_frame = problem.rotation[here] @ reference.T
        rotation = to_frame @ rotation_from_vector(state.turn[number]) @ reference
        seen = project_with_derivatives(
            view.path.reference,
            places.position[mine],
            position=problem.position[here] + state.move[number],
            rotation=rotation,
        )
        residual[here] = problem.pixel[here] - seen.pixel - aim[here]
        jacobian[here, :, :10] = -seen.d_point @ by_nodes[mine]
        jacobian[here, :, 10:13] = -seen.d_rotation @ to_frame @ _left_jacobian(state.turn[number])
        jacobian[here, :, 13:16] = -seen.d_position
        by_time = -(seen.d_point @ places.velocity[mine][:, :, None])
        jacobian[here, :, 16:17] = by_time
        jacobian[here, :, 17:18] = by_time * elapsed[here, None, None]
        jacobian[here, :, 18:20] = -problem.block_px[here, None, None] * np.eye(2)
        jacobian[here, :, 20:] = by_time * problem.row[here, None, None]
    return Rows(residual / problem.sigma_px[:, None], jacobian / problem.sigma_px[:, None, None], columns)


def _left_jacobian(w: Array) -> Array:
    """(3, 3) J with exp(w + δ) = exp(J δ) exp(w) to first order, to the second order in a small w."""
    skew = np.array([[0, -w[2], w[1]], [w[2], 0, -w[0]], [-w[1], w[0], 0]])
    angle = float(np.sqrt(w @ w))
    if angle < 1e-4:
        return np.eye(3) + skew / 2 + skew @ skew / 6
    return np.eye(3) + (1 - np.cos(angle)) / angle**2 * skew + (angle - np.sin(angle)) / angle**3 * (skew @ skew)


def _time_rows(problem: Problem, state: Unknowns) -> Rows:
    nodes = np.flatnonzero(np.isfinite(problem.sigma_time_s))
    weight = 1 / problem.sigma_time_s[nodes]
    residual = (state.time_s - problem.time_s)[nodes] * weight
    return Rows(residual[:, None], weight[:, None, None], NODE * nodes[:, None] + 3)


def _centre_rows(problem: Problem, state: Unknowns) -> Rows:
    nodes, white = np.arange(len(problem.centre)), problem.centre_whitening
    residual = (white @ (state.centre - problem.centre)[:, :, None])[:, :, 0]
    return Rows(residual, white, NODE * nodes[:, None] + np.arange(3))


def ground_distances(surface: Surface, centre: Array) -> tuple[Array, Array]:
    """Distances (g,) of points (g, 3) from the terrain, negative below it, and their gradients (g, 3)."""
    closest = closest_points(surface, centre)
    away = centre - closest.point
    face = surface.face_normals[closest.face]
    side = np.where(dot(away, face) < 0, -1.0, 1.0)
    touching = closest.distance < 1e-9
    gradient = np.where(touching[:, None], face, away * (side / np.where(touching, 1.0, closest.distance))[:, None])
    return side * closest.distance, gradient


def ground_rows(problem: Problem, state: Unknowns) -> Rows:
    """The distances from the terrain, (1, g): their errors are alike, so that they are one residual."""
    assert problem.surface is not None
    nodes, whitening = problem.grounded, problem.ground.whitening
    distance, gradient = ground_distances(problem.surface, state.centre[nodes])
    jacobian = (whitening[:, :, None] * gradient).reshape(1, nodes.size, 3 * nodes.size)
    columns = (NODE * nodes[:, None] + np.arange(3)).reshape(1, -1)
    return Rows((whitening @ (distance - problem.radius_m))[None], jacobian, columns)


def _pass_rows(problem: Problem, motion: NodeMotion) -> Rows:
    places = places_at(motion, problem.pass_segment, problem.pass_time_s)
    jacobian, columns = _by_nodes(places, motion, problem, problem.pass_segment)
    weight = 1 / problem.pass_sigma_m
    return Rows((places.position - problem.pass_position) * weight[:, None], jacobian * weight[:, None, None], columns)


def _pose_rows(problem: Problem, state: Unknowns) -> Rows:
    free = problem.columns.pose[:, 0] >= 0
    deviation = np.concatenate([state.turn, state.move], axis=1)[free]
    whitening = problem.pose_whitening[free]
    return Rows(np.einsum("vij,vj->vi", whitening, deviation), whitening, problem.columns.pose[free])


def _aim_rows(problem: Problem, state: Unknowns) -> Rows:
    free = problem.columns.aim[:, :, 0] >= 0
    residual = state.aim[free] / problem.sigma_aim
    slope = np.broadcast_to(np.eye(2) / problem.sigma_aim, (len(residual), 2, 2))
    return Rows(residual, slope, problem.columns.aim[free])


def _readout_rows(problem: Problem, state: Unknowns) -> Rows:
    free = np.flatnonzero(problem.columns.readout >= 0)
    residual = (state.readout_s[free] - problem.readout_s) / problem.sigma_readout_s
    slope = np.full((free.size, 1, 1), 1 / problem.sigma_readout_s)
    return Rows(residual[:, None], slope, problem.columns.readout[free, None])
