# SPDX-License-Identifier: GPL-3.0-or-later
"""From picks, views and pixels to the refinement's problem and its first state."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from ...errors import InputError
from ...terrain.raycast import closest_points
from ...terrain.surface import Surface
from ...vectors import Array, Indices, Mask, dot, norm, unit
from ..block import Block, per_pick
from ..chains import Segments, find_segments
from ..drag import Drag
from ..motion import GROUNDED
from ..picks import Picks
from ..placement import GroundNormals, pick_normals
from ..triangulation import GRAZING_DEG
from .contact_pixels import while_landed
from .ground_errors import ground_errors
from .problem import Problem, Unknowns, free_columns
from .views import PixelObservations, View

IN_THE_AIR_M, IN_THE_AIR_DIAMETERS = 1.0, 2.0
"""A release that is further from the terrain than both of these does not lie on it."""
SIGMA_FRAMES = 1.0
"""Standard deviation of a marked time without one, in frames: weak, since people are a frame or two off."""
SIGMA_CENTRE_M = 10.0
"""The same of a marked place [m]: only to hold what nothing else tells."""
SHAPE, ROUGHNESS = 0.1, 0.25
"""The standard deviation of a block's distance from the terrain, from its radius, and from what the terrain hides."""
SPACINGS, LEAST_TERRAIN_M, MOST_TERRAIN_M = 0.5, 0.02, 0.2
"""The accuracy of a terrain for which none is given, in parts of its point spacing, and its limits [m]: those of
terrestrial scans, which have centimetres between points, and of airborne ones, which have decimetres."""
READOUT_S, SIGMA_READOUT_S = 0.015, 0.009
"""Mean and standard deviation of the readout of phones and cameras, which is from 0 to 30 ms."""


@dataclass(frozen=True, eq=False)
class Setup:
    """A problem with where it came from.

    Attributes
    ----------
    problem, state : to be solved, and where to begin.
    picks : (n) all of them, in the terrain's frame.
    segments : of the picks.
    chosen : (k,) those of the problem.
    nodes : (nodes,) picks of the nodes; node_of (n,) the node of a pick or −1.
    rows : (m,) which of the given pixels.
    radius_m : (n,) of the block of each pick.
    normals : of the picks.
    names : of the trajectories, in the order of the problem's groups.
    noise : factor on the stated standard deviations of the pixels.
    """

    problem: Problem
    state: Unknowns
    picks: Picks
    segments: Segments
    chosen: Indices
    nodes: Indices
    node_of: Indices
    rows: Indices
    radius_m: Array
    normals: GroundNormals
    names: tuple[str, ...]
    noise: float = 1.0


@dataclass(frozen=True, eq=False)
class Ground:
    """What is known of the n picks on the ground, with or without a terrain.

    Attributes
    ----------
    picks : in the terrain's frame.
    segments : of the picks.
    radius_m : (n,) of the block [m].
    normals : of the picks; NaN in the air, or where nothing gives them.
    grounded : (n,) the pick lies on the terrain.
    surface : the terrain.
    sigma_m : (n,) standard deviation of the distance of a block that touches it, from contact to contact [m].
    sigma_terrain_m : accuracy of the terrain [m], NaN without one; terrain_stated : it was given.
    reference_drag : (n,) drag per metre for a coefficient of one [1/m].
    coefficient : of drag; 0 without.
    """

    picks: Picks
    segments: Segments
    radius_m: Array
    normals: GroundNormals
    grounded: Mask
    surface: Surface | None
    sigma_m: Array
    sigma_terrain_m: float
    terrain_stated: bool
    reference_drag: Array
    coefficient: float


def prepare(
    picks: Picks,
    surface: Surface | None,
    block: Block | Mapping[str, Block],
    drag: Drag | None,
    normal_radius_m: float | None,
    sigma_terrain_m: float | None,
) -> Ground:
    """Normals and distances of the picks on the ground."""
    radius = per_pick(picks, block, lambda one: one.radius_m)
    on_ground = np.isin(picks.kind, GROUNDED)
    normals = pick_normals(picks, surface, 2 * radius, normal_radius_m, on_ground)
    grounded = on_ground & (picks.status != "discarded") & (surface is not None)
    sigma, accuracy = SHAPE * radius, np.nan
    if surface is not None and len(picks):
        far = closest_points(surface, picks.position).distance
        grounded &= (picks.kind != "release") | (far <= np.maximum(IN_THE_AIR_M, IN_THE_AIR_DIAMETERS * 2 * radius))
        hidden = ROUGHNESS * surface.mean_spacing_m * np.nan_to_num(normals.spread)
        sigma = np.hypot(sigma, hidden)
    if surface is not None:
        accuracy = default_accuracy(surface) if sigma_terrain_m is None else sigma_terrain_m
    one = Drag(coefficient=1.0) if drag is None else replace(drag, coefficient=1.0)
    return Ground(
        picks=picks,
        segments=find_segments(picks),
        radius_m=radius,
        normals=normals,
        grounded=grounded,
        surface=surface,
        sigma_m=sigma,
        sigma_terrain_m=accuracy,
        terrain_stated=sigma_terrain_m is not None,
        reference_drag=per_pick(picks, block, one.per_metre),
        coefficient=0.0 if drag is None else drag.coefficient,
    )


def default_accuracy(surface: Surface) -> float:
    """Standard deviation of a terrain's height where none is given [m], by its point spacing."""
    return float(np.clip(SPACINGS * surface.mean_spacing_m, LEAST_TERRAIN_M, MOST_TERRAIN_M))


def set_up(
    ground: Ground,
    views: tuple[View, ...],
    observations: PixelObservations,
    names: list[str],
    gravity_mps2: float,
    free: frozenset[str],
    sigma_aim: float = 0.0,
    sigma_datum: float = 0.0,
) -> Setup:
    """The joint problem of some trajectories.

    Raises
    ------
    InputError : the pixels of a trajectory lie outside the time of its picks, or no two of its picks are joined.
    """
    picks, segments = ground.picks, ground.segments
    number = {name: i for i, name in enumerate(names)}
    group_of_pick = np.array([number.get(name, -1) for name in picks.trajectory.tolist()])
    chosen = np.flatnonzero(group_of_pick[segments.first_pick] >= 0)
    first_pick, last_pick = segments.first_pick[chosen], segments.last_pick[chosen]
    nodes = np.unique(np.concatenate([first_pick, last_pick]))
    node_of = np.full(len(picks), -1)
    node_of[nodes] = np.arange(nodes.size)
    rows = np.flatnonzero(np.isin(observations.trajectory, names) & ~while_landed(picks, views, observations))
    seen = observations.take(rows)
    groups = np.array([number[name] for name in seen.trajectory.tolist()], dtype=np.intp)
    _check_overlap(picks, views, seen, set(picks.trajectory[nodes].tolist()))

    timed = np.bincount(seen.view, minlength=len(views)) > 0
    timed[np.argmax(timed)] = False
    in_use = np.bincount(seen.view, minlength=len(views)) > 0
    posed = np.array(["camera" in free and view.pose_covariance is not None for view in views])
    unread = in_use & np.array([view.row_time_s is None for view in views])
    aimed = np.zeros((len(views), len(names)), dtype=np.bool_)
    aimed[seen.view, groups] = sigma_aim > 0
    centre = picks.position[nodes] + np.nan_to_num(ground.radius_m[:, None] * ground.normals.normal)[nodes]
    passes = _passes(picks, segments, chosen)
    height = np.array([view.path.reference.height for view in views])
    readout = height * np.array([view.row_time_s or 0.0 for view in views])
    readout[unread] = READOUT_S
    position, rotation = np.empty((rows.size, 3)), np.empty((rows.size, 3, 3))
    for i, view in enumerate(views):
        position[seen.view == i], rotation[seen.view == i] = view.path.poses_at(seen.time_s[seen.view == i])
    on_ground = np.flatnonzero(ground.grounded[nodes])
    given_time = picks.sigma_time_s[nodes]
    problem = Problem(
        views=views,
        first=node_of[first_pick],
        last=node_of[last_pick],
        contact=segments.contact[chosen],
        reference_drag=ground.reference_drag[first_pick],
        group=group_of_pick[first_pick],
        chain=segments.chain[first_pick],
        columns=free_columns(nodes.size, chosen.size, free, posed, timed, aimed, unread),
        view=seen.view,
        obs_group=groups,
        video_s=seen.time_s,
        row=seen.pixel[:, 1] / height[seen.view] - 0.5,
        pixel=seen.pixel,
        sigma_px=_pixel_sigmas(views, seen, centre.mean(axis=0)),
        block_px=_block_sizes(ground, views, seen, nodes, centre, position),
        sigma_aim=sigma_aim,
        position=position,
        rotation=rotation,
        time_s=picks.time_s[nodes],
        sigma_time_s=np.where(given_time > 0, given_time, SIGMA_FRAMES * _frame_s(views, seen)),
        centre=centre,
        centre_whitening=_places_whitening(ground, views, seen, nodes, centre),
        grounded=on_ground,
        radius_m=ground.radius_m[nodes[on_ground]],
        ground=ground_errors(
            centre[on_ground],
            ground.normals.normal[nodes[on_ground]],
            ground.sigma_m[nodes[on_ground]],
            ground.sigma_terrain_m,
            sigma_datum * _reach_m(views, seen, centre.mean(axis=0)),
        ),
        surface=ground.surface,
        pass_segment=passes[0],
        pass_time_s=picks.time_s[passes[1]],
        pass_position=picks.position[passes[1]],
        pass_sigma_m=picks.sigma_position_m[passes[1]],
        pose_whitening=_whitening(views, centre.mean(axis=0)),
        readout_s=READOUT_S,
        sigma_readout_s=SIGMA_READOUT_S,
    )
    v = len(views)
    state = Unknowns(
        centre=centre,
        time_s=problem.time_s.copy(),
        turn=np.zeros((v, 3)),
        move=np.zeros((v, 3)),
        offset_s=np.zeros(v),
        drift=np.zeros(v),
        aim=np.zeros((v, len(names), 2)),
        coefficient=ground.coefficient,
        gravity=gravity_mps2,
        readout_s=readout,
    )
    return Setup(
        problem, state, picks, segments, chosen, nodes, node_of, rows, ground.radius_m, ground.normals, tuple(names)
    )


def _passes(picks: Picks, segments: Segments, chosen: Indices) -> tuple[Indices, Indices]:
    """Segments (p,) and picks (p,) of the places marked in flight with a standard deviation."""
    first, last = segments.first_pick[chosen], segments.last_pick[chosen]
    inner = np.maximum(last - first - 1, 0)
    segment = np.repeat(np.arange(chosen.size), inner)
    pick = np.arange(segment.size) - np.repeat(np.cumsum(inner) - inner, inner) + first[segment] + 1
    known = picks.sigma_position_m[pick] > 0
    return segment[known], pick[known]


def _places_whitening(
    ground: Ground, views: tuple[View, ...], seen: PixelObservations, nodes: Indices, centre: Array
) -> Array:
    """(nodes, 3, 3) roots of the inverse of the covariances of marked places.

    A place that was marked in a picture is known across its ray as stated, and on the ground along the ray by so much
    less as the ray grazes it; in which picture it was is not known, and taken for the one that sees it flattest.
    """
    given = ground.picks.sigma_position_m[nodes]
    stated = given > 0
    white = np.eye(3) / np.where(stated, given, SIGMA_CENTRE_M)[:, None, None]
    normal = ground.normals.normal[nodes]
    at = np.flatnonzero(stated & ground.grounded[nodes] & np.isfinite(normal[:, 0]))
    places = np.array([views[i].path.reference.position for i in np.unique(seen.view)])
    if not at.size or not len(places):
        return white
    rays = unit(centre[at] - places[:, None])
    steepness = np.abs((rays * normal[at]).sum(axis=2))
    flattest = steepness.argmin(axis=0), np.arange(at.size)
    ray, rise = rays[flattest], np.maximum(steepness[flattest], np.sin(np.radians(GRAZING_DEG)))
    along = unit(ray - dot(ray, normal[at])[:, None] * normal[at])
    white[at] += (along[:, :, None] * along[:, None, :]) * ((rise - 1) / given[at])[:, None, None]
    return white


def _whitening(views: tuple[View, ...], middle: Array) -> Array:
    """(v, 6, 6) of the poses' covariances, or of what is usual at such a distance from the motion."""
    result = np.zeros((len(views), 6, 6))
    for i, view in enumerate(views):
        covariance = view.solved_covariance(float(norm(middle - view.path.reference.position)))
        result[i] = np.linalg.inv(np.linalg.cholesky(covariance))
    return result


def _reach_m(views: tuple[View, ...], seen: PixelObservations, middle: Array) -> float:
    """Distance from the cameras [m]: of such parts of each, which are of no other's, what their mean is off.

    What is taken for a view without a covariance holds this error already.
    """
    used = [views[i] for i in np.unique(seen.view)]
    away = [float(norm(middle - one.path.reference.position)) for one in used if one.pose_covariance is not None]
    return float(np.sqrt(np.square(away).sum())) / max(len(used), 1)


def _frame_s(views: tuple[View, ...], seen: PixelObservations) -> float:
    """Shortest usual interval between the frames of a view, on the common clock [s]."""
    intervals = []
    for i, view in enumerate(views):
        times = np.unique(seen.time_s[seen.view == i])
        if times.size > 1:
            intervals.append(float(np.median(np.diff(times))) * (1 + view.clock.drift) * view.clock.rate)
    return min(intervals, default=1 / 30)


def _pixel_sigmas(views: tuple[View, ...], seen: PixelObservations, middle: Array) -> Array:
    """(m,) of the pixels together with what is not known of each frame's pose [px]."""
    variance = seen.sigma_px**2
    for i, view in enumerate(views):
        path, mine = view.path, seen.view == i
        if not mine.any():
            continue
        distance = max(float(norm(middle - path.reference.position)), 1e-3)
        focal = (path.reference.fx + path.reference.fy) / 2
        turn = np.interp(seen.time_s[mine], path.time_s, path.sigma_rotation)
        shift = np.interp(seen.time_s[mine], path.time_s, path.sigma_position_m)
        variance[mine] += focal**2 * (turn**2 + (shift / distance) ** 2)
    return np.sqrt(variance)


def _block_sizes(
    ground: Ground,
    views: tuple[View, ...],
    seen: PixelObservations,
    nodes: Indices,
    centre: Array,
    position: Array,
) -> Array:
    """(m,) diameter of the block in the image [px], at the distance of the marked motion."""
    focal = np.array([(view.path.reference.fx + view.path.reference.fy) / 2 for view in views])
    common = np.empty(len(seen))
    for i, view in enumerate(views):
        common[seen.view == i] = view.clock.to_common(seen.time_s[seen.view == i])
    size = np.empty(len(seen))
    for name in np.unique(seen.trajectory):
        rows, own = np.flatnonzero(seen.trajectory == name), np.flatnonzero(ground.picks.trajectory[nodes] == name)
        time = ground.picks.time_s[nodes[own]]
        place = np.stack([np.interp(common[rows], time, centre[own, axis]) for axis in range(3)], axis=1)
        size[rows] = 2 * ground.radius_m[nodes[own[0]]] / np.maximum(norm(place - position[rows]), 1e-3)
    return size * focal[seen.view]


def _check_overlap(picks: Picks, views: tuple[View, ...], seen: PixelObservations, joined: set[str]) -> None:
    for name in np.unique(seen.trajectory):
        mine = seen.trajectory == name
        marked = picks.time_s[(picks.trajectory == name) & (picks.status != "discarded")]
        if name not in joined:
            raise InputError(
                "A trajectory needs two picks or more that nothing interrupts to be fitted to pixels",
                trajectory=str(name),
                advice="Mark the impacts before and after the flight",
            )
        for i in np.unique(seen.view[mine]):
            times = np.asarray(views[i].clock.to_common(seen.time_s[mine & (seen.view == i)]))
            if times.max() < marked.min() or times.min() > marked.max():
                raise InputError(
                    f"The clocks do not overlap: the picks run from {marked.min():.3f} to {marked.max():.3f} s, the "
                    f"pixels of view {views[i].name} from {times.min():.3f} to {times.max():.3f} s on the common clock",
                    trajectory=str(name),
                    advice="Correct the offset of the view's clock",
                )
