# SPDX-License-Identifier: GPL-3.0-or-later
"""Other places to start from: where else along their rays the picks may lie on the terrain and on their flights.

A single view that looks along the slope sees several humps behind one another, and a search that starts on the wrong
one ends there. Along the ray of each node the terrain tells where a block may touch it, and the pixels of each flight
tell, through gravity, how far away its two ends are: together a chain whose likeliest paths dynamic programming finds
(Viterbi 1967), all combinations of distances considered.
"""

from dataclasses import dataclass, replace

import numpy as np

from ...vectors import Array, Indices, norm, perpendicular, unit
from .problem import Evaluation, Problem, Unknowns, evaluate, ground_distances
from .setup import SIGMA_CENTRE_M
from .solver import HUBER, MEDIAN_LENGTH

MOST_STARTS = 4
"""States at most, and twice as many for each chain."""
REACH_M, LEAST_REACH_M = 25.0, 2.0
"""How far along a ray places are sought, at most and at least."""
STEPS = 161
"""Places along each ray."""
SIGMA_MARK_PX, SIGMA_FOUND_PX = 5.0, 3.0
"""Of a marked place, and of a solution's, across the ray."""
LIKELY = 12.0
"""Half a χ² by which a path may be worse than the best one."""
RIDGE = 1.0
"""And by which what lies between must be worse than the path, for it to be another one."""
FARTHEST = 0.5 * 6.0**2
"""Of a node from the terrain, as half a square: a mark may be wrong in itself."""
REWEIGHTED = 3
"""Rounds of weighting pixels by how well a flight passes them."""


@dataclass(frozen=True, eq=False)
class _Rays:
    """Rays of the n nodes: direction, the two across, and the deviations across them [m]."""

    along: Array
    beside: Array
    sigma_m: Array


def states_along_rays(problem: Problem, state: Unknowns, sigma_px: float) -> list[Unknowns]:
    """States with the nodes elsewhere on their rays, the likeliest first; none without a terrain.

    Parameters
    ----------
    state : the nodes are on their rays, at their times, or about them.
    sigma_px : how far they may be off their rays [px].
    """
    if problem.surface is None or not problem.grounded.size:
        return []
    found = _paths(problem, state, sigma_px)
    return _paths(problem, found[0], sigma_px) if found else []  # derivatives are of the place they were taken at


def _paths(problem: Problem, state: Unknowns, sigma_px: float) -> list[Unknowns]:
    """The likeliest states about one, different by more than a block."""
    there = evaluate(problem, state)
    if not there.valid:
        return []
    rays = _rays_of(problem, state, sigma_px)
    curve = _flights_by_distance(problem, there, rays)
    steps = _reaches(problem, curve)
    cost = _on_the_ground(problem, state, rays, steps)
    paths: list[tuple[float, Array]] = [(0.0, np.zeros(len(state.time_s)))]
    for chain in np.unique(problem.chain):
        segments = np.flatnonzero(problem.chain == chain)
        alternatives = _alternatives(problem, segments, curve, steps, cost)
        paths = [(total + extra, along + more) for total, along in paths for extra, more in alternatives]
        paths = sorted(paths, key=lambda one: one[0])[: 2 * MOST_STARTS]
    best = paths[0][0]
    apart = 2 * float(np.median(problem.radius_m))
    kept: list[Array] = []
    for total, along in paths:
        if total < best + LIKELY and all(np.abs(along - other).max() > apart for other in kept):
            kept.append(along)
    return [replace(state, centre=state.centre + along[:, None] * rays.along) for along in kept[:MOST_STARTS]]


def _rays_of(problem: Problem, state: Unknowns, sigma_px: float) -> _Rays:
    """Of the view that has most pixels of the nodes' trajectory, among those whose clock is held."""
    n = len(state.time_s)
    along, sigma = np.empty((n, 3)), np.empty(n)
    group_of = np.empty(n, dtype=np.intp)
    group_of[problem.first], group_of[problem.last] = problem.group, problem.group
    held = problem.columns.clock[:, 0] < 0
    for group in np.unique(group_of):
        count = np.bincount(problem.view[problem.obs_group == group], minlength=len(problem.views)) * held
        view = problem.views[int(np.argmax(count))]
        nodes = np.flatnonzero(group_of == group)
        position, _ = view.path.poses_at(view.clock.to_video(state.time_s[nodes]))
        away = state.centre[nodes] - position
        along[nodes] = unit(away)
        focal = (view.path.reference.fx + view.path.reference.fy) / 2
        sigma[nodes] = sigma_px * norm(away) / focal
    return _Rays(along, np.stack(perpendicular(along), axis=1), sigma)


@dataclass(frozen=True, eq=False)
class _Curve:
    """Half a χ² of each segment's pixels by how far its two ends move along their rays, x: ½ xᵀA x + bᵀx.

    Attributes
    ----------
    square : (k, 2, 2) A [1/m²]; slope : (k, 2) b [1/m].
    """

    square: Array
    slope: Array


def _flights_by_distance(problem: Problem, there: Evaluation, rays: _Rays) -> _Curve:
    """With what lies across the rays and the times chosen as the pixels like it."""
    k = len(problem.first)
    rows = np.flatnonzero((problem.columns.clock[problem.view, 0] < 0) & (there.segment >= 0))
    segment = there.segment[rows]
    turn, prior = np.zeros((k, 8, 8)), np.zeros((k, 8))
    known = np.where(np.isfinite(problem.sigma_time_s), problem.sigma_time_s, 1.0)
    for place, nodes in ((0, problem.first), (4, problem.last)):
        turn[:, place : place + 3, place] = rays.along[nodes]
        turn[:, place : place + 3, place + 1 : place + 3] = np.swapaxes(rays.beside[nodes], 1, 2)
        turn[:, place + 3, place + 3] = 1.0
        sigma = [np.full(k, SIGMA_CENTRE_M), rays.sigma_m[nodes], rays.sigma_m[nodes], known[nodes]]
        prior[:, place : place + 4] = np.stack(sigma, axis=1) ** -2.0
    jacobian = there.pixels.jacobian[rows][:, :, :8] @ turn[segment]
    residual, turned = there.pixels.residual[rows], np.swapaxes(jacobian, 1, 2)
    squares, products = turned @ jacobian, (turned @ residual[:, :, None])[:, :, 0]
    weight, scale = np.ones(rows.size), 1.0
    for _ in range(REWEIGHTED):
        normal, right = prior[:, None] * np.eye(8), np.zeros((k, 8))
        np.add.at(normal, segment, weight[:, None, None] * squares)
        np.add.at(right, segment, weight[:, None] * products)
        step = -np.linalg.solve(normal, right[:, :, None])
        left = norm(residual + (jacobian @ step[segment])[:, :, 0])
        scale = max(1.0, float(np.median(left)) / MEDIAN_LENGTH) if left.size else 1.0
        weight = HUBER / np.maximum(left / scale, HUBER)
    normal, right = normal / scale**2, right / scale**2
    kept, rest = np.array([0, 4]), np.array([1, 2, 3, 5, 6, 7])
    across = normal[:, kept][:, :, rest] @ np.linalg.inv(normal[:, rest][:, :, rest])
    square = normal[:, kept][:, :, kept] - across @ normal[:, rest][:, :, kept]
    slope = right[:, kept] - (across @ right[:, rest, None])[:, :, 0]
    return _Curve(square, slope)


def _reaches(problem: Problem, curve: _Curve) -> Array:
    """(n, STEPS) distances along the rays [m]: as far as gravity leaves open, and the marked place."""
    n = int(max(problem.first.max(), problem.last.max())) + 1
    information, right = np.zeros((n, n)), np.zeros(n)
    for i, (first, last) in enumerate(zip(problem.first, problem.last, strict=True)):
        both = [first, last]
        information[np.ix_(both, both)] += curve.square[i]
        right[both] += curve.slope[i]
    covariance = np.linalg.inv(information + 1e-9 * np.eye(n))
    middle, sigma = -covariance @ right, np.sqrt(np.diag(covariance))
    low = np.clip(np.minimum(middle - 4 * sigma, -LEAST_REACH_M), -REACH_M, -LEAST_REACH_M)
    high = np.clip(np.maximum(middle + 4 * sigma, LEAST_REACH_M), LEAST_REACH_M, REACH_M)
    return low[:, None] + (high - low)[:, None] * np.linspace(0, 1, STEPS)


def _on_the_ground(problem: Problem, state: Unknowns, rays: _Rays, steps: Array) -> Array:
    """(n, STEPS) half a χ² of the nodes' distance from the terrain; zero for those in the air."""
    cost = np.zeros_like(steps)
    nodes = problem.grounded
    places = state.centre[nodes, None] + steps[nodes, :, None] * rays.along[nodes, None]
    assert problem.surface is not None
    distance, _ = ground_distances(problem.surface, places.reshape(-1, 3))
    off = distance.reshape(nodes.size, -1) - problem.radius_m[:, None]
    later = np.concatenate([off[:, 1:], off[:, -1:]], axis=1)
    nearest = np.where(off * later <= 0, 0.0, np.minimum(np.abs(off), np.abs(later)))
    sigma = np.hypot(problem.ground.sigma_m, rays.sigma_m[nodes])
    cost[nodes] = np.minimum(0.5 * (nearest / sigma[:, None]) ** 2, FARTHEST)
    return cost


def _alternatives(
    problem: Problem, segments: Indices, curve: _Curve, steps: Array, cost: Array
) -> list[tuple[float, Array]]:
    """The likeliest paths of one chain: half a χ², and the distances (n,) along the rays, zero elsewhere."""
    nodes = np.append(problem.first[segments], problem.last[segments[-1]])
    tables = []
    for i, segment in enumerate(segments):
        a, b = steps[nodes[i], :, None], steps[nodes[i + 1], None, :]
        (aa, ab), (_, bb) = curve.square[segment]
        sa, sb = curve.slope[segment]
        tables.append(0.5 * aa * a**2 + ab * a * b + 0.5 * bb * b**2 + sa * a + sb * b)
    from scipy.signal import find_peaks

    forward, came = [cost[nodes[0]]], list[Indices]()
    for i, table in enumerate(tables):
        through = forward[-1][:, None] + table
        came.append(np.argmin(through, axis=0))
        forward.append(through.min(axis=0) + cost[nodes[i + 1]])
    backward, goes = [np.zeros(steps.shape[1])], list[Indices]()
    for i, table in reversed(list(enumerate(tables))):
        through = table + (cost[nodes[i + 1]] + backward[0])[None, :]
        goes.insert(0, np.argmin(through, axis=1))
        backward.insert(0, through.min(axis=1))
    best = float(forward[-1].min())
    found: dict[tuple[int, ...], float] = {}
    for i in range(len(nodes)):
        least = forward[i] + backward[i]
        padded = np.concatenate([[least.max()], least, [least.max()]])
        peaks, _ = find_peaks(-np.minimum(padded, best + 2 * LIKELY), prominence=RIDGE)
        for peak in peaks[least[peaks - 1] < best + LIKELY] - 1:
            path = [int(peak)]
            for j in range(i - 1, -1, -1):
                path.insert(0, int(came[j][path[0]]))
            for j in range(i, len(nodes) - 1):
                path.append(int(goes[j][path[-1]]))
            found[tuple(path)] = float(least[peak])
    result = []
    for places, total in sorted(found.items(), key=lambda one: one[1])[: 2 * MOST_STARTS]:
        along = np.zeros(len(steps))
        along[nodes] = steps[nodes, list(places)]
        result.append((total, along))
    return result
