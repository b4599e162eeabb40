# SPDX-License-Identifier: GPL-3.0-or-later
"""What a user should know about a refinement: where it rests on little, and what does not fit."""

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from ...least_squares import inverse
from ...remarks import Remark
from ...vectors import Array, Mask, dot, norm, unit
from ..triangulation import GRAZING_DEG
from .assumptions import on_assumptions
from .contact_pixels import while_landed
from .deviations import Fit, velocity_rows
from .faults import in_words
from .mending import unseen_ground
from .problem import CLOCK_COLUMN, NODE, solve_segments
from .setup import Ground, Setup
from .solver import normal_equations
from .views import PixelObservations, View

PULLED = 3.0
"""A time that moves by more standard deviations than this contradicts its pick."""
HELD = 0.7
"""A time whose standard deviation stays above this part of the marked one rests on the mark for the most part."""
CLOCK_SIGNIFICANCE = 6.0
NOT_SYNCHRONISED_S = 0.1
"""A clock that is off by more has not been set by events, however these were marked."""
MANY = 0.1
"""Outliers above this part of the pixels are more than slips of a tracker."""
IN_A_ROW = 5
"""Outliers one after the other: the motion between two picks is another one, as when an impact is missing."""
MOST_TIMES = 3
GONE_M = 0.3
"""What may be gone of the ground at a contact since it was scanned, for which it is said where it passes unseen."""
UNLIKELY = 0.05
"""Chance below which another solution is not spoken of."""


def remarks_on(
    ground: Ground,
    views: Sequence[View],
    observations: PixelObservations,
    residual: Array,
    outlier: Mask,
    fits: Sequence[Fit],
) -> tuple[Remark, ...]:
    """Remarks on solved problems, what does not fit first; residual (m, 2) is NaN for pixels that were not used."""
    late = [remark for fit in fits for remark in _late_views(fit)]
    remarks = [remark for remark in late if remark.severity == "warning"]  # which is what the pixels then do not fit by
    remarks += [remark for fit in fits for remark in _faults(fit, alone=len(fits) == 1)]
    remarks += [*_outliers(views, observations, residual, outlier), *on_assumptions(ground, views, fits)]
    seen = set(observations.trajectory.tolist())
    for name in dict.fromkeys(ground.picks.trajectory.tolist()):
        if name not in seen:
            remarks.append(Remark(f"Trajectory {name} has no pixels: its picks are as they were.", "note", name))
    landed = while_landed(ground.picks, views, observations)
    if landed.any():
        text = f"{landed.sum()} pixels between landings and take-offs were not used: there, no block moves evenly."
        remarks.append(Remark(text, "note"))
    outside = int((np.isnan(residual[:, 0]) & ~landed).sum())
    if outside:
        text = (
            f"{outside} of {len(residual)} pixels lie outside of the marked motion and were not used: mark one pick "
            "further, impact or pass, on each side."
        )
        remarks.append(Remark(text, "advice", "pixels"))
    for fit in fits:
        remarks += [
            *_second_solutions(fit),
            *_on_the_search(fit),
            *_alike_from_frame_to_frame(fit),
            *_without_pixels(fit),
            *_pulled(fit),
            *_open_ends(fit),
            *_off_centre(fit),
            *_grazing(fit),
            *_unseen_ground(fit),
        ]
    return (*remarks, *(remark for remark in late if remark.severity != "warning"))


def _faults(fit: Fit, *, alone: bool) -> Iterator[Remark]:
    """What was found untrue of what was given; a wrong rate is said with gravity."""
    problem = fit.setup.problem
    for fault in fit.faults:
        if fault.kind == "ground":
            node = int(problem.grounded[int(fault.at)])
            yield Remark(
                in_words(problem, fault, _pick(fit, node), alone=alone), "warning", _trajectory(fit.setup, node)
            )
        elif fault.kind == "drag":
            yield Remark(in_words(problem, fault, "", alone=alone), "warning", "drag")
        elif fault.kind != "rate":
            yield Remark(in_words(problem, fault, "", alone=alone), "warning", f"view {problem.views[fault.view].name}")


def _joined(spans: Sequence[Array]) -> list[tuple[float, float]]:
    """Spans of time in their order, those that overlap as one."""
    joined: list[tuple[float, float]] = []
    for first, last in sorted((float(span[0]), float(span[1])) for span in spans):
        if joined and first <= joined[-1][1]:
            joined[-1] = (joined[-1][0], max(joined[-1][1], last))
        else:
            joined.append((first, last))
    return joined


def _outliers(
    views: Sequence[View], observations: PixelObservations, residual: Array, outlier: Mask
) -> Iterator[Remark]:
    """Trajectories of which many pixels do not fit, or several in a row."""
    used = np.isfinite(residual[:, 0])
    for name in dict.fromkeys(observations.trajectory.tolist()):
        own = used & (observations.trajectory == name)
        count = int((own & outlier).sum())
        runs = []
        for i, view in enumerate(views):
            rows = np.flatnonzero(own & (observations.view == i))
            rows = rows[np.argsort(observations.time_s[rows], kind="stable")]
            edges = np.flatnonzero(np.diff(np.r_[False, outlier[rows], False].astype(np.int8)))
            for begin, end in edges.reshape(-1, 2):
                if end - begin >= IN_A_ROW:
                    runs.append(np.sort(view.clock.to_common(observations.time_s[rows[[begin, end - 1]]])))
        if not runs and count <= MANY * own.sum():
            continue
        text = f"{count} of the {int(own.sum())} pixels of trajectory {name} do not fit its motion"
        if runs:
            times = [f"{first:.2f} to {last:.2f} s" for first, last in _joined(runs)[:MOST_TIMES]]
            text += f", all of those from {' and '.join(times)}: is an impact missing there? Pick it and refine again."
        else:
            text += ": look at the track and at the picks."
        yield Remark(text, "warning", name)


def _second_solutions(fit: Fit) -> Iterator[Remark]:
    """Trajectories whose likeliest motion is not the only one that the pixels and the terrain allow."""
    problem, state = fit.setup.problem, fit.solution.state
    for name in dict.fromkeys(rival.trajectory for rival in fit.rivals):
        own = [i for i, rival in enumerate(fit.rivals) if rival.trajectory == name and fit.chance[i] > UNLIKELY]
        if not own:
            continue
        rival = fit.rivals[max(own, key=lambda i: float(fit.chance[i]))]
        centre, time_s = state.centre.copy(), state.time_s.copy()
        centre[rival.nodes], time_s[rival.nodes] = rival.centre, rival.time_s
        other = solve_segments(problem, replace(state, centre=centre, time_s=time_s))
        faster = np.abs(norm(other.start_velocity) - norm(fit.solution.evaluation.motion.start_velocity))
        of_trajectory = problem.group == fit.setup.names.index(name)
        away = norm(centre - state.centre)
        node = int(np.argmax(away))
        count = "another solution" if len(own) == 1 else f"{len(own)} other solutions"
        text = (
            f"The pixels and the terrain allow {count} for trajectory {name} (chance "
            f"{100 * float(fit.chance[own].sum()):.0f} %): its {_kind_and_time(fit, node)} lies {away[node]:.1f} m off "
            f"there, and speeds are others by up to {faster[of_trajectory].max():.1f} m/s. The standard deviations "
            "contain it. Film from a second side, or give the place of a mark that is sure a standard deviation."
        )
        yield Remark(text, "warning", name)


def _on_the_search(fit: Fit) -> Iterator[Remark]:
    names, scale = fit.setup.names, fit.scale * fit.setup.noise
    about = names[0] if len(names) == 1 else ""
    if not fit.solution.settled:
        text = "the fit has not converged: check the picks with the largest changes."
        yield Remark(f"{_who(fit.setup)}: {text}", "warning", about)
    if scale > 1:
        text = (
            f"the residuals are {scale:.1f} times as large as the stated standard deviations allow, which were "
            "enlarged by this factor."
        )
        yield Remark(f"{_who(fit.setup)}: {text}", "note", about)


def _alike_from_frame_to_frame(fit: Fit) -> Iterator[Remark]:
    """Tracks that are off by about the same in neighbouring frames."""
    alike = [track for track in fit.tracks if track.correlation > 0]
    if not alike:
        return
    independent = np.diag(fit.independent)
    deviation = np.sqrt(np.diag(fit.covariance)[: independent.size] / np.maximum(independent, 1e-300))
    times = [float(np.median(deviation[track.columns])) for track in alike]
    least, most = min(track.correlation for track in alike), max(track.correlation for track in alike)
    text = (
        f"{_who(fit.setup)}: {len(alike)} of {len(fit.tracks)} tracks are off by about the same from frame to frame "
        f"(correlation {least:.2f}{'' if len(alike) == 1 else f' to {most:.2f}'}), or the flights are not those of "
        "gravity alone. The standard deviations contain it: they are "
        f"{float(np.median(times)):.1f} times as large as for independent pixels."
    )
    yield Remark(text, "note", fit.setup.names[0] if len(fit.setup.names) == 1 else "")


def _without_pixels(fit: Fit) -> Iterator[Remark]:
    problem, time = fit.setup.problem, fit.solution.state.time_s
    count = np.bincount(fit.solution.evaluation.segment[fit.solution.weight > 0], minlength=len(problem.first))
    for segment in np.flatnonzero((count == 0) & ~problem.contact):
        first, last = problem.first[segment], problem.last[segment]
        name = _trajectory(fit.setup, first)
        text = f"The flight from {time[first]:.3f} to {time[last]:.3f} s of trajectory {name} has no pixels: it rests "
        yield Remark(f"{text}on its picks.", "note", name)


def _pulled(fit: Fit) -> Iterator[Remark]:
    problem, time = fit.setup.problem, fit.solution.state.time_s
    for node in np.flatnonzero(np.abs(time - problem.time_s) > PULLED * problem.sigma_time_s):
        change = 1e3 * (time[node] - problem.time_s[node])
        text = f"The {_pick(fit, node)} was moved by {change:+.0f} ms, more than its time allows: check the pick."
        yield Remark(text, "warning", _trajectory(fit.setup, node))


def _open_ends(fit: Fit) -> Iterator[Remark]:
    """Trajectories whose motion ends in picks whose time neither pixels beyond them nor the terrain determine."""
    setup, problem = fit.setup, fit.setup.problem
    nodes = np.arange(setup.nodes.size)
    end = ~(np.isin(nodes, problem.first) & np.isin(nodes, problem.last)) & (setup.picks.kind[setup.nodes] != "pass")
    found = np.sqrt(np.diag(fit.covariance)[: NODE * nodes.size].reshape(-1, NODE)[:, 3])
    held = np.flatnonzero(end & (found > HELD * fit.scale * problem.sigma_time_s))
    owner = setup.picks.trajectory[setup.nodes[held]]
    for name in dict.fromkeys(owner.tolist()):
        times = [f"{time:.3f} s" for time in fit.solution.state.time_s[held[owner == name]]]
        text = (
            f"Where the motion of trajectory {name} begins or ends, at {' and '.join(times)}, little but the "
            "pick's own time holds it: mark one pick further, impact or pass, on each side."
        )
        yield Remark(text, "advice", name)


def _off_centre(fit: Fit) -> Iterator[Remark]:
    """Views in which what was tracked is hardly the block."""
    problem, aim = fit.setup.problem, fit.solution.state.aim
    if problem.sigma_aim == 0:
        return
    for i, j in np.argwhere(np.abs(aim).max(axis=2) > PULLED * problem.sigma_aim):
        name = fit.setup.names[j]
        text = (
            f"What was tracked of trajectory {name} in view {problem.views[i].name} lies "
            f"{100 * float(norm(aim[i, j])):.0f} % of the block's diameter off its centre: check the track, the "
            "camera, its clock and the block's size."
        )
        yield Remark(text, "warning", name)


def _grazing(fit: Fit) -> Iterator[Remark]:
    """Contacts that no view sees at more than a few degrees above the ground."""
    setup, problem, state = fit.setup, fit.setup.problem, fit.solution.state
    nodes = problem.grounded
    normal = setup.normals.normal[setup.nodes[nodes]]
    steepest = np.zeros(nodes.size)
    for i in np.unique(problem.view):
        place = problem.views[i].path.reference.position
        steepest = np.fmax(steepest, np.abs(dot(unit(state.centre[nodes] - place), normal)))
    for i in np.flatnonzero(steepest < np.sin(np.radians(GRAZING_DEG))):
        text = (
            f"The {_pick(fit, nodes[i])} is seen at {np.degrees(np.arcsin(steepest[i])):.0f}° above the ground: its "
            "place rests on the flights beside it."
        )
        yield Remark(text, "note", _trajectory(setup, nodes[i]))


def _unseen_ground(fit: Fit) -> Iterator[Remark]:
    """That a change of the ground at one contact could not be noticed, where it could not."""
    unseen = () if fit.mended is None else fit.mended.unseen
    if not unseen:
        return
    problem, motion = fit.setup.problem, fit.solution.evaluation.motion
    least, moved = unseen_ground(problem, fit.solution, fit.independent, unseen)
    if float(np.median(least)) < GONE_M:
        return
    flying, change = np.flatnonzero(~problem.contact), list[Array]()
    for at_end, velocity in ((False, motion.start_velocity[flying]), (True, motion.end_velocity[flying])):
        slope = velocity_rows(problem, motion, flying, at_end=at_end)[:, :, : len(moved)] @ moved
        change.append(np.einsum("ki,kic->kc", unit(velocity), slope) / norm(velocity)[:, None])
    most = GONE_M * np.abs(np.concatenate(change)).max(axis=0)
    text = (
        f"{_who(fit.setup)}: these views do not test the ground at a single contact. An error there is not detectable "
        f"below about {float(np.median(least)):.1f} m; {GONE_M:g} m would change a speed next to it by "
        f"{100 * float(np.median(most)):.1f} %. A view from another side detects it."
    )
    yield Remark(text, "note", fit.setup.names[0] if len(fit.setup.names) == 1 else "")


def _late_views(fit: Fit) -> Iterator[Remark]:
    """Views whose clock would be another if it were free, as one step of the search shows."""
    problem, solution = fit.setup.problem, fit.solution
    seen, size = np.unique(problem.view[solution.weight > 0]), problem.columns.size
    for i in seen[1:]:
        if problem.columns.clock[i, 0] >= 0:
            continue
        rows = solution.evaluation.pixels
        columns = rows.columns.copy()
        columns[problem.view == i, CLOCK_COLUMN] = size
        freed = replace(problem, columns=replace(problem.columns, size=size + 1))
        evaluation = replace(solution.evaluation, pixels=replace(rows, columns=columns))
        information, gradient = normal_equations(freed, evaluation, solution.weight)
        covariance = inverse(information, partly=True)
        late = -float(covariance[-1] @ gradient)
        if abs(late) > CLOCK_SIGNIFICANCE * fit.scale * float(np.sqrt(covariance[-1, -1])):
            name = problem.views[i].name
            text = f"{_who(fit.setup)}: the clock of view {name} seems to be off by about {1e3 * late:+.0f} ms: "
            if abs(late) > NOT_SYNCHRONISED_S:
                text += "synchronise it by the same event in each view, and refine again."
                yield Remark(text, "warning", f"clock {name}")
            else:
                yield Remark(f"{text}fit the clocks too.", "advice", f"clock {name}")


def _who(setup: Setup) -> str:
    return f"Trajectory {setup.names[0]}" if len(setup.names) == 1 else f"{len(setup.names)} trajectories"


def _trajectory(setup: Setup, node: int) -> str:
    return str(setup.picks.trajectory[setup.nodes[node]])


def _pick(fit: Fit, node: int) -> str:
    """A node's pick in words."""
    return f"{_kind_and_time(fit, node)} of trajectory {_trajectory(fit.setup, node)}"


def _kind_and_time(fit: Fit, node: int) -> str:
    return f"{fit.setup.picks.kind[fit.setup.nodes[node]]} at {fit.solution.state.time_s[node]:.3f} s"
