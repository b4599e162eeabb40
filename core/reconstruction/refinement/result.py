# SPDX-License-Identifier: GPL-3.0-or-later
"""What refinement found: picks, impacts with their standard deviations, residuals, and advice."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.stats import chi2

from ...camera.model import rotation_from_vector
from ...constants import SAME_TIME_S
from ...vectors import Array, Mask, dot, norm, unit
from ..block import Block
from ..choices import FlightEnds
from ..drag import Drag
from ..node_motion import places_at
from ..picks import Picks
from ..placement import GroundNormals, pick_normals
from ..trajectory import Reconstruction, reconstruct
from ..triangulation import GRAZING_DEG
from .deviations import impact_sigmas, velocity_rows
from .problem import CLOCK_COLUMN, NODE, evaluate
from .setup import Ground, Setup
from .solver import UNEXPLAINED, Solution, normal_equations
from .views import PixelObservations, View

PULLED = 3.0
HELD = 0.7
"""A time whose standard deviation stays above this part of the marked one is told by the mark for the most part."""
CLOCK_SIGNIFICANCE = 6.0


@dataclass(frozen=True, eq=False)
class Refinement:
    """The result of `refine`.

    Attributes
    ----------
    picks : as given, with the refined times, places (a radius below the centre along the normal: on the terrain but
        for its roughness), normals and standard deviations; a pass lies on its flight.
    reconstruction : of these picks, its flights those of the block's centre. The standard deviations of its impacts
        come from the covariance of the fit and from the spread of the terrain normal.
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
    iterations : the most that a trajectory took.
    advice : sentences.
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
    iterations: int
    advice: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class _Fit:
    """One solved problem: with the covariance (size, size) of its unknowns, and the scale of its noise."""

    setup: Setup
    solution: Solution
    covariance: Array
    scale: float


def summarise(
    ground: Ground,
    views: tuple[View, ...],
    observations: PixelObservations,
    setups: Sequence[Setup],
    solutions: Sequence[Solution],
    *,
    block: Block | Mapping[str, Block],
    drag: Drag | None,
    gravity_mps2: float,
    normal_radius_m: float | None,
    site: str,
) -> Refinement:
    """Make the result of the solved problems."""
    fits = [_fit(setup, solution) for setup, solution in zip(setups, solutions, strict=True)]
    picks, normals = _refined_picks(ground, fits, normal_radius_m)
    columns, state = fits[0].setup.problem.columns, fits[0].solution.state
    if columns.law[0] >= 0 and drag is not None:
        drag = replace(drag, coefficient=max(state.coefficient, 0.0))
    fitted_gravity = state.gravity if columns.law[1] >= 0 else gravity_mps2
    on_ground = np.isfinite(normals.normal[:, 0]) | ~np.isin(picks.kind, ("impact", "contact", "stop"))
    ends: FlightEnds = "centres" if bool(on_ground[picks.status != "discarded"].all()) else "contacts"
    made = reconstruct(
        picks, surface=ground.surface, block=block, gravity_mps2=fitted_gravity, drag=drag,
        normal_radius_m=normal_radius_m, site=site, flights=ends,
    )  # fmt: skip
    made = _with_sigmas(made, fits, normals)

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
    by_view = [_rms(residual[good & (observations.view == i)]) for i in range(len(views))]
    return Refinement(
        picks=picks,
        reconstruction=made,
        views=_refined_views(views, fits[0]),
        residual_px=residual,
        outlier=outlier,
        rmse_px_before=_rms(before),
        rmse_px=_rms(residual[good]),
        rmse_px_by_view=np.array(by_view),
        noise_scale=max(fit.scale * fit.setup.noise for fit in fits),
        aim={key: value for fit in fits for key, value in _aim(views, fit).items()},
        unknowns=_unknowns(views, fits[0]),
        iterations=max(fit.solution.iterations for fit in fits),
        advice=_advice(ground, observations, residual, fits),
    )


def _rms(residual: Array) -> float:
    finite = residual[np.isfinite(residual[:, 0])]
    return float(np.sqrt((finite**2).sum(axis=1).mean())) if len(finite) else float("nan")


def _fit(setup: Setup, solution: Solution) -> _Fit:
    """The covariance, enlarged when the residuals are larger than the stated noise allows."""
    used = solution.weight > 0
    pixels = solution.evaluation.pixels.residual[used]
    squares = float((solution.weight[used, None] * pixels**2).sum())
    count = 2 * int(used.sum())
    for rows in solution.evaluation.others:
        squares += float((rows.residual**2).sum())
        count += rows.residual.size
    spare = count - setup.problem.columns.size
    scale = 1.0
    if spare > 0 and squares > chi2.ppf(UNEXPLAINED, spare):
        scale = float(np.sqrt(squares / spare))
    information = solution.information
    size = np.sqrt(np.diag(information))
    size[size == 0] = 1.0
    covariance = np.linalg.pinv(information / np.outer(size, size), hermitian=True) / np.outer(size, size)
    return _Fit(setup, solution, scale**2 * covariance, scale)


def _refined_picks(ground: Ground, fits: Sequence[_Fit], normal_radius_m: float | None) -> tuple[Picks, GroundNormals]:
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
        _settle_passes(fit, time, position)

    known = np.isfinite(ground.normals.normal[:, 0]) & on_node
    anew = known & np.isnan(picks.normal[:, 0])
    normals = GroundNormals(ground.normals.normal.copy(), ground.normals.radius_m.copy(), ground.normals.spread.copy())
    if anew.any() and ground.surface is not None:
        touching = replace(picks, position=position)
        found = pick_normals(touching, ground.surface, 2 * ground.radius_m, normal_radius_m, anew)
        for name in ("normal", "radius_m", "spread"):
            getattr(normals, name)[anew] = getattr(found, name)[anew]
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


def _settle_passes(fit: _Fit, time: Array, position: Array) -> None:
    """Put the passes between nodes onto their flights, within the time of the flight."""
    setup, motion = fit.setup, fit.solution.evaluation.motion
    first = setup.segments.first_pick[setup.chosen]
    last = setup.segments.last_pick[setup.chosen]
    for segment in np.flatnonzero(last - first > 1):
        between = np.arange(first[segment] + 1, last[segment])
        room = np.arange(1, between.size + 1) * 2 * SAME_TIME_S
        time[between] = np.clip(time[between], time[first[segment]] + room, time[last[segment]] - room[::-1])
        position[between] = places_at(motion, np.full(between.size, segment), time[between]).position


def _with_sigmas(made: Reconstruction, fits: Sequence[_Fit], normals: GroundNormals) -> Reconstruction:
    impacts = made.impacts
    own = np.flatnonzero(made.picks.kind == "impact")
    covariance = np.full((own.size, 6, 6), np.nan)
    for fit in fits:
        problem, motion = fit.setup.problem, fit.solution.evaluation.motion
        node = fit.setup.node_of[own]
        mine = np.flatnonzero(node >= 0)
        before, after = np.full(fit.setup.nodes.size, -1), np.full(fit.setup.nodes.size, -1)
        flying = np.flatnonzero(~problem.contact)
        before[problem.last[flying]] = after[problem.first[flying]] = flying
        slope = np.concatenate(
            [
                velocity_rows(problem, motion, before[node[mine]], at_end=True),
                velocity_rows(problem, motion, after[node[mine]], at_end=False),
            ],
            axis=1,
        )
        covariance[mine] = slope @ fit.covariance @ np.swapaxes(slope, 1, 2)
    given = np.isnan(impacts.normal_spread)
    spread = np.where(given, normals.spread[own], impacts.normal_spread)
    impacts = replace(
        impacts,
        normal_spread=spread,
        normal_radius_m=np.where(given, normals.radius_m[own], impacts.normal_radius_m),
    )
    sigma = impact_sigmas(impacts, covariance, spread)
    fitted = np.isfinite(covariance[:, 0, 0])
    for name, propagated in impacts.sigma.items():  # of trajectories without pixels
        sigma[name] = np.where(fitted if propagated.ndim == 1 else fitted[:, None], sigma[name], propagated)
    return replace(made, impacts=replace(impacts, sigma=sigma))


def _refined_views(views: tuple[View, ...], fit: _Fit) -> tuple[View, ...]:
    """All shared unknowns are in the first problem, which is then the only one."""
    state, columns = fit.solution.state, fit.setup.problem.columns
    refined = []
    for i, view in enumerate(views):
        path, pose = view.path, columns.pose[i]
        clock = replace(
            view.clock,
            offset_s=view.clock.offset_s + float(state.offset_s[i]),
            drift=view.clock.drift + float(state.drift[i]),
        )
        if pose[0] < 0:
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


def _aim(views: tuple[View, ...], fit: _Fit) -> dict[tuple[str, str], tuple[Array, Array]]:
    aim, columns = fit.solution.state.aim, fit.setup.problem.columns.aim
    deviation = np.sqrt(np.diag(fit.covariance))
    return {
        (views[i].name, _group_name(fit.setup, j)): (aim[i, j], deviation[columns[i, j]])
        for i, j in np.argwhere(columns[:, :, 0] >= 0)
    }


def _unknowns(views: tuple[View, ...], fit: _Fit) -> dict[str, tuple[float, float]]:
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


def _advice(ground: Ground, observations: PixelObservations, residual: Array, fits: Sequence[_Fit]) -> tuple[str, ...]:
    sentences: list[str] = []
    seen = set(observations.trajectory.tolist())
    for name in dict.fromkeys(ground.picks.trajectory.tolist()):
        if name not in seen:
            sentences.append(f"Trajectory {name} has no pixels: its picks are as they were.")
    outside = int(np.isnan(residual[:, 0]).sum())
    if outside:
        sentences.append(
            f"{outside} of {len(residual)} pixels lie outside of the marked motion and were not used: mark one pick "
            "further, impact or pass, on each side."
        )
    for fit in fits:
        sentences += _fit_advice(fit)
    return tuple(sentences)


def _fit_advice(fit: _Fit) -> list[str]:
    setup, solution, problem = fit.setup, fit.solution, fit.setup.problem
    picks, state = setup.picks, solution.state

    def at(node: int) -> str:
        return f"{picks.kind[setup.nodes[node]]} at {state.time_s[node]:.3f} s of trajectory {_name(setup, node)}"

    sentences: list[str] = []
    if not solution.settled:
        sentences.append(f"The fit of {_names(setup)} did not settle: check the picks with the largest changes.")
    scale = fit.scale * setup.noise
    if scale > 1:
        sentences.append(
            f"{_names(setup)}: the residuals are {scale:.1f} times as large as the stated standard deviations "
            "allow, which were enlarged by this factor."
        )
    count = np.bincount(solution.evaluation.segment[solution.weight > 0], minlength=len(problem.first))
    for segment in np.flatnonzero((count == 0) & ~problem.contact):
        start, end = state.time_s[problem.first[segment]], state.time_s[problem.last[segment]]
        sentences.append(
            f"The flight from {start:.3f} to {end:.3f} s of trajectory {_name(setup, problem.first[segment])} has no "
            "pixels: it rests on its picks."
        )
    pulled = np.abs(state.time_s - problem.time_s) > PULLED * problem.sigma_time_s
    for node in np.flatnonzero(pulled):
        change = 1e3 * (state.time_s[node] - problem.time_s[node])
        sentences.append(
            f"The {at(int(node))} was moved by {change:+.0f} ms, more than its time allows: check the pick."
        )
    sentences += _open_ends(fit) + _off_centre(fit) + _grazing(fit, at) + _late_views(fit)
    return sentences


def _open_ends(fit: _Fit) -> list[str]:
    """Trajectories whose motion ends in picks that no pixels beyond, and no terrain, tell the time of."""
    setup, problem = fit.setup, fit.setup.problem
    nodes = np.arange(setup.nodes.size)
    end = ~(np.isin(nodes, problem.first) & np.isin(nodes, problem.last)) & (setup.picks.kind[setup.nodes] != "pass")
    found = np.sqrt(np.diag(fit.covariance)[: NODE * nodes.size].reshape(-1, NODE)[:, 3])
    held = np.flatnonzero(end & (found > HELD * fit.scale * problem.sigma_time_s))
    owner = setup.picks.trajectory[setup.nodes[held]]
    sentences = []
    for name in dict.fromkeys(owner.tolist()):
        times = [f"{time:.3f} s" for time in fit.solution.state.time_s[held[owner == name]]]
        sentences.append(
            f"Where the motion of trajectory {name} begins or ends, at {' and '.join(times)}, little but the "
            "pick's own time holds it: mark one pick further, impact or pass, on each side."
        )
    return sentences


def _off_centre(fit: _Fit) -> list[str]:
    """Views in which what was tracked is hardly the block."""
    problem, aim = fit.setup.problem, fit.solution.state.aim
    far = np.argwhere(np.abs(aim).max(axis=2) > PULLED * problem.sigma_aim) if problem.sigma_aim > 0 else ()
    return [
        f"What was tracked of trajectory {_group_name(fit.setup, j)} in view {problem.views[i].name} lies "
        f"{100 * float(norm(aim[i, j])):.0f} % of the block's diameter off its centre: check the track, the camera, "
        "its clock and the block's size."
        for i, j in far
    ]


def _name(setup: Setup, node: int) -> str:
    return str(setup.picks.trajectory[setup.nodes[node]])


def _group_name(setup: Setup, group: int) -> str:
    return _name(setup, setup.problem.first[np.argmax(setup.problem.group == group)])


def _names(setup: Setup) -> str:
    names = list(dict.fromkeys(setup.picks.trajectory[setup.nodes].tolist()))
    return f"Trajectory {names[0]}" if len(names) == 1 else f"{len(names)} trajectories"


def _grazing(fit: _Fit, at: Callable[[int], str]) -> list[str]:
    """Contacts that no view sees at more than a few degrees above the ground."""
    setup, problem, state = fit.setup, fit.setup.problem, fit.solution.state
    nodes = problem.grounded
    normal = setup.normals.normal[setup.nodes[nodes]]
    steepest = np.zeros(nodes.size)
    for i in np.unique(problem.view):
        place = problem.views[i].path.reference.position
        steepest = np.fmax(steepest, np.abs(dot(unit(state.centre[nodes] - place), normal)))
    found = np.flatnonzero(steepest < np.sin(np.radians(GRAZING_DEG)))
    return [
        f"The {at(int(nodes[i]))} is seen at {np.degrees(np.arcsin(steepest[i])):.0f}° above the ground: its place "
        "rests on the flights beside it."
        for i in found
    ]


def _late_views(fit: _Fit) -> list[str]:
    """Views whose clock would be another if it were free, as one step of the search tells."""
    problem, solution = fit.setup.problem, fit.solution
    seen, size = np.unique(problem.view[solution.weight > 0]), problem.columns.size
    sentences: list[str] = []
    for i in seen[1:]:
        if problem.columns.clock[i, 0] >= 0:
            continue
        rows = solution.evaluation.pixels
        columns = rows.columns.copy()
        columns[problem.view == i, CLOCK_COLUMN] = size
        freed = replace(problem, columns=replace(problem.columns, size=size + 1))
        evaluation = replace(solution.evaluation, pixels=replace(rows, columns=columns))
        information, gradient = normal_equations(freed, evaluation, solution.weight)
        scale = np.sqrt(np.diag(information))
        scale[scale == 0] = 1.0
        inverse = np.linalg.pinv(information / np.outer(scale, scale), hermitian=True) / np.outer(scale, scale)
        late = -float(inverse[-1] @ gradient)
        if abs(late) > CLOCK_SIGNIFICANCE * fit.scale * float(np.sqrt(inverse[-1, -1])):
            sentences.append(
                f"{_names(fit.setup)}: the clock of view {problem.views[i].name} seems to be off by about "
                f"{1e3 * late:+.0f} ms: fit the clocks too."
            )
    return sentences
