# SPDX-License-Identifier: GPL-3.0-or-later
"""What if something that the fit takes for known were otherwise: by how much speeds and R would change."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ...least_squares import damped_step
from ...remarks import Remark
from ...vectors import Array, Indices, cross, dot, norm, unit
from ..drag import Drag
from ..impact import Impacts
from ..node_motion import NodeMotion
from .accelerations import LIFT
from .deviations import Fit
from .problem import Problem, Unknowns, common_times, evaluate, moved
from .setup import SHAPE
from .solver import Solution, normal_equations

CAMERA_M, READOUT_S, DIAMETER = 0.3, 0.02, 0.2
"""By how much they are changed: the camera's place, the rolling shutter, the block's diameter as a part of it."""
STATED = "stated deviation"
"""What the rows are about that hold the standard deviations of the impacts, to compare the others with."""
WITH_DRAG = "With air drag"
MATTERS = 0.5
"""What changes speeds by this part of their deviation makes 95 % intervals hold in 92 % of the cases, and is said."""
STEPS = 2
"""Of Gauss and Newton from the fit: the first is what its derivatives tell, the second what is not linear."""


@dataclass(frozen=True)
class WhatIf:
    """What a change of an input would do to a trajectory.

    Attributes
    ----------
    about : what is changed; change : how, in words.
    trajectory : name.
    speed_percent, most_speed_percent : of the incident and restituted speeds, the median change and the largest one.
    r, most_r : the same of R.
    """

    about: str
    change: str
    trajectory: str
    speed_percent: float
    most_speed_percent: float
    r: float
    most_r: float

    @property
    def cells(self) -> tuple[str, str, str, str, str]:
        """The change and what it does, as text for people: of speeds and of R, each the median and the most."""
        sign = "" if self.about == STATED else "+"
        percent = (f"{value:{sign}z.2f} %" for value in (self.speed_percent, self.most_speed_percent))
        parts = ("–" if np.isnan(value) else f"{value:{sign}z.4f}" for value in (self.r, self.most_r))
        speed, most_speed, r, most_r = (text.replace("-", "−") for text in (*percent, *parts))
        return self.change, speed, most_speed, r, most_r


@dataclass(frozen=True, eq=False)
class _Change:
    """A changed problem, where to begin, and what is added to the velocities at the ends of its flights, (k, 3)."""

    about: str
    words: str
    problem: Problem
    state: Unknowns
    at_end: Array | float = 0.0


def what_if(fits: Sequence[Fit], impacts: Impacts, sigma_terrain_m: float) -> tuple[WhatIf, ...]:
    """What would change if an input were otherwise, for each trajectory; an opposite change has the opposite effect.

    The stated deviations of the same numbers come first.

    Parameters
    ----------
    impacts : of these fits, with their deviations.
    sigma_terrain_m : by how much the terrain is raised [m].

    Notes
    -----
    The fit is not made anew from the start: Gauss and Newton's steps on the changed problem, from its solution, with
    the same pixels counting as much as they do there. That is what the derivatives of the fit tell, where they are
    linear. What is an unknown of the fit itself answers to a change of its prior.
    """
    rows = [_stated(impacts, name) for fit in fits for name in fit.setup.names]
    for fit in fits:
        problem, solution = fit.setup.problem, fit.solution
        before, after = flights_at_impacts(fit)
        unchanged = _refitted(_Change("", "", problem, solution.state), solution)
        if unchanged is None:
            continue
        speeds = _speeds(unchanged, before, after, 0.0)
        group = problem.group[np.maximum(before, after)]
        for change in _changes(fit, sigma_terrain_m):
            motion = _refitted(change, solution)
            if motion is None:
                continue
            changed = _speeds(motion, before, after, change.at_end)
            for number, name in enumerate(fit.setup.names):
                rows.append(_row(change, name, speeds[group == number], changed[group == number]))
    return tuple(row for row in rows if np.isfinite(row.speed_percent))


def gravest(rows: Sequence[WhatIf]) -> list[WhatIf]:
    """For each thing that is changed, and each change of it that changes a speed the most: over all trajectories.

    Of several changes of the same thing, such as the directions in which a camera is moved, the gravest stands alone.
    """
    found = []
    for about in dict.fromkeys(row.about for row in rows):
        own = [row for row in rows if row.about == about]
        worst = max(own, key=lambda row: abs(row.most_speed_percent))
        alike = [row for row in own if row.change == worst.change]
        most_r = max((row.most_r for row in alike), key=lambda value: -1.0 if np.isnan(value) else abs(value))
        medians = [np.array([getattr(row, name) for row in alike]) for name in ("speed_percent", "r")]
        speed, r = (float(np.nanmedian(each)) if np.isfinite(each).any() else np.nan for each in medians)
        found.append(replace(worst, speed_percent=speed, r=r, most_r=most_r))
    return found


def on_drag(rows: Sequence[WhatIf]) -> Iterator[Remark]:
    """Advice where air drag was left out and would matter beside the stated deviations."""
    found = {row.about: row for row in gravest(rows)}
    drag, stated = found.get("drag"), found.get(STATED)
    if drag is None or stated is None or drag.change != WITH_DRAG:
        return
    pairs = (
        (drag.speed_percent, stated.speed_percent),
        (drag.most_speed_percent, stated.most_speed_percent),
        (drag.r, stated.r),
    )
    if any(abs(change) > MATTERS * deviation for change, deviation in pairs):
        text = (
            f"Air drag is left out: with it speeds would change by {drag.cells[2]} at most and R by {drag.cells[3]} "
            f"(median), where their deviations are {stated.cells[2]} and {stated.cells[3]}. Switch it on where "
            "the block is known."
        )
        yield Remark(text, "advice", "drag")


def _stated(impacts: Impacts, name: str) -> WhatIf:
    """The deviations of the speeds, from those of the energies ½mv², and of R."""
    own, none = impacts.trajectory == name, np.full(len(impacts), np.nan)
    percent = []
    for velocity, energy in ((impacts.v1, "kinetic1_j"), (impacts.v2, "kinetic2_j")):
        percent.append((100 * impacts.sigma.get(energy, none) / (impacts.mass_kg * dot(velocity, velocity)))[own])
    r = impacts.sigma.get("r", none)[own]
    return WhatIf(STATED, "Deviation as stated", name, *_median_and_most(np.concatenate(percent)), *_median_and_most(r))


def _row(change: _Change, name: str, speeds: Array, changed: Array) -> WhatIf:
    """Of the impacts (q, 2) of a trajectory."""
    percent = 100 * (changed / speeds - 1).ravel()
    r = changed[:, 1] / changed[:, 0] - speeds[:, 1] / speeds[:, 0]
    return WhatIf(change.about, change.words, name, *_median_and_most(percent), *_median_and_most(r))


def _median_and_most(values: Array) -> tuple[float, float]:
    known = values[np.isfinite(values)]
    return (float(np.median(known)), float(known[np.abs(known).argmax()])) if known.size else (np.nan, np.nan)


def flights_at_impacts(fit: Fit) -> tuple[Indices, Indices]:
    """(q,) flights that end and that begin at each impact with one of them; −1 for none."""
    problem, setup = fit.setup.problem, fit.setup
    before, after = np.full(setup.nodes.size, -1), np.full(setup.nodes.size, -1)
    flying = np.flatnonzero(~problem.contact)
    before[problem.last[flying]] = after[problem.first[flying]] = flying
    leaving = setup.node_of[setup.picks.leaves_at[setup.nodes]]
    after = after[leaving]
    chosen = (setup.picks.kind[setup.nodes] == "impact") & ((before >= 0) | (after >= 0))
    return before[chosen], after[chosen]


def _speeds(motion: NodeMotion, before: Indices, after: Indices, at_end: Array | float) -> Array:
    """(q, 2) incident and restituted speeds; NaN where there is no flight."""
    ends = norm(motion.end_velocity + at_end)[before], norm(motion.start_velocity - at_end)[after]
    return np.stack([np.where(before >= 0, ends[0], np.nan), np.where(after >= 0, ends[1], np.nan)], axis=1)


def _refitted(change: _Change, solution: Solution) -> NodeMotion | None:
    """The motion that fits the changed problem; None where there is none."""
    problem, state, segment = change.problem, change.state, solution.evaluation.segment
    chain = np.where(segment >= 0, problem.chain[segment], -1)
    for _ in range(STEPS):
        here = evaluate(problem, state, chain)
        if not here.valid:
            return None
        information, gradient = normal_equations(problem, here, solution.weight)
        state = moved(problem, state, -damped_step(information, gradient))
    here = evaluate(problem, state, chain)
    return here.motion if here.valid else None


def _changes(fit: Fit, sigma_terrain_m: float) -> Iterator[_Change]:
    problem, state = fit.setup.problem, fit.solution.state
    for i, view in enumerate(problem.views):
        mine = problem.view == i
        if not mine.any():
            continue
        up, (x, y, _) = np.array([0.0, 0.0, 1.0]), view.path.reference.rotation[2]
        forward = np.array([x, y, 0.0]) / max(float(np.hypot(x, y)), 1e-9)
        for words, direction in (("higher", up), ("nearer", forward), ("to its right", np.cross(forward, up))):
            moved_by = np.where(mine[:, None], CAMERA_M * direction, 0.0)
            name = f"Camera of {view.name} {CAMERA_M:g} m {words}"
            yield _Change(f"camera of {view.name}", name, replace(problem, position=problem.position + moved_by), state)
    if problem.surface is not None and problem.grounded.size:
        raised = replace(problem, radius_m=problem.radius_m + sigma_terrain_m)
        yield _Change("terrain", f"Terrain {100 * sigma_terrain_m:.2g} cm higher", raised, state)
    yield _Change("rolling shutter", f"Rolling shutter {1e3 * READOUT_S:g} ms slower", _slower_readout(problem), state)
    less_round = (SHAPE * problem.radius_m) ** 2 * ((1 + DIAMETER) ** 2 - 1)
    larger = replace(
        problem,
        ground=problem.ground.with_contact(np.sqrt(problem.ground.contact_m**2 + less_round)),
        radius_m=(1 + DIAMETER) * problem.radius_m,
        block_px=(1 + DIAMETER) * problem.block_px,
        reference_drag=problem.reference_drag / (1 + DIAMETER),
    )
    yield _Change("diameter", f"Block {100 * DIAMETER:g} % larger", larger, state)
    if problem.columns.law[0] < 0:
        with_drag = state.coefficient > 0
        other = replace(state, coefficient=0.0 if with_drag else Drag().coefficient)
        yield _Change("drag", "Without air drag" if with_drag else WITH_DRAG, problem, other)
    yield _spinning(problem, fit.solution)


def _slower_readout(problem: Problem) -> Problem:
    """Rows that are exposed later, the more the lower they are in the picture."""
    late = np.zeros_like(problem.video_s)
    for i, view in enumerate(problem.views):
        mine, height = problem.view == i, view.path.reference.height
        pace = view.clock.rate * (1 + view.clock.drift)
        late[mine] = READOUT_S * (problem.pixel[mine, 1] / height - 0.5) / pace
    return replace(problem, video_s=problem.video_s + late)


def _spinning(problem: Problem, solution: Solution) -> _Change:
    """Blocks that turn in flight as if they rolled: the Magnus force presses them down.

    An acceleration a, taken as even over a flight of the duration T between fixed ends, moves it by a(s² − sT)/2, which
    is taken off the pixels, and its velocities by −aT/2 at the start and aT/2 at the end.
    """
    evaluation = solution.evaluation
    motion = evaluation.motion
    way = motion.displacement / motion.duration_s[:, None]
    down = np.nan_to_num(unit(cross(cross(np.broadcast_to([0.0, 0.0, 1.0], way.shape), way), way)))
    push = (LIFT * problem.reference_drag * np.where(problem.contact, 0.0, norm(way) ** 2))[:, None] * down
    rows = np.flatnonzero(evaluation.segment >= 0)
    flight = evaluation.segment[rows]
    since = common_times(problem, solution.state)[rows] - motion.start_time_s[flight]
    bent = push[flight] * (since * (since - motion.duration_s[flight]) / 2)[:, None]
    jacobian = evaluation.pixels.jacobian[rows]
    by_place = jacobian[:, :, 0:3] + jacobian[:, :, 4:7]  # of both nodes: minus that of the place between them
    pixel = problem.pixel.copy()
    pixel[rows] += (by_place @ bent[:, :, None])[:, :, 0] * problem.sigma_px[rows, None]
    at_end = push * motion.duration_s[:, None] / 2
    return _Change("spin", "Spinning as if rolling", replace(problem, pixel=pixel), solution.state, at_end)
