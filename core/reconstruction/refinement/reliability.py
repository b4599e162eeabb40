# SPDX-License-Identifier: GPL-3.0-or-later
"""Whether what was stated agrees with the pixels, and how large an error of it they would not show.

Each statement (a camera's place, the terrain, a contact, a marked time or place) is off by an error that is sought
beside all that is fitted (Baarda 1968, A testing procedure for use in geodetic networks). What is found, divided by its
standard deviation, is the test w. What the test would notice in four of five cases is the minimal detectable error, and
what an error of that size does to the speeds is what may stand in a result unseen.
"""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ...least_squares import inverse
from ...remarks import Remark
from ...vectors import Array, Indices, dot, norm, unit
from .deviations import Fit, velocity_rows
from .problem import NODE, Problem, evaluate, ground_distances
from .solver import normal_equations
from .what_if import flights_at_impacts

SIGNIFICANCE, POWER = 0.001, 0.8
"""Chance that a test of what is right rejects it, and that one notices an error of the size that is said."""
MOST_PERCENT = 20.0
"""The effect of an error on a speed is computed from derivatives, which hold up to about this."""
CAMERA, TERRAIN, CONTACT, TIME, PLACE = "camera of", "terrain", "contact", "time", "place"
OPPOSITE = {
    "higher": "lower",
    "nearer": "farther away",
    "to its right": "to its left",
    "later": "earlier",
    "farther away": "nearer",
}
CHECK = {
    "camera": "Check its pairs, and how their points lie to the terrain.",
    "terrain": "Check how the terrain and the cameras lie to each other.",
    "place": "A mark along a grazing ray is less certain than across it: leave its deviation out, or make it larger.",
}


@dataclass(frozen=True)
class Statement:
    """A statement against the pixels, for one trajectory.

    Attributes
    ----------
    about : "camera of NAME", "terrain", "contact", "time" or "place".
    error : how it may be wrong, in words.
    trajectory : name.
    unit : "m" or "s".
    found, sigma : the error that the pixels ask for, and its standard deviation, the stated one included.
    w : found / sigma.
    critical : |w| that chance exceeds in one of a thousand cases among all of the kind.
    noticed : the error that the test would notice with a probability of 80 %, or one that changes a speed by 20 %
        where this is less; beyond : it is the latter.
    speed_percent, most_speed_percent : what an error of that size changes speeds at impacts by, median and most.
    intervals : the most that it does in half widths of the 95 % interval of the same speed.
    """

    about: str
    error: str
    trajectory: str
    unit: str
    found: float
    sigma: float
    w: float
    critical: float
    noticed: float
    beyond: bool
    speed_percent: float
    most_speed_percent: float
    intervals: float

    @property
    def rejected(self) -> bool:
        """The pixels contradict it."""
        return abs(self.w) > self.critical

    @property
    def asked(self) -> str:
        """What the pixels ask for, in words without its size."""
        way = next(one for one in OPPOSITE if self.error.endswith(one) or f" {one} at " in self.error)
        return self.error if self.found > 0 else self.error.replace(way, OPPOSITE[way])

    @property
    def cells(self) -> tuple[str, str, str, str]:
        """The error, the size below which it is not noticed, and what it changes: as text for people."""
        size = f"{_short(1e3 * self.noticed)} ms" if self.unit == "s" else f"{_short(self.noticed)} m"
        sign = "> " if self.beyond else ""
        return self.error, sign + size, f"{_short(self.speed_percent)} %", f"{_short(self.most_speed_percent)} %"


def _short(value: float) -> str:
    """To two digits, without an exponent."""
    return f"{float(f'{value:.2g}'):g}"


@dataclass(frozen=True, eq=False)
class _Errors:
    """q errors of statements of one kind.

    Attributes
    ----------
    words, about : (q,) of each; group (q,) its trajectory, −1 for all.
    slope : (q,) gradient of half the squares by each; curvature (q,); mixed (q, size) with the unknowns.
    """

    about: list[str]
    words: list[str]
    group: Indices
    unit: str
    slope: Array
    curvature: Array
    mixed: Array


def reliability(fits: Sequence[Fit]) -> tuple[Statement, ...]:
    """All statements of solved problems, for each trajectory that they bear on."""
    return tuple(row for fit in fits for row in _of_fit(fit))


def worst(rows: Iterable[Statement]) -> list[Statement]:
    """Of each kind the statement whose unnoticed error changes a speed the most."""
    found = dict[str, Statement]()
    for row in rows:
        if row.about not in found or row.most_speed_percent > found[row.about].most_speed_percent:
            found[row.about] = row
    return list(found.values())


def on_statements(rows: Sequence[Statement]) -> Iterator[Remark]:
    """What the pixels contradict, the most certain alone, since one error makes several tests fail; and what they do
    not test."""
    grave = [row for row in rows if row.rejected and row.about not in (CONTACT, TIME)]  # which have their own remarks
    if grave:
        row = max(grave, key=lambda one: abs(one.w) / one.critical)
        text = (
            f"The pixels of trajectory {row.trajectory} contradict what is stated: "
            f"{row.asked[0].lower()}{row.asked[1:]} by {abs(row.found):.2g} ± {row.sigma:.1g} {row.unit} "
            f"({abs(row.w):.1f} standard deviations). {CHECK[row.about.split()[0]]}"
        )
        yield Remark(text, "warning", row.about)
    unseen = [row for row in rows if row.about not in (CONTACT, TIME, PLACE) and row.intervals > 1]
    if unseen:
        row = max(unseen, key=lambda one: one.most_speed_percent)
        error = row.error[0].lower() + row.error[1:]
        text = (
            f"An error of what is stated is not detectable below {row.noticed:.2g} m ({error}): it would change a "
            f"speed by {row.cells[3]}, more than its interval."
        )
        yield Remark(text, "note", "reliability")


def _of_fit(fit: Fit) -> Iterator[Statement]:
    from scipy.special import ndtri

    problem, solution = _all_poses_free(fit), fit.solution
    segment = solution.evaluation.segment
    chain = np.where(segment >= 0, problem.chain[segment], -1)
    here = evaluate(problem, solution.state, chain)
    before, after = flights_at_impacts(fit)
    if not here.valid or not before.size:
        return
    normal, gradient = normal_equations(problem, here, solution.weight)
    covariance = inverse(normal, partly=True)
    ends = [
        (velocity_rows(problem, here.motion, before, at_end=True), here.motion.end_velocity, before),
        (velocity_rows(problem, here.motion, after, at_end=False), here.motion.start_velocity, after),
    ]
    group = problem.group[np.maximum(before, after)]
    size = fit.covariance.shape[0] if fit.accelerations is None else fit.independent.shape[0]
    wider = np.trace(fit.covariance[:size, :size]) / max(float(np.trace(fit.independent)), 1e-300)
    scale = fit.scale * float(np.sqrt(max(wider, 1.0)))
    for errors in _errors(fit, problem):
        moved = errors.mixed @ covariance  # (q, size) what the unknowns follow each error by, with the other sign
        information = errors.curvature - np.einsum("qi,qi->q", moved, errors.mixed)
        information = np.maximum(information, 1e-12 * errors.curvature)
        sigma = scale / np.sqrt(information)
        found = -(errors.slope - moved @ gradient) / information
        percent = np.concatenate(
            [
                100 * np.einsum("kij,qj,ki->qk", rows, moved, unit(velocity[which])) / norm(velocity[which])
                for rows, velocity, which in ends
            ],
            axis=1,
        )
        known = np.concatenate([before, after]) >= 0
        half = np.concatenate([_half_widths(covariance, *one) for one in ends]) * scale
        critical = -float(ndtri(SIGNIFICANCE / 2 / max(len(errors.words), 1)))
        least = (critical + float(ndtri(POWER))) * sigma
        owner = np.concatenate([group, group])
        for i, words in enumerate(errors.words):
            for number, name in enumerate(fit.setup.names):
                own = known & (owner == number)
                mine = np.abs(percent[i][own])
                if not mine.size or errors.group[i] not in (-1, number):
                    continue
                most = MOST_PERCENT / max(float(mine.max()), 1e-9)
                noticed = min(least[i], most)
                yield Statement(
                    errors.about[i], words, name, errors.unit, float(found[i]), float(sigma[i]),
                    float(found[i] / sigma[i]), critical, float(noticed), bool(most < least[i]),
                    float(np.median(mine) * noticed), float(mine.max() * noticed),
                    float((mine / half[own]).max() * noticed),
                )  # fmt: skip


def _half_widths(covariance: Array, rows: Array, velocity: Array, which: Indices) -> Array:
    """(q,) of the 95 % intervals of speeds, in percent of these."""
    along = np.einsum("kij,ki->kj", rows, unit(velocity[which]))
    return np.asarray(196 * np.sqrt(np.einsum("kj,jl,kl->k", along, covariance, along)) / norm(velocity[which]))


def _all_poses_free(fit: Fit) -> Problem:
    """The problem with the poses that the fit holds as unknowns against their covariance, without accelerations."""
    problem = fit.setup.problem
    pose, size = problem.columns.pose.copy(), problem.columns.size
    for i in np.unique(problem.view[fit.solution.weight > 0]):
        if pose[i, 0] < 0:
            pose[i] = size + np.arange(6)
            size += 6
    push = np.full_like(problem.columns.push, -1)
    return replace(problem, columns=replace(problem.columns, pose=pose, push=push, size=size))


def _errors(fit: Fit, problem: Problem) -> Iterator[_Errors]:
    """Of each kind of statement there is."""
    state, setup, size = fit.solution.state, fit.setup, problem.columns.size
    time = state.time_s
    kinds = setup.picks.kind[setup.nodes]
    owner = np.array([setup.names.index(name) for name in setup.picks.trajectory[setup.nodes].tolist()])

    def called(node: int) -> str:
        return f"{kinds[node]} at {time[node]:.2f} s"

    for i, view in enumerate(problem.views):
        columns = problem.columns.pose[i]
        if columns[0] < 0:
            continue
        white = problem.pose_whitening[i]
        residual = white @ np.concatenate([state.turn[i], state.move[i]])
        up, (x, y, _) = np.array([0.0, 0.0, 1.0]), view.path.reference.rotation[2]
        ahead = np.array([x, y, 0.0]) / max(float(np.hypot(x, y)), 1e-9)
        along = -white[:, 3:] @ np.stack([up, ahead, np.cross(ahead, up)], axis=1)  # (6, 3)
        mixed = np.zeros((3, size))
        mixed[:, columns] = along.T @ white
        words = [f"Camera of {view.name} {way}" for way in ("higher", "nearer", "to its right")]
        about = [f"{CAMERA} {view.name}"] * 3
        yield _Errors(about, words, np.full(3, -1), "m", along.T @ residual, (along**2).sum(axis=0), mixed)

    if problem.surface is not None and problem.grounded.size:
        nodes, white = problem.grounded, problem.ground.whitening
        distance, slope = ground_distances(problem.surface, state.centre[nodes])
        residual = white @ (distance - problem.radius_m)
        jacobian = np.zeros((nodes.size, size))
        for axis in range(3):
            jacobian[:, NODE * nodes + axis] = white * slope[:, axis]
        for about, words, of, by in (
            ([TERRAIN], ["Terrain higher"], np.array([-1]), -white @ slope[:, 2:]),
            ([CONTACT] * nodes.size, [f"Terrain higher at {called(node)}" for node in nodes], owner[nodes], -white),
        ):
            yield _Errors(about, words, of, "m", by.T @ residual, (by**2).sum(axis=0), by.T @ jacobian)

    marked = np.flatnonzero(setup.picks.sigma_time_s[setup.nodes] > 0)
    if marked.size:
        weight = problem.sigma_time_s[marked] ** -2.0
        mixed = np.zeros((marked.size, size))
        mixed[np.arange(marked.size), NODE * marked + 3] = -weight
        late = (time - problem.time_s)[marked]
        words = [f"Mark of the {called(node)} later" for node in marked]
        yield _Errors([TIME] * marked.size, words, owner[marked], "s", -weight * late, weight, mixed)

    marked = np.flatnonzero(setup.picks.sigma_position_m[setup.nodes] > 0)
    if marked.size:
        place = problem.views[0].path.reference.position
        ray = unit(state.centre[marked] - place)
        white = problem.centre_whitening[marked]
        by = np.einsum("nij,nj->ni", np.swapaxes(white, 1, 2) @ white, ray)
        mixed = np.zeros((marked.size, size))
        for axis in range(3):
            mixed[np.arange(marked.size), NODE * marked + axis] = -by[:, axis]
        away, weight = dot((state.centre - problem.centre)[marked], by), dot(by, ray)
        words = [f"Mark of the {called(node)} farther away" for node in marked]
        yield _Errors([PLACE] * marked.size, words, owner[marked], "m", -away, weight, mixed)
