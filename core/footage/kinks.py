# SPDX-License-Identifier: GPL-3.0-or-later
"""Impacts proposed from a track: the times at which a path that is smooth in every flight changes its velocity at once.

The track is cut into pieces, each a polynomial of second or third degree in time (a flight's image is a parabola but
for perspective and distortion), so that the sum of squares and a price for every piece are least: optimal partitioning
(Jackson et al. 2005) with the Bayesian information criterion. Neighbouring pieces meet between two frames.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..errors import InputError
from ..vectors import Array

DEGREES = (2, 3)
SHORTEST = 4
"""Sightings in a piece, at least."""
LONGEST = 500
"""Sightings in a piece, at most."""
SMOOTH = 0.02
"""Share of the distance that a flight travels between frames, by which it may leave a polynomial."""
LEAST_SCORE = 8.0
LEAST_TURN = 0.15
"""Change of velocity as a share of the larger velocity, at least."""
REACH = 15
"""Sightings on either side of a kink that tell its time."""
AROUND = 2.5
"""Frames around a cut in which the pieces may meet."""
FARTHER = 0.02
"""Price of each squared frame between the cut and the meeting."""


@dataclass(frozen=True, eq=False)
class Kinks:
    """k proposed impacts.

    Attributes
    ----------
    time_s, sigma_time_s : (k,) when the pieces meet, between frames, and its standard deviation [s].
    pixel : (k, 2) where [px].
    velocity_before, velocity_after : (k, 2) [px/s].
    score : (k,) change of velocity in its standard deviations.
    """

    time_s: Array
    sigma_time_s: Array
    pixel: Array
    velocity_before: Array
    velocity_after: Array
    score: Array

    def __len__(self) -> int:
        return self.time_s.size


def find_kinks(
    time_s: Array, pixel: Array, sigma_px: Array, *, least_score: float = LEAST_SCORE, least_turn: float = LEAST_TURN
) -> Kinks:
    """Kinks of a track.

    Parameters
    ----------
    time_s, pixel, sigma_px : (m,) [s], (m, 2) and (m,) [px] of the track, in the stabilised picture.
    least_score, least_turn : changes of velocity that are smaller, in standard deviations or as a share of the larger
        velocity, are taken for imperfect smoothness.

    Raises
    ------
    InputError : times that do not ascend.
    """
    time_s, pixel, sigma_px = (np.asarray(a, dtype=np.float64) for a in (time_s, pixel, sigma_px))
    if (np.diff(time_s) <= 0).any():
        raise InputError("The times of a track must ascend")
    if time_s.size < 2 * SHORTEST:
        return _kinks([])
    step = np.hypot(*np.diff(pixel, axis=0).T)
    sigma = np.sqrt(sigma_px**2 + (SMOOTH * np.minimum(np.r_[step[0], step], np.r_[step, step[-1]])) ** 2)
    cuts = _cuts(time_s, pixel, sigma)
    met: dict[tuple[int, ...], tuple[float, float, Array, Array, Array, float, float]] = {}
    while True:  # the least of the kinks goes as long as one is too small, and its pieces are joined
        around = [tuple(cuts[i - 1 : i + 2].tolist()) for i in range(1, len(cuts) - 1)]
        for i, three in enumerate(around, start=1):
            if three not in met:  # where one has gone only those beside it are others
                met[three] = _meet(time_s, pixel, sigma, cuts, i)
        found = [met[three] for three in around]
        worth = [min(kink[5] / least_score, kink[6] / least_turn) for kink in found]
        if not worth or min(worth) >= 1:
            return _kinks(found)
        cuts = np.delete(cuts, 1 + int(np.argmin(worth)))


def _cuts(time_s: Array, pixel: Array, sigma: Array) -> np.ndarray:
    """(p + 1,) the first sighting of every piece, and the number of sightings."""
    n = time_s.size
    best = np.full(n + 1, np.inf)
    best[0], came = 0.0, np.zeros(n + 1, dtype=np.intp)
    price = np.log(2.0 * n)
    for i in range(n - SHORTEST + 1):
        if not np.isfinite(best[i]):
            continue
        ends, cost = _costs(time_s[i : i + LONGEST], pixel[i : i + LONGEST], sigma[i : i + LONGEST], price)
        total = best[i] + cost + price
        better = total < best[i + ends]
        best[i + ends[better]], came[i + ends[better]] = total[better], i
    cuts = [n]
    while cuts[-1] > 0:
        cuts.append(int(came[cuts[-1]]))
    return np.array(cuts[::-1])


def _costs(time_s: Array, pixel: Array, sigma: Array, price: float) -> tuple[np.ndarray, Array]:
    """Ends (e,) and costs (e,) of the pieces that begin with the first of these sightings."""
    when, place = time_s - time_s[0], pixel - pixel[0]
    weight = 1 / sigma**2
    top = max(DEGREES)
    ends = np.arange(SHORTEST, when.size + 1)
    last = ends - 1
    scale = when[last]
    powers = when[:, None] ** np.arange(2 * top + 1)
    moments = np.cumsum(weight[:, None] * powers, axis=0)[last] / scale[:, None] ** np.arange(2 * top + 1)
    right = np.cumsum(weight[:, None, None] * powers[:, : top + 1, None] * place[:, None], axis=0)[last]
    right /= scale[:, None, None] ** np.arange(top + 1)[:, None]
    squares = np.cumsum(weight * np.sum(place**2, axis=1))[last]
    cost = np.full(ends.size, np.inf)
    for degree in DEGREES:
        enough = ends > degree + 1
        grade = np.arange(degree + 1)
        normal = moments[:, grade[:, None] + grade] + 1e-12 * moments[:, :1, None] * np.eye(degree + 1)
        part = right[:, : degree + 1]
        explained = np.sum(part * np.linalg.solve(normal, part), axis=(1, 2))
        value = np.maximum(squares - explained, 0) + 2 * (degree + 1) * price
        cost = np.where(enough, np.minimum(cost, value), cost)
    return ends, cost


def _meet(
    time_s: Array, pixel: Array, sigma: Array, cuts: np.ndarray, i: int
) -> tuple[float, float, Array, Array, Array, float, float]:
    """Time, its standard deviation, place, velocities, score and turn where the pieces around a cut meet."""
    cut = int(cuts[i])
    middle = 0.5 * (time_s[cut - 1] + time_s[cut])
    frame = float(np.median(np.diff(time_s)))
    before = _piece(time_s, pixel, sigma, max(cuts[i - 1], cut - REACH), cut, middle)
    after = _piece(time_s, pixel, sigma, cut, min(cuts[i + 1], cut + REACH), middle)
    span = 0.5 * (time_s[cut] - time_s[cut - 1]) + AROUND * frame
    both, change = before[1] + after[1], after[0] - before[0]
    trial = np.linspace(-span, span, 201)
    grades = trial[:, None] ** np.arange(3)
    apart = np.sum((grades @ change) ** 2, axis=1) / np.einsum("ti,ij,tj->t", grades, both, grades)
    when = float(trial[np.argmin(apart + FARTHER * (trial / frame) ** 2)])
    turn = np.array([0, 1, 2 * when]) @ change
    nearer = np.array([1, when, when**2]) @ change @ turn / max(float(turn @ turn), 1e-12)
    when -= float(np.clip(nearer, trial[0] - trial[1], trial[1] - trial[0]))

    grade, slope = np.array([1, when, when**2]), np.array([0, 1, 2 * when])
    gap, turned = grade @ change, float(np.hypot(*(slope @ change)))
    variance = float(grade @ both @ grade)
    unlike = max(1.0, float(gap @ gap) / variance)
    share = float(grade @ before[1] @ grade) / variance
    velocities = slope @ before[0], slope @ after[0]
    return (
        middle + when,
        float(np.sqrt(variance * unlike)) / max(turned, 1e-9),
        grade @ ((1 - share) * before[0] + share * after[0]),
        *velocities,
        turned / float(np.sqrt(slope @ both @ slope)),
        turned / max([1e-9, *(float(np.hypot(*velocity)) for velocity in velocities)]),
    )


def _piece(time_s: Array, pixel: Array, sigma: Array, begin: int, end: int, origin: float) -> tuple[Array, Array]:
    """Coefficients (3, 2) of the parabola through sightings about a time, and their covariance (3, 3).

    The sighting nearest to the kink counts less: the block may touch the ground while the shutter is open.
    """
    part = slice(begin, end)
    when = time_s[part] - origin
    near = np.argsort(np.abs(when), kind="stable")[:1] if end - begin > SHORTEST else np.zeros(0, dtype=np.intp)
    loose = sigma[part].copy()
    loose[near] *= 2
    scale = float(np.abs(when).max())
    design = (when / scale)[:, None] ** np.arange(3) / loose[:, None]
    spread = np.linalg.inv(design.T @ design + 1e-12 * np.eye(3))
    values = spread @ design.T @ (pixel[part] / loose[:, None])
    residual = pixel[part] / loose[:, None] - design @ values
    factor = max(1.0, float(np.sum(residual**2)) / max(2 * (end - begin - 3), 1))
    unit = scale ** -np.arange(3.0)
    return values * unit[:, None], spread * factor * unit[:, None] * unit


def _kinks(found: Sequence[tuple[float, float, Array, Array, Array, float, float]]) -> Kinks:
    times, sigmas, places, before, after, score, _ = zip(*found, strict=True) if found else ((),) * 7
    return Kinks(
        time_s=np.array(times, dtype=np.float64),
        sigma_time_s=np.array(sigmas, dtype=np.float64),
        pixel=np.array(places, dtype=np.float64).reshape(-1, 2),
        velocity_before=np.array(before, dtype=np.float64).reshape(-1, 2),
        velocity_after=np.array(after, dtype=np.float64).reshape(-1, 2),
        score=np.array(score, dtype=np.float64),
    )
