# SPDX-License-Identifier: GPL-3.0-or-later
"""What refinement found: picks, impacts with their standard deviations, and residuals."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ...camera.model import rotation_from_vector
from ...constants import SAME_TIME_S
from ...remarks import Remark
from ...vectors import Array, Mask
from ..block import Block
from ..choices import FlightEnds
from ..drag import Drag
from ..intervals import ImpactErrors, impact_intervals, impact_sigmas
from ..node_motion import places_at
from ..picks import Picks
from ..placement import GroundNormals, pick_normals
from ..trajectory import Reconstruction, reconstruct
from ..uncertainty import ERRORS
from .advice import remarks_on
from .deviations import Fit, centre_rows, velocity_rows
from .ground_errors import terrain_tilt
from .problem import NODE, evaluate
from .reliability import Statement, on_statements, reliability
from .setup import Ground
from .views import PixelObservations, View
from .what_if import WhatIf, on_drag, what_if


@dataclass(frozen=True, eq=False)
class Refinement:
    """The result of `refine`.

    Attributes
    ----------
    picks : as given, with the refined times, places (a radius below the centre along the normal: on the terrain but
        for its roughness), normals and standard deviations; a pass lies on its flight.
    reconstruction : of these picks, its flights those of the block's centre. The standard deviations of its impacts
        and their intervals come from the covariance of the fit and from what is not known of the terrain's normal.
    views : with the refined poses and clocks.
    residual_px : (m, 2) observed less fitted [px]; NaN for pixels outside of the marked motion.
    outlier : (m,) pixels that do not belong.
    rmse_px_before, rmse_px : root mean square length of the residuals, of the marked and of the fitted motion, outliers
        left out of the latter [px].
    rmse_px_by_view : (v,) of the fitted motion [px]; NaN for a view without pixels.
    noise_scale : by how much the residuals are larger than stated, and by which the standard deviations of the pixels
        (of everything, where these do not explain it) were enlarged; 1 where they are not. The largest of all
        trajectories.
    aim : by the names of view and trajectory, where the tracked spot lies off the block's centre in the image (u, v),
        and its standard deviations, in parts of the block's diameter; empty where it was not sought.
    unknowns : fitted values with their standard deviations: gravity_mps2, drag_coefficient, "offset_s NAME",
        "drift NAME".
    what_if : what would change if an input were otherwise.
    statements : what was stated against the pixels, and how large an error of it they would not show.
    iterations : the most that a trajectory took.
    converged : every search has come to its end.
    remarks : on where it rests on little, and what does not fit; about the trajectory or the clock.
    """

    picks: Picks
    reconstruction: Reconstruction
    views: tuple[View, ...]
    residual_px: Array
    outlier: Mask
    rmse_px_before: float
    rmse_px: float
    rmse_px_by_view: Array
    noise_scale: float
    aim: Mapping[tuple[str, str], tuple[Array, Array]]
    unknowns: Mapping[str, tuple[float, float]]
    what_if: tuple[WhatIf, ...]
    statements: tuple[Statement, ...]
    iterations: int
    converged: bool
    remarks: tuple[Remark, ...]


def summarise(
    ground: Ground,
    views: tuple[View, ...],
    observations: PixelObservations,
    fits: Sequence[Fit],
    *,
    block: Block | Mapping[str, Block],
    drag: Drag | None,
    gravity_mps2: float,
    normal_radius_m: float | None,
    free: frozenset[str],
    site: str,
) -> Refinement:
    """Make the result of the solved problems."""
    picks, normals = _refined_picks(ground, fits, normal_radius_m)
    columns, state = fits[0].setup.problem.columns, fits[0].solution.state
    if columns.law[0] >= 0 and drag is not None:
        drag = replace(drag, coefficient=max(state.coefficient, 0.0))
    fitted_gravity = state.gravity if columns.law[1] >= 0 else gravity_mps2
    on_ground = np.isfinite(normals.normal[:, 0]) | ~np.isin(picks.kind, ("impact", "contact", "stop", "takeoff"))
    ends: FlightEnds = "centres" if bool(on_ground[picks.status != "discarded"].all()) else "contacts"
    made = reconstruct(
        picks, surface=ground.surface, block=block, gravity_mps2=fitted_gravity, drag=drag,
        normal_radius_m=normal_radius_m, site=site, flights=ends,
    )  # fmt: skip
    made = _with_sigmas(made, fits, normals, ground.sigma_terrain_m)

    m = len(observations)
    residual, before, outlier = np.full((m, 2), np.nan), np.full((m, 2), np.nan), np.zeros(m, dtype=np.bool_)
    for fit in fits:
        problem, end = fit.setup.problem, fit.solution.evaluation
        start = evaluate(problem, fit.setup.state)
        for target, found in ((residual, end), (before, start)):
            used = found.segment >= 0
            target[fit.setup.rows[used]] = (found.pixels.residual * problem.sigma_px[:, None])[used]
        outlier[fit.setup.rows] = fit.solution.outlier
    good = ~outlier
    what, statements = what_if(fits, made.impacts, ground.sigma_terrain_m), reliability(fits)
    by_view = [_rms(residual[good & (observations.view == i)]) for i in range(len(views))]
    return Refinement(
        picks=picks,
        reconstruction=made,
        views=_refined_views(views, fits[0], posed="camera" in free, alone=len(fits) == 1),
        residual_px=residual,
        outlier=outlier,
        rmse_px_before=_rms(before),
        rmse_px=_rms(residual[good]),
        rmse_px_by_view=np.array(by_view),
        noise_scale=max(fit.scale * fit.setup.noise for fit in fits),
        aim={key: value for fit in fits for key, value in _aim(views, fit).items()},
        unknowns=_unknowns(views, fits[0]),
        what_if=what,
        statements=statements,
        iterations=max(fit.solution.iterations for fit in fits),
        converged=all(fit.solution.settled for fit in fits),
        remarks=(
            *remarks_on(ground, views, observations, residual, outlier, fits),
            *on_statements(statements),
            *on_drag(what),
        ),
    )


def _rms(residual: Array) -> float:
    finite = residual[np.isfinite(residual[:, 0])]
    return float(np.sqrt((finite**2).sum(axis=1).mean())) if len(finite) else float("nan")


def _refined_picks(ground: Ground, fits: Sequence[Fit], normal_radius_m: float | None) -> tuple[Picks, GroundNormals]:
    picks = ground.picks
    position, time = picks.position.copy(), picks.time_s.copy()
    sigma_time, sigma_place = picks.sigma_time_s.copy(), picks.sigma_position_m.copy()
    on_node = np.zeros(len(picks), dtype=np.bool_)
    for fit in fits:
        nodes, n = fit.setup.nodes, fit.setup.nodes.size
        position[nodes], time[nodes] = fit.solution.state.centre, fit.solution.state.time_s
        variance = np.diag(fit.covariance)[: NODE * n].reshape(n, NODE)
        sigma_time[nodes] = np.sqrt(variance[:, 3])
        sigma_place[nodes] = np.sqrt(variance[:, :3].mean(axis=1))
        on_node[nodes] = True
        _passes_on_flights(fit, time, position)

    known = np.isfinite(ground.normals.normal[:, 0]) & on_node
    anew = known & np.isnan(picks.normal[:, 0])
    normals = ground.normals
    if anew.any() and ground.surface is not None:
        touching = replace(picks, position=position, sigma_position_m=sigma_place)
        found = pick_normals(touching, ground.surface, 2 * ground.radius_m, normal_radius_m, anew)
        normals = normals.with_rows(anew, found.take(anew))
    position[known] -= ground.radius_m[known, None] * normals.normal[known]
    refined = replace(
        picks,
        position=position,
        time_s=time,
        sigma_time_s=sigma_time,
        sigma_position_m=sigma_place,
        normal=np.where(known[:, None], normals.normal, picks.normal),
    )
    return refined, normals


def _passes_on_flights(fit: Fit, time: Array, position: Array) -> None:
    """Move the passes between nodes onto their flights, within the time of the flight."""
    setup, motion = fit.setup, fit.solution.evaluation.motion
    first = setup.segments.first_pick[setup.chosen]
    last = setup.segments.last_pick[setup.chosen]
    for segment in np.flatnonzero(last - first > 1):
        between = np.arange(first[segment] + 1, last[segment])
        room = np.arange(1, between.size + 1) * 2 * SAME_TIME_S
        time[between] = np.clip(time[between], time[first[segment]] + room, time[last[segment]] - room[::-1])
        position[between] = places_at(motion, np.full(between.size, segment), time[between]).position


def _with_sigmas(
    made: Reconstruction, fits: Sequence[Fit], normals: GroundNormals, sigma_terrain_m: float
) -> Reconstruction:
    impacts = made.impacts
    own = np.flatnonzero(made.picks.kind == "impact")
    covariance = np.full((own.size, ERRORS, ERRORS), np.nan)
    tilt = normals.tilt[own]
    for fit in fits:
        problem, motion = fit.setup.problem, fit.solution.evaluation.motion
        node, leaving = fit.setup.node_of[own], fit.setup.node_of[made.picks.leaves_at[own]]
        mine = np.flatnonzero(node >= 0)
        before, after = np.full(fit.setup.nodes.size, -1), np.full(fit.setup.nodes.size, -1)
        flying = np.flatnonzero(~problem.contact)
        before[problem.last[flying]] = after[problem.first[flying]] = flying
        slope = np.concatenate(
            [
                velocity_rows(problem, motion, before[node[mine]], at_end=True),
                velocity_rows(problem, motion, after[leaving[mine]], at_end=False),
                centre_rows(problem, node[mine]),
            ],
            axis=1,
        )
        covariance[mine] = slope @ fit.covariance @ np.swapaxes(slope, 1, 2)
        accuracy = problem.ground.tilting_scale * np.nan_to_num(sigma_terrain_m)
        tilt[mine] = np.hypot(tilt[mine], terrain_tilt(accuracy, 2 * normals.radius_m[own[mine]]))
    given = np.isnan(impacts.normal_spread)
    spread = np.where(given, normals.spread[own], impacts.normal_spread)
    impacts = replace(
        impacts,
        normal_spread=spread,
        normal_radius_m=np.where(given, normals.radius_m[own], impacts.normal_radius_m),
    )
    errors = ImpactErrors(covariance, normals.by_place[own], tilt)
    v1, v2, normal = impacts.v1, impacts.v2, impacts.normal
    sigma = impact_sigmas(impacts, v1, v2, normal, impacts.mass_kg, errors)
    intervals = impact_intervals(impacts, v1, v2, normal, errors)
    fitted = np.isfinite(covariance[:, 0, 0])
    for made_here, propagated in ((sigma, impacts.sigma), (intervals, impacts.intervals)):
        for name, column in propagated.items():  # of trajectories without pixels
            made_here[name] = np.where(fitted if column.ndim == 1 else fitted[:, None], made_here[name], column)
    return replace(made, impacts=replace(impacts, sigma=sigma, intervals=intervals))


def _refined_views(views: tuple[View, ...], fit: Fit, *, posed: bool, alone: bool) -> tuple[View, ...]:
    """All shared unknowns are in the first problem, which is then the only one."""
    state, columns = fit.solution.state, fit.setup.problem.columns
    refined = []
    for i, view in enumerate(views):
        path, pose = view.path, columns.pose[i]
        clock = replace(
            fit.setup.problem.views[i].clock if alone else view.clock,
            offset_s=view.clock.offset_s + float(state.offset_s[i]),
            drift=view.clock.drift + float(state.drift[i]),
        )
        if pose[0] < 0 or not posed:
            refined.append(replace(view, clock=clock))
            continue
        reference = path.reference.rotation
        turned = rotation_from_vector(state.turn[i]) @ reference
        camera = replace(path.reference, rotation=turned, position=path.reference.position + state.move[i])
        moved = replace(
            path,
            reference=camera,
            position=path.position + state.move[i],
            rotation=path.rotation @ reference.T @ turned,
        )
        covariance = fit.covariance[np.ix_(pose, pose)]
        refined.append(replace(view, path=moved, clock=clock, pose_covariance=covariance))
    return tuple(refined)


def _aim(views: tuple[View, ...], fit: Fit) -> dict[tuple[str, str], tuple[Array, Array]]:
    aim, columns = fit.solution.state.aim, fit.setup.problem.columns.aim
    deviation = np.sqrt(np.diag(fit.covariance))
    return {
        (views[i].name, fit.setup.names[j]): (aim[i, j], deviation[columns[i, j]])
        for i, j in np.argwhere(columns[:, :, 0] >= 0)
    }


def _unknowns(views: tuple[View, ...], fit: Fit) -> dict[str, tuple[float, float]]:
    columns, state, variance = fit.setup.problem.columns, fit.solution.state, np.diag(fit.covariance)
    found: dict[str, tuple[float, float]] = {}
    for name, column, value in (
        ("drag_coefficient", columns.law[0], state.coefficient),
        ("gravity_mps2", columns.law[1], state.gravity),
    ):
        if column >= 0:
            found[name] = (value, float(np.sqrt(variance[column])))
    for i, view in enumerate(views):
        for name, column, value in (
            ("offset_s", columns.clock[i, 0], view.clock.offset_s + float(state.offset_s[i])),
            ("drift", columns.clock[i, 1], view.clock.drift + float(state.drift[i])),
        ):
            if column >= 0:
                found[f"{name} {view.name}"] = (value, float(np.sqrt(variance[column])))
    return found
