# SPDX-License-Identifier: GPL-3.0-or-later
"""A film's own time: slow motion, ramps and freezes as a map from seconds of film to seconds of the fall."""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from ...errors import InputError
from ...vectors import Array

REAL_TIME = 1.0
SAME_RATE = 1e-9


@dataclass(frozen=True)
class Slow:
    """Slow motion about a moment.

    Attributes
    ----------
    at_s : the moment [s of the fall].
    rate : seconds of the fall in a second of film, there.
    half_s : it holds for so long before and after [s of the fall].
    ramp_s : and is reached, and left, within so long [s of the fall].
    """

    at_s: float
    rate: float
    half_s: float = 0.15
    ramp_s: float = 0.25


@dataclass(frozen=True)
class Freeze:
    """The picture stands still at a moment of the fall [s], for so long [s of film]."""

    at_s: float
    film_s: float = 0.5


@dataclass(frozen=True, eq=False)
class FilmClock:
    """Which second of the fall each second of a film shows.

    Attributes
    ----------
    film_s, fall_s : (n + 1,) where the n pieces begin, and the end of the last; the film begins at 0.
    rate : (n + 1,) seconds of the fall in a second of film, at each of them; between them it is linear in the time of
        the fall. A piece of a freeze has twice the same `fall_s`.
    """

    film_s: Array
    fall_s: Array
    rate: Array

    @property
    def duration_s(self) -> float:
        """Of the film [s]."""
        return float(self.film_s[-1])

    def fall_at(self, film_s: ArrayLike) -> Array:
        """Seconds of the fall at seconds of the film (q,); held at both ends.

        Notes
        -----
        On a piece whose rate goes from r0 to r1 over L seconds of the fall, dt/df = r0 + k t with k = (r1 − r0)/L:
        t = r0 (exp(k f) − 1)/k, and r0 f where k is 0.
        """
        film = np.clip(np.asarray(film_s, dtype=np.float64).reshape(-1), 0.0, self.duration_s)
        piece = np.clip(np.searchsorted(self.film_s, film, side="right") - 1, 0, self.film_s.size - 2)
        since, length = film - self.film_s[piece], self.fall_s[piece + 1] - self.fall_s[piece]
        start, end = self.rate[piece], self.rate[piece + 1]
        with np.errstate(divide="ignore", invalid="ignore"):
            k = np.where(length > 0, (end - start) / length, 0.0)
            grown = np.where(np.abs(k) > SAME_RATE, start * np.expm1(k * since) / k, start * since)
        return self.fall_s[piece] + np.clip(np.where(length > 0, grown, 0.0), 0.0, length)

    def rate_at(self, film_s: float) -> float:
        """Seconds of the fall in a second of film at a second of the film; 0 while the picture stands still."""
        piece = int(np.clip(np.searchsorted(self.film_s, film_s, side="right") - 1, 0, self.film_s.size - 2))
        length = self.fall_s[piece + 1] - self.fall_s[piece]
        if length <= 0:
            return 0.0
        share = (float(self.fall_at(film_s)[0]) - self.fall_s[piece]) / length
        return float((1 - share) * self.rate[piece] + share * self.rate[piece + 1])


def film_clock(
    start_s: float,
    end_s: float,
    *,
    rate: float = REAL_TIME,
    slow: Iterable[Slow] = (),
    freezes: Iterable[Freeze] = (),
) -> FilmClock:
    """The clock of a film that shows the fall from one moment to another.

    Parameters
    ----------
    start_s, end_s : [s of the fall].
    rate : seconds of the fall in a second of film, outside the slow motions.
    slow : where several meet, the slowest counts.
    freezes : those outside the film are left out.

    Raises
    ------
    InputError : the film would end before it begins, a rate is not above 0, or a duration is negative.
    """
    slow = tuple(slow)
    if not (np.isfinite([start_s, end_s]).all() and end_s > start_s):
        raise InputError(
            f"A film from {start_s:g} to {end_s:g} s of the fall shows nothing",
            advice="Give it an end later than its start",
        )
    wrong = [one for one in (rate, *(each.rate for each in slow)) if not (np.isfinite(one) and one > 0)]
    if wrong:
        raise InputError(f"A film cannot run at {wrong[0]:g} times the speed of the fall", advice="Give a rate above 0")
    freezes = sorted((one for one in freezes if start_s <= one.at_s <= end_s), key=lambda one: one.at_s)
    if any(one.film_s < 0 for one in freezes) or any(one.half_s < 0 or one.ramp_s <= 0 for one in slow):
        raise InputError("A freeze, slow motion or ramp of a film has a negative duration")
    fall = _knots(start_s, end_s, rate, slow, [one.at_s for one in freezes])
    rates = _rates(fall, rate, slow)
    film_s, fall_s, rate_s = [0.0], [float(fall[0])], [float(rates[0])]
    stops = {one.at_s: one.film_s for one in freezes}

    def stand(at: float) -> None:
        if stops.get(at, 0.0) > 0:
            film_s.append(film_s[-1] + stops[at])
            fall_s.append(at)
            rate_s.append(rate_s[-1])

    stand(fall_s[0])
    for i in range(1, fall.size):
        length, before, after = fall[i] - fall[i - 1], rates[i - 1], rates[i]
        mean = before if abs(after - before) < SAME_RATE else (after - before) / np.log(after / before)
        film_s.append(film_s[-1] + float(length / mean))
        fall_s.append(float(fall[i]))
        rate_s.append(float(after))
        stand(float(fall[i]))
    return FilmClock(np.array(film_s), np.array(fall_s), np.array(rate_s))


def _knots(start_s: float, end_s: float, rate: float, slow: tuple[Slow, ...], stops: list[float]) -> Array:
    """Ascending moments between which the rate is linear [s of the fall]."""
    own = {start_s, end_s, *stops}
    for one in slow:
        reach = (one.half_s, one.half_s + one.ramp_s)
        own |= {one.at_s + side * far for side in (-1, 1) for far in reach}
    knots = np.array(sorted(moment for moment in own if start_s <= moment <= end_s))
    crossings = []
    for i, first in enumerate(slow):
        for second in slow[i + 1 :]:
            difference = _rate_of(first, knots, rate) - _rate_of(second, knots, rate)
            turn = np.flatnonzero(difference[:-1] * difference[1:] < 0)
            share = difference[turn] / (difference[turn] - difference[turn + 1])
            crossings += (knots[turn] + share * np.diff(knots)[turn]).tolist()
    return np.array(sorted({*knots.tolist(), *crossings}))


def _rate_of(one: Slow, moments: Array, rate: float) -> Array:
    away = np.abs(moments - one.at_s)
    return np.interp(away, [one.half_s, one.half_s + one.ramp_s], [min(one.rate, rate), rate])


def _rates(moments: Array, rate: float, slow: tuple[Slow, ...]) -> Array:
    lowest = np.full(moments.size, float(rate))
    for one in slow:
        lowest = np.minimum(lowest, _rate_of(one, moments, rate))
    return lowest
