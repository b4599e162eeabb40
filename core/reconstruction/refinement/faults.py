# SPDX-License-Identifier: GPL-3.0-or-later
"""What may be untrue of what was given, and bends a whole trajectory: frames that a video lost or doubled, a contact
where the ground is no longer that of the terrain, a lens that zooms, a wrong capture rate.

Each has columns, the derivatives of the residuals by its size, a prior of this size, and a way to take it out of the
problem. `mending` tries them.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from ...vectors import Array
from .problem import CLOCK_COLUMN, DRAG_COLUMN, Problem, Unknowns, common_times, evaluate

Kind = Literal["gap", "ground", "zoom", "rate", "drag"]

SIGMA_GAP_FRAMES, SIGMA_GONE_M, SIGMA_ZOOM, SIGMA_RATE, SIGMA_DRAG = 4.0, 0.4, 0.04, 0.2, 0.6
"""Standard deviations of a jump of a clock in frames, of what is gone of the ground [m], of a focal length at each knot
and of a factor on times, as parts, and of a coefficient of drag."""
LEAST_DRAG = 1e-6
KNOTS = 5
"""Of a spline of the focal length over the time of a track."""
MOST_INSTANTS = 150
"""Instants of a view between which a jump is sought at first, before those about the likeliest."""


LIMITS = {"gap": (-10.0, 10.0), "ground": (-10.0, 10.0), "zoom": (-0.5, 0.5), "rate": (-0.9, 9.0), "drag": (0.0, 9.0)}
"""Sizes between which a fault can be one."""
RARE = {"gap": 100.0, "ground": 10.0, "zoom": 100.0, "rate": 100.0, "drag": 2.0}
"""One fit of so many has a fault of a kind: blocks dig into the ground, videos are cut less often."""
NEAR_FRAMES = 1.5
"""A jump that is nearer to a contact is no gap: a contact that lasts, or was two, looks alike and is more frequent."""
NEARLY_ONE = 0.7
"""Frames that are missing, from which they are counted."""
FEWEST_CONTACTS = 2
"""Of which one alone can be off the ground: more than these."""


@dataclass(frozen=True, eq=False)
class Fault:
    """Something given that is not so.

    Attributes
    ----------
    kind : gap: the clock of a view jumps after a frame; ground: a contact lies off the terrain; zoom: the focal length
        of a view changes; rate: all times are too short by a factor; drag: air brakes the blocks.
    view : its index, −1 for all.
    at : of a gap the video time of the last frame before it [s]; of the ground the contact, among those on it.
    picks : of a gap: the picks were marked in this view, and have its times.
    value : (p,) its size: common seconds by which all later frames are late; metres of the ground that are gone; parts
        by which the focal length is larger at the knots; part by which times are longer; coefficient of drag.
    knots_s : (p,) video times of the knots of a focal length.
    sigma : (p,) standard deviation of the size.
    doubtful : accelerations of the flights explain more of it: it was not taken out.
    """

    kind: Kind
    view: int
    at: float
    picks: bool
    value: Array
    knots_s: Array
    sigma: Array
    doubtful: bool = False


def frame_s(problem: Problem, view: int) -> float:
    """Usual interval between the pixels of a view [s of its video]."""
    times = np.unique(problem.video_s[problem.view == view])
    return float(np.median(np.diff(times))) if times.size > 1 else 1 / 30


def _later_nodes(problem: Problem, state: Unknowns, fault: Fault) -> Array:
    """(n,) 1 for nodes after a gap."""
    instant = problem.views[fault.view].clock.to_common(fault.at) + state.offset_s[fault.view]
    return np.asarray(state.time_s > instant, dtype=np.float64)


def _spline(time_s: Array, knots_s: Array) -> Array:
    """(m, p) by how much each knot weighs at times: a natural cubic spline."""
    from scipy.interpolate import CubicSpline

    return np.asarray(CubicSpline(knots_s, np.eye(knots_s.size), bc_type="natural")(time_s))


def _from_middle(problem: Problem, view: int) -> Array:
    """(m, 2) pixels from the principal point [px], zero for other views."""
    camera = problem.views[view].path.reference
    return np.where((problem.view == view)[:, None], problem.pixel - [camera.cx, camera.cy], 0.0)


def applied(problem: Problem, state: Unknowns, fault: Fault, value: Array) -> tuple[Problem, Unknowns]:
    """The problem and the state with a fault of this size taken out, the times of the nodes moved with it."""
    size = float(value[0])
    if fault.kind == "gap":
        view, views = problem.views[fault.view], list(problem.views)
        late = size * _later_nodes(problem, state, fault)
        views[fault.view] = replace(view, clock=view.clock.with_gap(fault.at, size / view.clock.speed))
        return (
            replace(problem, views=tuple(views), time_s=problem.time_s + late * fault.picks),
            replace(state, time_s=state.time_s + late * (fault.picks or np.unique(problem.view).size == 1)),
        )
    if fault.kind == "ground":
        contact = problem.ground.contact_m.copy()
        contact[int(fault.at)] = np.hypot(contact[int(fault.at)], SIGMA_GONE_M)
        return replace(problem, ground=problem.ground.with_contact(contact)), state
    if fault.kind == "zoom":
        larger = np.where(problem.view == fault.view, _spline(problem.video_s, fault.knots_s) @ value, 0.0)
        pixel = problem.pixel - _from_middle(problem, fault.view) * (larger / (1 + larger))[:, None]
        return replace(problem, pixel=pixel, sigma_px=problem.sigma_px / (1 + larger)), state  # their noise with them
    if fault.kind == "drag":
        return problem, replace(state, coefficient=state.coefficient + size)
    middle = float(state.time_s.mean())
    clocks = [
        replace(
            view.clock,
            offset_s=middle + (1 + size) * (view.clock.offset_s - middle),
            drift=(1 + view.clock.drift) * (1 + size) - 1,
        )
        for view in problem.views
    ]
    views = [replace(view, clock=clock) for view, clock in zip(problem.views, clocks, strict=True)]
    return (
        replace(problem, views=tuple(views), time_s=middle + (1 + size) * (problem.time_s - middle)),
        replace(state, time_s=middle + (1 + size) * (state.time_s - middle)),
    )


def candidates(problem: Problem, state: Unknowns) -> Iterator[list[Fault]]:
    """The faults of each kind and view, of which one at most is there; their sizes are zero."""
    grounded = problem.grounded.size if problem.surface is not None else 0
    seen = [int(i) for i in np.unique(problem.view) if np.unique(problem.video_s[problem.view == i]).size > 2 * KNOTS]
    for view in seen:
        yield gaps(problem, view)
    if grounded > FEWEST_CONTACTS:
        yield [_fault("ground", at=float(i)) for i in range(grounded)]
    if problem.columns.law[1] < 0:
        yield [_fault("rate")]
    if problem.columns.law[0] < 0 and state.coefficient == 0:
        yield [_fault("drag")]
    for view in seen:
        times = problem.video_s[problem.view == view]
        yield [_fault("zoom", view, knots_s=np.linspace(times.min(), times.max(), KNOTS))]


def gaps(problem: Problem, view: int, about_s: float | None = None) -> list[Fault]:
    """Gaps after the frames of a view, as many as there is time for; or all about a video time."""
    times = np.unique(problem.video_s[problem.view == view])[:-1]
    every = -(-times.size // MOST_INSTANTS)
    if about_s is not None:
        place = int(np.searchsorted(times, about_s))
        times = times[max(place - every, 0) : place + every + 1]
    elif every > 1:
        times = times[every // 2 :: every]
    return [_fault("gap", view, float(at), picks) for picks in (False, True) for at in times]


def _fault(kind: Kind, view: int = -1, at: float = 0.0, picks: bool = False, knots_s: Array | None = None) -> Fault:
    knots = np.zeros(0) if knots_s is None else knots_s
    nothing = np.zeros(max(knots.size, 1))
    return Fault(kind, view, at, picks, nothing, knots, nothing)


def prior_sigma(problem: Problem, fault: Fault) -> float:
    """Prior standard deviation of each number of a fault."""
    if fault.kind == "gap":
        return SIGMA_GAP_FRAMES * frame_s(problem, fault.view) * problem.views[fault.view].clock.speed
    return {"ground": SIGMA_GONE_M, "zoom": SIGMA_ZOOM, "rate": SIGMA_RATE, "drag": SIGMA_DRAG}[fault.kind]


def rarity(fault: Fault) -> float:
    """Logarithm of in how many fits one such fault is."""
    return float(np.log(RARE[fault.kind]))


def columns_of(problem: Problem, state: Unknowns, jacobian: Array, faults: Sequence[Fault]) -> Array:
    """(rows, c) derivatives of the residuals by the numbers of some faults, about the sizes that the problem has.

    Parameters
    ----------
    jacobian : (m, 2, 21) of the pixels' residuals.

    The rows are those of the pixels (2m), of the nodes' times (n), and of the ground (g).
    """
    by_time = jacobian[:, :, CLOCK_COLUMN]
    m, n, g = len(by_time), state.time_s.size, problem.grounded.size if problem.surface is not None else 0
    weight = np.where(np.isfinite(problem.sigma_time_s), -1 / problem.sigma_time_s, 0.0)
    columns = np.zeros((2 * m + n + g, sum(fault.value.size for fault in faults)))
    place = 0
    for fault in faults:
        own = columns[:, place : place + fault.value.size]
        place += fault.value.size
        if fault.kind == "ground":
            own[2 * m + n :, 0] = problem.ground.whitening[:, int(fault.at)]
        elif fault.kind == "gap":
            late = (problem.view == fault.view) & (problem.video_s > fault.at)
            own[: 2 * m, 0] = (by_time * late[:, None]).ravel()
            if fault.picks:
                own[2 * m : 2 * m + n, 0] = weight * _later_nodes(problem, state, fault)
        elif fault.kind == "drag":
            # without drag its derivatives are not computed
            slightly = replace(state, coefficient=max(state.coefficient, LEAST_DRAG))
            own[: 2 * m, 0] = evaluate(problem, slightly).pixels.jacobian[:, :, DRAG_COLUMN].ravel()
        elif fault.kind == "rate":
            middle = float(state.time_s.mean())
            own[: 2 * m, 0] = (by_time * (common_times(problem, state) - middle)[:, None]).ravel()
            own[2 * m : 2 * m + n, 0] = weight * (problem.time_s - middle)
        else:
            away = -_from_middle(problem, fault.view) / problem.sigma_px[:, None]
            own[: 2 * m] = (away[:, :, None] * _spline(problem.video_s, fault.knots_s)[:, None, :]).reshape(2 * m, -1)
    return columns


def at_contact(problem: Problem, state: Unknowns, fault: Fault) -> bool:
    """Whether a gap lies at a contact: one that lasts, or was two, looks alike."""
    if fault.kind != "gap":
        return False
    clock = problem.views[fault.view].clock
    middle = clock.to_common(fault.at) + clock.speed * frame_s(problem, fault.view) / 2 + state.offset_s[fault.view]
    between = np.intersect1d(problem.first, problem.last)  # where a run begins or ends there is nothing to mistake
    away = np.abs(state.time_s[between] - middle) / (clock.speed * frame_s(problem, fault.view))
    return bool((away < NEAR_FRAMES).any())


def can_be(fault: Fault) -> bool:
    """Whether the size of a fault is one that the problem can be solved with."""
    least, most = LIMITS[fault.kind]
    return bool(((least < fault.value) & (fault.value < most)).all())


def in_words(problem: Problem, fault: Fault, contact: str, *, alone: bool) -> str:
    """What was found and what to do, but for a wrong rate, which is said with gravity.

    Parameters
    ----------
    contact : a contact off the ground in words, as "impact at 2.1 s of trajectory a".
    alone : all trajectories were fitted together, so that the clock of the view is corrected, too.
    """
    size, sigma = float(fault.value[0]), float(fault.sigma[0])
    if fault.kind == "ground":
        return (
            f"The {contact} lies {abs(size):.2f} ± {sigma:.2f} m {'lower' if size > 0 else 'higher'} than the terrain, "
            "which fits elsewhere: was the ground there another one when it was scanned? The terrain does not hold "
            "this contact; its normal there is not to be believed."
        )
    if fault.kind == "drag":
        return (
            f"The flights brake as in air, with a coefficient of drag of {size:.2g} ± {sigma:.1g}, which was left out: "
            "switch air drag on, and refine again. The deviations contain it."
        )
    name = problem.views[fault.view].name
    if fault.kind == "gap":
        frame = frame_s(problem, fault.view)
        late = size / problem.views[fault.view].clock.speed
        count = abs(late) / frame
        number = f"{count:.0f}" if count > NEARLY_ONE else "part of a"
        frames = "frame" if number in ("1", "part of a") else "frames"
        are = "is" if frames == "frame" else "are"
        what = f"{number} {frames} {are} missing" if size > 0 else f"{number} {frames} too many {are} there"
        if fault.doubtful:
            return f"View {name}: perhaps {what} after {fault.at:.3f} s of its video: compare the pictures there."
        return (
            f"View {name}: {what} after {fault.at:.3f} s of its video (frame {fault.at / frame:.0f}): all later ones "
            f"were taken {1e3 * abs(size):.0f} ± {1e3 * sigma:.0f} ms {'later' if size > 0 else 'earlier'} than the "
            f"file says. Times and speeds{' and the clock of this view' if alone else ''} are corrected for it: "
            "compare the pictures there."
        )
    least, most = 100 * float(fault.value.min()), 100 * float(fault.value.max())
    seems = "may zoom" if fault.doubtful else "zooms"
    return (
        f"View {name}: the lens {seems}, by {least:+.1f} to {most:+.1f} % of the focal length, as the pixels tell. The "
        "deviations contain it: check the footage for a zoom, and film without one."
    )
