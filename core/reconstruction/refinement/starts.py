# SPDX-License-Identifier: GPL-3.0-or-later
"""Where refinement begins: the first guess of free clocks, and whether the marked motion can be seen at all."""

from dataclasses import replace

import numpy as np

from ...camera.model import project
from ...errors import InputError, RockfallError
from ...vectors import norm
from ..node_motion import places_at
from .problem import Problem, Unknowns, common_times, evaluate, segments_at, solve_segments
from .setup import Setup

CLOCK_REACH_S, CLOCK_STEP_S, CLOCK_PIXELS = 1.0, 1 / 60, 60
"""How far off a free clock may be, and the steps in which it is sought first, with how many pixels of a view."""


def find_clocks(problem: Problem, state: Unknowns) -> Unknowns:
    """A first guess of the free clocks: the offsets at which the median pixel lies closest to the marked motion."""
    motion = solve_segments(problem, state)
    offsets = np.arange(-CLOCK_REACH_S, CLOCK_REACH_S + CLOCK_STEP_S / 2, CLOCK_STEP_S)
    times, shift = common_times(problem, state), state.offset_s.copy()
    for number in np.flatnonzero(problem.columns.clock[:, 0] >= 0):
        mine = np.flatnonzero(problem.view == number)
        mine = mine[:: max(1, mine.size // CLOCK_PIXELS)]
        each = np.tile(mine, offsets.size)
        time = times[each] + np.repeat(offsets, mine.size)
        segment = segments_at(problem, state, time, problem.obs_group[each])
        used = np.flatnonzero(segment >= 0)
        places = places_at(motion, segment[used], time[used]).position
        camera, here = problem.views[number].path.reference, each[used]
        pixel = project(camera, places, position=problem.position[here], rotation=problem.rotation[here])
        miss = np.full(each.size, np.nan)
        miss[used] = norm(pixel - problem.pixel[here])
        table = miss.reshape(offsets.size, mine.size)
        enough = np.flatnonzero(np.isfinite(table).sum(axis=1) >= 0.5 * mine.size)
        if enough.size:
            shift[number] += offsets[enough[np.argmin(np.nanmedian(table[enough], axis=1))]]
    return replace(state, offset_s=shift)


def check_start(setup: Setup) -> None:
    """Refuse a marked motion that cannot be seen.

    Raises
    ------
    RockfallError : no flight joins the picks, or they are too close in time.
    InputError : a block behind a camera.
    """
    start = evaluate(setup.problem, setup.state)
    if start.valid:
        return
    problem = setup.problem
    unknown = np.flatnonzero(~np.isfinite(start.motion.inverse).all(axis=(1, 2)))
    if unknown.size:
        name = setup.picks.trajectory[setup.nodes[problem.first[unknown[0]]]]
        raise RockfallError(
            f"No flight with this drag joins the picks of trajectory {name}, the flight that starts at "
            f"{start.motion.start_time_s[unknown[0]]:.3f} s. Check the times, and the block's size."
        )
    lost = np.flatnonzero(~np.isfinite(start.pixels.residual).all(axis=1))
    if not lost.size:
        raise RockfallError("The picks are too close in time to be fitted. Remove one of each pair.")
    view = problem.views[problem.view[lost[0]]]
    segment = start.segment[lost[0]]
    raise InputError(
        f"The block is behind the camera of view {view.name}, or outside of what its lens can see, at "
        f"{problem.video_s[lost[0]]:.3f} s of the video",
        trajectory=str(setup.picks.trajectory[setup.nodes[problem.first[segment]]]),
        advice="Check the camera's solution, and that picks and camera are in the same coordinates",
    )
